"""A calibration study with scripted teachers: label, fit, calibrate, score."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Literal, get_args

import numpy as np
import pyarrow as pa

from steerlab.learning.baselines import fit_baselines, left_out
from steerlab.learning.label_quality import LabelQuality, mapper_quality
from steerlab.learning.mapper import LabelMapper, MindMeldMapper, stack_embeddings
from steerlab.learning.presets import preset
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import StudySplit, split_rollouts, split_study
from steerlab.sim.arrays import FloatArray
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import PopulationKind, sample_population
from steerlab.sim.progress import Progress
from steerlab.sim.records import labelled_table
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.teleop.loop import label_rollout

Ladder = Literal["full", "quick"]
"""Which baselines: all, or those that need no further training of a network."""


@dataclass(frozen=True, kw_only=True)
class PopulationRunConfig:
    """Who labels what, and how it is learned."""

    teachers: int = 34  # the paper's number of training participants
    new_teachers: int = 34
    noise: PopulationKind = "human"
    rollouts: int = 12
    preset: str = "lab"
    ladder: Ladder = "full"
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("teachers", 3), ("new_teachers", 2), ("rollouts", 4), ("seed", 0)):
            if getattr(self, name) < least:
                raise InvalidConfig(
                    f"{name.replace('_', '-')} is {getattr(self, name)}; it must be at least "
                    f"{least}."
                )
        preset(self.preset)
        if self.ladder not in get_args(Ladder):
            raise InvalidConfig(
                f"ladder is {self.ladder!r}; choose one of {', '.join(get_args(Ladder))}."
            )


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Quality of every mapper on one split; (people,) errors of MIND MELD's for the figure."""

    ladder: dict[str, LabelQuality]
    people_before: FloatArray
    people_after: FloatArray


@dataclass(frozen=True, kw_only=True)
class PopulationResult:
    """Everything a population run found; what is written and shown is made from this."""

    config: PopulationRunConfig
    rollouts: tuple[Rollout, ...]
    seen: list[ScriptedTeacher]
    new: list[ScriptedTeacher]
    labels: dict[str, pa.Table]  # by split
    parts: StudySplit
    mapper: MindMeldMapper
    scores: dict[str, Scores]  # by split
    left_out: dict[str, str]  # baselines that were not judged, and why
    probe: StyleProbe | None
    spearman_new: dict[str, float]
    seconds: dict[str, float]

    def embeddings(self, teachers: Sequence[ScriptedTeacher]) -> FloatArray:
        """(people, d)."""
        return stack_embeddings(self.mapper, [teacher.name for teacher in teachers])


def run_population(config: PopulationRunConfig, progress: Progress) -> PopulationResult:
    """Run the study; the same config gives the same labels and figures.

    Raises:
        InvalidConfig: the calibration set has fewer rollouts than asked for.
    """
    rollouts = load_calibration_set()
    if config.rollouts > len(rollouts):
        raise InvalidConfig(
            f"rollouts is {config.rollouts}; the calibration set has {len(rollouts)}."
        )
    rollouts = rollouts[: config.rollouts]
    seconds: dict[str, float] = {}
    started = perf_counter()
    seen = sample_population(config.noise, config.teachers, config.seed, prefix="seen")
    new = sample_population(config.noise, config.new_teachers, config.seed, prefix="new")
    labels = {
        split: pa.concat_tables(_label(rollouts, people, split, progress))
        for split, people in (("seen", seen), ("new", new))
    }
    series = [one for table in labels.values() for one in series_from_table(table)]
    names = [rollout.name for rollout in rollouts]
    parts = split_study(series, split_rollouts(names), [teacher.name for teacher in new])
    seconds["label"] = perf_counter() - started

    started = perf_counter()
    mapper = MindMeldMapper(
        preset(config.preset),
        seed=config.seed,
        on_epoch=lambda done, all_: progress("training MIND MELD", done / all_),
    )
    mapper.fit(parts.train_seen)
    seconds["fit"] = perf_counter() - started

    started = perf_counter()
    progress("calibrating new teachers", 0.0)
    mapper.calibrate(parts.calibrate_new)
    progress("calibrating new teachers", 1.0)
    seconds["calibrate"] = perf_counter() - started

    started = perf_counter()
    without = left_out(
        [parts], preset(config.preset), full=config.ladder == "full", styles_known=True
    )
    ladder = fit_baselines(
        mapper,
        parts,
        seed=config.seed,
        on_step=lambda share: progress("fitting rival mappers", share),
        without=without,
        styles={teacher.name: teacher.style for teacher in (*seen, *new)},
    )
    seconds["ladder"] = perf_counter() - started

    started = perf_counter()
    scores = {
        split: _score(ladder, mapper, held_out, config.seed)
        for split, held_out in (("seen", parts.held_out_seen), ("new", parts.held_out_new))
    }
    probe, spearman_new = _probe(mapper, seen, new)
    seconds["score"] = perf_counter() - started
    return PopulationResult(
        config=config,
        rollouts=rollouts,
        seen=seen,
        new=new,
        labels=labels,
        parts=parts,
        mapper=mapper,
        scores=scores,
        left_out=without,
        probe=probe,
        spearman_new=spearman_new,
        seconds=seconds,
    )


def _label(
    rollouts: Sequence[Rollout], teachers: Sequence[ScriptedTeacher], split: str, progress: Progress
) -> list[pa.Table]:
    tables: list[pa.Table] = []
    for done, teacher in enumerate(teachers, start=1):
        for order, rollout in enumerate(rollouts):
            labels = label_rollout(rollout, teacher, order=order)
            tables.append(labelled_table(rollout, labels, participant=teacher.name))
        progress(f"{split} teachers correct the rollouts", done / len(teachers))
    return tables


def _score(
    ladder: Mapping[str, LabelMapper],
    mapper: LabelMapper,
    held_out: Sequence[LabelSeries],
    seed: int,
) -> Scores:
    people = sorted({one.person for one in held_out})
    sums = {person: np.zeros(3) for person in people}  # before, after, steps
    for one in held_out:
        mapped = mapper.map(one)
        before = np.abs(one.label - one.truth)[one.valid]
        after = np.abs(mapped - one.truth)[one.valid]
        sums[one.person] += before.sum(), after.sum(), len(before)
    table = np.array([sums[person] for person in people])
    return Scores(
        ladder={
            name: mapper_quality(one, held_out, np.random.default_rng(seed))
            for name, one in ladder.items()
        },
        people_before=table[:, 0] / table[:, 2],
        people_after=table[:, 1] / table[:, 2],
    )


def _probe(
    mapper: MindMeldMapper, seen: Sequence[ScriptedTeacher], new: Sequence[ScriptedTeacher]
) -> tuple[StyleProbe | None, dict[str, float]]:
    """None with too few people to probe, which the report then says."""
    embeddings = stack_embeddings(mapper, [teacher.name for teacher in seen])
    if len(seen) < embeddings.shape[1] + 3:
        return None, {}
    probe = StyleProbe.fit(embeddings, style_parameters([teacher.style for teacher in seen]))
    new_embeddings = stack_embeddings(mapper, [teacher.name for teacher in new])
    return probe, probe.spearman_new(
        new_embeddings, style_parameters([teacher.style for teacher in new])
    )
