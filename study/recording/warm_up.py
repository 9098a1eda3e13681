"""Everything that a recording holds is logged once to nowhere: the first time takes up to 1 s."""

from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.world import Block, WorldSpec
from steerlab.study.recording.attempt_data import AttemptData
from steerlab.study.recording.blueprint import blueprint
from steerlab.study.recording.drive_log import DriveLog
from steerlab.study.recording.rebuild import new_stream
from steerlab.study.recording.scene import log_end, log_world
from steerlab.study.store.records import Attempt, AttemptStatus, Event, StoredRollout
from steerlab.teleop.timing import StepTiming


def warm_up() -> None:
    """Log a made-up attempt of two steps to a stream that is dropped."""
    start = Pose2D(0.0, 0.0, 0.0)
    world = WorldSpec(
        name="warm-up", ball_xy_m=(20.0, 0.0), start=start, blocks=(Block(9.0, 9.0, 1.0, 1.0),)
    )
    rollout = StoredRollout(name="warm-up", world=world, control_hz=20.0, seed=None, steps=None)
    attempt = Attempt(
        participant="nobody",
        rollout="warm-up",
        attempt=0,
        status=AttemptStatus.RUNNING,
        order_index=0,
    )
    steps = [_step(0), _step(1)]
    times = StepTiming(
        deadline_ns=0,
        actual_ns=1,
        sample_ns=2,
        event_age_ns=None,
        overrun=False,
        focus=True,
        device_ok=True,
    )
    stream = new_stream(rollout, "nobody", 0)
    stream.memory_recording()
    log_world(stream, world, start)
    stream.send_blueprint(blueprint(world, start, pictures=False))
    log = DriveLog(stream, rollout.control_hz)
    event = Event(step=0, at_ns=0, what="warm-up")
    log.event(event)
    for step in steps:
        log.step(step, times)
    data = AttemptData(
        rollout=rollout,
        attempt=attempt,
        session=None,
        steps=steps,
        times=[times, times],
        events=[event],
        flags=[],
    )
    log_end(stream, data)
    stream.disconnect()


def _step(step: int) -> LabelledStep:
    return LabelledStep(
        participant="nobody",
        rollout="warm-up",
        attempt=0,
        step=step,
        t_s=step / 20.0,
        x_m=float(step),
        y_m=0.0,
        heading_rad=0.0,
        speed_mps=5.0,
        lateral_speed_mps=0.0,
        yaw_rate_radps=0.0,
        acceleration_x_mps2=0.0,
        acceleration_y_mps2=0.0,
        robot_wheel=0.0,
        teacher_label=0.0,
        oracle_label=0.0,
        executed_wheel=0.0,
        gate=Driver.ROBOT,
        label_valid=True,
    )
