"""Tables: Parquet and csv against their schema, ndjson lines against theirs, with real captures."""

from __future__ import annotations

import csv as csv_module
import io
import json
import math
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import handmade
import jsonschema
import pytest

from ds47 import cli, report
from ds47.analysis import analyze
from ds47.model import CaptureResult, Parameter, ParameterError, Report, Transaction
from ds47.report import CannotWriteError, ReportOptions, csv, ndjson, parquet, write_all
from ds47.report import json as contract
from ds47.spec.units import timestamp

TABLE = report.schema("table-1")


def check_rows(name: str, read: list[dict[str, Any]]) -> None:
    """Rows against the schema: one as a whole, then every column by the values that occur in it."""
    jsonschema.Draft202012Validator({**TABLE, "$ref": f"#/$defs/{name}"}).validate(read[0])
    for column, about in TABLE["$defs"][name]["properties"].items():
        check = jsonschema.Draft202012Validator({**TABLE, **about})
        for value in {row[column] for row in read}:
            check.validate(value)
    assert all(list(row) == list(read[0]) for row in read)


@pytest.fixture(scope="module")
def arrow() -> Any:
    """pyarrow.parquet; without it these tests say why they do nothing."""
    import os

    if os.environ.get("DS47_CI") != "1":
        pytest.importorskip("pyarrow")
    import pyarrow.parquet

    return pyarrow.parquet


@pytest.fixture(scope="module")
def results(captures: Path) -> list[CaptureResult]:
    """What every stored capture says."""
    paths = sorted(captures.rglob("*.pcap*"))
    assert len(paths) > 100
    found = []
    for path in paths:
        result = analyze(str(path))
        result.path = path.relative_to(captures).as_posix()
        found.append(result)
    return found


class Binary(io.TextIOWrapper):
    """A text stream as `-o` opens it, that lets its bytes be read."""

    def __init__(self, terminal: bool = False) -> None:
        super().__init__(io.BytesIO(), encoding="utf-8")
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal


def table(arrow: Any, captures: list[CaptureResult]) -> Any:
    stream = Binary()
    write_all(parquet.Writer(stream), Report(captures))
    assert not stream.closed
    stream.buffer.seek(0)
    return arrow.read_table(stream.buffer)


def rows(arrow: Any, captures: list[CaptureResult]) -> list[dict[str, Any]]:
    """The rows as the schema describes them: a time as text, in nanoseconds."""
    read = table(arrow, captures)
    numbers = read.column("start").cast("int64").to_pylist()
    return [
        row | {"start": None if ns is None else timestamp(ns)}
        for row, ns in zip(read.to_pylist(), numbers, strict=True)
    ]


def transaction(*parameters: Parameter, **changes: Any) -> Transaction:
    usual = {"read_status": 0xDE80B500, "parameters": list(parameters)}
    return handmade.transaction(**(usual | changes))


def capture(*transactions: Transaction, path: str = "a.pcapng") -> CaptureResult:
    return CaptureResult(path, transactions=list(transactions))


def value(format_name: str, *values: Any, scaled: Any = None, **more: Any) -> Parameter:
    return Parameter(
        2902,
        2,
        "value",
        len(values),
        None,
        None,
        format_name,
        len(values),
        [*values],
        scaled,
        **more,
    )


def test_the_schemas_are_schemas():
    for name in ("report-1", "report-2", "table-1", "transaction-1", "transaction-2"):
        jsonschema.Draft202012Validator.check_schema(report.schema(name))
    assert list(parquet.columns("csv")) == list(csv.COLUMNS)
    for name in ("csv", "parquet"):
        properties = TABLE["$defs"][name]["properties"]
        assert TABLE["$defs"][name]["required"] == list(properties)
        assert all(column["description"] for column in parquet.columns(name).values())


def test_the_schemas_are_those_of_the_table():
    """The files are what tools/make_schemas.py makes of the one description of the result."""
    tool = runpy.run_path(str(Path(__file__).parents[2] / "tools" / "make_schemas.py"))
    for name in ("report", "transaction"):
        assert tool[name]() == report.schema(f"{name}-2")
    assert tool["table"]() == TABLE


def test_the_line_of_ndjson_is_that_of_the_report():
    own, whole = report.schema("transaction-2"), report.schema()["$defs"]
    assert own["oneOf"] == whole["line"]["oneOf"]
    assert own["$defs"] == {name: whole[name] for name in own["$defs"]}


@pytest.mark.slow
def test_every_line_of_ndjson_is_valid(results):
    stream = io.StringIO()
    write_all(ndjson.Writer(stream), Report(results))
    check = jsonschema.Draft202012Validator(report.schema("transaction-2"))
    lines = stream.getvalue().removesuffix("\n").split("\n")
    assert len(lines) > 300
    for line in lines:
        check.validate(json.loads(line))


def test_every_row_of_csv_is_valid(results):
    stream = io.StringIO()
    write_all(csv.Writer(stream), Report(results))
    text = stream.getvalue()
    read = list(csv_module.DictReader(io.StringIO(text, newline="")))
    assert text.count("\n") == len(read) + 1, "a row is a line"
    about = parquet.columns("csv")
    types = {"int64": int, "double": float, "string": str}
    typed = [
        {
            # an empty cell is null, except in a column that never is
            name: (types[about[name]["arrow"]](cell) if cell or name == "findings" else None)
            for name, cell in row.items()
        }
        for row in read
    ]
    check_rows("csv", typed)


def test_every_row_of_parquet_is_valid(arrow, results):
    read = rows(arrow, results)
    assert len(read) > 800
    check_rows("parquet", read)
    assert table(arrow, results).schema.equals(parquet.arrow_schema(), check_metadata=True)


def test_parquet_says_what_json_says(arrow, results):
    values: dict[tuple[str, int, int], list[str]] = {}
    seen = set()
    for row in rows(arrow, results):
        seen.add((row["path"], row["transaction"]))
        if row["value"] is not None:
            place = (row["path"], row["transaction"], row["parameter"])
            assert row["value_index"] == len(values.setdefault(place, []))
            values[place].append(row["value"])
    assert seen == {(each.path, item.id) for each in results for item in each.transactions}
    assert values == {
        (each.path, item.id, position): [
            one if isinstance(one, str) else contract.text(one) for one in parameter.values
        ]
        for each in results
        for item in each.transactions
        for position, parameter in enumerate(
            item.parameters or [part.parameter for part in item.items]
        )
        if parameter is not None and parameter.values
    }


def test_a_value_is_text_number_and_integer(arrow):
    item = transaction(
        value("Integer16", -5),
        value("Unsigned64", "18446744073709551615"),
        value("Integer64", "-9223372036854775807"),
        value("Float32", 0.1),
        value("Float64", "NaN"),
        value("Float64", "-Infinity"),
        value("OctetString", "2900"),
        value("VisibleString", "47"),
        value("N2", 16384, scaled=[100.0]),
        value("TimeOfDay", 77, scaled=["00:00:00.077"]),
        value("0x7F"),
    )
    read = rows(arrow, [capture(item)])
    found = [
        (
            row["value"],
            row["value.number"],
            row["value.integer"],
            row["scaled"],
            row["scaled.number"],
        )
        for row in read
    ]
    assert math.isnan(found.pop(4)[1])
    assert found == [
        ("-5", -5.0, -5, None, None),
        ("18446744073709551615", 2.0**64, None, None, None),
        ("-9223372036854775807", -(2.0**63), -(2**63) + 1, None, None),
        ("0.1", 0.1, None, None, None),
        ("-Infinity", -math.inf, None, None, None),
        ("2900", None, None, None, None),
        ("47", None, None, None, None),
        ("16384", 16384.0, 16384, "100.0", 100.0),
        ("77", 77.0, 77, "00:00:00.077", None),
        (None, None, None, None, None),
    ]


def test_an_element_is_the_subindex_of_its_value(arrow):
    error = ParameterError(0x11, 7)
    text = Parameter(944, 3, "text", 2, None, None, "VisibleString16", 2, ["a", "b"])
    failed = Parameter(901, 4, "value", 1, error=error)
    item = transaction(value("Float32", 1.0, 2.0, 3.0), text, failed)
    read = rows(arrow, [capture(item, transaction(id=2))])
    assert [
        (row["parameter"], row["value_index"], row["element"], row["error.code"]) for row in read
    ] == [
        (0, 0, 2, None),
        (0, 1, 3, None),
        (0, 2, 4, None),
        (1, 0, None, None),
        (1, 1, None, None),
        (2, None, 4, 0x11),
        (None, None, None, None),
    ]


def test_times_and_texts_that_no_column_can_hold(arrow):
    strange = '=1+\x1b[2J<script>\r\n"'
    items = [
        transaction(value("VisibleString", strange), start_ns=1 << 63),
        transaction(start_ns=-(1 << 63), id=2),
        transaction(start_ns=(1 << 63) - 1, duration_ns=-3_000_000, id=3),
    ]
    read = rows(arrow, [capture(*items, path="a\udc80.pcapng")])
    assert [row["start"] for row in read] == [None, None, "2262-04-11T23:47:16.854775807Z"]
    assert [row["duration_ms"] for row in read] == [12.4, 12.4, -3.0]
    assert read[0]["value"] == strange
    assert {row["path"] for row in read} == {"a\\udc80.pcapng"}


def test_row_groups_and_dictionaries(arrow, monkeypatch):
    monkeypatch.setattr(parquet, "ROWS_PER_GROUP", 1000)
    monkeypatch.setattr(parquet, "_ROWS_AT_ONCE", 100)
    stream = Binary()
    writer = report.open_writer("parquet", stream)
    assert writer.streams
    kept = []
    for number in range(1, 4001):
        writer.transaction("a.pcapng", transaction(value("Float32", 1.0), id=number), [])
        kept.append(len(writer._columns._rows) + writer._columns.packed)
    assert max(kept) < 1100, "rows stay in memory"
    assert stream.buffer.tell() > 1000, "nothing is written before the end"
    writer.close()
    stream.buffer.seek(0)
    about = arrow.ParquetFile(stream.buffer).metadata
    assert (about.num_rows, about.num_row_groups) == (4000, 4)
    assert about.metadata[b"schema"] == b"ds47.table/1"
    encodings = {
        about.schema.column(at).name: about.row_group(0).column(at).encodings
        for at in range(about.num_columns)
    }
    assert "RLE_DICTIONARY" in encodings["device"]
    assert "RLE_DICTIONARY" not in encodings["value.number"]


def test_no_capture_gives_an_empty_table(arrow):
    assert table(arrow, []).num_rows == 0
    assert table(arrow, []).schema == parquet.arrow_schema()


def test_a_terminal_is_refused(arrow):
    with pytest.raises(CannotWriteError, match="-o FILE"):
        report.open_writer("parquet", Binary(terminal=True))


def test_without_pyarrow_the_mend_is_said(monkeypatch, capsys, tmp_path, captures):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    target = tmp_path / "out.parquet"
    asked = ["report", str(captures / "seed-g120-read.pcapng"), "-f", "parquet", "-o", str(target)]
    assert cli.main(asked) == 2
    assert "pip install pyarrow" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_file_and_pipe_are_the_same(arrow, captures, tmp_path):
    asked = ["report", str(captures / "tour-machine.pcapng"), "-f", "parquet"]
    target = tmp_path / "out.parquet"
    assert cli.main([*asked, "-o", str(target)]) == 0
    piped = subprocess.run([sys.executable, "-m", "ds47", *asked], capture_output=True, check=True)
    assert piped.stdout == target.read_bytes()
    assert arrow.read_table(target).num_rows > 8


def test_a_report_that_is_given_up_leaves_no_file(arrow, tmp_path, capsys):
    target = tmp_path / "out.parquet"
    asked = ["report", str(tmp_path / "none.pcapng"), "-f", "parquet", "-o", str(target)]
    assert cli.main(asked) == 3
    assert arrow.read_table(target).num_rows == 0
    stream = Binary()
    writer = report.open_writer("parquet", stream, ReportOptions())
    writer.transaction("a", transaction(), [])
    stream.buffer.close()
    del writer  # the garbage collector closes what pyarrow opened
    assert "Exception" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=1+1", "'=1+1"),
        ("+1", "'+1"),
        ("-1", "'-1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("  =1", "'  =1"),
        ("＝1", "'＝1"),
        ("\t=1", "\\t=1"),
        ("\r\n=1", "\\r\\n=1"),
        ("\x1b]0;x\x07", "\\x1b]0;x\\x07"),
        ("a\x00b\x7fc\x9b\u202ed", "a\\x00b\\x7fc\\x9b\\u202ed"),
        ("a=b 名", "a=b 名"),
        ("a;=cmd|calc;b; @x", "a;'=cmd|calc;b;' @x"),
        ("", ""),
        ("  ", "  "),
    ],
)
def test_csv_cells_are_text(text, cell):
    assert csv.guarded(text) == cell


def test_csv_arrays_stay_json(tmp_path):
    texts = ["\x1b[2J", "\x9b\x7f", "é名=", "\\x1b"]
    stream = io.StringIO()
    write_all(csv.Writer(stream), Report([capture(transaction(value("VisibleString8", *texts)))]))
    (row,) = csv_module.DictReader(io.StringIO(stream.getvalue(), newline=""))
    assert row["values"].isprintable()
    assert json.loads(row["values"]) == texts
