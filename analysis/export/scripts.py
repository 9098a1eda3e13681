"""What loads an export in other programs: R, SPSS's syntax for the CSV files, and a note for JASP."""

from collections.abc import Iterator, Sequence

from steerlab.analysis.export.spss import fitted, label_of
from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.export.variables import Variable

_LONGEST_IN_SYNTAX = 200  # bytes of a label: a line of SPSS's syntax has at most 256
_R_TYPES = {"truth": "numeric", "whole": "numeric", "number": "numeric"}
_SPSS_TYPES = {"truth": "F1.0", "whole": "F8.0", "number": "F16.6"}

JASP = """\
JASP (https://jasp-stats.org)

Open > Computer > spss/participants.sav (with names of values and labels), or csv/participants.csv.
JASP takes one table at a time. In the CSV file an empty cell is missing, which JASP knows by itself.
In the .sav file the reasons of missing answers are numbers (-99, -98, -97; see spss_missing in
codebook.csv). If a version of JASP shows them as answers, enter them as missing values under
Preferences > Data, or open the CSV file instead.
Leave out who does not count: filter on counted = 1.
"""


def load_r(tables: Sequence[ExportTable]) -> str:
    """A script for base R that loads each table into a data frame of its name."""
    lines = [
        "# Loads every table of this export into a data frame of its name, with labels and levels.",
        "# Start R in this folder, or: source('load.R', chdir = TRUE)",
        "read_table <- function(name, types, labels, levels) {",
        "  file <- file.path('csv', paste0(name, '.csv'))",
        "  table <- read.csv(file, fileEncoding = 'UTF-8', na.strings = '', colClasses = types)",
        "  for (column in names(levels)) {",
        "    table[[column]] <- factor(table[[column]], levels = levels[[column]])",
        "  }",
        "  for (column in names(labels)) attr(table[[column]], 'label') <- labels[[column]]",
        "  table",
        "}",
    ]
    for table in tables:
        variables = table.variables
        types = [_R_TYPES.get(variable.kind, "character") for variable in variables]
        labels = [f"{v.name} = {_r(label_of(v))}" for v in variables]
        levels = [
            f"{v.name} = c({', '.join(_r(str(level.value)) for level in v.levels)})"
            for v in variables
            if v.kind == "choice"
        ]
        lines += [
            "",
            f"# A row is {table.what}.",
            f"{table.name} <- read_table('{table.name}',",
            f"  types = c({', '.join(_r(kind) for kind in types)}),",
            "  labels = list(",
            ",\n".join(f"    {label}" for label in labels),
            "  ),",
            "  levels = list(" + ", ".join(levels) + "))",
        ]
    return "\n".join(lines) + "\n"


def _r(text: str) -> str:
    """A text as R has it between quotes, in ASCII: R on Windows reads scripts in other encodings."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    escaped = escaped.replace("\t", "\\t")
    plain = "".join(c if c.isascii() else f"\\U{{{ord(c):06x}}}" for c in escaped)
    return f'"{plain}"'


def load_sps(tables: Sequence[ExportTable]) -> str:
    """SPSS syntax that loads each CSV file into a dataset of the table's name."""
    lines = [
        "* Encoding: UTF-8.",
        "* Loads every table of this export into a dataset of its name.",
        "* Put this folder's path into the next line, then run everything.",
        "CD '.'.",
    ]
    for table in tables:
        lines += _loaded(table)
    lines += ["", f"DATASET ACTIVATE {tables[0].name}."]
    return "\n".join(lines) + "\n"


def _loaded(table: ExportTable) -> Iterator[str]:
    variables = table.variables
    yield ""
    yield f"* A row is {table.what}."
    yield "GET DATA"
    yield f"  /TYPE=TXT /FILE='csv/{table.name}.csv' /ENCODING='UTF8'"
    yield "  /ARRANGEMENT=DELIMITED /DELIMITERS=',' /QUALIFIER='\"' /FIRSTCASE=2"
    yield "  /VARIABLES="
    yield from (f"    {v.name} {_SPSS_TYPES.get(v.kind) or _width(table, v)}" for v in variables)
    yield "  ."
    yield "VARIABLE LABELS"
    for variable in variables:
        yield f"  {variable.name}"
        yield f"    {_spss(label_of(variable))}"
    yield "  ."
    with_levels = [variable for variable in variables if variable.levels]
    for variable in with_levels:
        yield f"VALUE LABELS {variable.name}"
        for level in variable.levels:
            value = level.value if isinstance(level.value, int) else _spss(level.value)
            yield f"  {value} {_spss(level.label, 120)}"
        yield "  ."
    for measure in ("nominal", "ordinal", "scale"):
        if named := [v.name for v in variables if v.measure == measure]:
            yield "VARIABLE LEVEL"
            yield from (f"  {name}" for name in named)
            yield f"  ({measure.upper()})."
    yield f"DATASET COPY {table.name}."  # NAME would not keep it: PSPP reads over what is active


def _width(table: ExportTable, variable: Variable) -> str:
    """The format of a text that is as long as the longest in the table."""
    values = [
        *table.data[variable.name].unique().to_pylist(),
        *(level.value for level in variable.levels),
    ]
    return f"A{max((len(str(value).encode()) for value in values if value is not None), default=1)}"


def _spss(text: str, longest: int = _LONGEST_IN_SYNTAX) -> str:
    return "'" + fitted(" ".join(text.split()), longest).replace("'", "''") + "'"
