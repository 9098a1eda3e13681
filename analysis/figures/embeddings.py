"""What the embeddings hold: people on the two directions of w that follow gain and delay."""

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from steerlab.analysis.figures.look import (
    COLOUR_MAP,
    INK,
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


def style_directions(embeddings: FloatArray, gain: FloatArray, delay_s: FloatArray) -> FloatArray:
    """The unit directions of w along which log gain and delay grow, by least squares.

    Args:
        embeddings: (people, d).
        gain: (people,) true gains, positive.
        delay_s: (people,) true delays.

    Returns:
        (d, 2): a column for gain, a column for delay; a zero column if a style does not vary.
    """
    centred = embeddings - embeddings.mean(axis=0)
    style = np.column_stack([np.log(gain), delay_s])
    slopes = np.linalg.lstsq(centred, style - style.mean(axis=0), rcond=None)[0]
    lengths = np.linalg.norm(slopes, axis=0)
    return slopes / np.where(lengths > 1e-12, lengths, 1.0)


def embedding_figure(
    embeddings_seen: FloatArray,
    embeddings_new: FloatArray,
    gain: FloatArray,
    delay_s: FloatArray,
) -> Figure:
    """Two views of one plane, coloured by gain and by delay.

    The directions are fitted to the seen people only; the new ones are placed in their plane.

    Args:
        embeddings_seen: (P, d), the people the mapper was trained on.
        embeddings_new: (Q, d), people it has never seen.
        gain: (P + Q,) true gains, the seen people's first.
        delay_s: (P + Q,) true delays, likewise.

    Raises:
        InvalidConfig: lengths do not match, fewer than three people are seen, or a gain is not
            positive.
    """
    people = len(embeddings_seen) + len(embeddings_new)
    if len(gain) != people or len(delay_s) != people:
        raise InvalidConfig(
            f"{people} embeddings, {len(gain)} gains and {len(delay_s)} delays; give one each."
        )
    if len(embeddings_seen) < 3 or np.min(gain) <= 0.0:
        raise InvalidConfig(
            f"{len(embeddings_seen)} seen people with gains from {np.min(gain)}; the plane needs "
            f"three or more, with positive gains."
        )
    seen = slice(0, len(embeddings_seen))
    directions = style_directions(embeddings_seen, gain[seen], delay_s[seen])
    centred = np.vstack([embeddings_seen, embeddings_new]) - embeddings_seen.mean(axis=0)
    plane = centred @ directions
    figure = new_figure(8.6, 4.2)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, title, values, norm in (
        (panels[0], "coloured by gain (log scale)", gain, _log_norm(gain)),
        (panels[1], "coloured by delay (s)", delay_s, Normalize(delay_s.min(), delay_s.max())),
    ):
        quiet(axes)
        drawn = None
        for marker, rows, label in (
            (SEEN_MARKER, seen, "seen people"),
            (NEW_MARKER, slice(len(embeddings_seen), None), "new people"),
        ):
            drawn = axes.scatter(
                *plane[rows].T,
                c=values[rows],
                norm=norm,
                cmap=COLOUR_MAP,
                marker=marker,
                s=38,
                edgecolors=INK,
                linewidths=0.5,
                label=label,
            )
        axes.set_title(title, size=TEXT_PT, color=INK, loc="left")
        axes.set_xlabel("w along its gain direction")
        bar = figure.colorbar(drawn, ax=axes, location="bottom", shrink=0.9, aspect=32, pad=0.02)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=SMALL_PT, length=2)
        if isinstance(norm, LogNorm):
            bar.ax.xaxis.set_major_locator(FixedLocator(_gain_ticks(gain)))
            bar.ax.xaxis.set_minor_locator(NullLocator())
            bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
    panels[0].set_ylabel("w along its delay direction")
    key = figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside upper right",
        ncols=2,
        fontsize=SMALL_PT,
        frameon=False,
    )
    for handle in filter(None, key.legend_handles):
        handle.set(array=None, facecolor=PAPER)  # its marker tells, not its colour
    return figure


def _log_norm(gain: FloatArray) -> LogNorm:
    low, high = float(gain.min()), float(gain.max())
    return LogNorm(low, high if high > low else low * 1.01)


def _gain_ticks(gain: FloatArray) -> list[float]:
    """Halves and doubles within the range, or its ends where it is too narrow for two of them."""
    low, high = float(gain.min()), float(gain.max())
    ticks = [2.0**power for power in range(-6, 7) if low <= 2.0**power <= high]
    return ticks if len(ticks) > 1 else [low, high]
