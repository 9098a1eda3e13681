"""Anyone's labels: a CSV or Parquet file as checked columns. The format is in ``docs/fit.md``."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import CONTEXT
from steerlab.learning.tracking import TRACKING, TrackingColumns, numbered_steps
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import shown
from steerlab.sim.files.reading import reading
from steerlab.sim.files.table_file import TableFile, read_table_file

IntArray = NDArray[np.int64]

REQUIRED = ("person", "rollout", "step", "label", "truth")
SPLITS = ("train", "heldout", "new_calibration", "new_test")
_OUR_NAMES = {"participant": "person", "teacher_label": "label", "oracle_label": "truth"}
_TRACKING_NEEDS = ("person", "rollout", "step", *TRACKING)
_KNOWN = (*REQUIRED, "t_s", "split", "attempt", "label_valid")
_TEXT = ("person", "participant", "rollout", "split")


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelColumns:
    """A label file's columns, (rows,) each, in the file's order; of redone attempts the last.

    Attributes:
        person, rollout: indices into ``people`` and ``rollouts``, which are sorted.
        label: of a tracking table the input. NaN where the file has none, and where
            ``label_valid`` is false.
        truth: NaN where the file has none; of a tracking table all NaN until its rate is known.
        place: where a row is in the file, in words.
        t_s: None without such a column.
        split: indices into ``SPLITS``; None without such a column.
        tracking: what was to be tracked; None in a table of labels and truth.
        context: further numeric columns by name.
        notices: what was left out, in sentences for the report.
    """

    people: tuple[str, ...]
    rollouts: tuple[str, ...]
    person: IntArray
    rollout: IntArray
    step: IntArray
    label: FloatArray
    truth: FloatArray
    place: Callable[[int], str]
    t_s: FloatArray | None = None
    split: IntArray | None = None
    tracking: TrackingColumns | None = None
    context: dict[str, FloatArray] = field(default_factory=dict)
    notices: tuple[str, ...] = ()


def read_label_columns(path: Path) -> LabelColumns:
    """Read a label file: the documented columns, or steerlab's own ``LABELLED_STEP_SCHEMA``.

    A tracking table has ``reference``, ``disturbance`` and ``input`` in place of label and truth.

    Raises:
        InvalidLabels: the file cannot be read, lacks a column, or a column holds what it may not.
    """
    if not path.is_file():
        is_what = "a folder" if path.is_dir() else "not there"
        raise InvalidLabels(f"{path} is {is_what}; give a .csv or .parquet file of labels.")
    what, remedy = "a table of labels", "See docs/fit.md for what it may hold."
    file = read_table_file(
        path,
        what=what,
        error=InvalidLabels,
        remedy=remedy,
        text=_TEXT,
        known=(*_KNOWN, *_OUR_NAMES, *CONTEXT),
    )
    with reading(path, what, InvalidLabels, remedy):
        return _columns(file)


def _columns(file: TableFile) -> LabelColumns:
    ours = "participant" in file.columns and "person" not in file.columns
    if ours:
        names = [_OUR_NAMES.get(name, name) for name in file.columns]
        file = replace(file, table=file.table.rename_columns(names))
    names, path = file.columns, file.path
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidLabels(f"{path.name} has {twice[0]!r} under two names; drop one.")
    tracks = _tracks(names, path)
    _check_columns(names, path, tracks=tracks)
    if file.table.num_rows == 0:
        raise InvalidLabels(f"{path.name} has columns but no rows; give it labels.")
    if "attempt" in names:
        file = _last_attempts(file)
    people, person = file.names("person")
    rollouts, rollout = file.names("rollout")
    label = file.numbers("input" if tracks else "label")
    if "label_valid" in names:
        label = np.where(file.flags("label_valid"), label, np.nan)
    known = (*_KNOWN, *TRACKING) if tracks else _KNOWN
    wanted = [name for name in names if name not in known and (not ours or name in CONTEXT)]
    context, notices = _context(file, wanted)
    t_s = file.numbers("t_s") if "t_s" in names else None
    if t_s is not None and not np.isfinite(t_s).all():
        row = int(np.argmin(np.isfinite(t_s)))
        value = None if np.isnan(t_s[row]) else float(t_s[row])
        remedy = "it must be finite: fill the column, or drop it and give --rate-hz"
        raise file.wrong(row, "t_s", value, remedy)
    if "step" in names or t_s is None:
        step = file.whole("step")
    else:
        step = numbered_steps(t_s, person * len(rollouts) + rollout, file.place)
    return LabelColumns(
        people=people,
        rollouts=rollouts,
        person=person,
        rollout=rollout,
        step=step,
        label=label,
        truth=np.full(len(label), np.nan) if tracks else file.numbers("truth"),
        t_s=t_s,
        split=_splits(file) if "split" in names else None,
        tracking=_tracking(file) if tracks else None,
        context=context,
        place=file.place,
        notices=tuple(notices),
    )


def _tracks(names: list[str], path: Path) -> bool:
    """Whether this is a tracking table."""
    labels = [name for name in ("label", "truth") if name in names]
    if labels and "input" in names:
        raise InvalidLabels(
            f"{path.name} has both {labels[0]} and input; a table has label and truth, or "
            f"{', '.join(TRACKING)}: drop or rename those that it is not about."
        )
    return not labels and any(name in names for name in TRACKING)


def _check_columns(names: list[str], path: Path, *, tracks: bool) -> None:
    needed = _TRACKING_NEEDS if tracks else REQUIRED
    missing = [name for name in needed if name not in names]
    if tracks and "t_s" in names:
        missing = [name for name in missing if name != "step"]
    if not missing:
        return
    needs = ", ".join(needed)
    if tracks:
        needs = needs.replace("step", "step or t_s")
    raise InvalidLabels(
        f"{path.name} lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}; "
        f"it has {shown(names) if names else 'none'}. A {'tracking' if tracks else 'label'} table "
        f"needs {needs}."
    )


def _tracking(file: TableFile) -> TrackingColumns:
    found: dict[str, FloatArray] = {}
    for name in ("reference", "disturbance"):
        values = found[name] = file.numbers(name)
        if np.isinf(values).any():
            row = int(np.argmax(np.isinf(values)))
            raise file.wrong(
                row,
                name,
                float(values[row]),
                "it must be finite; leave it empty where there is none",
            )
    return TrackingColumns(**found)


def _last_attempts(file: TableFile) -> TableFile:
    _, person = file.names("person")
    rollouts, rollout = file.names("rollout")
    attempt = file.whole("attempt")
    pair = person * len(rollouts) + rollout
    _, index = np.unique(pair, return_inverse=True)
    last = np.full(index.max() + 1, np.iinfo(np.int64).min)
    np.maximum.at(last, index, attempt)
    keep = attempt == last[index]
    return file if keep.all() else file.kept(keep)


def _splits(file: TableFile) -> IntArray:
    values, codes = file.names("split", people_chose=False)
    for code, value in enumerate(values):
        if value not in SPLITS:
            row = int(np.argmax(codes == code))
            raise file.wrong(row, "split", value, f"it may be {', '.join(SPLITS)}")
    return np.array([SPLITS.index(value) for value in values])[codes]


def _context(file: TableFile, names: list[str]) -> tuple[dict[str, FloatArray], list[str]]:
    context: dict[str, FloatArray] = {}
    notices: list[str] = []
    for name in names:
        if not file.is_numeric(name):
            notices.append(f"Column {name} was left out: it is not numeric.")
            continue
        try:
            values = file.numbers(name)
        except InvalidLabels as why:  # nanoseconds since 1970, say: MIND MELD does not read them
            notices.append(f"Column {name} was left out: {why}")
            continue
        if np.isfinite(values).all():
            context[name] = values
        else:
            notices.append(f"Column {name} was left out: it has missing values.")
    return context, notices
