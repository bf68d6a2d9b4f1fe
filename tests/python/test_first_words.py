"""What a newcomer types first: the bare command, words that are nearly right, options that choose what failed."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import click
import pytest

from ds47.cli import COMMANDS, GROUPS, group, main

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
    assert said in line


HELPED = [
    (name, line)
    for name in COMMANDS
    for line, _ in getattr(group.get_command(click.Context(group), name), "examples", ())
]


@pytest.mark.parametrize(("name", "line"), HELPED)
def test_an_example_is_what_its_command_takes(name: str, line: str) -> None:
    program, word, *arguments = shlex.split(line)
    assert (program, word) == ("ds47", name)
    command = group.get_command(click.Context(group), name)
    assert command is not None
    assert command.make_context(name, arguments).params


def test_a_long_help_is_in_groups_with_an_example_first(capsys: Captured) -> None:
    _, out, _ = run(capsys, "report", "-h")
    titles = [line.rstrip(":") for line in out.splitlines() if line and not line.startswith(" ")][
        1:
    ]
    assert titles[0] == "Examples"
    assert titles[-3:] == ["PKW, cyclic frames, PROFIBUS", "S7", "Others"]
    for option in ("--summary", "--all", "--s7-port", "--select", "--help"):
        assert out.count(f"{option} ") >= 1
    assert "S7:" not in run(capsys, "explain", "-h")[1]


def test_a_full_disk_has_a_name(capsys: Captured, captures: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    status, _, err = run(capsys, "report", "-o", full, captures / "tour-machine.pcapng")
    assert status == 2
    assert "No space left on device" in err


@pytest.mark.parametrize(
    ("word", "numbers"), [("failed", [5, 6, 7]), ("not-ok", [5, 6, 7, 8]), ("partial", [7])]
)
def test_states_in_one_word(
    capsys: Captured, captures: Path, word: str, numbers: list[int]
) -> None:
    status, out, _ = run(capsys, "report", "-f", "json", "-s", word, captures / "tour-machine.pcapng")  # fmt: skip
    assert status == 0
    (capture,) = json.loads(out)["captures"]
    assert [each["id"] for each in capture["transactions"]] == numbers


def test_several_codes(capsys: Captured) -> None:
    status, out, _ = run(capsys, "explain", "p1120", "DE80B500")
    assert status == 0
    alone = [run(capsys, "explain", each)[1] for each in ("p1120", "DE80B500")]
    assert out == "\n".join(alone)
    assert run(capsys, "explain", "error", "82")[1].startswith("0x82 = 130")


def test_a_parameter_behind_params_is_shown(capsys: Captured) -> None:
    assert run(capsys, "params", "p1120") == run(capsys, "params", "show", "p1120")
    assert run(capsys, "params", "nonsense")[0] == 2


def test_parameters_are_offered_where_one_is_missing(capsys: Captured, captures: Path) -> None:
    status, out, err = run(capsys, "report", "--pnu", "p1121", captures / "tour-machine.pcapng")
    assert (status, out) == (1, "")
    assert err.startswith(
        "ds47: nothing matches --pnu 1121; read or changed here: p50076, p50303, p50304"
    )


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
    assert out.splitlines()[1].startswith("NOT OK, of what is shown: p50076 cannot be changed now")
    assert "only transaction" not in out
    _, out, _ = run(capsys, "report", "-r", "DS721", captures / "tour-machine.pcapng")
    assert out.splitlines()[1] == "OK, of what is shown: no parameter transaction"
