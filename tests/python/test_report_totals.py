"""What the reports count and sum up, with numbers that are typed by hand and no file read."""

from __future__ import annotations

import io
import json
import sys
from collections import Counter
from dataclasses import replace
from typing import Any

import handmade
import pytest

from ds47.model import (
    CaptureFile,
    CaptureResult,
    Device,
    Finding,
    Parameter,
    ParameterError,
    Report,
    Transaction,
)
from ds47.report import ReportOptions, write_all
from ds47.report.bilingual import Both
from ds47.report.html.views import Overview, capture_view
from ds47.report.html.views.drives import drives
from ds47.report.html.views.elements import elements
from ds47.report.latency import Latency, percentile
from ds47.report.overview import CaptureRow, Writer, document, lines, total, worst_first
from ds47.report.todo import answering, uncovered
from ds47.report.verdict import VerdictCounts, blind, verdict
from ds47.report.zones import zone

A, B = "192.168.133.33", "192.168.133.40"
MS = 1_000_000


def finding(rule: str, job: int | None = None, severity: str = "error", **args: Any) -> Finding:
    return Finding(rule, severity, 9, [9], job, None, args)


def capture(*jobs: Transaction, **changes: Any) -> CaptureResult:
    return replace(CaptureResult("line.pcapng", frames=9, transactions=list(jobs)), **changes)


def job(number: int, state: str = "ok", **changes: Any) -> Transaction:
    return handmade.transaction(id=number, state=state, **changes)


# Times


@pytest.mark.parametrize(
    ("percent", "expected"), [(5, 1), (50, 10), (51, 11), (90, 18), (95, 19), (96, 20), (100, 20)]
)
def test_so_many_of_a_hundred_are_at_most_the_percentile(percent: int, expected: int) -> None:
    """The nearest rank, of twenty times."""
    assert percentile(range(1, 21), percent) == expected


def test_the_percentile_of_one_is_that_one() -> None:
    assert [percentile([7], percent) for percent in (1, 50, 95, 100)] == [7] * 4


def test_half_of_the_times_are_at_most_the_first_number_and_95_of_100_at_most_the_second() -> None:
    """The 18th of twenty would be the 90th percentile."""
    times = [7, 20, 1, 13, 4, 18, 10, 2, 16, 5, 19, 8, 11, 3, 14, 6, 17, 9, 12, 15]
    told = Latency(each * MS for each in times).text()
    assert "10.0 ms" in told
    assert "19.0 ms" in told
    assert "20.0 ms" in told
    assert told == Latency(each * MS for each in sorted(times)).text()


def test_of_two_hundred_times_190_are_at_most_p95() -> None:
    assert percentile(range(1, 201), 95) == 190
    assert (
        Latency(each * MS for each in range(200))
        .text()
        .startswith("latency p50 99.0 ms, p95 189.0 ms")
    )


def test_a_time_counts_as_often_as_it_was() -> None:
    """Nine of 1 ms, nine of 2 ms and two of 3 ms."""
    one, other = Latency([MS] * 9 + [3 * MS]), Latency([2 * MS] * 9 + [3 * MS])
    one.update(other)
    assert one.text() == Latency([2 * MS, *[MS] * 9, *[2 * MS] * 8, 3 * MS, 3 * MS]).text()
    assert one.text() == "latency p50 2.0 ms, p95 3.0 ms, p99 3.0 ms, max 3.0 ms"


def test_a_clock_set_back_leaves_times_that_are_only_counted() -> None:
    """0 is a time; of none nothing is said."""
    assert Latency().text() == ""
    assert Latency([0]).text() == "latency p50 0.000 ms, p95 0.000 ms, p99 0.000 ms, max 0.000 ms"
    assert Latency([-1, -5 * MS]).text() == "latency unknown (2 negative times left out)"
    both = Latency([MS, -1])
    both.update(Latency([-1]))
    told = "latency p50 1.0 ms, p95 1.0 ms, p99 1.0 ms, max 1.0 ms (2 negative times left out)"
    assert both.text() == told


# The verdict


def test_the_counts_of_captures_are_added() -> None:
    one = VerdictCounts.of(
        capture(
            job(1),
            job(2, "refused", operation="change"),
            findings=[finding("DS101"), finding("DS402", severity="warning")],
        )
    )
    assert (one.captures, one.frames, one.unreadable, one.jobs, one.calls) == (1, 9, 0, 2, 1)
    cut = capture(job(1, device=B), complete=False, findings=[finding("DS207"), finding("DS105")])
    other = VerdictCounts.of(cut)
    assert other.unreadable == 1
    for _ in range(2):
        one.add(other)
    assert (one.captures, one.frames, one.unreadable, one.jobs, one.calls) == (3, 27, 2, 4, 5)
    assert one.drives == {A, B}
    assert one.states == {"ok": 3, "refused": 1}
    assert one.operations == {"read": 3, "change": 1}
    assert one.severities == {"error": 5, "warning": 1}


@pytest.mark.parametrize(
    ("counts", "level"),
    [
        ({}, "none"),
        ({"unreadable": 1}, "warn"),
        ({"jobs": 1}, "good"),
        ({"jobs": 1, "states": Counter(superseded=1)}, "warn"),
        ({"jobs": 1, "states": Counter(unanswered=1)}, "warn"),
        ({"jobs": 1, "states": Counter(mismatch=1)}, "bad"),
        ({"severities": Counter(warning=1)}, "warn"),
        ({"severities": Counter(error=1, warning=1)}, "bad"),
    ],
)
def test_the_verdict_is_as_bad_as_the_worst(counts: dict[str, Any], level: str) -> None:
    assert VerdictCounts(**counts).level == level


def test_a_verdict_says_what_could_not_be_read() -> None:
    told = "WARNING: 1 drive, 1 transaction, all done; 1 capture not read to its end"
    assert verdict(VerdictCounts(jobs=1, drives={A}, unreadable=1)).en == told


BLIND = [
    job(1, operation="change"),
    job(2, "unanswered"), job(3, "superseded"), job(4, "unanswered"),
    job(5, "orphan", ar="a"), job(6, "orphan", ar="a"), job(7, "orphan"), job(8, "orphan"), job(9, "orphan"),
]  # fmt: skip
RECORDS = {"47": {"read": 9}, "57408": {"read": 9, "write": 9}, "5": {"read": 2, "write": 3}}


def test_what_a_capture_cannot_show_is_counted() -> None:
    """Without its response: 3; begun before the capture: 2; without an AR: 3; other records: 5."""
    devices = [Device(A), Device(B, station=""), Device("192.168.133.2", station="plc")]
    shown = blind(capture(*BLIND, records=RECORDS, devices=devices))
    begins = [
        "Whether an accepted value is still in force later: ",
        "Whether the capturing computer lost frames: ",
        "The station names of 2 devices: ",
        "What the drive did with 3 requests: ",
        "Which requests 2 responses belong to: ",
        "Which requests 3 responses read without an AR belong to.",
        "5 other record requests (diagnosis, identification and the like): ",
    ]
    assert [each.en[: len(start)] for each, start in zip(shown, begins, strict=True)] == begins


def test_what_a_capture_shows_is_not_told_as_blind() -> None:
    assert blind(capture(job(1), dropped=0, records={"47": {"read": 9}})) == []
    failed = [job(1, "error", operation="change"), job(2, "partial")]
    assert blind(capture(*failed, dropped=0)) == []


# The drives of the page


def test_a_drive_counts_each_outcome_apart() -> None:
    """A refused record call is no failed transaction; times are those that can be true."""
    jobs = [
        job(1, "refused", duration_ns=None),
        job(2, "refused", duration_ns=-1),
        job(3, "error", duration_ns=9),
        job(4, duration_ns=3, operation="change", controller="plc 2"),
        job(5, duration_ns=0),
        job(6, "partial", duration_ns=5),
        job(7, device=B, duration_ns=None),
    ]
    first, second = drives(capture(*jobs, devices=[Device(A, station="press-1")]))
    assert (first.device.station, second.device) == ("press-1", Device(B))
    assert first.states == {"refused": 2, "error": 1, "ok": 2, "partial": 1}
    assert first.outcomes.en == "2 ok, 1 partial, 1 error, 2 refused"
    assert first.operations == {"read": 5, "change": 1}
    assert first.controllers == {"192.168.133.2", "plc 2"}
    assert (first.durations, first.median, first.slowest) == ([0, 3, 5, 9], 3, 9)
    assert (second.median, second.slowest) == (None, None)


def test_a_drive_object_of_a_drive_is_one_that_responded() -> None:
    jobs = [job(1, axis=2), job(2, "error", axis=3), job(3, "refused", axis=4), job(4, axis=0)]
    (drive,) = drives(capture(*jobs))
    assert drive.objects == {2, 3}


def test_the_time_that_a_capture_spans() -> None:
    second = 10**9
    begin = 1_767_225_600 * second
    starts = (begin + 2 * second, begin, begin + 1_500 * second)
    jobs = [job(number, start_ns=each) for number, each in enumerate(starts, 1)]
    result = capture(*jobs)
    result.start_ns, result.end_ns = begin - second, begin + 1_600 * second
    shown = capture_view(result, 1, 9, zone=zone("Asia/Shanghai")).span
    assert shown == Both(
        "2026-01-01 07:59:59.000 +08:00 (Asia/Shanghai) to 08:26:40.000, 1601.0 s",
        "2026-01-01 07:59:59.000 +08:00 (Asia/Shanghai) 至 08:26:40.000，共 1601.0 s",
    )
    assert capture_view(capture(), 1, 9).span is None


def test_the_overview_says_when_each_capture_began_and_how_long_it_is() -> None:
    def row(path: str, errors: int, start: str, end: str) -> CaptureRow:
        return CaptureRow(path, findings={"error": errors}, start=f"{start}Z", end=f"{end}Z")

    rows = [
        row("a", 3, "2026-11-21T11:14:03.999999999", "2026-11-21T11:14:05.500000000"),
        row("b", 2, "2026-11-21T23:00:00.000000000", "2026-11-21T22:00:00.000000000"),
        row("c", 1, "1970-01-01T00:00:01.000000000", "1970-01-01T00:00:02.000000000"),
        CaptureRow.unreadable("d", "why"),
    ]
    head, names, *lines = worst_first(rows, ReportOptions(zone=zone("Europe/Berlin")))
    assert head == "Captures, the worst first (times: Europe/Berlin)"
    assert names.split()[-3:] == ["start", "length", "capture"]
    assert [line.split()[5:] for line in lines] == [
        ["-", "-", "d", "not", "readable:", "why"], ["2026-11-21", "12:14:03", "1.50", "s", "a"],
        ["2026-11-22", "00:00:00", "-", "b"], ["-", "1.00", "s", "c"],
    ]  # fmt: skip
    assert CaptureRow.loaded(rows[0].plain()) == rows[0]
    older = rows[0].plain()
    del older["start"], older["end"]
    assert CaptureRow.loaded(older).length_ns is None


def test_the_tiles_of_a_capture_have_the_times_that_can_be_true() -> None:
    times = [None, -5, 0, 4, 8, 9]
    view = capture_view(
        capture(*(job(n, duration_ns=each) for n, each in enumerate(times, 1))), 1, 9
    )
    assert (view.median, view.slowest) == (4, 9)
    assert (view.jobs, view.rows, view.problems_left_out) == (6, 6, 0)
    empty = capture_view(capture(), 1, 9)
    assert (empty.median, empty.slowest, empty.plots) == (None, None, False)


def test_the_sum_over_captures_has_no_number_and_counts_who_cannot_be_read() -> None:
    bad = Overview.unreadable("x", 1, "why")
    assert (bad.level, bad.text.en) == ("bad", "NOT READ: why")
    summed = Overview.of_all([bad, bad])
    assert (summed.number, summed.counts.captures, summed.counts.unreadable) == (0, 2, 2)


# The parameters of the page


def parameter(pnu: int | None = 5, subindex: int | None = 0, **changes: Any) -> Parameter:
    usual = Parameter(pnu, subindex, "value", 1, format="Unsigned8", value_count=1, values=[7])
    return replace(usual, **changes)


def table_of(*jobs: Transaction) -> list[list[Any]]:
    """The rows: device, drive object, PNU, subindex, 3 of the name, reads, accepted, negative, ..."""
    rows: list[list[Any]] = elements(capture(*jobs))[0]["rows"]
    return rows


def test_parameters_stand_by_device_drive_object_pnu_and_subindex() -> None:
    asked = [(B, 2, 1, 0), (A, 3, 1, 0), (A, 2, 9, 1), (A, 2, 9, 0), (A, 2, 3, 5)]
    jobs = [
        job(n, device=device, axis=axis, parameters=[parameter(pnu, subindex)])
        for n, (device, axis, pnu, subindex) in enumerate(asked, 1)
    ]
    assert [row[:4] for row in table_of(*jobs)] == [
        [A, "DO 2", 3, 5],
        [A, "DO 2", 9, 0],
        [A, "DO 2", 9, 1],
        [A, "DO 3", 1, 0],
        [B, "DO 2", 1, 0],
    ]


def test_what_is_not_about_a_value_of_a_known_parameter_is_not_in_the_table() -> None:
    jobs = [
        job(1, "mismatch", parameters=[parameter(1)]),
        job(2, "orphan", parameters=[parameter(2)]),
        job(3, parameters=[parameter(None)]),
        job(4, parameters=[parameter(4, attribute="description")]),
        job(5, operation="vendor", parameters=[parameter(5)]),
        job(6, parameters=[parameter(6)]),
    ]
    assert [row[2] for row in table_of(*jobs)] == [6]


def test_an_access_is_as_many_elements_as_it_asked_for_and_256_at_most() -> None:
    def subindices(**changes: Any) -> list[int]:
        return [row[3] for row in table_of(job(1, parameters=[parameter(**changes)]))]

    no = ParameterError(0x6B, 0)
    assert subindices(subindex=3, element_count=3, values=[], error=no) == [3, 4, 5]
    assert subindices(subindex=3, element_count=3, values=[1], error=no) == [3, 4, 5]
    assert subindices(subindex=None, element_count=None, values=[]) == [0]
    assert subindices(element_count=9, values=["text"]) == [0]
    assert subindices(element_count=1, values=[1, 2]) == [0, 1]
    assert subindices(element_count=300, values=[]) == list(range(256))


def test_the_last_value_is_the_last_that_came() -> None:
    """An element for which a response has no value keeps its older one."""
    jobs = [
        job(1, parameters=[parameter(element_count=3, values=[1, 2, 3])]),
        job(2, "partial", parameters=[parameter(element_count=3, values=[4, 5])]),
    ]
    assert [(row[12], row[14]) for row in table_of(*jobs)] == [("4", 2), ("5", 2), ("3", 1)]


def test_a_value_without_a_scaled_one_stands_alone() -> None:
    (one, other) = table_of(
        job(1, parameters=[parameter(element_count=2, values=[50, 7], scaled=[0.5])])
    )
    assert (one[12], other[12]) == ("50 (0.5)", "7")


def test_a_refused_record_call_stands_with_its_status() -> None:
    ways = [{"write_status": 0xDF80B500, "read_status": None}, {"read_status": 0xDE80B700}]
    for changes, word in zip(ways, ("(DF80B500)", "(DE80B700)"), strict=True):
        ((*_, error, number),) = table_of(job(1, "refused", parameters=[parameter()], **changes))
        assert (error[0].split()[-1], number) == (word, 1)


def test_of_too_many_parameters_the_page_says_how_many_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys.modules[elements.__module__], "MOST", 2)
    jobs = [job(n, parameters=[parameter(pnu)]) for n, pnu in enumerate((1, 2, 3, 4, 3, 1), 1)]
    shown, left_out = elements(capture(*jobs))
    assert [(row[2], row[7]) for row in shown["rows"]] == [(1, 2), (2, 1)]
    assert left_out == 2


# What to do


def test_a_diagnosis_of_a_job_covers_the_findings_that_it_names_and_no_other() -> None:
    """An error number is covered by its own number, and only for rules that are about one."""
    said = finding("DS719", 1, code=0x6B)
    covered = finding("DS410", 1, code=0x6B)
    others = [
        finding("DS410", 1, code=0x11),
        finding("DS417", 1, code=0x6B),
        finding("DS410", 2, code=0x6B),
        finding("DS410", None, code=0x6B),
    ]
    assert uncovered(capture(job(1), job(2), findings=[said, covered, *others])) == others


def test_a_diagnosis_of_the_capture_covers_what_has_no_job() -> None:
    """Whatever its device is; of a job that of its own device only."""
    here, elsewhere = finding("DS410", 1, code=0x6B), finding("DS410", 2, code=0x6B)
    nowhere, said = finding("DS410", None, code=0x6B), finding("DS719", None, code=0x6B, device=B)
    result = capture(job(1), job(2, device=B), findings=[said, here, elsewhere, nowhere])
    assert uncovered(result) == [here]


def test_a_note_and_a_diagnosis_are_no_further_findings() -> None:
    serious = [finding("DS410", 1), finding("DS402", 1, "warning")]
    note = finding("DS415", 1, "note")
    assert uncovered(capture(job(1), findings=[note, *serious])) == serious
    assert uncovered(capture(job(1), findings=[note, finding("DS719", 1)])) == []


def test_who_answers_instead_are_the_drive_objects_of_that_device_that_do() -> None:
    jobs = [
        job(1, axis=3), job(2, axis=2), job(3, "partial", axis=4), job(4, axis=3), job(5, "error", axis=5),
        job(6, axis=6, device=B),
    ]  # fmt: skip
    item = handmade.diagnosis("DS709", "error", "x", A)
    assert answering(capture(*jobs), item) == "2, 3, 4"
    assert answering(capture(*jobs), replace(item, rule="DS719")) == ""


# The overview


def test_a_row_counts_what_a_capture_holds() -> None:
    missing = (2, 1, 0)
    files = [CaptureFile("x", n, missing_before=each) for n, each in enumerate(missing, 1)]
    row = CaptureRow.of(
        capture(
            job(1, duration_ns=0), job(2, "error", operation="change", duration_ns=-1), job(3, duration_ns=None),
            findings=[finding("DS410"), finding("DS402", severity="warning"), finding("DS410")], files=files,
        )
    )  # fmt: skip
    assert (row.files, row.missing_files, row.transactions, row.slowest_ns) == (3, 3, 3, 0)
    assert (row.states, row.operations) == ({"ok": 2, "error": 1}, {"read": 2, "change": 1})
    assert (row.findings, row.rules) == ({"error": 2, "warning": 1}, {"DS402": 1, "DS410": 2})
    assert CaptureRow.of(capture()).files == 1
    assert CaptureRow.of(capture(job(1, duration_ns=-1))).slowest_ns is None


def test_the_worst_of_a_capture_is_its_most_serious_finding() -> None:
    found = ({}, {"note": 1}, {"note": 1, "warning": 1}, {"error": 1})
    assert [CaptureRow("x", findings=each).worst for each in found] == [-1, 0, 1, 2]


ROWS = [
    CaptureRow("remark", states={"ok": 1}, findings={"note": 1}, frames=1, slowest_ns=5),
    CaptureRow("quiet", states={"ok": 2}, frames=10, slowest_ns=7_000_000, operations={"read": 2}),
    CaptureRow("state", states={"ok": 5, "error": 1}, frames=100, slowest_ns=7_000_000),
    CaptureRow("states", states={"error": 2}, frames=1000),
    CaptureRow("cut", complete=False, frames=10000, missing_files=2, files=4, dropped=3),
    CaptureRow("warnings", findings={"warning": 2, "note": 3}, rules={"DS402": 2, "DS415": 3}),
    CaptureRow("warning", findings={"warning": 1}, rules={"DS402": 1}),
    CaptureRow("error", findings={"error": 1}, rules={"DS410": 1}),
    CaptureRow("errors", findings={"error": 1, "warning": 1}, rules={"DS410": 1, "DS402": 1}),
    CaptureRow.unreadable("gone", "gone: why"),
]


def test_the_worst_captures_stand_first() -> None:
    """Not readable, errors, warnings, cut off, not ok, notes; those in which all is well are left out."""
    assert [row.path for row in sorted(ROWS, key=CaptureRow.badness)] == [
        "gone", "errors", "error", "warnings", "warning", "cut", "states", "state", "remark", "quiet",
    ]  # fmt: skip
    assert [row.path for row in ROWS if row.quiet] == ["remark", "quiet"]
    assert not CaptureRow("x", states={"unanswered": 1}).quiet


def test_the_sums_over_captures() -> None:
    """Who was slowest first counts where another was as slow."""
    summed = total(ROWS)
    assert {key: summed[key] for key in ("captures", "unreadable", "incomplete", "quiet", "frames")} == {
        "captures": 10, "unreadable": 1, "incomplete": 1, "quiet": 2, "frames": 11111,
    }  # fmt: skip
    assert summed["states"] == {"ok": 8, "error": 3}
    assert summed["findings"] == {"error": 2, "warning": 4, "note": 4}
    assert summed["operations"] == {"read": 2}
    assert summed["rules"] == {
        "DS402": {"findings": 4, "captures": 3},
        "DS410": {"findings": 2, "captures": 2},
        "DS415": {"findings": 3, "captures": 1},
    }
    assert summed["slowest"] == {"path": "quiet", "ns": 7_000_000}
    assert total([CaptureRow("x", slowest_ns=0)])["slowest"] == {"path": "x", "ns": 0}
    assert total([CaptureRow("x")])["slowest"] is None


def test_the_overview_as_it_is_printed() -> None:
    assert "\n".join(lines(ROWS, ReportOptions())) == PRINTED


def test_rules_in_as_many_captures_stand_by_their_ids() -> None:
    """And where there is no finding nothing is said of rules."""
    told = [
        line.split(":")[0]
        for line in lines([CaptureRow("x", rules={"DS417": 9, "DS410": 1})], ReportOptions())
    ]
    assert told[:3] == ["Findings", "  DS410", "  DS417"]
    assert lines([CaptureRow("x")], ReportOptions())[0].startswith("1 capture")


def test_a_series_of_two_files_says_so() -> None:
    assert (
        worst_first([CaptureRow("x", complete=False, files=2)], ReportOptions())[-1].split("  ")[-2]
        == "x (2 files)"
    )


def test_the_overview_as_a_document_has_a_row_for_each_capture_the_worst_first() -> None:
    text = "".join(document(ROWS))
    found = json.loads(text)
    assert (found["schema"], found["total"]) == ("ds47.overview/1", total(ROWS))
    paths = [row.path for row in sorted(ROWS, key=CaptureRow.badness)]
    assert [CaptureRow.loaded(each).path for each in found["captures"]] == paths
    assert len(text.splitlines()) == len(ROWS) + 1
    assert json.loads("".join(document([])))["captures"] == []


def test_the_overview_is_written_line_by_line() -> None:
    stream = io.StringIO()
    write_all(Writer(stream), Report([capture(job(1))]))
    assert stream.getvalue().startswith(
        "1 capture: 1 without problems\n  9 frames, 1 transaction: 1 ok"
    )
    assert stream.getvalue().endswith("\n")


PRINTED = """\
Captures, the worst first
  errors  warnings  notes  not ok  transactions  capture
       -         -      -       -             -  gone  not readable: why
       1         1      0       0             0  errors
       1         0      0       0             0  error
       0         2      3       0             0  warnings
       0         1      0       0             0  warning
       0         0      0       0             0  cut (4 files)  2 files of the series missing  only partly read: the file ends early  3 frames dropped
       0         0      0       2             2  states
       0         0      0       1             6  state

Findings
  DS402: 4 findings in 3 captures
  DS410: 2 findings in 2 captures
  DS415: 3 findings in 1 capture

All 10 captures: 2 without problems, 1 not readable, 1 only partly read
  11,111 frames, 11 transactions: 8 ok, 3 error; 2 read
  10 findings: 2 error, 4 warning, 4 note
  slowest 7.0 ms, in quiet"""  # noqa: E501


def test_a_table_of_captures_says_how_many_it_leaves_out() -> None:
    assert worst_first(ROWS[:2], ReportOptions()) == []
    assert "1 more capture" in worst_first(ROWS[2:5], ReportOptions(), 2)[-1]
    assert len(worst_first(ROWS[2:5], ReportOptions(), 2)) == 2 + 2 + 1
    assert len(worst_first(ROWS[2:5], ReportOptions(), 3)) == 2 + 3
