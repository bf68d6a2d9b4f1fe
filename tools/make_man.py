#!/usr/bin/env python3
"""Writes the manual pages of the command, man/ds47.1 and one for each of its commands, from what click knows.

    python tools/make_man.py [FOLDER]        (make man)

The wheel takes them along as share/man/man1. Equal commands give equal pages; tests/python/test_man.py holds them
to the present ones.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from ds47 import __version__
from ds47.cli import EXAMPLES, group

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "man"
STATUS = (
    ("0", "nothing at or above --fail-on, nothing else in the way"),
    ("1", "something was found, or nothing of what was asked for"),
    ("2", "wrong use, or an output that cannot be written"),
    ("3", "input unreadable, or not readable to its end"),
    ("70", "a fault of ds47 itself"),
    ("130", "interrupted"),
    ("141", "the reader of the output left"),
)
VARIABLES = (
    ("DS47_PARAMS", "the folder of the imported lists of parameters"),
    ("DS47_TSHARK", "the tshark to ask"),
    ("DS47_DUMPCAP", "the dumpcap to capture with"),
    ("DS47_TRACEBACK", "set: a fault of ds47 shows all that Python knows of it"),
    ("NO_COLOR", "set: no colours"),
)
FILES = (
    ("ds47.toml", "beside captures or above them: zone, title, expectations, masks, what cyclic frames hold"),
    ("NAME.ds47.json", "beside a capture: its stored result, which ds47 check compares"),
)  # fmt: skip


def escaped(text: str) -> str:
    """A text in which troff sees no command."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("`", "\\(ga").replace("^", "\\(ha")
    text = text.replace("~", "\\(ti").replace("'", "\\(aq")
    return re.sub(r"(?m)^\.", "\\&.", text)


def filled(text: str) -> str:
    """The same in lines as a source of troff has them."""
    return escaped(textwrap.fill(text, 72, break_long_words=False, break_on_hyphens=False))


def date() -> str:
    """That of this version in CHANGELOG.md, where it has one."""
    found = re.search(
        rf"^## \[{re.escape(__version__)}\] - (\S+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE
    )  # fmt: skip
    return found[1] if found else ""


def told(text: str) -> Iterator[str]:
    """The paragraphs of a help; one that begins with a backspace keeps its lines."""
    first = True
    for paragraph in re.split(r"\n\s*\n", text.strip("\n\f ")):
        whole = paragraph.lstrip("\n").startswith("\b")
        lines = [line.rstrip() for line in paragraph.replace("\b", "").strip("\n").split("\n")]
        if not first:
            yield ".PP"
        first = False
        if whole:
            yield from (".nf", *(escaped(line) for line in lines), ".fi")
        else:
            yield filled(" ".join(line.strip() for line in lines))


def pairs(rows: Iterator[tuple[str, str]] | tuple[tuple[str, str], ...]) -> Iterator[str]:
    """A list of terms with what they mean."""
    for term, meaning in rows:
        yield ".TP"
        yield rf"\fB{escaped(term)}\fP"
        yield filled(" ".join(meaning.split()))


def head(name: str, about: str) -> Iterator[str]:
    """Title and name."""
    yield '.\\" Made by tools/make_man.py from the help of the commands.'
    yield f'.TH "{escaped(name.upper().replace(" ", "-"))}" "1" "{date()}" "ds47 {__version__}" "ds47"'
    yield ".SH NAME"
    yield f"{escaped(name.replace(' ', '-'))} \\- {escaped(about)}"


def short(command: click.Command) -> str:
    """The first sentence of a command's help, as a name has it: no full stop."""
    return " ".join((command.help or "").split("\n\n")[0].split()).partition(". ")[0].rstrip(".")


def usage(command: click.Command, context: click.Context, name: str) -> str:
    """How it is called."""
    pieces = " ".join(command.collect_usage_pieces(context))
    return rf"\fB{escaped(name)}\fP {escaped(pieces)}"


def options(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    """The options with what their help says."""
    for each in command.get_params(context):
        record = each.get_help_record(context)
        if "--help" in each.opts:  # click keeps the names of the context that asked first
            record = ("-h, --help", each.help or "") if isinstance(each, click.Option) else record
        if record is not None and isinstance(each, click.Option):
            yield record


def examples(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Lines to type, with what they do, as the help of the command has them."""
    if rows:
        yield ".SH EXAMPLES"
    for line, about in rows:
        yield from (".TP", escaped(about), rf"\fB{escaped(line)}\fP")


def parts(command: click.Command, context: click.Context, name: str) -> Iterator[str]:
    """Synopsis, description and options; of a group the same of each of its commands."""
    yield ".SH SYNOPSIS"
    yield usage(command, context, name)
    yield ".SH DESCRIPTION"
    yield from told(command.help or "")
    yield ".SH OPTIONS"
    yield from pairs(options(command, context))
    yield from examples(getattr(command, "examples", ()))
    if isinstance(command, click.Group):
        for word in command.list_commands(context):
            found = command.get_command(context, word)
            assert found is not None
            inner = click.Context(found, context, info_name=word)  # with the names of --help above
            yield f".SH {escaped(name.upper())} {escaped(word.upper())}"
            yield usage(found, inner, f"{name} {word}")
            yield ".PP"
            yield from told(found.help or "")
            yield from pairs(options(found, inner))


def overview(context: click.Context) -> Iterator[str]:
    """The page of the command itself."""
    yield from head("ds47", short(group))
    yield ".SH SYNOPSIS"
    yield usage(group, context, "ds47")
    yield ".SH DESCRIPTION"
    yield from told(group.help or "")
    yield ".SH COMMANDS"
    words = [(word, group.get_command(context, word)) for word in group.list_commands(context)]
    yield from pairs(tuple((f"ds47-{word}(1)", short(found)) for word, found in words if found))
    yield ".SH OPTIONS"
    yield from pairs(options(group, context))
    for title, rows in (("EXIT STATUS", STATUS), ("ENVIRONMENT", VARIABLES), ("FILES", FILES)):
        yield f".SH {title}"
        yield from pairs(rows)
    yield from examples(EXAMPLES)
    yield ".SH SEE ALSO"
    yield r"\fBtshark\fP(1), \fBdumpcap\fP(1)"


def pages() -> dict[str, str]:
    """The name of each page, and its text."""
    context = click.Context(group, info_name="ds47", **group.context_settings)
    found = {"ds47.1": overview(context)}
    for word in group.list_commands(context):
        command = group.get_command(context, word)
        assert command is not None
        inner = click.Context(command, context, info_name=word)
        name = f"ds47 {word}"
        found[f"ds47-{word}.1"] = iter((
            *head(name, short(command)), *parts(command, inner, name), ".SH SEE ALSO", r"\fBds47\fP(1)",
        ))  # fmt: skip
    return {name: "\n".join(lines) + "\n" for name, lines in found.items()}


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    made = pages()
    for old in folder.glob("*.1"):
        if old.name not in made:
            old.unlink()
    for name, text in made.items():
        (folder / name).write_text(text, "utf-8", newline="\n")
    print(f"{folder}: {len(made)} pages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
