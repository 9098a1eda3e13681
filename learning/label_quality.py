"""How much better labels became: ratios of sums, over people, with a bootstrap interval."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries
from steerlab.sim.arrays import FloatArray

if TYPE_CHECKING:
    from steerlab.learning.mapper import LabelMapper

RESAMPLES = 2000
_FLOATS_AT_ONCE = 4_000_000


@dataclass(frozen=True, kw_only=True)
class LabelQuality:
    """Errors of labels before and after mapping.

    Attributes:
        mae_before, mae_after: mean absolute error of raw and of mapped labels, wheel units.
        improvement: ``1 - sum|mapped - o| / sum|a - o|`` over all labels.
        ci95: of ``improvement``; percentile bootstrap over people, NaN for a single person.
        person_median: median over people of each one's own improvement.
        people_improved: share of people whose summed error fell.
        labels_worsened: share of labels whose error grew.
        per_sample_percent: the paper's figure, the mean over labels of
            ``100 (|e| - |e'|) / |e|``. Errors near 0 dominate it (labels with e = 0 are left out);
            it is here for comparison with the paper only.
    """

    people: int
    labels: int
    mae_before: float
    mae_after: float
    improvement: float
    ci95: tuple[float, float]
    person_median: float
    people_improved: float
    labels_worsened: float
    per_sample_percent: float


def label_quality(
    person: np.ndarray,
    raw: FloatArray,
    mapped: FloatArray,
    truth: FloatArray,
    rng: np.random.Generator,
) -> LabelQuality:
    """Compare raw and mapped labels with the truth; all arrays (labels,), valid steps only.

    Raises:
        InvalidLabels: lengths differ, nothing is there, a value is not finite (a masked step?), or
            the raw labels have no error at all, so that no improvement is defined.
    """
    if not (len(person) == len(raw) == len(mapped) == len(truth) > 0):
        raise InvalidLabels(
            f"person, raw, mapped and truth hold {len(person)}, {len(raw)}, {len(mapped)} and "
            f"{len(truth)} labels; give as many of each, at least one."
        )
    for name, values in (("raw", raw), ("mapped", mapped), ("truth", truth)):
        if not np.isfinite(values).all():
            raise InvalidLabels(f"{name} has a value that is not finite; leave out masked steps.")
    before, after = np.abs(raw - truth), np.abs(mapped - truth)
    _, index = np.unique(person, return_inverse=True)
    ratios, labels_with_error = _ratios(before, after)
    return _quality(
        np.bincount(index, weights=before).astype(np.float64),
        np.bincount(index, weights=after).astype(np.float64),
        labels=len(raw),
        total_before=float(before.sum()),
        total_after=float(after.sum()),
        worsened=int((after > before).sum()),
        ratio=ratios / max(labels_with_error, 1),
        rng=rng,
    )


class LabelSums:
    """What ``label_quality`` needs of labels, added up a series at a time.

    Labels themselves are not kept, so a table of any length takes a few numbers a person.
    """

    def __init__(self) -> None:
        self._people: dict[str, tuple[float, float]] = {}
        self._labels = self._worsened = self._with_error = 0
        self._ratios = 0.0

    def add(self, person: str, raw: FloatArray, mapped: FloatArray, truth: FloatArray) -> None:
        """Add labels of one person; all arrays (labels,), valid steps only.

        Raises:
            InvalidLabels: a mapped label is not finite.
        """
        if not np.isfinite(mapped).all():
            raise InvalidLabels(f"A mapped label of {person!r} is not finite.")
        before, after = np.abs(raw - truth), np.abs(mapped - truth)
        ratios, with_error = _ratios(before, after)
        was_before, was_after = self._people.get(person, (0.0, 0.0))
        self._people[person] = was_before + float(before.sum()), was_after + float(after.sum())
        self._labels += len(before)
        self._worsened += int((after > before).sum())
        self._with_error += with_error
        self._ratios += ratios

    def quality(self, rng: np.random.Generator) -> LabelQuality:
        """The quality over everything added.

        Raises:
            InvalidLabels: nothing was, or the raw labels have no error at all.
        """
        if not self._labels:
            raise InvalidLabels("No label was added; there is nothing to judge.")
        sums = np.array(list(self._people.values()))
        return _quality(
            sums[:, 0],
            sums[:, 1],
            labels=self._labels,
            total_before=float(sums[:, 0].sum()),
            total_after=float(sums[:, 1].sum()),
            worsened=self._worsened,
            ratio=self._ratios / max(self._with_error, 1),
            rng=rng,
        )


def mapper_quality(
    mapper: "LabelMapper", series: Sequence[LabelSeries], rng: np.random.Generator
) -> LabelQuality:
    """Quality of ``mapper`` on the valid steps of ``series``.

    Raises:
        InvalidLabels: no valid step, or see ``label_quality``.
        UnknownPerson: someone was neither fitted nor calibrated.
    """
    if not series:
        raise InvalidLabels("No label series to score; give at least one.")
    columns = [
        (
            np.full(drive.valid.sum(), drive.person),
            drive.label[drive.valid],
            mapped[drive.valid],
            drive.truth[drive.valid],
        )
        for drive, mapped in ((drive, mapper.map(drive)) for drive in series)
    ]
    person, raw, mapped, truth = (np.concatenate(column) for column in zip(*columns, strict=True))
    return label_quality(person, raw, mapped, truth, rng)


def two_way_ci95(
    before: FloatArray, after: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of ``1 - sum(after) / sum(before)`` over other people *and* other drives.

    People and drives are drawn independently, each with all of their labels, and a cell counts as
    often as its person times its drive were drawn (the pigeonhole bootstrap: Owen, Annals of Applied
    Statistics 1(2), 2007, which shows it to be a little too wide rather than too narrow).

    Args:
        before, after: (people, drives) summed errors of raw and of mapped labels; 0 in both where a
            person was not scored on a drive. A draw that meets only such cells is left out.

    Returns:
        Percentiles 2.5 and 97.5 of ``RESAMPLES`` draws; NaN for one person or one drive.

    Raises:
        InvalidLabels: shapes differ, a sum is negative or not finite, or there is no error at all.
    """
    if before.ndim != 2 or before.shape != after.shape:
        raise InvalidLabels(
            f"before and after are {before.shape} and {after.shape}; give (people, drives) of both."
        )
    sums = np.stack([before, after])
    if not (np.isfinite(sums).all() and (sums >= 0.0).all()):
        raise InvalidLabels(
            "A summed error is negative or not finite; give sums of |label - truth|."
        )
    if not before.any():
        raise InvalidLabels("The raw labels equal the truth; no improvement is defined.")
    people, drives = before.shape
    if people < 2 or drives < 2:
        return float("nan"), float("nan")
    person = rng.multinomial(people, np.full(people, 1.0 / people), size=RESAMPLES)
    drive = rng.multinomial(drives, np.full(drives, 1.0 / drives), size=RESAMPLES)
    drawn = np.einsum("rp,spd,rd->sr", person, sums, drive, optimize=True)
    drawn = drawn[:, drawn.any(axis=0)]
    low, high = np.percentile(_improvement(*drawn), [2.5, 97.5], method="nearest")
    return float(low), float(high)


def _ratios(before: FloatArray, after: FloatArray) -> tuple[float, int]:
    """Sum of ``(|e| - |e'|) / |e|`` over labels with an error, and how many those are."""
    wrong = before > 0.0
    return float(((before[wrong] - after[wrong]) / before[wrong]).sum()), int(wrong.sum())


def _quality(
    before: FloatArray,
    after: FloatArray,
    *,
    labels: int,
    total_before: float,
    total_after: float,
    worsened: int,
    ratio: float,
    rng: np.random.Generator,
) -> LabelQuality:
    """The quality from sums; before and after are (people,)."""
    if total_before == 0.0:
        raise InvalidLabels("The raw labels equal the truth; no improvement is defined.")
    return LabelQuality(
        people=len(before),
        labels=labels,
        mae_before=total_before / labels,
        mae_after=total_after / labels,
        improvement=1.0 - total_after / total_before,
        ci95=_bootstrap_ci95(before, after, rng),
        person_median=float(np.median(_improvement(before, after))),
        people_improved=float((after < before).mean()),
        labels_worsened=worsened / labels,
        per_sample_percent=100.0 * ratio,
    )


def _improvement(before: FloatArray, after: FloatArray) -> FloatArray:
    """``1 - after / before``; where before is 0: 0 if it stayed so, else minus infinity."""
    faultless = np.where(after > 0.0, -np.inf, 0.0)
    return np.where(before > 0.0, 1.0 - after / np.where(before > 0.0, before, 1.0), faultless)


def _bootstrap_ci95(
    before: FloatArray, after: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    people = len(before)
    if people < 2:
        return float("nan"), float("nan")
    ratios: list[FloatArray] = []
    rows = max(1, _FLOATS_AT_ONCE // people)
    for start in range(0, RESAMPLES, rows):
        drawn = rng.integers(people, size=(min(rows, RESAMPLES - start), people))
        ratios.append(_improvement(before[drawn].sum(axis=1), after[drawn].sum(axis=1)))
    # An order statistic, not an interpolation: a resample may be minus infinity.
    low, high = np.percentile(np.concatenate(ratios), [2.5, 97.5], method="nearest")
    return float(low), float(high)
