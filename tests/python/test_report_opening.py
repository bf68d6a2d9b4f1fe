"""The first lines of the text report, and what the PLC saw: what they say, how short they are, both languages."""

from __future__ import annotations

import io
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import handmade
import pytest

from ds47 import spec
from ds47.analysis import analyze
from ds47.cli import main
from ds47.diagnosis.suggest import corrected
from ds47.model import CaptureResult, Device, Finding, Frames, Report
from ds47.report import ReportOptions, bilingual, plc, text, write_all
from ds47.report.filters import display_filter
from ds47.report.todo import More, causes, uncovered
from ds47.report.wrap import columns, wrap
from ds47.spec.reporting import COVERS, command_words, covers, report_words

DRIVE = "192.168.133.33"


def capture(*transactions, findings=(), diagnoses=(), **changes):
    item = CaptureResult(
        "line.pcapng", frames=9, devices=[Device(DRIVE, station="press-1")], transactions=list(transactions),
        findings=list(findings), diagnoses=list(diagnoses), dropped=0,
    )  # fmt: skip
    for key, value in changes.items():
        setattr(item, key, value)
    return item


def written(*captures, **options):
    stream = io.StringIO()
    write_all(
        text.Writer(stream, ReportOptions(rules=spec.rules(), **options)), Report(list(captures))
    )
    return stream.getvalue()


def opening(result, **options):
    """The lines before the transactions."""
    return written(result, **options).split("\n\nTransactions\n")[0].splitlines()


def diagnosis(rule="DS719", message="p0076[1] cannot be changed now: 0x6B no", **changes):
    usual = {"count": 1, "frames": [9], "transactions": [1], "device": DRIVE}
    return handmade.diagnosis(rule, spec.rules()[rule].severity, message, **(usual | changes))


# The opening


def test_a_capture_in_which_all_is_well_has_a_verdict_and_drives_and_no_more():
    assert opening(capture(handmade.transaction())) == [
        "line.pcapng: 9 frames",
        "OK: 1 drive, 1 transaction, all done",
        "  2026-01-01 00:00:00.000 +00:00 (UTC) to 00:00:00.012 (last transaction or event), 12.4 ms",
        "",
        "Drives",
        f'  {DRIVE}  "press-1"  1 transaction, all done',
    ]


def test_each_of_several_drives_has_its_times():
    other, silent = "192.168.133.40", "192.168.133.50"
    jobs = [
        handmade.transaction(),
        handmade.transaction(id=2, duration_ns=30_000_000),
        handmade.transaction(id=3, device=other, duration_ns=5_000_000),
        handmade.transaction(id=4, device=silent, duration_ns=None),
    ]
    devices = [Device(DRIVE), Device(other), Device(silent)]
    lines = opening(capture(*jobs, devices=devices))
    assert lines[lines.index("Drives") + 1 :] == [
        f"  {DRIVE}  2 transactions, all done  p50 12.4 ms, max 30.0 ms",
        f"  {other}  1 transaction, all done  p50 5.0 ms, max 5.0 ms",
        f"  {silent}  1 transaction, all done",
    ]
    assert "  p50 12.4 ms，最长 30.0 ms\n" in written(capture(*jobs, devices=devices), lang="zh")


def test_a_change_of_which_nobody_read_the_answer_is_not_ok(captures: Path):
    lines = opening(analyze(captures / "conversation-change-unread.pcapng"))
    assert lines[1:3] == [
        "WARNING: outcome unknown for the only transaction",
        "  1 drive, 1 transaction, 1 unanswered",
    ]
    shown = lines[lines.index("What this capture cannot show") + 1 :]
    assert any(
        line.startswith("  What the drive did with 1 request: its response") for line in shown
    )


def test_where_there_are_errors_jobs_are_answered_and_not_done(captures: Path):
    lines = opening(analyze(captures / "transport-reject.pcapng"))
    assert lines[1:3] == [
        "NOT OK: calls are answered with an RPC reject",
        "  1 drive, 1 transaction, all with a response",
    ]
    assert lines[6].endswith("1 transaction, all with a response")


def test_every_drive_has_its_counts_and_other_devices_stand_below():
    jobs = [
        handmade.transaction(id=1, state="refused", write_status=0xDF80B700),
        handmade.transaction(id=2),
        handmade.transaction(id=3, device="192.168.133.40"),
    ]
    lines = opening(capture(*jobs, devices=[Device("192.168.133.50"), Device(DRIVE)]))
    assert lines[1:3] == [
        "NOT OK: 1 of 3 transactions failed",
        "  2 drives, 3 transactions, 2 ok, 1 refused",
    ]
    assert lines[6:11] == [
        f"  {DRIVE}  2 transactions, 1 refused  p50 12.4 ms, max 12.4 ms",
        "  192.168.133.40  1 transaction, all done  p50 12.4 ms, max 12.4 ms",
        "",
        "Other devices",
        "  192.168.133.50",
    ]


def test_many_drives_do_not_push_away_what_to_do():
    jobs = [handmade.transaction(id=n, device=f"10.0.0.{n}") for n in range(1, 61)]
    lines = opening(capture(*jobs, devices=[]))
    assert lines[-1] == "  and 10 more drives"
    assert len(lines) == 56


def test_five_thousand_equal_symptoms_are_one_line():
    jobs = [handmade.transaction(id=n, state="error") for n in range(1, 5001)]
    message = "p0076[1] cannot be changed now: 0x6B no"
    findings = [
        each
        for n in range(1, 5001)
        for each in (
            handmade.finding(
                "DS410",
                "error",
                "Parameter 76[1] has a negative response: 0x6B no (info 0)",
                n,
                n,
                code=0x6B,
            ),
            handmade.finding("DS719", "error", message, n, n, code=0x6B),
        )
    ]
    told = diagnosis(code=0x6B, count=5000, frames=[1, 2, 3, 4, 5], transactions=[1, 2, 3, 4, 5])
    told.frames_left_out = 4995
    lines = opening(capture(*jobs, findings=findings, diagnoses=[told]))
    assert lines[8:] == [
        "What to do",
        f"  DS719 error drive-running: {message} (5,000 times)",
        "    -> 0x6B: remove the enable (OFF1, standstill) and repeat the change.",
        '    look at frame 1 (#1): ds47.finding == "DS719"',
    ]


def test_what_no_diagnosis_covers_stands_behind_them_a_line_a_rule():
    findings = [
        Finding("DS410", "error", 9, [9], 1, offset, {"pnu": pnu, "subindex": 0, "code": code})
        for offset, pnu, code in ((4, 1, 0x6B), (8, 2, 0x11), (12, 3, 0x11))
    ]
    back = {"read": 1, "written": 2, "by": 7}
    findings += [
        Finding("DS417", "warning", 9, [9], 1, None, {"pnu": 4, "subindex": 0} | back),
        Finding("DS417", "warning", 9, [9], 1, None, {"pnu": 5, "subindex": 0} | back),
        Finding("DS415", "note", 9, [9], 1),
        Finding("DS719", "error", 9, [9], 1, None, {"pnu": 76, "subindex": 1, "code": 0x6B}),
    ]
    job = handmade.transaction(state="error")
    lines = opening(capture(job, findings=findings, diagnoses=[diagnosis()]))
    place = lines.index("  Other findings")
    head = "  DS410 error drive-error: Parameters got a negative response: 0x11 " + spec.error_text(
        0x11, "en"
    )
    heads = [(line + lines[at + 1][3:]) for at, line in enumerate(lines) if line.startswith("  DS")]
    assert heads[1:] == [
        f"{head} (2 times in 1 frame)",
        *(
            f"  DS417 warning read-back-differs: Parameter p000{pnu}[0] reads back as 1, but the last value"
            " written in this capture is 2 (frame 7)"
            for pnu in (4, 5)
        ),
    ]
    assert lines[place + 1].startswith("  DS410")
    assert lines[-1] == "    look at frame 9 (#1)"
    assert sum("look at frame 9 (#1)" in line for line in lines) == 4
    assert not any("DS415" in line for line in lines)
    assert sum("-> " in line for line in lines) == 3


def test_what_an_older_result_says_is_told_as_it_is_each_sentence_once():
    findings = [
        handmade.finding("DS410", "error", f"Parameter {pnu}[0] failed", frame, 1)
        for frame, pnu in ((9, 1), (11, 2), (13, 2))
    ]
    lines = opening(capture(handmade.transaction(state="error"), findings=findings))
    assert [line for line in lines if line.startswith("  DS410")] == [
        "  DS410 error drive-error: Parameter 2[0] failed (2 times)",
        "  DS410 error drive-error: Parameter 1[0] failed",
    ]


def test_causes_of_one_rule_do_not_hide_the_others():
    many = [diagnosis("DS717", f"p{n}[0]", count=2, frames=[n]) for n in range(1, 9)]
    job = handmade.transaction(state="error")
    lines = opening(capture(job, diagnoses=[*many, diagnosis("DS702", "too early", frames=[77])]))
    assert "  DS717 index-and-count: 5 more causes of this kind, 10 times in all" in lines
    assert any(line.startswith("  DS702 warning read-too-early: too early") for line in lines)
    assert sum("Not an array" in line for line in lines) == 1  # the advice, once for all
    assert lines.index(next(line for line in lines if "5 more" in line)) < lines.index(
        next(line for line in lines if "DS702" in line)
    )


def test_with_several_drives_a_diagnosis_names_its_drive():
    jobs = [handmade.transaction(), handmade.transaction(id=2, device="192.168.133.40")]
    lines = opening(capture(*jobs, diagnoses=[diagnosis()]))
    assert any(f"drive-running: {DRIVE}: p0076[1] cannot" in line for line in lines)


def test_a_corrected_request_stands_below_its_diagnosis():
    request = bytes.fromhex("010101011001001500000000")[:10]
    told = diagnosis("DS717")
    told.corrected = request
    lines = opening(capture(handmade.transaction(state="error"), diagnoses=[told]))
    place = lines.index(f"    send instead: {request.hex()}")
    assert lines[place + 1].strip() == "16#0101 16#0101 16#1001 16#0015 16#0000"
    assert lines[place + 3].strip().startswith("#request[0] := 16#01; ")
    end = place + 8
    assert lines[end - 1].strip().startswith("ds47 encode ")
    assert lines[end].strip() == "with -f scl-fb: a function block for the PLC program"
    told.corrected = None
    without = opening(capture(handmade.transaction(state="error"), diagnoses=[told]))
    assert without == [*lines[:place], *lines[end + 1 :]]


@pytest.mark.parametrize(
    ("request_", "made"),
    [
        ("01010101100100150000", True),
        ("01020101100100150000" + "08013f800000", True),
        ("01510101100100150000", False),
        ("010101010100", False),
        ("0102010110ea00010000" + "0aea" + "00" * 234, False),
    ],
)
def test_only_what_a_function_block_can_be_made_of_is_offered_as_one(request_, made):
    data = bytes.fromhex(request_)
    shown = corrected(data)
    assert shown.block is made
    told = diagnosis("DS717")
    told.corrected = data
    lines = opening(capture(handmade.transaction(state="error"), diagnoses=[told]))
    assert any("-f scl-fb" in line for line in lines) is made
    if made:
        assert main(["encode", "-f", "scl-fb", *shlex.split(shown.encode or "")[2:]]) == 0


def test_what_a_capture_cannot_show_is_told_where_something_is_wrong_and_only_what_applies():
    well = written(capture(handmade.transaction(operation="change"), dropped=None))
    assert "cannot show" not in well
    job = handmade.transaction(operation="change", state="partial")
    lines = opening(capture(job, dropped=None))
    shown = lines[lines.index("What this capture cannot show") + 1 :]
    assert [line for line in shown if not line.startswith("   ")] == [
        "  Whether an accepted value is still in force later: only a later read shows that. Whether it was",
        "  Whether the capturing computer lost frames: a missing response may have been sent.",
    ]
    assert "cannot show" not in written(capture(handmade.transaction(state="error")))


def test_the_opening_is_chinese_where_that_is_asked_for():
    findings = [handmade.finding("DS401", "warning", "从未得到应答", 1, 1)]
    job = handmade.transaction(state="unanswered", frames=Frames(1, 2))
    lines = opening(capture(job, findings=findings, dropped=None), lang="zh")
    assert lines[:3] == [
        "line.pcapng: 9 帧", "警告：请求没有应答；唯一的任务结果未知", "  1 台驱动器，1 个任务，1 个无应答",
    ]  # fmt: skip
    assert "处理建议" in lines
    assert any(line.startswith("  DS401 警告") for line in lines)
    words = {line for line in lines if re.search(r"\b(error|warning|look|What|Drives)\b", line)}
    assert words == set()


def test_several_captures_end_with_the_verdict_over_all():
    stream = io.StringIO()
    writer = text.Writer(stream, ReportOptions(rules=spec.rules()))
    writer.capture(capture(handmade.transaction()))
    writer.unreadable("gone.pcapng", "no such file")
    writer.capture(capture(handmade.transaction(state="refused", write_status=0xDF80B500)))
    writer.close()
    last = stream.getvalue().split("All 3 captures\n")[1].splitlines()
    assert last[0] == "  NOT OK: 1 of 2 transactions failed; 1 capture not read to its end"


def test_colours_are_those_of_the_severity():
    job = handmade.transaction(state="error")
    content = written(capture(job, diagnoses=[diagnosis()]), color=True)
    assert f"\x1b[31mNOT OK: {DRIVE}: Change not possible now" in content
    assert "\x1b[31mDS719 error drive-running" in content
    assert "\x1b[32mOK: 1 drive" in written(capture(handmade.transaction()), color=True)


def test_nothing_of_a_capture_talks_to_the_terminal():
    told = diagnosis(message="a\x1b[2J\r\n\u202e", device="1\x07")
    jobs = [handmade.transaction(device="1\x07"), handmade.transaction(device="2")]
    content = written(capture(*jobs, diagnoses=[told], devices=[Device("3\x9b", station="\x1b")]))
    assert all(char.isprintable() or char == "\n" for char in content)


def test_every_stored_capture_has_a_line_for_all_that_is_serious(captures: Path):
    """Every error and warning is a diagnosis, covered by one, or has a line of its own."""
    seen = 0
    for path in sorted(captures.glob("*.pcapng")):
        result = analyze(path)
        lines = "\n".join(opening(result))
        for each in (*result.diagnoses, *uncovered(result)):
            assert each.rule in lines, (path.name, each)
            seen += 1
        assert "NOT OK" not in lines or "What to do" in lines, path.name
    assert seen > 50


# What a diagnosis covers


def test_what_is_covered_is_in_the_catalogue():
    for how in COVERS:
        for rule, covered in covers(how).items():
            assert rule.startswith("DS7")
            assert rule in spec.rules()
            assert all(any(known.startswith(each) for known in spec.rules()) for each in covered)
            assert (spec.rules()[rule].scope == "capture") == (how == "whole") or how == "word", (
                rule
            )


def test_a_diagnosis_covers_its_own_job_only():
    findings = [
        handmade.finding("DS203", "error", "refused", 1, 1), handmade.finding("DS705", "error", "clash", 1, 1),
        handmade.finding("DS203", "error", "refused", 5, 2), handmade.finding("DS416", "warning", "slow", 1, 1),
    ]  # fmt: skip
    jobs = [handmade.transaction(id=n) for n in (1, 2)]
    rest = uncovered(capture(*jobs, findings=findings, diagnoses=[diagnosis("DS705", "clash")]))
    assert [(each.rule, each.transaction) for each in rest] == [("DS203", 2), ("DS416", 1)]


def test_a_diagnosis_of_the_capture_covers_its_own_device_only():
    jobs = [handmade.transaction(id=1), handmade.transaction(id=2, device="192.168.133.40")]
    findings = [
        handmade.finding("DS203", "error", "refused", 1, 1, status="DF80B600"),
        handmade.finding("DS203", "error", "refused", 2, 1, status="DF80B700"),
        handmade.finding("DS203", "error", "refused", 3, 2, status="DF80B600"),
        handmade.finding("DS206", "warning", "nothing", 4),
        handmade.finding("DS708", "error", "turns away", 1, device=DRIVE, status="DF80B600"),
    ]
    told = diagnosis(
        "DS708", f"{DRIVE} turns requests to slot 2.1 away (DF80B600); slot 1.1 answers"
    )
    rest = uncovered(capture(*jobs, findings=findings, diagnoses=[told]))
    assert [each.frame for each in rest] == [2, 3, 4]
    told = diagnosis("DS703", "2 x", transactions=[])
    findings[-1] = handmade.finding("DS703", "warning", "2 x", 4, count=2, device=DRIVE)
    rest = uncovered(capture(*jobs, findings=findings, diagnoses=[told]))
    assert [each.frame for each in rest] == [1, 2, 3]


def test_without_diagnoses_every_serious_finding_is_told():
    findings = [
        handmade.finding("DS410", "error", "a", 1, 1),
        handmade.finding("DS402", "note", "b", 1, 1),
    ]
    assert uncovered(capture(findings=findings)) == findings[:1]


def test_causes_keep_their_order():
    items = [diagnosis("DS717", f"{n}") for n in range(3)] + [diagnosis("DS702", "x")]
    assert list(causes(items, 2)) == [items[0], items[1], More("DS717", 1, 1), items[3]]
    assert list(causes(items, 3)) == items
    assert list(causes([], 3)) == []


# What the PLC saw


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, "WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 4"),
        (
            {"write_status": 0xDF80B700, "read_status": None, "response": None, "frames": Frames(1, 2)},
            "WRREC ERROR, STATUS DF80B700; RDREC not started in this capture",
        ),
        (
            {"frames": Frames(1, 2, 9, 10, [(3, 4), (5, 6), (7, 8)]), "response": b"\x01\x82\x01\x01"},
            "WRREC DONE, STATUS 00000000; RDREC 3 x ERROR, STATUS DE80B500; RDREC VALID, STATUS 00000000, LEN 4"
            " - byte 1 is 16#82: negative response",
        ),
        (
            {"frames": Frames(1, 2, 3, 4), "read_status": 0xDE80B700, "response": None},
            "WRREC DONE, STATUS 00000000; RDREC ERROR, STATUS DE80B700",
        ),
        (
            {"frames": Frames(1, None), "write_status": None, "read_status": None, "response": None},
            "WRREC, no response before the capture ends; RDREC not started in this capture",
        ),
        (
            {"frames": Frames(1, 2, 3, None), "read_status": None, "response": None},
            "WRREC DONE, STATUS 00000000; RDREC, no response before the capture ends",
        ),
        (
            {"frames": Frames(1, 2, 5, None, [(3, 4), (6, 7)]), "read_status": None, "response": None},
            "WRREC DONE, STATUS 00000000; RDREC ERROR, STATUS DE80B500; "
            "RDREC, its whole response is not in the capture; RDREC ERROR, STATUS DE80B500",
        ),
        (
            {"frames": Frames(1, 2), "write_status": None, "read_status": None, "response": None},
            "WRREC ERROR with a STATUS of the PLC itself (RPC fault or reject); RDREC not started in this capture",
        ),
        (
            {"frames": Frames(1, None, 3, 4), "write_status": None},
            "WRREC, its response is not in the capture; RDREC VALID, STATUS 00000000, LEN 4",
        ),
        (
            {"frames": Frames(None, None, 3, 4), "write_status": None, "state": "orphan", "ar": "01"},
            "its WRREC is not known; RDREC VALID, STATUS 00000000, LEN 4",
        ),
        (
            {"frames": Frames(1, 2, None, None, [(3, 4)]), "read_status": None, "response": None},
            "WRREC DONE, STATUS 00000000; RDREC ERROR, STATUS DE80B500; RDREC not started again in this capture",
        ),
        (
            {"frames": Frames(1, 2, 3, 4, [], [(5, 6), (7, 8)])},
            "WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 4; RDREC 2 x VALID once more, LEN 4",
        ),
        (
            {"state": "superseded", "frames": Frames(1, 2), "read_status": None, "response": None},
            "WRREC DONE, STATUS 00000000; no response by RDREC before the next WRREC",
        ),
        (
            {"state": "partial", "response": b"\x01\x81\x01\x01"},
            "WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 4"
            " - byte 1 is 16#81: negative response, in part",
        ),
        (
            {"state": "mismatch", "request": b"\x02\x01\x01\x01"},
            "WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 4"
            " - the record does not mirror the request (reference)",
        ),
        (
            {"state": "mismatch", "request": b"\x01\x02\x03\x02"},
            "WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 4"
            " - the record does not mirror the request (DO, count, ID)",
        ),
    ],
)  # fmt: skip
def test_what_the_plc_saw(changes, expected):
    item = handmade.transaction(**({"response": b"\x01\x01\x01\x01"} | changes))
    if item.frames.read_response is None and item.state == "ok":
        item.state = "unanswered"
    witness = plc.Witness(capture(item))
    assert witness.text(item).en == expected
    assert witness.line(item).en == f"PLC: {expected}"
    chinese = witness.line(item).zh
    assert re.match("PLC：.*WRREC", chinese)
    numbers = r"[0-9A-F]{8}|16#\w+|LEN \d+"
    assert re.findall(numbers, chinese) == re.findall(numbers, expected)


def test_what_the_plc_saw_stands_below_what_is_not_ok_or_below_all():
    jobs = [handmade.transaction(id=1), handmade.transaction(id=2, state="unanswered")]
    lines = written(capture(*jobs)).splitlines()
    (place,) = [number for number, line in enumerate(lines) if "PLC: " in line]
    assert lines[place - 1].startswith("#2")
    assert written(capture(*jobs), plc=True).count("      PLC: WRREC DONE") == 2


def test_the_option_plc_tells_it_of_every_job(captures: Path, capsys):
    assert main(["report", "--plc", str(captures / "tour-machine.pcapng")]) == 0
    assert capsys.readouterr().out.count("      PLC: WRREC ") == 8
    assert main(["report", "--lang", "zh", str(captures / "tour-machine.pcapng")]) == 0
    assert capsys.readouterr().out.count("      PLC：WRREC ") == 4


def test_the_lines_below_the_opening_are_chinese_too(captures: Path, capsys):
    assert main(["report", "--lang", "zh", str(captures / "tour-machine.pcapng")]) == 0
    lines = capsys.readouterr().out.splitlines()
    (place,) = (number for number, line in enumerate(lines) if line == "任务")
    assert lines[place + 3].endswith(":= 100.0 s  8 帧 27.0 ms，轮询 2 次")
    assert lines[place + 9].endswith(
        "p50076[1] := 100.0 错误 0x6B：控制器使能时无修改权限  [错误]  4 帧 3.0 ms"
    )
    (place,) = (number for number, line in enumerate(lines) if line == "结论")
    assert lines[place + 3] == "  DS410 错误 drive-error：2 个结论"
    assert lines[place + 4].startswith(
        "    帧 29 #6 08:00:01.198：偏移 4：参数 p50076[1] 得到否定应答"
    )
    assert lines[-4:] == [
        "汇总",
        "  8 个任务：4 正常，1 部分失败，1 错误，1 被拒绝，1 无应答；4 读，4 修改",
        "  9 个结论：5 错误，2 警告，2 提示",
        "  耗时 p50 3.0 ms，p95 27.0 ms，p99 27.0 ms，最长 27.0 ms",
    ]


# Filters, lines, words


def test_display_filter():
    assert display_filter([7]) == ("frame.number == 7", 0)
    expected = "frame.number in {1..3} or frame.number == 5 or frame.number in {8..9}"
    assert display_filter([3, 1, 2, 9, 8, 5, 5]) == (expected, 0)
    content, left_out = display_filter(range(0, 200, 2))
    assert content.count("==") == 60
    assert left_out == 40


def tsharks(repository: Path) -> list[str]:
    """The tshark of this machine, and those of other versions that were fetched for the tests."""
    own = os.environ.get("DS47_TSHARK") or shutil.which("tshark")
    return [*([own] if own else []), *map(str, sorted(repository.glob("build/wireshark/*/tshark")))]


@pytest.mark.slow
def test_every_tshark_takes_the_filter(repository: Path, captures: Path, tmp_path: Path):
    found = tsharks(repository)
    if not found:
        pytest.skip("tshark is missing")
    frames = [1, 2, 3, 29, 33]
    wanted = ["-Y", display_filter(frames)[0], "-T", "fields", "-e", "frame.number"]
    capture_path = str(captures / "tour-machine.pcapng")
    environment = {**os.environ, "HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    for program in found:
        done = subprocess.run(
            [program, "-n", "-r", capture_path, *wanted],
            env=environment, capture_output=True, encoding="utf-8", timeout=120, check=False,
        )  # fmt: skip
        assert done.returncode == 0, (program, done.stderr)
        assert [int(line) for line in done.stdout.split()] == frames, program


def test_lines_are_as_wide_as_a_terminal():
    chinese = "应答没有被读取，" * 20 + "DE80B500 " * 10
    for content in (chinese, "word " * 60):
        lines = wrap(content, 40, 3)
        assert max(map(columns, lines)) <= 41  # a comma may stand out: it does not begin a line
        assert "".join(lines).replace(" ", "") == content.replace(" ", "")
        assert all(line.startswith("   ") and line[3] not in " ，" for line in lines[1:])


def test_every_word_is_there_in_both_languages_and_used():
    plugin = Path(__file__).resolve().parents[2] / "dissector"
    packages = (Path(bilingual.__file__).parent, plugin)
    sources = "".join(
        path.read_text("utf-8")
        for package in packages
        for path in package.rglob("*")
        if path.suffix in (".py", ".j2", ".lua")
    )
    made = (
        "verdict_",
        "told_",
        "severity_",
        "plc_write_",
        "plc_read_",
        "state_",
        "about_",
        "operation_",
        "certainty_",
        "bus_",
        "buffer_",
        "ms1_",
        "s7_",
        "statistics_",
        "rpc_",
    )
    for key, texts in report_words().items():
        assert set(texts) == {"en", "zh"}, key
        assert all(texts.values()), key
        assert key.startswith(made) or f'"{key}"' in sources, key


def test_every_word_of_the_commands_too():
    package = Path(bilingual.__file__).parent.parent
    sources = "".join(
        path.read_text("utf-8") for path in package.rglob("*") if path.suffix in (".py", ".j2")
    )
    made = (
        "worst_",
        "all_",
        "change_",
        "change_in_",
        "change_device_",
        "diff_",
        "decode_",
        "summary_",
        "ms1_",
        "s7_",
        "s7_user_",
        "bus_",
        "verdict_",
        "trail_",
    )
    for key, texts in command_words().items():
        assert key not in report_words()
        assert set(texts) == {"en", "zh"}, key
        en, zh = (set(re.findall(r"{\w+}", text)) - {"{n}"} for text in texts.values())
        assert en == zh, key
        names = [key, *(key.removeprefix(each) for each in made if key.startswith(each))]
        named = any(f'"{name}"' in sources for name in names)
        rows = ("s7_owner_", "s7_drive_by_", "version_", "trail_why_", "pkw_own_")
        assert named or key.startswith(rows), key  # rows of s7.toml, proofs, kinds of PKW requests


def test_a_wrong_drive_object_is_told_with_those_that_answer():
    jobs = [
        handmade.transaction(id=1, axis=2),
        handmade.transaction(id=2, axis=1),
        handmade.transaction(id=3, axis=7, state="error"),
        handmade.transaction(id=4, axis=5, device="192.168.133.40"),
    ]
    lines = opening(capture(*jobs, diagnoses=[diagnosis("DS709")]))
    assert "    these respond here: DO 1, 2" in lines
    assert not any(
        "respond here" in line for line in opening(capture(*jobs, diagnoses=[diagnosis()]))
    )


def _saw(captures: Path, name: str, number: int = 1) -> str:
    """What the PLC saw of a transaction of a stored capture."""
    result = analyze(captures / f"{name}.pcapng")
    return plc.Witness(result).text(result.transactions[number - 1]).en


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("transport-reject", "RDREC ERROR with a STATUS of the PLC itself (RPC fault or reject)"),
        ("transport-empty-body", "RDREC, a response without STATUS and record"),
        ("transport-rpc-fragments-incomplete", "RDREC, its whole response is not in the capture"),
        ("transport-ip-fragments-incomplete", "RDREC, its whole response is not in the capture"),
    ],
)
def test_no_call_is_left_out(captures: Path, name: str, expected: str):
    calls = _saw(captures, name).split("; ")
    assert [calls[0], calls[1]] == ["WRREC DONE, STATUS 00000000", expected]
    assert calls[2].startswith("RDREC VALID, STATUS 00000000, LEN ")
    assert not written(analyze(captures / f"{name}.pcapng")).splitlines()[1].endswith("all done")


def test_what_came_before_the_capture_ended_is_not_known(captures: Path):
    assert _saw(captures, "transport-ends-in-call", 2).startswith(
        "WRREC, no response before the capture ends"
    )


def test_a_read_that_is_there_is_started(captures: Path):
    assert _saw(captures, "diagnosis-half-captured") == (
        "WRREC, its response is not in the capture; RDREC, its whole response is not in the capture"
    )


def test_the_plc_got_the_record_whole(captures: Path):
    assert "RDREC VALID, STATUS 00000000, LEN 46 (24 of them captured)" in _saw(
        captures, "diagnosis-half-captured-cut"
    )


def test_a_read_without_an_ar_is_no_call_of_a_block():
    item = handmade.transaction(
        state="orphan", frames=Frames(None, None, 1, 2), write_status=None, response=b"\x01\x01\x01"
    )
    assert plc.Witness(capture(item)).text(item).en == (
        "a Read without an AR (ReadImplicit), no call of RDREC: STATUS 00000000, LEN 3"
    )


def test_calls_that_brought_nothing_stand_between_the_polls():
    item = handmade.transaction(frames=Frames(1, 2, 11, 12, [(3, 4), (7, 8), (9, 10)]))
    failed = handmade.finding("DS104", "error", "rejected", 6, 1, kind="reject")
    told = plc.Witness(capture(item, findings=[failed])).text(item).en.split("; ")
    assert told[1:4] == [
        "RDREC ERROR, STATUS DE80B500",
        "RDREC ERROR with a STATUS of the PLC itself (RPC fault or reject)",
        "RDREC 2 x ERROR, STATUS DE80B500",
    ]


def test_the_capture_ends_after_the_last_read_and_not_after_one_before():
    frames = Frames(1, 2, 5, None, [(3, 4), (6, 7)])
    item = handmade.transaction(state="unanswered", frames=frames, read_status=None, response=None)
    lost = handmade.finding("DS101", "warning", "lost", 8, 1, operation="Read")
    told = plc.Witness(capture(item, findings=[lost])).text(item).en.split("; ")
    assert told[1:] == [
        "RDREC ERROR, STATUS DE80B500",
        "RDREC, its whole response is not in the capture",
        "RDREC ERROR, STATUS DE80B500",
        "RDREC, no response before the capture ends",
    ]


@pytest.mark.parametrize("args", [{"length": 46}, {"length": None, "completed": 4}, {}])
def test_a_cut_record_of_which_a_damaged_result_lacks_facts_is_as_long_as_captured(args):
    item = handmade.transaction(response=b"\x01\x01\x01\x01")
    cut = Finding("DS106", "warning", 4, [4], 1, None, args)
    told = plc.Witness(capture(item, findings=[cut])).text(item).en
    assert told.endswith("RDREC VALID, STATUS 00000000, LEN 4")


def test_a_request_that_nothing_follows_for_long_ran_into_its_timeout():
    alone = handmade.transaction(
        state="unanswered", frames=Frames(1), write_status=None, read_status=None
    )
    second = handmade.transaction(id=2, index=0xB02F, frames=Frames(3, 4, 5, 6))
    second.start_ns = alone.start_ns + 700_000_000_000
    for items, expected in (
        ([alone, second], "WRREC BUSY until its timeout, then ERROR"),
        ([alone], "WRREC, no response before the capture ends"),
        ([alone, handmade.transaction(id=2)], "WRREC, its response is not in the capture"),
    ):
        assert plc.Witness(capture(*items)).text(alone).en.startswith(expected)


def test_whose_a_read_behind_a_write_without_a_response_was_is_not_known():
    """An older request is read for after it: its WRREC and RDREC may have run."""
    older = handmade.transaction(frames=Frames(1, 2, 6, 7, [(4, 5)]))
    lost = handmade.transaction(
        id=2, state="unanswered", frames=Frames(3), write_status=None, read_status=None
    )
    told = plc.Witness(capture(older, lost)).text(lost).en
    assert told == "WRREC, its response is not in the capture"
    lost.frames = Frames(8)
    told = plc.Witness(capture(older, lost)).text(lost).en
    assert told == "WRREC, no response before the capture ends; RDREC not started in this capture"


def test_one_without_an_ar_asks_nothing_of_its_own():
    """A ReadImplicit fetches what another request asked for."""
    from ds47.report.verdict import blind

    orphan = handmade.transaction(state="orphan", frames=Frames(None, None, 1, 2))
    words = "Which request 1 response belongs to"
    assert not any(each.en.startswith(words) for each in blind(capture(orphan)))
    orphan.ar = "00010203-0405-0607-0809-0a0b0c0d0e0f"
    assert any(each.en.startswith(words) for each in blind(capture(orphan)))


def test_nothing_was_accepted_where_every_change_failed():
    from ds47.report.verdict import blind

    for state, expected in (("error", False), ("refused", False), ("partial", True), ("ok", True)):
        item = handmade.transaction(operation="change", state=state)
        told = [each.en for each in blind(capture(item))]
        assert any(each.startswith("Whether an accepted value") for each in told) == expected


def test_a_write_of_several_records_is_no_other_call():
    from ds47.report.verdict import blind

    calls = {"47": {"write": 2, "read": 2}, "57408": {"write": 1, "read": 0}}
    told = [each.en for each in blind(capture(handmade.transaction(), records=calls))]
    assert not any("other record request" in each for each in told)
