"""Report as Parquet: one row per value, of S7 per item, for questions over many captures.

The columns, their types and what they mean stand in schema/table-1.schema.json (docs/data.md).
They are those of csv; a value has a row of its own and comes as text, as a number and, where it is
one, as an exact integer, so that a parameter over time is one filter. Texts are as the drive sent
them: what reads this file shows no formulas.

Rows are kept as Arrow columns until there are ROWS_PER_GROUP, then written: memory does not grow.
Needs pyarrow (the extra `parquet`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import Any, BinaryIO, ClassVar, TextIO

from ds47 import spec
from ds47.model import CaptureResult, Finding, Parameter, Transaction, Value
from ds47.report import CannotWriteError, ReportOptions, contract, schema
from ds47.report import Writer as _Writer
from ds47.report.targets import Telegrams
from ds47.spec.extras import install
from ds47.version import __version__

SCHEMA = "ds47.table/1"
"""The version of the columns, in the metadata of the file."""
ROWS_PER_GROUP = 1 << 16
"""Rows of a row group: enough to compress well, few enough to keep."""
_ROWS_AT_ONCE = 1 << 11
"""Rows kept as Python objects."""
_NUMERIC_KINDS = ("number", "float", "date", "time_of_day", "duration", "zero")
_NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
_NO_PARAMETER: list[Any] = [None] * 19
_START = [each.name for each in contract.TRANSACTION_COLUMNS].index("start")
_UNIT = 1 + [each.name for each in contract.HEAD_COLUMNS].index("unit")

Row = list[Any]


class Writer(_Writer):
    """Writes a row group to the binary stream below `stream` whenever enough rows have come."""

    streams: ClassVar[bool] = True

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        if stream.isatty():
            raise CannotWriteError("parquet is not for a terminal: -o FILE, or a pipe")
        try:
            arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        except ImportError as problem:
            raise CannotWriteError(
                f"parquet needs pyarrow ({problem}): {install('parquet')}"
            ) from problem
        stream.flush()
        self._columns = Columns(self.options.lang)
        schema = self._columns.schema
        self._file = parquet.ParquetWriter(
            arrow.PythonFile(_Sink(stream.buffer), "w"),
            schema,
            compression="zstd",
            version="2.6",
            use_dictionary=[each.name for each in schema if each.type == arrow.string()],
        )

    def whole(self, result: CaptureResult) -> None:
        Telegrams.tell(result)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        self._columns.add(path, transaction)
        if self._columns.packed >= ROWS_PER_GROUP:
            self._group()

    def close(self) -> None:
        self._group()
        self._file.close()

    def _group(self) -> None:
        table = self._columns.table()
        if table.num_rows:
            self._file.write_table(table, row_group_size=ROWS_PER_GROUP)


class Columns:
    """The rows of transactions as columns of Arrow, which take a small part of the memory. Needs pyarrow."""

    def __init__(self, lang: str = "en") -> None:
        self._arrow: Any = import_module("pyarrow")
        self._lang = lang
        self.schema = arrow_schema()
        self._types = self.schema.types
        self._rows: list[Row] = []
        self._batches: list[Any] = []
        self.packed = 0
        """Rows that are columns already."""

    def add(self, path: str, transaction: Transaction) -> None:
        """Takes the rows of a transaction."""
        left = _transaction_cells(path, transaction)
        for position, (parameter, right) in enumerate(contract.rows(transaction)):
            parts = [_NO_PARAMETER]
            if parameter is not None:
                parts = _parameter_cells(position, parameter, self._lang)
            self._rows += [left + cells + right for cells in parts]
        if len(self._rows) >= _ROWS_AT_ONCE:
            self._pack()

    def table(self) -> Any:
        """All rows since the last table, as a pyarrow.Table."""
        self._pack()
        found = self._arrow.Table.from_batches(self._batches, self.schema)
        self._batches.clear()
        self.packed = 0
        return found

    def _pack(self) -> None:
        if not self._rows:
            return
        columns = zip(*self._rows, strict=True)
        arrays = [
            self._arrow.array(column, kind)
            for column, kind in zip(columns, self._types, strict=True)
        ]
        self._batches.append(self._arrow.RecordBatch.from_arrays(arrays, schema=self.schema))
        self.packed += len(self._rows)
        self._rows.clear()


class _Sink:
    """A binary stream that knows how far it is: a pipe does not, and Parquet needs it."""

    closed = False

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._position = 0

    def write(self, data: Any) -> int:
        view = memoryview(data)
        if not self._stream.closed:  # else the report was given up, and this is the garbage
            self._stream.write(view)
        self._position += view.nbytes
        return view.nbytes

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        if not self._stream.closed:
            self._stream.flush()

    def close(self) -> None:
        """Leaves the stream open: it belongs to the caller."""
        self.flush()


def arrow_schema() -> Any:
    """The columns as a pyarrow.Schema, with unit and meaning as metadata."""
    arrow = import_module("pyarrow")
    types = {
        "int64": arrow.int64(),
        "double": arrow.float64(),
        "string": arrow.string(),
        "timestamp[ns, tz=UTC]": arrow.timestamp("ns", "UTC"),
    }
    return arrow.schema(
        [
            arrow.field(
                name,
                types[column["arrow"]],
                metadata={key: column[key] for key in ("description", "unit") if key in column},
            )
            for name, column in columns("parquet").items()
        ],
        metadata={"schema": SCHEMA, "tool": f"ds47 {__version__}"},
    )


def columns(table: str) -> dict[str, dict[str, Any]]:
    """The columns of `csv` or `parquet` in order, each as its definition in the schema."""
    definitions = schema("table-1")["$defs"]
    return {
        name: column if "$ref" not in column else definitions[column["$ref"].rpartition("/")[2]]
        for name, column in definitions[table]["properties"].items()
    }


def _transaction_cells(path: str, item: Transaction) -> Row:
    cells = contract.transaction_cells()(item, "en")
    cells[_START] = item.start_ns if _fits(item.start_ns) else None
    return [utf8(path), *cells]


def _parameter_cells(position: int, item: Parameter, lang: str) -> list[Row]:
    """A row for each value of the parameter, one row where it has none."""
    head = [position, *contract.head_cells(item, lang)]
    head[_UNIT] = utf8(item.unit)
    code, text, info = contract.error_cells(item, lang)
    tail: Row = [code, utf8(text), info]
    first = item.subindex if item.attribute == "value" else None
    if not item.values:
        return [[*head, None, first, None, None, None, None, None, *tail]]
    numeric = item.format in _numeric_formats()
    scaled = item.scaled or []
    return [
        [
            *head,
            index,
            None if first is None else first + index,
            *_value_cells(value, numeric),
            *(_scaled_cells(scaled[index]) if index < len(scaled) else (None, None)),
            *tail,
        ]
        for index, value in enumerate(item.values)
    ]


def _value_cells(value: Value, numeric: bool) -> tuple[str, float | None, int | None]:
    """A value as text, as a number, and as an integer where it fits one."""
    if isinstance(value, float):
        return repr(value), value, None
    if isinstance(value, int):
        return str(value), float(value), value if _fits(value) else None
    if not numeric:
        return utf8(value), None, None
    if value in _NOT_FINITE:
        return value, _NOT_FINITE[value], None
    number = int(value)
    return value, float(number), number if _fits(number) else None


def _scaled_cells(value: Value) -> tuple[str, float | None]:
    if isinstance(value, str):
        return utf8(value), _NOT_FINITE.get(value)
    return repr(value), float(value)


def _fits(number: int) -> bool:
    """Whether it is a signed 64-bit integer; the smallest stands for `none` in data frames."""
    return -(1 << 63) < number < 1 << 63


def utf8(text: Any) -> Any:
    """A text as UTF-8 can hold it: half a surrogate in a file name becomes an escape."""
    if text is None or text.isascii():
        return text
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


@cache
def _numeric_formats() -> frozenset[str]:
    """Formats with numbers as values, even if JSON has to write them as strings."""
    return frozenset(row.name for row in spec.formats().values() if row.kind in _NUMERIC_KINDS)
