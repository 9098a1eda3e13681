"""``steerlab analyze`` on a small scripted study, from enrolment to report, and on what is none."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from steerlab.analysis.study_data import study as study_data
from steerlab.analysis.study_data.networks import judge
from steerlab.analysis.study_data.records import ConditionValue, NotAStudy, Person, StudyData
from steerlab.analysis.study_data.study import read_study
from steerlab.analysis.study_tables.tables import KEYS
from steerlab.app.analyze import with_conditions
from steerlab.app.cli import main
from steerlab.learning.checkpoint import load_mapper
from steerlab.study import study_folder
from steerlab.study.contract import Role
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.store.teaching import TEACHING_SCHEMA
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from steerlab.study.surveys.answer_format import Likert

ROLLOUTS = '["calibration-05", "calibration-07", "calibration-11"]'  # the shortest
TRAINING, TEST = 4, 1


@pytest.fixture(scope="module")
def small_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analyze") / "study"
    new_study(folder, "mind-meld")
    path = folder / "study.toml"
    text = path.read_text()
    for before, after in (
        ("rollouts = 12 ", f"rollouts = {ROLLOUTS} "),
        ("minimum_people = 8 ", f"minimum_people = {TRAINING} "),
        ('preset = "lab"', 'preset = "lab"\nepochs = 2'),
    ):
        assert before in text
        text = text.replace(before, after, 1)
    path.write_text(text)
    with Study.open(folder) as study:
        for seed in range(TRAINING + TEST):
            who = study.enrol(Role.TRAINING if seed < TRAINING else Role.TEST).id
            script = ScriptedParticipant(kind="human", seed=seed)
            study.run(who, RunConfig(device=script.device, pages=script, recordings=False))
    return folder


@pytest.fixture
def study(small_study: Path, tmp_path: Path) -> Path:
    """A copy, with the networks that an earlier test trained."""
    return Path(shutil.copytree(small_study, tmp_path / "study"))


@pytest.fixture
def analyze(capsys) -> Callable[..., str]:
    def run(*arguments: object, code: int = 0) -> str:
        found = main(["analyze", *map(str, arguments), "--permutations", "199"])
        said = capsys.readouterr()
        assert found == code, said
        return said.out + said.err

    return run


def tables_of(out: Path) -> dict:
    return json.loads((out / "report" / "tables.json").read_text())


@pytest.mark.slow
def test_a_study_from_enrolment_to_report(small_study, analyze, tmp_path):
    out = tmp_path / "out"
    said = analyze(small_study, "--out", out)
    assert "H1 " in said
    assert "Deviates from the plan: H4 was planned and could not be tested" in said
    tables = tables_of(out)
    assert tuple(tables) == KEYS
    assert tables["exclusions"]["analysed"] == {"training": TRAINING, "test": TEST}
    assert len(tables["table1"]) == 2 * 11  # all scales, of both roles
    assert len(tables["style"]["rows"]) == TRAINING + TEST
    seen, new = (tables["label_quality"][split] for split in ("seen", "new"))
    assert (seen["people"], new["people"]) == (TRAINING, TEST)
    summary = json.loads((out / "report" / "summary.json").read_text())
    assert summary["simulated"] is True
    assert len(summary["plan_sha256"]) == 64
    page = (out / "report" / "index.html").read_text()
    assert summary["plan_sha256"] in page
    assert "say nothing about people" in page
    assert "corrected 3 recorded drives, everyone in the same order" in page
    assert f"{TRAINING + TEST} scripts steered without any device" in page
    assert "None of 15 attempts broke a limit of timing" in page
    h1 = tables["hypotheses"][0]
    assert h1["why"] == f"with {TRAINING} people the smallest p there can be is .125"
    assert page.count(h1["why"]) == 1
    assert {path.name for path in (out / "report").glob("*.csv")} >= {"table1.csv", "style.csv"}
    kept = list((small_study / "models").glob("analysis-*.safetensors"))
    assert len(kept) == 1
    again = tmp_path / "again"
    analyze(small_study, "--out", again)
    assert tables_of(again) == tables
    assert list((small_study / "models").glob("analysis-*.safetensors")) == kept


@pytest.mark.slow
def test_held_out_errors_are_of_rollouts_that_the_network_never_saw(study):
    data = read_study(study, networks=1, progress=lambda what, share: None)
    (path,) = (study / "models").glob("analysis-*.safetensors")
    held = [o for o in data.series if o.rollout == "calibration-11" and o.person.startswith("T")]
    by_hand = judge(load_mapper(path), held, seed=0, role="training")
    assert np.array_equal(data.held_out[0].after, by_hand.after)
    assert data.held_out[0].labels.sum() == sum(o.valid.sum() for o in held)
    frozen, own = data.embeddings
    assert frozen.source == "the frozen network"
    assert frozen.people == own.people == tuple(f"T{n + 1:03d}" for n in range(TRAINING))
    assert not np.allclose(frozen.w, own.w)


@pytest.mark.slow
def test_who_withdrew_and_what_was_done_again_is_said(study, analyze, capsys):
    main(["study", "withdraw", str(study), "T002", "--keep"])
    main(["study", "withdraw", str(study), "P001", "--erase"])
    with Study.open(study) as opened:
        who = opened.enrol(Role.TRAINING).id
        opened.consent(who, given=False)
        unfinished = opened.enrol(Role.TRAINING).id
    capsys.readouterr()
    analyze(study, "--seeds", 0)
    found = tables_of(study)
    reasons = {row["who"]: row["why"] for row in found["exclusions"]["rows"]}
    assert reasons["P001"] == "withdrew, and their data are erased"
    assert reasons[who] == "did not consent"
    assert reasons[unfinished] == "no finished attempt at 3 of 3 rollouts"
    assert "T002" not in reasons  # withdrew and left their data
    assert found["exclusions"]["analysed"] == {"training": TRAINING, "test": 0}
    assert "P001" not in json.dumps(found["style"])
    assert "empty" in found["label_quality"]["seen"]
    with Study.open(study) as opened:
        opened.redo("T001", "about-you")
    analyze(study, "--seeds", 0)
    people = {row["scale"]: row["people"] for row in tables_of(study)["table1"]}
    assert people["openness"] == TRAINING - 1  # a page that is open again has no scores yet


@pytest.mark.slow
def test_a_network_that_was_changed_costs_its_cells_alone(study, analyze):
    (model,) = [path for path in (study / "models").glob("mind_meld-*") if "P001" not in path.name]
    model.write_bytes(b"something else")
    with (study / "study.toml").open("a") as file:
        file.write("# an afterthought\n")
    analyze(study, "--seeds", 0)
    page = (study / "report" / "index.html").read_text()
    assert "was changed after it was frozen" in page
    assert "The frozen network cannot be used" in page
    tables = tables_of(study)
    assert tables["table2"]["why_empty"] == "there is no embedding: no network was trained"
    assert len(tables["style"]["rows"]) == TRAINING + TEST


@pytest.mark.slow
def test_answers_that_a_changed_questionnaire_does_not_allow_are_left_out(
    study, analyze, monkeypatch
):
    known = study_folder.study_questionnaires(study)
    narrow = tuple(
        replace(item, format=Likert(low=1, high=3, anchors=((1, "no"), (3, "yes"))))
        for item in known["mini_ipip_5"].items
    )
    changed = {**known, "mini_ipip_5": replace(known["mini_ipip_5"], items=narrow)}
    monkeypatch.setattr(study_folder, "study_questionnaires", lambda folder: changed)
    analyze(study, "--seeds", 0)
    page = (study / "report" / "index.html").read_text()
    assert "&#39;mini_ipip_5&#39; was changed after it was frozen" in page
    assert "An answer of T001 to mini_ipip_5 was left out" in page
    rows = {row["scale"]: row for row in tables_of(study)["table1"]}
    assert rows["extraversion"]["left_out"] > 0


@pytest.mark.slow
def test_before_the_network_is_frozen_one_is_trained(study, analyze, capsys):
    main(["study", "withdraw", str(study), "T004", "--erase"])  # three are too few to train anew
    capsys.readouterr()
    analyze(study)
    assert "No network is frozen" in (study / "report" / "index.html").read_text()
    (network,) = tables_of(study)["table2"]["networks"]
    assert network["source"].startswith("trained for the analysis")
    assert network["people"] == TRAINING - 1
    (kept,) = (study / "models").glob("*.safetensors")
    assert kept.name.startswith("analysis-")
    assert "T004" not in kept.read_bytes().decode("latin-1")


@pytest.mark.slow
def test_outcomes_of_conditions_join_a_study(study, analyze, tmp_path):
    table = tmp_path / "outcomes.csv"
    table.write_text(
        "participant,condition,round,success\n"
        + "".join(f"{who},{c},1,0.5\n" for who in ("P001", "X999") for c in ("bc", "dagger"))
    )
    analyze(study, "--seeds", 0, "--conditions", table, "--out", tmp_path / "out")
    found = tables_of(tmp_path / "out")
    assert found["conditions"]["metrics"]["success"]["means"]["bc"]["people"] == 1
    assert "at least 4 are needed" in json.dumps(found["conditions"])
    left = [row["who"] for row in found["exclusions"]["rows"]]
    assert left == ["X999"]


@pytest.mark.parametrize(
    ("who", "condition", "said"),
    [
        ("P001 ", "bc", "Participants 'P001' and 'P001 ' differ only by blanks"),
        ("p001", "bc", "Participants 'P001' and 'p001' differ only by blanks"),
        ("P002", "BC", "Conditions 'bc' and 'BC' differ only by blanks"),
    ],
)
def test_outcomes_of_somebody_who_only_looks_like_another_are_refused(who, condition, said):
    """They would be left out, or join as another condition."""

    def value(person: str, condition: str) -> ConditionValue:
        return ConditionValue(
            person=person, condition=condition, metric="success", value=1, round=0
        )

    data = StudyData(
        kind="study",
        title="",
        simulated=False,
        people=(Person(id="P001", role=Role.TEST), Person(id="P002", role=Role.TEST)),
        series=(),
        conditions=(value("P001", "bc"),),
    )
    assert len(with_conditions(data, [value("P002", "bc")]).conditions) == 2
    with pytest.raises(NotAStudy, match=said):
        with_conditions(data, [value(who, condition)])


@pytest.mark.slow
def test_rounds_that_were_taught_in_the_study_are_compared(study, analyze, monkeypatch):
    rows = [
        {
            "participant": who, "phase": "teach-1", "position": place, "condition": condition,
            "round": number, "success": None if number == 0 else 0.5, "final_distance_m": 9.0,
            "trials": 10, "label_mae": 0.25, "given_mae": 0.5, "labels_asked": 9,
            "teacher_s": 1.0, "switches": 0, "loss": None,
        }
        for who in ("P001", "nobody")
        for place, condition in enumerate(("bc", "mind_meld"), start=1)
        for number in (0, 1, 2)
    ]  # fmt: skip
    table = pa.Table.from_pylist(rows, schema=TEACHING_SCHEMA)
    monkeypatch.setattr(study_data, "read_teaching_rounds", lambda connection: table)
    analyze(study, "--seeds", 0)
    found = tables_of(study)["conditions"]["metrics"]
    assert set(found) == {"success", "final_distance_m", "label_mae"}
    curve = found["success"]["curves"]["bc"]
    assert [(one["round"], one["people"], one["mean"]) for one in curve] == [
        (1, 1, 0.5),
        (2, 1, 0.5),
    ]
    assert found["label_mae"]["means"]["mind_meld"]["mean"] == 0.25


@pytest.mark.slow
def test_a_plan_that_was_changed_is_said(study, analyze, capsys):
    path = study / "study.toml"
    text = path.read_text()
    assert "alpha = 0.05" in text
    path.write_text(text.replace("alpha = 0.05", "alpha = 0.01"))
    assert main(["study", "amend", str(study), "--why", "a stricter level"]) == 0
    capsys.readouterr()
    said = analyze(study, "--seeds", 0)
    assert "The analysis plan was changed with version 2 of the protocol" in said
    assert f"when {TRAINING + TEST} participants were enrolled: a stricter level" in said
    assert tables_of(study)["hypotheses"][0]["alpha"] == 0.01


@pytest.mark.slow
def test_a_study_before_its_first_participant(tmp_path, analyze):
    new_study(tmp_path / "study", "mind-meld")
    said = analyze(tmp_path / "study")
    assert "The analysis plan is not frozen" in said
    assert tables_of(tmp_path / "study")["exclusions"]["enrolled"] == 0


def test_what_is_no_study_is_refused(tmp_path, analyze):
    said = analyze(tmp_path, code=2)
    assert "is no study and no population run" in said
    assert "Traceback" not in said
    (tmp_path / "study.db").write_text("no database")
    assert "not a database" in analyze(tmp_path, code=2)
    (tmp_path / "study.db").unlink()
    (tmp_path / "labels").mkdir()
    for split in ("seen", "new"):
        (tmp_path / "labels" / f"{split}.parquet").write_text("no parquet")
    assert "summary.json cannot be read" in analyze(tmp_path, code=2)


def test_a_folder_of_somebody_elses_is_not_replaced(tmp_path, analyze):
    new_study(tmp_path / "study", "mind-meld")
    report = tmp_path / "out" / "report"
    report.mkdir(parents=True)
    (report / "thesis.tex").write_text("years of work")
    assert "is not empty" in analyze(tmp_path / "study", "--out", tmp_path / "out", code=2)
    assert (report / "thesis.tex").read_text() == "years of work"
    assert "seeds is -1" in analyze(tmp_path / "study", "--seeds", "-1", code=2)
