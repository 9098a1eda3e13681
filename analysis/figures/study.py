"""Figures of a study's analysis: what w is associated with, styles, label errors, learning curves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from steerlab.analysis.figures.labels import before_after_figure
from steerlab.analysis.figures.look import (
    BLUE,
    INK,
    MUTED,
    NEW_MARKER,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    learner_looks,
    new_figure,
    quiet,
)
from steerlab.analysis.wording import learner_name
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_MARKERS = {"training": (SEEN_MARKER, PAPER), "test": (NEW_MARKER, BLUE)}
METRIC_WORDS = {
    "success": "drives that reach the ball",
    "final_distance_m": "final distance (m)",
    "label_mae": "mean label error (wheel units)",
}
_ROW_IN = 0.33  # height of a construct's row


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
    axes.set_xlabel("lag (s): early left of 0, late right of it")
    axes.set_ylabel("amplitude (wheel units): too much above 0")
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
    figure, axes = before_after_figure(largest)
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
    axes.set(
        xlabel="mean label error as given (wheel units)",
        ylabel="mean label error as mapped (wheel units)",
    )
    _legend(figure, axes)
    return figure


def learning_curves_figure(metrics: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Means by round with 95 % intervals over enough people, a panel a metric that has rounds.

    Args:
        metrics: by metric, ``curves`` by condition as in ``tables.json``.

    Raises:
        InvalidConfig: no metric has rounds.
    """
    shown = [name for name, metric in metrics.items() if any(metric["curves"].values())]
    if not shown:
        raise InvalidConfig("No outcome has rounds; there is no curve to draw.")
    figure = new_figure(8.6, 3.6 if len(shown) > 1 else 4.2)
    panels: Sequence[Axes] = np.atleast_1d(figure.subplots(1, len(shown))).tolist()
    names = list(dict.fromkeys(name for metric in shown for name in metrics[metric]["curves"]))
    looks = learner_looks(names)
    for axes, metric in zip(panels, shown, strict=True):
        quiet(axes, grid="y")
        for name, curve in metrics[metric]["curves"].items():
            rounds = [row["round"] for row in curve]
            axes.plot(
                rounds,
                [row["mean"] for row in curve],
                color=looks[name].colour,
                linestyle=looks[name].line,
                linewidth=1.6,
                marker=SEEN_MARKER,
                markersize=3,
                label=learner_name(name),
            )
            known = [row for row in curve if row["too_few"] is None]
            if known:
                low, high = np.array([row["ci95"] for row in known]).T
                rounds = [row["round"] for row in known]
                axes.fill_between(
                    rounds, low, high, color=looks[name].colour, alpha=0.1, linewidth=0
                )
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


@dataclass(frozen=True, kw_only=True)
class Association:
    """Multiple R of w with one construct.

    Attributes:
        low, high: limits of the 95 % interval of ``r``.
        significant: the corrected p-value is below alpha.
    """

    title: str
    r: float
    low: float
    high: float
    significant: bool


def association_figure(rows: Sequence[Association], *, by_chance: float) -> Figure:
    """Multiple R with its interval, a row a construct, in the order given.

    Args:
        by_chance: the R that an embedding of this size has with nothing, on average.

    Raises:
        InvalidConfig: no row.
    """
    if not rows:
        raise InvalidConfig("No construct could be tested; there is nothing to draw.")
    figure = new_figure(8.6, 0.9 + _ROW_IN * len(rows))
    axes = figure.add_subplot()
    quiet(axes, grid="x")
    axes.axvline(by_chance, color=MUTED, linewidth=0.9, linestyle="--")
    for height, row in enumerate(rows):
        axes.plot([row.low, row.high], [height, height], color=BLUE, linewidth=1.4)
        axes.plot(
            row.r,
            height,
            SEEN_MARKER,
            color=BLUE,
            markerfacecolor=BLUE if row.significant else PAPER,
            markersize=6.5,
            markeredgewidth=1.3,
        )
    axes.set_yticks(range(len(rows)), [row.title for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("multiple R of w with 95 % interval (0: w says nothing of it, 1: all of it)")
    axes.tick_params(axis="y", labelsize=TEXT_PT, labelcolor=INK, length=0)
    shown = [
        Line2D(
            [], [], color=BLUE, marker=SEEN_MARKER, linestyle="none", label="significant (Holm)"
        ),
        Line2D(
            *([], []),
            color=BLUE,
            marker=SEEN_MARKER,
            markerfacecolor=PAPER,
            linestyle="none",
            label="not significant",
        ),
        Line2D([], [], color=MUTED, linestyle="--", label="R by chance alone, on average"),
    ]
    figure.legend(
        handles=shown, loc="outside upper right", ncols=3, fontsize=SMALL_PT, frameon=False
    )
    return figure


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A style metric of each person, and what a plane over w gives for it, (people,) each."""

    title: str
    unit: str
    metric: FloatArray
    by_w: FloatArray
    r: float


def prediction_figure(panels: Sequence[Prediction]) -> Figure:
    """Style metrics against their best linear prediction from w, with the line where both are equal.

    Raises:
        InvalidConfig: no panel.
    """
    if not panels:
        raise InvalidConfig("No style metric goes with w; there is nothing to draw.")
    figure = new_figure(8.6, 4.2)
    for axes, panel in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        quiet(axes)
        both = np.concatenate([panel.metric, panel.by_w])
        ends = [float(both.min()), float(both.max())]
        axes.plot(ends, ends, color=MUTED, linewidth=0.9)
        axes.plot(panel.by_w, panel.metric, SEEN_MARKER, color=BLUE, markersize=5, alpha=0.75)
        axes.set_title(f"{panel.title}, R = {panel.r:.2f}", size=TEXT_PT, color=INK, loc="left")
        axes.set(xlabel="as w predicts it", ylabel=f"as measured ({panel.unit})")
    return figure


def plane_over(w: FloatArray, values: FloatArray) -> FloatArray:
    """The best linear prediction of ``values`` (n,) from ``w`` (n, d), in sample."""
    design = np.column_stack([np.ones(len(w)), w])
    return design @ np.linalg.lstsq(design, values, rcond=None)[0]
