"""When people correct: those who only correct what is wrong leave the wheel centred otherwise."""

import numpy as np

from steerlab.sim.arrays import BoolArray, FloatArray

HYSTERESIS = 0.2
"""People begin to correct at 1.2 times their tolerance and stop below 0.8 times it, so a difference
that hovers about it does not make them let go and grip again at every step; an assumption."""


def correcting(difference: FloatArray, tolerance: float) -> BoolArray:
    """Whether someone corrects, step by step; before the first step they do not.

    Args:
        difference: (steps,) between what the wheel should be and what the robot's is, in wheel
            units, as they perceive it; NaN where no robot drives, and where they therefore do.
        tolerance: in wheel units, above 0; only the past of a step counts.
    """
    begins = ~(np.abs(difference) <= (1.0 + HYSTERESIS) * tolerance)
    ends = np.abs(difference) < (1.0 - HYSTERESIS) * tolerance
    steps = np.arange(len(difference))
    latest = np.maximum.accumulate(np.where(begins | ends, steps, -1))
    return (latest >= 0) & begins[latest]
