"""The loop in which a teacher labels a rollout: the same for a wheel and for a script.

Everything is indexed by control step. Only the clock knows of wall time: a wheel's clock waits
for each step's deadline, a script's does not wait at all.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from steerlab.sim.rollout import FloatArray, Rollout
from steerlab.sim.teachers import Teacher

OnLabel = Callable[[int, float | None], None]


class Clock(Protocol):
    """Says when a control step is due."""

    def wait_for(self, step: int) -> None:
        """Return when ``step`` is due."""
        ...


class NullClock:
    """Every step is due at once: simulated teachers need no time."""

    def wait_for(self, step: int) -> None:
        """Return at once."""


def label_rollout(
    rollout: Rollout,
    teacher: Teacher,
    *,
    order: int,
    attempt: int = 0,
    clock: Clock,
    on_label: OnLabel | None = None,
) -> FloatArray:
    """Let ``teacher`` watch ``rollout`` and label each of its steps.

    Args:
        order: the rollout's place in the teacher's session, from 0.
        on_label: called with each step and its label as it is given, to keep it.

    Returns:
        (steps,) labels in [-2.5, 2.5]; NaN where the teacher gave none.
    """
    teacher.begin(rollout, order=order, attempt=attempt)
    labels = np.full(rollout.steps, np.nan)
    for step in range(rollout.steps):
        clock.wait_for(step)
        label = teacher.label(step)
        if label is not None:
            labels[step] = label
        if on_label is not None:
            on_label(step, label)
    return labels
