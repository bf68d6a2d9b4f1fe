"""Text fits the terminal: no line of any command is wider than 60, 80 or 140 columns, in English or in Chinese.

Wider is only what a user copies as a whole, and a path that is wider itself: breaking it would spoil it. The
terminal is `COLUMNS` and a stream that says it is one; elsewhere tables are as wide as they are.
"""

from __future__ import annotations

import io
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ds47 import spec
from ds47.analysis import analyze
from ds47.cli import main
from ds47.model import Report
from ds47.report import ReportOptions, overview, text, write_all
from ds47.report.changes import Writer as Trail
from ds47.report.selection import Selection
from ds47.report.table import table
from ds47.report.wrap import columns, fitted

ROOT = Path(__file__).resolve().parents[2]
CAPTURES = sorted(path for path in (ROOT / "captures").rglob("*.pcap*") if path.suffix != ".json")
WIDTHS = (60, 80, 140)
LANGS = ("en", "zh")
KINDS = [(60, "en"), (60, "zh"), (80, "en"), (140, "zh")]
COPIED = re.compile(
    r".*\w (==|in) [{0-9\"]"  # a display filter
    r"|(--cyclic \S+ ?)+$"
    r"|.*[0-9a-f]{20,}$"  # the bytes of a request
    r"|ds47 encode "  # the command that makes them
)
SHOWN = (
    "cyclic-changed-after-off1.pcapng", "lossy-stacks/l3_once.pcapng", "profibus-refused-records.pcapng",
    "real-stacks/o3_two_controllers.pcapng", "s7-stacks/errors_cpp_cpp.pcapng", "tour-machine.pcapng",
)  # fmt: skip
"""DS47, PKW and PZD, PROFIBUS, S7, and what is long."""
OF_CAPTURES = (
    ("report", "--all"), ("report", "--filters"), ("report", "-f", "overview"), ("trail",),
    ("watch", "--no-follow"),
)  # fmt: skip
OTHERS = (
    ("report", "--no-progress", "captures/field", "captures/lossy-stacks"),
    ("report", "-f", "overview", "--no-progress", "captures/field", "captures/lossy-stacks"),
    ("report", "-d", "dp3", "captures/profibus-wrong-project.pcapng"),  # narrowed to no transaction
    ("diff", "--all", "captures/seed-dcm-read.pcapng", "captures/tour-machine.pcapng"),
    ("diff", "captures/tour-machine.pcapng", "captures/real-stacks/o1_profinetpy062_be.pcapng"),
    ("diff", "captures/lossy-stacks/l1_replay.device.pcapng", "captures/lossy-stacks/l4_harsh.pcapng"),
    ("check", "--summary", "--all", "captures/field"),
    ("rules",), ("rules", "PKW"), ("rules", "DS"),
    ("params", "show", "p1120"), ("params", "show", "r0945"), ("params", "list"),
    ("explain", "DE80B500"), ("explain", "0x6B", "82", "p2900", "REAL", "DS705"), ("explain", "stw1 047F"),
    ("decode", "--as", "response", "01 82 02 01 81 44 00 6B 00 00 05"),
    ("decode", "--as", "ppo1-in", "20 00 00 00 00 00 00 01 FB 37 20 00"),
    ("decode", "--as", "s7", "32 01 00 00 00 00 00 0E 00 00 04 01 12 0A 10 02 00 01 00 00 84 00 00 00"),
    ("lab", "list"),
)  # fmt: skip


class Terminal(io.StringIO):
    """What the commands write to."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def printed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """The lines that a command prints on a terminal of so many columns, with colours."""
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")

    def run(width: int, *words: str, status: tuple[int, ...] = (0, 1)) -> list[str]:
        monkeypatch.setenv("COLUMNS", str(width))
        terminal = Terminal()
        monkeypatch.setattr("sys.stdout", terminal)
        assert main(list(words)) in status
        return terminal.getvalue().splitlines()

    return run


def too_wide(lines: list[str], width: int) -> Iterator[str]:
    """The lines with more columns, but for what is copied."""
    for line in lines:
        if columns(line) > width:
            plain = re.sub(r"\x1b\[\d*m", "", line).strip()
            if len(plain.split()) > 1 and not COPIED.match(plain):
                yield line


@pytest.mark.parametrize(("width", "lang"), KINDS)
@pytest.mark.parametrize("words", OF_CAPTURES, ids=" ".join)
@pytest.mark.parametrize("name", SHOWN)
def test_of_a_capture(
    printed: Callable[..., list[str]], name: str, words: tuple[str, ...], width: int, lang: str
) -> None:
    lines = printed(width, *words, "--lang", lang, f"captures/{name}")
    assert lines
    assert list(too_wide(lines, width)) == []


@pytest.mark.parametrize(("width", "lang"), KINDS)
@pytest.mark.parametrize("words", OTHERS, ids=" ".join)
def test_of_other_commands(
    printed: Callable[..., list[str]], words: tuple[str, ...], width: int, lang: str
) -> None:
    language = () if words[0] == "lab" else ("--lang", lang)
    lines = printed(width, *words, *language)
    assert lines
    assert list(too_wide(lines, width)) == []


@pytest.mark.parametrize(("width", "lang"), KINDS)
def test_of_what_changed(
    printed: Callable[..., list[str]], tmp_path: Path, width: int, lang: str
) -> None:
    stored = ROOT / "captures" / "real-stacks" / "o1_profinetpy062_be.ds47.json"
    shutil.copy(ROOT / "captures" / "tour-machine.pcapng", tmp_path / "a.pcapng")
    shutil.copy(stored, tmp_path / "a.ds47.json")
    lines = printed(width, "check", "--all", "--lang", lang, str(tmp_path))
    assert len(lines) > 60
    assert list(too_wide(lines, width)) == []
    lines = printed(width, "accept", "--all", "--lang", lang, str(tmp_path), status=(2,))
    assert len(lines) > 60
    assert list(too_wide(lines, width)) == []


@pytest.mark.slow
@pytest.mark.parametrize("part", range(8))
def test_of_every_capture(part: int) -> None:
    for path in CAPTURES[part::8]:
        result = analyze(path)
        result.path = path.name
        for lang in LANGS:
            for width in WIDTHS:
                options = ReportOptions(rules=spec.rules(), lang=lang, width=width, color=True)
                stream = io.StringIO()
                write_all(text.Writer(stream, options), Report([result, result]))
                write_all(overview.Writer(stream, options), Report([result]))
                Trail(stream, "text", options).capture(result, Selection())
                assert list(too_wide(stream.getvalue().splitlines(), width)) == [], path


ROWS = [
    ("dp3", "slave", "12", "no answer to the first request of the master"),
    ("dp12", "master", "0", ""),
]
HEAD = ("station", "role", "requests", "about")


def test_a_table_where_it_has_room() -> None:
    assert table(ROWS, 80, HEAD) == [
        "  station  role    requests  about",
        "  dp3      slave   12        no answer to the first request of the master",
        "  dp12     master  0",
    ]
    assert table(ROWS, None, HEAD) == table(ROWS, 80, HEAD)
    assert table(ROWS, 80, HEAD, right=True)[2] == "     dp12  master         0"


def test_the_last_cell_is_broken_as_long_as_it_has_some_room() -> None:
    assert table(ROWS, 56, HEAD) == [
        "  station  role    requests  about",
        "  dp3      slave   12        no answer to the first",
        "                             request of the master",
        "  dp12     master  0",
    ]


def test_else_each_row_is_a_card_without_what_is_nothing() -> None:
    assert table(ROWS, 40, HEAD, lead=(0, 1)) == [
        "  dp3  slave",
        "    requests 12",
        "    about no answer to the first request",
        "    of the master",
        "  dp12  master",
    ]
    dim = table([("a", "x", "PPO3")], 14, ("name", "b", "PPO"), paint=lambda _, text: f"<{text}>")
    assert dim == ["  a", "    <b> x", "    PPO3"]


def test_a_line_is_broken_between_cells_first() -> None:
    assert fitted("  10.0.0.1  device 0x0501  1 transaction, all done", 40) == [
        "  10.0.0.1  device 0x0501",
        "      1 transaction, all done",
    ]
    long = "  10.0.0.1     a text that has no room in a line of its own  ok"
    assert fitted(long, 40) == [
        "  10.0.0.1",
        "      a text that has no room in a line",
        "      of its own",
        "      ok",
    ]
    assert fitted(long, None) == [long]


def test_in_a_pipe_a_table_stays_one(capsys: pytest.CaptureFixture[str]) -> None:
    capture = str(ROOT / "captures" / "s7-stacks" / "areas_pure_cpp_480.pcapng")
    assert main(["report", "--all", capture]) == 0
    (row,) = [
        line for line in capsys.readouterr().out.splitlines() if " -> 127.0.0.2:102  " in line
    ]
    assert columns(row) > 140
