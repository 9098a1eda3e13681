"""Tables as Parquet, with what each column is in its field's metadata."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.export.variables import Variable
from steerlab.study.derived import EXPORT_LABEL


def write_parquet(table: ExportTable, folder: Path, *, study: str) -> None:
    """``NAME.parquet`` in ``folder``."""
    fields = [
        field.with_metadata(field_metadata(variable))
        for field, variable in zip(table.data.schema, table.variables, strict=True)
    ]
    about = {EXPORT_LABEL: study, "table": table.name, "row": table.what}
    schema = pa.schema(fields, metadata=about | {"key": ", ".join(table.key)})
    pq.write_table(table.data.cast(schema), folder / f"{table.name}.parquet")


def field_metadata(variable: Variable) -> dict[str, str]:
    """``label``, ``unit``, ``measure``, and ``levels`` as JSON, as far as there are any."""
    levels = [{"value": level.value, "label": level.label} for level in variable.levels]
    found = {
        "label": variable.label,
        "unit": variable.unit,
        "measure": variable.measure,
        "levels": json.dumps(levels, ensure_ascii=False) if levels else "",
        "questionnaire": variable.source.questionnaire if variable.source else "",
        "citation": variable.source.citation if variable.source else "",
    }
    return {key: value for key, value in found.items() if value}
