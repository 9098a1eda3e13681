"""The summary of a simulated study: the numbers that its JSON file and its report both show."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from numbers import Integral, Real
from typing import Any, Self

from steerlab.learning.label_quality import LabelQuality
from steerlab.sim.errors import InvalidValue, SteerlabError
from steerlab.sim.files.run_folder import finite_json
from steerlab.sim.files.structured import json_values, structured, versioned, within_file

SUMMARY_SCHEMA = 1
DIGITS = 6  # floats in JSON: below this, two machines may differ for the same seed
SPLITS = ("seen", "new")
STYLES = ("gain", "delay")
MAPPER = "mind_meld"


class InvalidSummary(SteerlabError, ValueError):
    """The results have no summary: nobody is left to judge, or a number is not defined."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SplitSummary:
    """Results over the people of one split, on rollouts held out from training.

    Attributes:
        people: how many teachers.
        labels: how many held-out labels.
        mae_before, mae_after: mean |label - oracle| of raw and of mapped labels, in wheel units.
        improvement: by method, ``1 - sum|mapped - o| / sum|a - o|``.
        ci95: bootstrap interval of MIND MELD's improvement, over people.
        person_median: median over people of each one's own improvement.
        people_improved: share of people whose summed error fell, 0 to 1.
        labels_worsened: share of labels that moved away from the oracle's, 0 to 1.
        per_sample_percent: the paper's mean of per-sample ratios; for comparison only.
    """

    people: int
    labels: int
    mae_before: float
    mae_after: float
    improvement: Mapping[str, float]
    ci95: tuple[float, float]
    person_median: float
    people_improved: float
    labels_worsened: float
    per_sample_percent: float

    @classmethod
    def of(cls, ladder: Mapping[str, LabelQuality], unit: float = 1.0) -> Self:
        """From the quality of each method on one split.

        Args:
            ladder: by method, MIND MELD among them.
            unit: what one wheel unit is in the units to report errors in.

        Raises:
            InvalidSummary: so many people label without any error that the median person has no
                improvement.
        """
        best = ladder[MAPPER]
        if not isfinite(best.person_median) or not isfinite(best.ci95[0]):
            raise InvalidSummary(
                f"Too many of the {best.people} people gave labels without any error, which "
                f"nothing can improve: the median person’s improvement, or its interval, is not "
                f"defined. Leave such people out."
            )
        return cls(
            people=best.people,
            labels=best.labels,
            mae_before=unit * best.mae_before,
            mae_after=unit * best.mae_after,
            improvement={method: quality.improvement for method, quality in ladder.items()},
            ci95=best.ci95,
            person_median=best.person_median,
            people_improved=best.people_improved,
            labels_worsened=best.labels_worsened,
            per_sample_percent=best.per_sample_percent,
        )

    def __post_init__(self) -> None:
        for name in ("people", "labels"):
            if getattr(self, name) < 1:
                raise InvalidValue(name, getattr(self, name), "1 or more")
        for name in ("mae_before", "mae_after", "person_median", "per_sample_percent"):
            _check_finite(name, getattr(self, name))
        for name in ("people_improved", "labels_worsened"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidValue(name, getattr(self, name), "a share, from 0 to 1")
        for method, value in self.improvement.items():
            _check_finite(f"improvement.{method}", value)
        if MAPPER not in self.improvement:
            allowed = f"of several methods, one of them {MAPPER!r}"
            raise InvalidValue("improvement", sorted(self.improvement), allowed)
        for index, limit in enumerate(self.ci95):
            _check_finite(f"ci95[{index}]", limit)
        if self.ci95[0] > self.ci95[1]:
            raise InvalidValue("ci95", [*self.ci95], "the lower limit first, then the upper one")


@dataclass(frozen=True, kw_only=True, slots=True)
class StyleSummary:
    """How well the embedding holds one style parameter; None where it could not be measured.

    Attributes:
        probe_r2: R² of a linear probe from embeddings to the parameter.
        spearman_new: rank correlation of the probe's guess and the truth, over new people.
    """

    probe_r2: float | None
    spearman_new: float | None

    def __post_init__(self) -> None:
        for name in ("probe_r2", "spearman_new"):
            value = getattr(self, name)
            if value is not None:
                _check_finite(name, value)


@dataclass(frozen=True, kw_only=True, slots=True)
class Summary:
    """One simulated study in numbers; ``seconds`` and ``versions`` differ between equal runs.

    Attributes:
        left_out: methods that were not judged, and why, as a clause.

    Raises:
        InvalidValue: a split or style is missing, the splits have different methods, or a method
            is both judged and left out.
    """

    seed: int
    noise: str
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    splits: Mapping[str, SplitSummary]
    style: Mapping[str, StyleSummary]
    left_out: Mapping[str, str]
    verb: str = "simulate"

    def __post_init__(self) -> None:
        for name, given, wanted in (
            ("splits", self.splits, SPLITS),
            ("style", self.style, STYLES),
        ):
            if set(given) != set(wanted):
                raise InvalidValue(name, sorted(given), f"of {' and '.join(sorted(wanted))}")
        for name, value in self.seconds.items():
            _check_finite(f"seconds.{name}", value)
        methods = [set(self.splits[split].improvement) for split in SPLITS]
        if methods[0] != methods[1]:
            odd = sorted(methods[0] ^ methods[1])
            raise InvalidValue("splits", odd, "methods of both splits, not of one only")
        if both := sorted(methods[0] & set(self.left_out)):
            allowed = "of methods that are not judged, which this one is"
            raise InvalidValue(f"left_out.{both[0]}", self.left_out[both[0]], allowed)

    def reproducible(self) -> dict[str, Any]:
        """What the same seed must give again: everything but ``versions`` and ``seconds``."""
        volatile = ("versions", "seconds")
        return {name: value for name, value in self.to_dict().items() if name not in volatile}

    def to_dict(self) -> dict[str, Any]:
        """Plain values in a fixed order, floats rounded to ``DIGITS``."""
        return rounded(
            {
                "schema": SUMMARY_SCHEMA,
                "verb": self.verb,
                "seed": self.seed,
                "noise": self.noise,
                "versions": dict(sorted(self.versions.items())),
                "seconds": dict(sorted(self.seconds.items())),
                "splits": {name: asdict(self.splits[name]) for name in SPLITS},
                "left_out": dict(sorted(self.left_out.items())),
                "style": {name: asdict(self.style[name]) for name in STYLES},
            }
        )

    def to_json(self) -> str:
        """The summary as JSON: equal summaries give equal text."""
        return summary_json(self.to_dict())

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The inverse of ``to_json``, up to rounding.

        Raises:
            InvalidConfig: the text is no JSON, of another schema, or a value is missing, unknown
                or wrong; the message names the place.
        """
        values = json_values(text, "The summary")
        with within_file(""):
            return structured(cls, versioned(cls, values, "schema", SUMMARY_SCHEMA))


def _check_finite(path: str, value: float) -> None:
    if not isfinite(value):
        raise InvalidValue(path, value, "a finite number")


def summary_json(values: Mapping[str, Any]) -> str:
    """The text of ``summary.json``; a NaN is refused."""
    return finite_json(values, "summary.json", indent=2) + "\n"


def rounded(value: Any) -> Any:
    """``value`` as JSON has it, with floats rounded to ``DIGITS``."""
    if isinstance(value, Mapping):
        return {name: rounded(item) for name, item in value.items()}
    if isinstance(value, tuple | list):
        return [rounded(item) for item in value]
    if isinstance(value, Integral):
        return int(value)  # numpy's are no JSON
    if isinstance(value, Real):
        return round(float(value), DIGITS) + 0.0  # + 0.0: "-0.0" and "0.0" are one number
    return value
