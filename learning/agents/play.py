"""One drive as fast as the computer allows, with a script at the wheel."""

from math import nan

import numpy as np

from steerlab.learning.agents.contract import Episode, Watching
from steerlab.learning.agents.drive import HeldGate, Robot, RoundDrive
from steerlab.learning.agents.episode import make_episode, make_rollout
from steerlab.sim.arrays import FloatArray
from steerlab.sim.engine.driving import DrivingState
from steerlab.sim.live_teacher import LiveTeacher, Responding
from steerlab.sim.records import Driver
from steerlab.sim.rollout import Outcome
from steerlab.sim.tasks import HELD_STEPS


def play(drive: RoundDrive, teacher: Responding, live: LiveTeacher) -> Episode:
    """Drive from the start to the end; the teacher drives where the gate says so.

    Args:
        teacher: gives feedback on the whole drive afterwards, knowing all of it.
        live: the same person at the wheel, who knows only what has been.
    """
    env, context, driving = drive.env, drive.context, drive.env.driving
    reacting, untaught = drive.gate.watching is Watching.REACTING, drive.learner is None
    robot = Robot(env, drive.learner, doubts=drive.gate.needs_doubt)
    gate = HeldGate(drive.gate)
    states: list[DrivingState] = []
    physics: list[FloatArray] = []
    robot_wheel: list[float] = []
    hands: list[float] = []
    taught: list[bool] = []
    state = driving.reset(start=drive.start.pose)
    gate.begin(drive.number, drive.gate_rng(), Driver.TEACHER if untaught else Driver.ROBOT)
    if reacting:
        live.begin(context)
    for noise in np.repeat(drive.start.noise, HELD_STEPS).tolist():
        wheel = robot(state)
        truth = env.oracle(state) if reacting else nan
        hand = live.react(truth) if reacting else nan
        who = gate.who_drives(len(states), nan if untaught else wheel, hand, truth, robot.doubt)
        states.append(state)
        physics.append(driving.physics_state())
        robot_wheel.append(hand if untaught else wheel)
        hands.append(hand)
        taught.append(who is Driver.TEACHER)
        driving.step((hand if taught[-1] else wheel) + noise)
        state = driving.state
        if driving.outcome is not Outcome.RUNNING:
            break
    pose = np.array([(s.pose.x_m, s.pose.y_m, s.pose.heading_rad) for s in states])
    velocity = np.array([s.velocity for s in states])
    rollout = make_rollout(
        env,
        context.name,
        driving.outcome,
        pose=pose,
        velocity=velocity,
        acceleration=np.array([s.acceleration for s in states]),
        robot_wheel=np.array(robot_wheel),
        truth=env.planner.label_rollout(pose, velocity[:, 0]).wheel,
        physics_state=np.array(physics),
    )
    feedback = np.full(rollout.steps, nan)
    if rollout.oracle_valid.any():
        feedback = teacher.respond(rollout, order=context.order, attempt=context.attempt)
    return make_episode(
        rollout,
        teacher_wheel=np.array(hands),
        teacher_drives=np.array(taught),
        feedback=feedback,
        seen=robot.seen,
        number=drive.number,
        person=teacher.name,
    )
