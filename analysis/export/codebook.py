"""The codebook: a row for each column of each table."""

from collections.abc import Sequence

import pyarrow as pa

from steerlab.analysis.export.tables import Column, ExportTable, arrow_values
from steerlab.analysis.export.variables import Variable, number, text, whole

CODEBOOK = "codebook"
KINDS = {
    "text": "text",
    "choice": "one of some words",
    "truth": "0 or 1",
    "whole": "whole number",
    "number": "number",
    "time": "ISO 8601, UTC",
}
COLUMNS = (
    text("table", "Table the variable is in"),
    text("name", "Name of the column, the same in every format"),
    text("label", "What it is"),
    text("type", "What its values are"),
    text("unit", "Unit"),
    text("measure", "nominal, ordinal or scale"),
    number("low", "Lowest value there can be"),
    number("high", "Highest value there can be"),
    text("values", "What single values mean: VALUE = meaning, parted by ;"),
    text("spss_codes", "Numbers that words have in SPSS: NUMBER = VALUE, parted by ;"),
    text("spss_missing", "Numbers that reasons of missing answers have in SPSS"),
    text("questionnaire", "Key of the questionnaire it comes from"),
    whole("version", "Version of the questionnaire"),
    text("phase", "Phase in which it is asked"),
    text("condition", "Condition after which it is asked"),
    text("item_or_scale", "Id of the item, or key of the scale"),
    text("reversed_in", "Scales in which the item counts in reverse; its answers are as given"),
    text("citation", "Where the questionnaire comes from"),
)


def codebook(tables: Sequence[ExportTable]) -> ExportTable:
    """The codebook of some tables; it holds nobody's data."""
    rows = [_row(table, variable) for table in tables for variable in table.variables]
    values = [
        arrow_values(Column(variable=column, values=[row[at] for row in rows]))
        for at, column in enumerate(COLUMNS)
    ]
    return ExportTable(
        name=CODEBOOK,
        what="a column of a table",
        key=("table", "name"),
        variables=COLUMNS,
        data=pa.table(values, names=[column.name for column in COLUMNS]),
    )


def _row(table: ExportTable, variable: Variable) -> tuple[str | float | None, ...]:
    source, words = variable.source, variable.kind == "choice"
    return (
        table.name,
        variable.name,
        variable.label,
        KINDS[variable.kind],
        variable.unit or None,
        variable.measure,
        variable.low,
        variable.high,
        "; ".join(f"{level.value} = {level.label}" for level in variable.levels) or None,
        "; ".join(f"{code} = {value}" for value, code in variable.codes.items()) if words else None,
        "; ".join(f"{code} = {why}" for why, code in variable.missing_codes.items()) or None,
        source.questionnaire if source else None,
        source.version if source else None,
        source.phase if source else None,
        (source.condition or None) if source else None,
        source.part if source else None,
        (", ".join(source.reversed_in) or None) if source else None,
        source.citation if source else None,
    )
