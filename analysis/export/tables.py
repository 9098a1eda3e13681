"""``ExportTable``: rows and their variables, which every format writes in its own way."""
# pyarrow ships no types:
# pyright: reportAttributeAccessIssue=false

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pyarrow as pa

from steerlab.analysis.export.variables import Variable, distinct, text
from steerlab.analysis.study_data.asked import Missing
from steerlab.study.derived import EXPORT_COLUMN

PARTICIPANTS = "participants"
"""The table with a row for each participant."""

_ARROW = {
    "text": pa.string(),
    "choice": pa.string(),
    "time": pa.string(),
    "truth": pa.int8(),
    "whole": pa.int64(),
    "number": pa.float64(),
}


@dataclass(frozen=True, kw_only=True)
class Column:
    """A variable and its values, a row each.

    Attributes:
        values: plain ones, None where there is none; or as Arrow has them.
        why: why a value is missing, where that is known; empty for all but answers.
    """

    variable: Variable
    values: Sequence[Any] | pa.ChunkedArray
    why: Sequence[Missing | None] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class ExportTable:
    """A table.

    Attributes:
        what: what a row is.
        key: the columns that tell rows apart.
        variables: of each column, in order; the first says which study it is.
        data: (rows, columns); null where there is no value.
        why: by column, as in ``Column``.
    """

    name: str
    what: str
    key: tuple[str, ...]
    variables: tuple[Variable, ...]
    data: pa.Table
    why: Mapping[str, Sequence[Missing | None]] = field(default_factory=dict)


def made_table(
    name: str, what: str, key: Sequence[str], columns: Sequence[Column], *, study: str, rows: int
) -> ExportTable:
    """A table with the study's id before all else."""
    mark = Column(
        variable=text(EXPORT_COLUMN, "Identifies the study, and marks the file as steerlab's"),
        values=[study] * rows,
    )
    everything = (mark, *columns)
    names = distinct([column.variable.name for column in everything])
    variables = tuple(
        replace(column.variable, name=name) for column, name in zip(everything, names, strict=True)
    )
    arrays = [arrow_values(column) for column in everything]
    return ExportTable(
        name=name,
        what=what,
        key=tuple(key),
        variables=variables,
        data=pa.table(arrays, names=names),
        why={name: one.why for one, name in zip(everything, names, strict=True) if one.why},
    )


def arrow_values(column: Column) -> pa.Array | pa.ChunkedArray:
    """A column's values in the type of its variable."""
    values, type_ = column.values, _ARROW[column.variable.kind]
    if isinstance(values, pa.ChunkedArray):
        return values.cast(type_)
    if column.variable.kind == "truth":
        return pa.array(values, type=pa.bool_()).cast(type_)
    return pa.array(values, type=type_)
