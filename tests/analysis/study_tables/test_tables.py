"""The tables of a made-up study hold what their own statistics say, and what was planted."""

import json

import numpy as np
import pytest

from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.correlation import paper_correlation
from steerlab.analysis.statistics.multiple_correlation import multiple_correlation
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.study_tables.constructs import main_scales
from steerlab.analysis.study_tables.csv_files import csv_files
from steerlab.analysis.study_tables.plain import is_empty, plain
from steerlab.analysis.study_tables.tables import KEYS
from steerlab.analysis.summary import InvalidSummary
from steerlab.study.surveys.questionnaire_file import shipped_questionnaires
from steerlab.study.surveys.reliability import cronbach_alpha
from steerlab.study.surveys.scoring import keyed_table


def rows_of(analysis, key: str) -> dict[str, dict]:
    return {row["key"]: row for row in analysis.tables[key]["rows"]}


def test_the_keys_are_those_that_were_asked_for(whole):
    assert tuple(json.loads(whole.to_json())) == KEYS
    assert "NaN" not in whole.to_json()


def test_table_1_is_scores_and_alpha(whole):
    rows = [row for row in whole.tables["table1"] if row["role"] == "training"]
    titles = [row["scale"] for row in rows if not row["sub_scale"]]
    assert titles == [
        *("experience", "experience", "total"),
        *("extraversion", "agreeableness", "conscientiousness", "neuroticism", "openness"),
    ]
    questionnaire = shipped_questionnaires()["mini_ipip_5"]
    people = [one.answers["mini_ipip_5"] for one in whole.data.of_role("training")]
    answers = keyed_table(questionnaire, "neuroticism", people)
    row = next(row for row in rows if row["scale"] == "neuroticism")
    assert row["mean"] == pytest.approx(answers.sum(axis=1).mean(), rel=1e-5)
    assert row["sd"] == pytest.approx(answers.sum(axis=1).std(ddof=1), rel=1e-5)
    assert row["alpha"] == pytest.approx(cronbach_alpha(answers).alpha, rel=1e-5)
    assert row["mean_rescaled"] == pytest.approx((row["mean"] - 4) / 16, rel=1e-4)
    assert (row["low"], row["high"], row["people"]) == (4, 20, 20)
    assert {row["people"] for row in whole.tables["table1"] if row["role"] == "test"} == {4}


def test_a_sub_scale_is_not_a_test_of_its_own():
    assert main_scales(shipped_questionnaires()["trust"]) == ("total",)
    assert len(main_scales(shipped_questionnaires()["mini_ipip_5"])) == 5


def test_table_2_is_the_statistics_of_each_construct(whole):
    found = rows_of(whole, "table2")
    row = found["mini_ipip_5.neuroticism"]
    construct = next(one for one in whole.constructs if one.key == "mini_ipip_5.neuroticism")
    w = whole.data.embeddings[0].of(construct.people)
    alone = multiple_correlation(w, construct.values, rng=np.random.default_rng(0), permutations=19)
    assert row["primary"]["r"] == pytest.approx(alone.r, rel=1e-5)
    for at, one in enumerate(row["paper_compatible"]):
        by_hand = paper_correlation(w[:, at], construct.values)
        assert one["label"] == "paper-compatible"
        assert one["r"] == pytest.approx(by_hand.correlation.r, rel=1e-4)
    assert {row["people"] for row in found.values()} == {20}


def test_only_what_was_planted_is_found(whole):
    found = rows_of(whole, "table2")
    significant = {
        key for key, row in found.items() if row["holm"] is not None and row["holm"] < 0.05
    }
    assert significant == {"mini_ipip_5.neuroticism", "amplitude_total", "lag_plain_s"}


def test_the_family_is_corrected_together_and_metrics_beside_it_are_not(whole):
    rows = list(rows_of(whole, "table2").values())
    family = [row for row in rows if row["family"]]
    assert len(family) == 8 + 2
    expected = holm(np.array([row["primary"]["p"] for row in family]))
    assert [row["holm"] for row in family] == pytest.approx(expected.tolist(), rel=1e-5)
    assert {row["holm"] for row in rows if not row["family"]} == {None}
    assert all(row["bh"] <= row["holm"] for row in family)


def test_all_networks_together_span_the_single_ones(whole):
    for row in rows_of(whole, "table2").values():
        several = row["networks"]
        assert several["networks"] == (1 if row["rollouts"] else 2)  # one was fitted on all drives
        assert several["lowest"] <= several["r"] <= several["highest"]
        assert several["interval"][0] <= row["primary"]["interval"][0]


def test_label_quality_is_a_ratio_of_sums(whole):
    seen = whole.tables["label_quality"]["seen"]
    assert seen["improvement"] == pytest.approx(0.6)
    assert seen["per_sample_percent"] == pytest.approx(35.0)
    assert seen["people_improved"] == 1.0
    assert len(seen["by_person"]) == 20
    assert is_empty(whole.tables["label_quality"]["new"])


def test_hypotheses_have_verdict_effect_interval_and_power(whole):
    found = {row["id"]: row for row in whole.tables["hypotheses"]}
    assert list(found) == ["H1", "H2a", "H2b", "H2c", "H3a", "H3b", "H4"]
    assert found["H1"]["verdict"] == "supported"
    assert found["H1"]["effect"]["share_removed"] == pytest.approx(0.6)
    assert found["H2a"]["verdict"] == "supported"
    assert found["H2a"]["effect"]["what"].endswith("Neuroticism")
    assert len(found["H2a"]["parts"]) == 5
    assert found["H2b"]["verdict"] == found["H2c"]["verdict"] == "not supported"
    assert found["H3a"]["verdict"] == found["H3b"]["verdict"] == "supported"
    assert found["H4"]["verdict"] == "supported"
    assert not any({"otherwise", "note"} & set(row) for row in found.values())
    for row in found.values():
        low, high = row["effect"]["ci95"]
        assert low <= row["effect"]["value"] <= high
        assert row["power"]["level"] < row["power"]["of_medium"] < 1.0
        assert row["smallest_p"] < 0.05
    assert found["H1"]["power"]["level"] == pytest.approx(0.05 / 3, rel=1e-5)  # three are primary
    assert found["H2a"]["power"]["level"] == pytest.approx(
        0.05 / 4 / 5, rel=1e-5
    )  # of four, over five scales
    assert found["H4"]["power"]["level"] == pytest.approx(
        0.05 / 4 / 3, rel=1e-5
    )  # over three pairs
    assert {row["id"] for row in found.values() if row["primary"]} == {"H1", "H3a", "H3b"}
    assert [row["id"] for row in found.values() if not row["planned"]] == [
        "H2a",
        "H2b",
        "H2c",
        "H4",
    ]


def test_labels_that_got_worse_support_nothing(study, tables_of):
    from dataclasses import replace

    data = study(12)
    (one,) = data.held_out
    worse = replace(data, held_out=(replace(one, before=one.after, after=one.before),))
    found = tables_of(worse)["hypotheses"][0]
    assert found["p"] < 0.05
    assert found["verdict"] == "not supported"
    assert found["note"] == "the labels got worse"


def test_the_csv_files_hold_the_same_numbers(whole):
    files = csv_files(whole.tables)
    assert set(files) >= {"table1.csv", "table2.csv", "hypotheses.csv", "style.csv"}
    header, first, *_ = files["table1.csv"].splitlines()
    row = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(row["alpha"]) == whole.tables["table1"][0]["alpha"]
    assert float(row["alpha_ci95_low"]) == whole.tables["table1"][0]["alpha_ci95"][0]
    for text in files.values():
        assert "nan" not in text.lower().replace("anan", "")
        assert text.count("\n") >= 1


def test_equal_analyses_give_equal_text(study):
    from steerlab.analysis.study_tables.tables import AnalysisConfig, analyse

    config = AnalysisConfig(permutations=99)
    assert analyse(study(9), config).to_json() == analyse(study(9), config).to_json()


def test_what_is_not_finite_never_becomes_a_cell():
    with pytest.raises(InvalidSummary, match="nan"):
        plain({"p": [np.nan]})
    assert plain(NotComputable(reason="so")) == {"empty": "so"}
    assert plain(np.float64(-0.0)) == 0.0
    assert plain(1.23456789e-12) == 1.23457e-12


def test_fastdtw_is_a_column_beside(study):
    from steerlab.analysis.study_tables.tables import exact_styles, style_table

    data = study(4)
    rows = style_table(data, exact_styles(data), fastdtw=True)["rows"]
    for row in rows:
        assert row["amplitude_total_fastdtw"] == pytest.approx(row["amplitude_total"], abs=1.0)
    assert "not computed" in style_table(data, exact_styles(data), fastdtw=False)["fastdtw"]
