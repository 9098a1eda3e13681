"""How a recording is laid out in the viewer: world, camera, plots, events."""

from typing import Any

import numpy as np
import rerun.blueprint as rrb

from steerlab.sim.geometry import Pose2D
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.sim.world import WorldSpec
from steerlab.study.recording.layout import (
    ABOUT,
    CAMERA,
    EVENTS,
    TIME,
    TIMING,
    WHEELS,
    WORLD,
)

_HIGH_SHARE, _BACK_SHARE = 0.42, 0.3  # of the way to the ball: the eye is above and behind
_LEAST_SPAN_M = 30.0


def blueprint(world: WorldSpec, start: Pose2D, *, pictures: bool) -> Any:
    """Panels for one attempt.

    Args:
        world: of the drive.
        start: of the drive; the eye looks from behind it towards the ball.
        pictures: whether there are any of the camera.
    """
    above = rrb.Spatial3DView(
        origin=f"/{WORLD}",
        name="World",
        background=rrb.Background(color=[24, 26, 30], kind=rrb.BackgroundKind.SolidColor),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=_eye(world, start),
    )
    wheels = rrb.TimeSeriesView(
        origin=f"/{WHEELS}",
        name=f"Wheel positions, left is up, limits ±{WHEEL_LIMIT:g}",
        axis_y=rrb.ScalarAxis(range=(-WHEEL_LIMIT, WHEEL_LIMIT), zoom_lock=True),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )
    timing = rrb.TimeSeriesView(
        origin=f"/{TIMING}",
        name="Timing of the control steps",
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop),
    )
    events = rrb.TextLogView(origin=f"/{EVENTS}", name="Events")
    about = rrb.TextDocumentView(origin=f"/{ABOUT}", name="Attempt")
    beside: list[Any] = [rrb.Tabs(about, events)]
    if pictures:
        beside.insert(0, rrb.Spatial2DView(origin=f"/{CAMERA}", name="What the teacher saw"))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(above, rrb.Vertical(*beside), column_shares=[2, 1]),
            rrb.Horizontal(wheels, timing, column_shares=[2, 1]),
            row_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIME),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _eye(world: WorldSpec, start: Pose2D) -> rrb.EyeControls3D:
    here, ball = np.array((start.x_m, start.y_m)), np.array(world.ball_xy_m)
    way = ball - here
    span_m = max(float(np.hypot(*way)), _LEAST_SPAN_M)
    eye = here - _BACK_SHARE * way
    centre = here + 0.45 * way
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(*eye.tolist(), _HIGH_SHARE * span_m),
        look_target=(*centre.tolist(), 0.0),
        eye_up=(0.0, 0.0, 1.0),
    )
