"""``LabelledStep``: the record at which the loop, the store, the learners and the analysis meet."""

from dataclasses import dataclass
from enum import StrEnum

import pyarrow as pa

SCHEMA_VERSION = 1


class Gate(StrEnum):
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
        speed_mps, slip_mps, yaw_rate_radps: body-frame velocity.
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
    slip_mps: float
    yaw_rate_radps: float
    acceleration_x_mps2: float
    acceleration_y_mps2: float
    robot_wheel: float
    teacher_label: float | None
    oracle_label: float | None
    executed_wheel: float
    gate: Gate
    label_valid: bool


_FLOATS = (
    "t_s",
    "x_m",
    "y_m",
    "heading_rad",
    "speed_mps",
    "slip_mps",
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
