"""``steerlab fit`` end to end: what it writes, what it refuses, and that it can be trusted."""

import csv
import json
import logging
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from steerlab.analysis.summary import Summary
from steerlab.app import fit as fit_module
from steerlab.app.cli import main
from steerlab.app.fit import FitConfig
from steerlab.learning import baselines, certainty, training_budget
from steerlab.learning.baselines import BASELINES, CEILING, FULL_ONLY
from steerlab.learning.checkpoint import load_mapper
from steerlab.learning.cross_validation import cross_validate
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, label_table
from steerlab.learning.presets import MapperConfig
from steerlab.learning.training import TrainingConfig
from steerlab.learning.training_budget import fit_within_budget
from steerlab.learning.windows import WindowConfig
from steerlab.sim.errors import InvalidConfig

EXAMPLE = Path(__file__).parents[2] / "docs" / "example-labels.csv"
QUICK = MapperConfig(
    window=WindowConfig(half_width_s=0.5), training=TrainingConfig(epochs=20, share_per_epoch=0.5)
)
# Training rounds differently on other processors.
GOLDEN_TOLERANCE = 0.05


def _silent(what: str, share: float) -> None:
    pass


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(fit_module, "preset", lambda name: QUICK)
    monkeypatch.setattr(training_budget, "LEAST_TRAINING_STEPS", 20)


def _write(path: Path, rows: list[dict[str, object]]) -> Path:
    with path.open("w", newline="") as sink:
        writer = csv.DictWriter(sink, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return path


def _rows(people: int = 4, rollouts: int = 4, steps: int = 20) -> list[dict[str, object]]:
    rng = np.random.default_rng(5)
    truth = rng.uniform(-1.0, 1.0, (rollouts, steps))
    return [
        {
            "person": f"p{p}",
            "rollout": f"r{r}",
            "step": s,
            "label": (0.5 + 0.4 * p) * truth[r, s] + 0.05,
            "truth": truth[r, s],
        }
        for p in range(people)
        for r in range(rollouts)
        for s in range(steps)
    ]


def _fit(labels: Path, out: Path, *options: str, ladder: str = "quick") -> int:
    return main(["fit", str(labels), "--out", str(out), "--ladder", ladder, *options])


def test_everything_promised_is_there(quick, tmp_path, capsys):
    labels = _write(tmp_path / "labels.csv", _rows())
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    assert "4 teachers it had never seen" in capsys.readouterr().out
    out = tmp_path / "out"
    found = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert found == {
        "mapped.parquet",
        "models/mind_meld.safetensors",
        "report/index.html",
        "summary.json",
    }
    summary = Summary.from_json((out / "summary.json").read_text())
    assert summary.verb == "fit"
    mapped = pq.read_table(out / "mapped.parquet")
    assert mapped.column_names == [
        "person",
        "rollout",
        "step",
        "label",
        "truth",
        "mapped",
        "scored_as",
        "fold",
    ]
    rows = mapped.to_pylist()
    assert [(row["person"], row["rollout"], row["step"]) for row in rows] == [
        (row["person"], row["rollout"], row["step"]) for row in _rows()
    ]
    for split in ("seen", "new"):  # the summary's numbers are those of the rows
        scored = [row for row in rows if row["scored_as"] == split]
        assert summary.splits[split].labels == len(scored)
        before = sum(abs(row["label"] - row["truth"]) for row in scored)
        after = sum(abs(row["mapped"] - row["truth"]) for row in scored)
        found_improvement = summary.splits[split].improvement["mind_meld"]
        assert found_improvement == pytest.approx(1.0 - after / before, abs=1e-5)
    assert set(load_mapper(out / "models" / "mind_meld.safetensors").people) == {
        "p0",
        "p1",
        "p2",
        "p3",
    }


def test_the_page_needs_nothing_else(quick, tmp_path):
    rows = [{**row, "person": f"<b>{row['person']}"} for row in _rows()]
    labels = _write(tmp_path / "labels.csv", rows)
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert "<script" not in page
    assert "<b>p0" not in page
    assert page.count("<img") == 3
    assert str(tmp_path) not in page


def test_the_same_seed_gives_the_same_numbers(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", _rows())
    found = []
    for out in ("one", "two"):
        assert _fit(labels, tmp_path / out, "--folds", "2", "--seed", "7") == 0
        found.append(Summary.from_json((tmp_path / out / "summary.json").read_text()))
    assert found[0].reproducible() == found[1].reproducible()


def test_a_limit_changes_units_only(quick, tmp_path):
    summaries, tables = [], []
    for name, factor in (("wheel", 1.0), ("percent", 40.0)):
        rows = [
            {**row, "label": factor * row["label"], "truth": factor * row["truth"]}
            for row in _rows()
        ]
        labels = _write(tmp_path / f"{name}.csv", rows)
        limit = str(2.5 * factor)
        assert _fit(labels, tmp_path / name, "--folds", "2", "--limit", limit) == 0
        summaries.append(Summary.from_json((tmp_path / name / "summary.json").read_text()))
        tables.append(pq.read_table(tmp_path / name / "mapped.parquet"))
    new, scaled = (one.splits["new"] for one in summaries)
    assert scaled.mae_before == pytest.approx(40.0 * new.mae_before, abs=1e-3)
    assert scaled.improvement["mind_meld"] == pytest.approx(new.improvement["mind_meld"], abs=1e-3)
    np.testing.assert_allclose(
        tables[1]["mapped"], 40.0 * np.asarray(tables[0]["mapped"]), 0.01, 0.1
    )


def test_a_split_column_and_masked_rows(quick, tmp_path):
    splits = {"p0": ("train", "heldout"), "p1": ("train", "heldout")}
    rows = [
        {
            **row,
            "split": splits.get(row["person"], ("new_calibration", "new_test"))[
                row["rollout"] == "r3"
            ],
            "label": "" if row["step"] == 3 else row["label"],
        }
        for row in _rows()
    ]
    labels = _write(tmp_path / "labels.csv", rows)
    assert _fit(labels, tmp_path / "out") == 0
    mapped = pq.read_table(tmp_path / "out" / "mapped.parquet").to_pylist()
    for row in mapped:
        scored = row["rollout"] == "r3"
        expected = ("seen" if row["person"] in splits else "new") if scored else None
        assert row["scored_as"] == expected
        assert (row["mapped"] is None) == (not scored or row["step"] == 3)
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert "16 of 320 rows lack label or truth and are masked." in page


def test_our_own_tables_are_read(quick, tmp_path):
    rows = _rows()
    ours = {
        "participant": [row["person"] for row in rows],
        "rollout": [row["rollout"] for row in rows],
        "attempt": [0] * len(rows),
        "step": [row["step"] for row in rows],
        "t_s": [row["step"] / 20.0 for row in rows],
        "teacher_label": [row["label"] for row in rows],
        "oracle_label": [row["truth"] for row in rows],
        "label_valid": [True] * len(rows),
    }
    pq.write_table(pa.table(ours), tmp_path / "seen.parquet")
    assert _fit(tmp_path / "seen.parquet", tmp_path / "out", "--folds", "2") == 0


def _refused(capsys, labels: Path, out: Path, *options: str) -> str:
    assert _fit(labels, out, *options) == 2
    said = capsys.readouterr().err
    assert said.startswith("steerlab: ")
    assert said.count("\n") == 1
    assert not out.exists()
    assert not [name for name in os.listdir(out.parent) if name.endswith(".part")]
    return said


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        ({"label": 0.0}, (), "no valid label other than 0"),
        ({"truth": ""}, (), "nothing to learn from"),
        ({"rollout": "only"}, (), "twice"),
        ({"label": 3.0}, (), "--limit"),
        ({}, ("--folds", "5"), "cannot make 5 folds"),
        ({}, ("--folds", "1"), "folds is 1"),
        ({}, ("--limit", "0"), "limit is 0"),
        ({}, ("--rate-hz", "-3"), "rate-hz is -3"),
        ({}, ("--seed", "-1"), "seed is -1"),
        ({}, ("--rate-hz", "1"), ""),
    ],
)
def test_what_cannot_be_fitted_is_said(change, options, said, quick, tmp_path, capsys):
    labels = _write(tmp_path / "labels.csv", [{**row, **change} for row in _rows()])
    if not said:  # slow labels are no error
        assert _fit(labels, tmp_path / "out", "--folds", "2", *options) == 0
        return
    assert said in _refused(capsys, labels, tmp_path / "out", *options)


def test_labels_without_error_are_refused_before_anything_is_trained(quick, tmp_path, capsys):
    rows = [
        {**row, "label": row["truth"] if row["person"] in ("p0", "p1") else row["label"]}
        for row in _rows()
    ]
    labels = _write(tmp_path / "labels.csv", rows)
    said = _refused(capsys, labels, tmp_path / "out", "--folds", "2")
    assert "2 of 4 seen people gave labels without any error" in said
    assert "'p0', 'p1'" in said
    few = [{**row, "label": row["truth"]} if row["person"] == "p0" else row for row in _rows()]
    _write(labels, few)
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0


def test_labels_that_are_the_truth_cannot_be_improved(quick, tmp_path, capsys):
    rows = [{**row, "label": row["truth"]} for row in _rows()]
    labels = _write(tmp_path / "labels.csv", rows)
    said = _refused(capsys, labels, tmp_path / "out", "--folds", "2")
    assert "no improvement is defined" in said


def _moving(rows: list[dict[str, object]], wheel: float = 1.0) -> list[dict[str, object]]:
    """The same with a car's motion, the wheel in units of ``wheel``."""
    return [
        {
            **row,
            "yaw_rate_radps": 0.3 * row["truth"],
            "speed_mps": 5.0,
            "robot_wheel": wheel * (row["truth"] + 0.1),
        }
        for row in rows
    ]


def _summary(out: Path) -> Summary:
    return Summary.from_json((out / "summary.json").read_text())


def test_what_cannot_be_judged_is_said_in_summary_and_report(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", _rows())
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    summary = _summary(tmp_path / "out")
    judged = set(summary.splits["new"].improvement)
    assert judged | set(summary.left_out) == set(BASELINES)
    assert set(summary.left_out) == {*FULL_ONLY, "sim_pretrained_context", "no_labels"} - {CEILING}
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    for key, why in summary.left_out.items():
        assert f"<code>{key}</code>" in page
        assert why in page
    assert "without yaw_rate_radps, speed_mps, robot_wheel" in page


def test_a_table_with_the_cars_motion_has_the_rung_that_reads_it(quick, tmp_path):
    improvements = []
    for name, unit in (("wheel", 1.0), ("percent", 40.0)):
        rows = [
            {**row, "label": unit * row["label"], "truth": unit * row["truth"]}
            for row in _moving(_rows(), unit)
        ]
        labels = _write(tmp_path / f"{name}.csv", rows)
        limit = str(2.5 * unit)
        assert _fit(labels, tmp_path / name, "--folds", "2", "--limit", limit) == 0
        summary = _summary(tmp_path / name)
        assert "sim_pretrained_context" not in summary.left_out
        improvements.append(summary.splits["new"].improvement["sim_pretrained_context"])
    assert improvements[1] == pytest.approx(improvements[0], abs=1e-4)  # the wheel was scaled too


def test_a_wheel_in_other_units_and_slow_labels_leave_rungs_out(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", _moving(_rows(), wheel=30.0))
    assert _fit(labels, tmp_path / "out", "--folds", "2", "--rate-hz", "0.2") == 0
    left_out = _summary(tmp_path / "out").left_out
    for key in ("eb_nonlinear", "sim_pretrained", "sim_pretrained_context"):
        assert "0.2 Hz" in left_out[key]
    assert _fit(labels, tmp_path / "out", "--folds", "2", "--force") == 0
    left_out = _summary(tmp_path / "out").left_out
    assert "robot_wheel reaches" in left_out["sim_pretrained_context"]
    assert "sim_pretrained" not in left_out


def test_people_unlike_the_others_are_named_in_the_report(quick, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(certainty.TrainingPeople, "furthest", lambda self: 0.0)
    monkeypatch.setattr(certainty.TrainingPeople, "distance", lambda self, embedding: 1.0)
    labels = _write(tmp_path / "labels.csv", _rows())
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    assert not caplog.records
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert "of a style unlike the training people’s" in page
    assert certainty.log.level == logging.NOTSET


@pytest.mark.slow
def test_the_full_ladder_is_the_default(quick, tmp_path, monkeypatch):
    for settings in ("PAPER", "PAPER_TEXT"):
        monkeypatch.setattr(baselines, settings, QUICK)
    labels = _write(tmp_path / "labels.csv", _moving(_rows(rollouts=6)))
    assert main(["fit", str(labels), "--out", str(tmp_path / "out"), "--folds", "2"]) == 0
    summary = _summary(tmp_path / "out")
    assert summary.left_out == {}
    for split in ("seen", "new"):
        assert set(summary.splits[split].improvement) == set(BASELINES)
    page = (tmp_path / "out" / "report" / "index.html").read_text(encoding="utf-8")
    assert "auto, the mapper to use here, blends" in page


def test_two_rollouts_and_two_folds_are_enough(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", _rows(rollouts=2))
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    assert {"shared_ridge", "person_ridge"} <= set(_summary(tmp_path / "out").left_out)


def test_rollouts_of_one_step_give_a_result(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", _rows(steps=1))
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0


def test_rollouts_too_short_to_mean_anything_are_warned_of(quick, tmp_path, caplog):
    labels = _write(tmp_path / "labels.csv", _rows(steps=2))
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    said = "16 of 16 held-out rollouts have fewer valid labels than MIND MELD's window of 1 s"
    assert said in caplog.text
    assert "2 at 20 Hz). What was removed there says little" in caplog.text
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert "16 of 16 held-out rollouts have fewer valid labels" in page
    caplog.clear()
    rows = [{**row, "label": "" if row["step"] > 1 else row["label"]} for row in _rows()]
    assert _fit(_write(labels, rows), tmp_path / "masked", "--folds", "2") == 0
    assert said in caplog.text  # labels count, not steps
    caplog.clear()
    assert _fit(_write(labels, _rows()), tmp_path / "long", "--folds", "2") == 0
    assert not caplog.records


def test_names_that_look_like_one_are_refused_before_anything_is_trained(quick, tmp_path, capsys):
    rows = [
        {
            **row,
            "rollout": "R1" if (row["person"], row["rollout"]) == ("p1", "r1") else row["rollout"],
        }
        for row in _rows()
    ]
    said = _refused(capsys, _write(tmp_path / "labels.csv", rows), tmp_path / "out", "--folds", "2")
    assert "labels.csv, line 102: rollouts 'r1' and 'R1' differ only by" in said


def test_one_truth_under_two_names_is_said_in_the_report(quick, tmp_path):
    rows = [
        {
            **row,
            "rollout": "again"
            if (row["person"], row["rollout"]) == ("p1", "r1")
            else row["rollout"],
        }
        for row in _rows()
    ]
    labels = _write(tmp_path / "labels.csv", rows)
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0
    page = (tmp_path / "out" / "report" / "index.html").read_text()
    assert "one and the same truth are one drive, whatever their names" in page


def test_an_unknown_ladder_is_refused():
    with pytest.raises(InvalidConfig, match="choose one of full, quick"):
        FitConfig(ladder="tall")


def test_with_a_split_column_the_model_that_was_judged_is_kept(quick, tmp_path):
    names = {"p0": ("train", "heldout"), "p1": ("train", "heldout")}
    rows = [
        {
            **row,
            "split": names.get(row["person"], ("new_calibration", "new_test"))[
                row["rollout"] == "r3"
            ],
        }
        for row in _rows()
    ]
    labels = _write(tmp_path / "labels.csv", rows)
    assert _fit(labels, tmp_path / "out") == 0
    mapper = load_mapper(tmp_path / "out" / "models" / "mind_meld.safetensors")
    mapped = pq.read_table(tmp_path / "out" / "mapped.parquet").to_pylist()
    table = label_table(read_label_columns(labels), LabelScale())
    for one in (given.series for given in table.given):
        if one.rollout == "r3":
            found = [
                row["mapped"]
                for row in mapped
                if (row["person"], row["rollout"]) == (one.person, one.rollout)
            ]
            np.testing.assert_allclose(found, mapper.map(one), atol=1e-5)


def test_constant_labels_give_a_result(quick, tmp_path):
    labels = _write(tmp_path / "labels.csv", [{**row, "label": 0.3} for row in _rows()])
    assert _fit(labels, tmp_path / "out", "--folds", "2") == 0


@pytest.mark.slow
def test_the_shipped_example_gives_the_golden_numbers(tmp_path, capsys):
    assert _fit(EXAMPLE, tmp_path / "out", "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    improvement = {split: summary["splits"][split]["improvement"] for split in ("seen", "new")}
    assert improvement["seen"]["person_gain"] == pytest.approx(0.25, abs=0.01)
    assert improvement["new"]["person_gain"] == pytest.approx(0.25, abs=0.01)
    assert improvement["seen"]["mind_meld"] == pytest.approx(0.63, abs=GOLDEN_TOLERANCE)
    assert improvement["new"]["mind_meld"] == pytest.approx(0.49, abs=GOLDEN_TOLERANCE)


@pytest.mark.slow
def test_a_table_of_many_people(quick, tmp_path, monkeypatch):
    for function in (cross_validate, fit_within_budget):
        monkeypatch.setitem(function.__kwdefaults__, "most_labels", 2_000)
    people, rollouts, steps = 120, 4, 10
    rng = np.random.default_rng(1)
    truth = np.tile(rng.uniform(-1.0, 1.0, rollouts * steps), people)
    gain = np.repeat(rng.uniform(0.5, 2.0, people), rollouts * steps)
    table = pa.table(
        {
            "person": np.repeat([f"p{p:04d}" for p in range(people)], rollouts * steps),
            "rollout": np.tile(np.repeat([f"r{r}" for r in range(rollouts)], steps), people),
            "step": np.tile(np.arange(steps), people * rollouts),
            "label": np.clip(gain * truth, -2.5, 2.5),
            "truth": truth,
        }
    )
    pq.write_table(table, tmp_path / "many.parquet")
    assert _fit(tmp_path / "many.parquet", tmp_path / "out", "--folds", "2") == 0
    summary = _summary(tmp_path / "out")
    assert summary.splits["new"].people == people
    assert len(load_mapper(tmp_path / "out" / "models" / "mind_meld.safetensors").people) == people
