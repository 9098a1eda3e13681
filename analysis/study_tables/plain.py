"""Statistics as plain values for JSON and CSV; a cell without a value holds the reason instead."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from math import isfinite
from numbers import Integral, Real
from typing import Any

import numpy as np

from steerlab.analysis.statistics.outcome import ConfidenceInterval, NotComputable
from steerlab.analysis.summary import InvalidSummary

DIGITS = 6
EMPTY = "empty"
"""The key under which a cell without a value says why."""


def empty(reason: str) -> dict[str, str]:
    """A cell that has no value."""
    return {EMPTY: reason}


def is_empty(value: Any) -> bool:
    """Whether a cell has no value."""
    return isinstance(value, Mapping) and set(value) == {EMPTY}


def plain(value: Any) -> Any:
    """Records, intervals and arrays as JSON has them; floats rounded to ``DIGITS`` digits.

    Raises:
        InvalidSummary: a number is not finite.
    """
    if isinstance(value, NotComputable):
        return empty(value.reason)
    if isinstance(value, ConfidenceInterval):
        return [plain(value.low), plain(value.high)]
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Sequence | set | frozenset) and not isinstance(value, str):
        return [plain(part) for part in value]
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return _number(float(value))
    raise InvalidSummary(f"{type(value).__name__} {value!r} is no value of a table.")


def _number(value: float) -> float:
    if not isfinite(value):
        raise InvalidSummary(f"A number of a table is {value}; a cell without one says why.")
    if value == 0.0:
        return 0.0
    return float(f"{value:.{DIGITS}g}")  # significant digits: a p of 1e-9 stays one
