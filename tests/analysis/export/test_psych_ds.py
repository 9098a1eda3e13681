"""The published rules of Psych-DS, one by one, on an export.

Schema 1.5.0, https://github.com/psych-ds/psych-DS at 84c80a0: ``rules/errors.yaml``,
``rules/files/common/core.yaml``, ``rules/files/tabular_data/data.yaml``, ``rules/compiled_metadata.yaml``,
and how https://github.com/psych-ds/psychds-validator at 6239b2e applies them (``src/schema/applyRules.ts``,
``src/files/csv.ts``). Errors in capitals are the schema's codes.
"""

import csv
import json
import re

import pytest

pytestmark = pytest.mark.slow  # the study takes half a minute

NAME = re.compile(r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.csv")
OFFICIAL = {  # meta/context.yaml: the keywords of file names
    *("study", "site", "subject", "session", "task", "condition", "trial", "stimulus"),
    "description",
}
OF_DATASET = {  # schema.org: properties of Dataset, CreativeWork and Thing that are used here
    *("name", "description", "schemaVersion", "identifier", "version", "dateModified"),
    *("keywords", "variableMeasured"),
}
OF_PROPERTY_VALUE = {  # schema.org/PropertyValue
    *("name", "description", "unitText", "minValue", "maxValue", "measurementTechnique"),
    *("valueReference", "value"),
}


@pytest.fixture
def root(exported):
    return exported[0] / "psych-ds"


@pytest.fixture
def metadata(root):
    """By path: INVALID_JSON_FORMATTING and JSON_ENCODING_ERROR are no option after this."""
    files = sorted(root.rglob("*.json"))
    return {path: json.loads(path.read_bytes().decode("utf-8")) for path in files}


def _rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def test_the_required_files_are_where_they_belong(root):
    assert (root / "dataset_description.json").is_file()  # MISSING_DATASET_DESCRIPTION
    assert (root / "data").is_dir()  # MISSING_DATA_DIRECTORY
    assert list((root / "data").glob("*.csv"))  # MISSING_DATAFILE
    assert (root / "README.md").is_file()  # MISSING_README_DOC
    assert (root / "CHANGES.md").is_file()  # MISSING_CHANGES_DOC
    others = [path for path in root.rglob("dataset_description.json") if path.parent != root]
    assert others == []  # WRONG_METADATA_LOCATION
    assert all(path.stat().st_size for path in root.rglob("*") if path.is_file())  # FILE_EMPTY


def test_file_names_are_pairs_of_official_keywords_and_values(root):
    for path in (root / "data").glob("*.csv"):
        assert NAME.fullmatch(path.name), path.name  # FILENAME_KEYWORD_FORMATTING_ERROR
        pairs = path.name.removesuffix("_data.csv").split("_")
        keys = [pair.partition("-")[0] for pair in pairs]
        assert set(keys) <= OFFICIAL  # FILENAME_UNOFFICIAL_KEYWORD_WARNING
        assert len(set(keys)) == len(keys)


def test_csv_files_have_a_header_and_whole_rows(root, exported):
    found = sorted((root / "data").glob("*.csv"))
    assert len(found) == len(exported[1])
    for path in found:
        header, *rows = _rows(path)  # CSV_HEADER_MISSING, CSV_FORMATTING_ERROR
        assert header
        assert len(set(header)) == len(header)  # CSV_HEADER_REPEATED
        assert {len(row) for row in rows} == {len(header)}  # CSV_HEADER_LENGTH_MISMATCH
        assert "row_id" not in header  # ROWID_VALUES_NOT_UNIQUE


def test_metadata_is_json_ld_of_a_schema_org_dataset(metadata):
    for path, values in metadata.items():
        assert values["@context"] == "https://schema.org/", path
        assert values["@type"] == "Dataset"  # INCORRECT_DATASET_TYPE, MISSING_DATASET_TYPE
        for key in ("name", "description", "variableMeasured"):  # JSON_KEY_REQUIRED
            assert values[key], (path, key)
        # INVALID_SCHEMAORG_PROPERTY, UNKNOWN_NAMESPACE
        assert {key for key in values if not key.startswith("@")} <= OF_DATASET
        for one in values["variableMeasured"]:
            _check_property_value(one)


def _check_property_value(one):
    """OBJECT_TYPE_MISSING, INVALID_OBJECT_TYPE, INVALID_SCHEMAORG_PROPERTY."""
    assert one["@type"] == "PropertyValue"
    assert {key for key in one if not key.startswith("@")} <= OF_PROPERTY_VALUE
    assert one["name"]
    for level in one.get("valueReference", ()):
        _check_property_value(level)


def test_each_column_is_described_and_each_description_has_a_column(root, metadata):
    columns = {path.name: _rows(path)[0] for path in (root / "data").glob("*.csv")}
    described = [v["name"] for v in metadata[root / "dataset_description.json"]["variableMeasured"]]
    assert len(set(described)) == len(described)
    # CSV_COLUMN_MISSING_FROM_METADATA, VARIABLE_MISSING_FROM_CSV_COLUMNS
    assert set(described) == {name for names in columns.values() for name in names}
    for name, header in columns.items():  # a sidecar replaces the list as a whole
        sidecar = metadata[root / "data" / name.replace(".csv", ".json")]
        assert [one["name"] for one in sidecar["variableMeasured"]] == header


def test_files_outside_data_are_in_folders_that_the_schema_names(root):
    known = {"README.md", "CHANGES.md", "dataset_description.json", "data", "documentation"}
    assert {path.name for path in root.iterdir()} == known  # FILE_NOT_CHECKED
