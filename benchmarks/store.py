"""How fast steps and shards are kept, beside the bare libraries doing the same in the same run."""

import sqlite3
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.sim.geometry import Pose2D
from steerlab.sim.records import COLUMNS, LABELLED_STEP_SCHEMA, Driver, LabelledStep, row_from_step
from steerlab.sim.shards import read_shards, write_shard
from steerlab.sim.world import WorldSpec
from steerlab.study.store.records import StoredRollout
from steerlab.study.store.store import StudyStore

STEPS = 4_000
TABLE_ROWS = 200_000
REPEATS = 5

APPEND_RATIO_LIMIT = 2.5  # validation, triggers and foreign keys on top of a bare WAL insert
APPEND_LIMIT_US = 500.0  # 1 % of a 20 Hz control step
SHARD_RATIO_LIMIT = 2.0  # checks and one fsync on top of bare pyarrow
READ_RATIO_LIMIT = 2.0


def _step(step: int) -> LabelledStep:
    return LabelledStep(
        participant="P01",
        rollout="r0",
        attempt=0,
        step=step,
        t_s=step / 20,
        x_m=step * 0.25,
        y_m=0.1,
        heading_rad=0.01,
        speed_mps=5.0,
        lateral_speed_mps=0.1,
        yaw_rate_radps=0.2,
        acceleration_x_mps2=0.3,
        acceleration_y_mps2=0.4,
        robot_wheel=0.5,
        teacher_label=0.6,
        oracle_label=0.7,
        executed_wheel=0.5,
        gate=Driver.ROBOT,
        label_valid=True,
    )


def _store_append_us(folder: Path, steps: list[LabelledStep]) -> float:
    world = WorldSpec(name="w", ball_xy_m=(9.0, 0.0), start=Pose2D(-9.0, 0.0, 0.0))
    rollout = StoredRollout(name="r0", world=world, control_hz=20.0, seed=0, steps=len(steps))
    with StudyStore.create(folder / "study.db") as store:
        store.add_participant("P01", "seen")
        store.add_rollout(rollout)
        attempt = store.begin_attempt("P01", "r0")
        began = perf_counter()
        for step in steps:
            store.append(step)
        took_s = perf_counter() - began
        store.finish_attempt(attempt)
    return took_s / len(steps) * 1e6


def _bare_insert_us(folder: Path, steps: list[LabelledStep]) -> float:
    rows = [tuple(row_from_step(step).values()) for step in steps]
    connection = sqlite3.connect(folder / "bare.db", isolation_level=None)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    connection.execute(f"CREATE TABLE steps ({', '.join(COLUMNS)})")
    insert = f"INSERT INTO steps VALUES ({', '.join('?' * len(COLUMNS))})"
    began = perf_counter()
    for row in rows:
        connection.execute(insert, row)
    took_s = perf_counter() - began
    connection.close()
    return took_s / len(steps) * 1e6


def _labels(rows: int, rng: np.random.Generator) -> pa.Table:
    columns: dict[str, Any] = {
        field.name: rng.normal(size=rows)
        for field in LABELLED_STEP_SCHEMA
        if pa.types.is_floating(field.type)
    }
    columns |= {
        "participant": [f"P{i * 34 // rows:02}" for i in range(rows)],
        "rollout": ["r0"] * rows,
        "attempt": np.zeros(rows, dtype=np.int32),
        "step": np.arange(rows, dtype=np.int32),
        "gate": ["robot"] * rows,
        "label_valid": np.ones(rows, dtype=bool),
    }
    arrays = [pa.array(columns[field.name], field.type) for field in LABELLED_STEP_SCHEMA]
    return pa.Table.from_arrays(arrays, schema=LABELLED_STEP_SCHEMA)


def _shard_seconds(folder: Path, labels: pa.Table) -> tuple[float, float, float, float]:
    shard, bare = folder / "shard.parquet", folder / "bare" / "bare.parquet"
    bare.parent.mkdir()
    began = perf_counter()
    write_shard(labels, shard)
    wrote = perf_counter()
    pq.write_table(labels, bare, compression="zstd")
    wrote_bare = perf_counter()
    read_shards(folder)
    read = perf_counter()
    pq.read_table(bare)
    return wrote - began, wrote_bare - wrote, read - wrote_bare, perf_counter() - read


def run() -> list[Row]:
    """Medians of a few interleaved repeats, so that a busy machine slows both sides alike."""
    steps = [_step(i) for i in range(STEPS)]
    labels = _labels(TABLE_ROWS, np.random.default_rng(0))
    appends: list[tuple[float, float]] = []
    shards: list[tuple[float, float, float, float]] = []
    for _ in range(REPEATS):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            appends.append((_store_append_us(folder, steps), _bare_insert_us(folder, steps)))
            shards.append(_shard_seconds(folder, labels))
    append_us = median(ours for ours, _ in appends)
    write_mb_per_s = labels.nbytes / 1e6 / median(write for write, *_ in shards)
    return [
        at_most("store.append", append_us, APPEND_LIMIT_US, "µs"),
        at_most(
            "store.append / bare sqlite3 insert",
            median(ours / bare for ours, bare in appends),
            APPEND_RATIO_LIMIT,
            "x",
        ),
        at_least("write_shard", write_mb_per_s, 20.0, "MB/s"),
        at_most(
            "write_shard / bare pyarrow write",
            median(ours / bare for ours, bare, _, _ in shards),
            SHARD_RATIO_LIMIT,
            "x",
        ),
        at_most(
            "read_shards / bare pyarrow read",
            median(ours / bare for _, _, ours, bare in shards),
            READ_RATIO_LIMIT,
            "x",
        ),
    ]


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
