"""Paths, colours and names of what a recording shows, and its layout in the Rerun viewer."""

from collections.abc import Sequence
from math import nan, tan
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from steerlab.sim.arrays import FloatArray
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import LabelledStep
from steerlab.sim.vehicle import WHEEL_LIMIT, CarConfig
from steerlab.sim.world import WorldSpec
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
# The oracle's and the robot's are those of the figures, the ball's that of the camera's picture.
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
_EYE_HEIGHT_SHARE, _EYE_BACK_SHARE = 0.42, 0.3  # of the start's distance to the ball
_LEAST_SPAN_M = 30.0


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
    """The rear axle moves on a circle about the point where the lines of both axles meet."""
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


def blueprint(world: WorldSpec, start: Pose2D, *, pictures: bool) -> Any:
    """The viewer's panels for one attempt: world, camera, plots and events.

    Args:
        start: of the drive; the eye is above and behind it and looks towards the ball.
        pictures: whether there are camera pictures.
    """
    scene = rrb.Spatial3DView(
        origin=f"/{WORLD}",
        name="World",
        background=rrb.Background(color=[24, 26, 30], kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=_eye(world, start),
    )
    wheel_plot = rrb.TimeSeriesView(
        origin=f"/{WHEELS}",
        name=f"Wheel positions, left is up, limits ±{WHEEL_LIMIT:g}",
        axis_y=rrb.ScalarAxis(range=(-WHEEL_LIMIT, WHEEL_LIMIT), zoom_lock=True),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )
    timing_plot = rrb.TimeSeriesView(
        origin=f"/{TIMING}",
        name="Timing of the control steps",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
    events = rrb.TextLogView(origin=f"/{EVENTS}", name="Events")
    attempt = rrb.TextDocumentView(origin=f"/{ABOUT}", name="Attempt")
    beside: list[Any] = [rrb.Tabs(attempt, events)]
    if pictures:
        beside.insert(0, rrb.Spatial2DView(origin=f"/{CAMERA}", name="What the teacher saw"))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(scene, rrb.Vertical(*beside), column_shares=[2, 1]),
            rrb.Horizontal(wheel_plot, timing_plot, column_shares=[2, 1]),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIME),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _eye(world: WorldSpec, start: Pose2D) -> rrb.EyeControls3D:
    start_m, ball_m = np.array((start.x_m, start.y_m)), np.array(world.ball_xy_m)
    to_ball_m = ball_m - start_m
    span_m = max(float(np.hypot(*to_ball_m)), _LEAST_SPAN_M)
    eye_m = start_m - _EYE_BACK_SHARE * to_ball_m
    centre_m = start_m + 0.45 * to_ball_m
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(*eye_m.tolist(), _EYE_HEIGHT_SHARE * span_m),
        look_target=(*centre_m.tolist(), 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )
