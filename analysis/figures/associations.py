"""What w goes together with: R of each construct, and style metrics against what w says of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from steerlab.analysis.figures.look import (
    BLUE,
    INK,
    MUTED,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    new_figure,
    quiet,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_ROW_IN = 0.33


@dataclass(frozen=True, kw_only=True)
class Association:
    """One row; ``found`` where the corrected p-value is below alpha."""

    title: str
    r: float
    low: float
    high: float
    found: bool


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
    for place, row in enumerate(rows):
        axes.plot([row.low, row.high], [place, place], color=BLUE, linewidth=1.4)
        axes.plot(
            row.r,
            place,
            SEEN_MARKER,
            color=BLUE,
            markerfacecolor=BLUE if row.found else PAPER,
            markersize=6.5,
            markeredgewidth=1.3,
        )
    axes.set_yticks(range(len(rows)), [row.title for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("multiple R of w, with 95 % interval")
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
        Line2D([], [], color=MUTED, linestyle="--", label="mean R by chance"),
    ]
    figure.legend(
        handles=shown, loc="outside upper right", ncols=3, fontsize=SMALL_PT, frameon=False
    )
    return figure


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """A style metric of each person, and what a plane over w gives for it, (people,) each."""

    title: str
    metric: FloatArray
    by_w: FloatArray
    r: float


def prediction_figure(panels: Sequence[Prediction]) -> Figure:
    """Style metrics against their best linear prediction from w; on the line it is right.

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
        axes.set(xlabel="as w predicts it", ylabel="as measured")
    return figure


def plane_over(w: FloatArray, values: FloatArray) -> FloatArray:
    """The best linear prediction of ``values`` (n,) from ``w`` (n, d), in sample."""
    design = np.column_stack([np.ones(len(w)), w])
    return design @ np.linalg.lstsq(design, values, rcond=None)[0]
