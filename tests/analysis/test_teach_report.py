import copy
from base64 import b64encode
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from scipy.stats import wilcoxon

from steerlab.analysis.summary import InvalidSummary
from steerlab.analysis.teach_report import (
    TeachReport,
    compare,
    headline,
    pairs_of,
    person_points,
    render_teach_report,
    summarise,
    table_lines,
    verdict,
)
from steerlab.analysis.wording import learner_name, p_value
from steerlab.learning.agents import LEARNERS
from steerlab.sim.tasks import make_task

RUN = {
    "task": "slalom", "rounds": 2, "seed": 0, "noise": 0.5, "family": "scripted",
    "learner_seeds": 2, "starts": 10, "starts_on_the_way": 4, "teachers": 3,
    "learners": ["dagger", "mind-meld"], "driving": "softened", "population": "wide",
}  # fmt: skip


def _png() -> str:
    file = BytesIO()
    Image.new("RGB", (64, 64), (90, 120, 150)).save(file, "PNG")
    return b64encode(file.getvalue()).decode("ascii")


FRAME = _png()


def _round(number: int, success: float | None, mae: float | None, asked: int) -> dict:
    distance_m = None if success is None else 50.0 - 40.0 * success
    return {
        "round": number, "outcome": "block_hit", "label_mae": mae, "labels_asked": asked,
        "teacher_seconds": asked / 10.0, "switches": 1, "loss": 0.1, "drives": 4,
        "success": success, "collisions": None if success is None else 1.0 - success,
        "final_distance_m": distance_m, "path_m": [[-40.0, 0.0], [-20.0, 1.0]],
    }  # fmt: skip


def _learner(final: float, mae: float | None = 0.5, asked: int = 100) -> dict:
    return {
        "by_round": [
            _round(0, 0.0, 0.3, 150),
            _round(1, None, mae, asked),
            _round(2, final, mae, asked),
        ],
        "final_drives": [
            {
                "outcome": "ball_reached",
                "final_distance_m": 4.0,
                "path_m": [[-40.0, 0.0], [30.0, 1.0]],
            }
        ],
        "frames": [FRAME] * 6,
    }


def _shard(name: str, dagger: tuple[float, float], mind_meld: tuple[float, float]) -> dict:
    return {
        "schema": 1, "teacher": name, "style": {}, "quirk": None, "left_out": None,
        "failed_demonstrations": [0, 0],
        "conditions": {
            "dagger": [_learner(value) for value in dagger],
            "mind-meld": [_learner(value, mae=0.2) for value in mind_meld],
        },
    }  # fmt: skip


@pytest.fixture
def shards() -> list[dict]:
    return [
        _shard("a", (0.2, 0.4), (0.8, 1.0)),
        _shard("b", (0.0, 0.2), (0.5, 0.5)),
        _shard("c", (0.9, 0.7), (0.7, 0.9)),
    ]


@pytest.fixture
def four(shards) -> list[dict]:
    """As few as can be tested."""
    return [*shards, _shard("d", (0.1, 0.3), (0.9, 0.9))]


def _summary(shards) -> dict:
    return summarise(shards, run=RUN, versions={"steerlab": "1"}, seconds={"this_call": 1.0})


def test_learner_seeds_are_averaged_before_teachers(shards):
    found = _summary(shards)["conditions"]
    assert found["dagger"]["success"] == pytest.approx((0.3 + 0.1 + 0.8) / 3)
    assert found["mind-meld"]["final_distance_m"] == pytest.approx(50 - 40 * (0.9 + 0.5 + 0.8) / 3)
    assert found["dagger"]["labels_asked"] == 350
    assert found["dagger"]["teacher_seconds"] == pytest.approx(35.0)
    assert found["mind-meld"]["label_mae"] == pytest.approx(0.2)  # not the demonstration's
    assert [row["round"] for row in found["dagger"]["by_round"]] == [0, 1, 2]
    assert found["dagger"]["by_round"][1]["success"] is None


def test_the_schema_is_what_was_promised(four):
    summary = _summary(four)
    assert {"schema", "verb", "task", "rounds", "teachers", "conditions", "tests"} <= set(summary)
    assert (summary["schema"], summary["verb"], summary["teachers"]) == (1, "teach", 4)
    assert set(summary["conditions"]["dagger"]) == {
        "success", "final_distance_m", "mean_distance_m", "collisions", "label_mae",
        "labels_asked", "teacher_seconds", "switches", "by_round",
    }  # fmt: skip
    assert len(summary["tests"]) == 2
    for test in summary["tests"]:
        assert set(test) == {
            "a", "b", "metric", "better", "worse", "p", "p_holm", "effect", "ci95",
        }  # fmt: skip


def test_tests_are_paired_over_teachers(four):
    tests = {test["metric"]: test for test in _summary(four)["tests"]}
    assert set(tests) == {"final_distance_m", "success"}
    success = tests["success"]
    assert (success["a"], success["b"]) == ("mind-meld", "dagger")
    assert (success["better"], success["worse"]) == (3, 0)
    low, high = success["ci95"]
    assert low <= np.mean([0.6, 0.4, 0.0, 0.7]) <= high
    assert tests["final_distance_m"]["ci95"][1] <= 0.0  # nearer is better, and is counted so
    assert tests["final_distance_m"]["better"] == 3


def test_p_is_wilcoxons_and_holm_covers_the_table():
    rng = np.random.default_rng(0)
    base = rng.normal(size=20)
    tables = {
        name: {"final_distance_m": base + shift + rng.normal(0, 0.1, 20), "success": base}
        for name, shift in (("dagger", 0.0), ("mind-meld", -1.0), ("bc", 0.05))
    }
    tests = compare(tables, seed=0)
    first = next(t for t in tests if (t["a"], t["b"]) == ("mind-meld", "dagger"))
    difference = tables["mind-meld"]["final_distance_m"] - tables["dagger"]["final_distance_m"]
    assert first["p"] == pytest.approx(wilcoxon(difference)[1], abs=1e-6)
    assert first["p_holm"] == pytest.approx(min(1.0, 6 * wilcoxon(difference)[1]), abs=1e-5)
    assert first["effect"] == 1.0
    assert all(test["p"] == 1.0 for test in tests if test["metric"] == "success")


def test_effect_and_correction_by_hand():
    gains = {"mind-meld": [3.0, 2.0, -1.0, 0.0], "bc": [4.0, 3.0, 2.0, 1.0]}
    tables = {
        name: {"success": np.array(gain), "final_distance_m": np.zeros(4)}
        for name, gain in (gains | {"dagger": [0.0] * 4}).items()
    }
    tests = {
        (test["a"], test["b"]): test
        for test in compare(tables, seed=0)
        if test["metric"] == "success"
    }
    assert tests["mind-meld", "dagger"]["effect"] == pytest.approx((3 + 2 - 1) / 6, abs=1e-6)
    assert tests["bc", "dagger"]["effect"] == 1.0
    smallest = min(test["p"] for test in tests.values())
    assert min(test["p_holm"] for test in tests.values()) == pytest.approx(min(1.0, 6 * smallest))


def test_no_pair_is_tested_twice():
    pairs = pairs_of(["bc", "dagger", "mind-meld", "oracle", "shiv"])
    assert len({frozenset(pair) for pair in pairs}) == len(pairs) == 7


def test_too_few_teachers_test_nothing(shards):
    for count in (1, 2, 3):
        assert _summary(shards[:count])["tests"] == []


def test_whoever_was_left_out_is_named_and_not_counted(shards):
    lost = _shard("d", (0.0, 0.0), (0.0, 0.0)) | {"left_out": "never reached", "conditions": {}}
    summary = _summary([*shards, lost])
    assert summary["teachers"] == 3
    assert summary["left_out"] == {"d": "never reached"}
    assert any("never reached" in line for line in table_lines(summary))
    with pytest.raises(InvalidSummary, match="never reached"):
        _summary([lost])


def test_a_learner_without_labels_has_no_label_error(shards):
    for shard in shards:
        shard["conditions"]["dagger"] = [_learner(0.5, mae=None, asked=0)] * 2
    found = _summary(shards)["conditions"]["dagger"]
    assert found["label_mae"] is None
    assert found["labels_asked"] == 150


def test_a_learner_that_was_not_taught_is_named(shards):
    odd = copy.deepcopy(shards[0])
    del odd["conditions"]["dagger"]
    with pytest.raises(InvalidSummary, match="a has not taught dagger"):
        _summary([shards[1], odd])


def test_learners_of_an_earlier_run_are_left_aside(shards):
    alone = summarise(
        shards,
        run=RUN | {"learners": ["mind-meld"]},
        versions={"steerlab": "1"},
        seconds={"this_call": 1.0},
    )
    assert list(alone["conditions"]) == ["mind-meld"]
    assert alone["conditions"]["mind-meld"] == _summary(shards)["conditions"]["mind-meld"]


def test_the_page_has_every_number_and_no_reference_outside(shards):
    summary = _summary(shards)
    report = TeachReport(
        summary=summary,
        shards=shards,
        world=make_task("slalom").world,
        command="steerlab teach --out x",
    )
    page = render_teach_report(report)
    assert page == render_teach_report(report)
    assert "http" not in page.split("<body>")[1].replace("data:image/svg+xml", "")
    for name, found in summary["conditions"].items():
        key = f'data-key="conditions.{name}.success" value="{found["success"]}"'
        assert key in page
    assert "3 teachers, scripted, taught every learner 2 times" in page


def test_the_page_says_what_is_established_and_what_is_not(shards, four):
    summary = _summary(four)
    assert "does not establish a difference" in verdict(summary)
    assert "better for 3, worse for 0" in verdict(summary)
    for test in summary["tests"]:
        test["p_holm"] = 0.002
    assert verdict(summary).endswith("p = .002 after Holm’s correction.")
    assert verdict(_summary(shards[:1])) == ""
    assert "73\u202f% of drives with MIND MELD’s labels" in headline(_summary(shards))
    one = summary | {"conditions": {"eil": {"success": 0.5}, "shiv": {"success": 0.75}}}
    assert "SHIV reached the ball most: 75" in headline(one)
    alone = headline(summary | {"conditions": {"eil": {"success": 0.5}}})
    assert alone == "Policies taught by 4 teachers as EIL reached the ball in 50\u202f% of drives"


def test_each_teacher_is_a_point_of_the_error_figure(shards):
    points = person_points(shards, ["dagger"])
    expected = np.array([(0.5, 0.3), (0.5, 0.1), (0.5, 0.8)])
    assert np.array(points["dagger"]) == pytest.approx(expected)


def test_many_learners_still_make_a_page(shards):
    names = [*LEARNERS[:13], "mapped:person_ridge"]
    for shard in shards:
        taught = list(shard["conditions"].values())
        shard["conditions"] = {name: taught[row % 2] for row, name in enumerate(names)}
    summary = summarise(
        shards, run=RUN | {"learners": names}, versions={}, seconds={"this_call": 1.0}
    )
    page = render_teach_report(
        TeachReport(
            summary=summary, shards=shards, world=make_task("hard").world, command="steerlab teach"
        )
    )
    assert all(learner_name(name) in page for name in names)


def test_p_values_in_words():
    assert [p_value(p) for p in (1e-5, 0.0123, 1.0)] == ["<\u00a0.001", ".012", "1"]
