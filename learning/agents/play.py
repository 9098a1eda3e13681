"""One drive, whoever holds the wheel: the loop that all interactive learners share."""

from dataclasses import dataclass

import numpy as np

from steerlab.learning.agents.contract import Episode, Gate, GateInput, Learner, Watching
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations, stack
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.live_teacher import DriveContext, LiveTeacher, Responding
from steerlab.sim.records import Driver
from steerlab.sim.rollout import FloatArray, Outcome, Rollout
from steerlab.sim.tasks import HELD_STEPS, Start

NAN = float("nan")


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where in a teacher's session a drive stands; noise and drift depend on it, conditions do not.

    Attributes:
        order: drives the teacher has seen before, calibration included.
    """

    name: str
    round_number: int
    order: int
    attempt: int = 0


class _Log:
    """Collects columns while a drive runs."""

    def __init__(self) -> None:
        self.states: list[DrivingState] = []
        self.physics: list[FloatArray] = []
        self.robot: list[float] = []
        self.live: list[float] = []
        self.seen: list[Observations] = []
        self.rows: list[int] = []
        self.learner: list[float] = []
        self.doubt: list[float] = []
        self.taught: list[bool] = []


def play(
    stage: TaskEnv,
    learner: Learner | None,
    teacher: Responding,
    gate: Gate,
    start: Start,
    place: Place,
    *,
    live: LiveTeacher,
    rng: np.random.Generator,
) -> Episode:
    """Drive from ``start`` to the end; the teacher drives where ``gate`` says so.

    Args:
        learner: None while there is none yet; the gate must then leave the wheel to the teacher.
        teacher: gives feedback on the whole drive afterwards, knowing all of it.
        live: the same person at the wheel, who knows only what has been.
        rng: for gates that draw.
    """
    driving, reacting = stage.driving, gate.watching is Watching.REACTING
    log, held = _Log(), Driver.TEACHER if learner is None else Driver.ROBOT
    state = driving.reset(start=start.pose)
    if reacting:
        config = stage.task.driving
        live.begin(
            DriveContext(
                name=place.name,
                order=place.order,
                attempt=place.attempt,
                steps=config.max_steps,
                control_hz=config.control_hz,
            )
        )
    gate.begin(place.round_number, rng)
    for decision, noise in enumerate(start.noise.tolist()):
        seen = stage.look()
        wheel = NAN if learner is None else float(learner.act(seen)[0])
        doubt = float(learner.doubt(seen)[0]) if learner is not None and gate.needs_doubt else NAN
        truth = stage.oracle(state) if reacting else NAN
        hand = live.react(truth) if reacting else NAN
        held = gate.who_drives(GateInput(decision, held, wheel, hand, truth, doubt))
        taught = held is Driver.TEACHER
        log.seen.append(seen)
        log.rows.append(len(log.states))
        log.learner.append(wheel)
        log.doubt.append(doubt)
        log.taught.append(taught)
        for step in range(HELD_STEPS):
            if step and reacting:
                hand = live.react(stage.oracle(state))
            log.states.append(state)
            log.physics.append(driving.physics_state())
            log.robot.append(hand if learner is None else wheel)
            log.live.append(hand if taught else NAN)
            driving.step((hand if taught else wheel) + noise)
            state = driving.state
            if driving.outcome is not Outcome.RUNNING:
                break
        if driving.outcome is not Outcome.RUNNING:
            break
    rollout = _rollout(stage, log, place)
    known = rollout.oracle_valid.any()
    return Episode(
        rollout=rollout,
        feedback=(
            teacher.respond(rollout, order=place.order, attempt=place.attempt)
            if known
            else np.full(rollout.steps, np.nan)
        ),
        live=np.array(log.live),
        teacher_drives=np.array(log.taught),
        seen=stack(log.seen),
        rows=np.array(log.rows),
        learner_wheel=np.array(log.learner),
        doubt=np.array(log.doubt),
        final_distance_m=driving.distance_to_ball_m,
        round_number=place.round_number,
        person=teacher.name,
    )


def _rollout(stage: TaskEnv, log: _Log, place: Place) -> Rollout:
    pose = np.array([(s.pose.x_m, s.pose.y_m, s.pose.heading_rad) for s in log.states])
    velocity = np.array([s.velocity for s in log.states])
    labels = stage.planner.label_rollout(pose, velocity[:, 0])
    return Rollout(
        name=place.name,
        world=stage.task.world,
        control_hz=stage.task.driving.control_hz,
        seed=stage.seed,
        outcome=stage.driving.outcome,
        t_s=np.arange(len(pose)) / stage.task.driving.control_hz,
        pose=pose,
        velocity=velocity,
        acceleration=np.array([s.acceleration for s in log.states]),
        robot_wheel=np.array(log.robot),
        oracle_label=labels.wheel,
        oracle_valid=labels.valid,
        physics_state=np.array(log.physics),
    )
