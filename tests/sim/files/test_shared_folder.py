"""A folder in which somebody else is at work."""

import os
from errno import EACCES, EISDIR, ENOTEMPTY
from pathlib import Path
from threading import Event, Thread

import pytest

from steerlab.sim.files import shared_folder
from steerlab.sim.files.shared_folder import entries_of, everything_in, remove


def test_everything_is_found_a_folder_before_what_is_in_it_and_links_are_not_followed(tmp_path):
    (tmp_path / "b" / "deep").mkdir(parents=True)
    (tmp_path / "b" / "deep" / "x").touch()
    (tmp_path / "a").touch()
    (tmp_path / "c").symlink_to(tmp_path / "b")
    found = [str(path.relative_to(tmp_path)) for path in everything_in(tmp_path)]
    assert found == ["a", "b", "c", "b/deep", "b/deep/x"]
    assert list(everything_in(tmp_path / "none")) == entries_of(tmp_path / "none") == []


def test_a_folder_that_goes_while_it_is_looked_through_holds_nothing(tmp_path):
    (tmp_path / "a" / "deep").mkdir(parents=True)
    (tmp_path / "a" / "x").touch()
    found = []
    for path in everything_in(tmp_path):
        found.append(path.name)
        remove(tmp_path / "a")
    assert found == ["a"]


def test_what_others_remove_or_add_to_is_removed(tmp_path):
    """One program makes files in a folder while another removes it."""
    folder, stop = tmp_path / "folder", Event()

    def write():
        number = 0
        while not stop.is_set() and number < 2000:
            folder.mkdir(exist_ok=True)
            try:
                (folder / f"{number % 50}").touch()
            except FileNotFoundError:  # it is gone just now
                continue
            number += 1

    writer = Thread(target=write)
    writer.start()
    try:
        for _ in range(20):
            remove(folder)
    finally:
        stop.set()
        writer.join()
    remove(folder)
    assert not folder.exists()
    remove(folder)


def test_a_file_in_whose_place_a_folder_is_made_meanwhile_is_removed_all_the_same(
    tmp_path, monkeypatch
):
    path, real = tmp_path / "a", Path.unlink
    path.touch()

    def unlink(self, missing_ok=False):
        if self == path and self.is_file():
            real(self)
            self.mkdir()
            raise IsADirectoryError(EISDIR, "Is a directory")
        real(self, missing_ok)

    monkeypatch.setattr(Path, "unlink", unlink)
    remove(path)
    assert not path.exists()


def test_what_may_not_be_read_is_said(tmp_path, monkeypatch):
    def refuse(path):
        raise PermissionError(EACCES, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(PermissionError):
        list(everything_in(tmp_path))


@pytest.mark.parametrize(("number", "tries"), [(EACCES, 1), (ENOTEMPTY, shared_folder._TRIES)])
def test_what_cannot_be_removed_is_said(tmp_path, monkeypatch, number, tries):
    """At once, or when others have filled it again and again."""
    tried = []

    def refuse(path):
        tried.append(path)
        raise OSError(number, os.strerror(number), str(path))

    monkeypatch.setattr(shared_folder, "_PAUSE_S", 0.0)
    monkeypatch.setattr(shared_folder.shutil, "rmtree", refuse)
    with pytest.raises(OSError, match=os.strerror(number)):
        remove(tmp_path)
    assert len(tried) == tries
