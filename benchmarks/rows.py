"""A measured figure beside its limit: what every benchmark returns, and how one is printed."""

from collections.abc import Sequence
from typing import Any

Row = dict[str, Any]
"""``name``, ``measured``, ``limit``, ``unit``, ``ok``."""


def at_most(name: str, measured: float, limit: float, unit: str = "") -> Row:
    """A figure that may not pass its limit: a time, an error."""
    return _row(name, measured, limit, unit, measured <= limit)


def at_least(name: str, measured: float, limit: float, unit: str = "") -> Row:
    """A figure that must reach its limit: a rate, an improvement."""
    return _row(name, measured, limit, unit, measured >= limit)


def print_rows(rows: Sequence[Row]) -> int:
    """Print a line a row; 0 if all limits are kept, else 1, for ``SystemExit``."""
    for row in rows:
        verdict = "pass" if row["ok"] else "FAIL"
        print(
            f"{row['name']:44} {row['measured']:10.4g} {row['limit']:8g} {row['unit']:8} {verdict}"
        )
    return 0 if all(row["ok"] for row in rows) else 1


def _row(name: str, measured: float, limit: float, unit: str, ok: bool) -> Row:
    return {"name": name, "measured": measured, "limit": limit, "unit": unit, "ok": bool(ok)}
