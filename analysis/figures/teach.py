"""Figures of a downstream comparison: learning curves, error and cost of labels, drives, camera."""

from base64 import b64decode
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.ticker import MaxNLocator, PercentFormatter
from PIL import Image

from steerlab.analysis.figures.look import (
    FAINT,
    GREEN,
    INK,
    MUTED,
    PAPER,
    SMALL_PT,
    TEXT_PT,
    halo,
    learner_looks,
    new_figure,
    quiet,
)
from steerlab.analysis.wording import learner_name
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec

_MAIN = ("mind-meld", "oracle", "dagger", "bc")  # drawn on top, with their bands
_LEGEND_COLUMNS = 4
_LETTER_IN, _LINE_IN = 0.075, 0.17  # of a point's name
_AXES_IN = (0.8, 0.65)  # what ticks and labels take of a figure

_HALF_HIGH_M = 24.0  # of the map that is shown on either side of the way to the ball
_MARGIN_M = 6.0

Point = tuple[float, float]
"""A teacher's label error and final success with one learner."""


def curve_figure(conditions: Mapping[str, Any]) -> Figure:
    """Success and final distance by round, with 95 % intervals over teachers.

    With many learners only the main ones keep their bands, which would cover each other.
    """
    figure = new_figure(8.6, 3.7 + 0.2 * (len(conditions) // _LEGEND_COLUMNS))
    looks = learner_looks(list(conditions))
    banded = set(conditions) if len(conditions) <= 6 else set(_MAIN)
    panels = figure.subplots(1, 2)
    for axes, key, label in zip(
        panels, ("success", "final_distance_m"), ("success", "final distance (m)"), strict=True
    ):
        for name, condition in conditions.items():
            rows = [row for row in condition["by_round"] if row[key] is not None]
            rounds, values = [row["round"] for row in rows], [row[key] for row in rows]
            look, front = looks[name], 4 if name in _MAIN else 3
            axes.plot(
                rounds, values, color=look.colour, linestyle=look.line, linewidth=1.8,
                marker="o", markersize=3, label=learner_name(name), zorder=front,
            )  # fmt: skip
            bands = [row[f"{key}_ci95"] for row in rows]
            if all(bands) and name in banded:
                low, high = np.array(bands).T
                axes.fill_between(rounds, low, high, color=look.colour, alpha=0.12, linewidth=0)
        axes.set(xlabel="round (0: after the demonstration)", ylabel=label)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        quiet(axes, grid="y")
    panels[0].set_ylim(-0.03, 1.03)
    panels[0].yaxis.set_major_formatter(PercentFormatter(1.0))
    panels[1].set_ylim(bottom=0.0)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(_LEGEND_COLUMNS, len(conditions)),
        fontsize=SMALL_PT,
        frameon=False,
    )
    return figure


def cost_figure(conditions: Mapping[str, Any]) -> Figure:
    """What a learner asked of its teacher, and how well it then drove."""
    figure = _point_figure(len(conditions))
    axes = figure.add_subplot()
    means = {
        name: (condition["labels_asked"], condition["success"])
        for name, condition in conditions.items()
    }
    _success_axes(axes, "labels asked of a teacher, all rounds")
    axes.set_xlim(0.0, 1.25 * max(x for x, _ in means.values()))
    _named_points(figure, axes, means)
    return figure


def error_figure(conditions: Mapping[str, Any], people: Mapping[str, Sequence[Point]]) -> Figure:
    """Label error in the rounds against success after them: a small point is a teacher.

    Args:
        conditions: means by learner; one without label error is left out.
        people: each teacher's values by learner.
    """
    figure = _point_figure(len(conditions))
    axes = figure.add_subplot()
    looks = learner_looks(list(conditions))
    means: dict[str, Point] = {}
    for name, condition in conditions.items():
        if condition["label_mae"] is None:
            continue
        error, success = np.array(people[name]).T
        axes.plot(error, success, "o", color=looks[name].colour, markersize=3, alpha=0.35)
        means[name] = (condition["label_mae"], condition["success"])
    _success_axes(axes, "label error in the rounds (wheel units)")
    axes.set_xlim(left=-0.05)
    _named_points(figure, axes, means)
    return figure


def _point_figure(points: int) -> Figure:
    """An empty figure; wider where there are many names to write."""
    return new_figure(4.6 if points <= 6 else 8.6, 3.7)


def _success_axes(axes: Axes, label: str) -> None:
    axes.set(xlabel=label, ylabel="success after the last round")
    axes.set_ylim(-0.05, 1.12)
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    quiet(axes, grid="y")


def _named_points(figure: Figure, axes: Axes, means: Mapping[str, Point]) -> None:
    """Large points, each with its name where it covers no other name and no other point."""
    looks = learner_looks(list(means))
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    spots = {name: (np.array(mean) - low) / (high - low) for name, mean in means.items()}
    axes_in = figure.get_size_inches() - _AXES_IN
    taken = [(spot, 0.055 / axes_in) for spot in spots.values()]
    for name, spot in spots.items():
        axes.plot(
            *means[name], "o", color=looks[name].colour, markersize=7, zorder=5,
            markeredgecolor=PAPER,
        )  # fmt: skip
        text = learner_name(name)
        half = np.array((_LETTER_IN * len(text), _LINE_IN)) / axes_in / 2.0
        centre = min(_name_centres(spot, half), key=lambda at: _crowding(at, half, spot, taken))
        taken.append((centre, half))
        axes.text(
            float(centre[0]), float(centre[1]), text, transform=axes.transAxes, size=SMALL_PT,
            color=looks[name].colour, ha="center", va="center", path_effects=halo(), zorder=6,
        )  # fmt: skip


def _name_centres(spot: np.ndarray, half: np.ndarray) -> list[np.ndarray]:
    """Where a name's centre may be: beside, above and below its point, nearer ones first."""
    sides = ((1, 0), (0, 1), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))
    return [spot + side * (half + off) for off in (0.024, 0.06, 0.11) for side in np.array(sides)]


def _crowding(
    at: np.ndarray,
    half: np.ndarray,
    spot: np.ndarray,
    taken: Sequence[tuple[np.ndarray, np.ndarray]],
) -> float:
    """Cost of a name at ``at``: overlap with what is there and with the frame, then distance."""
    covered = 0.0
    for centre, size in taken:
        overlap = np.clip(half + size - np.abs(at - centre), 0.0, None)
        covered += float(np.prod(overlap))
    outside = float(np.clip(half - at, 0.0, None).sum() + np.clip(at + half - 1.0, 0.0, None).sum())
    return 100.0 * covered + 50.0 * outside + float(np.hypot(*(at - spot)))


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
