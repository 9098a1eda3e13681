"""A complete study with scripted participants, by the command line alone."""

import json

import numpy as np
import pytest

from steerlab.app.cli import main
from steerlab.study.contract import Role, StudyError
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.connection import connect
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.store.records import Flag
from steerlab.study.store.schema import STORE_VERSION
from steerlab.study.store.teaching import read_teaching_rounds
from steerlab.study.study import Study


def steerlab(capsys, *arguments: object, code: int = 0) -> str:
    found = main(["study", *map(str, arguments)])
    said = capsys.readouterr()
    assert found == code, said
    return said.out + said.err


def _flagged_everywhere(folder, monkeypatch, who):
    """How many attempts ``verify`` would name if the computer had never kept time."""
    flags = [Flag(name="overrun_share", value=0.2, bound=0.001)]
    with monkeypatch.context() as patch, Study.open(folder, read_only=True) as study:
        patch.setattr(study._opened.store, "flags", lambda attempt: flags)
        (found,) = [one.found for one in study.verify().findings if one.what == who and not one.ok]
    return found.count("steps took too long")


def _analysed(folder, capsys):
    """``steerlab analyze`` reads the rounds that were taught, and erasing takes its report."""
    assert main(["analyze", str(folder), "--seeds", "0", "--permutations", "99"]) == 0
    capsys.readouterr()
    tables = json.loads((folder / "report" / "tables.json").read_text())
    found = tables["conditions"]["metrics"]["final_distance_m"]
    assert set(found["conditions"]) == {"mind_meld", "dagger", "bc"}
    assert found["people"] == 2
    with Study.open(folder, read_only=True) as study:
        taught = read_teaching_rounds(study._opened.store.connection).to_pylist()
    last = max(row["round"] for row in taught)
    for name, one in found["means"].items():
        own = [
            row["final_distance_m"]
            for row in taught
            if row["condition"] == name and row["round"] == last
        ]
        assert one["mean"] == pytest.approx(np.mean(own), rel=1e-5)


@pytest.mark.slow
def test_four_training_and_two_test_participants(folder, capsys, change, monkeypatch):
    change(folder, ("minimum_people = 2 ", "minimum_people = 4 "))
    for seed in range(4):
        said = steerlab(
            capsys, "run", folder, "--teacher", f"scripted:human:{seed}", "--no-recordings"
        )
        assert f"T00{seed + 1} has nothing left to do." in said
    for seed in (7, 8):
        said = steerlab(
            *(capsys, "run", folder, "--teacher", f"scripted:human:{seed}", "--role", "test"),
            "--no-recordings",
        )
        assert said.count("2 of 2 drives taught") == 3
        assert "w from network" in said
    status = json.loads(steerlab(capsys, "status", folder, "--json"))
    assert [one["id"] for one in status] == ["T001", "T002", "T003", "T004", "P001", "P002"]
    assert {one["standing"] for one in status} == {"finished"}
    assert status[4]["order"] != status[5]["order"]
    assert status[4]["phases"]["teach-1"] == "done"
    verified = json.loads(steerlab(capsys, "verify", folder, "--json"))
    assert all(one["ok"] for one in verified["findings"])
    assert _flagged_everywhere(folder, monkeypatch, "P001") == 2 + 3 * 2  # corrected, taught
    with Study.open(folder, read_only=True) as study:
        found = read_embeddings(study._opened.store.connection)
        assert set(found) == {"P001", "P002"}
        assert all(
            np.isfinite(one.w).all() and np.isfinite(one.covariance).all() for one in found.values()
        )
        labels = study._opened.store.read_labels()
        assert len(set(labels.column("participant").to_pylist())) == 6
    _analysed(folder, capsys)
    steerlab(capsys, "withdraw", folder, "P002", "--erase")
    assert not (folder / "report").exists()
    steerlab(capsys, "withdraw", folder, "T004", "--keep")
    said = steerlab(capsys, "verify", folder, "--expect-head", verified["head"])
    assert "BAD" not in said


def test_the_verbs_of_a_study(tmp_path, capsys, change):
    folder = tmp_path / "s"
    assert "Made" in steerlab(capsys, "new", folder)
    assert "exists already" in steerlab(capsys, "new", folder, code=2)
    assert "Nobody is enrolled" in steerlab(capsys, "status", folder)
    said = steerlab(capsys, "enrol", folder, "--role", "test", code=2)
    assert "8 training participants must have finished" in said
    change(folder, ("network_first = true ", "network_first = false "))
    assert "T001, training" in steerlab(capsys, "enrol", folder, "--role", "training")
    enrolled = json.loads(steerlab(capsys, "enrol", folder, "--role", "test", "--json"))
    assert enrolled["next"] == "consent"
    assert len(enrolled["order"]) == 3
    said = steerlab(capsys, "run", folder, "--participant", "T001")
    assert "T001 is at consent" in said
    assert "T001 is at consent" in steerlab(capsys, "resume", folder, "T001")
    assert "is not over yet" in steerlab(capsys, "redo", folder, "T001", "about-you", code=2)
    assert "finished; the protocol asks for" in steerlab(capsys, "train", folder, code=2)
    steerlab(capsys, "note", folder, "--text", "moved the table")
    assert "note T001: not finished yet" in steerlab(capsys, "verify", folder)
    assert "as version 1 has it" in steerlab(capsys, "amend", folder, "--why", "x", code=2)
    assert "either --keep or --erase" in steerlab(capsys, "withdraw", folder, "T001", code=2)
    assert "their data are erased" in steerlab(capsys, "withdraw", folder, "T001", "--erase")
    assert "Who runs?" in steerlab(capsys, "run", folder, code=2)
    said = steerlab(capsys, "run", folder, "--participant", "P001", "--plant", "a.b:gain:1", code=2)
    assert "give --teacher as well" in said
    assert "There is no study in" in steerlab(capsys, "status", tmp_path, code=2)


def test_what_cannot_be_used_is_told_in_a_sentence_by_every_verb(folder, capsys, change):
    change(folder, ('key = "bc"', 'key = "bcc"'))
    said = steerlab(capsys, "enrol", folder, "--role", "test", code=2)
    assert "study.toml, line 23: $.conditions[1].key is 'bcc'; it must be one of" in said
    change(folder, ('key = "bcc"', 'key = "bc"'))
    steerlab(capsys, "enrol", folder, "--role", "test")
    other = connect(folder / "study.db", read_only=False)
    other.execute("UPDATE meta SET value = ? WHERE key = 'schema_version'", (STORE_VERSION + 1,))
    other.close()
    for act in (
        ["status"],
        ["verify"],
        ["enrol", "--role", "test"],
        ["run", "--participant", "P001"],
    ):
        assert "was made by another version of steerlab" in steerlab(
            capsys, act[0], folder, *act[1:], code=2
        )
    assert main(["console", str(folder), "--port", "0"]) == 2
    said = capsys.readouterr()
    assert "was made by another version of steerlab" in said.err
    assert "Traceback" not in said.out + said.err
    assert not (folder / "console.lock").exists()


@pytest.mark.parametrize(
    ("spec", "plants", "said"),
    [
        ("scripted:human", [], "scripted:KIND:SEED"),
        ("scripted:robot:3", [], "a KIND of paper, low, human, high"),
        ("scripted:human:-3", [], "give a number from 0"),
        ("scripted:human:3", ["mini_ipip_5.extraversion"], "QUESTIONNAIRE.SCALE:STYLE:R"),
        ("scripted:human:3", ["mini_ipip_5.extraversion:gain:much"], "QUESTIONNAIRE.SCALE"),
    ],
)
def test_a_script_that_is_none_is_refused(spec, plants, said):
    with pytest.raises(StudyError, match=said):
        ScriptedParticipant.parse(spec, plants)


def test_a_planted_effect_shows_in_the_answers(study, folder, change):
    """Over scripted people, over-correctors score higher on a scale tied to the gain."""
    from scipy.stats import spearmanr

    from steerlab.study.progress import progress_of
    from steerlab.study.surveys.scoring import score

    gains, scores = [], []
    asked = study.questionnaire("fluency")
    for seed in range(24):
        script = ScriptedParticipant.parse(f"scripted:human:{seed}", ["fluency.fluency:gain:0.9"])
        who = study.enrol(Role.TRAINING).id
        for _ in range(2):
            place = progress_of(study._opened, who)
            script.fill(study._opened, place, place.view.next_phase)
        gains.append(script.teacher.style.gain)
        given = study.answers(who, "about-you", "fluency")
        scores.append(float(score(asked, given)["fluency"].score))
    assert spearmanr(gains, scores).statistic > 0.5
