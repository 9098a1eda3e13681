"""How every figure looks: colours, type sizes, axes, each learner's line, and where labels go."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke

from steerlab.sim.arrays import FloatArray

# Okabe & Ito, "Color Universal Design" (2008). One meaning each, in all figures.
INK = "#1b1f24"
MUTED = "#646b75"
FAINT = "#d5d9de"
BLUE = "#0072B2"  # what was learned or driven: MIND MELD, the rollout
VERMILLION = "#D55E00"  # the oracle
GREEN = "#009E73"  # the goal
PAPER = "#ffffff"

SEEN_MARKER = "o"  # people the mapper was trained on
NEW_MARKER = "D"  # people it has never seen
COLOUR_MAP = "viridis"

TEXT_PT = 9.5
SMALL_PT = 8.5

# Of learners: MIND MELD and the oracle have the colours they have in all figures.
_LEARNER_COLOURS = {"mind-meld": BLUE, "oracle": VERMILLION, "dagger": INK, "bc": "#E69F00"}
_OTHER_COLOURS = ("#CC79A7", "#009E73", "#56B4E9", "#8C6D31", "#7B61A8", MUTED)
_DASHES = ("--", ":", "-.")


@dataclass(frozen=True, slots=True)
class LearnerLook:
    """How one learner is drawn."""

    colour: str
    line: str


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure on white, laid out so that nothing overlaps the edges."""
    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor=PAPER)


def quiet(axes: Axes, *, grid: Literal["x", "y"] | None = None) -> None:
    """Make axes unobtrusive: two thin spines, small grey ticks, a faint grid along ``grid``."""
    axes.set_facecolor(PAPER)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(MUTED)
        axes.spines[side].set_linewidth(0.7)
    axes.tick_params(labelsize=SMALL_PT, colors=MUTED, width=0.7, length=3)
    axes.xaxis.label.set(size=TEXT_PT, color=INK)
    axes.yaxis.label.set(size=TEXT_PT, color=INK)
    if grid:
        axes.grid(axis=grid, color=FAINT, linewidth=0.6)
        axes.set_axisbelow(True)


def halo() -> list[AbstractPathEffect]:
    """A white rim around text that stands on lines."""
    return [withStroke(linewidth=2.6, foreground=PAPER)]


def learner_looks(names: Sequence[str]) -> dict[str, LearnerLook]:
    """Each learner's colour and line, in the order given; well-known learners always have the same."""
    known = {name: _LEARNER_COLOURS.get(name.replace("_", "-")) for name in names}
    looks = {name: LearnerLook(colour, "-") for name, colour in known.items() if colour}
    others = [name for name in names if name not in looks]
    for row, name in enumerate(others):
        line = _DASHES[row // len(_OTHER_COLOURS) % len(_DASHES)]
        looks[name] = LearnerLook(_OTHER_COLOURS[row % len(_OTHER_COLOURS)], line)
    return {name: looks[name] for name in names}


def spread(wanted: Sequence[float], gap: float) -> list[float]:
    """Positions close to ``wanted``, in the same order, at least ``gap`` apart.

    Groups of labels that would touch are centred on the mean of what they name.
    """
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    groups: list[tuple[float, list[int]]] = []  # centre, members
    for i in order:
        groups.append((wanted[i], [i]))
        while len(groups) > 1:
            (low, below), (high, above) = groups[-2:]
            if high - low >= gap * (len(below) + len(above)) / 2.0:
                break
            members = below + above
            centre = float(np.mean([wanted[member] for member in members]))
            groups[-2:] = [(centre, members)]
    placed = [0.0] * len(wanted)
    for centre, members in groups:
        for rank, member in enumerate(members):
            placed[member] = centre + gap * (rank - (len(members) - 1) / 2.0)
    return placed


def clearest_spot(candidates: FloatArray, size: tuple[float, float], taken: FloatArray) -> int:
    """The candidate centre that leaves a label of this size farthest from what is taken.

    Args:
        candidates: (n, 2) possible centres; earlier ones win ties.
        size: width and height of the label.
        taken: (m, 2) points that should stay uncovered.

    Returns:
        Index of the best candidate.
    """
    if len(taken) == 0:
        return 0
    away = np.abs(candidates[:, None, :] - taken[None, :, :]) - np.asarray(size) / 2.0
    # Distance from a point to the label's box; negative is how deep it lies inside.
    outside = np.hypot(*np.moveaxis(np.maximum(away, 0.0), 2, 0))
    inside = np.minimum(away.max(axis=2), 0.0)
    return int(np.argmax((outside + inside).min(axis=1)))
