"""The tables equal what is worked out by hand from the database, read past the program."""

import json
import shutil
from datetime import datetime
from statistics import mean

import numpy as np
import pytest

from steerlab.analysis.export.tables import PARTICIPANTS
from steerlab.analysis.export.wide import participants_table
from steerlab.analysis.study_data.asked import Missing
from steerlab.analysis.study_data.study import read_study
from steerlab.analysis.study_data.whole_study import read_whole_study
from steerlab.analysis.style.person_style import people_styles
from steerlab.study.study import Study
from steerlab.study.study_folder import OpenStudy

pytestmark = pytest.mark.slow  # the study takes half a minute

EVERYBODY = ["T001", "T002", "P001", "T003", "T004", "P002"]


@pytest.fixture
def wide(exported):
    return exported[1][PARTICIPANTS]


@pytest.fixture
def rows(wide):
    return {row["participant"]: row for row in wide.data.to_pylist()}


def _raw(query, who, questionnaire, phase):
    """The last answer to each item."""
    found = query(
        "SELECT item, value FROM responses WHERE participant = ? AND questionnaire = ? "
        "AND phase = ? ORDER BY id",
        *(who, questionnaire, phase),
    )
    return {item: json.loads(value) for item, value in found}


def test_one_row_a_person_with_who_they_are(rows, whole, query):
    assert list(rows) == EVERYBODY
    assert {row["steerlab_study"] for row in rows.values()} == {whole.id}
    assert [rows[who]["role"] for who in EVERYBODY] == [
        *("training", "training", "test", "training", "training", "test")
    ]
    assert [rows[who]["scripted"] for who in EVERYBODY] == [1, 1, 1, None, None, None]
    (order,) = query("SELECT condition_order FROM enrolments WHERE participant = 'P001'")[0]
    assert rows["P001"]["condition_order"] == " > ".join(json.loads(order))
    assert rows["T001"]["condition_order"] is None
    (at,) = query("SELECT at_utc FROM enrolments WHERE participant = 'T002'")[0]
    assert rows["T002"]["enrolled_utc"] == at
    assert datetime.fromisoformat(at).utcoffset().total_seconds() == 0


def test_who_counts_is_who_analyze_counts_and_the_others_have_its_reasons(rows, folder):
    analysed = read_study(folder, networks=0, progress=lambda what, share: None)
    counted = {person.id for person in analysed.people}
    why = {one.who: one.why for one in analysed.exclusions if one.what == "person"}
    assert counted == {"T001", "T002", "P001"}
    assert {who for who, row in rows.items() if row["counted"]} == counted
    assert {who: row["exclusion"] for who, row in rows.items() if row["exclusion"]} == why
    assert why["T004"] == "did not consent"


def test_answers_and_scores_are_those_of_the_raw_answers(rows, query):
    fluency = _raw(query, "T003", "fluency", "about-you")
    assert fluency == {"f1": 2, "f2": 7, "f3": 1}
    assert [rows["T003"][f"fluency_{item}"] for item in fluency] == [2, 7, 1]
    for who in ("T001", "T002", "P001", "T003"):
        raw = _raw(query, who, "fluency", "about-you")
        assert rows[who]["fluency_f3"] == raw["f3"]  # as it was given
        assert rows[who]["fluency_fluency_score"] == raw["f1"] + raw["f2"] + (8 - raw["f3"])
        assert (
            rows[who]["demographics_gender"]
            == _raw(query, who, "demographics", "about-you")["gender"]
        )
    order = rows["P001"]["condition_order"].split(" > ")
    for position, condition in enumerate(order, start=1):
        trust = _raw(query, "P001", "trust", f"after-teach-{position}")
        distrust, trusting = (
            [trust[f"t{item:02}"] for item in items] for items in (range(1, 6), range(6, 13))
        )
        score = {
            name: rows["P001"][f"{condition}_trust_{name}_score"]
            for name in ("total", "trust", "distrust")
        }
        assert score["distrust"] == sum(distrust)
        assert score["trust"] == sum(trusting)
        assert score["total"] == sum(8 - answer for answer in distrust) + sum(trusting)
        tlx = _raw(query, "P001", "raw_tlx", f"after-teach-{position}")
        assert rows["P001"][f"{condition}_raw_tlx_workload_score"] == pytest.approx(
            mean(tlx.values())
        )
        assert rows["P001"][f"{condition}_position"] == position


def test_why_an_answer_is_missing(wide):
    people = wide.data["participant"].to_pylist()

    def why(who, column):
        return wide.why[column][people.index(who)]

    assert wide.data["demographics_age"][people.index("T003")].as_py() is None
    assert why("T003", "demographics_age") is Missing.NOT_ANSWERED
    assert why("T001", "mind_meld_trust_t01") is Missing.NOT_SHOWN  # training participants
    assert why("P002", "mind_meld_trust_t01") is Missing.NOT_REACHED
    assert why("P002", "fluency_f1") is Missing.NOT_REACHED
    assert why("T004", "fluency_f1") is Missing.NOT_SHOWN
    assert why("T001", "fluency_f1") is None


def test_a_page_that_is_open_again_has_no_answers(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "study")
    with Study.open(copy) as study:
        study.redo("T001", "about-you")
    opened = OpenStudy.open(copy, read_only=True)
    whole = read_whole_study(opened, with_withdrawn=False)
    opened.store.close()
    table = participants_table(whole, free_text=False)
    assert table.data["fluency_f1"][0].as_py() is None
    assert table.data["fluency_fluency_score"][0].as_py() is None
    assert table.why["fluency_f1"][0] is Missing.NOT_REACHED


def test_label_quality_is_the_mean_over_the_steps(rows, query):
    for who in ("T001", "P001"):
        steps = query(
            "SELECT teacher_label, oracle_label FROM steps WHERE participant = ? AND label_valid "
            "AND rollout LIKE 'calibration-%' AND teacher_label NOT NULL AND oracle_label NOT NULL",
            who,
        )
        assert rows[who]["labels"] == len(steps)
        assert rows[who]["label_mae"] == pytest.approx(np.mean([abs(a - o) for a, o in steps]))
    assert rows["T003"]["label_mae"] is None
    assert rows["T003"]["rollouts_finished"] == 0


def test_style_is_what_analyze_tests(rows, folder):
    analysed = read_study(folder, networks=0, progress=lambda what, share: None)
    for style in people_styles(analysed.series):
        for name in ("amplitude", "amplitude_total", "wrong_direction", "lag_s", "voted_lag_s"):
            assert rows[style.person][f"style_{name}"] == pytest.approx(getattr(style, name))


def test_w_is_that_of_the_frozen_network(rows, folder, query):
    analysed = read_study(folder, networks=0, progress=lambda what, share: None)
    (frozen,) = analysed.embeddings
    for who, w in zip(frozen.people, frozen.w.tolist(), strict=True):
        assert [rows[who][f"w_{index + 1}"] for index in range(len(w))] == w
    (kept,) = query("SELECT w FROM embeddings WHERE participant = 'P001'")[0]
    kept = json.loads(kept)
    assert [rows["P001"][f"w_{index + 1}"] for index in range(len(kept))] == kept
    assert rows["P001"]["w_source"] == "found with the network frozen"
    assert rows["T003"]["w_1"] is None


def test_outcomes_of_a_condition_are_those_of_its_last_drives(rows, query):
    for condition in ("mind_meld", "bc", "dagger"):
        taught = query(
            "SELECT phase, round, labels_asked, teacher_s, label_mae FROM teaching_rounds "
            "WHERE participant = 'P001' AND condition = ? ORDER BY round",
            condition,
        )
        phase, last = taught[-1][:2]
        drives = query(
            "SELECT outcome, final_distance_m FROM teaching_trials WHERE participant = 'P001' "
            "AND phase = ? AND round = ?",
            *(phase, last),
        )
        found = {
            name.removeprefix(f"{condition}_"): value
            for name, value in rows["P001"].items()
            if name.startswith(f"{condition}_")
        }
        outcomes = [outcome for outcome, _ in drives]
        assert found["drives"] == len(drives) == 3
        assert found["rounds"] == last == 1
        assert found["success"] == outcomes.count("ball_reached") / 3
        assert found["block_hit_share"] == outcomes.count("block_hit") / 3
        assert found["out_of_bounds_share"] == outcomes.count("out_of_bounds") / 3
        assert found["time_limit_share"] == outcomes.count("time_limit") / 3
        assert found["final_distance_m"] == pytest.approx(mean(metres for _, metres in drives))
        assert found["labels_asked"] == sum(row[2] for row in taught)
        assert found["teacher_s"] == pytest.approx(sum(row[3] for row in taught))
        known = [row[4] for row in taught if row[1] > 0 and row[4] is not None]
        assert found["label_mae"] == (pytest.approx(mean(known)) if known else None)
    assert rows["T001"]["mind_meld_success"] is None


def test_durations_are_from_the_first_answer_or_drive_to_the_end(rows, query):
    for phase in ("about-you", "calibration", "teach-1", "after-teach-2"):
        acts = query(
            "SELECT act, at_utc FROM phase_events WHERE participant = 'P001' AND phase = ?", phase
        )
        times = {act: datetime.fromisoformat(at) for act, at in acts}
        took = (times["done"] - times["started"]).total_seconds()
        assert rows["P001"][f"duration_{phase.replace('-', '_')}_s"] == pytest.approx(took)
    assert rows["T001"]["duration_teach_1_s"] is None


def test_practice_is_what_was_kept_of_it(rows, query):
    for who in ("T001", "P001"):
        kept = query(
            "SELECT detail FROM phase_events WHERE participant = ? AND phase = 'practice' "
            "AND act = 'done'",
            who,
        )
        sitting = json.loads(kept[-1][0])
        assert {name: rows[who][f"practice_{name}"] for name in sitting} == sitting
    assert rows["T003"]["practice_balls"] is None


def test_long_tables_have_every_record(exported, query):
    tables = {name: table.data.to_pylist() for name, table in exported[1].items()}
    (steps,) = query(
        "SELECT count(*) FROM steps JOIN attempts USING (participant, rollout, attempt) "
        "WHERE status = 'finished'"
    )[0]
    assert len(tables["labels"]) == steps
    for name, source in (
        ("attempts", "attempts"),
        ("sessions", "sessions"),
        ("rounds", "teaching_rounds"),
        ("drives", "teaching_trials"),
    ):
        (count,) = query(f"SELECT count(*) FROM {source}")[0]
        assert len(tables[name]) == count, name
    assert "timing" not in tables  # scripts have no clock
    given = [row for row in tables["answers"] if row["state"] == "answered"]
    assert all((row["value"] is None) != (row["words"] is None) for row in given)
    assert not any(
        row["value"] is not None or row["words"] is not None
        for row in tables["answers"]
        if row["state"] != "answered"
    )
    (count,) = query("SELECT count(*) FROM responses WHERE item <> 'gender_own_words'")[0]
    assert len(given) == count  # nobody changed an answer
    for name, table in exported[1].items():
        keys = list(zip(*(table.data[column].to_pylist() for column in table.key), strict=True))
        assert len(set(keys)) == len(keys), name


def test_the_codebook_has_every_column(exported):
    import pandas as pd

    out, tables = exported
    book = pd.read_csv(out / "codebook.csv")
    assert list(zip(book.table, book.name, strict=True)) == [
        (table.name, variable.name) for table in tables.values() for variable in table.variables
    ]
    assert book.label.notna().all()
    by_name = book[book.table == PARTICIPANTS].set_index("name")
    trust = by_name.loc["mind_meld_trust_t01"]
    assert trust.label == "The system is deceptive. (mind_meld)"
    assert (trust.low, trust.high, trust.measure) == (1, 7, "ordinal")
    assert trust["values"] == "1 = Not at all; 7 = Extremely"
    assert trust.reversed_in == "total"
    assert (trust.questionnaire, trust.version, trust.condition) == ("trust", 1, "mind_meld")
    assert "Jian" in trust.citation
    assert by_name.loc["demographics_age"].unit == "years"
    assert by_name.loc["duration_calibration_s"].unit == "s"
    assert by_name.loc["demographics_gender"].spss_codes.startswith("1 = woman; 2 = man")
