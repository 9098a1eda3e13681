"""Anyone's labels: a CSV or Parquet file as checked columns. The format is in ``docs/fit.md``."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import CONTEXT
from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.files.reading import reading

IntArray = NDArray[np.int64]

REQUIRED = ("person", "rollout", "step", "label", "truth")
SPLITS = ("train", "heldout", "new_calibration", "new_test")
_OUR_NAMES = {"participant": "person", "teacher_label": "label", "oracle_label": "truth"}
_KNOWN = (*REQUIRED, "t_s", "split", "attempt", "label_valid")
_TEXT = ("person", "participant", "rollout", "split")


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelColumns:
    """A label file's columns, (rows,) each, in the file's order; of redone attempts the last.

    Attributes:
        person, rollout: indices into ``people`` and ``rollouts``, which are sorted.
        label, truth: NaN where the file has none, and where ``label_valid`` is false.
        t_s: None without such a column.
        split: indices into ``SPLITS``; None without such a column.
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
    t_s: FloatArray | None = None
    split: IntArray | None = None
    context: dict[str, FloatArray] = field(default_factory=dict)
    notices: tuple[str, ...] = ()


def read_label_columns(path: Path) -> LabelColumns:
    """Read a label file: the documented columns, or steerlab's own ``LABELLED_STEP_SCHEMA``.

    Raises:
        InvalidLabels: the file cannot be read, lacks a column, or a column holds what it may not.
    """
    with reading(path, "a table of labels", InvalidLabels, "See docs/fit.md for what it may hold."):
        return _columns(_table(path), path)


def _columns(table: pa.Table, path: Path) -> LabelColumns:
    ours = "participant" in table.column_names and "person" not in table.column_names
    if ours:
        table = table.rename_columns([_OUR_NAMES.get(n, n) for n in table.column_names])
    names = table.column_names
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidLabels(f"{path.name} has column {twice[0]!r} twice; rename or drop one.")
    if missing := [name for name in REQUIRED if name not in names]:
        raise InvalidLabels(
            f"{path.name} lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}; "
            f"it has {', '.join(names) or 'none'}. A label table needs {', '.join(REQUIRED)}."
        )
    if table.num_rows == 0:
        raise InvalidLabels(f"{path.name} has columns but no rows; give it labels.")
    if "attempt" in names:
        table = _last_attempts(table)
    people, person = _codes(table, "person")
    rollouts, rollout = _codes(table, "rollout")
    label = _numbers(table, "label")
    if "label_valid" in names:
        label = np.where(_flags(table, "label_valid"), label, np.nan)
    wanted = [name for name in names if name not in _KNOWN and (not ours or name in CONTEXT)]
    context, notices = _context(table, wanted)
    t_s = _numbers(table, "t_s") if "t_s" in names else None
    if t_s is not None and not np.isfinite(t_s).all():
        row = int(np.argmin(np.isfinite(t_s)))
        raise InvalidLabels(
            f"Row {row + 1} has no finite t_s; fill the column, or drop it and give --rate-hz."
        )
    return LabelColumns(
        people=people,
        rollouts=rollouts,
        person=person,
        rollout=rollout,
        step=_whole(table, "step"),
        label=label,
        truth=_numbers(table, "truth"),
        t_s=t_s,
        split=_splits(table) if "split" in names else None,
        context=context,
        notices=tuple(notices),
    )


def _table(path: Path) -> pa.Table:
    if not path.is_file():
        what = "a folder" if path.is_dir() else "not there"
        raise InvalidLabels(f"{path} is {what}; give a .csv or .parquet file of labels.")
    if path.suffix.lower() == ".parquet":
        return pyarrow.parquet.read_table(path)
    if path.suffix.lower() == ".csv":
        types = {name: pa.string() for name in _TEXT}  # "007" is a name, not the number 7
        options = pyarrow.csv.ConvertOptions(column_types=types)
        return pyarrow.csv.read_csv(path, convert_options=options)
    raise InvalidLabels(f"{path.name} is neither .csv nor .parquet; convert or rename it.")


def _codes(table: pa.Table, name: str) -> tuple[tuple[str, ...], IntArray]:
    """The column's sorted distinct values, and each row's index into them (no string per row)."""
    column = table.column(name)
    if column.null_count:
        raise InvalidLabels(f"Column {name} has {column.null_count} empty rows; name each one.")
    try:
        encoded = column.cast(pa.string()).combine_chunks().dictionary_encode()
    except pa.ArrowException as error:
        raise InvalidLabels(f"Column {name} is {column.type}; it must be text.") from error
    values = encoded.dictionary.to_pylist()
    if any(not value.strip() for value in values):
        raise InvalidLabels(f"Column {name} has an empty name; name each {name}.")
    order = sorted(range(len(values)), key=values.__getitem__)
    rank = np.empty(len(values), dtype=np.int64)
    rank[order] = np.arange(len(values))
    return tuple(values[i] for i in order), rank[encoded.indices.to_numpy()]


def _numbers(table: pa.Table, name: str) -> FloatArray:
    column = table.column(name)
    if not _is_numeric(column.type):
        example = next((v for v in column.slice(0, 1000).to_pylist() if v is not None), None)
        raise InvalidLabels(
            f"Column {name} holds {column.type} such as {example!r}; it must hold numbers, "
            f"and nothing (or NaN) where there is none."
        )
    return column.cast(pa.float64()).to_numpy()


def _is_numeric(kind: pa.DataType) -> bool:
    types = pa.types
    return (
        types.is_integer(kind)
        or types.is_floating(kind)
        or types.is_decimal(kind)
        or types.is_null(kind)
    )


def _whole(table: pa.Table, name: str) -> IntArray:
    values = _numbers(table, name)
    whole = np.isfinite(values) & (values == np.round(values)) & (np.abs(values) < 2**53)
    if not whole.all():
        row = int(np.argmin(whole))
        raise InvalidLabels(
            f"Row {row + 1} has {name} {values[row]:g}; it must be a whole number in every row."
        )
    return values.astype(np.int64)


def _flags(table: pa.Table, name: str) -> BoolArray:
    column = table.column(name)
    if column.null_count or not pa.types.is_boolean(column.type):
        raise InvalidLabels(f"Column {name} is {column.type}; it must be true or false everywhere.")
    return column.to_numpy()


def _last_attempts(table: pa.Table) -> pa.Table:
    _, person = _codes(table, "person")
    rollouts, rollout = _codes(table, "rollout")
    attempt = _whole(table, "attempt")
    pair = person * len(rollouts) + rollout
    _, index = np.unique(pair, return_inverse=True)
    last = np.full(index.max() + 1, np.iinfo(np.int64).min)
    np.maximum.at(last, index, attempt)
    keep = attempt == last[index]
    return table if keep.all() else table.filter(pa.array(keep))


def _splits(table: pa.Table) -> IntArray:
    values, codes = _codes(table, "split")
    if unknown := [value for value in values if value not in SPLITS]:
        raise InvalidLabels(f"split has {unknown[0]!r}; it may hold {', '.join(SPLITS)}.")
    return np.array([SPLITS.index(value) for value in values])[codes]


def _context(table: pa.Table, names: list[str]) -> tuple[dict[str, FloatArray], list[str]]:
    context: dict[str, FloatArray] = {}
    notices: list[str] = []
    for name in names:
        if not _is_numeric(table.column(name).type):
            notices.append(f"Column {name} was left out: it is not numeric.")
            continue
        values = _numbers(table, name)
        if np.isfinite(values).all():
            context[name] = values
        else:
            notices.append(f"Column {name} was left out: it has missing values.")
    return context, notices
