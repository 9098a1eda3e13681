"""Tables as labelled SPSS files (.sav), by the extra ``export``: pyreadstat, and pandas, which it needs.

Limits are those of the SPSS documentation (IBM SPSS Statistics, "Variable names", "Variable labels",
"Value labels"): names of 64 bytes, labels of variables 256, of values 120.
"""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.export.variables import Variable
from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.writing import writing
from steerlab.study.derived import EXPORT_LABEL

LONGEST_LABEL, LONGEST_VALUE_LABEL = 256, 120  # bytes
_DATE_AT, _TIME_AT = slice(92, 101), slice(101, 109)  # in the header, "01 Jan 70" and "00:00:00"
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
_FORMATS = {"truth": "F1.0", "choice": "F8.0", "whole": "F8.0", "number": "F16.6"}


class CannotWriteSpss(SteerlabError):
    """What SPSS files are written with is not installed."""


def check_installed() -> None:
    """Refuse before anything is read.

    Raises:
        CannotWriteSpss: with how to install it.
    """
    try:
        import pandas  # noqa: F401
        import pyreadstat  # noqa: F401
    except ImportError as error:
        raise CannotWriteSpss(
            f"SPSS files need {error.name}, which is not installed; run pip install "
            "'steerlab[export]', or choose --format csv, whose load.sps makes the same in SPSS."
        ) from error


def write_spss(table: ExportTable, folder: Path, *, study: str, changed_utc: str) -> None:
    """``NAME.sav`` in ``folder``; dated ``changed_utc``, so that the same study gives the same bytes.

    Raises:
        OSError: the disk does not take it.
    """
    import pandas
    import pyreadstat

    columns = {variable.name: _values(table, variable) for variable in table.variables}
    frame = pandas.DataFrame(
        {
            name: pandas.Series(values, dtype=object if _is_text(variable) else "float64")
            for (name, values), variable in zip(columns.items(), table.variables, strict=True)
        }
    )
    numeric = [variable for variable in table.variables if not _is_text(variable)]
    path = folder / f"{table.name}.sav"
    with writing(path, pyreadstat.ReadstatError):
        pyreadstat.write_sav(
            frame,  # pyright: ignore[reportArgumentType] (a protocol that pandas' types do not meet)
            path,
            file_label=f"{EXPORT_LABEL} {study}: {table.name}",
            column_labels=[
                fitted(label_of(variable), LONGEST_LABEL) for variable in table.variables
            ],
            variable_value_labels={v.name: labels for v in numeric if (labels := value_labels(v))},
            missing_ranges={
                v.name: list(v.missing_codes.values()) for v in numeric if v.missing_codes
            },
            variable_measure={variable.name: variable.measure for variable in table.variables},
            variable_format={variable.name: _FORMATS[variable.kind] for variable in numeric},
        )
        # It takes half a write for a whole one, and only finds when it reads that rows are missing.
        pyreadstat.read_sav(path, usecols=[table.variables[0].name])
    _date(path, datetime.fromisoformat(changed_utc))


def label_of(variable: Variable) -> str:
    """The label with its unit."""
    return f"{variable.label} [{variable.unit}]" if variable.unit else variable.label


def value_labels(variable: Variable) -> dict[int | float, str]:
    """The words of each number, of reasons of missing answers too."""
    labels = {variable.codes[level.value]: level.label for level in variable.levels}
    labels |= {code: why.value for why, code in variable.missing_codes.items()}
    return {code: fitted(label, LONGEST_VALUE_LABEL) for code, label in labels.items()}


def fitted(label: str, longest: int) -> str:
    """A label of at most so many bytes; the codebook has all of it."""
    if len(label.encode()) <= longest:
        return label
    return label.encode()[: longest - 3].decode(errors="ignore").rstrip() + "…"


def _is_text(variable: Variable) -> bool:
    return variable.kind in ("text", "time")


def _values(table: ExportTable, variable: Variable) -> Sequence[Any]:
    """Texts, or numbers: words by their codes, reasons of missing answers by theirs."""
    values = table.data[variable.name].to_pylist()
    if _is_text(variable):
        return values
    if variable.kind == "choice":
        values = [None if value is None else variable.codes[value] for value in values]
    why, codes = table.why.get(variable.name), variable.missing_codes
    if why is None:
        return values
    return [
        codes[reason] if reason is not None else value
        for value, reason in zip(values, why, strict=True)
    ]


def _date(path: Path, at: datetime) -> None:
    """Put a date into the header, where pyreadstat writes the present one."""
    with path.open("r+b") as file:
        file.seek(_DATE_AT.start)
        file.write(f"{at.day:02} {_MONTHS[at.month - 1]} {at.year % 100:02}{at:%H:%M:%S}".encode())
