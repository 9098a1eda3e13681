"""Power by sample size, with Monte-Carlo error."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.look import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    new_figure,
    quiet,
)
from steerlab.analysis.power_study.curves import TARGETS, PowerCurve
from steerlab.analysis.power_study.simulated_studies import HOLM
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_COLOURS = (BLUE, VERMILLION, "#009E73", "#CC79A7", "#E69F00", "#56B4E9", INK)
_LINES = ("-", ":")  # dashed is after Holm


def power_figure(curves: Sequence[PowerCurve]) -> Figure:
    """A line a test; bars are 1.96 Monte-Carlo errors, thin lines the powers one plans for.

    Raises:
        InvalidConfig: no curve.
    """
    if not curves:
        raise InvalidConfig("No test was simulated; there is no curve to draw.")
    figure = new_figure(8.6, 4.0 + 0.18 * len(curves))
    axes = figure.add_subplot()
    quiet(axes, grid="y")
    for target in TARGETS:
        axes.axhline(target, color=FAINT, linewidth=1.4)
        axes.annotate(
            f"{100 * target:.0f} %",
            (1.0, target),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            size=SMALL_PT,
            color=MUTED,
        )
    plain = list(dict.fromkeys(curve.test.removesuffix(HOLM) for curve in curves))
    for curve in curves:
        row = plain.index(curve.test.removesuffix(HOLM))
        axes.errorbar(
            curve.people,
            curve.power,
            yerr=1.96 * curve.error,
            color=_COLOURS[row % len(_COLOURS)],
            linestyle="--" if curve.test.endswith(HOLM) else _LINES[row // len(_COLOURS) % 2],
            marker=SEEN_MARKER,
            markersize=3.5,
            linewidth=1.5,
            elinewidth=0.9,
            label=curve.test,
        )
    axes.set_xscale("function", functions=(_root, _square))
    axes.set_xticks(curves[0].people, [str(size) for size in curves[0].people])
    axes.set_ylim(-0.02, 1.04)
    axes.set_xlabel("people (root scale)", size=TEXT_PT)
    axes.set_ylabel("share of studies that reject")
    figure.legend(loc="outside lower center", ncols=2, fontsize=SMALL_PT, frameon=False)
    return figure


def _root(values: FloatArray) -> FloatArray:
    return np.sqrt(np.abs(values))


def _square(values: FloatArray) -> FloatArray:
    return values**2
