"""From the columns of a label file to one ``LabelSeries`` per person and rollout."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_file import SPLITS, IntArray, LabelColumns
from steerlab.learning.series import LabelSeries
from steerlab.learning.tracking import DEFAULT_GAIN, checked_gain, holding_input, one_rate
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT

DEFAULT_RATE_HZ = 20.0
_MOST_MISSING = 10  # times the rows there are: beyond this, step is no count of control steps
_UNEVEN = 0.1  # of a step: clocks that were rounded pass, frames that were dropped do not


@dataclass(frozen=True, kw_only=True)
class LabelScale:
    """The range of a table's labels and, without ``t_s``, their rate.

    Attributes:
        limit: labels are within ±``limit``; they are learned scaled to ±``WHEEL_LIMIT``.
        rate_hz: None takes it from ``t_s``, or ``DEFAULT_RATE_HZ`` where there is none.
        gain: of the cursor of a tracking table (``tracking``); None is ``DEFAULT_GAIN``.
    """

    limit: float = WHEEL_LIMIT
    rate_hz: float | None = None
    gain: float | None = None

    def __post_init__(self) -> None:
        if self.gain is not None:
            checked_gain(self.gain)
        for name in ("limit", "rate_hz"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0.0):
                raise InvalidConfig(f"{name.replace('_', '-')} is {value}; it must be positive.")

    @property
    def wheel_per_unit(self) -> float:
        """Wheel units to one unit of the table."""
        return WHEEL_LIMIT / self.limit


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class GivenSeries:
    """A series, and which of its steps the table has; steps it lacks are masked in the series.

    Attributes:
        steps: the numbers of the steps given, rising; ``series`` starts at ``steps[0]``.
        split: one of ``SPLITS``, or None.
    """

    series: LabelSeries
    steps: IntArray
    split: str | None

    @property
    def rows(self) -> IntArray:
        """Indices of the given steps in ``series``."""
        return self.steps - self.steps[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rollouts:
    """The rows of a file by person, rollout and step.

    Attributes:
        order: (rows,) rows of the file, sorted.
        step: (rows,) of the sorted rows.
        starts, ends: (rollouts,) where each person's rollout begins and ends among them.
        names: person and rollout of each.
        filled_at: (rows,) where each sorted row is once missing steps have a place of their own.
        offsets: (rollouts + 1,) where each rollout begins there.
    """

    order: IntArray
    step: IntArray
    starts: IntArray
    ends: IntArray
    names: list[tuple[str, str]]
    filled_at: IntArray
    offsets: IntArray

    @classmethod
    def of(cls, columns: LabelColumns) -> "_Rollouts":
        """Sort the rows.

        Raises:
            InvalidLabels: a step comes twice or jumps too far.
        """
        pair = columns.person * len(columns.rollouts) + columns.rollout
        order = np.lexsort((columns.step, pair))
        pair, step = pair[order], columns.step[order]
        starts = np.flatnonzero(np.r_[True, pair[1:] != pair[:-1]])
        ends = np.r_[starts[1:], len(pair)]
        names = [
            (columns.people[columns.person[row]], columns.rollouts[columns.rollout[row]])
            for row in order[starts]
        ]
        _check_steps(columns, step, order, starts, ends, names)
        offsets = np.r_[0, np.cumsum(step[ends - 1] - step[starts] + 1)]
        return cls(
            order=order,
            step=step,
            starts=starts,
            ends=ends,
            names=names,
            filled_at=np.repeat(offsets[:-1] - step[starts], ends - starts) + step,
            offsets=offsets,
        )

    def spread(self, values: FloatArray) -> FloatArray:
        """A column of the file, (steps of all rollouts,), NaN where a step is missing."""
        filled = np.full(self.offsets[-1], np.nan)
        filled[self.filled_at] = values[self.order]
        return filled

    def gathered(self, filled: FloatArray) -> FloatArray:
        """The way back: a column of the file, (rows,)."""
        values = np.empty(len(self.order))
        values[self.order] = filled[self.filled_at]
        return values


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelTable:
    """A label file ready to learn from: series by person and rollout, in wheel units.

    Attributes:
        notices: what was left out or masked, in sentences for the report.
    """

    given: tuple[GivenSeries, ...]
    scale: LabelScale
    notices: tuple[str, ...]

    @property
    def has_split(self) -> bool:
        """Whether the table's own split column says what trains and what is held out."""
        return self.given[0].split is not None


def label_table(columns: LabelColumns, scale: LabelScale) -> LabelTable:
    """Sort and cut the columns into series. A step that is missing between others is masked.

    Raises:
        InvalidLabels: a label is beyond the limit, a step comes twice or jumps too far, times are
            uneven, a pair is in two splits, or no row has both label and truth.
    """
    rollouts = _Rollouts.of(columns)
    rates = _rates(columns, rollouts, scale)
    columns = _with_truth(columns, rollouts, rates, scale)
    label_name = "label" if columns.tracking is None else "input"
    for name, values in ((label_name, columns.label), ("truth", columns.truth)):
        _check_range(name, columns, values, scale.limit)
    known = np.isfinite(columns.label) & np.isfinite(columns.truth)
    if not known.any():
        raise InvalidLabels(
            f"No row has both a{'n' if columns.tracking else ''} {label_name} and a truth; there is "
            f"nothing to learn from."
        )
    label = rollouts.spread(columns.label * scale.wheel_per_unit)
    truth = rollouts.spread(columns.truth * scale.wheel_per_unit)
    valid = np.isfinite(label) & np.isfinite(truth)
    missing = len(label) - len(rollouts.step)
    context, notices = columns.context, list(columns.notices)
    if missing and context:
        notices += [f"Column {name} was left out: steps are missing." for name in context]
        context = {}
    if "robot_wheel" in context:  # a wheel position, in the units of the labels
        context = context | {"robot_wheel": context["robot_wheel"] * scale.wheel_per_unit}
    wide = np.column_stack([rollouts.spread(v) for v in context.values()]) if context else None
    splits = _splits(columns, rollouts)
    given: list[GivenSeries] = []
    for index, (person, rollout) in enumerate(rollouts.names):
        rows = slice(rollouts.offsets[index], rollouts.offsets[index + 1])
        steps = rollouts.step[rollouts.starts[index] : rollouts.ends[index]]
        series = LabelSeries(
            person=person,
            rollout=rollout,
            rate_hz=float(rates[index]),
            label=label[rows],
            truth=truth[rows],
            valid=valid[rows],
            context=np.empty((0, 0)) if wide is None else wide[rows],
            context_names=tuple(context),
        )
        given.append(GivenSeries(series=series, steps=steps, split=splits[index]))
    if blank := int((~known).sum()):
        notices.append(f"{blank} of {len(known)} rows lack {label_name} or truth and are masked.")
    if missing:
        notices.append(f"{missing} steps are missing between others and are masked.")
    return LabelTable(given=tuple(given), scale=scale, notices=tuple(notices))


def _with_truth(
    columns: LabelColumns, rollouts: _Rollouts, rates: FloatArray, scale: LabelScale
) -> LabelColumns:
    """Of a tracking table, with the truth that its reference and disturbance give."""
    tracking = columns.tracking
    if tracking is None:
        if scale.gain is not None:
            raise InvalidLabels(
                f"--gain is {scale.gain:g}, but the table has label and truth; a gain is for a "
                f"table of reference, disturbance and input: drop it."
            )
        return columns
    gain = DEFAULT_GAIN if scale.gain is None else scale.gain
    reference, disturbance = map(rollouts.spread, (tracking.reference, tracking.disturbance))
    truth = np.empty(len(reference))
    for index, rate_hz in enumerate(one_rate(rates)):
        rows = slice(rollouts.offsets[index], rollouts.offsets[index + 1])
        truth[rows] = holding_input(
            reference[rows], disturbance[rows], rate_hz=float(rate_hz), gain=gain
        )
        given = np.isfinite(reference[rows]) & np.isfinite(disturbance[rows])
        if given.any() and not np.isfinite(truth[rows]).any():
            person, rollout = rollouts.names[index]
            raise InvalidLabels(
                f"{person!r} on {rollout!r} has {int(given.sum())} of the steps with a reference "
                f"and a disturbance, and no two or three in a row, so the reference has no rate; "
                f"leave the rollout out."
            )
    notice = (
        f"A tracking table: the label is the input, the truth the reference’s rate / gain − the "
        f"disturbance, with gain {gain:g}."
    )
    return replace(columns, truth=rollouts.gathered(truth), notices=(notice, *columns.notices))


def _check_range(name: str, columns: LabelColumns, values: FloatArray, limit: float) -> None:
    beyond = np.abs(values) > limit * (1.0 + 1e-9)  # False for NaN
    if not beyond.any():
        return
    infinite = np.isinf(values)
    row = int(np.argmax(infinite if infinite.any() else beyond))
    where = (
        f"{columns.place(row)} ({columns.people[columns.person[row]]!r} on "
        f"{columns.rollouts[columns.rollout[row]]!r}, step {columns.step[row]})"
    )
    if infinite.any():
        raise InvalidLabels(f"{where}: {name} is infinite; leave it empty where there is none.")
    largest = float(np.abs(values[beyond]).max())
    raise InvalidLabels(
        f"{where}: {name} {values[row]:g} is outside ±{limit:g}; if the labels have another range, "
        f"give it as --limit ({largest:g} or more)."
    )


def _check_steps(
    columns: LabelColumns,
    step: IntArray,
    order: IntArray,
    starts: IntArray,
    ends: IntArray,
    names: list[tuple[str, str]],
) -> None:
    inside = np.ones(len(step) - 1, dtype=bool)
    inside[starts[1:] - 1] = False
    repeats = np.flatnonzero((np.diff(step) == 0) & inside)
    if len(repeats):
        person, rollout = names[int(np.searchsorted(starts, repeats[0], side="right")) - 1]
        raise InvalidLabels(
            f"{columns.place(int(order[repeats[0] + 1]))}: {person!r} on {rollout!r} has step "
            f"{step[repeats[0]]} twice; number the steps of each rollout, or give an attempt "
            f"column."
        )
    rows = ends - starts
    sparse = np.flatnonzero(step[ends - 1] - step[starts] + 1 > _MOST_MISSING * rows)
    if len(sparse):
        index = sparse[0]
        person, rollout = names[index]
        raise InvalidLabels(
            f"{person!r} on {rollout!r} has {rows[index]} rows for steps {step[starts[index]]} to "
            f"{step[ends[index] - 1]}; step must count control steps: 0, 1, 2."
        )


def _rates(columns: LabelColumns, rollouts: _Rollouts, scale: LabelScale) -> FloatArray:
    order, starts, ends, names = rollouts.order, rollouts.starts, rollouts.ends, rollouts.names
    if columns.t_s is None:
        if columns.tracking is not None and scale.rate_hz is None:
            raise InvalidLabels(
                "The table has neither t_s nor --rate-hz, so nothing tells how fast its reference "
                "moves; give one of them."
            )
        return np.full(len(starts), scale.rate_hz or DEFAULT_RATE_HZ)
    t_s, step = columns.t_s[order], rollouts.step
    counts = step[ends - 1] - step[starts]
    spans = t_s[ends - 1] - t_s[starts]
    timed = counts > 0
    step_s = np.where(timed, spans / np.maximum(counts, 1), np.nan)
    lines = np.repeat(t_s[starts], ends - starts) + np.repeat(step_s, ends - starts) * (
        step - np.repeat(step[starts], ends - starts)
    )
    off = np.abs(t_s - lines) > _UNEVEN * np.repeat(np.abs(step_s), ends - starts)
    backwards = timed & ~(step_s > 0.0)
    if off.any() or backwards.any():
        row = int(np.argmax(off)) if off.any() else int(starts[np.argmax(backwards)])
        index = int(np.searchsorted(starts, row, side="right")) - 1
        rows = slice(starts[index], ends[index])
        pace_s = np.diff(t_s[rows]) / np.diff(step[rows])
        usual_s = float(np.median(pace_s))
        late = int(starts[index] + 1 + np.argmax(np.abs(pace_s - usual_s)))  # least like the others
        person, rollout = names[index]
        raise InvalidLabels(
            f"{columns.place(int(order[late]))}: t_s of {person!r} on {rollout!r} is not evenly "
            f"spaced: it goes from {t_s[late - 1]:g} at step {step[late - 1]} to {t_s[late]:g} at "
            f"step {step[late]}, and mostly by {usual_s:g} a step. Resample the labels, or drop "
            f"the column and give --rate-hz."
        )
    rates = np.round(1.0 / step_s, 4)
    if not timed.any():
        rates[:] = scale.rate_hz or DEFAULT_RATE_HZ
    rate_hz = float(np.nanmedian(rates))
    if scale.rate_hz is not None and abs(rate_hz / scale.rate_hz - 1.0) > 0.01:
        raise InvalidLabels(
            f"--rate-hz is {scale.rate_hz:g}, but t_s says {rate_hz:g}; drop the one that is wrong."
        )
    return np.where(timed, rates, rate_hz)  # a lone step has no neighbours, so any rate will do


def _splits(columns: LabelColumns, rollouts: _Rollouts) -> list[str | None]:
    order, starts, names = rollouts.order, rollouts.starts, rollouts.names
    if columns.split is None:
        return [None] * len(starts)
    split = columns.split[order]
    mixed = np.flatnonzero(np.maximum.reduceat(split, starts) != np.minimum.reduceat(split, starts))
    if len(mixed):
        person, rollout = names[mixed[0]]
        raise InvalidLabels(
            f"{person!r} on {rollout!r} is in two splits; windows overlap, so a rollout must be "
            f"in one."
        )
    return [SPLITS[code] for code in split[starts]]
