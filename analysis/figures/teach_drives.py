"""Drives of a downstream comparison: paths over rounds on the map, and what the camera saw."""

from base64 import b64decode
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image

from steerlab.analysis.figures.learners import learner_looks, learner_name
from steerlab.analysis.figures.look import (
    FAINT,
    GREEN,
    INK,
    MUTED,
    SMALL_PT,
    TEXT_PT,
    new_figure,
    quiet,
)
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec

_HALF_HIGH_M = 24.0  # of the map that is shown on either side of the way to the ball
_MARGIN_M = 6.0


def path_figure(world: WorldSpec, conditions: Mapping[str, Sequence[Any]]) -> Figure:
    """Where each condition's car went while it was taught: one teacher, pale to dark by round.

    Args:
        conditions: by name, the rounds of one learner as a shard holds them.
    """
    columns = 2 if len(conditions) in (2, 4) else min(3, len(conditions))
    rows = -(-len(conditions) // columns)
    figure = new_figure(8.6, (5.1 / columns + 0.05) * rows + 0.2)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes in grid[len(conditions) :]:
        axes.set_axis_off()
    looks = learner_looks(list(conditions))
    for axes, (name, rounds) in zip(grid, conditions.items(), strict=False):
        _draw_world(axes, world)
        shade = LinearSegmentedColormap.from_list("", (FAINT, looks[name].colour))
        for row in rounds:
            path = np.array(row["path_m"])
            colour = shade(0.15 + 0.85 * row["round"] / max(1, rounds[-1]["round"]))
            axes.plot(*path.T, color=colour, linewidth=1.2)
            if row["outcome"] == "block_hit":
                axes.plot(*path[-1], "x", color=INK, markersize=5, markeredgewidth=1.2, zorder=5)
        axes.set_title(learner_name(name), size=TEXT_PT, color=INK, loc="left")
        quiet(axes)
        axes.tick_params(labelsize=SMALL_PT - 1.0)
    return figure


def contact_figure(conditions: Mapping[str, Sequence[str]]) -> Figure:
    """What the camera saw in one drive of each learner; policies see what is between the lines.

    Args:
        conditions: by name, base64 of PNG, in the order of the drive.
    """
    columns = max(len(frames) for frames in conditions.values())
    figure = new_figure(8.6, 1.24 * len(conditions) + 0.25)
    grid = figure.subplots(len(conditions), columns, squeeze=False)
    for axes_row, (name, frames) in zip(grid, conditions.items(), strict=True):
        for axes, frame in zip(axes_row, frames, strict=False):
            with Image.open(BytesIO(b64decode(frame))) as image:
                pixels = np.asarray(image)
            axes.imshow(pixels, interpolation="nearest")
            for edge in (0.25, 0.75):
                axes.axhline(edge * len(pixels) - 0.5, color="white", linewidth=0.8, alpha=0.8)
        for axes in axes_row:
            axes.set_xticks([])
            axes.set_yticks([])
            for spine in axes.spines.values():
                spine.set_visible(False)
        axes_row[0].set_ylabel(
            learner_name(name).replace(", ", ",\n"),
            size=SMALL_PT, rotation=0, ha="right", va="center", color=INK,
        )  # fmt: skip
    for axes, text in ((grid[0][0], "start"), (grid[0][-1], "end")):
        axes.set_title(text, size=SMALL_PT, color=MUTED)
    return figure


def _draw_world(axes: Axes, world: WorldSpec) -> None:
    """Blocks and ball; the map is cut to the way from start to ball."""
    for block in world.blocks:
        corner = (block.x_m - block.half_x_m, block.y_m - block.half_y_m)
        size = 2.0 * block.half_x_m, 2.0 * block.half_y_m
        axes.add_patch(Rectangle(corner, *size, facecolor=MUTED))
    axes.add_patch(Circle(world.ball_xy_m, BALL_RADIUS_M, facecolor=GREEN, zorder=4))
    start, (ball_x_m, ball_y_m) = world.start, world.ball_xy_m
    low_m, high_m = sorted((start.x_m, ball_x_m))
    bottom_m, top_m = sorted((start.y_m, ball_y_m))
    axes.set(
        xlim=(low_m - _MARGIN_M, high_m + _MARGIN_M),
        ylim=(
            min(bottom_m - _MARGIN_M, (bottom_m + top_m) / 2.0 - _HALF_HIGH_M),
            max(top_m + _MARGIN_M, (bottom_m + top_m) / 2.0 + _HALF_HIGH_M),
        ),
    )
    axes.set_aspect("equal", adjustable="box")
