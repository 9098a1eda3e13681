"""Tables as CSV: UTF-8, commas, ``.`` for decimals, an empty cell where there is no value."""

import io
from pathlib import Path

import pyarrow.csv as pv

from steerlab.analysis.export.tables import ExportTable


def csv_bytes(table: ExportTable) -> bytes:
    """A table's text; numbers read back to the last bit, and truth values are 0 and 1."""
    text = io.BytesIO()
    text.write(",".join(table.data.column_names).encode() + b"\n")
    options = pv.WriteOptions(include_header=False, quoting_style="needed")
    pv.write_csv(table.data, text, options)
    return text.getvalue()


def write_csv(table: ExportTable, folder: Path) -> None:
    """``NAME.csv`` in ``folder``."""
    (folder / f"{table.name}.csv").write_bytes(csv_bytes(table))
