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
        (_changed(label="left"), "row 1: label is 'left'; it must be a number"),
        (_changed(step=0.5), "row 1: step is 0.5; it must be a whole number"),
        (_changed(step=0), "has step 0 twice"),
        (_changed(step=[*range(0, 30000, 1000)]), "step must count control steps"),
        (_changed(person=None), "row 1: person is empty; every row needs a name"),
        (_changed(rollout=" "), "row 1: rollout is ' '; every row needs a name"),
        (_changed(label=None), "nothing to learn from"),
        (_changed(truth=float("nan")), "nothing to learn from"),
        (_changed(truth=float("inf")), "truth is infinite"),
        (_changed(label=3.5), "outside ±2.5"),
        (_changed(split="test"), "row 1: split is 'test'; it may be train, heldout"),
        (_changed(split=["train", "heldout"] * 15), "is in two splits"),
        (_changed(t_s=1.0), "not evenly spaced"),
        (_changed(t_s=[0.0, 0.1, 0.2, 0.9, 1.0] * 6), "not evenly spaced"),
        (_changed(t_s=None), "row 1: t_s is empty; it must be finite"),
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
        (
            "labels.csv",
            b"person,rollout\np,r,1\n",
            "line 2 has 3 cells, and the first line, which names the columns, 2: 'p,r,1'",
        ),
        ("labels.csv", b"person;rollout;step;label;truth\np;r;0;1;1\n", "by semicolons"),
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


HEADING = "person,rollout,step,label,truth"


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("label", ".", "label is '.'; it must be a number"),
        ("label", "#DIV/0!", "label is '#DIV/0!'"),
        ("truth", '"1,234.5"', "truth is '1,234.5'; it must be a number with a decimal point"),
        ("label", '"0,5"', "label is '0,5'"),
        ("label", "true", "label is 'true'"),
        ("label", "2024-05-01", "label is '2024-05-01'"),
        ("label", "inf", "label is infinite"),
        ("label", "-3.5", "label -3.5 is outside"),
        ("step", "", "step is empty; it must be a whole number"),
        ("step", "9007199254740993", "step is 9007199254740993; it must be within ±2^53"),
        ("step", "1e300", "step is 1e+300"),
        ("step", "1.5", "step is 1.5"),
        ("person", "", "person is empty; every row needs a name"),
        ("person", "\u200b", "every row needs a name"),
        ("label_valid", "", "label_valid is empty; it must be true or false"),
        ("label_valid", "yes", "label_valid is 'yes'; it must be true or false"),
        ("split", "Train", "split is 'Train'; it may be train"),
        ("t_s", "", "t_s is empty; it must be finite"),
        ("t_s", "9.0", "goes from 0.3 at step 3 to 9 at step 4, and mostly by 0.1 a step"),
    ],
)
@pytest.mark.parametrize("attempts", [False, True])
def test_the_line_and_the_value_that_does_not_fit_are_named(
    attempts, column, value, said, tmp_path
):
    """Step 4 is on line 8: a blank line and a line break in quotes come before it."""
    rows = [
        {
            "person": "p",
            "rollout": "r1",
            "attempt": "1",
            "step": str(step),
            "t_s": f"0.{step}",
            "label": "0.25",
            "truth": "0.5",
            "split": "train",
            "label_valid": "true",
        }
        for step in range(8)
    ]
    rows[1]["note"] = '"two\nlines"'
    rows[4][column] = value
    if attempts:  # rows are dropped before
        rows[0]["attempt"] = "0"
    else:
        for row in rows:
            del row["attempt"]
    names = [*rows[0], "note"]
    lines = [",".join(row.get(name, "x") for name in names) for row in rows]
    text = "\n".join([",".join(names), "", *lines]) + "\n"
    with pytest.raises(InvalidLabels) as refused:
        _read_csv(tmp_path, text)
    assert "labels.csv, line 8" in str(refused.value)
    assert said in str(refused.value)


def test_an_infinite_value_is_named_and_no_other(tmp_path):
    columns = _changed(label=[3.0, float("-inf"), *[0.1] * 28])
    with pytest.raises(InvalidLabels, match=r"row 2 .*label is infinite"):
        _read(tmp_path, columns)


def test_the_second_of_two_equal_steps_is_named(tmp_path):
    columns = _table(1, 1, 5)
    columns["step"] = [0, 1, 2, 3, 1]
    with pytest.raises(InvalidLabels, match="row 5: 'p0' on 'r0' has step 1 twice"):
        _read(tmp_path, columns)


ALIKE = [
    ("drive1", "drive1 "),
    ("drive1", " drive1"),
    ("drive1", "Drive1"),
    ("drive 1", "drive\u00a01"),
    ("drive 1", "drive1"),
    ("drive1", "dri\u200bve1"),
    ("drive1", "drive\uff11"),
    ("dr\u00edve", "dri\u0301ve"),
    ("Stra\u00dfe", "STRASSE"),
]


@pytest.mark.parametrize("column", ["person", "rollout"])
@pytest.mark.parametrize(("one", "other"), ALIKE)
def test_names_that_look_like_one_are_refused(one, other, column, tmp_path):
    columns = _table(2, 2, 5)
    columns[column] = [one] * 10 + [other] * 10
    columns["step"] = list(range(20))
    for read in (lambda: _read(tmp_path, columns), lambda: _as_csv(tmp_path, columns)):
        with pytest.raises(InvalidLabels, match=f"{column}s .* differ only by blanks") as refused:
            read()
        shown = str(refused.value).split(f"{column}s ")[1].split(" differ")[0].split(" and ")
        assert len(set(shown)) == 2  # and one can see the difference
        assert "row 11" in str(refused.value) or "line 12" in str(refused.value)


def _as_csv(path: Path, columns: dict[str, list]) -> LabelTable:
    pyarrow.csv.write_csv(pa.table(columns), path / "labels.csv")
    return label_table(read_label_columns(path / "labels.csv"), LabelScale())


@pytest.mark.parametrize("name", ["label_valid ", "Split", "\u00a0attempt", "Step"])
def test_a_column_that_only_looks_known_is_refused(name, tmp_path):
    """It would be taken for another one, and its labels for valid."""
    columns = _table()
    columns[name] = [1] * 30
    with pytest.raises(InvalidLabels, match=r"columns .* differ only by blanks.*; call it"):
        _read(tmp_path, columns)


@pytest.mark.parametrize("ending", ["CSV", "Csv", "PARQUET"])
def test_endings_may_be_in_capitals(ending, tmp_path):
    path = tmp_path / f"LABELS.{ending}"
    if ending == "PARQUET":
        pq.write_table(pa.table(_table()), path)
    else:
        pyarrow.csv.write_csv(pa.table(_table()), path)
    assert len(label_table(read_label_columns(path), LabelScale()).given) == 6


@pytest.mark.parametrize("megabytes", [0.9, 1.2, 2.5])
def test_line_breaks_in_quotes_are_read_in_files_of_any_size(megabytes, tmp_path):
    """And a column is what the whole of it is: whole numbers first, others after a megabyte."""
    rows = int(megabytes * 2**20 / 60)
    lines = [
        f'p,r,{step},{0 if step < rows - 5 else 0.5},0,"a note\n of two lines, and some words"\n'
        for step in range(rows)
    ]
    given = _read_csv(tmp_path, "".join([f"{HEADING},note\n", *lines])).given
    assert given[0].series.steps == rows
    assert given[0].series.label[-1] == 0.5


def test_binary_names_and_dictionaries_are_what_they_hold(tmp_path):
    columns = _table()
    table = pa.table(columns)
    binary = pa.array([name.encode() for name in columns["person"]], pa.binary())
    packed = table.set_column(0, "person", binary)
    packed = packed.set_column(3, "label", table["label"].dictionary_encode())
    packed = packed.set_column(1, "rollout", table["rollout"].dictionary_encode())
    for one, other in zip(_read(tmp_path, table).given, _read(tmp_path, packed).given, strict=True):
        assert (one.series.person, one.series.rollout) == (other.series.person, one.series.rollout)
        np.testing.assert_array_equal(one.series.label, other.series.label)
    broken = packed.set_column(0, "person", pa.array([b"p"] * 29 + [b"\xff"], pa.binary()))
    with pytest.raises(InvalidLabels, match=r"row 30: person is b'\\xff'; it must be UTF-8"):
        _read(tmp_path, broken)


def test_what_is_stored_as_something_else_is_said(tmp_path):
    def refused(name: str, values: pa.Array) -> str:
        table = pa.table(_table())
        index = table.column_names.index(name)
        with pytest.raises(InvalidLabels) as error:
            _read(tmp_path, table.set_column(index, name, values))
        return str(error.value)

    numbers = pa.array(range(2**53 + 1, 2**53 + 31), pa.int64())
    assert "row 1: label is 9007199254740993; it must be within ±2^53" in refused("label", numbers)
    times = numbers.cast(pa.timestamp("ns"))
    assert "row 1: truth is '1970-04-15 05:59:59.254740993'" in refused("truth", times)
    texts = pa.array(["0.5"] * 30)
    assert "column label holds string such as '0.5'; store it as numbers" in refused("label", texts)
    lists = pa.array([[0.5]] * 30)
    assert "column label is list<" in refused("label", lists)
    nowhere = pa.array([1.0] * 29 + [float("nan")])
    assert "row 30: person is empty" in refused("person", nowhere)


def test_context_that_cannot_be_kept_exactly_is_left_out(tmp_path):
    columns = _table() | {"stamp_ns": [1_700_000_000_000_000_001 + i for i in range(30)]}
    table = _read(tmp_path, columns)
    assert table.given[0].series.context_names == ()
    (notice,) = table.notices
    assert "Column stamp_ns was left out" in notice
    assert "2^53" in notice


ROW = "p,r,0,0.5,1\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (f"{HEADING},Gr\u00f6\u00dfe\n".encode("cp1252"), "line 1 is not UTF-8: byte 0xf6 after"),
        (f"{HEADING}\n{ROW}J\u00f6rg,r,1,0,1\n".encode("cp1252"), "line 3 is not UTF-8: byte 0xf6"),
        (f"{HEADING}\n{ROW}".encode("utf-16"), "is UTF-16 text"),
        (f"{HEADING}\n{ROW}".encode("utf-16-be"), "zero bytes, so it is damaged, or UTF-16"),
        (f"{HEADING}\n{ROW}".replace(",", ";").encode(), "separates its columns by semicolons"),
        (f"{HEADING}\n{ROW}".replace(",", "\t").encode(), "separates its columns by tabs"),
        (f"sep=;\n{HEADING}\n{ROW}".encode(), "begins with 'sep=;', which only Excel reads"),
        (f"\ufeffsep=,\n{HEADING}\n".encode(), "begins with 'sep=,'"),
        (f"# made by us\n{HEADING}\n".encode(), "Comment lines are not read: delete them"),
        (
            f"{HEADING}\n{ROW}# a break\n{ROW}".encode(),
            "line 3 has 1 cells, and the first line, which names the columns, 5: '# a break'",
        ),
        (
            f"{HEADING}\n{ROW}p,r,1,0,5,1\n".encode(),
            "line 3 has 6 cells, and the first line, which names the columns, 5: 'p,r,1,0,5,1'",
        ),
        (b"PK\x03\x04 a workbook", "is a zip archive, as Excel's workbooks are"),
        (b"PAR1 a table", "is a Parquet file under another ending"),
    ],
)
def test_what_another_program_wrote_is_told_with_its_cause(content, said, tmp_path):
    (tmp_path / "labels.csv").write_bytes(content)
    with pytest.raises(InvalidLabels) as refused:
        read_label_columns(tmp_path / "labels.csv")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_byte_order_mark_and_other_line_ends_are_read(tmp_path):
    path = tmp_path / "labels.csv"
    for end in ("\n", "\r\n", "\r"):
        path.write_bytes("\ufeff".encode() + f"{HEADING}\n{ROW}".replace("\n", end).encode())
        assert len(label_table(read_label_columns(path), LabelScale()).given) == 1


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
