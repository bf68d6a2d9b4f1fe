"""Serializers against hand-built results: JSON by its schema, NDJSON, CSV, text."""

from __future__ import annotations

import csv as csv_module
import io
import json as json_module
import re
from copy import deepcopy
from types import SimpleNamespace

import handmade
import jsonschema
import pytest
from handmade import finding

from ds47 import report
from ds47.analysis import AnalysisOptions, analyze
from ds47.model import (
    OPERATIONS,
    SEVERITIES,
    STATES,
    CaptureResult,
    Device,
    Frames,
    Parameter,
    ParameterError,
    Read,
    Report,
)
from ds47.report import csv, formatting, json, ndjson, text, write_all
from ds47.report.contract import FINDING
from ds47.report.latency import Latency, percentile
from ds47.spec.units import timestamp

VALIDATOR = jsonschema.Draft202012Validator(report.schema())


def definition(name):
    return VALIDATOR.evolve(schema={"$ref": f"urn:ds47:report:2#/$defs/{name}"})


def make_transaction(number=12, **changes):
    usual = {
        "ar": "12345678-1234-1234-1234-123456789abc",
        "request": bytes.fromhex("030102011001c47f0000"),
        "response": bytes.fromhex("03010201080141200000"),
        "parameters": [Parameter(50303, 0, "value", 1, None, None, "Float32", 1, [10.0])],
    }
    return handmade.transaction(id=number, **(usual | changes))


def make_capture(*transactions, findings=(), **changes):
    item = CaptureResult(
        path="line 1.pcapng",
        frames=1234,
        rpc={"requests": 2, "responses": 2},
        records={"45103": {"read": 1, "write": 1}, "47": {"read": 1, "write": 1}},
        devices=[Device("192.168.133.33", "00:0e:8c:00:00:01", "drive1", 0x2A, 0x501)],
        transactions=list(transactions),
        findings=list(findings),
        summary={"transactions": len(transactions)},
    )
    for key, value in changes.items():
        setattr(item, key, value)
    return item


def hard_capture():
    failed = ParameterError(0x11, 7, said="=cannot, with state")
    error = Parameter(901, 0, "value", 1, error=failed, value_count=2)
    odd = make_transaction(
        2,
        operation="change",
        state="partial",
        ar=None,
        request_reference=None,
        axis=None,
        frames=Frames(None, None, 5, 6, [Read(7, None)], [Read(9, 10)]),
        duration_ns=-3_000_000,
        request=None,
        response=None,
        write_status=None,
        read_status=0xDE80B500,
        parameters=[
            error,
            Parameter(None, None, None, None, None, "V", "N2", 2, [1, -2], [0.1, "NaN"]),
        ],
        findings=["DS410"],
    )
    strange = make_transaction(
        3,
        parameters=[
            Parameter(1, 0, "text", 1, None, None, "VisibleString", 4, ["=1+\x1b[2J\r\n\u202e"])
        ],
    )
    findings = [
        finding("DS410", "error", "p0901: no", 6, 2, 4),
        finding("DS102", "warning", "without request", 20),
    ]
    return make_capture(make_transaction(1), odd, strange, findings=findings, complete=False)


def written(module, item, **options):
    stream = io.StringIO()
    write_all(
        module.Writer(stream, **options),
        Report([item] if isinstance(item, CaptureResult) else item),
    )
    return stream.getvalue()


def test_schema_is_a_schema_and_knows_the_words_of_the_model():
    jsonschema.Draft202012Validator.check_schema(report.schema())
    definitions = report.schema()["$defs"]
    assert tuple(definitions["operation"]["enum"]) == OPERATIONS
    assert tuple(definitions["state"]["enum"]) == STATES
    assert tuple(definitions["severity"]["enum"]) == SEVERITIES


@pytest.mark.parametrize("captures", [[], [make_capture()], [hard_capture(), make_capture()]])
def test_json_validates_and_is_the_document(captures):
    content = written(json, captures)
    parsed = json_module.loads(content)
    VALIDATOR.validate(parsed)
    assert parsed == json.document(Report(captures))
    assert content == written(json, captures)


def test_json_is_the_contract():
    (capture,) = json_module.loads(written(json, make_capture(make_transaction(1))))["captures"]
    (item,) = capture["transactions"]
    assert item["start"] == "2026-01-01T00:00:00.000000001Z"
    assert item["duration_ms"] == 12.4
    assert item["bytes"]["request"] == "030102011001c47f0000"
    assert item["status"] == {"write": "00000000", "read": "00000000"}
    assert item["frames"]["polls"] == []
    assert list(capture["records"]) == ["47", "45103"]


def test_json_finding_has_the_offset_in_its_message():
    plain = FINDING.plain(finding("DS315", "error", "2 bytes missing", 6, 2, 4))
    assert plain["message"] == "offset 4: 2 bytes missing"
    assert plain["filter"] == "frame.number == 6"


@pytest.mark.parametrize("name", ["report-2", "transaction-2", "overview-1", "table-1"])
def test_every_reference_of_a_schema_leads_to_a_definition(name):
    schema = report.schema(name)
    named = set(re.findall(r'"#/\$defs/([^"/]+)"', json_module.dumps(schema)))
    assert named <= schema.get("$defs", {}).keys()


@pytest.mark.parametrize("start", ["cyclic", "profibus", "s7", "seed", "tour"])
def test_what_captures_of_every_channel_say_validates(captures, start):
    found = [
        path for path in sorted(captures.glob(f"{start}*")) if path.suffix in (".pcapng", ".txt")
    ]
    assert found
    line = jsonschema.Draft202012Validator(report.schema("transaction-2"))
    for path in found:
        result = analyze(path, AnalysisOptions())
        VALIDATOR.validate(json_module.loads(written(json, result)))
        for each in written(ndjson, result).splitlines():
            line.validate(json_module.loads(each))


def test_schema_is_strict():
    good = json.document(Report([make_capture(make_transaction())]))
    for change in (
        lambda capture: capture["transactions"][0].update(state="fine"),
        lambda capture: capture["transactions"][0].update(extra=1),
        lambda capture: capture["transactions"][0].pop("axis"),
        lambda capture: capture.update(extra=1),
        lambda capture: capture["transactions"][0]["frames"].update(extra=1),
    ):
        bad = deepcopy(good)
        change(bad["captures"][0])
        assert not VALIDATOR.is_valid(bad)


@pytest.mark.parametrize(
    ("time_ns", "expected"),
    [
        (0, "1970-01-01T00:00:00.000000000Z"),
        (-1, "1969-12-31T23:59:59.999999999Z"),
        (951_827_696_123_456_789, "2000-02-29T12:34:56.123456789Z"),
        (2**63 - 1, "2262-04-11T23:47:16.854775807Z"),
        (253_402_300_800 * 10**9, "10000-01-01T00:00:00.000000000Z"),
    ],
)
def test_timestamp(time_ns, expected):
    assert timestamp(time_ns) == expected


def test_ndjson_lines_validate_and_hold_everything():
    lines = [json_module.loads(line) for line in written(ndjson, hard_capture()).splitlines()]
    for line in lines:
        definition("line").validate(line)
    assert [line["transaction"]["id"] for line in lines[:-1]] == [1, 2, 3]
    assert [finding["rule"] for finding in lines[1]["findings"]] == ["DS410"]
    assert [finding["rule"] for finding in lines[-1]["capture"]["findings"]] == ["DS102"]


@pytest.mark.parametrize("name", ["ndjson", "csv"])
def test_streaming_writes_at_once_and_says_the_same(name):
    capture = hard_capture()
    stream = io.StringIO()
    writer = report.open_writer(name, stream)
    assert writer.streams
    before = len(stream.getvalue())
    writer.transaction(capture.path, capture.transactions[0], [])
    assert len(stream.getvalue()) > before


def rows(item):
    return list(csv_module.DictReader(io.StringIO(written(csv, item), newline="")))


def test_csv_has_a_row_per_parameter():
    table = rows(hard_capture())
    assert list(table[0]) == list(csv.COLUMNS)
    assert [(row["transaction"], row["pnu"]) for row in table] == [
        ("1", "50303"),
        ("2", "901"),
        ("2", ""),
        ("3", "1"),
    ]
    assert table[0]["values"] == "10.0"
    assert table[2]["values"] == "[1, -2]"
    assert table[1]["duration_ms"] == "-3.0"


def test_csv_keeps_transactions_without_parameters():
    (row,) = rows(make_capture(make_transaction(parameters=[], state="unanswered")))
    assert row["state"] == "unanswered"


def test_csv_guards_texts_and_only_texts():
    table = rows(hard_capture())
    assert table[1]["error.text"] == "'=cannot, with state"
    assert table[3]["values"].startswith("'=1+")
    values = [("Integer16", -5), ("Float32", "-Infinity"), ("Integer64", "-9007199254740993")]
    parameters = [
        Parameter(1, 0, "value", 1, None, None, *pair[:1], 1, [pair[1]]) for pair in values
    ]
    table = rows(make_capture(make_transaction(parameters=parameters)))
    assert [row["values"] for row in table] == ["-5", "-Infinity", "-9007199254740993"]


def test_unknown_format_is_wrong_use():
    with pytest.raises(ValueError, match="no report format"):
        report.open_writer("docx", io.StringIO())


def test_text_has_the_line_of_the_contract():
    content = written(text, make_capture(make_transaction()))
    line = (
        "#12  00:00:00.000  0.000  1  read  192.168.133.33 DO 2  p50303[0] = 10.0  4 frames 12.4 ms"
    )
    assert line in content.splitlines()
    assert "line 1.pcapng: 1,234 frames" in content
    assert '192.168.133.33  00:0e:8c:00:00:01  "drive1"  vendor 0x002A  device 0x0501' in content
    assert "latency p50 12.4 ms, p95 12.4 ms, p99 12.4 ms, max 12.4 ms" in content
    assert content.isascii()


def test_text_tells_controllers_and_slots_apart_when_there_are_several():
    other = make_transaction(13, controller="192.168.133.3", subslot=2)
    content = written(text, make_capture(make_transaction(), other))
    assert "192.168.133.3 -> 192.168.133.33 slot 1.2 DO 2" in content


def test_text_cannot_break_a_terminal_or_a_console():
    capture = hard_capture()
    capture.devices[0].station = "a\x07\x9b"
    capture.path = "x\x1b]0;\x07.pcap"
    content = written(text, capture)
    assert all(char.isprintable() or char == "\n" for char in content)
    assert "\\x1b[2J\\r\\n\\u202e" in content


def test_text_leaves_negative_times_out_of_the_latency():
    content = written(text, hard_capture())
    assert "max 12.4 ms (1 negative time left out)" in content


def test_text_marks_states_and_errors_in_words():
    content = written(text, hard_capture())
    assert "[partial]" in content
    assert "p0901[0] error 0x11: =cannot, with state (info 7)" in content
    refused = make_transaction(state="refused", write_status=0xDF80B000, parameters=[])
    assert "[refused DF80B000]" in written(text, make_capture(refused))


def test_text_puts_many_parameters_below_the_line():
    many = [Parameter(n, 0, "value", 1, None, None, "Float32", 1, [n / 7]) for n in range(9)]
    lines = written(text, make_capture(make_transaction(parameters=many))).splitlines()
    assert any("9 parameters  4 frames" in line for line in lines)
    assert f"      p0003[0] = {3 / 7}" in lines


def test_text_groups_findings_with_one_filter_and_says_what_it_left_out():
    findings = [finding("DS204", "note", "polled", 2 * n) for n in range(1, 81)]
    findings.append(finding("DS101", "error", "gone", 7))
    rules = {"DS204": SimpleNamespace(name="polled", advice="wait", advice_zh="")}
    options = report.ReportOptions(rules=rules, filters=True)
    content = written(text, make_capture(findings=findings), options=options)
    assert content.index("DS101") < content.index("DS204")
    assert "DS204 note polled: 80 findings" in content
    assert content.count(" or frame.number == 160") == 0
    assert content.count(" or frame.number == 120\n") == 0
    assert "frame.number == 118 or frame.number == 120  (and 20 more frames)" in content
    assert "and 68 more" in content
    assert "look at frame 7: frame.number == 7" in content


def test_text_colours_only_when_asked():
    assert "\x1b[" not in written(text, hard_capture())
    assert "\x1b[31m" in written(text, hard_capture(), options=report.ReportOptions(color=True))


def test_text_sums_up_several_captures():
    content = written(text, [make_capture(make_transaction()), make_capture(make_transaction())])
    lines = (
        "All 2 captures\n  OK: 1 drive, 2 transactions, all done\n  2 transactions: 2 ok; 2 read"
    )
    assert lines in content
    assert "no DS47 transaction" in written(text, make_capture())


def test_percentile_is_a_measured_value():
    assert [percentile(range(1, 101), at) for at in (50, 95, 100)] == [50, 95, 100]
    times = [number * 1_000_000 for number in range(1, 101)]
    counted = Latency(times[50:])
    counted.update(Latency(times[:50]))
    assert counted.text() == "latency p50 50.0 ms, p95 95.0 ms, p99 99.0 ms, max 100.0 ms"
    assert Latency([1]).text() == "latency p50 0.000 ms, p95 0.000 ms, p99 0.000 ms, max 0.000 ms"
    assert percentile([7], 50) == 7


def test_words():
    array = Parameter(2902, 2, "value", 40, None, "V", "Float32", 40, [1.5] * 40)
    assert formatting.parameter(array, written=False) == (
        "r2902[2..41] = 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, ... (40 values) V"
    )
    label = Parameter(944, 0, "text", 1, None, None, "VisibleString", 3, ['a"b'])
    assert formatting.parameter(label, written=False) == 'p0944[0].text = "a\\"b"'
    change = Parameter(50304, 0, "value", 1, None, None, "Float32", 1, [100.0])
    assert formatting.parameter(change, written=True) == "p50304[0] := 100.0"
    scaled = Parameter(1, 0, "value", 1, None, "%", "N2", 1, [16384], [100.0])
    assert formatting.parameter(scaled, written=False) == "p0001[0] = 16384 (100.0 %)"
    lengths = (412_000, 12_400_000, 999_900_000, 5_756_200_000, 12_300_000_000)
    assert [formatting.duration(ns) for ns in lengths] == [
        "0.412 ms",
        "12.4 ms",
        "999.9 ms",
        "5.76 s",
        "12.3 s",
    ]
