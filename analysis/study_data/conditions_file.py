"""Outcomes of conditions, from a table or from the folder of a ``steerlab teach`` run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pv
import pyarrow.parquet as pq

from steerlab.analysis.study_data.records import ConditionValue, Exclusion, NotAStudy
from steerlab.analysis.study_data.teach_shard import TeachShard, read_teach_shard
from steerlab.sim.errors import InvalidConfig, shown
from steerlab.sim.files.reading import reading

METRICS = ("success", "final_distance_m", "label_mae")
_KEYS = ("participant", "condition", "round")
_EXAMPLE = f"{', '.join(_KEYS)} and one or more of {', '.join(METRICS)}"


def read_conditions(path: Path) -> tuple[ConditionValue, ...]:
    """A .csv or .parquet table, or the folder of a ``steerlab teach`` run.

    A table has a row for each participant, condition and round; empty cells are missing. A column
    ``position`` may give the condition's place in the participant's order, from 0.

    Raises:
        NotAStudy: it is neither, a column is missing, or a value is not allowed.
    """
    if path.is_dir():
        return _of_shards(path)
    remedy = f"Give a .csv or .parquet table with {_EXAMPLE}."
    with reading(path, "a table of outcomes", NotAStudy, remedy):
        parquet = path.suffix.lower() == ".parquet"
        return _of_table(pq.read_table(path) if parquet else pv.read_csv(path), path)


def left_out_teachers(path: Path) -> tuple[Exclusion, ...]:
    """Teachers of a ``steerlab teach`` run who could not be judged, and why; none for a table."""
    shards = [_shard(file) for file in sorted((path / "teachers").glob("*.json"))]
    return tuple(
        Exclusion(what="teacher", who=shard.teacher, why=shard.left_out[0].why)
        for shard in shards
        if shard.left_out
    )


def _of_table(table: pa.Table, path: Path) -> tuple[ConditionValue, ...]:
    names = table.column_names
    metrics = [name for name in METRICS if name in names]
    if missing := [name for name in _KEYS if name not in names]:
        raise NotAStudy(f"{path} lacks {', '.join(missing)}; it needs {_EXAMPLE}.")
    if not metrics:
        raise NotAStudy(f"{path} has {shown(names)}; it needs {_EXAMPLE}.")
    values: list[ConditionValue] = []
    seen: set[tuple[str, str, int]] = set()
    for line, row in enumerate(table.to_pylist(), start=2):
        where = f"{path}, row {line}"
        key = (_text(row, "participant", where), _text(row, "condition", where))
        round_ = _whole(row["round"], "round", where)
        if (*key, round_) in seen:
            raise NotAStudy(
                f"{where}: {shown(key[0])} has {shown(key[1])} in round {round_} twice."
            )
        seen.add((*key, round_))
        position = row.get("position")
        for metric in metrics:
            if row[metric] is None:
                continue
            values.append(
                ConditionValue(
                    person=key[0],
                    condition=key[1],
                    metric=metric,
                    value=_number(row[metric], metric, where),
                    round=round_,
                    position=None if position is None else _whole(position, "position", where),
                )
            )
    return tuple(values)


def _of_shards(folder: Path) -> tuple[ConditionValue, ...]:
    """Each teacher's figures, averaged over learner seeds; who was left out is not there."""
    paths = sorted((folder / "teachers").glob("*.json"))
    if not paths:
        raise NotAStudy(
            f"{folder} has no teachers/*.json; give the folder of a steerlab teach run, or a .csv "
            f"or .parquet table with {_EXAMPLE}."
        )
    return tuple(value for path in paths for value in _of_shard(_shard(path)))


def _shard(path: Path) -> TeachShard:
    try:
        return read_teach_shard(path)[0]
    except InvalidConfig as error:
        raise NotAStudy(f"{path} is no shard of steerlab teach: {error}") from error


def _of_shard(shard: TeachShard) -> list[ConditionValue]:
    if shard.left_out:
        return []
    outcomes: list[ConditionValue] = []
    for condition, seeds in shard.conditions.items():
        for rows in zip(*(taught.by_round for taught in seeds.values()), strict=True):
            for metric in METRICS:
                values = [getattr(row, metric) for row in rows]
                known = [value for value in values if value is not None]
                if known:
                    outcomes.append(
                        ConditionValue(
                            person=shard.teacher,
                            condition=condition,
                            metric=metric,
                            value=float(np.mean(known)),
                            round=rows[0].round,
                        )
                    )
    return outcomes


def _text(row: Mapping[str, Any], name: str, where: str) -> str:
    value = row[name]
    if value is None or not str(value).strip():
        raise NotAStudy(f"{where}: {name} is empty; every row needs one.")
    return str(value)


def _whole(value: Any, name: str, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise NotAStudy(f"{where}: {name} is {shown(value)}; it must be a whole number from 0.")
    return value


def _number(value: Any, name: str, where: str) -> float:
    if isinstance(value, bool):
        return float(value)
    if not isinstance(value, int | float) or not np.isfinite(value):
        raise NotAStudy(f"{where}: {name} is {shown(value)}; it must be a finite number, or empty.")
    if name == "success" and not 0.0 <= value <= 1.0:
        raise NotAStudy(f"{where}: success is {value}; it must be from 0 to 1.")
    return float(value)
