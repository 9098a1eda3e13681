"""The ladder: how much of the label error each method removed, for seen and for new people."""

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
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
    "eb_nonlinear": "a window per person, learned prior",
    "sim_pretrained": "pre-trained on simulated people",
    "sim_pretrained_context": "pre-trained, with the car's motion",
    "true_style": "network told the true style",
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
    figure = new_figure(4.9, 0.9 + 0.47 * len(methods))
    axes = figure.add_subplot()
    quiet(axes, grid="x")
    axes.axvline(0.0, color=INK, linewidth=0.9)
    for row, method in enumerate(methods):
        ours = method == "mind_meld"
        colour = BLUE if ours else MUTED
        # Above its dots, not beside them: the figure stays narrow enough for a phone. At the left
        # edge, not at 0 %: one method far below the others must not push the names out.
        axes.annotate(
            method_name(method),
            (0.0, row + 0.2),
            xycoords=("axes fraction", "data"),
            xytext=(2, 0),
            textcoords="offset points",
            size=TEXT_PT,
            color=BLUE if ours else INK,
            weight="bold" if ours else "normal",
            va="bottom",
            bbox={"facecolor": PAPER, "edgecolor": "none", "pad": 0.8},
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
    _name_markers(axes)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_ylim(-0.5, len(methods) - 0.35)
    axes.xaxis.set_major_formatter(PercentFormatter(xmax=1.0, decimals=0))
    axes.set_xlabel("label error removed, with 95 % confidence interval")
    return figure


def _name_markers(axes: Axes) -> None:
    """Which marker is which, once, above the rows."""
    keys = [
        Line2D([], [], marker=marker, color=MUTED, markerfacecolor=fill, markersize=6.0, label=name)
        for marker, fill, name in (
            (SEEN_MARKER, PAPER, "seen people"),
            (NEW_MARKER, MUTED, "new people"),
        )
    ]
    axes.legend(
        handles=keys,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=2,
        frameon=False,
        borderaxespad=0.2,
        fontsize=SMALL_PT,
        labelcolor=INK,
        handlelength=1.6,
        columnspacing=1.4,
    )
