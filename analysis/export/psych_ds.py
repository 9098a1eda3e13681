"""A Psych-DS dataset: CSV files under ``data/`` with metadata in JSON-LD.

Written against schema 1.5.0 of https://github.com/psych-ds/psych-DS (``schema_model/versions/1.5.0``,
commit 84c80a0), whose rules the validator https://github.com/psych-ds/psychds-validator applies, and
https://psychds-docs.readthedocs.io. What is recommended and steerlab cannot know (author, citation,
license, funder, url, privacyPolicy) is left for the experimenter to add: the validator warns of it.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from steerlab.analysis.export.codebook import codebook
from steerlab.analysis.export.csv_format import csv_bytes, write_csv
from steerlab.analysis.export.tables import ExportTable
from steerlab.analysis.export.variables import Variable
from steerlab.analysis.study_data.whole_study import WholeStudy

DESCRIPTION, DATA = "dataset_description.json", "data"
SCHEMA_VERSION = "Psych-DS 1.5.0"


def data_file(table: ExportTable, study: str) -> str:
    """``study-ID_description-TABLE_data.csv``: official keywords, values of letters and digits."""
    return f"study-{study}_description-{table.name}_data.csv"


def write_psych_ds(
    study: WholeStudy, tables: Sequence[ExportTable], folder: Path, *, about: str, version: str
) -> None:
    """The dataset, with ``folder`` as its root.

    Args:
        about: the text of its README.
        version: of steerlab.
    """
    data = folder / DATA
    data.mkdir()
    for table in tables:
        path = data / data_file(table, study.id)
        path.write_bytes(csv_bytes(table))
        _write(
            path.with_suffix(".json"),
            {
                "@context": "https://schema.org/",
                "@type": "Dataset",
                "name": f"{study.title}: {table.name}",
                "description": f"A row is {table.what}. Columns that tell rows apart: "
                f"{', '.join(table.key)}.",
                "variableMeasured": [property_value(one) for one in table.variables],
            },
        )
    # A column that several tables have is described as in the first; each sidecar has its own.
    everything = {one.name: one for table in reversed(tables) for one in table.variables}
    _write(
        folder / DESCRIPTION,
        {
            "@context": "https://schema.org/",
            "@type": "Dataset",
            "name": study.title,
            "description": f"Data of the study “{study.title}”: how people correct and teach a "
            "robot that drives. Participants are pseudonyms. README.md says what each file is.",
            "schemaVersion": SCHEMA_VERSION,
            "identifier": study.id,
            "version": f"protocol {study.protocol_version}, sha256 {study.protocol_sha256}",
            "dateModified": study.changed_utc,
            "keywords": ["human-robot interaction", "learning from demonstration", "driving"],
            "variableMeasured": [property_value(one) for one in everything.values()],
        },
    )
    (folder / "documentation").mkdir()
    write_csv(codebook(tables), folder / "documentation")
    (folder / "README.md").write_text(about, encoding="utf-8")
    (folder / "CHANGES.md").write_text(
        f"# Changes\n\n- {study.changed_utc}: as the study was then, by steerlab {version}.\n",
        encoding="utf-8",
    )


def property_value(variable: Variable) -> dict[str, Any]:
    """A variable as schema.org's ``PropertyValue``; nothing that is empty."""
    found: Mapping[str, Any] = {
        "@type": "PropertyValue",
        "name": variable.name,
        "description": variable.label,
        "unitText": variable.unit,
        "minValue": variable.low,
        "maxValue": variable.high,
        "measurementTechnique": variable.source.citation if variable.source else "",
        "valueReference": [
            {"@type": "PropertyValue", "value": level.value, "name": level.label}
            for level in variable.levels
        ],
    }
    return {key: value for key, value in found.items() if value not in ("", None, [])}


def _write(path: Path, values: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(values, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
