"""An export as a folder: every format that was asked for, codebook, README, and what loads them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from steerlab.analysis.export.codebook import codebook
from steerlab.analysis.export.csv_format import write_csv
from steerlab.analysis.export.long import long_tables
from steerlab.analysis.export.parquet import write_parquet
from steerlab.analysis.export.psych_ds import write_psych_ds
from steerlab.analysis.export.scripts import JASP, load_r, load_sps
from steerlab.analysis.export.spss import write_spss
from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.export.wide import participants_table
from steerlab.analysis.study_data.whole_study import WholeStudy
from steerlab.sim.progress import Progress

Format = Literal["csv", "spss", "parquet", "psych-ds"]
FORMATS: tuple[Format, ...] = get_args(Format)

_FOLDERS: dict[Format, str] = {
    "csv": "csv/*.csv: UTF-8, commas; an empty cell has no value",
    "spss": "spss/*.sav: for SPSS, JASP, jamovi, PSPP and R's haven; with labels and missing codes",
    "parquet": "parquet/*.parquet: for pandas, R's arrow, Julia; labels in the fields' metadata",
    "psych-ds": "psych-ds/: the same tables as a Psych-DS dataset, to be published as it is",
}
_CODEBOOK = "codebook.csv: every column of every table: label, type, unit, range, values, origin"
_SCRIPTS = [
    "load.R: R; makes a data frame of each table",
    "load.sps: SPSS; makes a dataset of each CSV file (spss/ needs no syntax)",
]
_JASP = "JASP.txt: how to open it in JASP"
_PSYCH_DS = [
    "dataset_description.json: what the dataset is, and all its columns",
    "data/*_data.csv: the tables; beside each a .json with its own columns",
    "documentation/codebook.csv: the same as a table",
]


@dataclass(frozen=True, kw_only=True)
class ExportConfig:
    """What is exported.

    Attributes:
        formats: each once.
        free_text: also what participants wrote in their own words.
        with_withdrawn: also those who left and let their data be kept.
    """

    formats: tuple[Format, ...] = ("csv",)
    free_text: bool = False
    with_withdrawn: bool = False


def write_export(
    study: WholeStudy, config: ExportConfig, folder: Path, *, version: str, progress: Progress
) -> list[ExportTable]:
    """Write everything but ``summary.json`` into an empty folder; the same study, the same bytes.

    Args:
        version: of steerlab.

    Returns:
        the tables.
    """
    progress("making the tables", 0.0)
    tables = [
        participants_table(study, free_text=config.free_text),
        *long_tables(study, free_text=config.free_text),
    ]
    files = [_CODEBOOK, *(_FOLDERS[format] for format in config.formats)]
    files += _SCRIPTS if "csv" in config.formats else []
    files += [_JASP] if {"csv", "spss"} & {*config.formats} else []
    files += ["summary.json: what the export was made from, and the hash of each file"]
    readme = readme_text(study, config, tables, files, version)
    (folder / "README.txt").write_text(readme, encoding="utf-8")
    write_csv(codebook(tables), folder)
    for index, format in enumerate(config.formats):
        progress("writing the files", index / len(config.formats))
        (folder / format).mkdir()
        if format == "psych-ds":
            about = readme_text(study, config, tables, _PSYCH_DS, version)
            write_psych_ds(study, tables, folder / format, about=about, version=version)
        else:
            _write(format, study, tables, folder)
    progress("writing the files", 1.0)
    return tables


def _write(format: Format, study: WholeStudy, tables: Sequence[ExportTable], folder: Path) -> None:
    """The files of one format, and the scripts that load them."""
    if format == "csv":
        (folder / "load.R").write_text(load_r(tables), encoding="utf-8")
        (folder / "load.sps").write_text(load_sps(tables), encoding="utf-8")
    if format in ("csv", "spss"):
        (folder / "JASP.txt").write_text(JASP, encoding="utf-8")
    for table in tables:
        if format == "csv":
            write_csv(table, folder / format)
        elif format == "parquet":
            write_parquet(table, folder / format, study=study.id)
        else:
            write_spss(table, folder / format, study=study.id, changed_utc=study.changed_utc)


def readme_text(
    study: WholeStudy,
    config: ExportConfig,
    tables: Sequence[ExportTable],
    files: Sequence[str],
    version: str,
) -> str:
    """What each file is, and what the reader must know."""
    counted = sum(person.why_excluded is None for person in study.people)
    lines = [
        study.title,
        "=" * len(study.title),
        "",
        f"Study {study.id}, as it was on {study.changed_utc}",
        f"Protocol version {study.protocol_version}, sha256 {study.protocol_sha256}",
        f"Exported by steerlab {version}: steerlab export, see docs/export.md",
        "",
        f"Participants: {len(study.people)}, of whom {counted} count in the analysis (counted = 1).",
        "exclusion says why the others do not; the rules are those of steerlab analyze.",
        *study.notices,
        "",
        "Files",
        "-----",
        *files,
        "",
        "Tables",
        "------",
        *(
            f"{table.name}: a row is {table.what}; {table.data.num_rows} rows; "
            f"key {', '.join(table.key)}"
            for table in tables
        ),
        "A table without any row is left out.",
        "",
        "Values",
        "------",
        "A missing value is an empty cell (CSV), null (Parquet), system-missing (SPSS). Why there is",
        "no answer to an item stands in the column state of the table answers; SPSS files have it",
        "as user-missing numbers as well: spss_missing in the codebook.",
        "Truth values are 0 and 1. Times are ISO 8601 in UTC. Units end names (_s, _m) and stand in",
        "the codebook. Labels are wheel positions from -2.5 to 2.5. Answers are as given: reversed",
        "items are turned in scores alone.",
        "",
        "Privacy",
        "-------",
        "Participants are pseudonyms. Who withdrew is not here"
        + (", unless they left their data." if config.with_withdrawn else "."),
        "The experimenter's notes are not here. What participants wrote in their own words is "
        + ("here: read it before you pass this on." if config.free_text else "not here."),
        "Age, gender and the like can still tell who somebody is: this is personal data until you",
        "have made sure that it is not. When somebody asks for erasure, delete this copy too:",
        "steerlab erases exports inside the study's folder, and knows no others.",
    ]
    return "\n".join(lines) + "\n"
