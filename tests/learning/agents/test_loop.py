"""The loop that everyone teaches in, with a teacher who is made up: no simulator, no camera."""

from dataclasses import replace

import numpy as np
import pytest

from steerlab.learning.agents import Judging, TaskEnv, TeachingConfig, TeachingLoop, TeachingSpec
from steerlab.learning.agents.catalogue import dagger, oracle
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.drive import HeldGate, Robot
from steerlab.learning.agents.episode import label_errors, make_episode, make_rollout
from steerlab.learning.agents.gates import LearnerDrives, TeacherDrives
from steerlab.learning.agents.label_rules import WhereTeacherDrives
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.offline import MemoryLog
from steerlab.learning.agents.teaching import BallNeverReached, NothingShown, RoundDiverged
from steerlab.learning.agents.teaching_contract import AfterRest
from steerlab.learning.policy import IMAGE_SHAPE, Observations
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingDiverged
from steerlab.sim.engine.driving import Driving
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.progress import no_progress
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import make_task

DECISIONS = 12
CONFIG = TeachingConfig(
    rounds=2, evaluate_every=1, tries=3, training=PolicyTrainingConfig(steps=3, batch_size=4)
)


class Nowhere:
    """As much of a ``TaskEnv`` as a loop needs that drives nothing."""

    seed = 0
    task = make_task("easy")
    context = TaskEnv.context


class MadeUp:
    """Drives that depend on round and attempt; ``plan`` says what comes of each rest.

    A plan's entry is what the teacher wants, or ``"early"`` and that: before anything is learnt.
    """

    def __init__(self, env, log, plan=(), *, outcomes=(), wheel=0.3):
        self._env, self._log, self._wheel = env, log, wheel
        self._plan, self._outcomes = list(plan), list(outcomes)
        self.drives, self.waited = [], []

    def drive(self, drive):
        self.drives.append((drive.number, drive.context.attempt, drive.failed, drive.tries_left))
        context = drive.context
        rng = np.random.default_rng([drive.number, context.attempt])
        steps, driven = 2 * DECISIONS, drive.gate.who_drives(None) is Driver.TEACHER
        given = np.full(steps, self._wheel) + 0.1 * drive.number
        rollout = make_rollout(
            self._env,
            context.name,
            self._outcomes.pop(0) if self._outcomes else Outcome.BALL_REACHED,
            pose=np.zeros((steps, 3)),
            velocity=np.zeros((steps, 3)),
            acceleration=np.zeros((steps, 2)),
            robot_wheel=np.zeros(steps),
            truth=np.full(steps, 0.5),
            physics_state=np.zeros((steps, 0)),
        )
        image = rng.integers(0, 255, (DECISIONS, *IMAGE_SHAPE), dtype=np.uint8)
        episode = make_episode(
            rollout,
            teacher_wheel=given,
            teacher_drives=np.full(steps, driven),
            feedback=given,
            seen=Observations(image, np.zeros((DECISIONS, 5), np.float32)),
            number=drive.number,
            person="P001",
        )
        return self._log.add(episode)

    def rest(self, number, outcome, learn, meanwhile):
        how = self._plan.pop(0) if self._plan else AfterRest.GO_ON
        if isinstance(how, tuple):
            return how[1]
        learn(no_progress)
        meanwhile(no_progress)
        return how

    def wait(self, what, work):
        self.waited.append(what)
        work(no_progress)
        return True


def _spec(agent=None, config=CONFIG) -> TeachingSpec:
    nowhere = Judging(on_the_way=(), at_the_end=())
    agent = agent or dagger()
    return TeachingSpec(teacher="P001", agent=agent, config=config, judging=nowhere, seed=4)


def _teach(log=None, plan=(), *, spec=None, **made_up):
    env = Nowhere()
    log = log or MemoryLog(env, 4)
    interface = MadeUp(env, log, plan, **made_up)
    loop = TeachingLoop(spec or _spec(), env, log, interface)
    return loop.run(), loop, log, interface


def _weights(networks):
    return [tensor for network in networks for tensor in network.state_dict().values()]


def _same(one, other):
    return all(bool((a == b).all()) for a, b in zip(_weights(one), _weights(other), strict=True))


def test_a_demonstration_and_then_rounds_each_kept():
    finished, loop, log, interface = _teach()
    assert finished
    assert [one.round_number for one in log.results] == [0, 1, 2]
    assert [drive[:2] for drive in interface.drives] == [(0, 0), (1, 0), (2, 0)]
    assert _same(loop.learner.networks, log.rounds()[-1].networks())
    assert not _same(log.rounds()[0].networks(), log.rounds()[1].networks())
    first, second, _ = log.results
    assert first.label_mae == first.given_mae == pytest.approx(0.2)
    assert second.label_mae == pytest.approx(0.1)
    assert second.labels_asked == DECISIONS
    assert second.teacher_seconds == pytest.approx(0.1 * DECISIONS)


def test_what_is_shown_first_is_taken_as_it_was_driven_unless_the_oracle_labels_it():
    for agent, shown in ((dagger(), 0.3), (oracle(), 0.5)):
        _, _, log, _ = _teach(spec=_spec(agent))
        assert log.results[0].targets.target == pytest.approx(np.full(DECISIONS, shown))


def test_the_first_drive_is_redone_with_what_is_left_said():
    hit = Outcome.BLOCK_HIT
    _, _, log, interface = _teach(outcomes=[hit, hit])
    assert interface.drives[:3] == [(0, 0, None, 3), (0, 1, hit, 2), (0, 2, hit, 1)]
    assert log.results[0].drive.attempt == 2
    with pytest.raises(BallNeverReached, match="P001 did not reach the ball of task 'easy' in 3"):
        _teach(outcomes=[hit] * 3)


@pytest.mark.parametrize("redo", [AfterRest.REDO, ("early", AfterRest.REDO)])
def test_a_redo_forgets_what_was_learnt_from_the_drive(redo):
    go_on = AfterRest.GO_ON
    _, loop, log, interface = _teach(plan=[go_on, redo, go_on, go_on])
    assert [drive[:2] for drive in interface.drives] == [(0, 0), (1, 0), (1, 1), (2, 0)]
    assert [one.drive.attempt for one in log.results] == [0, 1, 0]
    _, straight, _, _ = _teach()
    assert not _same(loop.learner.networks, straight.learner.networks)


@pytest.mark.parametrize("stop", [AfterRest.STOP, ("early", AfterRest.STOP)])
def test_who_stops_goes_on_as_if_nothing_had_happened(stop):
    finished, _, log, interface = _teach(plan=[AfterRest.GO_ON, stop])
    assert not finished
    assert interface.waited == []
    finished, loop, log, again = _teach(log)
    assert finished
    driven = [drive[:2] for drive in (*interface.drives, *again.drives)]
    assert driven == [(0, 0), (1, 0), (2, 0)]  # what was driven and not learnt from is learnt from
    assert len(again.waited) == 2
    _, straight, _, _ = _teach()
    assert _same(loop.learner.networks, straight.learner.networks)


def test_a_drive_that_cannot_be_learnt_from_leaves_the_learner_as_it_was(monkeypatch):
    train = PolicyLearner.train

    def diverge(self, episodes, *progress):
        train(self, episodes, *progress)  # the weights are spoilt
        if len(episodes) == 2:
            raise TrainingDiverged("The policy's loss is nan.")
        return 0.0

    env = Nowhere()
    log = MemoryLog(env, 4)
    loop = TeachingLoop(_spec(), env, log, MadeUp(env, log))
    with monkeypatch.context() as patch:
        patch.setattr(PolicyLearner, "train", diverge)
        with pytest.raises(RoundDiverged, match="loss is nan") as raised:
            loop.run()
    assert raised.value.round_number == 1
    assert [one.round_number for one in log.results] == [0]
    assert _same(loop.learner.networks, log.rounds()[0].networks())


def test_a_drive_of_an_earlier_run_that_still_cannot_be_learnt_from_is_driven_anew(monkeypatch):
    class EarlierRun(MemoryLog):
        def left_over(self, number):
            found = super().left_over(number)
            return None if found is None else replace(found, seen=None)

    env = Nowhere()
    log = EarlierRun(env, 4)
    _teach(log, plan=[AfterRest.GO_ON, ("early", AfterRest.STOP)])
    train, calls = PolicyLearner.train, []

    def diverge_once(self, episodes, *progress):
        if len(episodes) == 2:
            calls.append(1)
            if len(calls) == 1:
                raise TrainingDiverged("The policy's loss is nan.")
        return train(self, episodes, *progress)

    monkeypatch.setattr(PolicyLearner, "train", diverge_once)
    finished, _, log, interface = _teach(log)
    assert finished
    assert [drive[:2] for drive in interface.drives] == [(1, 1), (2, 0)]


def test_a_first_drive_without_a_label_is_said_to_be_one():
    with pytest.raises(NothingShown, match="first drive of P001 holds no label"):
        _teach(wheel=np.nan)


def test_a_round_without_labels_is_kept_and_nothing_is_known_of_its_errors():
    nobody = Agent(name="nobody", gate=LearnerDrives(), rule=WhereTeacherDrives())
    _, loop, log, _ = _teach(spec=_spec(nobody))
    for result in log.results[1:]:
        assert (result.loss, result.label_mae, result.given_mae) == (None, None, None)
        assert label_errors(result.episode, result.targets) == (None, None)
    assert _same(loop.learner.networks, log.rounds()[0].networks())


def test_policies_that_did_not_drive_in_the_rest_drive_at_the_end(monkeypatch):
    from steerlab.learning.agents import teaching

    asked = []
    monkeypatch.setattr(teaching, "evaluate", lambda env, *rest: asked.append(1) or ["a drive"])

    class Impatient(MadeUp):
        def rest(self, number, outcome, learn, meanwhile):
            learn(no_progress)
            return AfterRest.GO_ON

    env = Nowhere()
    log = MemoryLog(env, 4)
    assert TeachingLoop(_spec(), env, log, Impatient(env, log)).run()
    assert len(asked) == 3
    assert [one.drives for one in log.results] == [["a drive"]] * 3
    every_second = replace(CONFIG, rounds=3, evaluate_every=2)
    log = MemoryLog(env, 4)
    assert TeachingLoop(_spec(config=every_second), env, log, Impatient(env, log)).run()
    assert [bool(one.drives) for one in log.results] == [True, False, True, True]


class Restless:
    """Changes its mind at every decision."""

    def begin(self, number, rng):
        self.asked = 0

    def who_drives(self, moment):
        self.asked += 1
        return Driver.TEACHER if self.asked % 2 else Driver.ROBOT


def test_a_gate_is_asked_at_decisions_and_held_in_between():
    held = HeldGate(Restless())
    held.begin(1, np.random.default_rng(0))
    who = [held.who_drives(step, 0.0, 0.0, 0.0, 0.0) for step in range(8)]
    teacher, robot = Driver.TEACHER, Driver.ROBOT
    assert who == [teacher, teacher, robot, robot] * 2


def test_who_is_given_the_wheel_keeps_it_for_as_long_as_is_said():
    held = HeldGate(Restless(), least_given=3)
    held.begin(1, np.random.default_rng(0))
    who = [held.who_drives(step, 0.0, 0.0, 0.0, 0.0) for step in range(16)]
    given = [one is Driver.TEACHER for one in who[::2]]
    assert given == [True, True, True, False, True, True, True, False]


@pytest.mark.parametrize("gate", [LearnerDrives(), TeacherDrives()])
def test_who_never_changes_their_mind_drives_all_of_it(gate):
    held = HeldGate(gate)
    held.begin(1, np.random.default_rng(0))
    assert len({held.who_drives(step, 0.0, 0.0, 0.0, 0.0) for step in range(9)}) == 1


def test_a_robot_asked_twice_about_a_step_decides_once():
    class Blank:
        def look(self):
            return Observations(np.zeros((1, *IMAGE_SHAPE), np.uint8), np.zeros((1, 5), np.float32))

    with Driving(make_task("easy").world) as driving:
        robot = Robot(Blank(), PolicyLearner(3))
        wheels = []
        for _ in range(4):
            wheels.append((robot(driving.state), robot(driving.state)))
            driving.step(0.0)
        assert all(one == two for one, two in wheels)
        assert len(robot.decision_ns) == len(robot.seen) == 2
        with pytest.raises(InvalidConfig, match="no doubt"):
            Robot(Blank(), PolicyLearner(3), doubts=True)(driving.reset())
