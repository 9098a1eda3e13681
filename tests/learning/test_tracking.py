"""Tracking tables: what a person's input should have been, and tables that do not say it."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, LabelTable, label_table
from steerlab.learning.tracking import holding_input, numbered_steps, one_rate, rate_of_change
from steerlab.sim.errors import InvalidConfig
from tests.learning.made_up_tracking import EXAMPLE, made_up_tracking

RATE_HZ = 50.0
NAN = float("nan")


def _tracking(steps: int = 6, **columns: list) -> dict[str, list]:
    """One person on one rollout, the reference a parabola."""
    t_s = np.arange(steps) / RATE_HZ
    return {
        "person": ["p"] * steps,
        "rollout": ["r"] * steps,
        "step": list(range(steps)),
        "t_s": t_s.tolist(),
        "reference": (t_s**2).tolist(),
        "disturbance": [0.25] * steps,
        "input": [0.5] * steps,
    } | columns


def _without(*names: str) -> dict[str, list]:
    return {name: values for name, values in _tracking().items() if name not in names}


def _read(path: Path, columns: dict[str, list], **scale: float) -> LabelTable:
    pq.write_table(pa.table(columns), path / "tracking.parquet")
    return label_table(read_label_columns(path / "tracking.parquet"), LabelScale(**scale))


def test_the_holding_input_holds_the_cursor():
    """A cursor that gets it stays on the reference: midpoint steps of dx/dt = gain (u + d)."""
    gain, rng = -1.7, np.random.default_rng(0)
    t_s = np.arange(2000) / RATE_HZ
    reference = 0.8 * np.sin(1.3 * t_s) + 0.1 * t_s
    disturbance = np.cumsum(rng.normal(0.0, 0.05, len(t_s)))
    given = holding_input(reference, disturbance, rate_hz=RATE_HZ, gain=gain)
    speed = gain * (given + disturbance)
    cursor = reference[0] + np.r_[0.0, np.cumsum((speed[1:] + speed[:-1]) / 2.0 / RATE_HZ)]
    assert np.abs(cursor - reference).max() < 1e-3
    assert np.abs(cursor + disturbance - reference).max() > 0.1  # and the test can tell


def test_the_rate_is_central_one_sided_at_the_ends_and_never_across_a_gap():
    values = np.array([0.0, 1.0, 4.0, 9.0, NAN, 25.0, 36.0])
    expected = [1.0, 2.0, 4.0, NAN, NAN, NAN, 11.0]
    np.testing.assert_array_equal(rate_of_change(values, 1.0), expected)
    np.testing.assert_array_equal(rate_of_change(values[:2], 3.0), [3.0, 3.0])
    assert np.isnan(rate_of_change(values[:1], 3.0)).all()


def test_at_rest_it_is_minus_the_disturbance_and_undisturbed_the_references_rate(tmp_path):
    disturbance = [0.1, -0.2, 0.3, 0.0, -0.5, 0.6]
    (one,) = _read(tmp_path, _tracking(reference=[3.0] * 6, disturbance=disturbance)).given
    assert one.series.truth.tolist() == [-value for value in disturbance]
    assert one.series.label.tolist() == [0.5] * 6
    (one,) = _read(tmp_path, _tracking(disturbance=[0.0] * 6), gain=0.5).given
    t_s = np.arange(6) / RATE_HZ
    np.testing.assert_allclose(one.series.truth[1:-1], 2.0 * 2.0 * t_s[1:-1])  # a parabola: exact
    assert one.series.rate_hz == RATE_HZ


def test_the_report_says_what_was_taken_for_the_truth(tmp_path):
    assert "reference’s rate / gain − the disturbance, with gain 2" in str(
        _read(tmp_path, _tracking(), gain=2.0).notices
    )
    assert "with gain 1." in _read(tmp_path, _tracking()).notices[0]


@settings(max_examples=50, deadline=None)
@given(
    reference=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=9),
    gain=st.floats(0.1, 10.0),
)
def test_mirror_images_are_exact(reference, gain):
    there, push = np.array(reference), np.linspace(-1.0, 0.7, len(reference))
    one = holding_input(there, push, rate_hz=60.0, gain=gain)
    other = holding_input(-there, -push, rate_hz=60.0, gain=gain)
    np.testing.assert_array_equal(one, -other)


def test_gaps_are_masked_in_the_truth_and_no_further(tmp_path):
    reference = [0.0, 0.01, NAN, 0.03, 0.04, 0.05, 0.06, 0.07]
    table = _tracking(8, reference=reference, disturbance=[0.0] * 7 + [NAN])
    (one,) = _read(tmp_path, table).given
    assert one.series.valid.tolist() == [True, False, False, False, True, True, True, False]
    rows = [0, 1, 2, 5, 6, 7]  # 3 and 4 are missing
    cut = {name: [values[row] for row in rows] for name, values in _tracking(8).items()}
    (one,) = _read(tmp_path, cut).given
    assert np.flatnonzero(one.series.valid).tolist() == [0, 1, 6, 7]


def test_times_stand_in_for_steps(tmp_path):
    with_steps, without = (
        _read(tmp_path, table).given for table in (_tracking(), _without("step"))
    )
    np.testing.assert_array_equal(with_steps[0].series.truth, without[0].series.truth)
    rounded = [round(step / 60.0, 3) for step in range(2700)]
    kept = [*range(100), *range(110, 2700)]
    place = "line {}".format
    steps = numbered_steps(np.array(rounded)[kept], np.zeros(2690, dtype=np.int64), place)
    assert steps.tolist() == kept
    with pytest.raises(InvalidLabels, match=r"line 2: t_s 0\.1 comes twice"):
        numbered_steps(np.array([0.0, 0.1, 0.1]), np.zeros(3, dtype=np.int64), place)


def test_a_clocks_rounding_makes_no_second_truth(tmp_path):
    """Or the same reference would not be known again, and be held out and trained on."""
    rows: dict[str, list] = {}
    for person, steps in (("p", 41), ("q", 36)):
        one = _tracking(steps, person=[person] * steps)
        one["t_s"] = [round(step / 60.0, 3) for step in range(steps)]
        for name, values in one.items():
            rows.setdefault(name, []).extend(values)
    first, second = (one.series for one in _read(tmp_path, rows).given)
    assert first.rate_hz != second.rate_hz
    np.testing.assert_array_equal(first.truth[:35], second.truth[:35])
    np.testing.assert_array_equal(one_rate(np.array([60.0, 20.0])), [60.0, 20.0])


@pytest.mark.parametrize(
    ("table", "scale", "said"),
    [
        (_tracking(label=[0.0] * 6), {}, "has both label and input; a table has label and truth"),
        (_tracking(truth=[0.0] * 6), {}, "has both truth and input"),
        (_without("disturbance"), {}, "lacks the column disturbance; .* tracking table needs"),
        (_without("reference"), {}, "lacks the column reference"),
        (_without("input"), {}, "lacks the column input"),
        (_without("input", "step", "t_s"), {}, "step, input; .* step or t_s"),
        (_without("t_s"), {}, "neither t_s nor --rate-hz"),
        (_tracking(1), {}, "'p' on 'r' has 1 of the steps .* the reference has no rate"),
        (_tracking(reference=[0.0, NAN] * 3), {}, "'p' on 'r' has 3 of the steps"),
        (_tracking(reference=[float("inf")] * 6), {}, "row 1: reference is inf; it must be finite"),
        (_tracking(disturbance=[9.0] * 6), {}, r"row 1 .*truth -8\.98 is outside ±2\.5; .*--limit"),
        (_tracking(input=[9.0] * 6), {}, "row 1 .*input 9 is outside"),
        (_tracking(input=[NAN] * 6), {}, "both an input and a truth; there is nothing"),
        (_tracking(disturbance=["x"] * 6), {}, "disturbance is 'x'; it must be a number"),
    ],
)
def test_what_says_no_truth_is_refused_in_a_sentence(table, scale, said, tmp_path):
    with pytest.raises(InvalidLabels, match=said) as error:
        _read(tmp_path, table, **scale)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("gain", [0.0, NAN, float("inf")])
def test_a_gain_that_no_cursor_has_is_refused(gain):
    with pytest.raises(InvalidConfig, match=r"gain is .*; it must be finite and not 0"):
        LabelScale(gain=gain)


def test_a_gain_for_a_table_of_labels_is_refused(tmp_path):
    columns = _without("reference", "disturbance", "input")
    columns |= {"label": [0.5] * 6, "truth": [0.25] * 6}
    assert len(_read(tmp_path, columns | {"reference": [1.0] * 6}).given) == 1  # a context column
    with pytest.raises(InvalidLabels, match="--gain is 2, but the table has label and truth"):
        _read(tmp_path, columns, gain=2.0)


def test_the_shipped_example_is_what_its_script_makes():
    text = EXAMPLE.read_text(encoding="utf-8")
    assert text == made_up_tracking()
    assert len(text) < 60_000
