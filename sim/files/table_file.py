"""Tables that people make, in .csv or .parquet files; what does not fit is named with its place."""

import csv
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from steerlab.sim.arrays import BoolArray, FloatArray
from steerlab.sim.errors import SteerlabError, shown
from steerlab.sim.files.reading import reading
from steerlab.sim.names import alike, appearance, both_shown

IntArray = NDArray[np.int64]

_EXACT = 2**53  # whole numbers from here on are no longer all exact as floating-point numbers
_LARGEST_BLOCK = 1 << 30  # bytes; pyarrow can take twice as many
_EMPTY = pv.ConvertOptions().null_values  # what counts as an empty cell among numbers
_NUMBER = (
    "it must be a number with a decimal point and no thousands separators, and the cell empty "
    "where there is none"
)
_SAVE = "Save it as CSV UTF-8 with commas."
_OTHER_FORMATS = {
    b"\xff\xfe": "is UTF-16 text, such as Excel's Unicode Text",
    b"\xfe\xff": "is UTF-16 text",
    b"PK\x03\x04": "is a zip archive, as Excel's workbooks are",
    b"\x1f\x8b": "is compressed",
    b"PAR1": "is a Parquet file under another ending",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class TableFile:
    """A table, and where its rows are in its file.

    Attributes:
        error: what is raised about its values.
        rows: of the file, (rows of ``table``,) from 0.
    """

    path: Path
    table: pa.Table
    error: type[SteerlabError]
    rows: IntArray

    @property
    def columns(self) -> list[str]:
        """Their names."""
        return self.table.column_names

    def place(self, row: int) -> str:
        """Where a row of ``table`` is: ``labels.csv, line 7``, or ``labels.parquet, row 6``."""
        number = int(self.rows[row])
        if self.path.suffix.lower() == ".csv" and (line := _line_of(self.path, number)):
            return f"{self.path.name}, line {line}"
        return f"{self.path.name}, row {number + 1}"

    def kept(self, keep: BoolArray) -> "TableFile":
        """The same with only some of the rows."""
        return replace(self, table=self.table.filter(pa.array(keep)), rows=self.rows[keep])

    def is_numeric(self, name: str) -> bool:
        """Whether a column holds nothing but numbers and empty cells."""
        kind, types = self.table.column(name).type, pa.types
        return (
            types.is_integer(kind)
            or types.is_floating(kind)
            or types.is_decimal(kind)
            or types.is_null(kind)
        )

    def numbers(self, name: str, *, truth_values: bool = False) -> FloatArray:
        """A column of numbers, (rows,); NaN where there is none.

        Args:
            truth_values: may be there instead, throughout; they become 0 and 1.

        Raises:
            SteerlabError: a value is no number, or a whole number too large to be kept exactly.
        """
        column = self.table.column(name)
        if truth_values and pa.types.is_boolean(column.type):
            column = column.cast(pa.int8())
        elif not self.is_numeric(name):
            self._refuse(name, self._texts(name), pa.float64(), _NUMBER)
        values = column.cast(pa.float64(), safe=False).to_numpy()
        if pa.types.is_integer(column.type) and (np.abs(values) >= _EXACT).any():
            row = int(np.argmax(np.abs(values) >= _EXACT))
            raise self.wrong(row, name, column[row].as_py(), "it must be within ±2^53")
        return values

    def whole(self, name: str) -> IntArray:
        """A column of whole numbers, (rows,), one in every row.

        Raises:
            SteerlabError: a value is none.
        """
        values = self.numbers(name)
        whole = np.isfinite(values) & (values == np.round(values)) & (np.abs(values) < _EXACT)
        if not whole.all():
            row = int(np.argmin(whole))
            value = None if np.isnan(values[row]) else float(values[row])
            raise self.wrong(row, name, value, "it must be a whole number within ±2^53")
        return values.astype(np.int64)

    def flags(self, name: str) -> BoolArray:
        """A column of truth values, (rows,), one in every row.

        Raises:
            SteerlabError: a value is none.
        """
        column, allowed = self.table.column(name), "it must be true or false"
        if pa.types.is_boolean(column.type):
            if column.null_count:
                row = int(np.argmax(column.is_null().to_numpy()))
                raise self.wrong(row, name, None, allowed)
            return column.to_numpy()
        texts = self._texts(name)
        for row, value in enumerate(texts.to_pylist()):
            if value is None or value.lower() not in ("true", "false"):
                raise self.wrong(row, name, value, allowed)
        raise self._stored_otherwise(name, texts, "truth values")

    def names(self, name: str, *, people_chose: bool = True) -> tuple[tuple[str, ...], IntArray]:
        """The sorted distinct texts of a column, and each row's index into them, (rows,).

        Args:
            people_chose: the names, so that two which look alike are not two for certain.

        Raises:
            SteerlabError: a row has no name, or two names look like one.
        """
        encoded = self._texts(name).dictionary_encode()
        values: list[str | None] = encoded.dictionary.to_pylist()
        codes = encoded.indices.fill_null(len(values)).to_numpy().astype(np.int64)
        for code, value in enumerate([*values, None]):
            if (value is None or not appearance(value)) and (codes == code).any():
                row = int(np.argmax(codes == code))
                raise self.wrong(row, name, value, "every row needs a name")
        known = [value for value in values if value is not None]
        order = sorted(range(len(known)), key=known.__getitem__)
        if people_chose and (pair := alike(known)):
            row = int(np.argmax(codes == known.index(pair[1])))
            raise self.error(
                f"{self.place(row)}: {name}s {both_shown(*pair)}. Write them alike if they are "
                f"one; give names that differ in more if they are two."
            )
        rank = np.empty(len(known), dtype=np.int64)
        rank[order] = np.arange(len(known))
        return tuple(known[code] for code in order), rank[codes]

    def wrong(self, row: int, name: str, value: object, allowed: str) -> SteerlabError:
        """The error of one value; None if the cell is empty."""
        said = "empty" if value is None or value == "" else shown(value)
        return self.error(f"{self.place(row)}: {name} is {said}; {allowed}.")

    def _texts(self, name: str) -> pa.StringArray:
        """A column as text, as the file has it where that is text; None where a cell is null."""
        column = self.table.column(name).combine_chunks()
        if isinstance(column, pa.ChunkedArray):  # of no rows, in old versions
            column = pa.concat_arrays(column.chunks)
        if pa.types.is_floating(column.type):
            column = pa.array(column.to_numpy(zero_copy_only=False), from_pandas=True)  # no NaN
        try:
            return column.cast(pa.string())
        except pa.ArrowException as why:
            if "UTF8" not in str(why):
                raise self.error(
                    f"{self.path.name}: column {name} is {column.type}, which is neither text nor "
                    f"number; store it as one of them."
                ) from why
            row = _first_refused(column, pa.string())
            raise self.wrong(row, name, column[row].as_py(), "it must be UTF-8 text") from why

    def _refuse(self, name: str, texts: pa.StringArray, kind: pa.DataType, allowed: str) -> None:
        """Raise the error of the first of ``texts`` that cannot be cast to ``kind``."""
        trimmed = ["" if text is None else text.strip() for text in texts.to_pylist()]
        given = pa.array([None if text in _EMPTY else text for text in trimmed], pa.string())
        if _casts(given, kind):
            raise self._stored_otherwise(name, texts, "numbers")
        row = _first_refused(given, kind)
        raise self.wrong(row, name, texts[row].as_py(), allowed)

    def _stored_otherwise(self, name: str, texts: pa.StringArray, what: str) -> SteerlabError:
        kind = self.table.column(name).type
        example = next((text for text in texts.to_pylist() if text), None)
        return self.error(
            f"{self.path.name}: column {name} holds {kind} such as {shown(example)}; store it as "
            f"{what}."
        )


def read_table_file(
    path: Path,
    *,
    what: str,
    error: type[SteerlabError],
    remedy: str,
    text: Collection[str],
    known: Sequence[str],
) -> TableFile:
    """Read a .csv or .parquet file, whose ending may be in capitals.

    Args:
        what: it should be, such as ``a table of labels``.
        remedy: a sentence: what to do about a file that is no such table.
        text: columns that are text whatever they look like: ``007`` is a name, not the number 7.
        known: columns that have a meaning.

    Raises:
        SteerlabError: it cannot be read, a column comes twice, or a column's name only looks like
            one of ``known``.
    """
    with reading(path, what, error, remedy):
        if path.suffix.lower() == ".parquet":
            table = pq.read_table(path)
        elif path.suffix.lower() == ".csv":
            table = _read_csv(path, text, error)
        else:
            raise error(f"{path.name} is neither .csv nor .parquet; convert or rename it.")
        table = _without_dictionaries(table)
        _check_header(path, table.column_names, known, error)
        return TableFile(path=path, table=table, error=error, rows=np.arange(table.num_rows))


def _without_dictionaries(table: pa.Table) -> pa.Table:
    """Dictionaries only save space; here they are what they hold."""
    for place, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type):
            column = table.column(place).cast(field.type.value_type)
            table = table.set_column(place, field.name, column)
    return table


def _check_header(
    path: Path, names: list[str], known: Sequence[str], error: type[SteerlabError]
) -> None:
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise error(f"{path.name} has column {twice[0]!r} twice; rename or drop one.")
    meant = {appearance(name): name for name in known}
    for name in names:
        real = meant.get(appearance(name), name)
        if real != name:
            raise error(
                f"{path.name}: columns {both_shown(name, real)}; call it {real!r} if it is that, "
                f"or something else."
            )


def _read_csv(path: Path, text: Collection[str], error: type[SteerlabError]) -> pa.Table:
    """One block, so that types are those of the whole file and quoted line breaks never split."""
    if cause := _other_format(path):
        raise error(f"{path.name} {cause}")
    size = min(max(path.stat().st_size, 1 << 20), _LARGEST_BLOCK)
    try:
        return pv.read_csv(
            path,
            read_options=pv.ReadOptions(block_size=size),
            parse_options=pv.ParseOptions(newlines_in_values=True),
            convert_options=pv.ConvertOptions(column_types={name: pa.string() for name in text}),
        )
    except pa.ArrowInvalid as why:
        if cause := _undecodable(path) or _uneven(path):
            raise error(f"{path.name}, {cause}") from why
        raise


def _other_format(path: Path) -> str:
    """What a file is that is no CSV with commas in UTF-8, by how it begins; empty if it may be."""
    with path.open("rb") as file:
        start = file.read(1 << 16)
    for mark, what in _OTHER_FORMATS.items():
        if start.startswith(mark):
            return f"{what}. {_SAVE}"
    if b"\0" in start:
        return f"holds zero bytes, so it is damaged, or UTF-16 text. {_SAVE}"
    lines = start.removeprefix(b"\xef\xbb\xbf").lstrip(b"\r\n").splitlines()
    header = lines[0].decode(errors="replace") if lines else ""
    if header.lstrip('"').lower().startswith("sep="):
        return (
            f"begins with {shown(header)}, which only Excel reads. Delete that line; columns "
            f"are separated by commas."
        )
    if header.startswith("#") and not header.startswith("#,"):
        return (
            f"begins with {shown(header)}. Comment lines are not read: delete them; the first line "
            f"names the columns."
        )
    for mark, what in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if header.count(mark) > header.count(","):
            return (
                f"separates its columns by {what}. Save it with commas between columns and points "
                f"in numbers."
            )
    cause = _undecodable_line(1, lines[0]) if lines else ""
    return f"cannot be read: {cause}" if cause else ""


def _undecodable(path: Path) -> str:
    """The first line that is not UTF-8; empty if there is none."""
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if cause := _undecodable_line(number, line):
                return cause
    return ""


def _undecodable_line(number: int, line: bytes) -> str:
    try:
        line.decode()
    except UnicodeDecodeError as error:
        before = line[: error.start].decode()[-20:]
        return (
            f"line {number} is not UTF-8: byte 0x{line[error.start]:02x} after {before!r}, as in "
            f"files of Windows-1252 or Latin-1. {_SAVE}"
        )
    return ""


def _uneven(path: Path) -> str:
    """The first line with more or fewer cells than the header; empty if there is none."""
    cells = 0
    for line, row in _csv_rows(path):
        cells = cells or len(row)
        if len(row) != cells:
            start = shown(",".join(row))
            return (
                f"line {line} has {len(row)} cells, and the first line, which names the columns, "
                f"{cells}: {start}. Give each line as many; quote a cell that has commas; delete "
                f"comment lines and titles."
            )
    return ""


def _line_of(path: Path, number: int) -> int | None:
    """The line on which a row begins, the header being row -1; None if it cannot be told."""
    for row, (line, _) in enumerate(_csv_rows(path), start=-1):
        if row == number:
            return line
    return None


def _csv_rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV file that are not empty, header and all, with the line each begins on."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        reader, line = csv.reader(file), 1
        try:
            for row in reader:
                if row:
                    yield line, row
                line = reader.line_num + 1
        except csv.Error:  # a cell beyond its limit: no line can be told
            return


def _casts(column: pa.Array, kind: pa.DataType) -> bool:
    try:
        column.cast(kind)
    except pa.ArrowInvalid:
        return False
    return True


def _first_refused(column: pa.Array, kind: pa.DataType) -> int:
    """The first value that cannot be cast to ``kind``, which one of them cannot."""
    start, stop = 0, len(column)
    while stop - start > 1:
        middle = (start + stop) // 2
        if _casts(column[start:middle], kind):
            start = middle
        else:
            stop = middle
    return start
