"""People who track with a cursor: what their input should have been.

A first-order cursor moves by its input and a disturbance, ``dx/dt = gain (u + d)``. The person is to
hold it on a reference ``r``. The input that does so exactly is ``u = r' / gain - d``: with the
reference at rest minus the disturbance, without a disturbance the reference's rate. So the input is
the label, and that is the truth. The mapping for people is in ``docs/fit.md``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.errors import InvalidLabels
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

IntArray = NDArray[np.int64]

TRACKING = ("reference", "disturbance", "input")
"""Columns that a tracking table has in place of label and truth."""

DEFAULT_GAIN = 1.0  # the cursor's speed is its input, as in most first-order tracking tasks
_ONE_RATE = (
    0.01  # relative: clocks that were rounded differ by less, recordings at two rates by more
)


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackingColumns:
    """What was to be tracked, (rows,) each, in the file's order; NaN where the file has none.

    Attributes:
        reference: where the cursor should be, in units of the screen, any.
        disturbance: what is added to the input, in the input's units.
    """

    reference: FloatArray
    disturbance: FloatArray


def checked_gain(gain: float) -> float:
    """The gain of a cursor that an input can move.

    Raises:
        InvalidConfig: it is 0 or not finite.
    """
    if not isfinite(gain) or gain == 0.0:
        raise InvalidConfig(
            f"gain is {gain:g}; it must be finite and not 0: the cursor's speed is gain times "
            f"(input + disturbance)."
        )
    return gain


def rate_of_change(values: FloatArray, rate_hz: float) -> FloatArray:
    """The derivative of ``values``, (steps,), in their units a second, (steps,).

    Central differences over two steps; one-sided over one step at the first and the last. NaN where
    the value or a neighbour is NaN: nothing is taken across a gap.
    """
    rate = np.full(len(values), np.nan)
    if len(values) > 1:
        rate[1:-1] = (values[2:] - values[:-2]) * (0.5 * rate_hz)
        rate[0] = (values[1] - values[0]) * rate_hz
        rate[-1] = (values[-1] - values[-2]) * rate_hz
    return np.where(np.isnan(values), np.nan, rate)


def holding_input(
    reference: FloatArray, disturbance: FloatArray, *, rate_hz: float, gain: float
) -> FloatArray:
    """The input that would hold a first-order cursor on its reference, (steps,) like both.

    Mirror images of reference and disturbance give the mirror image of it, to the last bit.

    Args:
        reference: where the cursor should be at consecutive steps; NaN in gaps.
        disturbance: what is added to the input.
        rate_hz: of the steps.
        gain: speed of the cursor, in the reference's units a second, to one unit of input.

    Raises:
        InvalidConfig: the gain is 0 or not finite.
    """
    return rate_of_change(reference, rate_hz) / checked_gain(gain) - disturbance


def one_rate(rates_hz: FloatArray) -> FloatArray:
    """The rates, (rollouts,): all the median one if they differ by a clock's rounding only.

    Else the same reference, recorded twice, would have two truths.
    """
    median = float(np.median(rates_hz))
    alike = (np.abs(rates_hz / median - 1.0) <= _ONE_RATE).all()
    return np.full(len(rates_hz), median) if alike else rates_hz


def numbered_steps(t_s: FloatArray, rollout: IntArray, place: Callable[[int], str]) -> IntArray:
    """Step numbers, (rows,), of rows that have only times: from 0 in each rollout.

    A step is the median time between neighbours; a longer one leaves out as many numbers as fit.

    Args:
        t_s: finite times, (rows,), in any order.
        rollout: (rows,) which person's rollout each belongs to.
        place: where a row is in the file, in words.

    Raises:
        InvalidLabels: a time comes twice in a rollout.
    """
    order = np.lexsort((t_s, rollout))
    ordered = rollout[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    steps = np.zeros(len(t_s), dtype=np.int64)
    for rows in np.split(order, starts[1:]):
        between_s = np.diff(t_s[rows])
        if not len(between_s):
            continue
        if not (between_s > 0.0).all():
            row = int(rows[1 + int(np.argmin(between_s))])
            raise InvalidLabels(
                f"{place(row)}: t_s {t_s[row]:g} comes twice in one rollout; give each rollout a "
                f"name of its own, or number its rows in a step column."
            )
        apart = np.rint(between_s / np.median(between_s))
        steps[rows[1:]] = np.cumsum(np.maximum(apart, 1.0)).astype(np.int64)
    return steps
