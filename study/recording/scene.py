"""What does not change during a recording: the world, the car's body, line names and paths."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import rerun as rr

from steerlab.sim.arrays import FloatArray
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import Driver, LabelledStep
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec
from steerlab.study.recording import layout
from steerlab.study.store.records import AttemptData

_SOLID = rr.components.FillMode.Solid
_PATH_HEIGHT_M = 0.12
_PATH_RADIUS_M, _ORACLE_RADIUS_M = 0.22, 0.13
_START_M = 3.0
_DRIVER_RGB = {Driver.ROBOT: layout.ROBOT_RGB, Driver.TEACHER: layout.TEACHER_RGB}


def log_world(
    stream: rr.RecordingStream, world: WorldSpec, start: Pose2D, car: CarConfig | None = None
) -> None:
    """Everything that is known before an attempt begins, at ``start``."""

    def log(path: str, what: Any) -> None:
        stream.log(path, what, static=True, strict=True)

    half_m = world.half_extent_m
    corners = [(-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m)]
    log(layout.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    log(
        layout.GROUND,
        rr.Boxes3D(
            centers=[(0.0, 0.0, -0.05)],
            half_sizes=[(half_m, half_m, 0.05)],
            colors=[layout.GROUND_RGB],
            fill_mode=_SOLID,
        ),
    )
    log(
        layout.EDGE,
        rr.LineStrips3D(
            [[(x_m, y_m, 0.05) for x_m, y_m in (*corners, corners[0])]],
            colors=[layout.EDGE_RGB],
            radii=[0.12],
        ),
    )
    if world.blocks:
        sizes = [(b.half_x_m, b.half_y_m, b.height_m / 2.0) for b in world.blocks]
        log(
            layout.BLOCKS,
            rr.Boxes3D(
                centers=[(b.x_m, b.y_m, b.height_m / 2.0) for b in world.blocks],
                half_sizes=sizes,
                colors=[layout.BLOCK_RGB] * len(sizes),
                fill_mode=_SOLID,
            ),
        )
    log(
        layout.BALL,
        rr.Ellipsoids3D(
            centers=[(*world.ball_xy_m, BALL_RADIUS_M)],
            half_sizes=[(BALL_RADIUS_M,) * 3],
            colors=[layout.BALL_RGB],
            fill_mode=_SOLID,
            labels=["ball"],
        ),
    )
    ahead = start.ahead(_START_M)
    log(
        layout.START,
        rr.Arrows3D(
            origins=[(start.x_m, start.y_m, _PATH_HEIGHT_M)],
            vectors=[(ahead.x_m - start.x_m, ahead.y_m - start.y_m, 0.0)],
            colors=[layout.EDGE_RGB],
            labels=["start"],
        ),
    )
    log(layout.BODY, _body(car or CarConfig()))
    for path, names, colors, widths in (
        (layout.WHEELS, layout.WHEEL_NAMES, layout.WHEEL_RGBS, layout.WHEEL_WIDTHS),
        (layout.TIMING, layout.TIMING_NAMES, layout.TIMING_RGBS, (1.5, 1.5)),
    ):
        log(path, rr.SeriesLines(names=names, colors=colors, widths=widths))


def log_end(
    stream: rr.RecordingStream, data: AttemptData, oracle_xy_m: FloatArray | None = None
) -> None:
    """Everything that is known only when an attempt is over.

    Args:
        oracle_xy_m: the oracle's path from the start, (points, 2), where known.
    """
    if len(data.steps) > 1:
        strips, gates = _driven(data.steps)
        driven = rr.LineStrips3D(
            strips,
            colors=[_DRIVER_RGB[gate] for gate in gates],
            radii=[_PATH_RADIUS_M],
            labels=[f"the {gate} drove" for gate in gates],
        )
        stream.log(layout.DRIVEN, driven, static=True, strict=True)
    if oracle_xy_m is not None:
        oracle = rr.LineStrips3D(
            [_on_ground(oracle_xy_m)],
            colors=[layout.ORACLE_RGB],
            radii=[_ORACLE_RADIUS_M],
        )
        stream.log(layout.ORACLE_PATH, oracle, static=True, strict=True)
        name = rr.Points3D(  # a label of the line would lie in its middle, on the label of the driven line
            _on_ground(oracle_xy_m[len(oracle_xy_m) // 4][None]),
            colors=[layout.ORACLE_RGB],
            radii=[_ORACLE_RADIUS_M],
            labels=["the oracle's way"],
        )
        stream.log(layout.ORACLE_NAME, name, static=True, strict=True)
    text = rr.TextDocument(about(data), media_type=rr.MediaType.MARKDOWN)
    stream.log(layout.ABOUT, text, static=True, strict=True)


def about(data: AttemptData) -> str:
    """What a reader must know about an attempt, in Markdown."""
    attempt, session = data.attempt, data.session
    why = f": {attempt.end_reason}" if attempt.end_reason else ""
    valid = sum(step.label_valid for step in data.steps)
    rows = [
        ("participant", attempt.participant),
        ("rollout", attempt.rollout),
        ("attempt", str(attempt.attempt)),
        ("status", f"{attempt.status}{why}"),
        ("steps", f"{len(data.steps)} at {data.rollout.control_hz:g} Hz, {valid} labels valid"),
        ("flags", "; ".join(f"{f.name} {f.value:.3g} (limit {f.bound:g})" for f in data.flags)),
    ]
    if session is not None:
        latency = session.input_latency_ms
        rows += [
            ("session", f"{session.id}, {session.started_utc}"),
            ("device", f"{session.device_name} ({session.input_kind})"),
            ("force feedback", session.force_feedback),
            ("input latency", "not measured" if latency is None else f"{latency:.3g} ms"),
            ("steerlab", session.steerlab_version),
        ]
    head, *lines = [f"| {name} | {_cell(value)} |" for name, value in rows]
    return "\n".join([head, "|---|---|", *lines])


def _cell(text: str) -> str:
    return text.replace("|", "\\|") or "none"


def _body(car: CarConfig) -> rr.Boxes3D:
    """Chassis and cabin, as they are in the simulator."""
    half_m, half_width_m = car.length_m / 2.0, car.width_m / 2.0
    return rr.Boxes3D(
        centers=[(0.0, 0.0, 0.6), (-0.25, 0.0, 1.15)],
        half_sizes=[(half_m, half_width_m, 0.4), (0.42 * half_m, 0.88 * half_width_m, 0.3)],
        colors=[layout.ROBOT_RGB, layout.GLASS_RGB],
        fill_mode=_SOLID,
    )


def _driven(steps: Sequence[LabelledStep]) -> tuple[list[FloatArray], list[Driver]]:
    """A line strip for each stretch with the same driver, and those drivers."""
    starts = [0, *(i for i in range(1, len(steps)) if steps[i].gate is not steps[i - 1].gate)]
    points = _on_ground(np.array([(step.x_m, step.y_m) for step in steps]))
    strips = [points[first : last + 1] for first, last in pairwise([*starts, len(steps)])]
    return strips, [steps[first].gate for first in starts]


def _on_ground(xy_m: FloatArray) -> FloatArray:
    """(points, 2) -> (points, 3), just above the ground."""
    return np.column_stack([xy_m, np.full(len(xy_m), _PATH_HEIGHT_M)])
