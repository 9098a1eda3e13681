"""An embedding as one number a person: its first principal component."""

from dataclasses import dataclass

import numpy as np

from steerlab.analysis.statistics.outcome import NotComputable, checked, flat, too_few
from steerlab.sim.rollout import FloatArray


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FirstComponent:
    """Where people lie along the direction in which they differ most.

    Attributes:
        scores: (n,), mean 0.
        direction: (d,), unit length; its largest entry is positive, which settles the sign.
        explained: share of the variance, 1/d to 1. Near 1/d the direction is an accident.
    """

    scores: FloatArray
    direction: FloatArray
    explained: float


def first_component(embedding: FloatArray) -> FirstComponent | NotComputable:
    """First principal component of ``embedding`` (n, d), without rescaling its dimensions.

    Raises:
        InvalidConfig: a value is not finite.
    """
    embedding = checked("embedding", embedding, 2)
    if missing := too_few(len(embedding)):
        return missing
    if all(flat("", column) for column in embedding.T):
        return NotComputable(reason="everyone has the same embedding")
    centred = embedding - embedding.mean(axis=0)
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)
    direction = directions[0] * np.sign(directions[0][np.argmax(np.abs(directions[0]))])
    return FirstComponent(
        scores=centred @ direction,
        direction=direction,
        explained=float(spread[0] ** 2 / np.square(spread).sum()),
    )
