"""The README and the pages of docs/ show what happens: each ``ds47`` command runs and shows the real output.

In a ``console`` block a line that starts with ``$ `` is a command, run by a shell's rules but
without a shell: pipes, ``<`` and ``>`` as a person types them. ``  # exit 1`` at its end says which
exit status it has, otherwise it has to be 0. They run in their order, in one folder.
"""

import os
import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from forked import ds47
from ringbuffer import recording

README = Path(__file__).resolve().parents[2] / "README.md"
CHINESE = README.with_name("README.zh.md")
DOCS = README.parent / "docs"
PAGES = [README, CHINESE, *sorted(DOCS.rglob("*.md"))]
PLACEHOLDER = "(the report stands here)"


@dataclass(frozen=True)
class Command:
    """A command of the README: its line, its exit status, and the output shown below it."""

    line: str
    status: int
    output: tuple[str, ...]


def read_commands(text: str) -> list[Command]:
    """All ``$ ds47`` commands in the console blocks of a Markdown text."""
    commands = []
    for block in re.findall(r"^```console\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            line, *output = part.rstrip("\n").split("\n")
            line, _, comment = re.sub(r" {3,}#", "  #", line).partition("  # ")
            status = re.match(r"exit (\d+)", comment)
            if re.search(r"\bds47 |^cat ", line):
                commands.append(Command(line, int(status[1]) if status else 0, tuple(output)))
    return commands


def split_pipe(line: str) -> tuple[list[list[str]], dict[str, str]]:
    """Split a command line into the programs of its pipe and its redirections."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="|<>")
    lexer.whitespace_split = True
    words = list(lexer)
    programs: list[list[str]] = [[]]
    files: dict[str, str] = {}
    position = 0
    while position < len(words):
        word = words[position]
        if word == "|":
            programs.append([])
        elif word in ("<", ">"):
            position += 1
            files[word] = words[position]
        else:
            programs[-1].append(word)
        position += 1
    return programs, files


def home_in(folder: Path) -> dict[str, str]:
    """A home folder for commands that write into it, such as `ds47 plugin install`."""
    home = str(folder / "home")
    return {
        "HOME": home,
        "USERPROFILE": home,
        "APPDATA": home,
        "XDG_CONFIG_HOME": f"{home}/.config",
    }


def run(command: Command, folder: Path) -> tuple[int, str, str]:
    """Run a command in a folder; returns exit status, stdout and stderr of the last program."""
    programs, files = split_pipe(command.line)
    data = (folder / files["<"]).read_bytes() if "<" in files else b""
    status, errors = 0, b""
    for words in programs:
        if words[0] == "ds47":
            arguments = words[1:]
        elif words[0] == "echo":
            data = (" ".join(words[1:]) + "\n").encode()
            continue
        else:
            assert words[0] == "cat", f"the README may use ds47, echo and cat, not {words[0]}"
            data = b"".join((folder / word).read_bytes() for word in words[1:])
            continue
        environment = {**os.environ, **home_in(folder), "PYTHONUTF8": "1", "NO_COLOR": "1"}
        result = ds47(*arguments, cwd=folder, env=environment, data=data)
        status, data, errors = result.returncode, result.stdout, result.stderr
    if ">" in files:
        (folder / files[">"]).write_bytes(data)
        data = b""
    return status, data.decode("utf-8"), errors.decode("utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the stored captures, so that no command can change the checkout."""
    copy = tmp_path_factory.mktemp("readme")
    shutil.copytree(README.parent / "captures", copy / "captures")
    recording(copy / "recording", README.parent / "captures")
    return copy


@pytest.fixture(scope="module")
def done() -> dict[str, tuple[int, str, str]]:
    """What each line came to: on the stored captures, which do not change, it comes to the same again."""
    return {}


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [command for page in PAGES for command in read_commands(page.read_text("utf-8"))],
    ids=lambda c: c.line,
)
def test_command_of_the_readme(
    command: Command, folder: Path, done: dict[str, tuple[int, str, str]]
) -> None:
    if command.line not in done or " captures" not in command.line:
        done[command.line] = run(command, folder)
    status, output, errors = done[command.line]
    assert status == command.status, errors
    assert "Traceback" not in errors
    if " -i lo" in command.line:  # where other tests talk at the same time
        assert re.search(r"^Summary of \d+ frames", output, re.MULTILINE), output
    elif PLACEHOLDER not in command.output:
        _assert_shown(command.output, output)


def _assert_shown(shown: tuple[str, ...], output: str) -> None:
    """The lines shown are lines of the output, in order; "..." stands for any left out."""
    lines = iter([line.rstrip() for line in output.splitlines()])
    for line in shown:
        if line.strip() in ("", "..."):
            continue
        assert line.rstrip() in lines, f"not in the output, or not in this order: {line!r}"


@pytest.mark.parametrize("page", [README, CHINESE, DOCS / "index.md"], ids=lambda page: page.name)
def test_a_report_is_what_one_sees_first(page: Path) -> None:
    shown = page.read_text("utf-8").partition("<!-- show ")[2].partition(" -->\n")[2]
    first = read_commands(shown)[0]
    assert first.line.startswith("ds47 report ")
    assert len(first.output) <= 15


def test_the_readme_says_the_same_in_chinese() -> None:
    said, told = (read_commands(page.read_text("utf-8")) for page in (CHINESE, README))
    assert {each.line.replace("--lang zh ", "").removesuffix(" --lang zh") for each in said} == {
        each.line for each in told
    }


def test_links_lead_somewhere() -> None:
    for document in [README, CHINESE, *DOCS.rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", document.read_text("utf-8")):
            assert (document.parent / target).exists(), f"{document.name}: {target}"


def test_a_status_and_an_output_are_read_from_a_block() -> None:
    text = (
        "```console\n$ ds47 report x  # exit 3\none\n\ntwo\n"
        "$ cat a | ds47 decode\n$ make report\n```\n"
    )
    assert read_commands(text) == [
        Command("ds47 report x", 3, ("one", "", "two")),
        Command("cat a | ds47 decode", 0, ()),
    ]


def test_a_command_line_is_split_as_a_shell_does() -> None:
    assert split_pipe("echo '16#0101 16#0102' | ds47 decode - > out.json") == (
        [["echo", "16#0101 16#0102"], ["ds47", "decode", "-"]],
        {">": "out.json"},
    )


def test_columns_are_documented() -> None:
    from ds47.report.csv import COLUMNS

    text = (README.parent / "docs" / "data.md").read_text("utf-8").partition("## CSV")[2]
    assert [name for name in re.findall(r"`([a-z_.]+)`", text) if name in COLUMNS][
        : len(COLUMNS)
    ] == list(COLUMNS)
