"""Labels as Parquet shards: what population runs write, and every learner and analysis reads."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from steerlab.sim.errors import shown
from steerlab.sim.files.by_suffix import files_with
from steerlab.sim.files.reading import reading
from steerlab.sim.files.refusal import refusal
from steerlab.sim.files.whole_file import whole_file
from steerlab.sim.records import LABELLED_STEP_SCHEMA, SCHEMA_VERSION, InvalidRecord

ROWS_PER_GROUP = 65_536
_VERSION_KEY = b"steerlab.schema_version"


def write_shard(table: pa.Table, path: Path) -> None:
    """Write ``table`` as one zstd Parquet file: complete under its name, or not there at all.

    Equal rows give equal bytes (with one version of pyarrow), however the table is chunked.

    Raises:
        InvalidRecord: the table is not of ``LABELLED_STEP_SCHEMA``, or ``path`` cannot be written.
    """
    if path.suffix != ".parquet":
        raise InvalidRecord(f"{path} would not be read back; name it {path.stem}.parquet.")
    labels = check_labels(table, path.name).combine_chunks()
    try:
        with whole_file(path) as part:  # it does not end in .parquet: read_shards never sees it
            pq.write_table(labels, part, compression="zstd", row_group_size=ROWS_PER_GROUP)
    except OSError as error:
        raise InvalidRecord(
            f"Cannot write {path}: {refusal(error, 'check that the folder exists and is writable')}."
        ) from error


def read_shards(folder: Path) -> pa.Table:
    """All ``*.parquet`` files of a folder as one table of ``LABELLED_STEP_SCHEMA``.

    Rows come in the files' own order, files in the order of their names.

    Raises:
        InvalidRecord: no shard is there, one is damaged or of another schema, or two hold the
            same attempt.
    """
    if not folder.is_dir():
        raise InvalidRecord(f"{folder} is not a folder; give the folder that holds the shards.")
    paths = files_with(folder, ".parquet")
    if not paths:
        raise InvalidRecord(f"{folder} holds no *.parquet file; was the run finished?")
    shards: list[pa.Table] = []
    found_in: dict[tuple[str, str, int], str] = {}
    for path in paths:
        shard = _read_shard(path)
        for attempt in _attempts(shard):
            if attempt in found_in:
                participant, rollout, number = attempt
                raise InvalidRecord(
                    f"Attempt {number} of {participant!r} at {rollout!r} is in both "
                    f"{found_in[attempt]} and {path.name}; remove one of them from {folder}."
                )
            found_in[attempt] = path.name
        shards.append(shard)
    return pa.concat_tables(shards)


def check_labels(table: pa.Table, source: str) -> pa.Table:
    """``table`` under ``LABELLED_STEP_SCHEMA`` itself, if its columns and values fit.

    Raises:
        InvalidRecord: a column is missing, unknown, misplaced or of another type; a required
            value is null; a number is NaN or infinite.
    """
    wanted, names = LABELLED_STEP_SCHEMA.names, table.schema.names
    if names != wanted:
        missing = [name for name in wanted if name not in names]
        unknown = [name for name in names if name not in wanted]
        what = f"missing {missing}, unknown {unknown}" if missing or unknown else f"order {names}"
        raise InvalidRecord(f"{source}: columns are not those of a label table: {what}.")
    for field in LABELLED_STEP_SCHEMA:
        column = table.column(field.name)
        if column.type != field.type:
            raise InvalidRecord(
                f"{source}: column {field.name!r} is {column.type}; cast it to {field.type}."
            )
        if column.null_count and not field.nullable:
            raise InvalidRecord(
                f"{source}: column {field.name!r} has {column.null_count} empty values; "
                f"only teacher_label and oracle_label may be empty."
            )
        if pa.types.is_floating(field.type) and not _all_finite(column):
            raise InvalidRecord(
                f"{source}: column {field.name!r} holds NaN or infinite values; "
                f"a missing label is null, and nothing else may be missing."
            )
    return pa.Table.from_arrays(table.columns, schema=LABELLED_STEP_SCHEMA)


def _all_finite(column: pa.ChunkedArray) -> bool:
    return bool(np.isfinite(column.drop_null().to_numpy()).all())


def _read_shard(path: Path) -> pa.Table:
    with reading(path, "a Parquet file", InvalidRecord, "Delete it and run its share again."):
        with pq.ParquetFile(path) as shard:
            table = shard.read()
        table.validate(full=True)  # texts are UTF-8, among other things
        version = (table.schema.metadata or {}).get(_VERSION_KEY, b"").decode(errors="replace")
        if version.isdecimal() and int(version) > SCHEMA_VERSION:
            raise InvalidRecord(
                f"{path} has label schema {shown(version)}, this steerlab reads up to "
                f"{SCHEMA_VERSION}; upgrade steerlab."
            )
        return check_labels(table, str(path))


def _attempts(shard: pa.Table) -> list[tuple[str, str, int]]:
    keys = ["participant", "rollout", "attempt"]
    distinct = shard.group_by(keys, use_threads=False).aggregate([])
    return list(zip(*(distinct.column(key).to_pylist() for key in keys), strict=True))
