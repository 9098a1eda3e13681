"""Is a mapped label as wrong as ``sim_pretrained`` says? ``python -m benchmarks.expected_error``.

34 + 34 scripted people, population seeds 0 to 4, by noise, people and what the mapper reads. Drives
differ in how hard they are, so each of the twelve is held out once: four folds, nine drives to fit
and calibrate on. A row compares the stated with the actual absolute error, or the share of truths
within an interval with the share it claims. The network is not fine-tuned.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.pretrained import LEAST, SEEDS, rank_correlation, sample_people, study_split
from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import RolloutSplit, StudySplit, split_study
from steerlab.sim.arrays import FloatArray
from steerlab.sim.populations import PopulationKind

SHARES = (0.5, 0.8, 0.95)
MOST_OFF = 0.05  # of a coverage
MOST_OFF_MEAN = 0.15  # stated over actual, minus 1
LEAST_RANK_CORRELATION = 0.4
DECILES = 10
FOLDS = 4


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Of many labels: the network's error, the scaled and the actual one, inside ``SHARES``, drive."""

    network: FloatArray
    stated: FloatArray
    actual: FloatArray
    inside: FloatArray
    drive: np.ndarray

    @classmethod
    def concatenate(cls, parts: list["Errors"]) -> "Errors":
        """Labels one after another."""
        names = ("network", "stated", "actual", "inside", "drive")
        return cls(
            **{name: np.concatenate([getattr(one, name) for one in parts]) for name in names}
        )


def run() -> list[Row]:
    """Every noise level, with and without context, seen and new people."""
    rows: list[Row] = []
    for kind in LEAST:
        found: dict[tuple[bool, str], list[Errors]] = {}
        for seed in SEEDS:
            for split in folds(kind, seed):
                for context in (False, True):
                    mapper = SimPretrainedMapper(context=context, fine_tuning=None)
                    mapper.fit(split.train_seen)
                    mapper.calibrate(split.calibrate_new)
                    for part in ("seen", "new"):
                        errors = measured(mapper, getattr(split, f"held_out_{part}"))
                        found.setdefault((context, part), []).append(errors)
        for (context, part), parts in sorted(found.items()):
            name = f"{kind}, {'context' if context else 'labels'}, {part}"
            rows += _rows(name, Errors.concatenate(parts))
    return rows


def folds(kind: PopulationKind, seed: int) -> Iterator[StudySplit]:
    """One population's labels with each drive held out once."""
    people = sample_people(kind, seed)
    split = study_split(people)
    series = [*split.train_seen, *split.held_out_seen, *split.calibrate_new, *split.held_out_new]
    names = sorted({one.rollout for one in series})
    for fold in range(FOLDS):
        held_out = tuple(names[fold::FOLDS])
        train = tuple(name for name in names if name not in held_out)
        yield split_study(
            series,
            RolloutSplit(train=train, held_out=held_out),
            [teacher.name for teacher in people[1]],
        )


def measured(mapper: SimPretrainedMapper, series: tuple[LabelSeries, ...]) -> Errors:
    """Stated and actual errors of valid labels."""
    half_widths = np.array([mapper.error_scale.half_width(share) for share in SHARES])
    parts: list[Errors] = []
    for one in series:
        mapped, stated = mapper.map_with_spread(one)
        actual = np.abs(mapped - one.truth)
        network = stated / mapper.error_scale.factor
        parts.append(
            Errors(
                network=network[one.valid],
                stated=stated[one.valid],
                actual=actual[one.valid],
                inside=(actual[:, None] <= half_widths * network[:, None])[one.valid].astype(float),
                drive=np.full(int(one.valid.sum()), one.rollout),
            )
        )
    return Errors.concatenate(parts)


def show(name: str, found: Errors) -> None:
    """Stated over actual error, all in all, by decile of the stated one and by drive."""
    deciles = np.array_split(np.argsort(found.stated), DECILES)
    drives = [np.flatnonzero(found.drive == drive) for drive in np.unique(found.drive)]
    everything = np.arange(len(found.stated))
    print(name)
    for what, parts in (("all", [everything]), ("deciles", deciles), ("drives", drives)):
        for source in ("network", "stated"):
            ratios = [
                getattr(found, source)[part].sum() / found.actual[part].sum() for part in parts
            ]
            text = " ".join(f"{one:.2f}" for one in ratios)
            print(f"  {source} / actual, {what}: {text}", flush=True)


def _rows(name: str, found: Errors) -> list[Row]:
    show(name, found)
    off = abs(float(found.stated.sum() / found.actual.sum()) - 1.0)
    rows = [at_most(f"{name}: mean off by", off, MOST_OFF_MEAN)]
    for share, inside in zip(SHARES, found.inside.mean(axis=0).tolist(), strict=True):
        print(f"  {share:.0%} interval holds {inside:.1%}", flush=True)
        rows.append(at_most(f"{name}: {share:.0%} interval off by", abs(inside - share), MOST_OFF))
    correlation = rank_correlation(found.stated, found.actual)
    rows.append(at_least(f"{name}: rank correlation", correlation, LEAST_RANK_CORRELATION))
    return rows


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
