"""A place that cannot be written is said before the work, not after it."""

import pytest

from steerlab.app import analyze, fit, power, simulate, synthetic, teach
from steerlab.app.cli import main
from steerlab.learning.mapper import MindMeldMapper
from steerlab.sim import calibration_generator
from steerlab.study import models
from steerlab.study.recording import replay
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from tests.faults.kills import TABLE


def _worked(*_, **__):
    raise AssertionError("worked before it looked whether the results can be kept")


VERBS = {
    "simulate": (simulate, "run_population", "--out OUT"),
    "demo": (simulate, "run_population", "--out OUT"),
    "fit": (fit, "cross_validate", f"{TABLE} --out OUT"),
    "synthetic": (synthetic, "run_synthetic", "--out OUT"),
    "teach": (teach, "prepare", "--out OUT"),
    "power": (power, "run_block", "--out OUT"),
    "analyze": (analyze, "_read", "STUDY --out OUT"),
    "calibration-set": (calibration_generator, "generate_calibration_set", "--force --out OUT"),
    "replay": (replay, "rebuild_recording", "STUDY --save OUT"),
}


@pytest.fixture
def refused(tmp_path, monkeypatch, capsys):
    def run(verb, out):
        module, work, arguments = VERBS[verb]
        monkeypatch.setattr(module, work, _worked)
        if not (study := tmp_path / "study").exists():
            new_study(study, "mind-meld")
        words = arguments.replace("OUT", str(out)).replace("STUDY", str(study)).split()
        assert main([verb, *words]) == 2
        return capsys.readouterr().err

    return run


@pytest.mark.parametrize("verb", VERBS)
def test_nothing_is_computed_that_cannot_be_kept(verb, refused, tmp_path):
    (tmp_path / "file").write_text("")
    assert "Cannot write" in refused(verb, tmp_path / "file" / "out")


@pytest.mark.parametrize("verb", ["calibration-set", "replay"])
def test_a_folder_in_place_of_a_file_is_refused(verb, refused, tmp_path):
    (tmp_path / "out").mkdir()
    assert "is a folder; give the name of a file" in refused(verb, tmp_path / "out")


def test_a_screenshot_has_a_place_before_it_is_drawn(refused, tmp_path, monkeypatch, capsys):
    (tmp_path / "shot.png").mkdir()
    monkeypatch.setattr(replay, "rebuild_recording", _worked)
    assert main(["replay", str(tmp_path), "--screenshot", str(tmp_path / "shot.png")]) == 2
    assert "is a folder" in capsys.readouterr().err


def test_a_study_that_cannot_be_written_is_told_before_it_is_analysed(
    tmp_path, monkeypatch, capsys
):
    from steerlab.sim.files import whole_file

    new_study(tmp_path / "study", "mind-meld")
    monkeypatch.setattr(analyze, "_read", _worked)

    def read_only(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(whole_file.tempfile, "mkdtemp", read_only)
    assert main(["analyze", str(tmp_path / "study")]) == 2
    said = capsys.readouterr().err
    assert (
        f"Cannot write to {tmp_path / 'study'}: Read-only file system; choose another folder"
        in said
    )


def test_an_analysis_makes_no_folder_for_a_study_that_is_none(tmp_path, capsys):
    assert main(["analyze", str(tmp_path / "misspelt")]) == 2
    assert "is no study and no population run" in capsys.readouterr().err
    assert not (tmp_path / "misspelt").exists()


def test_a_network_that_cannot_be_kept_is_not_trained(tmp_path, monkeypatch):
    new_study(tmp_path / "study", "mind-meld")
    monkeypatch.setattr(models, "check_people", lambda study: [])
    monkeypatch.setattr(MindMeldMapper, "fit", _worked)
    with Study.open(tmp_path / "study") as study:
        (study.folder / "models").write_text("a file in the way")
        with pytest.raises(OSError, match="models"):
            study.train(lambda what, share: None)
