"""``LabelSeries``: one person's labels for one rollout beside the ground truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from steerlab.learning.errors import InvalidLabels, UnknownPerson
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.vehicle import WHEEL_LIMIT

if TYPE_CHECKING:
    import pyarrow as pa

_COLUMNS = (
    "participant",
    "rollout",
    "attempt",
    "step",
    "t_s",
    "teacher_label",
    "oracle_label",
    "label_valid",
)
CONTEXT = ("yaw_rate_radps", "speed_mps", "robot_wheel")
"""What ``series_from_table`` keeps of the car's own motion, where the table has it."""
_SLACK = 1e-6  # labels may pass WHEEL_LIMIT by rounding only
Learned = TypeVar("Learned")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LabelSeries:
    """Labels and truth at consecutive control steps.

    Attributes:
        person: the participant's pseudonym.
        rate_hz: control rate of the steps.
        label: (steps,) the teacher's label ``a``; NaN where none was given.
        truth: (steps,) the oracle label ``o``; NaN where none exists.
        valid: (steps,) True where the step may train and score; label and truth are then finite.
        context: (steps, columns) what else is known of each step, such as the car's motion; it
            must be finite. Most mappers read labels only.
        context_names: one name a column.
    """

    person: str
    rollout: str
    rate_hz: float
    label: FloatArray
    truth: FloatArray
    valid: BoolArray
    context: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    context_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        where = f"Series of {self.person!r} on {self.rollout!r}"
        if not (self.label.ndim == 1 and len(self.label) > 0):
            raise InvalidLabels(f"{where}: label is {self.label.shape}; give (steps,), not empty.")
        for name in ("truth", "valid"):
            shape = getattr(self, name).shape
            if shape != self.label.shape:
                raise InvalidLabels(f"{where}: {name} is {shape}, not {self.label.shape}.")
        if self.context.size == 0:  # none given: (steps, 0)
            object.__setattr__(self, "context", np.empty((self.steps, 0)))
        if self.context.shape != (self.steps, len(self.context_names)):
            raise InvalidLabels(
                f"{where}: context is {self.context.shape}, not "
                f"{(self.steps, len(self.context_names))}: a row a step and a column a name."
            )
        if not np.isfinite(self.context).all():
            raise InvalidLabels(
                f"{where}: context has a value that is not finite; drop the column."
            )
        if not (np.isfinite(self.rate_hz) and self.rate_hz > 0.0):
            raise InvalidLabels(f"{where}: rate_hz is {self.rate_hz}; it must be positive.")
        if self.valid.dtype != np.bool_:
            raise InvalidLabels(f"{where}: valid is {self.valid.dtype}, not bool.")
        for name in ("label", "truth"):
            values = getattr(self, name)
            if not np.isfinite(values[self.valid]).all():
                raise InvalidLabels(f"{where}: a valid step has no finite {name}; mask it.")
            beyond = np.abs(values) > WHEEL_LIMIT + _SLACK  # False for NaN
            if beyond.any():
                raise InvalidLabels(
                    f"{where}: {name} {values[beyond][0]:g} at step {int(np.argmax(beyond))} is "
                    f"outside ±{WHEEL_LIMIT}; scale the wheel before it is recorded."
                )

    @property
    def steps(self) -> int:
        """Number of control steps."""
        return len(self.label)


def series_from_table(table: "pa.Table") -> list[LabelSeries]:
    """One series per participant and rollout, sorted by both, from ``LABELLED_STEP_SCHEMA`` rows.

    Of several attempts at a rollout the last one counts. A null or NaN label or oracle label, and
    a label not marked valid, masks its step. Rows may come in any order.

    Raises:
        InvalidLabels: a column is missing, steps have gaps or repeat, or times are uneven.
    """
    missing = [name for name in _COLUMNS if name not in table.column_names]
    if missing:
        raise InvalidLabels(
            f"The table lacks {', '.join(missing)}; it has {', '.join(table.column_names)}."
        )
    keys = ("participant", "rollout", "attempt", "step")
    context = tuple(name for name in CONTEXT if name in table.column_names)
    table = table.select([*_COLUMNS, *context]).sort_by([(key, "ascending") for key in keys])
    columns = {name: _numpy(table, name) for name in (*_COLUMNS, *context)}
    person, rollout, attempt = (columns[key] for key in keys[:3])
    rows = len(person)
    if rows == 0:
        return []
    new_pair = (person[1:] != person[:-1]) | (rollout[1:] != rollout[:-1])
    new_series = new_pair | (attempt[1:] != attempt[:-1])
    bounds = [0, *(np.flatnonzero(new_series) + 1).tolist(), rows]
    last_attempt = [*new_pair[np.asarray(bounds[1:-1], dtype=int) - 1].tolist(), True]
    return [
        _series({name: values[start:stop] for name, values in columns.items()}, context)
        for start, stop, last in zip(bounds[:-1], bounds[1:], last_attempt, strict=True)
        if last
    ]


def _numpy(table: "pa.Table", name: str) -> np.ndarray:
    column = table.column(name)
    if name in ("teacher_label", "oracle_label"):
        column = column.cast("float64")  # nulls become NaN below
    elif column.null_count:
        raise InvalidLabels(f"Column {name} has {column.null_count} nulls; it may have none.")
    return column.to_numpy()


def _series(columns: dict[str, np.ndarray], context: tuple[str, ...]) -> LabelSeries:
    person, rollout = str(columns["participant"][0]), str(columns["rollout"][0])
    where = f"{person!r} on {rollout!r}, attempt {columns['attempt'][0]}"
    step = columns["step"]
    jumps = np.flatnonzero(np.diff(step) != 1)
    if len(jumps):
        before, after = step[jumps[0]], step[jumps[0] + 1]
        raise InvalidLabels(
            f"{where}: step {after} follows step {before}; "
            "steps must be consecutive (keep masked steps as rows with null labels)."
        )
    label = np.where(columns["label_valid"], columns["teacher_label"], np.nan)
    truth = columns["oracle_label"].astype(np.float64)
    return LabelSeries(
        person=person,
        rollout=rollout,
        rate_hz=_rate_hz(columns["t_s"], where),
        label=label,
        truth=truth,
        valid=np.isfinite(label) & np.isfinite(truth),
        context=np.column_stack([columns[name] for name in context])
        if context
        else np.empty((0, 0)),
        context_names=context,
    )


def _rate_hz(t_s: np.ndarray, where: str) -> float:
    if len(t_s) < 2:
        raise InvalidLabels(f"{where}: one step has no rate; a series needs at least two.")
    step_s = (t_s[-1] - t_s[0]) / (len(t_s) - 1)
    if not step_s > 0.0 or np.abs(np.diff(t_s) - step_s).max() > 0.01 * step_s:
        raise InvalidLabels(f"{where}: t_s is not evenly spaced; it must be step / control_hz.")
    return round(1.0 / step_s, 6)


def by_person(series: Sequence[LabelSeries]) -> dict[str, list[LabelSeries]]:
    """Each person's series, people and series in the order given."""
    people: dict[str, list[LabelSeries]] = {}
    for drive in series:
        people.setdefault(drive.person, []).append(drive)
    return people


def lookup_person(learned: Mapping[str, Learned], mapper: str, person: str) -> Learned:
    """The entry of ``person`` in ``learned``, which ``mapper`` keeps by person.

    Raises:
        UnknownPerson: the person was neither fitted nor calibrated.
    """
    if person in learned:
        return learned[person]
    names = list(learned)
    known = ", ".join(names[:5]) or "no one"
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    raise UnknownPerson(
        f"{mapper} does not know {person!r}; it knows {known}{more}; "
        "call calibrate with their calibration series first."
    )
