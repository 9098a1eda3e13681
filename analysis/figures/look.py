"""How every figure looks: colours safe for colour-blind readers, type sizes, quiet axes."""

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke

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


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure on white, laid out so that nothing overlaps the edges."""
    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor=PAPER)


def quiet(axes: Axes, *, grid: Literal["x", "y"] | None = None) -> None:
    """Axes that step back: two thin spines, small grey ticks, a faint grid along ``grid``."""
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
