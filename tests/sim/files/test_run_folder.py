import json
import os
from contextlib import suppress
from pathlib import Path

import pytest

from steerlab.sim.files.folder_lock import LockedOut
from steerlab.sim.files.output_folder import OutputError
from steerlab.sim.files.run_folder import SUMMARY, results, run_folder, write_json


@pytest.mark.parametrize("figure", [float("nan"), float("inf")])
def test_a_run_whose_figures_are_not_finite_is_no_success(tmp_path, figure):
    path = tmp_path / "summary.json"
    write_json({"success": 0.5}, path)
    with pytest.raises(OutputError, match=r"summary\.json would hold a figure that is NaN"):
        write_json({"by_round": [{"success": figure}]}, path)
    assert json.loads(path.read_text(encoding="utf-8")) == {"success": 0.5}


class Killed(BaseException):
    pass


def _call(out: Path, text: str) -> None:
    with results(out) as fresh:
        (fresh / "report").mkdir()
        for name in (SUMMARY, "a.csv", "report/index.html"):
            (fresh / name).write_text(text)


def _found(out: Path) -> dict[str, str]:
    return {str(p.relative_to(out)): p.read_text() for p in out.rglob("*") if p.is_file()}


def _whole(text: str) -> dict[str, str]:
    return {SUMMARY: text, "a.csv": text, "report/index.html": text}


def test_results_of_two_calls_never_stand_together(tmp_path, monkeypatch):
    """Killed before any of its acts: all old, all new, or no summary that would say otherwise."""
    _call(tmp_path, "old")
    replace, unlink, seen = Path.replace, Path.unlink, []
    for last in range(6):
        acts = iter(range(6))

        def act(real, path, *rest, acts=acts, last=last, **options):
            if next(acts) == last:
                raise Killed
            return real(path, *rest, **options)

        with monkeypatch.context() as patch, suppress(Killed):
            patch.setattr(Path, "replace", lambda *args, act=act: act(replace, *args))
            patch.setattr(Path, "unlink", lambda *args, act=act, **k: act(unlink, *args, **k))
            _call(tmp_path, "new")
        found = _found(tmp_path)
        assert found in (_whole("old"), _whole("new")) or SUMMARY not in found
        seen.append(SUMMARY in found)
        _call(tmp_path, "old")
        assert _found(tmp_path) == _whole("old")
    assert seen == [True, False, False, False, True, True]


def _call_on_a_full_disk(out: Path) -> None:
    with results(out) as fresh:
        (fresh / "a.csv").write_text("new")
        raise OSError(28, "No space left on device")


def test_a_disk_that_is_full_leaves_the_results_of_the_call_before(tmp_path):
    _call(tmp_path, "old")
    with pytest.raises(OutputError, match="No space left"):
        _call_on_a_full_disk(tmp_path)
    assert _found(tmp_path) == _whole("old")


def _run(out, seed, *, force=False):
    return run_folder(out, {"seed": seed}, file="run.json", parts=("parts",), force=force)


def test_two_programs_never_run_in_one_folder(tmp_path):
    """The second would begin the first's folder anew, or keep its parts under other settings."""
    out = tmp_path / "out"
    with _run(out, 0):
        (out / "parts" / "0.json").touch()
        for again in (_run(out, 0), _run(out, 1, force=True)):
            with pytest.raises(LockedOut, match=rf"works in .*out already: process {os.getpid()}"):
                again.__enter__()
        assert (out / "parts" / "0.json").exists()
    with _run(out, 1, force=True):
        assert list((out / "parts").iterdir()) == []


def test_a_folder_of_something_else_is_refused_and_gets_no_lock(tmp_path):
    (tmp_path / "letter").touch()
    with pytest.raises(OutputError, match=r"no readable run\.json"), _run(tmp_path, 0):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["letter"]
