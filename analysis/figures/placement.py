"""Where direct labels go, so that they cover neither the data nor each other."""

from collections.abc import Sequence

import numpy as np

from steerlab.sim.arrays import FloatArray


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
    """Which candidate centre leaves a label of this size the farthest from what is taken.

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
