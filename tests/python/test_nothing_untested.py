"""No format, no command and no page comes in alone: each has a page with an example, a manual page, and a test.

What there is comes from the formats of the reports and from the commands themselves, with their subcommands. A
test is one that runs the command with these words. Whether an example works is test_readme.py's, whether a manual
page is complete test_man.py's.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import click
import pytest
import test_readme

from ds47.cli import group
from ds47.report import FORMATS

ROOT = Path(__file__).resolve().parents[2]
PAGES = {
    path: path.read_text("utf-8")
    for path in [*ROOT.glob("README*.md"), *(ROOT / "docs").rglob("*.md")]
}
BLOCK = re.compile(r"^```\w*\n(.*?)^```|((?:^ {4}\S[^\n]*\n)+)", re.DOTALL | re.MULTILINE)


def commands(
    found: click.Command = group, words: tuple[str, ...] = ()
) -> Iterator[tuple[str, click.Command]]:
    """Every command that does something, by its words: `check`, `params list`."""
    if not isinstance(found, click.Group):
        yield " ".join(words), found
        return
    context = click.Context(found)
    for name in found.list_commands(context):
        below = found.get_command(context, name)
        assert below is not None
        yield from commands(below, (*words, name))


COMMANDS = dict(commands())


def formats() -> Iterator[tuple[str, str]]:
    """Commands with each format that `-f` names; the first one is what comes without it."""
    for words, command in COMMANDS.items():
        for option in command.params:
            if "-f" in option.opts and isinstance(option.type, click.Choice):
                yield from ((words, name) for name in tuple(option.type.choices)[1:])


@cache
def examples() -> list[str]:
    """The lines of all blocks of code, those that go on below as one."""
    blocks = [each for text in PAGES.values() for each in BLOCK.findall(text)]
    joined = (re.sub(r" \\\n\s*", " ", fenced or indented) for fenced, indented in blocks)
    return [line for each in joined for line in each.splitlines()]


@cache
def runs() -> list[list[str]]:
    """The words of the texts that a call or a list in a test has with all that is inside, in their order."""
    paths = {*ROOT.glob("tests/python/*.py"), *ROOT.glob("tests/browser/*.py")} - {Path(__file__)}
    sources = [path.read_text("utf-8") for path in paths]
    command = re.compile(rf'"(?:{"|".join(each.split()[0] for each in COMMANDS)})[ "]')
    tests = [
        each
        for text in sources
        if command.search(text)
        for each in ast.parse(text).body
        if isinstance(each, ast.FunctionDef) and each.name.startswith("test_")
    ]
    return [words_of(each) for test in tests for each in outermost(test)]


def outermost(node: ast.AST) -> Iterator[ast.AST]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Call | ast.List | ast.Tuple):
            yield child
        else:
            yield from outermost(child)


def words_of(node: ast.AST) -> list[str]:
    texts = [
        each
        for each in ast.walk(node)
        if isinstance(each, ast.Constant) and isinstance(each.value, str)
    ]
    in_order = sorted(texts, key=lambda each: (each.lineno, each.col_offset))
    return [word for each in in_order for word in str(each.value).split()]


def follow(words: Sequence[str], wanted: Sequence[str]) -> bool:
    """Whether words stand behind each other."""
    count = len(wanted)
    return any(list(words[at : at + count]) == list(wanted) for at in range(len(words) - count + 1))


def manual_of(command: str) -> str:
    """What the manual page of a command, or its part about a subcommand, says."""
    first, *more = command.split()
    path = ROOT / "man" / f"ds47-{first}.1"
    text = path.read_text("utf-8") if path.exists() else ""
    return (
        text.partition(f".SH DS47 {command.upper()}\n")[2].partition("\n.SH ")[0] if more else text
    )


def lacking(command: str, manual: str, word: str | None = None) -> list[str]:
    """What a command does not have, or a format that its `-f` names."""
    shown = "" if word is None else f" ... -f {word}"
    option = "" if word is None else rf"(?=.* -f {re.escape(word)}(?: |$))"
    listed = manual.partition("\\fB\\-f, ")[2].partition("\n.")[0]
    offered = re.findall(r"[\w-]+", listed.replace("\\-", "-"))
    wanted = [command.split(), *([] if word is None else [["-f", word]])]
    found = {
        f"a block of code in a page of docs/ with `ds47 {command}{shown}`": any(
            re.search(rf"\bds47 {command}(?= |$){option}", line) for line in examples()
        ),
        "a manual page": f"\\fBds47 {command}\\fP" in manual if word is None else word in offered,
        f"a test that runs `ds47 {command}{shown}`": any(
            all(follow(words, each) for each in wanted) for words in runs()
        ),
    }
    return [what for what, is_there in found.items() if not is_there]


@pytest.mark.parametrize(("command", "name"), list(formats()))
def test_a_format(command: str, name: str) -> None:
    assert lacking(command, manual_of(command), name) == []


def test_the_page_of_the_report_begins_with_all_formats() -> None:
    head = PAGES[ROOT / "docs/report.md"].partition("\n| ")[0]
    missing = [name for name in FORMATS if f"`{name}`" not in head]
    assert not missing, f"docs/report.md, first paragraph: -f {', '.join(missing)}"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command(command: str) -> None:
    assert lacking(command, manual_of(command)) == []


def test_a_page_whose_commands_show_their_output_is_run() -> None:
    shown = {path for path, text in PAGES.items() if test_readme.read_commands(text)}
    assert shown - set(test_readme.PAGES) == set()


@pytest.mark.parametrize(
    ("command", "name"), [("report", "telex"), ("report", "note"), ("params list", "note")]
)
def test_a_format_that_comes_in_alone_is_noticed(command: str, name: str) -> None:
    assert lacking(command, manual_of(command), name) == [
        f"a block of code in a page of docs/ with `ds47 {command} ... -f {name}`",
        "a manual page",
        f"a test that runs `ds47 {command} ... -f {name}`",
    ]


def test_a_command_that_comes_in_alone_is_noticed() -> None:
    assert len(lacking("params sort", manual_of("params sort"))) == 3


WITHOUT_COMMAND = {
    "benchmarks.md": "what make bench wrote; a machine of its own",
    "data.md": "its commands run in test_data_examples.py",
    "developers/development.md": "commands of make",
    "developers/upstream.md": "programs of Wireshark",
    "developers/way.md": "what bench/way.py wrote",
    "engines.md": "needs tshark and pyshark: test_engine.py",
    "how-to/index.md": "a list of pages",
    "how-to/take-a-capture.md": "programs that capture",
    "offline.md": "files of a release, which make try-release tries",
    "pairing.md": "a specification",
    "platforms.md": "what was tried elsewhere",
    "protocol.md": "a specification",
    "python.md": "its examples run in test_library.py",
    "reliability.md": "commands of make, which take as long as one likes",
    "stability.md": "promises",
    "start/install.md": "how the command comes there",
}
"""Pages of docs/ on which no command runs, and why."""
TYPED = re.compile(r"(?:^\s*(?:\$ )?|[|(] ?)ds47 ([a-z][\w-]*)(.*)")


def typed(text: str) -> Iterator[tuple[str, str]]:
    """The words behind `ds47` in a page's code, in blocks and in sentences, and the rest of their lines."""
    blocks = [fenced or indented for fenced, indented in BLOCK.findall(text)]
    lines = [line for each in blocks for line in re.sub(r" \\\n\s*", " ", each).splitlines()]
    for line in [*lines, *re.findall(r"(?<!`)`(ds47 [^`\n]+)`(?!`)", text)]:
        yield from TYPED.findall(line)


def unknown(text: str) -> list[str]:
    """Commands, subcommands and options of a page that there are not."""
    found = []
    for word, rest in typed(text):
        command, words = group.get_command(click.Context(group), word), [word]
        for more in rest.split():
            if not isinstance(command, click.Group):
                break
            command = command.get_command(click.Context(command), more)
            words.append(more)
        if command is None:
            found.append(f"ds47 {' '.join(words)}")
            continue
        known = {
            each for option in command.params for each in (*option.opts, *option.secondary_opts)
        }
        given = re.findall(r" (--[a-z][\w-]*)", re.split(r" {2,}", rest)[0])
        found += [f"ds47 {word} {each}" for each in given if each not in {*known, "--help"}]
    return found


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_has_a_command_that_runs(path: Path) -> None:
    name = path.relative_to(ROOT / "docs").as_posix() if "docs" in path.parts else path.name
    runs_one = test_readme.read_commands(PAGES[path]) != []
    assert runs_one != (name in WITHOUT_COMMAND)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_what_a_page_types_is_there(path: Path) -> None:
    assert unknown(PAGES[path]) == []


def test_what_a_page_types_wrongly_is_noticed() -> None:
    page = (
        "    ds47 repot --nonsense capture.pcapng\n\n```console\n$ echo 1 | ds47 params sort\n"
        "$ ds47 report --nonsense x\n$ ds47 report --all x\n```\n`ds47 chekc` and ds47 knows it\n"
    )
    wrong = ["ds47 repot", "ds47 params sort", "ds47 report --nonsense", "ds47 chekc"]
    assert sorted(unknown(page)) == sorted(wrong)
