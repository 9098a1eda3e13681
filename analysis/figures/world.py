"""A drive from above: where the car went, and where the oracle would have gone (paper, Fig. rrt)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import NDArray

from steerlab.analysis.figures.look import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    PAPER,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    clearest_spot,
    halo,
    new_figure,
    quiet,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec

_MAP_IN = 4.4
_LETTER_IN = 0.082  # mean width of a letter at TEXT_PT
_LINE_IN = 0.17
_MARGIN_M = 10.0  # of ground around the drive, the ball and the paths
_LEAST_HALF_M = 25.0


def world_figure(
    world: WorldSpec,
    pose: FloatArray,
    oracle_paths: Sequence[tuple[FloatArray, str]] = (),
    *,
    camera_rgb: NDArray[np.uint8] | None = None,
    camera_label: str = "what the teacher sees",
    car: CarConfig | None = None,
) -> Figure:
    """The world from above with a rollout and the oracle's paths, beside a camera frame if given.

    Args:
        world: its ground, blocks and ball.
        pose: (steps, 3) x_m, y_m, heading_rad of the rollout.
        oracle_paths: (n, 2) points from a moment of the rollout to the ball, and a short label.
        camera_rgb: (height, width, 3) of one frame.
        camera_label: what the frame shows, and when.
        car: whose footprint is drawn at the start.
    """
    car = car or CarConfig()
    figure = new_figure(_MAP_IN if camera_rgb is None else 8.6, _MAP_IN)
    if camera_rgb is None:
        above = figure.add_subplot()
    else:
        above, camera = figure.subplots(1, 2, width_ratios=(1.0, 0.92))
        _draw_camera(camera, camera_rgb, camera_label)
    centre, half_m = _window(world, pose, oracle_paths)
    (left, bottom), (right, top) = centre - half_m, centre + half_m
    above.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    above.set(xlabel="x (m)", ylabel="y (m)")
    quiet(above)
    for block in world.blocks:
        corner = (block.x_m - block.half_x_m, block.y_m - block.half_y_m)
        size = 2.0 * block.half_x_m, 2.0 * block.half_y_m
        above.add_patch(Rectangle(corner, *size, facecolor=INK, label="block"))
    for points, label in oracle_paths:
        above.plot(*points.T, color=VERMILLION, linewidth=1.5, label=label, zorder=3)
        above.plot(*points[0], "o", color=VERMILLION, markersize=4.5, zorder=5)
    above.plot(pose[:, 0], pose[:, 1], color=BLUE, linewidth=2.2, label="rollout", zorder=4)
    _draw_car(above, pose[0], car)
    above.add_patch(
        Circle(world.ball_xy_m, BALL_RADIUS_M, facecolor=GREEN, edgecolor=PAPER, zorder=6)
    )
    _write_labels(above, world, pose, oracle_paths)
    return figure


def _window(
    world: WorldSpec, pose: FloatArray, oracle_paths: Sequence[tuple[FloatArray, str]]
) -> tuple[FloatArray, float]:
    """Centre and half side of the square that holds the drive, the ball and the paths."""
    shown = np.vstack([pose[:, :2], world.ball_xy_m, *(points for points, _ in oracle_paths)])
    low, high = shown.min(axis=0), shown.max(axis=0)
    half_m = float((high - low).max()) / 2.0 + _MARGIN_M
    half_m = min(max(half_m, _LEAST_HALF_M), world.half_extent_m)
    reach_m = world.half_extent_m - half_m
    return np.clip((low + high) / 2.0, -reach_m, reach_m), half_m


def _draw_car(axes: Axes, pose: FloatArray, car: CarConfig) -> None:
    """The car's footprint at its true size."""
    x_m, y_m, heading_rad = pose
    along, across = car.length_m / 2.0, car.width_m / 2.0
    corners = np.array([(along, across), (along, -across), (-along, -across), (-along, across)])
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    world_from_car = np.array([(cos, -sin), (sin, cos)])
    footprint = corners @ world_from_car.T + (x_m, y_m)
    axes.add_patch(Polygon(footprint, facecolor=BLUE, edgecolor=PAPER, linewidth=0.8, zorder=6))


def _draw_camera(axes: Axes, rgb: NDArray[np.uint8], label: str) -> None:
    axes.imshow(rgb, interpolation="nearest")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(MUTED)
    axes.set_xlabel(label, size=SMALL_PT, color=MUTED)


def _write_labels(
    axes: Axes,
    world: WorldSpec,
    pose: FloatArray,
    oracle_paths: Sequence[tuple[FloatArray, str]],
) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    metres_per_inch = (right - left) / (0.84 * _MAP_IN)
    line_m = _LINE_IN * metres_per_inch
    drive = pose[:, :2]
    taken = np.vstack([drive, *(_dense(points) for points, _ in oracle_paths), *_outlines(world)])
    ball = np.array(world.ball_xy_m)
    for text, colour, anchors, off_m in (
        *((label, VERMILLION, _beginning(points), 0.0) for points, label in oracle_paths),
        ("rollout", BLUE, drive, 0.0),
        ("ball", GREEN, ball[None], BALL_RADIUS_M),
        ("start", BLUE, drive[:1], 2.0),
    ):
        width_m = _LETTER_IN * len(text) * metres_per_inch
        half_box = np.array((width_m, line_m)) / 2.0
        least, most = np.array((left, bottom)) + half_box, np.array((right, top)) - half_box
        spots = np.clip(_spots(anchors, width_m, line_m, off_m), least, most)
        spot = spots[clearest_spot(spots, (width_m, line_m), taken)]
        axes.text(
            spot[0],
            spot[1],
            text,
            color=colour,
            size=TEXT_PT,
            weight="bold",
            ha="center",
            va="center",
            path_effects=halo(),
            zorder=8,
        )
        box = np.array([(dx, dy) for dx in (-0.5, -0.25, 0, 0.25, 0.5) for dy in (-0.5, 0, 0.5)])
        taken = np.vstack([taken, spot + box * (width_m, line_m)])


def _spots(anchors: FloatArray, width_m: float, line_m: float, off_m: float) -> FloatArray:
    """Label centres just beside a line or an object, not at the ends of a line."""
    if len(anchors) > 2:
        at = np.linspace(0.05, 0.9, 24) * (len(anchors) - 1)
        anchors = anchors[at.astype(int)]
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    reach = np.array((width_m / 2.0 + off_m + 0.8, line_m / 2.0 + off_m + 0.8))
    around = np.column_stack([np.cos(angles), np.sin(angles)]) * reach
    return (anchors[:, None, :] + around).reshape(-1, 2)


def _beginning(points: FloatArray) -> FloatArray:
    """Where the path leaves the rollout: near the ball all paths run together."""
    dense = _dense(points)
    return dense[: max(3, len(dense) // 3)]


def _dense(points: FloatArray, spacing_m: float = 1.0) -> FloatArray:
    """The path at even spacing, so that labels keep clear of its straight legs too."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    at = np.arange(0.0, along[-1] + spacing_m, spacing_m)
    return np.column_stack([np.interp(at, along, column) for column in points.T])


def _outlines(world: WorldSpec) -> list[FloatArray]:
    """Points that fill the blocks and the ball."""
    unit = np.linspace(-1.0, 1.0, 5)
    square = np.array([(x, y) for x in unit for y in unit])
    blocks = [
        square * (block.half_x_m, block.half_y_m) + (block.x_m, block.y_m) for block in world.blocks
    ]
    return [*blocks, 0.7 * BALL_RADIUS_M * square + np.array(world.ball_xy_m)]
