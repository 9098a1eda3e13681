"""The ladder: how much of the label error each method removed, for seen and for new people."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from steerlab.analysis.figures.look import (
    BLUE,
    INK,
    MUTED,
    NEW_MARKER,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    halo,
    new_figure,
    quiet,
)
from steerlab.sim.errors import InvalidConfig

Interval = tuple[float, float, float]
"""A value and the lower and upper limit of its confidence interval."""

_SEEN_LIFT, _NEW_LIFT = 0.07, -0.2  # above and below a method's row

_NAMES = {
    "identity": "labels as given",
    "shared_gain": "one gain for all",
    "person_gain": "a gain per person",
    "person_gain_lag": "a gain and lag per person",
    "shared_ridge": "one linear window for all",
    "person_ridge": "a linear window per person",
    "no_embedding": "network without embedding",
    "mean_embedding": "MIND MELD with one embedding for all",
    "shuffled_embedding": "MIND MELD with shuffled embeddings",
    "mind_meld": "MIND MELD",
    "mind_meld_paper": "MIND MELD, the paper's settings",
    "true_style": "true style known (ceiling)",
}


def method_name(method: str) -> str:
    """A method's key in words; an unknown key is shown as it is, without underscores."""
    return _NAMES.get(method, method.replace("_", " "))


def improvement_figure(ladder: Mapping[str, Mapping[str, Interval]]) -> Figure:
    """A dot per method and split with its interval; the best method for new people is on top.

    Args:
        ladder: by method and then split (``seen``, ``new``), the improvement as a fraction and the
            limits of its interval.

    Raises:
        InvalidConfig: there is no method, or one lacks a split.
    """
    if not ladder:
        raise InvalidConfig("The ladder has no method; give at least one.")
    for method, splits in ladder.items():
        if set(splits) != {"seen", "new"}:
            raise InvalidConfig(f"{method!r} has {sorted(splits)}; give ['new', 'seen'].")
    methods = sorted(ladder, key=lambda method: ladder[method]["new"][0])
    figure = new_figure(5.6, 0.8 + 0.58 * len(methods))
    axes = figure.add_subplot()
    quiet(axes, grid="x")
    axes.axvline(0.0, color=INK, linewidth=0.9)
    for row, method in enumerate(methods):
        ours = method == "mind_meld"
        colour = BLUE if ours else MUTED
        # Above its dots, not beside them: the figure stays narrow enough for a phone.
        axes.annotate(
            method_name(method),
            (0.0, row + 0.2),
            xytext=(5, 0),
            textcoords="offset points",
            size=TEXT_PT,
            color=BLUE if ours else INK,
            weight="bold" if ours else "normal",
            va="bottom",
            path_effects=halo(),
        )
        for split, marker, fill, lift in (
            ("seen", SEEN_MARKER, PAPER, _SEEN_LIFT),
            ("new", NEW_MARKER, colour, _NEW_LIFT),
        ):
            value, low, high = ladder[method][split]
            axes.plot([low, high], [row + lift] * 2, color=colour, linewidth=1.6, zorder=2)
            axes.plot(
                value,
                row + lift,
                marker,
                color=colour,
                markerfacecolor=fill,
                markersize=6.5 if marker == SEEN_MARKER else 5.8,
                label=f"{method} {split}",
                zorder=3,
            )
    _name_markers(axes, len(methods) - 1, ladder[methods[-1]])
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_ylim(-0.5, len(methods) - 0.35)
    axes.xaxis.set_major_formatter(PercentFormatter(xmax=1.0, decimals=0))
    axes.set_xlabel("label error removed, with 95 % confidence interval")
    return figure


def _name_markers(axes: Axes, row: int, splits: Mapping[str, Interval]) -> None:
    """Which marker is which, said once, at the top row and on its roomier side."""
    for split, lift in (("seen", _SEEN_LIFT), ("new", _NEW_LIFT)):
        value, low, high = splits[split]
        on_left = value > float(np.mean(axes.get_xlim()))
        axes.annotate(
            f"{split} people",
            (low if on_left else high, row + lift),
            xytext=(-6 if on_left else 6, 0),
            textcoords="offset points",
            size=SMALL_PT,
            color=INK,
            ha="right" if on_left else "left",
            va="center",
            path_effects=halo(),
        )
