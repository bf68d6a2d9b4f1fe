"""What a newcomer types first: the bare command, words that are nearly right, options that choose what failed."""

from __future__ import annotations

import json
import re
import shlex
import struct
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
import pytest

from ds47.cli import COMMANDS, EXAMPLES, GROUPS, group, main
from ds47.cli.selecting import CRITERIA, chosen
from ds47.report.zones import Zone

Captured = pytest.CaptureFixture[str]


def run(capsys: Captured, *words: object) -> tuple[int, str, str]:
    status = main([*map(str, words)])
    said = capsys.readouterr()
    return status, said.out, said.err


def test_the_bare_command_is_a_help_on_stdout(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["ds47"])
    assert main() == 0
    out, err = capsys.readouterr()
    assert not err
    for title, commands in GROUPS.items():
        assert f"\n{title}:\n" in out
        for name, about in commands.items():
            assert f"  {name}" in out
            assert about in out
    assert "..." not in out.partition("Look at")[2]
    assert out.rstrip().endswith("Start with: ds47 demo")
    assert max(map(len, out.splitlines())) <= 80


def test_no_help_shows_the_marks_of_its_layout(capsys: Captured) -> None:
    for name in COMMANDS:
        status, out, _ = run(capsys, name, "-h")
        assert status == 0
        assert "\\b" not in out, name


def test_every_command_is_in_a_group() -> None:
    package = Path(main.__code__.co_filename).parent
    written = {
        path.stem for path in package.glob("*.py") if "\ndef command(" in path.read_text("utf-8")
    }
    assert set(COMMANDS) == written


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["report", "-s", "faild", "x"], "'faild' is unknown. Did you mean 'failed'?"),
        (["report", "-f", "jsn", "x"], "'jsn' is unknown. Did you mean 'json'?"),
        (["report"], "Missing argument 'PATH...'. Try: ds47 report -h"),
        (
            ["report", "-r", "drive-eror", "a.pcap"],
            "no rule has the number or name 'drive-eror'. Did you mean: drive-error?",
        ),
        (["report", "--select", "xyz", "a.pcap"], "Try: ds47 rules"),
        (["decode", ""], "the message: no bytes. Try: ds47 decode 01"),
        (["report", "--expect", __file__, "a.pcap"], "ends in .py. Try: .toml, .csv or .xlsx"),
        (["watch"], "a SOURCE (- for stdin). Try: ds47 watch -h"),
        (["reprot"], "No such command 'reprot'. Did you mean: ds47 report, ds47 export?"),
        (["explain", "p1120", "xyzzy"], "unknown code 'xyzzy'. Accepted: "),
    ],
)
def test_an_error_is_one_line_with_one_prefix(
    capsys: Captured, words: list[str], said: str
) -> None:
    status, out, err = run(capsys, *words)
    assert (status, out) == (2, "")
    (line,) = err.splitlines()
    assert line.startswith("ds47: error: ")
    assert line.count("Try: ") <= 1
    assert said in line


@pytest.mark.parametrize(
    "words",
    [["trail"], ["diff", "a.pcap"], ["export"], ["baseline"], ["accept", "--yes"]],
)
def test_what_cannot_be_read_has_the_same_prefix(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.pcap").write_bytes(b"\x89PNG\r\n\x1a\n")
    status, _, err = run(capsys, *words, "a.pcap")
    assert status == 3
    (line,) = err.splitlines()
    assert line.startswith("ds47: error: a.pcap: not a capture: it is a PNG picture. Try: ")


HELPED = [
    (name, line)
    for name in COMMANDS
    for line, _ in getattr(group.get_command(click.Context(group), name), "examples", ())
]
HELPED += [(line.split()[1], line) for line, _ in EXAMPLES]


@pytest.mark.parametrize(("name", "line"), HELPED)
def test_an_example_is_what_its_command_takes(name: str, line: str) -> None:
    program, word, *arguments = shlex.split(line)
    assert (program, word) == ("ds47", name)
    command = group.get_command(click.Context(group), name)
    assert command is not None
    assert command.make_context(name, arguments).params


def test_a_long_help_is_in_groups_with_an_example_first(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    _, out, _ = run(capsys, "report", "-h")
    titles = [line.rstrip(":") for line in out.splitlines() if line and not line.startswith(" ")][
        1:
    ]
    assert titles[0] == "Examples"
    assert titles[-3:] == ["Many captures", "How to read the frames", "Cyclic frames, PROFIBUS, S7"]
    for option in ("--summary", "--all", "--s7-port", "--select", "--help"):
        assert out.count(f"{option} ") >= 1
    assert len(out.splitlines()) <= 90
    assert "S7:" not in run(capsys, "explain", "-h")[1]
    own = run(capsys, "export", "--help")[1].partition("Options:\n")[2].partition("\n\n")[0]
    assert "--anonymise " in own
    assert "--state" not in own


def test_a_full_disk_has_a_name(capsys: Captured, captures: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    status, _, err = run(capsys, "report", "-o", full, captures / "tour-machine.pcapng")
    assert status == 2
    assert err == (
        "ds47: error: cannot write /dev/full: No space left on device. Try: a file on another disk\n"
    )
    capture = captures / "tour-machine.pcapng"
    assert run(capsys, "trail", "-o", full, capture)[2] == err
    with full.open("w") as stream:  # the shell opened it: ds47 was told no name
        words = [sys.executable, "-m", "ds47", "report", capture]
        done = subprocess.run(words, stdout=stream, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (2, err)


@pytest.mark.parametrize(
    ("word", "numbers"),
    [("failed", [5, 6, 7]), ("outcome-unknown", [8]), ("not-ok", [5, 6, 7, 8]), ("partial", [7])],
)
def test_states_in_one_word(
    capsys: Captured, captures: Path, word: str, numbers: list[int]
) -> None:
    status, out, _ = run(capsys, "report", "-f", "json", "-s", word, captures / "tour-machine.pcapng")  # fmt: skip
    assert status == 0
    (capture,) = json.loads(out)["captures"]
    assert [each["id"] for each in capture["transactions"]] == numbers


@pytest.mark.parametrize("name", ["params", "plugin", "lab"])
def test_the_bare_name_of_a_family_of_commands_shows_its_help(
    capsys: Captured, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    status, out, err = run(capsys, name)
    assert (status, err) == (0, "")
    assert out.startswith(f"Usage: ds47 {name}")
    assert "..." not in out.partition("Commands:")[2]


def test_several_codes(capsys: Captured) -> None:
    status, out, _ = run(capsys, "explain", "p1120", "DE80B500")
    assert status == 0
    alone = [run(capsys, "explain", each)[1] for each in ("p1120", "DE80B500")]
    assert out == "\n".join(alone)
    assert run(capsys, "explain", "error", "82")[1].startswith("0x82 = 130")


def test_a_parameter_behind_params_is_shown(capsys: Captured) -> None:
    assert run(capsys, "params", "p1120") == run(capsys, "params", "show", "p1120")
    assert run(capsys, "params", "ramp") == run(capsys, "params", "show", "ramp")
    assert run(capsys, "params", "shwo")[0] == 2


def test_parameters_are_offered_where_one_is_missing(capsys: Captured, captures: Path) -> None:
    status, out, err = run(capsys, "report", "--pnu", "p1121", captures / "tour-machine.pcapng")
    assert (status, out) == (1, "")
    assert err.startswith(
        "ds47: error: nothing matches --pnu 1121; read or changed here: p50076, p50303, p50304"
    )


def test_states_are_offered_where_one_is_missing(capsys: Captured, captures: Path) -> None:
    path = captures / "conversation-superseded-read.pcapng"
    status, out, err = run(capsys, "report", "-s", "unanswered", path)
    assert (status, out) == (1, "")
    assert err == (
        "ds47: error: nothing matches --state unanswered; there are 1 ok, 1 superseded;"
        " superseded: the response was not fetched before the next request\n"
    )
    _, _, err = run(capsys, "report", "--lang", "zh", "-s", "unanswered", path)
    assert err.startswith("ds47: error: 没有内容符合 --state unanswered；有 1 个正常，1 个被取代；")
    _, _, err = run(capsys, "trail", "-s", "orphan", captures / "tour-machine.pcapng")
    assert err.endswith("there are 4 ok, 1 partial, 1 error, 1 refused, 1 unanswered\n")


def test_a_station_without_transactions_can_be_asked_for(capsys: Captured, captures: Path) -> None:
    path = captures / "profibus-wrong-project.pcapng"
    status, out, err = run(capsys, "report", "-d", "dp3", path)
    assert (status, err) == (0, "")
    assert "narrowed by --device dp3: 0 of 0 transactions, 4 of 6 findings" in out
    assert "DS814 error bus-slave-diagnosis" in out
    healthy = captures / "profibus-healthy.pcapng"
    status, out, _ = run(capsys, "report", "-d", "dp4", healthy)  # not even a finding
    assert status == 0
    assert [line.split()[0] for line in out.splitlines() if line.startswith("  dp")] == [
        "dp2", "dp4", "dp4",
    ]  # fmt: skip
    assert run(capsys, "report", "-d", "dp4", "-s", "error", healthy)[0] == 1
    status, out, err = run(capsys, "report", "-d", "dp77", healthy)
    assert (status, out) == (1, "")
    assert err == "ds47: error: nothing matches --device dp77; there are dp3, dp4, dp5\n"


@pytest.mark.parametrize("command", ["report", "trail", "export"])
@pytest.mark.parametrize(("start", "end"), [("12:00", "11:00"), ("12", "11.5")])
def test_a_span_that_ends_before_it_begins(
    capsys: Captured, captures: Path, tmp_path: Path, command: str, start: str, end: str
) -> None:
    path = captures / "tour-machine.pcapng"
    words = command, "-o", tmp_path / "out", "--from", start, "--to", end, path
    status, _, err = run(capsys, *words)
    assert status == 2
    assert f"ds47: error: --from is later than --to. Try: ds47 {command} -h\n" in err


def test_a_span_of_time_may_go_past_midnight() -> None:
    zone = Zone("UTC", UTC)
    none: dict[str, Any] = dict.fromkeys(CRITERIA, ())
    choice = chosen(zone, **none | {"start": "23:50", "end": "00:10"})
    first = int(datetime(2026, 1, 1, 23, tzinfo=UTC).timestamp()) * 10**9
    selection = choice.of(first, first + 2 * 3600 * 10**9)
    assert (selection.start, selection.end) == (first + 3000 * 10**9, first + 4200 * 10**9)


def test_an_interface_without_its_option(capsys: Captured) -> None:
    _, _, err = run(capsys, "watch", "eth99")
    assert err == (
        "ds47: error: cannot open eth99: No such file or directory."
        " For an interface: ds47 watch -i eth99\n"
    )
    for path in ("eth99.pcapng", "./eth99"):
        assert "interface" not in run(capsys, "watch", path)[2]


def test_one_length_of_a_report(capsys: Captured, captures: Path) -> None:
    path = captures / "tour-machine.pcapng"
    status, out, err = run(capsys, "report", "--summary", "--all", path)
    assert (status, out) == (2, "")
    assert err == "ds47: error: either --summary or --all. Try: ds47 report -h\n"
    _, _, err = run(capsys, "report", "--all", "-f", "json", path)
    assert "--all has no effect in json, only in text" in err


def test_a_fault_says_how_to_take_in_its_list(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the advice has it: a CSV file with two columns, one command."""
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "lists"))
    _, out, _ = run(capsys, "explain", "F07900")
    told = " ".join(out.split())
    assert "the columns number (F07900) and name" in told
    command = "params import LIST.csv --vendor sinamics"
    assert f"ds47 {command}" in told
    (tmp_path / "LIST.csv").write_text("number,name\nF07900,Motor blocked\n", "utf-8")
    monkeypatch.chdir(tmp_path)
    assert run(capsys, *command.split())[0] == 0
    assert "Motor blocked" in run(capsys, "explain", "F07900")[1]


def test_a_page_is_not_for_a_terminal(
    capsys: Captured, captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    status, out, _ = run(capsys, "report", "-f", "html", captures / "tour-machine.pcapng")
    assert (status, out) == (0, "written to tour-machine.html: open it in a browser\n")
    assert (tmp_path / "tour-machine.html").read_text("utf-8").startswith("<!doctype html>")
    assert not opened
    run(capsys, "report", "-f", "html", "--open", captures / "tour-machine.pcapng")
    assert opened == [(tmp_path / "tour-machine.html").as_uri()]


def test_the_name_of_a_file_says_its_format(
    capsys: Captured, captures: Path, tmp_path: Path
) -> None:
    for name, begins in (("x.html", "<!doctype html>"), ("x.md", "## ")):
        assert (
            run(capsys, "report", "-o", tmp_path / name, captures / "tour-machine.pcapng")[0] == 0
        )
        assert (tmp_path / name).read_text("utf-8").startswith(begins)
    run(capsys, "report", "-f", "text", "-o", tmp_path / "y.html", captures / "tour-machine.pcapng")
    assert "NOT OK: " in (tmp_path / "y.html").read_text("utf-8").splitlines()[1]


def test_a_verdict_of_a_part_says_so(capsys: Captured, captures: Path) -> None:
    _, out, _ = run(capsys, "report", "-t", "6", captures / "tour-machine.pcapng")
    assert out.splitlines()[1].startswith("NOT OK, in the part shown: p50076 cannot be changed now")
    assert "only transaction" not in out
    _, out, _ = run(capsys, "report", "-r", "DS721", captures / "tour-machine.pcapng")
    assert out.splitlines()[1] == "OK, in the part shown: no parameter transaction"


@pytest.mark.parametrize(
    ("option", "there"),
    [
        (["--do", "9"], "there is DO 2"),
        (["-t", "99"], "the last transaction is #8"),
        (["--from", "9999"], "the capture lasts 13.5 s"),
        (["-r", "DS711"], "there are DS203, DS402, DS410, DS417, DS701, DS705, DS719, DS721"),
    ],
)
def test_what_there_is_instead_is_of_the_kind_that_was_asked_for(
    option: list[str], there: str, captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", *option, str(captures / "tour-machine.pcapng")]) == 1
    assert capsys.readouterr().err.rstrip().endswith(there)


@pytest.mark.parametrize("words", ["ramp-up time", "ramp up time", "Rampup Time"])
def test_a_name_is_found_whatever_stands_between_its_words(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["params", "show", words]) == 0
    assert "p1120" in capsys.readouterr().out


def test_a_word_that_is_no_code_shows_the_parameters_that_have_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["params", "show", "ramp"]) == 0
    whole = [each for each in capsys.readouterr().out.splitlines() if not each.startswith(" ")]
    assert main(["explain", "ramp"]) == 0
    *found, last = capsys.readouterr().out.splitlines()
    assert found == whole[:10]
    assert last == f"and {len(whole) - 10} more; all, with their sources: ds47 params show ramp"
    assert main(["explain", "ramp-up", "time"]) == 0
    out = capsys.readouterr().out
    assert "p1120" in out
    assert out.endswith("\nwith their sources: ds47 params show 'ramp-up time'\n")


def test_a_word_is_looked_up_in_both_languages(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "ramp", "--lang", "zh"]) == 0
    assert "p1120  斜坡函数发生器斜坡上升时间" in capsys.readouterr().out
    assert main(["explain", "斜坡"]) == 0
    assert "p1120  Ramp-function generator, ramp-up time" in capsys.readouterr().out
    assert main(["explain", "xyzzy", "--lang", "zh"]) == 2
    assert capsys.readouterr().err.startswith("ds47: error: 未知代码 'xyzzy'. 可用的形式：")


def test_a_word_that_is_a_code_too_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "slow"]) == 0
    assert capsys.readouterr().out.startswith("DS416 slow")


@pytest.mark.parametrize(
    ("words", "named"),
    [(["-f", "json", "ramp"], True), (["p1120", "ramp"], True), (["rampart"], False)],
)
def test_a_look_up_by_name_is_offered_where_it_finds_something(
    words: list[str], named: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", *words]) == 2
    out, err = capsys.readouterr()
    assert (out, "ds47 params show ramp" in err) == ("", named)


def test_a_file_that_no_format_is_for_is_refused(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = tmp_path / "report.pdf"
    assert main(["report", str(captures / "tour-machine.pcapng"), "-o", str(there)]) == 2
    assert "print the page to one" in capsys.readouterr().err
    assert not there.exists()


def test_an_empty_capture_is_one_for_every_command(capsys: Captured, tmp_path: Path) -> None:
    path = tmp_path / "plain.pcap"
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    path.write_bytes(header + struct.pack("<IIII", 1, 0, 60, 60) + bytes(60))
    told = [
        run(capsys, "trail", path)[2],
        run(capsys, "export", "-o", tmp_path / "copy.pcapng", path)[2],
        subprocess.run(
            [sys.executable, "-m", "ds47", "watch", "-"],
            input=path.read_bytes(),
            capture_output=True,
        ).stderr.decode(),
    ]
    for err in told:
        assert "EMPTY: 1 frame, none of PROFINET" in err
        assert "mirror port?" in err
    page = tmp_path / "page.html"
    run(capsys, "report", "-f", "html", "-o", page, path)
    text = page.read_text("utf-8")
    assert "Nothing can be said: the capture has no frame of PROFINET" in text
    assert "Nothing went wrong" not in text


def test_times_of_each_drive_object(capsys: Captured, captures: Path) -> None:
    path = captures / "real-stacks" / "o3_two_controllers.pcapng"
    _, out, _ = run(capsys, "report", "--all", path)
    times = re.search(r"^ +DO 2: p50 ([\d.]+ ms), max ([\d.]+ ms); DO 3: p50", out, re.MULTILINE)
    assert times
    _, out, _ = run(capsys, "report", "--do", "2", path)
    assert re.search(f"latency p50 {re.escape(times[1])}, .* max {re.escape(times[2])}", out)
