"""The reports and statistics of the Lua side, from the very results of the Python side.

CSV must be the bytes that Python writes, the text has what the JSON of Python has; the statistics are checked
against numbers computed here.
"""

from __future__ import annotations

import copy
import dataclasses
import io
import json
import re
import subprocess
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import chain, groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import handmade
import pytest
from lua_program import LUAS, lua_program
from test_cyclic_scenes import SCENES, capture
from test_lua_cyclic import scenes
from test_lua_pzd import ABSENT, NAMES, without_connect
from test_profibus_bus import everything_wrong
from whole_capture import without_analyzers

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.cyclic.named import parse
from ds47.lab import captured
from ds47.model import (
    STATES,
    CaptureResult,
    Finding,
    Frames,
    Parameter,
    ParameterError,
    Report,
    Transaction,
)
from ds47.profidrive.drive_objects import DriveObjects
from ds47.report import contract, write_all
from ds47.report import csv as csv_report
from ds47.report.bilingual import say
from ds47.report.escaping import escape
from ds47.report.sentences import advice
from ds47.report.wrap import columns
from ds47.spec.statuses import status_text

Run = Callable[[list[dict[str, Any]]], list[str]]


def told_row(row: spec.Pnu | Mapping[int, str]) -> dict[Any, Any]:
    """A row of the tables of parameters as the Lua tables have it."""
    return row.columns() if isinstance(row, spec.Pnu) else dict(row)


@pytest.fixture(scope="module", params=LUAS)
def lua(request: pytest.FixtureRequest, repository: Path, tmp_path_factory: Any) -> Run:
    """Runs the driver with a list of jobs, gives the texts."""
    program = lua_program(request.param)
    folder = tmp_path_factory.mktemp(request.param)

    def run(jobs: list[dict[str, Any]]) -> list[str]:
        (folder / "in.json").write_text(json.dumps(jobs, default=told_row), encoding="utf-8")
        driver = repository / "tests" / "lua" / "report.lua"
        command = [program, str(driver), str(folder / "in.json"), str(folder / "out.json")]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
        assert done.returncode == 0, done.stderr
        texts = json.loads((folder / "out.json").read_bytes())
        return list(texts)

    return run


@pytest.fixture(scope="module")
def results(captures: Path) -> list[CaptureResult]:
    """Every stored capture, analyzed, and a line of PROFIBUS with every trouble."""
    found = []
    for path in (*sorted(captures.glob("*.pcapng")), *sorted(captures.glob("s7-stacks/*.pcapng"))):
        result = without_analyzers(analyze(path))
        result.path = path.name
        found.append(result)
    line = without_analyzers(analyze(io.BytesIO(captured(everything_wrong().stage))))
    line.path = "line.pcapng"
    return [*found, line]


def as_lua(result: CaptureResult) -> dict[str, Any]:
    """A result with the keys and the times of the Lua side."""
    item = dataclasses.asdict(result)
    begin = 0 if result.start_ns is None else result.start_ns
    base = min((each["start_ns"] for each in item["transactions"]), default=begin) // 10**9
    item["base_seconds"] = base
    for each in item["transactions"]:
        each["start_ns"] -= base * 10**9
        for key in ("request", "response"):
            each[key] = None if each[key] is None else each[key].hex()
        for key in ("polls", "rereads"):
            pairs = each["frames"][key]
            each["frames"][key] = [{"request": one, "response": two} for one, two in pairs]
        for part in each["parameters"]:
            said = part["described"]
            part["described"] = said and {"name": said[0], "frames": list(said[1])}
    names = ("transactions", "findings", "base_seconds", "relations")
    item = {name: item[name] for name in names}
    for each in item["findings"]:
        each["args"] = with_points(each["args"])
        assert each.pop("said") is None  # the plugin reads no stored results
    return item


def with_points(value: Any) -> Any:
    """Arguments with their floats as texts, {"float": "30.0"}: JSON in Lua 5.2 makes 30 of them."""
    if isinstance(value, dict):
        return {name: with_points(each) for name, each in value.items()}
    if isinstance(value, list):
        return [with_points(each) for each in value]
    return {"float": repr(value)} if isinstance(value, float) else value


def finding(rule: str, frame: int, job: int | None, offset: int | None, /, **args: Any) -> Finding:
    """A finding of a rule, as serious as the rule is."""
    return Finding(rule, spec.rules()[rule].severity, frame, [frame], job, offset, args)


def job(kind: str, result: CaptureResult, **options: Any) -> dict[str, Any]:
    """What the driver takes: a result and what to make of it."""
    given = {"path": result.path, "frames": result.frames, **options}
    return {"kind": kind, "result": as_lua(result), "options": given}


def python_csv(result: CaptureResult) -> str:
    proved, stream = DriveObjects.of(result.transactions), io.StringIO()
    for each in result.transactions:
        each.drive_object = proved.reached(each)
    write_all(csv_report.Writer(stream), Report([result]))
    return stream.getvalue()


def odd_result() -> CaptureResult:
    """What no lab capture has: odd texts, many values, clocks set back, numbers at their ends."""
    texts = ["=1+2", "a,b", 'say "x"', "two\nlines", "\x1b[31m", "\xa0\xad\x85", "Grün", "\t", ""]
    parameters = [
        Parameter(1000 + i, i, "text", 1, format="VisibleString", value_count=1, values=[text])
        for i, text in enumerate(texts)
    ]
    numbers = [
        0.0,
        -0.0,
        1e-05,
        1.5e16,
        3.4e38,
        0.1,
        123456.79,
        -1.0,
        "NaN",
        "-Infinity",
        1e16,
        5.0,
    ]
    parameters += [
        Parameter(65535, 0, "value", 12, format="Float64", value_count=12, values=list(numbers)),
        Parameter(1, 1, "0x50", 0, format="0x7F", value_count=1, values=[]),
        Parameter(2, 65535, "value", 3, None, "°C", "N2", 3, [1, -2, 0], [0.1, -0.2, 0.0]),
        Parameter(3, 0, "value", 2, None, "s", "Unsigned64", 2, [2**53, "9007199254740993"]),
        Parameter(3, 0, "value", 1, None, None, "TimeOfDay", 1, [77], ["00:00:00.077"]),
        Parameter(4, 0, "value", 1, None, None, "VisibleString", 5, ["\t\x1b[2J\x9b\xad\x7f"]),
        Parameter(4, 1, "value", 2, None, "＝1", "VisibleString2", 2, [" =\\x1b", "\x85\xad é"]),
        Parameter(None, None, None, None, format="Unsigned8+Unsigned8", value_count=1, values=["0102"],
                  scaled=[1]),
    ]  # fmt: skip
    common = {"ar": None, "api": 2**32 - 1, "slot": 1, "index": 0xB02E, "request_reference": 255}
    frames = Frames(1, 2, 1234567, 12345678, [(3, 4), (None, 5)], [(9, 10)])
    first = Transaction(
        "change", "partial", "10.0.0.1", "-10.0.0.2", subslot=65535, axis=None, frames=frames,
        start_ns=951_782_400 * 10**9 - 1, duration_ns=12_345_678_901, request=None, response=None,
        write_status=0, read_status=0, parameters=parameters, findings=["DS401", "DS402"], id=1, **common,
    )  # fmt: skip
    second = dataclasses.replace(
        first, state="refused", operation="unknown", parameters=[], id=1000, controller="10.0.0.3",
        duration_ns=-5, write_status=0xDF80B500, start_ns=951_868_800 * 10**9 - 1, frames=Frames(7),
    )  # fmt: skip
    findings = [finding("DS101", n, 1, None, operation="\x07 ring") for n in range(1, 80)]
    findings += [finding("DS302", 4, None, 12, id=None), finding("DS415", 4, None, None)]
    times = [0.0, 2.25, 30.0, 1e16, 12.0005]
    findings += [finding("DS416", 5, 1, None, milliseconds=each, limit=200) for each in times]
    read = [30.0, 30, "x\x1b", None, 1e-05, -0.0, "NaN", "é" * 120]
    back = {"pnu": 7, "subindex": None, "written": 30.0, "by": 2}
    findings += [finding("DS417", 6, 1, None, read=each, **back) for each in read]
    return CaptureResult("a,b.pcapng", frames=1234567, complete=False, problem="ends in frame 3",
                         dropped=1, transactions=[first, second], findings=findings)  # fmt: skip


@cache
def cyclic_results() -> list[CaptureResult]:
    """Transactions of PKW beside others, more relations than are listed, lengths of no telegram."""
    found = [analyze(each.open()) for each in scenes()]
    named = tuple(map(parse, NAMES))
    for turned in (named, named[::-1], tuple(map(parse, ABSENT))):
        found.append(analyze(without_connect(), AnalysisOptions(cyclic=turned)))
    found += [analyze(io.BytesIO(capture(each))) for each in list(SCENES.values())[::5]]
    for result in found:
        result.path = "cyclic.pcapng"
    mixed = copy.deepcopy(found[0])
    mixed.transactions.append(handmade.transaction(id=3, state="unanswered"))
    mixed.transactions.append(dataclasses.replace(mixed.transactions[0], id=4, state="unanswered"))
    mixed.relations = mixed.relations * 23
    mixed.relations[1] = dataclasses.replace(mixed.relations[0], telegrams=[353, 354], cycle_ms=0.5)
    mixed.findings += [
        finding("DS501", 9, 4, None, pnu=None, subindex=0, code=None),
        finding("DS501", 9, 4, None, pnu=7, subindex=0, code=107),
    ]
    return [*found, mixed]


def empty_results() -> list[CaptureResult]:
    records = {str(47 + i): {"read": i, "write": 1} for i in range(8)}
    return [
        CaptureResult("-"),
        CaptureResult(
            "-", frames=1, rpc={"requests": 3, "responses": 0, "unanswered": 3}, records=records
        ),
    ]


SEVERITIES = ("error", "warning", "note")


def told_by_json(result: CaptureResult, lang: str) -> str:
    """The report of the plugin, made of the JSON of Python, without its blanks and ends of lines."""
    findings = [contract.FINDING.plain(each, lang) for each in result.findings]
    rules, zh = spec.rules(), lang == "zh"
    comma, colon = ("，", "：") if zh else (", ", ": ")

    def counted(key: str, items: list[str], order: Sequence[str], form: str) -> str:
        parts = [
            form.format(items.count(each), words(kind_of[key] + each, lang))
            for each in order
            if each in items
        ]
        return words(key, lang, len(items)) + (colon + comma.join(parts) if parts else "")

    kind_of = {"transactions": "state_", "findings": "severity_"}
    states = [each.state for each in result.transactions]
    severities = [each["severity"] for each in findings]
    told = [
        f"{escape(result.path)}: {words('frames', lang, result.frames)}",
        counted("transactions", states, STATES, "{}个{}" if zh else "{} {}"),
        counted("findings", severities, SEVERITIES, "{} {}"),
    ]
    by_rule = sorted(findings, key=lambda each: (SEVERITIES.index(each["severity"]), each["rule"]))
    for (severity, rule), group in groupby(by_rule, key=itemgetter("severity", "rule")):
        found, about = list(group), rules[rule]
        told += [
            words("findings_of_rule", lang, rule=rule, name=" " + about.name,
                  severity=words(f"severity_{severity}", lang),
                  findings=words("findings", lang, len(found))),
            "-> " + (about.advice_zh if zh else about.advice),
        ]  # fmt: skip
        for each in found:
            job = "" if each["transaction"] is None else f" #{each['transaction']}"
            frames = words("frame", lang, frame=", ".join(map(str, each["frames"])))
            told.append(f"{frames}{job}{colon}{escape(each['message'])}")
    return "".join("".join(told).split())


def words(key: str, lang: str, n: int = 0, /, **values: Any) -> str:
    """A text of the reports, filled in."""
    return say(key, n=n, **values).text(lang)


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_advice_is_about_what_was_seen(lua: Run, lang: str) -> None:
    """Of each rule: numbers and statuses that its advice names, others, and those of makers without a table."""
    found = [
        finding(row.id, 1, None, None, code=code, asked=asked, vendor_id=vendor)
        for row in spec.rules().values() if not row.analyzer_only
        for code in (None, 0x05, 0x11, 0x18, 0x23, 0x6B, 0x84, 0x0811) for asked in (None, 1, 2)
        for vendor in (None, 0x002A, 0x010B, 0x0213, 0x7ABC)
    ]  # fmt: skip
    found += [
        finding(row, 1, None, None, status=status)
        for row in ("DS201", "DS203") for status in ("DE80B000", "DF80B700", "DF80A900", "C0810100")
    ]  # fmt: skip
    (told,) = lua([job("advice", CaptureResult("-", findings=found), lang=lang)])
    assert told.split("\n") == [advice(spec.rules()[each.rule], each.args, lang) for each in found]


@pytest.mark.slow
@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_text_has_every_finding_of_the_json_with_its_frames_and_advice(
    lua: Run, results: list[CaptureResult], lang: str
) -> None:
    everything = [*results, odd_result(), *empty_results(), *cyclic_results()]
    texts = lua([job("report", each, lang=lang) for each in everything])
    for result, text in zip(everything, texts, strict=True):
        assert "".join(text.split()) == told_by_json(result, lang), result.path
        assert all(columns(line) <= 100 or " " not in line.strip() for line in text.splitlines())


def test_the_text_of_a_short_capture(lua: Run) -> None:
    items = [handmade.transaction(), handmade.transaction(id=2, state="refused")]
    found = [
        finding("DS203", 6, 2, None, status="DF80B700"),
        finding("DS402", 9, 1, None, case="ends"),
    ]
    result = CaptureResult("x", frames=9, transactions=items, findings=found)
    (text,) = lua([job("report", result)])
    assert text.startswith(
        "x: 9 frames\n2 transactions: 1 ok, 1 refused\n2 findings: 1 error, 1 note\n\n"
        "DS203 error write-refused: 1 finding\n  -> 0xB0: no parameter channel "
    )
    assert "\n  frame 6 #2: Write refused with status DF80B700: write: " in text
    assert text.endswith("\n")


def test_statistics_name_a_drive_object_only_where_it_is_one(
    lua: Run,
) -> None:
    ways = [(47, 2), (47, 0), (0xB02E, 9)]
    jobs = [
        handmade.transaction(id=n, index=index, axis=axis)
        for n, (index, axis) in enumerate(ways, 1)
    ]
    (text,) = lua([job("statistics", CaptureResult(path="x", transactions=jobs))])
    for place in ("192.168.133.33 DO 2\n", "192.168.133.33 axis 0\n", "192.168.133.33 slot 1.1\n"):
        assert place in text


def test_csv_is_that_of_python(lua: Run, results: list[CaptureResult]) -> None:
    everything = [*results, odd_result(), *empty_results(), *cyclic_results(), telegrams_said()]
    texts = lua([job("csv", each) for each in everything])
    for result, text in zip(everything, texts, strict=True):
        assert text == python_csv(result), result.path
    column = csv_report.COLUMNS.index("telegram")
    told = [line.split(",")[column] for line in texts[-1].splitlines()[1:]]
    assert told == ["102", "105", "102", "", "", "102"]


def telegrams_said() -> CaptureResult:
    """p0922 of drive objects: read, changed, refused, of a number that none has, and other parameters."""
    ways = [(2, 922, 105, "ok"), (3, 922, 105, "ok"), (2, 922, 102, "partial"), (4, 922, 7, "error"),
            (5, 922, 0, "ok"), (2, 1120, 3, "ok")]  # fmt: skip
    jobs = [
        handmade.transaction(
            id=n, axis=axis, state=state, index=0xB02F, operation="change" if n == 3 else "read",
            parameters=[Parameter(pnu, 0, "value", 0, format="Unsigned16", value_count=1, values=[number])],
        )
        for n, (axis, pnu, number, state) in enumerate(ways, 1)
    ]  # fmt: skip
    return CaptureResult("telegrams.pcapng", transactions=jobs)


def test_times_of_every_kind_of_day(lua: Run) -> None:
    """The calendar: ends of years, leap days, the days of a century, years of five digits."""
    everything = []
    for day in [0, 58, 59, 364, 11_015, 11_016, 11_017, 47_540, 2_932_896, 10_000_000]:
        result = odd_result()
        start_ns = (day * 86_400 + 86_399) * 10**9 + 7
        result.transactions = [dataclasses.replace(result.transactions[1], start_ns=start_ns)]
        everything.append(result)
    assert lua([job("csv", each) for each in everything]) == [
        python_csv(each) for each in everything
    ]


def rows(text: str, title: str, lines_each: int = 1) -> list[list[str]]:
    """The rows of one table of the statistics below its head, cells apart; a row may have several lines."""
    lines = text.split("\n\n" + title)[1].split("\n\n")[0].splitlines()
    head = next(place for place, line in enumerate(lines) if set(line.strip()) == {"-"})
    below = lines[head + 1 :]
    return [
        " ".join(below[place : place + lines_each]).split()
        for place in range(0, len(below), lines_each)
    ]


def tour(results: list[CaptureResult]) -> CaptureResult:
    return copy.deepcopy(next(each for each in results if each.path == "tour-machine.pcapng"))


def test_statistics_count_what_the_result_holds(lua: Run, results: list[CaptureResult]) -> None:
    wanted = job("statistics", tour(results))
    for number, each in enumerate(wanted["result"]["transactions"]):
        each["drive_ns"] = 1_000_000 * number
    text = lua([wanted])[0]
    assert text.startswith(
        "DS47 statistics: tour-machine.pcapng\n37 frames, 8 transactions (4 ok, "
    )
    times = rows(text, "Response time in ms: from the Write request to the Read response")
    assert times == [
        ["192.168.133.33"],
        ["read", "4", "4", "3.000", "4.000", "3.000", "7.000", "7.000"],
        ["change", "4", "2", "3.000", "15.000", "3.000", "27.000", "27.000"],
        ["all", "8", "6", "3.000", "7.667", "3.000", "27.000", "27.000"],
    ]
    shares = rows(text, "Share of the drive in ms: the same without the pause of the program")[1]
    assert shares == ["read", "4", "4", "0.000", "2.750", "2.000", "6.000", "6.000"]
    errors = rows(text, "Negative responses by error number")
    assert [row[:4] for row in errors if row[0].startswith("0x")] == [
        ["0x6B", "1", "29", "192.168.133.33"],
        ["0x00", "1", "33", "192.168.133.33"],
    ]
    refused = rows(text, "Refused record calls")
    assert refused[0][:5] == ["DF80B500", "write", "1", "23", "192.168.133.33"]
    slow = rows(text, "Slowest transactions", 2)
    assert len(slow) == 6
    assert slow[0][:7] == ["27.000", "1.000", "#2", "13", "change", "192.168.133.33", "DO"]
    open_ones = rows(text, "Requests without a response (unanswered, superseded, incomplete)", 2)
    assert open_ones == [
        ["34", "#8", "unanswered", "change", "192.168.133.33", "DO", "2", "p50303[0]", ":=", "10.0"]
    ]
    rules = rows(text, "Findings by rule")
    told = [row[0] for row in rules if not row[0].startswith("DS7")]
    assert told == ["DS203", "DS410", "DS417", "DS402"]
    assert rules[1][:4] == ["DS410", "error", "2", "29"]


def test_statistics_of_nothing(lua: Run) -> None:
    texts = lua([job("statistics", each) for each in empty_results()])
    assert all(text.count("  none\n") == 7 for text in texts)


def test_negative_times_are_left_out_and_said(lua: Run) -> None:
    text = lua([job("statistics", odd_result())])[0]
    assert "1 negative times left out" in text
    assert rows(text, "Slowest transactions")[0][0] == "12345.7"


def test_chinese_columns_stand_under_each_other(lua: Run, results: list[CaptureResult]) -> None:
    text = lua([job("statistics", tour(results), lang="zh")])[0]
    assert text.startswith("DS47 统计")
    lines = text.split("\n\n")[1].splitlines()

    def column(line: str, what: str) -> int:
        before = line[: line.index(what)]
        return sum(2 if unicodedata.east_asian_width(char) in "WF" else 1 for char in before)

    assert column(lines[1], "操作") + 2 == column(lines[4], "读") == column(lines[5], "修改")
    right = [len(line) + sum(unicodedata.east_asian_width(char) in "WF" for char in line)
             for line in lines[1:2] + lines[4:]]  # fmt: skip
    assert len(set(right)) == 1


def test_long_lists_are_cut_and_say_so(lua: Run) -> None:
    base = odd_result()
    item = dataclasses.replace(base.transactions[0], state="unanswered", duration_ns=None)
    base.transactions = [dataclasses.replace(item, id=n) for n in range(1, 61)]
    text = lua([job("statistics", base)])[0]
    assert "  and 10 more\n" in text
    cut = rows(text, "Requests without a response (unanswered, superseded, incomplete)")[1]
    assert cut[-1].endswith("...")


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_tables_fit_the_window_of_wireshark(
    lua: Run, results: list[CaptureResult], lang: str
) -> None:
    """Its window for a text is 72 columns wide: a longer line would be broken there."""
    texts = lua([job("statistics", each, lang=lang) for each in [*results, odd_result()]])
    lines = {line for text in texts for line in text.splitlines()}
    assert len(lines) > 500
    assert [line for line in lines if columns(line) > 72] == []


A, B = "192.168.133.33", "192.168.133.40"


def timed(number: int, milliseconds: int | None, **changes: Any) -> Transaction:
    """A transaction of the first drive that took so long."""
    nanoseconds = None if milliseconds is None else milliseconds * 1_000_000
    frames = Frames(4 * number, 4 * number + 1, 4 * number + 2, 4 * number + 3)
    usual = {"id": number, "duration_ns": nanoseconds, "frames": frames}
    return handmade.transaction(**usual | changes)


def statistics(
    lua: Run, *transactions: Transaction, shares: Any = (), order: Any = None, **changes: Any
) -> str:
    """The statistics; `shares` has the times of the drive in ms, one a transaction."""
    result = CaptureResult("line.pcapng", frames=99, transactions=list(transactions), **changes)
    wanted = job("statistics", result, **({"order": order} if order else {}))
    for each, share in zip(wanted["result"]["transactions"], shares, strict=False):
        each["drive_ns"] = share * 1_000_000
    return lua([wanted])[0]


RESPONSE_TIME = "Response time in ms: from the Write request to the Read response"
SHARE = "Share of the drive in ms: the same without the pause of the program\nbefore its first Read"
SLOWEST = "Slowest transactions"
OPEN = "Requests without a response (unanswered, superseded, incomplete)"


def test_half_of_the_times_are_at_most_p50_and_95_of_100_at_most_p95(lua: Run) -> None:
    """Twenty times of 1 to 20 ms: the 10th and the 19th; the 18th would be the 90th percentile."""
    times = [7, 20, 1, 13, 4, 18, 10, 2, 16, 5, 19, 8, 11, 3, 14, 6, 17, 9, 12, 15]
    jobs = [timed(number, time) for number, time in enumerate(times, 1)]
    text = statistics(lua, *jobs, shares=[time + 100 for time in times])
    device, row = rows(text, RESPONSE_TIME)
    assert device == [A]
    assert row == ["read", "20", "20", "1.000", "10.500", "10.000", "19.000", "20.000"]
    _, row = rows(text, SHARE)
    assert row == ["read", "20", "20", "101.000", "110.500", "110.000", "119.000", "120.000"]


def test_times_stand_by_device_and_operation_with_their_sum_last(lua: Run) -> None:
    """Devices as they first come, reads before changes; a time of 0 is one, a negative one is not."""
    jobs = [
        timed(1, 5, device=B, operation="change"),
        timed(2, 1, device=A),
        timed(3, None, device=B),
        timed(4, 0, device=B),
        timed(5, -3, device=A, operation="change"),
        timed(6, 3, device=A),
    ]
    text = statistics(lua, *jobs, shares=[4, 1, 2, 0, 2, 2])
    assert rows(text, RESPONSE_TIME)[:-1] == [
        [B],
        ["read", "2", "1", "0.000", "0.000", "0.000", "0.000", "0.000"],
        ["change", "1", "1", "5.000", "5.000", "5.000", "5.000", "5.000"],
        [A],
        ["read", "2", "2", "1.000", "2.000", "1.000", "3.000", "3.000"],
        ["change", "1", "0", "-", "-", "-", "-", "-"],
        ["all", "6", "4", "0.000", "2.250", "1.000", "5.000", "5.000"],
    ]
    assert f"\n  1 negative times left out: the clock was set back\n\n{SHARE}\n" in text
    shares = rows(text, SHARE)  # of what has a response only
    assert shares[:2] == [[B], ["read", "2", "1", "0.000", "0.000", "0.000", "0.000", "0.000"]]
    assert shares[-1] == ["all", "6", "5", "0.000", "1.800", "2.000", "4.000", "4.000"]
    assert text.count("negative times") == 1


def test_the_mean_of_one_time_is_that_time(lua: Run) -> None:
    _, row = rows(statistics(lua, timed(1, None, duration_ns=499)), RESPONSE_TIME)
    assert row[4] == "0.000"


def test_from_a_second_on_times_have_a_tenth_of_a_millisecond(lua: Run) -> None:
    jobs = [timed(1, None, duration_ns=999_999_499), timed(2, None, duration_ns=1_000_000_000)]
    _, row = rows(statistics(lua, *jobs), RESPONSE_TIME)
    assert (row[3], row[7]) == ("999.999", "1000.0")


def test_the_meaning_of_a_status_is_of_the_language_asked_for(lua: Run) -> None:
    refused = timed(1, 1, state="refused", write_status=0xDF80B500)
    wanted = job("statistics", CaptureResult("x", transactions=[refused]), lang="zh")
    found = rows(lua([wanted])[0], "被拒绝的记录调用")
    told = [" ".join(row[5 if number == 0 else 0 :]) for number, row in enumerate(found)]
    assert "".join(told) == status_text(0xDF80B500, "zh")


def test_error_numbers_and_refused_calls_are_counted_the_most_frequent_first(lua: Run) -> None:
    """By device and meaning; what is as frequent as another stands as it came. STATUS 0 is no refusal."""

    def negative(code: int | None) -> Parameter:
        error = ParameterError(code, None, 0x2A)
        return Parameter(5, 0, "value", 1, format="Error", value_count=1, values=[], error=error)

    no, never = negative(0x6B), negative(0x11)
    jobs = [
        timed(1, 1, parameters=[never]),
        timed(2, 1, parameters=[no, Parameter(6, 0, "value", 1, values=[])]),
        timed(3, 1, device=B, parameters=[no]),
        timed(4, 1, parameters=[negative(None), no]),
        timed(5, 1, state="refused", write_status=0xDF80B500, read_status=None),
        timed(6, 1, state="refused", read_status=0xDE80B700),
        timed(7, 1, state="refused", read_status=0xDE80B700),
        timed(8, 1, device=B, state="refused", read_status=0xDE80B700),
    ]
    text = statistics(lua, *jobs)
    found = rows(text, "Negative responses by error number")
    numbers = [place for place, row in enumerate(found) if row[0] == "-" or row[0].startswith("0x")]
    joined = [list(chain(*found[place:end])) for place, end in pairwise([*numbers, len(found)])]
    assert joined == [
        ["0x6B", "2", "11", A, *spec.error_text(0x6B, "en", 0x2A).split()],
        ["0x11", "1", "7", A, *spec.error_text(0x11).split()],
        ["0x6B", "1", "15", B, *spec.error_text(0x6B, "en", 0x2A).split()],
        ["-", "1", "19", A],
    ]
    refused = rows(text, "Refused record calls")
    assert [row[:5] for row in refused if re.fullmatch("[0-9A-F]{8}", row[0])] == [
        ["DE80B700", "read", "2", "27", A],
        ["DF80B500", "write", "1", "21", A],
        ["DE80B700", "read", "1", "35", B],
    ]


def test_the_slowest_ten_stand_by_their_time_then_by_their_number(lua: Run) -> None:
    """A negative time is none; 0 is one, where there is room."""
    times = [3, 9, 3, None, 12, -9, 3, 1, 10, 11, 2, 0, 3, 7]
    jobs = [timed(number, time) for number, time in enumerate(times, 1)]
    shown = rows(statistics(lua, *jobs), SLOWEST, 2)
    numbers = ["#5", "#10", "#9", "#2", "#14", "#1", "#3", "#7", "#13", "#11"]
    assert [row[2] for row in shown] == numbers
    assert shown[0][:5] == ["12.000", "-", "#5", "23", "read"]
    few = rows(statistics(lua, timed(1, 0), timed(2, -1), timed(3, None)), SLOWEST, 2)
    assert [row[2] for row in few] == ["#1"]


def test_who_has_no_response_is_listed_in_the_order_of_the_capture(lua: Run) -> None:
    states = ["unanswered", "ok", "superseded", "orphan", "refused", "unanswered"]
    jobs = [timed(number, 1, state=state) for number, state in enumerate(states, 1)]
    shown = rows(statistics(lua, *jobs), OPEN, 2)
    assert [row[:3] for row in shown] == [
        ["4", "#1", "unanswered"],
        ["12", "#3", "superseded"],
        ["24", "#6", "unanswered"],
    ]


NEAR, FAR = "192.168.0.9", "192.168.0.10"
ORDERS = {
    "": ([FAR, "read", "change", NEAR, "read", "all"], ["#2", "#4", "#1", "#5"], ["#3", "#6"]),
    "device": (
        [NEAR, "read", FAR, "read", "change", "all"],
        ["#4", "#2", "#1", "#5"],
        ["#6", "#3"],
    ),
    "time": ([FAR, "change", "read", NEAR, "read", "all"], ["#2", "#4", "#1", "#5"], ["#3", "#6"]),
    "-time": ([FAR, "read", "change", NEAR, "read", "all"], ["#5", "#1", "#4", "#2"], ["#3", "#6"]),
    "count": ([FAR, "read", "change", NEAR, "read", "all"], ["#2", "#4", "#1", "#5"], ["#3", "#6"]),
    "-count": (
        [FAR, "change", "read", NEAR, "read", "all"],
        ["#2", "#4", "#1", "#5"],
        ["#3", "#6"],
    ),
    "frame": ([FAR, "read", "change", NEAR, "read", "all"], ["#1", "#2", "#4", "#5"], ["#3", "#6"]),
    "-frame": (
        [FAR, "read", "change", NEAR, "read", "all"],
        ["#5", "#4", "#2", "#1"],
        ["#6", "#3"],
    ),
}
"""Order, with a minus the other way round -> first cells of times, numbers of the slowest, and of those without a
response. By device the numbers in an address count as such."""


@pytest.mark.parametrize("order", ORDERS)
def test_tables_are_sorted_by_the_column_that_was_chosen(lua: Run, order: str) -> None:
    jobs = [
        timed(1, 5, device=FAR),
        timed(2, 9, device=FAR, operation="change"),
        timed(3, None, device=FAR, state="unanswered"),
        timed(4, 7, device=NEAR),
        timed(5, 1, device=FAR),
        timed(6, None, device=NEAR, state="unanswered"),
    ]
    chosen = {"by": order.removeprefix("-"), "reversed": order.startswith("-")} if order else None
    text = statistics(lua, *jobs, order=chosen)
    times, slowest, none = ORDERS[order]
    assert [row[0] for row in rows(text, RESPONSE_TIME)] == times
    assert [row[2] for row in rows(text, SLOWEST, 2)] == slowest
    assert [row[1] for row in rows(text, OPEN, 2)] == none
    heads = {"time": "Max*", "count": "Count*", "device": "Device*", "frame": "Frame*"}
    marked = {head for head in heads.values() if head in text}
    assert marked == ({heads[order.removeprefix("-")]} if order else set())


def test_a_number_that_is_missing_comes_last_either_way(lua: Run) -> None:
    jobs = [timed(1, None), timed(2, 3, operation="change")]
    for reverse in (False, True):
        text = statistics(lua, *jobs, order={"by": "time", "reversed": reverse})
        assert [row[0] for row in rows(text, RESPONSE_TIME)] == [A, "change", "read", "all"]


def test_a_table_has_fifty_rows_and_says_how_many_more_there_are(lua: Run) -> None:
    jobs = [timed(number, None, state="unanswered") for number in range(1, 52)]
    text = statistics(lua, *jobs[:50])
    assert len(rows(text, OPEN, 2)) == 50
    assert "more" not in text
    text = statistics(lua, *jobs)
    assert len(rows(text, OPEN, 2)) == 51  # the last one says how many
    assert "\n  and 1 more\n" in text


@pytest.mark.parametrize(
    ("parameters", "shown"),
    [
        ([], "-"),
        ([(1, [])], "p0001[0]"),
        ([(1, [7])], "p0001[0] := 7"),
        ([(1, [7]), (None, [8])], "p0001[0] := 7; p? := 8"),
        ([(1234, [])] * 4 + [(12345, [])] * 2, "p1234[0]; " * 4 + "p12345[0]; p12345[0]"),
        ([(1234, [])] * 3 + [(12345, [])] * 3, "p1234[0]; " * 3 + "p12345[0]; p12345[0]; p1234..."),
        ([(1, [])] * 20, "p0001[0]; " * 5 + "p0001[0..."),
    ],
)
def test_what_was_asked_is_cut_where_it_has_no_room(
    lua: Run, parameters: list[tuple[int | None, list[int]]], shown: str
) -> None:
    """After 60 columns; the three points are among them."""
    asked = [
        Parameter(pnu, 0, "value", 1, format="Unsigned8", value_count=1, values=values)
        for pnu, values in parameters
    ]
    item = timed(1, None, operation="change", state="unanswered", parameters=asked)
    text = statistics(lua, item)
    lines = text.split(OPEN)[1].splitlines()
    assert lines[4].endswith("DO 2")
    assert lines[5].strip() == shown
    assert len(shown) <= 60


def test_a_read_asks_for_no_value(lua: Run) -> None:
    read = Parameter(1, 0, "value", 1, format="Unsigned8", value_count=1, values=[7])
    assert "p0001[0] :=" not in statistics(lua, timed(1, 5, parameters=[read]))


def test_the_statistics_as_they_are_printed(lua: Run) -> None:
    """Numbers end under each other, texts begin there; the line below the titles is as wide as the table."""
    value = Parameter(50303, 0, "value", 1, format="Unsigned8", value_count=1, values=[10])
    error = ParameterError(0x6B, 0, 0x2A)
    jobs = [
        timed(1, 12, parameters=[value]),
        timed(2, 1234, operation="change", state="error",
              parameters=[dataclasses.replace(value, values=[], error=error)]),
        timed(3, None, state="unanswered", parameters=[value], frames=Frames(13)),
    ]  # fmt: skip
    findings = [
        finding("DS415", 9, 2, None),
        finding("DS410", 11, 2, 4, code=0x6B),
        finding("DS410", 12, 2, 4, code=0x6B),
    ]
    text = statistics(lua, *jobs, shares=[2, 3], findings=findings)
    assert text == PRINTED


PRINTED = """\
DS47 statistics: line.pcapng
99 frames, 3 transactions (1 ok, 1 error, 1 unanswered), 3 findings

Response time in ms: from the Write request to the Read response
  Operation  Count  Timed     Min     Mean     p50     p95     Max
  ----------------------------------------------------------------
  192.168.133.33
    read         2      1  12.000   12.000  12.000  12.000  12.000
    change       1      1  1234.0   1234.0  1234.0  1234.0  1234.0
  all            3      2  12.000  623.000  12.000  1234.0  1234.0

Share of the drive in ms: the same without the pause of the program
before its first Read
  Operation  Count  Timed    Min   Mean    p50    p95    Max
  ----------------------------------------------------------
  192.168.133.33
    read         2      1  2.000  2.000  2.000  2.000  2.000
    change       1      1  3.000  3.000  3.000  3.000  3.000
  all            3      2  2.000  2.500  2.000  3.000  3.000

Negative responses by error number, each with its first frame
  Code  Count  Frame  Device          Meaning
  ----------------------------------------------------------------------
  0x6B      1     11  192.168.133.33  No change access while the
                                      controller is enabled

Refused record calls, each with its first frame
  none

Slowest transactions
      ms  Drive  No.  Frame  Operation  Device
      Asked
  ---------------------------------------------------------
  1234.0  3.000   #2     11  change     192.168.133.33 DO 2
      p50303[0]
  12.000  2.000   #1      7  read       192.168.133.33 DO 2
      p50303[0]

Requests without a response (unanswered, superseded, incomplete)
  Frame  No.  State       Operation  Device
      Asked
  ------------------------------------------------------
     13   #3  unanswered  read       192.168.133.33 DO 2
      p50303[0]

Findings by rule, each with its first frame
  Rule   Severity  Count  Frame  Name
  ----------------------------------------------------------------
  DS410  error         2     11  Negative response for a parameter
  DS415  note          1      9  Same request reference again
"""
