"""Small rollouts with oracle-like labels, people who label them, and one trained mapper."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning.baselines import (
    CEILING,
    IdentityMapper,
    NoEmbeddingMapper,
    TrueStyleMapper,
    fit_baselines,
    left_out,
)
from steerlab.learning.baselines.auto import AutoMapper
from steerlab.learning.baselines.choosing import choose
from steerlab.learning.empirical_bayes.mapper import EmpiricalBayesMapper
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import MapperConfig
from steerlab.learning.series import CONTEXT, LabelSeries
from steerlab.learning.splits import StudySplit, split_rollouts, split_study
from steerlab.learning.streaming import StreamingMapper
from steerlab.learning.training import TrainingConfig
from steerlab.sim.populations import sample_population
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher
from steerlab.sim.vehicle import WHEEL_LIMIT

CONTROL_HZ = 20.0
_SMALL = TrainingConfig(share_per_epoch=0.3, least_per_epoch=1, batch_size=256)
BRIEF = MapperConfig(training=replace(_SMALL, epochs=3))
QUICK = MapperConfig(training=replace(_SMALL, epochs=40))

LabelPeople = Callable[[Sequence[ScriptedTeacher], Sequence[Rollout]], list[LabelSeries]]


def _oracle_like(rng: np.random.Generator, steps: int) -> np.ndarray:
    """Kicks that decay within a second, smoothed, and a slow wander: about 5 % saturated."""
    step_s = 1.0 / CONTROL_HZ
    kicked = np.zeros(steps)
    level, smooth = 0.0, 0.0
    for step in range(steps):
        if rng.random() < 0.5 * step_s:
            level += rng.normal(0.0, 1.6)
        level *= np.exp(-step_s / 0.9)
        smooth += step_s / 0.15 * (level - smooth)
        kicked[step] = smooth
    wander = np.convolve(rng.normal(0.0, 1.0, steps + 20), np.hanning(21) / 4.0, "valid")
    return np.clip(1.8 * kicked + 0.3 * wander, -WHEEL_LIMIT, WHEEL_LIMIT)


@pytest.fixture(scope="session")
def rollouts(make_rollout: Callable[..., Rollout]) -> tuple[Rollout, ...]:
    rng = np.random.default_rng(11)
    return tuple(make_rollout(_oracle_like(rng, 200), name=f"r{index:02d}") for index in range(8))


@pytest.fixture(scope="session")
def label_people() -> LabelPeople:
    def label(teachers: Sequence[ScriptedTeacher], rollouts: Sequence[Rollout]):
        return [
            LabelSeries(
                person=teacher.name,
                rollout=rollout.name,
                rate_hz=rollout.control_hz,
                label=teacher.respond(rollout, order=order, attempt=0),
                truth=rollout.oracle_label,
                valid=rollout.oracle_valid,
                context=np.column_stack(
                    [rollout.velocity[:, 2], rollout.velocity[:, 0], rollout.robot_wheel]
                ),
                context_names=CONTEXT,
            )
            for teacher in teachers
            for order, rollout in enumerate(rollouts)
        ]

    return label


@pytest.fixture(scope="session")
def people() -> dict[str, list[ScriptedTeacher]]:
    return {
        "seen": sample_population("low", 12, 101, prefix="seen"),
        "new": sample_population("low", 6, 101, prefix="new"),
    }


@pytest.fixture(scope="session")
def study(rollouts, label_people, people) -> StudySplit:
    series = label_people(people["seen"] + people["new"], rollouts)
    names = [rollout.name for rollout in rollouts]
    return split_study(series, split_rollouts(names), [one.name for one in people["new"]])


@pytest.fixture(scope="session")
def quick_config() -> MapperConfig:
    return QUICK


@pytest.fixture(scope="session")
def trained(study: StudySplit) -> MindMeldMapper:
    """Fitted on the seen people and calibrated on the new ones; treat as read-only."""
    mapper = MindMeldMapper(QUICK, seed=5)
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    return mapper


@pytest.fixture(scope="session")
def streaming(study: StudySplit) -> StreamingMapper:
    """Waits 0.2 s; barely trained, since what it must equal is itself. Treat as read-only."""
    mapper = StreamingMapper(0.2, BRIEF, seed=5)
    mapper.fit(study.train_seen)
    mapper.calibrate(study.calibrate_new)
    return mapper


@pytest.fixture(scope="session")
def ladder(
    study: StudySplit, trained: MindMeldMapper, streaming: StreamingMapper, people
) -> dict[str, LabelMapper]:
    """Every baseline; those that train a network beyond MIND MELD's do so briefly."""
    without = left_out([study], trained.config, full=False)
    baselines = fit_baselines(trained, study, seed=5, on_step=lambda share: None, without=without)
    styles = {one.name: one.style for group in people.values() for one in group}
    trained_apart = (
        NoEmbeddingMapper(BRIEF, seed=5),
        MindMeldMapper(BRIEF, seed=5, name="mind_meld_paper"),
        MindMeldMapper(BRIEF, seed=5, name="mind_meld_paper_text"),
        TrueStyleMapper(styles, BRIEF, seed=5),
    )
    for mapper in trained_apart:
        mapper.fit(study.train_seen)
        mapper.calibrate(study.calibrate_new)
        baselines[mapper.name] = mapper
    builders = {"identity": IdentityMapper, "eb_nonlinear": EmpiricalBayesMapper}
    choice = replace(
        choose(study.train_seen, builders, seed=5),
        weights={"eb_nonlinear": 0.75, "mind_meld": 0.25},
    )
    baselines["auto"] = AutoMapper(baselines, choice)
    assert CEILING in baselines
    return baselines | {streaming.name: streaming}
