"""Label tables from anywhere: read exactly, or refused with a sentence that says what to mend."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, LabelTable, label_table
from steerlab.sim.errors import InvalidConfig, SteerlabError

EXAMPLE = Path(__file__).parents[2] / "docs" / "example-labels.csv"


def _table(people: int = 3, rollouts: int = 2, steps: int = 5) -> dict[str, list]:
    rows = [(p, r, s) for p in range(people) for r in range(rollouts) for s in range(steps)]
    return {
        "person": [f"p{p}" for p, _, _ in rows],
        "rollout": [f"r{r}" for _, r, _ in rows],
        "step": [s for _, _, s in rows],
        "label": [0.02 * s + 0.5 * p for p, _, s in rows],
        "truth": [0.02 * s for _, _, s in rows],
    }


def _read(path: Path, columns: dict[str, list] | pa.Table, **scale: float) -> LabelTable:
    table = columns if isinstance(columns, pa.Table) else pa.table(columns)
    pq.write_table(table, path / "labels.parquet")
    return label_table(read_label_columns(path / "labels.parquet"), LabelScale(**scale))


def _read_csv(path: Path, text: str, **scale: float) -> LabelTable:
    (path / "labels.csv").write_text(text)
    return label_table(read_label_columns(path / "labels.csv"), LabelScale(**scale))


def test_the_shipped_example_reads():
    table = label_table(read_label_columns(EXAMPLE), LabelScale())
    assert len(table.given) == 8 * 4
    assert {one.series.rate_hz for one in table.given} == {10.0}
    assert table.notices == ()
    assert not table.has_split


def test_csv_and_parquet_give_the_same(tmp_path):
    columns = _table()
    pyarrow.csv.write_csv(pa.table(columns), tmp_path / "labels.csv")
    from_csv = label_table(read_label_columns(tmp_path / "labels.csv"), LabelScale())
    for one, other in zip(from_csv.given, _read(tmp_path, columns).given, strict=True):
        assert (one.series.person, one.series.rollout) == (other.series.person, one.series.rollout)
        np.testing.assert_array_equal(one.series.label, other.series.label)
        np.testing.assert_array_equal(one.series.truth, other.series.truth)
        assert one.series.rate_hz == 20.0  # the documented default


def test_rows_may_come_in_any_order(tmp_path):
    table = pa.table(_table())
    shuffled = table.take(np.random.default_rng(0).permutation(table.num_rows))
    for one, other in zip(
        _read(tmp_path, table).given, _read(tmp_path, shuffled).given, strict=True
    ):
        np.testing.assert_array_equal(one.series.label, other.series.label)


def test_names_stay_text(tmp_path):
    text = "person,rollout,step,label,truth\n007,01,0,1,1\n007,01,1,1,2\n7,01,0,1,1\n"
    given = _read_csv(tmp_path, text).given
    assert [(one.series.person, one.series.rollout) for one in given] == [
        ("007", "01"),
        ("7", "01"),
    ]


def test_nan_and_empty_mask_their_step(tmp_path):
    text = (
        "person,rollout,step,label,truth\n"
        "p,r,0,0.5,0.1\np,r,1,,0.2\np,r,2,NaN,0.3\np,r,3,0.5,\np,r,4,0.5,nan\np,r,5,0.5,0.4\n"
    )
    table = _read_csv(tmp_path, text)
    assert table.given[0].series.valid.tolist() == [True, False, False, False, False, True]
    assert table.notices == ("4 of 6 rows lack label or truth and are masked.",)


def test_missing_steps_are_masked_not_closed_up(tmp_path):
    columns = _table(1, 1, 8)
    keep = [0, 1, 4, 5, 7]
    table = _read(tmp_path, {name: [v[i] for i in keep] for name, v in columns.items()})
    (one,) = table.given
    assert one.series.steps == 8
    assert np.flatnonzero(one.series.valid).tolist() == keep == one.rows.tolist()
    np.testing.assert_allclose(one.series.label[one.rows], [0.02 * step for step in keep])
    assert table.notices == ("3 steps are missing between others and are masked.",)


def test_t_s_gives_the_rate_even_when_rounded(tmp_path):
    columns = _table(2, 2, 40)
    columns["t_s"] = [round(step / 30.0, 3) for step in columns["step"]]
    rates = [one.series.rate_hz for one in _read(tmp_path, columns).given]
    np.testing.assert_allclose(rates, 30.0, rtol=1e-3)


def test_another_range_is_scaled_to_the_wheel(tmp_path):
    columns = _table()
    columns["label"] = [40.0 * value for value in columns["label"]]
    with pytest.raises(InvalidLabels, match=r"outside ±2\.5; .*--limit \(43.2 or more\)"):
        _read(tmp_path, columns)
    table = _read(tmp_path, columns, limit=100.0)
    largest = max(np.abs(one.series.label).max() for one in table.given)
    assert largest == pytest.approx(43.2 / 100.0 * 2.5)


def test_numeric_columns_become_context_and_others_are_left_out(tmp_path):
    columns = _table()
    rows = len(columns["step"])
    columns |= {"speed": list(range(rows)), "note": ["x"] * rows, "hole": [None, *range(1, rows)]}
    table = _read(tmp_path, columns)
    assert table.given[0].series.context_names == ("speed",)
    np.testing.assert_array_equal(table.given[1].series.context[:, 0], range(5, 10))
    assert len(table.notices) == 2


def test_our_own_schema_is_read(tmp_path):
    columns = _table(2, 1, 4)
    ours = {
        "participant": columns["person"] * 2,
        "rollout": columns["rollout"] * 2,
        "attempt": [0] * 8 + [1] * 8,
        "step": columns["step"] * 2,
        "t_s": [step / 20.0 for step in columns["step"]] * 2,
        "speed_mps": [5.0] * 16,
        "x_m": [1.0] * 16,
        "teacher_label": [9.0] * 8 + [0.5] * 8,  # the first attempt does not count
        "oracle_label": [0.25] * 16,
        "label_valid": [True] * 15 + [False],
    }
    table = _read(tmp_path, ours)
    assert table.given[0].series.label.tolist() == [0.5] * 4
    assert table.given[1].series.valid.tolist() == [True, True, True, False]
    assert table.given[0].series.context_names == ("speed_mps",)


def _changed(**changes: object) -> dict[str, list]:
    columns = _table()
    rows = len(columns["step"])
    for name, value in changes.items():
        columns[name] = value if isinstance(value, list) else [value] * rows
    return columns


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({k: v for k, v in _table().items() if k != "truth"}, "lacks the column truth; it has"),
        ({"a": [1]}, "lacks the columns person, rollout, step, label, truth"),
        ({name: pa.array([], pa.string()) for name in _table()}, "no rows"),
        (_changed(label="left"), "label holds string such as 'left'"),
        (_changed(step=0.5), "step 0.5; it must be a whole number"),
        (_changed(step=0), "has step 0 twice"),
        (_changed(step=[*range(0, 30000, 1000)]), "step must count control steps"),
        (_changed(person=None), "person has 30 empty rows"),
        (_changed(rollout=" "), "rollout has an empty name"),
        (_changed(label=None), "nothing to learn from"),
        (_changed(truth=float("nan")), "nothing to learn from"),
        (_changed(truth=float("inf")), "truth is infinite"),
        (_changed(label=3.5), "outside ±2.5"),
        (_changed(split="test"), "split has 'test'; it may hold train, heldout"),
        (_changed(split=["train", "heldout"] * 15), "is in two splits"),
        (_changed(t_s=1.0), "not evenly spaced"),
        (_changed(t_s=[0.0, 0.1, 0.2, 0.9, 1.0] * 6), "not evenly spaced"),
        (_changed(t_s=None), "no finite t_s"),
        (_changed(label_valid="yes"), "true or false"),
    ],
)
def test_what_cannot_be_read_is_said(columns, said, tmp_path):
    with pytest.raises(InvalidLabels, match=said.replace("(", r"\(")) as error:
        _read(tmp_path, columns)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("labels.xlsx", b"x", "neither .csv nor .parquet"),
        ("labels.csv", b"", "cannot be read"),
        ("labels.csv", b"person,rollout\np,r,1\n", "cannot be read"),
        ("labels.csv", b"person;rollout;step;label;truth\np;r;0;1;1\n", "lacks the columns"),
        ("labels.csv", b"person,person\np,r\n", "twice"),
        ("labels.parquet", b"PAR1 not", "cannot be read"),
    ],
)
def test_what_is_no_table_is_said(name, content, said, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidLabels, match=said):
        read_label_columns(tmp_path / name)
    with pytest.raises(InvalidLabels, match="is not there"):
        read_label_columns(tmp_path / "absent.csv")
    with pytest.raises(InvalidLabels, match="is a folder"):
        read_label_columns(tmp_path)


def test_rate_and_limit_are_checked(tmp_path):
    for bad in ({"limit": 0.0}, {"limit": float("nan")}, {"rate_hz": -1.0}):
        with pytest.raises(InvalidConfig, match="must be positive"):
            LabelScale(**bad)
    columns = _changed(t_s=[step / 10.0 for step in _table()["step"]])
    with pytest.raises(InvalidLabels, match="--rate-hz is 20, but t_s says 10"):
        _read(tmp_path, columns, rate_hz=20.0)


CELL = st.one_of(
    st.floats(),
    st.integers(),
    st.text(max_size=5),
    st.sampled_from(["", "NaN", "p", "r", "train", "0", "1e400", '"', "-0", "true"]),
)
HEADER = ["person", "rollout", "step", "label", "truth", "t_s", "split", "attempt", "label_valid"]


@settings(max_examples=150, deadline=None)
@given(
    header=st.lists(st.sampled_from([*HEADER, "x", ""]), max_size=8),
    rows=st.lists(st.lists(CELL, max_size=8), max_size=6),
)
def test_any_csv_is_read_or_refused(header, rows, tmp_path_factory):
    path = tmp_path_factory.mktemp("any") / "labels.csv"
    lines = [",".join(header), *(",".join(map(str, row)) for row in rows)]
    path.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    with suppress(SteerlabError):  # and no other error
        assert label_table(read_label_columns(path), LabelScale()).given


@settings(max_examples=60, deadline=None)
@given(data=st.data(), people=st.integers(1, 4), rollouts=st.integers(1, 3))
def test_every_value_comes_back_where_it_was(data, people, rollouts, tmp_path_factory):
    finite = st.floats(-2.5, 2.5)
    rows = []
    for person in range(people):
        for rollout in range(rollouts):
            steps = data.draw(st.sets(st.integers(0, 12), min_size=2, max_size=8))
            rows += [
                (f"p{person}", f"r{rollout}", s, data.draw(finite), data.draw(finite))
                for s in sorted(steps)
            ]
    shuffled = data.draw(st.permutations(rows))
    columns = dict(zip(_table(), map(list, zip(*shuffled, strict=True)), strict=True))
    table = _read(tmp_path_factory.mktemp("rows"), columns)
    back = [
        (g.series.person, g.series.rollout, int(step), g.series.label[row], g.series.truth[row])
        for g in table.given
        for step, row in zip(g.steps, g.rows, strict=True)
    ]
    assert back == rows
    assert sum(int(g.series.valid.sum()) for g in table.given) == len(rows)
