"""``steerlab export``: where exports go, what they may replace, and that an erasure reaches them."""

import io
import json
import shutil
import sys
import zipfile
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from steerlab.analysis.export.bundle import FORMATS, ExportConfig
from steerlab.app import export as export_run
from steerlab.app.cli import main
from steerlab.app.export import default_out, export
from steerlab.app.packed_export import packed
from steerlab.study.contract import Role
from steerlab.study.derived import ErasedMeanwhile, derived_files, left_of
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from tests.study.conftest import _run_scripted, make_small

CSV = ExportConfig(formats=("csv",))


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Three training participants who finished."""
    folder = make_small(tmp_path_factory.mktemp("export") / "study")
    with Study.open(folder) as study:
        for seed in (1, 2, 3):
            _run_scripted(study, Role.TRAINING, seed)
    return folder


@pytest.fixture
def folder(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "study"))


@pytest.fixture
def steerlab(capsys):
    def run(*arguments: object, code: int = 0) -> str:
        found = main([*map(str, arguments)])
        said = capsys.readouterr()
        assert found == code, said
        return said.out + said.err

    return run


def _silent(what: str, share: float) -> None:
    pass


def _export(folder, config=CSV, out=None, force=False):
    return export(folder, config, out, force=force, progress=_silent)


def _people(path):
    return pd.read_csv(path).participant.unique().tolist()


def _erase(folder, who="T002"):
    with Study.open(folder) as study:
        study.withdraw(who, erase=True)


def _verified(folder):
    with Study.open(folder, read_only=True) as study:
        return study.verify()


def test_several_formats_in_one_call(folder, steerlab):
    said = steerlab("export", folder, "--format", "parquet", "csv")
    out = folder / "exports" / "csv+parquet"
    assert "3 participants, of whom 3 count" in said
    assert str(out / "README.txt") in said
    assert {path.name for path in out.iterdir()} == {
        *("csv", "parquet", "README.txt", "codebook.csv", "summary.json"),
        *("load.R", "load.sps", "JASP.txt"),
    }
    readme = (out / "README.txt").read_text()
    summary = json.loads(steerlab("export", folder, "--format", "parquet", "csv", "--json"))
    for known in (summary["study"], summary["protocol_sha256"], summary["title"]):
        assert known in readme
    with Study.open(folder, read_only=True) as study:
        (frozen,) = study.analysis_plans()
    assert summary["protocol_sha256"] == frozen.protocol_sha256
    assert steerlab("study", "verify", folder)


def test_what_has_not_changed_is_not_made_again(folder, monkeypatch):
    first = _export(folder)
    place = folder / "exports" / "csv"

    def again(*_, **__):
        raise AssertionError("made again")

    with monkeypatch.context() as patch:
        patch.setattr(export_run, "write_export", again)
        assert _export(folder) == first
        (place / "csv" / "attempts.csv").write_text("changed")
        with pytest.raises(AssertionError):
            _export(folder)
    assert _export(folder) == first  # to the byte, as the hashes of all files say
    with Study.open(folder) as study:
        study.note("T001", "asked for a break")
    second = _export(folder)
    assert second["state"] != first["state"]
    changed = {name for name, digest in second["files"].items() if first["files"][name] != digest}
    assert changed == {"README.txt"}  # which says when; a note is nowhere else


def test_who_withdrew_is_absent_and_said(folder, steerlab, tmp_path):
    steerlab("study", "withdraw", folder, "T002", "--keep")
    said = steerlab("export", folder, "--format", *FORMATS)
    assert "2 participants" in said
    assert "Withdrew, and left their data in the study: 1." in said
    out = folder / "exports" / "+".join(FORMATS)
    for path in out.rglob("*.csv"):
        assert "T002" not in path.read_text(), path
    assert not left_of(folder / "exports", "T002")
    said = steerlab(
        *("export", folder, "--format", "csv", "--withdrawn", "--out", tmp_path / "all")
    )
    table = pd.read_csv(tmp_path / "all" / "csv" / "participants.csv").set_index("participant")
    assert table.loc["T002", "standing"] == "withdrawn, data kept"
    assert table.counted.tolist() == [1, 1, 1]  # as analyze has it


def test_an_erasure_removes_every_file_wherever_it_lies(folder):
    config = ExportConfig(formats=FORMATS)
    _export(folder, config)
    inside = folder / "exports" / "+".join(FORMATS)
    assert left_of(folder, "T002")
    elsewhere = folder / "for a talk" / "deep"
    elsewhere.mkdir(parents=True)
    shutil.copytree(inside, elsewhere / "whole")
    for kind in ("csv/labels.csv", "spss/labels.sav", "parquet/labels.parquet"):
        shutil.copy(inside / kind, elsewhere / f"one{Path(kind).suffix}")
    shutil.copy(inside / "csv" / "participants.csv", folder / "renamed.txt")
    _, content = packed(folder, default_out(folder, config))
    (elsewhere / "download.zip").write_bytes(content)
    own = folder / "own.zip"
    with zipfile.ZipFile(own, "w") as archive:  # somebody's own archive, with an export in it
        archive.write(inside / "summary.json", "x/summary.json")
    (folder / "own.csv").write_text("participant,score\nT002,1\n")
    names = {path.relative_to(folder).as_posix() for path in left_of(folder, "T002")}
    assert {
        *("for a talk/deep/one.csv", "for a talk/deep/one.sav", "for a talk/deep/one.parquet"),
        *("for a talk/deep/download.zip", "renamed.txt"),
        *("for a talk/deep/whole/spss/participants.sav",),
        *("for a talk/deep/whole/parquet/participants.parquet",),
    } <= names
    _erase(folder)
    assert not left_of(folder, "T002")
    assert not inside.exists()
    assert [path for path in elsewhere.rglob("*")] == []
    assert not (folder / "renamed.txt").exists()
    assert own.exists()
    assert (folder / "own.csv").exists()
    assert _verified(folder).ok


def test_verify_names_an_export_that_came_back_and_erasing_again_removes_it(folder, tmp_path):
    _export(folder, ExportConfig(formats=FORMATS), tmp_path / "out")
    _export(folder)
    _, content = packed(folder, default_out(folder, CSV))
    _erase(folder)
    assert _verified(folder).ok
    (folder / "again.zip").write_bytes(content)
    shutil.copy(tmp_path / "out" / "spss" / "participants.sav", folder / "again.sav")
    shutil.copytree(tmp_path / "out", folder / "again")
    verified = _verified(folder)
    assert not verified.ok
    (found,) = [one.found for one in verified.findings if "is not finished" in one.found]
    assert {"again.zip", "again.sav"} <= set(found.replace(",", "").split())
    _erase(folder)
    assert not left_of(folder, "T002")
    assert _verified(folder).ok


def test_an_export_made_after_an_erasure_is_kept_and_says_who_was_gone(folder, tmp_path):
    _erase(folder)
    summary = _export(folder, ExportConfig(formats=FORMATS))
    assert summary["erased_before"] == ["T002"]
    assert _people(folder / "exports" / "+".join(FORMATS) / "csv" / "participants.csv") == [
        *("T001", "T003")
    ]
    _, content = packed(folder, default_out(folder, ExportConfig(formats=FORMATS)))
    (folder / "packed.zip").write_bytes(content)
    assert not left_of(folder, "T002")
    assert _verified(folder).ok


def test_an_export_that_was_under_way_when_somebody_was_erased_keeps_nothing(folder, monkeypatch):
    real = export_run.write_export

    def meanwhile(*arguments, **more):
        made = real(*arguments, **more)
        _erase(folder)
        return made

    monkeypatch.setattr(export_run, "write_export", meanwhile)
    with pytest.raises(ErasedMeanwhile, match="T002 were erased while this ran"):
        _export(folder)
    assert not (folder / "exports" / "csv").exists()
    assert not left_of(folder, "T002")


def test_what_was_made_before_an_erasure_is_not_packed_after_it(folder, tmp_path):
    _export(folder)
    shutil.copytree(folder / "exports", tmp_path / "kept")
    _erase(folder)
    shutil.copytree(tmp_path / "kept", folder / "exports")
    with pytest.raises(export_run.OutputError, match="no export as the study is now"):
        packed(folder, default_out(folder, CSV))


def test_a_packed_export_is_the_same_to_the_byte(folder):
    summary = _export(folder)
    name, content = packed(folder, default_out(folder, CSV))
    assert packed(folder, default_out(folder, CSV)) == (name, content)
    assert name == f"{summary['study']}-csv"
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert {f"{name}/{file}" for file in summary["files"]} < set(archive.namelist())
        assert archive.testzip() is None


def test_another_place_is_not_replaced_unless_forced(folder, tmp_path, steerlab):
    out = tmp_path / "out"
    steerlab("export", folder, "--format", "csv", "--out", out)
    steerlab("export", folder, "--format", "csv", "--out", out)  # the same, so it stays
    said = steerlab("export", folder, "--format", "parquet", "--out", out, code=2)
    assert "is not empty; choose another folder, or add --force" in said
    steerlab("export", folder, "--format", "parquet", "--out", out, "--force")
    assert (out / "parquet").is_dir()
    assert not (out / "csv").exists()


def test_the_export_of_another_study_is_never_replaced(folder, made, tmp_path, steerlab):
    out = tmp_path / "out"
    other = tmp_path / "other"
    make_small(other)
    steerlab("study", "enrol", other, "--role", "training")
    steerlab("export", other, "--format", "csv", "--out", out)
    before = (out / "summary.json").read_bytes()
    for force in ((), ("--force",)):
        said = steerlab("export", folder, "--format", "csv", "--out", out, *force, code=2)
        assert "holds the export of another study" in said
        assert len(said.strip().splitlines()) == 1
    assert (out / "summary.json").read_bytes() == before
    copy = shutil.copytree(made, tmp_path / "a copy")  # of the same study
    steerlab("export", copy, "--format", "csv", "--out", tmp_path / "mine")
    steerlab("export", folder, "--format", "parquet", "--out", tmp_path / "mine", "--force")


def test_an_export_is_its_owners_alone(folder, tmp_path):
    _export(folder, out=tmp_path / "out")
    assert (tmp_path / "out").stat().st_mode & 0o077 == 0


def test_a_study_is_never_replaced(folder, tmp_path, steerlab):
    for out in (folder, folder.parent):
        said = steerlab("export", folder, "--format", "csv", "--out", out, "--force", code=2)
        assert "holds a study" in said
    assert (folder / "study.db").exists()


def test_what_cannot_be_exported_is_said_in_a_sentence(folder, tmp_path, steerlab, monkeypatch):
    assert "There is no study in" in steerlab("export", tmp_path, "--format", "csv", code=2)
    new_study(tmp_path / "new", "mind-meld")
    assert "Nobody is enrolled" in steerlab("export", tmp_path / "new", "--format", "csv", code=2)
    for who in ("T001", "T002", "T003"):
        steerlab("study", "withdraw", folder, who, "--keep")
    assert "Nobody is left" in steerlab("export", folder, "--format", "csv", code=2)
    monkeypatch.setitem(sys.modules, "pyreadstat", None)
    said = steerlab("export", folder, "--format", "spss", code=2)
    assert "SPSS files need pyreadstat, which is not installed; run pip install" in said


def test_all_but_spss_needs_no_extra(folder, monkeypatch):
    for name in ("pandas", "pyreadstat"):
        monkeypatch.setitem(sys.modules, name, None)
    summary = _export(folder, ExportConfig(formats=("csv", "parquet", "psych-ds")))
    assert summary["participants"] == 3


def test_a_network_that_is_gone_is_said_and_the_rest_is_exported(folder, steerlab):
    steerlab("study", "train", folder)
    steerlab("export", folder, "--format", "csv")
    table = folder / "exports" / "csv" / "csv" / "participants.csv"
    assert pd.read_csv(table).w_1.notna().all()
    for model in (folder / "models").glob("*.safetensors"):
        model.unlink()
    assert "The frozen network cannot be used" in steerlab("export", folder, "--format", "csv")
    assert "w_1" not in pd.read_csv(table).columns


def test_files_that_are_not_ours_are_nobodys(folder):
    (folder / "a.sav").write_bytes(b"$FL2@(#) SPSS DATA FILE" + b" " * 200 + b"T002")
    (folder / "b.zip").write_bytes(b"PK\x03\x04T002")
    (folder / "c.csv").write_text("steerlab,participant\nx,T002\n")
    table = pq.read_table(_parquet(folder))
    pq.write_table(table.replace_schema_metadata(None), folder / "d.parquet")
    pq.write_table(table.select(["participant"]), folder / "e.parquet")  # still says what it is
    shutil.rmtree(folder / "exports")
    assert left_of(folder, "T002") == [folder / "e.parquet"]
    assert not {"a.sav", "b.zip", "c.csv", "d.parquet"} & {
        path.name for path in derived_files(folder, ())
    }


def _parquet(folder):
    _export(folder, ExportConfig(formats=("parquet",)))
    return folder / "exports" / "parquet" / "parquet" / "attempts.parquet"
