"""``AutoMapper``: a blend of mappers, weighted as ``choosing`` found it on held-out labels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.learning.errors import NotFitted
from steerlab.learning.mapper import LabelMapper
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What was chosen, and why.

    Attributes:
        weights: of the mappers that are blended, the largest first; they add up to 1.
        improvement: of each candidate on the labels held out for the choice.
        blended: of the blend on the same labels.
        labels: how many these were.
        left_out: candidates that could not be fitted on what is not held out, with the reason.
    """

    weights: Mapping[str, float]
    improvement: Mapping[str, float]
    blended: float
    labels: int
    left_out: Mapping[str, str]

    def __str__(self) -> str:
        """In a sentence."""
        parts = " + ".join(f"{weight:.2g} {name}" for name, weight in self.weights.items())
        best = max(self.improvement, key=lambda name: self.improvement[name])
        return (
            f"{parts}: on {self.labels} labels of the training people that were held out it removes "
            f"{self.blended:.0%} of the error, {best} alone {self.improvement[best]:.0%}"
        )


class AutoMapper:
    """A blend of mappers that are fitted already, as ``choose`` found it.

    Args:
        mappers: by name; shared, and fitted and calibrated by whoever made them.
        choice: which of them count.
    """

    name = "auto"

    def __init__(self, mappers: Mapping[str, LabelMapper], choice: Choice) -> None:
        if missing := set(choice.weights) - set(mappers):
            raise NotFitted(f"auto blends {', '.join(sorted(missing))}, which it was not given.")
        self.choice = choice
        self.mappers = {name: mappers[name] for name in choice.weights}

    def fit(self, series: Sequence[LabelSeries]) -> None:
        """Fit the blended mappers; the choice stays."""
        for mapper in self.mappers.values():
            mapper.fit(series)

    def calibrate(self, series: Sequence[LabelSeries]) -> None:
        """Calibrate the blended mappers."""
        for mapper in self.mappers.values():
            mapper.calibrate(series)

    def map(self, series: LabelSeries) -> FloatArray:
        """Mapped labels (steps,).

        Raises:
            NotFitted, UnknownPerson: as of the mappers.
        """
        return self.blend({name: mapper.map(series) for name, mapper in self.mappers.items()})

    def blend(self, mapped: Mapping[str, FloatArray]) -> FloatArray:
        """The weighted mean of what the mappers gave, (steps,)."""
        parts = [weight * mapped[name] for name, weight in self.choice.weights.items()]
        return np.sum(parts, axis=0)

    def unlike(self, people: Sequence[str]) -> tuple[str, ...]:
        """Who of ``people`` gave labels unlike any the pre-trained mapper has seen, if it counts."""
        pretrained = self.mappers.get("sim_pretrained")
        if not isinstance(pretrained, SimPretrainedMapper):
            return ()
        return tuple(person for person in people if pretrained.is_unlike(person))
