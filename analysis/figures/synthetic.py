"""The paper's figure 2: how the synthetic experiment is made, and what the embeddings hold."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from steerlab.analysis.figures.look import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    NEW_MARKER,
    PAPER,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    new_figure,
    quiet,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

# Okabe & Ito again; none of these has another meaning elsewhere.
TIMING_COLOURS = {"delayed": "#CC79A7", "neither": "#646b75", "anticipatory": "#56B4E9"}
_SMALLEST_PT, _LARGEST_PT = 4.0, 15.0  # diameter of a point at no and at the largest correction


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrators:
    """A group of demonstrators, whom the figure shows as points.

    Attributes:
        gain: (people,) above 1 over-corrects, below 1 under-corrects.
        delay_s: (people,) negative anticipates.
        timing: (people,) keys of ``TIMING_COLOURS``.
        embeddings: (people, 2).
    """

    gain: FloatArray
    delay_s: FloatArray
    timing: Sequence[str]
    embeddings: FloatArray

    def __post_init__(self) -> None:
        shapes = (len(self.gain), len(self.delay_s), len(self.timing), self.embeddings.shape)
        people = len(self.gain)
        if shapes != (people, people, people, (people, 2)) or not people:
            raise InvalidConfig(
                f"gain, delay_s, timing and embeddings are {shapes}; give one each a person, and "
                f"embeddings of 2 dimensions."
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownDrive:
    """One drive's labels in degrees: by timing, one demonstrator's feedback as given and as mapped."""

    t_s: FloatArray
    truth_deg: FloatArray
    feedback_deg: Mapping[str, FloatArray]
    mapped_deg: Mapping[str, FloatArray]


def synthetic_figure(
    paths_m: Sequence[FloatArray],
    goals_m: Sequence[FloatArray],
    shown: ShownDrive,
    seen: Demonstrators,
    new: Demonstrators,
) -> Figure:
    """Panels a to f as the paper's caption has them.

    Args:
        paths_m: (rows, 2) positions of each calibration drive; the first is the one shown.
        goals_m: (2,) of each drive.
        shown: labels of the first drive.
        seen, new: demonstrators.
    """
    figure = new_figure(8.2, 9.8)
    figure.set_layout_engine("constrained", h_pad=0.1, w_pad=0.08)
    grid = figure.subplots(3, 2)
    panels: list[Axes] = list(grid.flat)
    titles = (
        "a  artificial DAgger-like drives",
        "b  ground truth on one drive",
        "c  demonstrators",
        "d  their corrective feedback",
        "e  the same after mapping",
        "f  embeddings w",
    )
    for axes, title in zip(panels, titles, strict=True):
        quiet(axes)
        axes.set_title(title, size=TEXT_PT, color=INK, loc="left", weight="bold")
    _drives(panels[0], paths_m, goals_m)
    lines = [
        (panels[1], {}),
        (panels[3], shown.feedback_deg),
        (panels[4], shown.mapped_deg),
    ]
    for axes, labels in lines:
        _labels(axes, shown, labels)
    largest = 1.08 * max(
        float(np.abs(values).max()) for values in (shown.truth_deg, *shown.feedback_deg.values())
    )
    for axes, _ in lines[1:]:  # feedback before and after on one scale
        axes.set_ylim(-largest, largest)
    _styles(panels[2], seen, new)
    _embeddings(panels[5], seen, new)
    figure.legend(
        handles=_key(),
        loc="outside lower center",
        ncols=4,
        fontsize=SMALL_PT,
        frameon=False,
        labelcolor=INK,
    )
    return figure


def _drives(axes: Axes, paths_m: Sequence[FloatArray], goals_m: Sequence[FloatArray]) -> None:
    for path, goal in zip(paths_m, goals_m, strict=True):
        first = path is paths_m[0]
        width, alpha = (2.2, 1.0) if first else (0.9, 0.5)
        axes.plot(*path.T, color=BLUE, linewidth=width, alpha=alpha, zorder=3 if first else 2)
        axes.plot(*goal, marker="o", color=GREEN, markersize=7 if first else 4.5, linestyle="")
    axes.plot(0.0, 0.0, marker="o", color=INK, markersize=4.5)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal", adjustable="datalim")


def _labels(axes: Axes, shown: ShownDrive, labels: Mapping[str, FloatArray]) -> None:
    axes.axhline(0.0, color=MUTED, linewidth=0.6)
    axes.plot(shown.t_s, shown.truth_deg, color=VERMILLION, linewidth=2.4, alpha=0.85)
    for timing, values in labels.items():
        axes.plot(shown.t_s, values, color=TIMING_COLOURS[timing], linewidth=1.3)
    axes.set(xlabel="time (s)", ylabel="wheel angle (°, left positive)")
    axes.set_xlim(shown.t_s[0], shown.t_s[-1])


def _styles(axes: Axes, seen: Demonstrators, new: Demonstrators) -> None:
    """Gain against shift; people of equal shift are spread a little, so that none hides another."""
    for people, marker in ((seen, SEEN_MARKER), (new, NEW_MARKER)):
        offset = 0.02 * (np.arange(len(people.gain)) % 5 - 2)
        for timing, colour in TIMING_COLOURS.items():
            rows = np.array(people.timing) == timing
            axes.plot(
                people.gain[rows],
                (people.delay_s + offset)[rows],
                marker,
                color=colour,
                markersize=4.5,
                markeredgecolor=INK,
                markeredgewidth=0.4,
            )
    axes.axvline(1.0, color=MUTED, linewidth=0.6)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([0.4, 0.6, 1.0, 1.6, 2.5]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"×{value:g}"))
    axes.set_yticks(sorted({float(value) for value in seen.delay_s}))
    axes.set(xlabel="under-corrects       magnitude       over-corrects", ylabel="delay (s)")


def _embeddings(axes: Axes, seen: Demonstrators, new: Demonstrators) -> None:
    strongest = max(float(np.abs(np.log(people.gain)).max()) for people in (seen, new))
    for people, marker in ((seen, SEEN_MARKER), (new, NEW_MARKER)):
        degree = np.abs(np.log(people.gain)) / max(strongest, 1e-9)
        diameter = _SMALLEST_PT + (_LARGEST_PT - _SMALLEST_PT) * degree
        colours = [TIMING_COLOURS[timing] for timing in people.timing]
        over = people.gain >= 1.0
        for rows, filled in ((over, True), (~over, False)):
            chosen = [colour for colour, row in zip(colours, rows, strict=True) if row]
            axes.scatter(
                *people.embeddings[rows].T,
                s=diameter[rows] ** 2 * (1.0 if marker == SEEN_MARKER else 0.75),
                marker=marker,
                facecolors=chosen if filled else PAPER,
                edgecolors=INK if filled else chosen,
                linewidths=0.5 if filled else 1.8,
                alpha=0.85,
            )
    axes.set(xlabel="first dimension of w", ylabel="second dimension of w")
    axes.margins(0.08)


def _key() -> list[Line2D]:
    def dot(colour: str, label: str, **changes: object) -> Line2D:
        style = {
            "marker": SEEN_MARKER,
            "linestyle": "",
            "color": colour,
            "markersize": 7.0,
            **changes,
        }
        return Line2D([], [], label=label, **style)

    hollow = {"markerfacecolor": PAPER, "markeredgecolor": MUTED}
    return [
        *(dot(colour, timing) for timing, colour in TIMING_COLOURS.items()),
        Line2D([], [], color=VERMILLION, linewidth=2.4, label="ground truth"),
        dot(MUTED, "over-corrects (f)"),
        dot(MUTED, "under-corrects (f)", markeredgewidth=1.8, **hollow),
        dot(MUTED, "seen people", markersize=5.0, **hollow),
        dot(MUTED, "new people", marker=NEW_MARKER, markersize=5.0, **hollow),
    ]
