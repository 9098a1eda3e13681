"""Tables with a row for each control step: labels, and when it happened."""
# pyarrow.compute makes its functions when it is imported:
# pyright: reportAttributeAccessIssue=false

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from steerlab.analysis.export.tables import Column, ExportTable, made_table
from steerlab.analysis.export.variables import Variable, choice, number, text, truth, whole
from steerlab.analysis.study_data.whole_study import WholeStudy
from steerlab.sim.records import Driver

PERSON = text("participant", "Pseudonym")
ROLLOUT = text("rollout", "Calibration rollout, or the drive a robot was taught in")
ATTEMPT = whole("attempt", "Which try at this rollout, from 0")
STEP = whole("step", "Control step, from 0")


def labels_table(study: WholeStudy) -> ExportTable:
    """What was seen, given and done at every control step of the finished attempts."""
    drivers = {driver.value: f"the {driver.value} drove" for driver in Driver}
    variables = (
        PERSON,
        ROLLOUT,
        ATTEMPT,
        STEP,
        number("t_s", "Time since the start", "s", low=0.0),
        number("x_m", "Position of the car", "m"),
        number("y_m", "Position of the car", "m"),
        number("heading_rad", "Heading of the car", "rad"),
        number("speed_mps", "Forward speed", "m/s"),
        number("lateral_speed_mps", "Lateral speed, positive to the left", "m/s"),
        number("yaw_rate_radps", "Yaw rate, positive to the left", "rad/s"),
        number("acceleration_x_mps2", "Forward acceleration", "m/s²"),
        number("acceleration_y_mps2", "Lateral acceleration", "m/s²"),
        number("robot_wheel", "Wheel that the robot's policy asked for", "wheel units"),
        number("teacher_label", "Label that the participant gave", "wheel units"),
        number("oracle_label", "Ground truth", "wheel units"),
        number("executed_wheel", "Wheel that the car had", "wheel units"),
        choice("gate", "Who drove", drivers),
        truth("label_valid", "The device was connected, in focus and calibrated"),
    )
    key = ("participant", "rollout", "attempt", "step")
    what = "a control step of a finished attempt"
    return _from_arrow("labels", what, key, variables, study.labels, study)


def _from_arrow(
    name: str,
    what: str,
    key: Sequence[str],
    variables: Sequence[Variable],
    table: pa.Table,
    study: WholeStudy,
) -> ExportTable:
    """A table as the store has it, whose columns are the variables'."""
    columns = [Column(variable=v, values=table[v.name]) for v in variables]
    return made_table(name, what, key, columns, study=study.id, rows=table.num_rows)


def timing_table(study: WholeStudy) -> ExportTable:
    """When every control step at a wheel happened."""
    variables = (
        PERSON,
        ROLLOUT,
        ATTEMPT,
        STEP,
        number("deadline_s", "When the step was due, from the attempt's first one", "s"),
        number("lateness_s", "How much later it was done", "s"),
        number("sample_lateness_s", "How much later the device was read", "s"),
        number("event_age_s", "Age of the device's last event when it was read", "s"),
        truth("overrun", "The loop was not done with it in time"),
        truth("focus", "The window had the focus"),
        truth("device_ok", "The device was connected"),
    )
    key = ("participant", "rollout", "attempt", "step")
    table = study.timings
    due = table["deadline_ns"].to_numpy()
    firsts = np.empty(len(due), dtype=np.int64)
    for rows in _attempt_rows(table):
        firsts[rows] = due[rows.start]
    added = {
        "deadline_s": pa.array((due - firsts) / 1e9),
        "lateness_s": _seconds(table["actual_ns"], table["deadline_ns"]),
        "sample_lateness_s": _seconds(table["sample_ns"], table["deadline_ns"]),
        "event_age_s": pc.divide(pc.cast(table["event_age_ns"], pa.float64()), 1e9),
    }
    for column, values in added.items():
        table = table.append_column(column, values)
    what = "a control step at a wheel; scripts have none"
    return _from_arrow("timing", what, key, variables, table, study)


def _attempt_rows(table: pa.Table) -> Iterator[slice]:
    """The rows of each attempt, which lie together."""
    names = [table[name].to_pylist() for name in ("participant", "rollout", "attempt")]
    keys, begin = list(zip(*names, strict=True)), 0
    for row in range(1, len(keys) + 1):
        if row == len(keys) or keys[row] != keys[begin]:
            yield slice(begin, row)
            begin = row


def _seconds(after: pa.ChunkedArray, before: pa.ChunkedArray) -> pa.ChunkedArray:
    return pc.divide(pc.cast(pc.subtract(after, before), pa.float64()), 1e9)
