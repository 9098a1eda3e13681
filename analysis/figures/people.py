"""Person by person: the mean label error before and after mapping."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

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
    new_figure,
    quiet,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

_CROWD = 300  # people of a split; beyond it points are small and faint, and pixels, not shapes
_CROWD_INK = 800.0  # points that lie on each other must not all be black
_CROWD_DPI = 200


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
    figure = new_figure(5.4, 4.7)
    axes = figure.add_subplot()
    quiet(axes)
    axes.fill_between([0, largest], [0, largest], color=BLUE, alpha=0.06, linewidth=0)
    axes.plot([0, largest], [0, largest], color=MUTED, linewidth=0.9)
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
    axes.set(xlim=(0, largest), ylim=(0, largest), aspect="equal")
    axes.set(xlabel="mean label error before", ylabel="mean label error after")
    return figure
