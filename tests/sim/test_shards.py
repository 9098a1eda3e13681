"""Parquet shards: round trips, equal bytes, and what damaged or foreign files say."""

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steerlab.sim.records import LABELLED_STEP_SCHEMA, InvalidRecord, table_from_columns
from steerlab.sim.shards import check_labels, read_shards, write_shard


def labels(participant: str = "P01", rows: int = 6, seed: int = 0) -> pa.Table:
    rng = np.random.default_rng(seed)
    columns: dict[str, object] = {
        field.name: rng.normal(size=rows)
        for field in LABELLED_STEP_SCHEMA
        if pa.types.is_floating(field.type)
    }
    columns |= {
        "participant": [participant] * rows,
        "rollout": ["calibration-00"] * rows,
        "attempt": np.zeros(rows, dtype=np.int32),
        "step": np.arange(rows, dtype=np.int32),
        "gate": ["robot"] * rows,
        "label_valid": [True] * rows,
    }
    columns["teacher_label"] = [None if i % 3 == 1 else float(i) for i in range(rows)]
    return table_from_columns(columns)


def with_column(table: pa.Table, name: str, values: object, kind: pa.DataType) -> pa.Table:
    field = pa.field(name, kind)
    return table.set_column(table.schema.get_field_index(name), field, pa.array(values, kind))


@given(
    people=st.lists(
        st.text(min_size=1, max_size=8).filter(lambda text: text.isprintable()),
        min_size=1,
        max_size=4,
        unique=True,
    ),
    number=st.floats(allow_nan=False, allow_infinity=False),
)
@settings(max_examples=25)
def test_round_trip_in_the_order_of_file_names(
    tmp_path_factory: pytest.TempPathFactory, people: list[str], number: float
):
    folder = tmp_path_factory.mktemp("shards")
    tables = [
        with_column(labels(person, seed=i), "x_m", [number] * 6, pa.float64())
        for i, person in enumerate(people)
    ]
    for i in reversed(range(len(people))):  # written in another order than they are read
        write_shard(tables[i], folder / f"shard-{i:03}.parquet")
    back = read_shards(folder)
    assert back.schema.equals(LABELLED_STEP_SCHEMA, check_metadata=True)
    wanted = pa.concat_tables([table.cast(LABELLED_STEP_SCHEMA) for table in tables])
    assert back.equals(wanted)


def test_equal_rows_give_equal_bytes_however_they_are_chunked(tmp_path: Path):
    whole = labels(rows=100)
    chunked = pa.concat_tables([whole.slice(0, 33), whole.slice(33, 1), whole.slice(34)])
    write_shard(whole, tmp_path / "a.parquet")
    write_shard(chunked, tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_an_empty_table_is_a_shard_too(tmp_path: Path):
    write_shard(labels(rows=0), tmp_path / "none.parquet")
    assert read_shards(tmp_path).num_rows == 0


def test_a_shard_replaces_its_older_self_and_leaves_no_part(tmp_path: Path):
    write_shard(labels(seed=1), tmp_path / "a.parquet")
    write_shard(labels(seed=2), tmp_path / "a.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["a.parquet"]
    assert read_shards(tmp_path).equals(labels(seed=2))


def test_a_failed_write_keeps_the_old_shard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_shard(labels(seed=1), tmp_path / "a.parquet")

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(InvalidRecord, match=r"Cannot write .*No space left on device"):
        write_shard(labels(seed=2), tmp_path / "a.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["a.parquet"]
    assert read_shards(tmp_path).equals(labels(seed=1))


def test_a_shard_from_another_system_may_end_in_capitals(tmp_path: Path):
    write_shard(labels(), tmp_path / "a.parquet")
    (tmp_path / "a.parquet").rename(tmp_path / "A.PARQUET")
    assert read_shards(tmp_path).num_rows == 6


def test_a_part_of_a_killed_run_is_not_read(tmp_path: Path):
    write_shard(labels(), tmp_path / "a.parquet")
    (tmp_path / ".a-x1y2.part").write_bytes(b"PAR1 half a file")
    assert read_shards(tmp_path).num_rows == 6


def test_a_missing_folder_or_a_wrong_name_is_told(tmp_path: Path):
    with pytest.raises(InvalidRecord, match="not a folder"):
        read_shards(tmp_path / "nowhere")
    with pytest.raises(InvalidRecord, match=r"holds no \*\.parquet"):
        read_shards(tmp_path)
    with pytest.raises(InvalidRecord, match="check that the folder exists"):
        write_shard(labels(), tmp_path / "nowhere" / "a.parquet")
    with pytest.raises(InvalidRecord, match=r"name it a\.parquet"):
        write_shard(labels(), tmp_path / "a.csv")


@pytest.mark.parametrize("keep", [0, 3, 200, -1])
def test_a_truncated_shard_is_named(tmp_path: Path, keep: int):
    path = tmp_path / "a.parquet"
    write_shard(labels(), path)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InvalidRecord, match=r"a\.parquet cannot be read as a Parquet file"):
        read_shards(tmp_path)


def test_a_damaged_page_is_told(tmp_path: Path):
    path = tmp_path / "a.parquet"
    write_shard(labels(rows=2000), path)
    damaged = bytearray(path.read_bytes())
    damaged[60:600] = bytes(540)
    path.write_bytes(damaged)
    with pytest.raises(InvalidRecord, match="cannot be read as a Parquet file"):
        read_shards(tmp_path)


def test_a_newer_schema_asks_for_an_upgrade(tmp_path: Path):
    newer = labels().replace_schema_metadata({"steerlab.schema_version": "2"})
    pq.write_table(newer, tmp_path / "a.parquet")
    with pytest.raises(InvalidRecord, match=r"schema '2'.*upgrade steerlab"):
        read_shards(tmp_path)


def test_one_attempt_in_two_shards_is_refused(tmp_path: Path):
    write_shard(labels(), tmp_path / "a.parquet")
    write_shard(labels(seed=1), tmp_path / "b.parquet")
    with pytest.raises(InvalidRecord, match=r"'P01' .* both a\.parquet and b\.parquet"):
        read_shards(tmp_path)


def test_a_table_of_another_schema_says_how_it_differs():
    table = labels()
    with pytest.raises(InvalidRecord, match=r"mine: .*missing \['gate'\], unknown \[\]"):
        check_labels(table.drop_columns(["gate"]), "mine")
    with pytest.raises(InvalidRecord, match="order"):
        check_labels(table.select([*reversed(table.column_names)]), "mine")
    with pytest.raises(InvalidRecord, match="cast it to int32"):
        check_labels(with_column(table, "step", range(6), pa.int64()), "mine")
    with pytest.raises(InvalidRecord, match="'x_m' has 6 empty values"):
        check_labels(with_column(table, "x_m", [None] * 6, pa.float64()), "mine")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_nan_is_not_a_way_to_say_missing(tmp_path: Path, bad: float):
    table = with_column(labels(), "oracle_label", [None, bad, 0, 0, 0, 0], pa.float64())
    with pytest.raises(InvalidRecord, match="'oracle_label' holds NaN or infinite"):
        write_shard(table, tmp_path / "a.parquet")
