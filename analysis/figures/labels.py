"""One teacher's labels before and after mapping, beside the oracle's."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from steerlab.analysis.figures.look import (
    BLUE,
    INK,
    MUTED,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    halo,
    new_figure,
    quiet,
)
from steerlab.analysis.figures.placement import spread
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

_HEIGHT_IN = 4.6


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
    """Each line's name at its right end, in its colour."""
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
            color=colours.get(name, INK),
            size=TEXT_PT,
            weight="bold",
            va="center",
            path_effects=halo(),
        )
