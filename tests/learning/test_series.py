import numpy as np
import pyarrow as pa
import pytest

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.sim.records import LABELLED_STEP_SCHEMA


def make_series(**changes) -> LabelSeries:
    values = {
        "person": "p",
        "rollout": "r",
        "rate_hz": 20.0,
        "label": np.array([0.1, 0.2, 0.3]),
        "truth": np.array([0.0, 0.1, 0.2]),
        "valid": np.array([True, True, True]),
    }
    return LabelSeries(**(values | changes))


def rows(person="p", rollout="r", attempt=0, steps=4, hz=20.0, **changes) -> list[dict]:
    table = []
    for step in range(steps):
        row = dict.fromkeys(LABELLED_STEP_SCHEMA.names, 0.0)
        row |= {
            "participant": person,
            "rollout": rollout,
            "attempt": attempt,
            "step": step,
            "t_s": step / hz,
            "teacher_label": 0.1 * step,
            "oracle_label": 0.2 * step,
            "gate": "robot",
            "label_valid": True,
        }
        table.append(row | changes)
    return table


def table(*parts: list[dict]) -> pa.Table:
    return pa.Table.from_pylist([row for part in parts for row in part], LABELLED_STEP_SCHEMA)


def test_one_series_per_person_and_rollout_whatever_the_row_order():
    whole = table(rows("b", "x"), rows("a", "y", hz=10.0), rows("a", "x", steps=6))
    shuffled = whole.take(np.random.default_rng(0).permutation(len(whole)))
    series = series_from_table(shuffled)
    assert [(one.person, one.rollout) for one in series] == [("a", "x"), ("a", "y"), ("b", "x")]
    assert [one.rate_hz for one in series] == [20.0, 10.0, 20.0]
    assert [one.steps for one in series] == [6, 4, 4]
    np.testing.assert_allclose(series[0].label, 0.1 * np.arange(6))
    np.testing.assert_allclose(series[0].truth, 0.2 * np.arange(6))
    assert series[0].valid.all()


def test_the_last_attempt_counts():
    series = series_from_table(
        table(rows(attempt=0), rows(attempt=2, teacher_label=1.0), rows(attempt=1), rows("q"))
    )
    assert [(one.person, one.label[0]) for one in series] == [("p", 1.0), ("q", 0.0)]


def test_missing_labels_oracles_and_invalid_labels_mask_their_step():
    part = rows(steps=5)
    part[0]["teacher_label"] = None
    part[1]["oracle_label"] = None
    part[2]["label_valid"] = False
    part[3]["oracle_label"] = float("nan")
    (one,) = series_from_table(table(part))
    assert one.valid.tolist() == [False, False, False, False, True]
    assert np.isnan(one.label).tolist() == [True, False, True, False, False]
    assert np.isnan(one.truth).tolist() == [False, True, False, True, False]


def test_no_truth_at_all_is_allowed_for_mapping():
    (one,) = series_from_table(table(rows(oracle_label=None)))
    assert not one.valid.any()


def test_gaps_and_repeats_are_errors_that_name_them():
    part = rows()
    with pytest.raises(InvalidLabels, match=r"'p' on 'r', attempt 0: step 3 follows step 1"):
        series_from_table(table(part[:2] + part[3:]))
    with pytest.raises(InvalidLabels, match="step 2 follows step 2"):
        series_from_table(table([*part, part[2]]))


def test_uneven_times_single_steps_and_missing_columns_are_errors():
    part = rows()
    part[2]["t_s"] += 0.02
    with pytest.raises(InvalidLabels, match="evenly"):
        series_from_table(table(part))
    with pytest.raises(InvalidLabels, match="at least two"):
        series_from_table(table(rows(steps=1)))
    with pytest.raises(InvalidLabels, match="lacks oracle_label"):
        series_from_table(table(rows()).drop_columns(["oracle_label"]))


def test_an_empty_table_has_no_series():
    assert series_from_table(LABELLED_STEP_SCHEMA.empty_table()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"label": np.zeros(0), "truth": np.zeros(0), "valid": np.zeros(0, bool)}, "empty"),
        ({"truth": np.zeros(2)}, r"truth is \(2,\)"),
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"valid": np.ones(3)}, "not bool"),
        ({"label": np.array([0.0, np.nan, 0.0])}, "no finite label"),
        ({"label": np.array([0.0, 3.0, 0.0])}, r"label 3 at step 1 is outside ±2\.5"),
    ],
)
def test_a_series_that_breaks_its_rules_is_refused(changes, message):
    with pytest.raises(InvalidLabels, match=message):
        make_series(**changes)


def test_context_comes_with_the_table_and_is_checked():
    series = _series_of_context(context=np.ones((4, 2)), context_names=("speed_mps", "x"))
    assert series.context.shape == (4, 2)
    assert _series_of_context().context.shape == (4, 0)
    with pytest.raises(InvalidLabels, match="a column a name"):
        _series_of_context(context=np.ones((4, 2)), context_names=("speed_mps",))
    with pytest.raises(InvalidLabels, match="not finite"):
        _series_of_context(context=np.full((4, 1), np.nan), context_names=("x",))


def _series_of_context(**changes):
    values = {"person": "p", "rollout": "r", "rate_hz": 20.0, "label": np.zeros(4)}
    return LabelSeries(**values, truth=np.ones(4), valid=np.ones(4, bool), **changes)
