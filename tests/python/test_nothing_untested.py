"""No format, no command and no page comes in alone: each has a page with an example, a manual page, and a test.

What there is comes from the formats of the reports and from the commands themselves. Whether an example works is
test_readme.py's, whether a manual page is complete test_man.py's.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
import test_readme

from ds47.cli import COMMANDS
from ds47.report import FORMATS

ROOT = Path(__file__).resolve().parents[2]
PAGES = {
    path: path.read_text("utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
}
BLOCK = re.compile(r"^```\w*\n(.*?)^```|((?:^ {4}\S.*\n)+)", re.DOTALL | re.MULTILINE)


@cache
def examples() -> list[str]:
    """The lines of all blocks of code, those that go on below as one."""
    blocks = [each for text in PAGES.values() for each in BLOCK.findall(text)]
    joined = (re.sub(r" \\\n\s*", " ", fenced or indented) for fenced, indented in blocks)
    return [line for each in joined for line in each.splitlines()]


@cache
def names_of_tests() -> str:
    sources = [*(ROOT / "tests/python").glob("*.py"), *(ROOT / "tests/browser").glob("*.py")]
    found = (re.findall(r"def (test_\w+)", path.read_text("utf-8")) for path in sources)
    return " ".join(name for each in found for name in each)


def lacking(command: str, manual: str, word: str, *, named: bool = False) -> list[str]:
    """What a command does not have, or a format that `-f` names."""
    words, option = (f"... -f {word}", rf"(?=.* -f {word}\b)") if named else ("...", "")
    found = {
        f"a block of code in a page of docs/ with `ds47 {command} {words}`": any(
            re.search(rf"\bds47 {command}(?= |$){option}", line) for line in examples()
        ),
        "a manual page": re.search(rf"\b{word}\b", manual) is not None,
        f"a test whose name contains {word}": re.search(rf"test_\w*{word}", names_of_tests())
        is not None,
    }
    return [what for what, is_there in found.items() if not is_there]


def manual_of(command: str) -> str:
    path = ROOT / "man" / f"ds47-{command}.1"
    return path.read_text("utf-8") if path.exists() else ""


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_of_the_report(name: str) -> None:
    assert lacking("report", manual_of("report"), name, named=name != FORMATS[0]) == []


def test_the_page_of_the_report_begins_with_all_formats() -> None:
    head = PAGES[ROOT / "docs/report.md"].partition("\n| ")[0]
    missing = [name for name in FORMATS if f"`{name}`" not in head]
    assert not missing, f"docs/report.md, first paragraph: -f {', '.join(missing)}"


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command(name: str) -> None:
    assert lacking(name, manual_of(name), name) == []


def test_a_page_whose_commands_show_their_output_is_run() -> None:
    shown = {path for path, text in PAGES.items() if test_readme.read_commands(text)}
    assert shown - set(test_readme.PAGES) == set()


def test_what_comes_in_alone_is_noticed() -> None:
    assert lacking("report", manual_of("report"), "telex", named=True) == [
        "a block of code in a page of docs/ with `ds47 report ... -f telex`",
        "a manual page",
        "a test whose name contains telex",
    ]
