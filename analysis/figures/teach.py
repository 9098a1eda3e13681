"""Figures of a downstream comparison: learning curves, label error and label cost against success."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from steerlab.analysis.figures.learners import learner_looks, learner_name
from steerlab.analysis.figures.look import PAPER, SMALL_PT, halo, new_figure, quiet

_MAIN = ("mind-meld", "oracle", "dagger", "bc")  # drawn on top, with their bands
_LEGEND_COLUMNS = 4
_LETTER_IN, _LINE_IN = 0.075, 0.17  # of a point's name
_AXES_IN = (0.8, 0.65)  # what ticks and labels take of a figure

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
        for name, found in conditions.items():
            rows = [row for row in found["by_round"] if row[key] is not None]
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
    means = {name: (one["labels_asked"], one["success"]) for name, one in conditions.items()}
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
    for name, found in conditions.items():
        if found["label_mae"] is None:
            continue
        error, success = np.array(people[name]).T
        axes.plot(error, success, "o", color=looks[name].colour, markersize=3, alpha=0.35)
        means[name] = (found["label_mae"], found["success"])
    _success_axes(axes, "label error in the rounds (wheel units)")
    axes.set_xlim(left=-0.05)
    _named_points(figure, axes, means)
    return figure


def _point_figure(points: int) -> Figure:
    """Wider where many names must find a place."""
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
        place = min(_places(spot, half), key=lambda at: _crowding(at, half, spot, taken))
        taken.append((place, half))
        axes.text(
            float(place[0]), float(place[1]), text, transform=axes.transAxes, size=SMALL_PT, color=looks[name].colour,
            ha="center", va="center", path_effects=halo(), zorder=6,
        )  # fmt: skip


def _places(spot: np.ndarray, half: np.ndarray) -> list[np.ndarray]:
    """Centres of a name beside, above and below its point, nearer ones first."""
    found: list[np.ndarray] = []
    for off in (0.024, 0.06, 0.11):
        for x, y in ((1, 0), (0, 1), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            found.append(spot + np.array((x * (half[0] + off), y * (half[1] + off))))
    return found


def _crowding(
    at: np.ndarray,
    half: np.ndarray,
    spot: np.ndarray,
    taken: Sequence[tuple[np.ndarray, np.ndarray]],
) -> float:
    """Overlap with what is there and with the frame, then distance from the point."""
    covered = 0.0
    for centre, size in taken:
        overlap = np.clip(half + size - np.abs(at - centre), 0.0, None)
        covered += float(np.prod(overlap))
    outside = float(np.clip(half - at, 0.0, None).sum() + np.clip(at + half - 1.0, 0.0, None).sum())
    return 100.0 * covered + 50.0 * outside + float(np.hypot(*(at - spot)))
