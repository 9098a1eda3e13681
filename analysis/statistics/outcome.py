"""What a statistic is when it has no value, and the checks that every test begins with."""

from dataclasses import dataclass

import numpy as np

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

FEWEST = 4
"""People. Fisher's interval of a correlation needs four; the other tests keep to the same floor."""
_FLAT = 1e-12  # relative; a spread below this is rounding


@dataclass(frozen=True, kw_only=True, slots=True)
class NotComputable:
    """A statistic that these data do not define.

    Attributes:
        reason: a clause, such as ``all values are 3``.
    """

    reason: str

    def __str__(self) -> str:
        return f"not computable: {self.reason}"


@dataclass(frozen=True, kw_only=True, slots=True)
class ConfidenceInterval:
    """From where to where a quantity lies, in its unit, at a confidence level such as 0.95."""

    low: float
    high: float
    confidence: float = 0.95


def checked(name: str, values: FloatArray, dimensions: int = 1) -> FloatArray:
    """``values`` as floats.

    Raises:
        InvalidConfig: another number of dimensions, or a value that is not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    no_columns = array.ndim == 2 and array.shape[1] == 0
    if array.ndim != dimensions or no_columns or not np.isfinite(array).all():
        raise InvalidConfig(
            f"{name} has shape {array.shape} and {int((~np.isfinite(array)).sum())} values that "
            f"are not finite; give {dimensions} dimension(s), and leave out who has no value."
        )
    return array


def checked_pairs(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both as floats, (n,) each.

    Raises:
        InvalidConfig: they differ in length, or a value is not finite.
    """
    x, y = checked("x", x), checked("y", y)
    if len(x) != len(y):
        raise InvalidConfig(f"x has {len(x)} values and y has {len(y)}; give one of each a person.")
    return x, y


def checked_table(name: str, table: FloatArray) -> FloatArray:
    """One row a person and one column a condition, of two or more.

    Raises:
        InvalidConfig: no such table, or a value is not finite.
    """
    table = checked(name, table, 2)
    if table.shape[1] < 2:
        raise InvalidConfig(f"{name} has {table.shape[1]} columns; compare two or more conditions.")
    return table


def checked_success(success: FloatArray) -> FloatArray:
    """The values, which are 1 for reaching the goal and 0 for not.

    Raises:
        InvalidConfig: a value is neither.
    """
    if other := sorted(set(np.unique(success).tolist()) - {0.0, 1.0}):
        raise InvalidConfig(f"success has {other[0]:g}; it must be 0 or 1.")
    return success


def checked_confidence(confidence: float) -> float:
    """The level.

    Raises:
        InvalidConfig: it is not between 0 and 1.
    """
    if not 0.0 < confidence < 1.0:
        raise InvalidConfig(f"confidence is {confidence}; it must be between 0 and 1.")
    return confidence


def too_few(count: int, fewest: int = FEWEST, what: str = "people") -> NotComputable | None:
    """Why there are not enough, if there are not."""
    if count >= fewest:
        return None
    return NotComputable(reason=f"{what}: {count}; at least {fewest} are needed")


def flat(name: str, values: FloatArray) -> NotComputable | None:
    """Why ``values`` cannot be compared with anything: they are all one number."""
    if np.ptp(values) > _FLAT * np.abs(values).max():
        return None
    return NotComputable(reason=f"all values of {name} are {values[0]:.6g}")


def dependent(columns: FloatArray) -> NotComputable | None:
    """Why the columns (n, d) span less than d dimensions, if they do."""
    for at, column in enumerate(columns.T):
        if missing := flat(f"dimension {at}", column):
            return missing
    centred = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    rank = int(np.linalg.matrix_rank(centred))
    if rank == columns.shape[1]:
        return None
    return NotComputable(
        reason=f"{columns.shape[1]} dimensions span only {rank}: they follow from each other"
    )
