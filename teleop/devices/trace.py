"""A recorded trace played back: the same samples at the same steps, every time."""

import csv
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from steerlab.sim.errors import shown
from steerlab.sim.files.reading import reading
from steerlab.sim.rollout import Rollout
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.contract import (
    Button,
    DeviceError,
    DeviceInfo,
    DeviceSample,
    InputKind,
)

COLUMNS = ("step", "wheel", "throttle", "brake", "buttons")
NO_SAMPLE = DeviceSample(wheel=None, ok=False)
Row = Mapping[str, Any]


class TraceDevice:
    """Plays rows of ``COLUMNS``; a step without a row is a gap, never a repeat.

    Args:
        rows: ``step`` and ``wheel`` each; ``throttle``, ``brake`` and ``buttons`` (names joined
            by ``|``) may be missing, and everything but the step may be empty.
        name: of the trace.

    Raises:
        DeviceError: a row is not what it must be, or a step is there twice.
    """

    def __init__(self, rows: Iterable[Row], *, name: str = "trace") -> None:
        self._name = name
        self._samples: dict[int, DeviceSample] = {}
        for number, row in enumerate(rows, start=1):
            where = f"{name}, row {number}"
            step, sample = _sample(row, where)
            if step in self._samples:
                raise DeviceError(f"{where}: step {step} is there twice; keep one.")
            self._samples[step] = sample
        if not self._samples:
            raise DeviceError(f"{name} holds no rows; record at least one step.")
        self._connected = False
        self._last = NO_SAMPLE

    @property
    def info(self) -> DeviceInfo:
        """The trace's name and length."""
        details = {"samples": str(len(self._samples))}
        return DeviceInfo(kind=InputKind.TRACE, name=self._name, details=details)

    def connect(self) -> None:
        """Nothing to open: the trace was read."""
        self._connected = True

    def begin(self, rollout: Rollout | None, *, order: int, attempt: int) -> None:
        """Start over."""
        self._last = NO_SAMPLE

    def read(self, step: int | None = None) -> DeviceSample:
        """The sample of ``step``; without a step, the last one."""
        if not self._connected:
            return NO_SAMPLE
        if step is not None:
            self._last = self._samples.get(step, NO_SAMPLE)
        return self._last

    def disconnect(self) -> None:
        """Nothing to close."""
        self._connected = False
        self._last = NO_SAMPLE


def read_trace(path: Path) -> TraceDevice:
    """A trace from a ``.csv`` or ``.parquet`` file.

    Raises:
        DeviceError: it cannot be read, or holds something else.
    """
    suffix = path.suffix.casefold()
    if suffix not in (".csv", ".parquet"):
        raise DeviceError(f"{path} is no trace; give a .csv or .parquet file.")
    remedy = f"Give a table with step, wheel, or all of {', '.join(COLUMNS)}."
    with reading(path, "a trace", DeviceError, remedy):
        if suffix == ".csv":
            with path.open(newline="", encoding="utf-8-sig") as file:
                reader = csv.DictReader(file)
                columns, rows = list(reader.fieldnames or ()), list(reader)
        else:
            table = pq.read_table(path)
            columns, rows = table.column_names, table.to_pylist()
        if not {"step", "wheel"} <= set(columns) <= set(COLUMNS):
            raise DeviceError(f"{path} has columns {shown(columns)}. {remedy}")
        return TraceDevice(rows, name=path.name)


def _sample(row: Row, where: str) -> tuple[int, DeviceSample]:
    extra = set(row) - set(COLUMNS)
    if extra:
        raise DeviceError(
            f"{where}: unknown {shown(extra)} in {shown(dict(row))}; give only {COLUMNS}."
        )
    wheel = _number(row, "wheel", -WHEEL_LIMIT, WHEEL_LIMIT, where)
    step = _number(row, "step", 0, 2**31 - 1, where)
    if step is None or step != int(step):
        raise DeviceError(f"{where}: step is {shown(row.get('step'))}; give a whole number from 0.")
    names = [name for name in str(row.get("buttons") or "").split("|") if name]
    unknown = sorted(set(names) - {*Button})
    if unknown:
        raise DeviceError(f"{where}: no buttons {shown(unknown)}; choose from {', '.join(Button)}.")
    return int(step), DeviceSample(
        wheel=wheel,
        throttle=_number(row, "throttle", 0.0, 1.0, where),
        brake=_number(row, "brake", 0.0, 1.0, where),
        buttons=frozenset(map(Button, names)),
        ok=wheel is not None,
    )


def _number(row: Row, name: str, low: float, high: float, where: str) -> float | None:
    value = row.get(name)
    if value is None or value == "":
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not isfinite(number) or not low <= number <= high:
        raise DeviceError(
            f"{where}: {name} is {shown(value)}; give {low:g} to {high:g}, or leave empty."
        )
    return number
