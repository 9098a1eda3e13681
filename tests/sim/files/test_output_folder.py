import os

import pytest

from steerlab.sim.files.output_folder import OutputError, output_folder


class Interrupted(Exception):
    pass


def _fail_after_writing(out, force=False):
    with output_folder(out, force=force) as folder:
        (folder / "a").write_text("1")
        raise Interrupted


def test_results_appear_whole(tmp_path):
    out = tmp_path / "deep" / "out"
    with output_folder(out) as folder:
        (folder / "a").write_text("1")
        assert not out.exists()
    assert (out / "a").read_text() == "1"
    assert os.listdir(out.parent) == ["out"]


def test_a_failure_leaves_nothing(tmp_path):
    with pytest.raises(Interrupted):
        _fail_after_writing(tmp_path / "out")
    assert os.listdir(tmp_path) == []


def test_a_full_folder_is_kept_unless_forced(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("precious")
    with pytest.raises(OutputError, match="--force"), output_folder(out):
        pass
    with pytest.raises(Interrupted):
        _fail_after_writing(out, force=True)
    assert (out / "old").read_text() == "precious"
    with output_folder(out, force=True) as folder:
        (folder / "new").write_text("1")
    assert os.listdir(out) == ["new"]
    assert os.listdir(tmp_path) == ["out"]


def test_an_empty_folder_is_used(tmp_path):
    with output_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
    (tmp_path / "out" / "a").unlink()
    with output_folder(tmp_path / "out") as folder:
        (folder / "b").write_text("1")
    assert os.listdir(tmp_path / "out") == ["b"]


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"), output_folder(tmp_path / "file"):
        pass
    with pytest.raises(OutputError, match="Cannot write"), output_folder(tmp_path / "file" / "out"):
        pass


def test_a_full_disk_is_said_and_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match="No space left"), output_folder(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert os.listdir(tmp_path) == []


def test_folders_of_a_layered_file_system_are_replaced_too(tmp_path, monkeypatch):
    """There a folder of a lower layer cannot be renamed, as in many containers."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("1")
    rename = os.rename

    def refuse(source, target, **rest):
        if os.fspath(source) == os.fspath(out):
            raise OSError(18, "Invalid cross-device link")
        rename(source, target, **rest)

    monkeypatch.setattr(os, "rename", refuse)
    with output_folder(out, force=True) as folder:
        (folder / "new").write_text("1")
    assert os.listdir(out) == ["new"]
    assert os.listdir(tmp_path) == ["out"]
