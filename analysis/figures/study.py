"""Figures of a study's analysis: everyone's style, label errors, learning curves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from steerlab.analysis.figures.learners import learner_looks, learner_name
from steerlab.analysis.figures.look import (
    BLUE,
    INK,
    MUTED,
    NEW_MARKER,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    new_figure,
    quiet,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_MARKERS = {"training": (SEEN_MARKER, PAPER), "test": (NEW_MARKER, BLUE)}
METRIC_WORDS = {
    "success": "drives that reach the ball",
    "final_distance_m": "final distance (m)",
    "label_mae": "mean label error",
}


def style_figure(people: Mapping[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """Everyone's amplitude metric and lag, by role.

    Args:
        people: amplitude (a point of the path, wheel units) and lag (s), (people,) each, by role.

    Raises:
        InvalidConfig: nobody has both.
    """
    if not any(len(lag) for _, lag in people.values()):
        raise InvalidConfig("Nobody has both style metrics; there is nothing to draw.")
    figure = new_figure(6.2, 4.2)
    axes = figure.add_subplot()
    quiet(axes)
    axes.axhline(0.0, color=MUTED, linewidth=0.7)
    axes.axvline(0.0, color=MUTED, linewidth=0.7)
    for role, (amplitude, lag_s) in people.items():
        marker, fill = _MARKERS[role]
        axes.plot(
            lag_s,
            amplitude,
            marker,
            color=BLUE,
            markerfacecolor=fill,
            markersize=5.5,
            label=f"{role} participants",
        )
    axes.set_xlabel("lag (s): anticipating left, delayed right")
    axes.set_ylabel("amplitude: under-correcting below, over above")
    _legend(figure, axes)
    return figure


def error_figure(people: Mapping[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """Each person's mean label error before and after mapping; below the diagonal it fell.

    Args:
        people: mean errors before and after, (people,) each, by role.

    Raises:
        InvalidConfig: nobody.
    """
    everyone = [values for pair in people.values() for values in pair if len(values)]
    if not everyone:
        raise InvalidConfig("Nobody has held-out labels; there is nothing to draw.")
    largest = 1.08 * max(float(values.max()) for values in everyone) or 1.0  # nobody erred
    figure = new_figure(5.4, 4.7)
    axes = figure.add_subplot()
    quiet(axes)
    axes.fill_between([0, largest], [0, largest], color=BLUE, alpha=0.06, linewidth=0)
    axes.plot([0, largest], [0, largest], color=MUTED, linewidth=0.9)
    for role, (before, after) in people.items():
        marker, fill = _MARKERS[role]
        better = int((after < before).sum())
        axes.plot(
            before,
            after,
            marker,
            color=BLUE,
            markerfacecolor=fill,
            markersize=5.5,
            label=f"{role} participants: {better} of {len(after)} improved",
        )
    axes.set(xlim=(0, largest), ylim=(0, largest), aspect="equal")
    axes.set(xlabel="mean label error as given", ylabel="mean label error as mapped")
    _legend(figure, axes)
    return figure


def learning_curves_figure(metrics: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Means by round with 95 % intervals over people, a panel a metric that has rounds.

    Args:
        metrics: by metric, ``curves`` by condition as in ``tables.json``.

    Raises:
        InvalidConfig: no metric has rounds.
    """
    shown = [name for name, found in metrics.items() if any(found["curves"].values())]
    if not shown:
        raise InvalidConfig("No outcome has rounds; there is no curve to draw.")
    figure = new_figure(8.6, 3.6 if len(shown) > 1 else 4.2)
    panels: Sequence[Axes] = np.atleast_1d(figure.subplots(1, len(shown))).tolist()
    names = list(dict.fromkeys(name for metric in shown for name in metrics[metric]["curves"]))
    looks = learner_looks(names)
    for axes, metric in zip(panels, shown, strict=True):
        quiet(axes, grid="y")
        for name, curve in metrics[metric]["curves"].items():
            rounds = [one["round"] for one in curve]
            axes.plot(
                rounds,
                [one["mean"] for one in curve],
                color=looks[name].colour,
                linestyle=looks[name].line,
                linewidth=1.6,
                marker=SEEN_MARKER,
                markersize=3,
                label=learner_name(name),
            )
            known = [one for one in curve if isinstance(one["ci95"], list)]
            if known:
                low, high = np.array([one["ci95"] for one in known]).T
                at = [one["round"] for one in known]
                axes.fill_between(at, low, high, color=looks[name].colour, alpha=0.1, linewidth=0)
        axes.set_title(METRIC_WORDS.get(metric, metric), size=TEXT_PT, color=INK, loc="left")
        axes.set_xlabel("round")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _legend(figure, panels[0], columns=min(5, len(names)))
    return figure


def _legend(figure: Figure, axes: Axes, *, columns: int = 2) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper right",
        ncols=columns,
        fontsize=SMALL_PT,
        frameon=False,
    )
