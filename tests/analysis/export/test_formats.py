"""Every format gives back what was written, with its labels; the same study gives the same bytes."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pyreadstat
import pytest

from steerlab.analysis.export.spss import CannotWriteSpss, check_installed, write_spss
from steerlab.analysis.export.tables import PARTICIPANTS
from tests.analysis.export.conftest import NOTE, OWN_WORDS, export_to

pytestmark = pytest.mark.slow  # the study takes half a minute


def test_csv_gives_back_every_value(exported):
    out, tables = exported
    for name, table in tables.items():
        path = out / "csv" / f"{name}.csv"
        assert path.read_bytes().decode("utf-8").startswith("steerlab_study,participant,")
        found = pd.read_csv(path, keep_default_na=False, na_values=[""])
        for variable in table.variables:
            written, read = table.data[variable.name].to_pylist(), found[variable.name]
            assert [v is None for v in written] == read.isna().tolist(), variable.name
            assert [v for v in written if v is not None] == read.dropna().tolist(), variable.name


def test_parquet_has_labels_and_units_in_its_fields(exported, whole):
    out, tables = exported
    for name, table in tables.items():
        found = pq.read_table(out / "parquet" / f"{name}.parquet")
        assert found.equals(table.data.cast(found.schema))
        assert found.schema.metadata[b"steerlab export"] == whole.id.encode()
        for variable, field in zip(table.variables, found.schema, strict=True):
            assert field.metadata[b"label"].decode() == variable.label
    found = pq.read_schema(out / "parquet" / "participants.parquet")
    assert found.field("demographics_age").metadata[b"unit"] == b"years"
    levels = json.loads(found.field("demographics_gender").metadata[b"levels"])
    assert levels[0] == {"value": "woman", "label": "Woman"}


def _read_sav(out, name=PARTICIPANTS):
    return pyreadstat.read_sav(out / "spss" / f"{name}.sav", user_missing=True)


def test_spss_has_labels_levels_and_codes_of_what_is_missing(exported):
    out, tables = exported
    table = tables[PARTICIPANTS]
    found, about = _read_sav(out)
    assert list(found.columns) == table.data.column_names
    assert about.column_names_to_labels["mind_meld_trust_t01"].startswith(
        "The system is deceptive."
    )
    assert about.column_names_to_labels["duration_calibration_s"].endswith("[s]")
    assert about.variable_value_labels["demographics_gender"][1.0] == "Woman"
    assert about.variable_value_labels["counted"] == {0.0: "no", 1.0: "yes"}
    assert about.variable_measure["mind_meld_trust_t01"] == "ordinal"
    assert about.variable_measure["demographics_gender"] == "nominal"
    assert about.variable_measure["label_mae"] == "scale"
    codes = {-99.0: "not answered", -98.0: "not shown", -97.0: "not reached"}
    assert about.missing_ranges["fluency_f1"] == [{"lo": code, "hi": code} for code in codes]
    assert codes.items() <= about.variable_value_labels["fluency_f1"].items()
    by_person = found.set_index("participant")
    assert by_person.loc["T003", "demographics_age"] == -99
    assert by_person.loc["T001", "mind_meld_trust_t01"] == -98
    assert by_person.loc["P002", "fluency_f1"] == -97
    assert np.isnan(by_person.loc["P002", "fluency_fluency_score"])  # system-missing


@pytest.mark.parametrize("name", ["participants", "labels", "answers", "drives", "phases"])
def test_spss_gives_back_every_value(exported, name):
    out, tables = exported
    found, _ = pyreadstat.read_sav(out / "spss" / f"{name}.sav")  # user-missing as missing
    for variable in tables[name].variables:
        written = tables[name].data[variable.name].to_pylist()
        if variable.kind == "choice":
            written = [None if v is None else variable.codes[v] for v in written]
        text = variable.kind in ("text", "time")
        missing = "" if text else None
        read = [missing if not text and pd.isna(v) else v for v in found[variable.name]]
        assert read == [missing if v is None else v for v in written], variable.name


def test_the_same_study_gives_the_same_bytes(exported, whole, tmp_path):
    export_to(tmp_path, whole)
    files = [path for path in sorted(tmp_path.rglob("*")) if path.is_file()]
    assert len(files) > 50
    for path in files:
        other = exported[0] / path.relative_to(tmp_path)
        assert path.read_bytes() == other.read_bytes(), other


def _holding(out, words: bytes):
    return sorted(p.name for p in out.rglob("*") if p.is_file() and words in p.read_bytes())


def test_own_words_leave_only_when_asked_for_and_notes_never(exported, whole, tmp_path):
    assert _holding(exported[0], OWN_WORDS.encode()) == []
    assert "demographics_gender_own_words" not in exported[1][PARTICIPANTS].data.column_names
    export_to(tmp_path, whole, free_text=True)
    found = _holding(tmp_path, OWN_WORDS.encode())
    assert {"participants.csv", "answers.csv", "participants.sav", "answers.sav"} <= set(found)
    for out in (exported[0], tmp_path):
        assert _holding(out, NOTE.encode()) == []


def test_rows_that_the_disk_did_not_take_are_missed(exported, tmp_path, monkeypatch):
    write = pyreadstat.write_sav

    def half(frame, path, **settings):  # a full disk takes so much, and pyreadstat ends well
        write(frame, path, **settings)
        os.truncate(path, path.stat().st_size * 2 // 3)

    monkeypatch.setattr(pyreadstat, "write_sav", half)
    table = exported[1]["labels"]
    with pytest.raises(OSError, match="expected number of rows"):
        write_spss(table, tmp_path, study="one", changed_utc="2026-01-01T00:00:00+00:00")


def test_spss_is_refused_in_a_sentence_without_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyreadstat", None)
    with pytest.raises(CannotWriteSpss, match=r"pip install 'steerlab\[export\]'"):
        check_installed()


def test_load_r_makes_every_table(exported, tmp_path):
    rscript = shutil.which("Rscript")
    if rscript is None:
        pytest.skip("no Rscript; install it with: sudo apt-get install r-base-core")
    out, tables = exported
    lines = [f"source('{out / 'load.R'}', chdir = TRUE)"]
    lines += [f"cat('{name}', nrow({name}), ncol({name}), '\\n')" for name in tables]
    lines += [
        "cat(levels(participants$demographics_gender), '\\n')",
        "cat(attr(participants$demographics_age, 'label'), '\\n')",
        "cat(format(mean(labels$teacher_label), digits = 15), '\\n')",
        "cat(as.character(participants$demographics_gender[4]), '\\n')",
    ]
    (tmp_path / "check.R").write_text("\n".join(lines))
    done = subprocess.run([rscript, tmp_path / "check.R"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    said = [line.strip() for line in done.stdout.splitlines()]
    shapes = [f"{name} {t.data.num_rows} {t.data.num_columns}" for name, t in tables.items()]
    assert said[: len(shapes)] == shapes
    levels, label, labels_mean, own = said[len(shapes) :]
    assert levels == "woman man non_binary self_described prefer_not_to_say"
    assert label == "How old are you? [years]"
    assert float(labels_mean) == pytest.approx(np.mean(tables["labels"].data["teacher_label"]))
    assert own == "self_described"


def test_load_sps_makes_every_table(exported, tmp_path):
    pspp = shutil.which("pspp")
    if pspp is None:
        pytest.skip("no pspp, which runs SPSS's syntax; install it with: sudo apt-get install pspp")
    out, tables = exported
    text = (out / "load.sps").read_text().replace("CD '.'", f"CD '{out}'")
    for name in tables:
        text += f"DATASET ACTIVATE {name}.\nSAVE OUTFILE='{tmp_path / name}.sav'.\n"
    (tmp_path / "all.sps").write_text(text)
    done = subprocess.run(
        [pspp, tmp_path / "all.sps"], capture_output=True, text=True, cwd=tmp_path
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    for name, table in tables.items():
        found, about = pyreadstat.read_sav(tmp_path / f"{name}.sav")
        assert found.shape == table.data.shape, name
        for variable in table.variables:
            written = table.data[variable.name].to_pylist()
            text = variable.kind in ("text", "time", "choice")
            missing = "" if text else None
            read = [missing if not text and pd.isna(v) else v for v in found[variable.name]]
            expected = [missing if v is None else v for v in written]
            if text:
                assert read == expected, variable.name
            else:
                assert read == [v if v is None else pytest.approx(v, rel=1e-9) for v in expected]
    assert about.column_names_to_labels["teacher_label"].startswith("Label that")
    _, about = pyreadstat.read_sav(tmp_path / "participants.sav")
    assert about.variable_value_labels["demographics_gender"]["woman"] == "Woman"
    assert about.variable_measure["mind_meld_trust_t01"] == "ordinal"
