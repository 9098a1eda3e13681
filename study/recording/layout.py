"""Where things are in a recording, what the lines are called, and which colour means what."""

from collections.abc import Sequence
from math import nan, tan

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.teleop.timing import StepTiming

Rgb = tuple[int, int, int]

STEP, TIME = "step", "t"  # timelines: control step, and time since the attempt's start

WORLD = "world"
GROUND, EDGE, BLOCKS, BALL, START = (
    f"{WORLD}/{name}" for name in ("ground", "edge", "blocks", "ball", "start")
)
CAR = f"{WORLD}/car"
BODY, WAYS = f"{CAR}/body", f"{CAR}/ways"
DRIVEN, ORACLE_PATH = f"{WORLD}/paths/driven", f"{WORLD}/paths/oracle"
ORACLE_NAME = f"{ORACLE_PATH}/name"
WHEELS, TIMING, EVENTS, CAMERA, ABOUT = "wheels", "timing", "events", "camera", "about"

# Okabe & Ito, "Color Universal Design" (2008), those that stand out on the viewer's dark ground.
# The oracle and the robot are as in the figures; the ball is as in the camera's picture beside it.
TEACHER_RGB: Rgb = (240, 228, 66)
ROBOT_RGB: Rgb = (86, 180, 233)
ORACLE_RGB: Rgb = (213, 94, 0)
BALL_RGB: Rgb = (255, 115, 13)
GROUND_RGB: Rgb = (58, 62, 68)
EDGE_RGB: Rgb = (200, 205, 210)
BLOCK_RGB: Rgb = (122, 130, 142)
GLASS_RGB: Rgb = (30, 42, 54)

WHEEL_NAMES = ("teacher's label", "robot's wheel", "oracle")
WHEEL_RGBS = (TEACHER_RGB, ROBOT_RGB, ORACLE_RGB)
WHEEL_WIDTHS = (3.0, 1.5, 1.5)
TIMING_NAMES = ("step woke late (ms)", "age of last input (ms)")
TIMING_RGBS: tuple[Rgb, ...] = (ROBOT_RGB, TEACHER_RGB)

WAY_M = 12.0
_WAY_POINTS = 13
_WAY_HEIGHT_M = 0.2
_NS_PER_MS = 1e6


def recording_name(participant: str, rollout: str, attempt: int) -> str:
    """What a recording is called in the viewer."""
    return f"{participant} · {rollout} · attempt {attempt}"


def wheels(step: LabelledStep) -> tuple[float, float, float]:
    """Positions in the order of ``WHEEL_NAMES``; NaN leaves a gap where there is none."""
    label, oracle = step.teacher_label, step.oracle_label
    return (
        nan if label is None else label,
        step.robot_wheel,
        nan if oracle is None else oracle,
    )


def timing_ms(times: StepTiming) -> tuple[float, float]:
    """Milliseconds in the order of ``TIMING_NAMES``; NaN before the device's first event."""
    age_ns = times.event_age_ns
    return (
        (times.actual_ns - times.deadline_ns) / _NS_PER_MS,
        nan if age_ns is None else age_ns / _NS_PER_MS,
    )


def ways(wheel_positions: Sequence[float], car: CarConfig) -> list[tuple[FloatArray, Rgb]]:
    """Where each known wheel would take the car over the next metres, without tyre slip.

    Args:
        wheel_positions: in the order of ``WHEEL_NAMES``; NaN for those that are unknown.

    Returns:
        (points, 3) of the car's centre in the car's frame, and the colour.
    """
    return [
        (_way(car, wheel), rgb)
        for wheel, rgb in zip(wheel_positions, WHEEL_RGBS, strict=True)
        if wheel == wheel  # NaN is not
    ]


def _way(car: CarConfig, wheel: float) -> FloatArray:
    """A circle of the rear axle about the point where the axles' lines meet."""
    along_m = np.linspace(0.0, WAY_M, _WAY_POINTS)
    turned_rad = along_m * tan(car.road_wheel_rad(wheel)) / car.wheelbase_m
    half_base_m = car.wheelbase_m / 2.0
    # sin(x)/x and (1-cos x)/x by sinc, which knows the straight line too
    rear_x_m = along_m * np.sinc(turned_rad / np.pi)
    rear_y_m = along_m * np.sin(turned_rad / 2.0) * np.sinc(turned_rad / (2.0 * np.pi))
    return np.column_stack(
        [
            rear_x_m + half_base_m * (np.cos(turned_rad) - 1.0),
            rear_y_m + half_base_m * np.sin(turned_rad),
            np.full(_WAY_POINTS, _WAY_HEIGHT_M),
        ]
    )
