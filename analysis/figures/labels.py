"""Labels before and after mapping: one teacher's over time, by method, and person by person."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from steerlab.analysis.figures.look import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    NEW_MARKER,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    halo,
    new_figure,
    quiet,
    spread,
)
from steerlab.analysis.wording import method_name
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

_HEIGHT_IN = 4.6  # of the label figure
_SEEN_LIFT, _NEW_LIFT = 0.07, -0.2  # above and below a method's row
_CROWD = 300  # people of a split; beyond it points are small and faint, and pixels, not shapes
_CROWD_INK = 800.0  # points that lie on each other must not all be black
_CROWD_DPI = 200

Interval = tuple[float, float, float]
"""A value and the lower and upper limit of its confidence interval."""


def label_figure(
    t_s: FloatArray,
    raw: FloatArray,
    mapped: FloatArray,
    truth: FloatArray,
    saturation: float = WHEEL_LIMIT,
) -> Figure:
    """Labels over time, and below how far they are from the oracle's.

    Args:
        t_s: (steps,) time in the rollout.
        raw: (steps,) the teacher's label; NaN where there is none, which leaves a gap.
        mapped: (steps,) the mapper's label, likewise.
        truth: (steps,) the oracle's label, likewise.
        saturation: the wheel's limit, drawn on both sides.

    Raises:
        InvalidConfig: the arrays differ in length, or hold no step with all three labels.
    """
    named = {"t_s": t_s, "raw": raw, "mapped": mapped, "truth": truth}
    shapes = {name: np.shape(v) for name, v in named.items()}
    if len(set(shapes.values())) != 1 or len(np.shape(t_s)) != 1:
        raise InvalidConfig(f"Labels of different shapes: {shapes}; give one value a step.")
    if not np.isfinite(raw + mapped + truth).any():
        raise InvalidConfig("No step has a raw, a mapped and a true label; choose another rollout.")
    figure = new_figure(8.6, _HEIGHT_IN)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.1, 1.0))
    for axes in (above, below):
        quiet(axes, grid="y")
        span_s = max(t_s[-1] - t_s[0], 1e-3)  # of a single step there is none
        axes.set_xlim(t_s[0], t_s[0] + span_s * 1.17)  # room for the lines' names
    for side in (-saturation, saturation):
        above.axhline(side, color=MUTED, linewidth=0.8, linestyle=(0, (2, 3)))
    above.annotate(
        "wheel at its limit",
        (t_s[0], saturation),
        xytext=(4, 2),
        textcoords="offset points",
        size=SMALL_PT,
        color=MUTED,
        va="bottom",
    )
    above.plot(t_s, truth, color=VERMILLION, linewidth=2.6, alpha=0.9, label="oracle")
    above.plot(t_s, raw, color=MUTED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="teacher")
    above.plot(t_s, mapped, color=BLUE, linewidth=1.6, label="mapped")
    above.set(ylim=(-1.16 * saturation, 1.16 * saturation), ylabel="wheel label\n(left positive)")
    before, after = np.abs(raw - truth), np.abs(mapped - truth)
    below.fill_between(t_s, before, color=MUTED, alpha=0.28, linewidth=0, label="before")
    below.plot(t_s, before, color=MUTED, linewidth=0.9)
    below.fill_between(t_s, after, color=BLUE, alpha=0.45, linewidth=0, label="after")
    below.plot(t_s, after, color=BLUE, linewidth=1.1)
    below.set(xlabel="time in the rollout (s)", ylabel="distance from\nthe oracle")
    below.set_ylim(bottom=0.0)
    _name_lines(above, t_s, (("oracle", truth), ("teacher", raw), ("mapped", mapped)), 2.1)
    _name_lines(below, t_s, (("before", before), ("after", after)), 1.0)
    return figure


def _name_lines(
    axes: Axes, t_s: FloatArray, lines: tuple[tuple[str, FloatArray], ...], share: float
) -> None:
    """Each line's name at its right end, in its colour; ``share`` is the panel's of the height."""
    colours = {"oracle": VERMILLION, "teacher": MUTED, "mapped": BLUE}
    colours |= {"before": MUTED, "after": BLUE}
    ends = [float(values[np.isfinite(values)][-1]) for _, values in lines]
    low, high = axes.get_ylim()
    height_in = 0.8 * _HEIGHT_IN * share / 3.1
    gap = (high - low) * 0.17 / height_in
    heights = np.array(spread(ends, gap))
    heights += max(0.0, low + gap / 2.0 - heights.min())  # not onto the axis below
    for (name, _), height in zip(lines, heights, strict=True):
        axes.annotate(
            name,
            (t_s[-1], height),
            xytext=(8, 0),
            textcoords="offset points",
            color=colours[name],
            size=TEXT_PT,
            weight="bold",
            va="center",
            path_effects=halo(),
        )


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


def before_after_figure(largest: float) -> tuple[Figure, Axes]:
    """Square axes from 0 to ``largest``; the half below the diagonal, where errors fell, is shaded."""
    figure = new_figure(5.4, 4.7)
    axes = figure.add_subplot()
    quiet(axes)
    axes.fill_between([0, largest], [0, largest], color=BLUE, alpha=0.06, linewidth=0)
    axes.plot([0, largest], [0, largest], color=MUTED, linewidth=0.9)
    axes.set(xlim=(0, largest), ylim=(0, largest), aspect="equal")
    return figure, axes


def people_figure(people: Mapping[str, tuple[FloatArray, FloatArray]]) -> Figure:
    """Each person as a point: below the diagonal the labels got better.

    Args:
        people: by split (``seen``, ``new``), the mean error of each person's labels before and
            after, (people,) each, in wheel units.

    Raises:
        InvalidConfig: a split is missing or empty, or its arrays differ in length.
    """
    for split in ("seen", "new"):
        before, after = people.get(split, (np.empty(0), np.empty(0)))
        if not len(before) or np.shape(before) != np.shape(after):
            raise InvalidConfig(
                f"Split {split!r} has {len(before)} errors before and {len(after)} after; give "
                f"one of each for every person."
            )
    largest = 1.08 * max(float(np.max(values)) for pair in people.values() for values in pair)
    figure, axes = before_after_figure(largest)
    axes.text(
        0.55 * largest,
        0.57 * largest,
        "no change",
        size=SMALL_PT,
        color=MUTED,
        rotation=45,
        rotation_mode="anchor",
        va="bottom",
    )
    most = max(len(before) for before, _ in people.values())
    crowd = most > _CROWD
    if crowd:
        figure.set_dpi(_CROWD_DPI)
    for split, marker, fill in (("seen", SEEN_MARKER, PAPER), ("new", NEW_MARKER, BLUE)):
        before, after = people[split]
        size = 5.5 if split == "seen" else 4.8
        axes.plot(
            before,
            after,
            marker,
            color=BLUE,
            markerfacecolor=fill,
            markersize=0.5 * size if crowd else size,
            markeredgewidth=0.5 if crowd else 1.1,
            alpha=float(np.clip(_CROWD_INK / most, 0.12, 0.5)) if crowd else None,
            rasterized=crowd,
            label=f"{split} people",
        )
    lines = [
        f"{'○' if split == 'seen' else '◆'} {np.sum(after < before)} of {len(after)} "
        f"{split} people improved"
        for split, (before, after) in people.items()
    ]
    axes.text(
        0.03,
        0.97,
        "\n".join(lines),
        transform=axes.transAxes,
        size=TEXT_PT,
        color=INK,
        va="top",
        linespacing=1.5,
        bbox={"facecolor": PAPER, "edgecolor": FAINT, "boxstyle": "round,pad=0.5"},
    )
    axes.set(xlabel="mean label error before", ylabel="mean label error after")
    return figure
