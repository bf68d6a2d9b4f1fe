"""The trail as text fits the terminal, and says why a value before is not known."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ds47.analysis import analyze
from ds47.cli import main
from ds47.report import ReportOptions, open_writer, write_one
from ds47.report.changes import Writer
from ds47.report.formatting import both_sides
from ds47.report.selection import Selection
from ds47.report.trail import changes
from ds47.report.wrap import columns

STACK = "real-stacks/o1_profinetpy062_be.pcapng"


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("width", [60, 80, 140])
def test_no_line_is_too_wide(
    captures: Path, width: int, lang: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("tour-machine.pcapng", STACK):
        assert main(["trail", "--width", str(width), "--lang", lang, str(captures / name)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert max(map(columns, lines[1:])) <= width


def test_where_a_table_has_no_room_each_change_is_a_card(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["trail", "--width", "80", str(captures / "tour-machine.pcapng")]) == 0
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("  08:00:00.255  p50304[0]  ? -> 100.0  accepted")
    about = "seconds 0.255  frame 6  controller 192.168.133.2  drive press-1-drive DO 2"
    assert lines[at + 1 : at + 3] == [f"    {about}", "    by 47 slot 1.1"]
    assert lines[-1] == "  ? in frames 6, 26: neither read nor written before in this capture"


@pytest.mark.parametrize(
    ("old", "new", "shown"),
    [
        ((40.0, "Float32"), (1110835200, "DoubleWord"), ("40.0", "45.5 (DoubleWord 1110835200)")),
        ((1109393408, "DoubleWord"), (45.5, "Float32"), ("40.0 (DoubleWord 1109393408)", "45.5")),
        ((-2, "Integer16"), (65535, "Word"), ("-2", "-1 (Word 65535)")),
        ((2, "Unsigned16"), (3, "Word"), ("2", "3")),
        ((40.0, "Float32"), (30, "Unsigned16"), ("40.0 (Float32)", "30 (Unsigned16)")),
        ((40.0, "Float32"), (30, "Word"), ("40.0 (Float32)", "30 (Word)")),
        ((2, "Unsigned16"), (3, "Unsigned32"), ("2", "3")),
        ((None, None), (1110835200, "DoubleWord"), ("?", "1110835200")),
    ],
)
def test_both_sides_of_a_change_are_in_one_format(old: Any, new: Any, shown: object) -> None:
    assert both_sides(*old, *new) == shown


def test_the_text_says_what_the_brackets_are(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for selected, told in ((("-t", "29"), True), (("-t", "24"), False)):
        assert main(["trail", *selected, str(captures / STACK)]) == 0
        out = capsys.readouterr().out
        assert ("45.5 (DoubleWord 1110835200)" in out, "In brackets: " in out) == (told, told)


def test_a_value_is_unknown_for_a_reason(captures: Path) -> None:
    for name in ("tour-machine.pcapng", STACK, "cyclic-changed-after-off1.pcapng"):
        for each in changes(analyze(captures / name)):
            assert (each.old is None) == bool(each.unknown)
    reasons = {each.unknown for each in changes(analyze(captures / STACK))}
    assert reasons <= {"", "unseen", "open", "itself", "unsure", "anew"}
    assert {"", "unseen"} <= reasons


def test_the_head_counts_what_came_of_the_writes(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(captures / "tour-machine.pcapng")
    for words, said in (
        ((), "4 writes: 1 accepted, 2 refused, 1 outcome unknown; first frame"),
        (("-t", "2"), "1 write: 1 accepted; first frame"),
        (("-t", "1"), "0 writes; first frame"),
        (("--lang", "zh"), "4 次写入：1 次被接受，2 次被拒绝，1 次结果未知；首帧"),
    ):
        assert main(["trail", *words, path]) == ("-t" in words and "1" in words)
        assert said in capsys.readouterr().out.splitlines()[0]


@pytest.mark.parametrize("width", [60, 140])
def test_a_name_that_is_wider_than_a_line_is_broken(captures: Path, width: int) -> None:
    result = analyze(captures / "tour-machine.pcapng")
    named = [replace(each, station="n" * 240) for each in result.devices]
    result.devices[:] = named
    options = ReportOptions(width=width)
    trail, report = io.StringIO(), io.StringIO()
    changed = Writer(trail, "text", options)
    changed.capture(result, Selection())
    changed.close()
    write_one(open_writer("text", report, options), result)
    for written in (trail, report):
        text = written.getvalue()
        assert max(map(columns, text.splitlines()[1:])) <= width
        assert text.count("n" * (width // 2)) >= 240 // width
