"""``LabelledStep``: the record at which the loop, the store, the learners and the analysis meet.

Made step by step, from rows, or from a rollout and a teacher's labels for it.
"""
# pyarrow ships no types, so strict mode would reject each of its names:
# pyright: reportUnknownMemberType=false, reportUnknownParameterType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportMissingTypeStubs=false

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from typing import Any

import numpy as np
import pyarrow as pa

from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import SteerlabError
from steerlab.sim.rollout import Rollout

SCHEMA_VERSION = 1
_INT32_MAX = 2**31 - 1


class InvalidRecord(SteerlabError, ValueError):
    """A step, a row, a table or a shard is not what ``LABELLED_STEP_SCHEMA`` asks for."""


class Driver(StrEnum):
    """Who drove the car in a step."""

    ROBOT = "robot"
    TEACHER = "teacher"


@dataclass(frozen=True, kw_only=True, slots=True)
class LabelledStep:
    """One teacher's label for one control step of one rollout.

    Attributes:
        participant: pseudonym of the person (or scripted teacher); never a name.
        attempt: 0 for the first try at a rollout; a redo is a new attempt, nothing is overwritten.
        t_s: time since the rollout's start.
        speed_mps, lateral_speed_mps, yaw_rate_radps: velocity in the body frame: forward, lateral
            (positive to the left), yaw rate (positive to the left).
        acceleration_x_mps2, acceleration_y_mps2: body-frame acceleration.
        robot_wheel: what the robot's policy asked for.
        teacher_label: the label ``a``; None when the device gave none.
        oracle_label: the ground truth ``o``; None when no drivable path exists.
        executed_wheel: what the car did.
        label_valid: the device was connected, in focus and calibrated.
    """

    participant: str
    rollout: str
    attempt: int
    step: int
    t_s: float
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    lateral_speed_mps: float
    yaw_rate_radps: float
    acceleration_x_mps2: float
    acceleration_y_mps2: float
    robot_wheel: float
    teacher_label: float | None
    oracle_label: float | None
    executed_wheel: float
    gate: Driver
    label_valid: bool


_FLOATS = (
    "t_s",
    "x_m",
    "y_m",
    "heading_rad",
    "speed_mps",
    "lateral_speed_mps",
    "yaw_rate_radps",
    "acceleration_x_mps2",
    "acceleration_y_mps2",
    "robot_wheel",
    "teacher_label",
    "oracle_label",
    "executed_wheel",
)
_NULLABLE = ("teacher_label", "oracle_label")

LABELLED_STEP_SCHEMA = pa.schema(
    [
        pa.field("participant", pa.string(), nullable=False),
        pa.field("rollout", pa.string(), nullable=False),
        pa.field("attempt", pa.int32(), nullable=False),
        pa.field("step", pa.int32(), nullable=False),
        *(pa.field(name, pa.float64(), nullable=name in _NULLABLE) for name in _FLOATS),
        pa.field("gate", pa.string(), nullable=False),
        pa.field("label_valid", pa.bool_(), nullable=False),
    ],
    metadata={"steerlab.schema": "LabelledStep", "steerlab.schema_version": str(SCHEMA_VERSION)},
)
"""Arrow schema of ``LabelledStep``: Parquet shards and SQLite rows have exactly these columns."""


def table_from_columns(columns: dict[str, object]) -> pa.Table:
    """A table of ``LABELLED_STEP_SCHEMA`` from arrays by column name.

    Raises:
        pyarrow.ArrowInvalid: a column has another length or type.
        KeyError: a column is missing.
    """
    arrays = [pa.array(columns[field.name], type=field.type) for field in LABELLED_STEP_SCHEMA]
    table = pa.Table.from_arrays(arrays, schema=LABELLED_STEP_SCHEMA)
    table.validate(full=True)
    return table


COLUMNS: tuple[str, ...] = tuple(LABELLED_STEP_SCHEMA.names)
"""The column names, in the order in which rows and tables hold them."""

Row = dict[str, Any]


def row_from_step(step: LabelledStep) -> Row:
    """The step as plain ``str | int | float | bool | None`` values by column, numpy scalars too.

    Raises:
        InvalidRecord: a number is NaN, infinite, negative where it counts, or a text is unusable.
    """
    row: Row = {name: getattr(step, name) for name in COLUMNS}
    try:
        for name in ("participant", "rollout"):
            check_name(name, row[name])
        for name in ("attempt", "step"):
            row[name] = _count(name, row[name])
        for name in _FLOATS:
            if not (row[name] is None and name in _NULLABLE):
                row[name] = _finite(name, row[name])
        row["gate"] = _gate(row["gate"]).value
        row["label_valid"] = bool(row["label_valid"])
    except InvalidRecord:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidRecord(f"Not a step that can be kept: {error}. In {row}.") from error
    return row


def step_from_row(row: Mapping[str, Any]) -> LabelledStep:
    """The inverse of ``row_from_step``; 0 and 1 serve as ``label_valid``.

    Raises:
        InvalidRecord: a column is missing, unknown or holds something else than it may.
    """
    if set(row) != set(COLUMNS):
        missing = sorted(set(COLUMNS) - set(row))
        unknown = sorted(set(row) - set(COLUMNS))
        raise InvalidRecord(f"Not a step: missing {missing}, unknown {unknown}.")
    if row["label_valid"] not in (0, 1):
        raise InvalidRecord(f"label_valid is {row['label_valid']!r}; give True or False.")
    plain = row_from_step(LabelledStep(**row))
    plain["gate"] = Driver(plain["gate"])
    return LabelledStep(**plain)


def table_from_steps(steps: Iterable[LabelledStep]) -> pa.Table:
    """A table of ``LABELLED_STEP_SCHEMA``, one row a step, in the order given."""
    return pa.Table.from_pylist(
        [row_from_step(step) for step in steps], schema=LABELLED_STEP_SCHEMA
    )


def check_name(what: str, name: object) -> str:
    """``name`` if it is a non-empty text of printable characters.

    Raises:
        InvalidRecord: it is not: line breaks and lone surrogates do not survive files and pages.
    """
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise InvalidRecord(f"{what} is {name!r}; give a printable text that is not blank.")
    return name


def _gate(value: object) -> Driver:
    try:
        return Driver(value)
    except ValueError:
        raise InvalidRecord(f"gate is {value!r}; give one of {[*Driver]}.") from None


def _count(name: str, value: Any) -> int:
    count = int(value)
    if count != value or not 0 <= count <= _INT32_MAX:
        raise InvalidRecord(f"{name} is {value!r}; give a whole number from 0 to {_INT32_MAX}.")
    return count


def _finite(name: str, value: Any) -> float:
    number = float(value)
    if not isfinite(number):
        remedy = "use None where there is none" if name in _NULLABLE else "mark the step instead"
        raise InvalidRecord(f"{name} is {number}; a stored number is finite, so {remedy}.")
    return number


def labelled_table(
    rollout: Rollout, labels: FloatArray, *, participant: str, attempt: int = 0
) -> pa.Table:
    """A rollout's steps with a teacher's labels, as a table of ``LABELLED_STEP_SCHEMA``.

    Args:
        labels: (steps,) the teacher's; NaN where the device gave none, which becomes null.
    """
    steps = rollout.steps
    given = ~np.isnan(labels)
    speed, slip, yaw_rate = rollout.velocity.T
    acceleration_x, acceleration_y = rollout.acceleration.T
    x_m, y_m, heading_rad = rollout.pose.T
    return table_from_columns(
        {
            "participant": [participant] * steps,
            "rollout": [rollout.name] * steps,
            "attempt": np.full(steps, attempt, np.int32),
            "step": np.arange(steps, dtype=np.int32),
            "t_s": rollout.t_s,
            "x_m": x_m,
            "y_m": y_m,
            "heading_rad": heading_rad,
            "speed_mps": speed,
            "lateral_speed_mps": slip,
            "yaw_rate_radps": yaw_rate,
            "acceleration_x_mps2": acceleration_x,
            "acceleration_y_mps2": acceleration_y,
            "robot_wheel": rollout.robot_wheel,
            "teacher_label": pa.array(labels, mask=~given),
            "oracle_label": pa.array(rollout.oracle_label, mask=~rollout.oracle_valid),
            "executed_wheel": rollout.robot_wheel,  # a replay shows what the robot did
            "gate": [str(Driver.ROBOT)] * steps,
            "label_valid": given,
        }
    )


def labelled_step(
    rollout: Rollout, step: int, label: float | None, *, participant: str, attempt: int = 0
) -> LabelledStep:
    """The record of one step; equal to the row of ``labelled_table``."""
    x_m, y_m, heading_rad = rollout.pose[step].tolist()
    speed, slip, yaw_rate = rollout.velocity[step].tolist()
    acceleration_x, acceleration_y = rollout.acceleration[step].tolist()
    wheel = float(rollout.robot_wheel[step])
    return LabelledStep(
        participant=participant,
        rollout=rollout.name,
        attempt=attempt,
        step=step,
        t_s=float(rollout.t_s[step]),
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        speed_mps=speed,
        lateral_speed_mps=slip,
        yaw_rate_radps=yaw_rate,
        acceleration_x_mps2=acceleration_x,
        acceleration_y_mps2=acceleration_y,
        robot_wheel=wheel,
        teacher_label=label,
        oracle_label=float(rollout.oracle_label[step]) if rollout.oracle_valid[step] else None,
        executed_wheel=wheel,
        gate=Driver.ROBOT,
        label_valid=label is not None,
    )
