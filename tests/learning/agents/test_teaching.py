"""Rounds of driving, labels and training on the real thing, as short as they go."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning.agents import (
    BallNeverReached,
    Judging,
    TaskEnv,
    TeachingConfig,
    demonstrate_offline,
    evaluate,
    make_agent,
    teach_offline,
)
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.gates import LearnerDrives, TeacherDrives
from steerlab.learning.agents.label_rules import WhereTeacherDrives
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingDiverged
from steerlab.sim.rollout import Outcome
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle
from steerlab.sim.tasks import draw_task_start, make_task

pytestmark = [pytest.mark.render]
GOOD = ScriptedTeacher("good", TeacherStyle(constant_noise=0.05), seed=1)
CONFIG = TeachingConfig(rounds=1, training=PolicyTrainingConfig(steps=5))


@pytest.fixture(scope="module")
def env():
    with TaskEnv(make_task("easy"), seed=0) as made:
        yield made


@pytest.fixture(scope="module")
def demonstration(env):
    return demonstrate_offline(env, GOOD, CONFIG, seed=0)[0]


def _judging(env, count=1) -> Judging:
    starts = [draw_task_start(env.task, "test", number) for number in range(count)]
    return Judging(on_the_way=starts[:1], at_the_end=starts)


def _teach(env, agent, demonstration, config=CONFIG, seed=0):
    return teach_offline(
        env, agent, GOOD, demonstration, _judging(env), config, seed=seed,
        progress=lambda share: None,
    )  # fmt: skip


def test_a_demonstration_is_redone_until_it_reaches_the_ball(env, demonstration, monkeypatch):
    assert demonstration.outcome is Outcome.BALL_REACHED
    assert demonstration.teacher_drives.all()
    assert np.isfinite(demonstration.live).all()
    from steerlab.learning.agents import offline

    real, tries = offline.play, []

    def short(drive, *arguments):
        episode = real(drive, *arguments)
        tries.append(drive.start.noise[0])
        if len(tries) == 1:
            failed = replace(episode.rollout, outcome=Outcome.BLOCK_HIT)
            return replace(episode, rollout=failed)
        return episode

    monkeypatch.setattr(offline, "play", short)
    _, failed = demonstrate_offline(env, GOOD, CONFIG, seed=0)
    assert failed == 1
    assert tries[0] != tries[1]  # with other noise


def test_a_teacher_who_never_arrives_is_said_to_be_so():
    wrong_way = ScriptedTeacher("lost", TeacherStyle(bias=2.4), seed=0)
    config = replace(CONFIG, tries=2)
    with (
        TaskEnv(make_task("easy"), seed=0) as env,
        pytest.raises(BallNeverReached, match="lost did not reach the ball of task 'easy' in 2"),
    ):
        demonstrate_offline(env, wrong_way, config, seed=0)


@pytest.mark.slow
def test_what_everyone_meets_depends_on_the_seed_alone(env, demonstration):
    _, one = _teach(env, make_agent("dagger", {}), demonstration)
    _, two = _teach(env, make_agent("oracle", {}), demonstration)
    assert (one[1].episode.rollout.pose[0] == two[1].episode.rollout.pose[0]).all()
    assert one[0].episode is two[0].episode
    assert two[0].label_mae == 0.0 < one[0].label_mae
    _, again = _teach(env, make_agent("dagger", {}), demonstration)
    assert (one[1].episode.rollout.pose == again[1].episode.rollout.pose).all()
    assert [drive.final_distance_m for drive in one[-1].drives] == [
        drive.final_distance_m for drive in again[-1].drives
    ]


def test_a_gate_that_lets_no_label_through_leaves_the_policy_as_it_is(env, demonstration):
    nobody = Agent(name="nobody", gate=LearnerDrives(), rule=WhereTeacherDrives())
    learner, (first, second) = _teach(env, nobody, demonstration)
    assert second.labels_asked == 0
    assert second.loss is None
    assert second.label_mae is None
    assert second.teacher_seconds == 0.0
    seen = demonstration.seen
    untaught, _ = _teach(env, nobody, demonstration, replace(CONFIG, evaluate_every=5))
    assert (learner.act(seen) == untaught.act(seen)).all()
    assert first.labels_asked == len(demonstration.rows)


def test_what_a_round_costs_is_counted(env, demonstration):
    bc = Agent(name="bc", gate=TeacherDrives(), rule=WhereTeacherDrives())
    _, (_, second) = _teach(env, bc, demonstration)
    assert second.labels_asked == len(second.episode.rows)
    assert second.teacher_seconds == pytest.approx(0.1 * second.labels_asked)
    assert second.switches == 0


def test_a_loss_that_is_no_number_stops_the_learner(env, demonstration):
    wild = replace(CONFIG, training=PolicyTrainingConfig(steps=40, rate=1e30))
    with pytest.raises(TrainingDiverged, match="lower the rate"):
        _teach(env, make_agent("dagger", {}), demonstration, wild)


def test_judging_in_lock_step_is_judging_one_by_one(env, demonstration):
    learner, _ = _teach(env, make_agent("dagger", {}), demonstration)
    starts = [draw_task_start(env.task, "lock", number) for number in range(2)]
    together = evaluate(env, learner, starts)
    alone = [evaluate(env, learner, [start])[0] for start in starts]
    for one, other in zip(together, alone, strict=True):
        assert one.outcome is other.outcome
        assert one.path_m == pytest.approx(other.path_m, abs=0.01)  # sums in another order
