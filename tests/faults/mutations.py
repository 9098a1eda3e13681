"""Damage to files, drawn from a seed: of bytes, of plain values, of tables, of databases."""

import json
import random
import sqlite3
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

WORDS = (
    *(b"", b"0", b"-1", b"1e999", b"-1e999", b"nan", b"NaN", b"inf", b"1e23", b"9" * 400, b"1.5"),
    *(b"9007199254740993", b"99999999999999999999", b"true", b"null", b"None", b"''", b'""'),
    *(b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3", b"\xed\xa0\x80", b"\r\n", b"\n", b"'", b'"'),
    *(b"[" * 5000, b"{" * 5000, b'{"a":' * 3000, b"#DIV/0!", b'"1,234.5"', b".", b"P01 "),
    *(b"1979-05-27", b"2026-13-99T99:99:99", b"0x7fffffffffffffff", b"\xe2\x80\xae", b"../../x"),
)
VALUES = (
    *(None, True, False, 0, -1, 1, 2**31, 2**53 + 1, 2**63 - 1, 2**64, 10**23, 10**400),
    *(float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-320, 0.5, "", " ", "x", "\x00"),
    *("\ud800", "nan", "P01", "x" * 100_000, [], {}, [[]], {"": None}, [None], {"a": {"a": {}}}),
)


def damaged_bytes(data: bytes, rng: random.Random) -> bytes:
    """One to four changes of a file's bytes."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_BYTES)(data, rng)
    return data


def damaged_values(value: Any, rng: random.Random) -> Any:
    """A copy of plain values in which a node is changed, missing, doubled or named otherwise."""
    paths = list(_paths(value))
    path = rng.choice(paths)
    root = [json.loads(json.dumps(value))]
    parent, key = root, 0
    for step in path:
        parent, key = parent[key], step
    if parent is root or rng.random() < 0.7:
        parent[key] = rng.choice(VALUES)
    elif isinstance(parent, list) or rng.random() < 0.5:
        del parent[key]
    else:
        parent[str(rng.choice(("", key + "x", "a.b", "\n")))] = parent.pop(key)
    return root[0]


def damaged_json(data: bytes, rng: random.Random) -> bytes:
    """A JSON file with other values, as Python's own writer would spell them."""
    changed = data
    try:
        changed = json.dumps(damaged_values(json.loads(data), rng)).encode()
    except ValueError:  # damaged already, or a number of too many digits
        return damaged_bytes(data, rng)
    return changed


def damaged_tensors(data: bytes, rng: random.Random) -> bytes:
    """A safetensors file: numbers that are not finite, another header, other shapes and types."""
    if rng.random() < 0.3:
        return damaged_bytes(data, rng)
    (length,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + length]), bytearray(data[8 + length :])
    kind = rng.random()
    if kind < 0.4:
        bad = struct.pack("<f", rng.choice((float("nan"), float("inf"), -float("inf"), 3e38)))
        at = 4 * rng.randrange(max(1, len(body) // 4))
        body[at : at + 4] = bad
    elif kind < 0.8:
        ours = json.loads(header["__metadata__"]["steerlab"])
        header["__metadata__"]["steerlab"] = json.dumps(damaged_values(ours, rng))
    else:
        names = [name for name in header if name != "__metadata__"]
        header[rng.choice(names)] = damaged_values(header[rng.choice(names)], rng)
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + bytes(body)


def damage_parquet(path: Path, rng: random.Random) -> None:
    """A Parquet file in place: its bytes, or a column of another type, name or content."""
    if rng.random() < 0.3:
        path.write_bytes(damaged_bytes(path.read_bytes(), rng))
        return
    table = pq.read_table(path)
    index = rng.randrange(table.num_columns)
    name = table.column_names[index]
    rows = table.num_rows
    kind = rng.random()
    if kind < 0.15:
        table = table.remove_column(index)
    elif kind < 0.25:
        other = rng.choice((name + " ", name.upper(), rng.choice(table.column_names), ""))
        table = table.rename_columns([other if n == name else n for n in table.column_names])
    elif kind < 0.35:
        table = table.slice(0, rng.choice((0, 1, 2)))
    else:
        table = table.set_column(index, name, _column(rows, rng))
    pq.write_table(table, path)


def damage_database(path: Path, rng: random.Random) -> str:
    """A value of a column of a SQLite file becomes another, whatever its triggers say; tells where."""
    connection = sqlite3.connect(path, isolation_level=None)
    connection.text_factory = bytes
    try:
        connection.execute("PRAGMA writable_schema=ON")
        triggers = connection.execute("SELECT name, sql FROM sqlite_master WHERE type='trigger'")
        dropped = [(name.decode(), sql.decode()) for name, sql in triggers]
        for name, _ in dropped:
            connection.execute(f'DROP TRIGGER "{name}"')
        connection.execute("PRAGMA ignore_check_constraints=ON")
        tables = connection.execute("SELECT name FROM sqlite_master WHERE type='table'").fetchall()
        full = [
            name
            for (raw,) in tables
            if not (name := raw.decode()).startswith("sqlite_")
            and connection.execute(f'SELECT EXISTS(SELECT 1 FROM "{name}")').fetchone()[0]
        ]
        table = rng.choice(full)
        columns = [row[1].decode() for row in connection.execute(f'PRAGMA table_info("{table}")')]
        column = rng.choice(columns)
        value = rng.choice(_CELLS)
        (rows,) = connection.execute(f'SELECT count(*) FROM "{table}"').fetchone()
        old = f'(SELECT "{column}" FROM "{table}" LIMIT 1 OFFSET {rng.randrange(rows)})'
        # NOT NULL, a STRICT table's type or a unique key may stand in the way.
        with suppress(sqlite3.Error):
            connection.execute(
                f'UPDATE "{table}" SET "{column}"=? WHERE "{column}" IS {old}', (value,)
            )
        for _, sql in dropped:
            connection.execute(sql)
        return f"{table}.{column} = {value!r}"
    finally:
        connection.close()


_CELLS = (
    *(None, 0, -1, 2**62, 0.5, float("inf"), 1e308, "", "x", "\x00", "{}", "[]", "[" * 5000),
    *("9" * 400, b"", b"\xff", b"PAR1", "nan", "2026-13-99", '{"a": NaN}', "x" * 100_000),
)


def _column(rows: int, rng: random.Random) -> pa.Array:
    huge = [2**63 - 1 - i for i in range(rows)]
    return rng.choice(
        (
            lambda: pa.nulls(rows),
            lambda: pa.array([rng.choice((None, True, False)) for _ in range(rows)]),
            lambda: pa.array(
                [rng.choice(("", "x", "P01", "P01 ", "1", "nan")) for _ in range(rows)]
            ),
            lambda: pa.array([b"\xff\xfe"] * rows),
            lambda: pa.array(huge),
            lambda: pa.array(list(range(rows))).cast(pa.timestamp("ns")),
            lambda: pa.array([rng.choice((1e308, -1e308, float("nan"), 0.0)) for _ in range(rows)]),
            lambda: pa.array([float("inf")] * rows),
            lambda: pa.array([[1.0]] * rows),
            lambda: pa.array([{"a": 1}] * rows),
            lambda: pa.array(["a"] * rows).dictionary_encode(),
            lambda: pa.array([1] * rows).cast(pa.decimal128(38, 18)),
            lambda: pa.array([0] * rows, pa.uint64()),
            lambda: pa.array([0] * rows, pa.duration("us")),
            lambda: pa.array([0] * rows, pa.date32()),
            lambda: pa.array([0.5] * rows, pa.float16()),
        )
    )()


def _paths(value: Any, path: tuple[Any, ...] = ()):
    yield path
    children = value.items() if isinstance(value, dict) else ()
    children = enumerate(value[:40]) if isinstance(value, list) else children
    for key, child in children:
        yield from _paths(child, (*path, key))


def _flip(data: bytes, rng: random.Random) -> bytes:
    if not data:
        return b"\x00"
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    at, length = rng.randrange(len(data) + 1), rng.choice((1, 2, 8, 64, len(data)))
    return data[:at] + data[at + length :]


def _repeat(data: bytes, rng: random.Random) -> bytes:
    at, length = rng.randrange(len(data) + 1), rng.choice((1, 8, 64, 512))
    return data[: at + length] + data[at:]


def _insert(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(WORDS) + data[at:]


def _replace_token(data: bytes, rng: random.Random) -> bytes:
    """A number or word of a text becomes another."""
    at = rng.randrange(len(data) + 1)
    end = at
    while end < len(data) and (data[end : end + 1].isalnum() or data[end : end + 1] in b"+-._"):
        end += 1
    return data[:at] + rng.choice(WORDS) + data[max(end, at) :]


def _truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _zero(data: bytes, rng: random.Random) -> bytes:
    at, length = rng.randrange(len(data) + 1), rng.choice((4, 64, 4096))
    return data[:at] + b"\x00" * len(data[at : at + length]) + data[at + length :]


def _swap(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


_BYTES: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _flip, _flip, _cut, _repeat, _insert, _replace_token, _replace_token, _truncate, _zero, _swap
)  # fmt: skip
