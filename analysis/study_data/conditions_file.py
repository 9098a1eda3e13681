"""Outcomes of conditions, from a table or from the folder of a ``steerlab teach`` run."""

from pathlib import Path

import numpy as np

from steerlab.analysis.study_data.records import ConditionValue, Exclusion, NotAStudy
from steerlab.analysis.study_data.teach_shard import TeachShard, read_teach_shard
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig, shown
from steerlab.sim.files.by_suffix import files_with
from steerlab.sim.files.reading import reading
from steerlab.sim.files.table_file import TableFile, read_table_file

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
    what, remedy = "a table of outcomes", f"Give a .csv or .parquet table with {_EXAMPLE}."
    file = read_table_file(
        path,
        what=what,
        error=NotAStudy,
        remedy=remedy,
        text=("participant", "condition"),
        known=(*_KEYS, *METRICS, "position"),
    )
    with reading(path, what, NotAStudy, remedy):
        return _of_table(file)


def left_out_teachers(path: Path) -> tuple[Exclusion, ...]:
    """Teachers of a ``steerlab teach`` run who could not be judged, and why; none for a table."""
    shards = [_shard(file) for file in files_with(path / "teachers", ".json")]
    return tuple(
        Exclusion(what="teacher", who=shard.teacher, why=shard.left_out[0].why)
        for shard in shards
        if shard.left_out
    )


def _of_table(file: TableFile) -> tuple[ConditionValue, ...]:
    names, path = file.columns, file.path
    metrics = {name: _metric(file, name) for name in METRICS if name in names}
    if missing := [name for name in _KEYS if name not in names]:
        raise NotAStudy(f"{path} lacks {', '.join(missing)}; it needs {_EXAMPLE}.")
    if not metrics:
        raise NotAStudy(f"{path} has {shown(names)}; it needs {_EXAMPLE}.")
    if file.table.num_rows == 0:
        return ()
    people, person = file.names("participant")
    conditions, condition = file.names("condition")
    rounds = file.whole("round")
    if (rounds < 0).any():
        row = int(np.argmax(rounds < 0))
        raise file.wrong(row, "round", int(rounds[row]), "it must be a whole number from 0")
    positions = _positions(file) if "position" in names else np.full(len(rounds), np.nan)
    values: list[ConditionValue] = []
    seen: set[tuple[str, str, int]] = set()
    for row, round_ in enumerate(rounds.tolist()):
        key = (people[person[row]], conditions[condition[row]], round_)
        if key in seen:
            raise NotAStudy(
                f"{file.place(row)}: {shown(key[0])} has {shown(key[1])} in round {round_} twice."
            )
        seen.add(key)
        values += [
            ConditionValue(
                person=key[0],
                condition=key[1],
                metric=metric,
                value=float(of_metric[row]),
                round=round_,
                position=None if np.isnan(positions[row]) else int(positions[row]),
            )
            for metric, of_metric in metrics.items()
            if not np.isnan(of_metric[row])
        ]
    return tuple(values)


def _metric(file: TableFile, name: str) -> FloatArray:
    """(rows,) NaN where the cell is empty; truth values are 0 and 1."""
    values = file.numbers(name, truth_values=True)
    if np.isinf(values).any():
        row = int(np.argmax(np.isinf(values)))
        raise file.wrong(row, name, float(values[row]), "it must be a finite number, or empty")
    outside = (values < 0.0) | (values > 1.0)  # False for NaN
    if name == "success" and outside.any():
        row = int(np.argmax(outside))
        raise file.wrong(row, name, float(values[row]), "it must be from 0 to 1")
    return values


def _positions(file: TableFile) -> FloatArray:
    """(rows,) NaN where the cell is empty."""
    values = file.numbers("position")
    wrong = ~np.isnan(values) & ((values < 0.0) | (values != np.round(values)) | np.isinf(values))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise file.wrong(row, "position", float(values[row]), "it must be a whole number from 0")
    return values


def _of_shards(folder: Path) -> tuple[ConditionValue, ...]:
    """Each teacher's figures, averaged over learner seeds; who was left out is not there."""
    paths = files_with(folder / "teachers", ".json")
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
