"""Commands and options, from click's own objects: what `ds47 COMMAND --help` says, as a page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click

from ds47.cli import group

from .markdown import code, plain, table

_HEAD = """# Commands

Every command with its options, as `ds47 COMMAND --help` says it. A capture is named by a path, a folder, a URL, or
`-` for standard input. The exit status of every command: 0 nothing at or above `--fail-on`, 1 something, 2 wrong
use, 3 an input that could not be read to its end, 70 a fault of ds47 itself, 130 interrupted.
"""


def commands() -> Iterator[tuple[str, click.Command, click.Context]]:
    """Every command with its whole name, commands of commands too, in the order of the help."""
    yield from _below("ds47", group, click.Context(group, info_name="ds47"))


def _below(
    name: str, parent: click.Group, context: click.Context
) -> Iterator[tuple[str, click.Command, click.Context]]:
    for word in parent.list_commands(context):
        command = parent.get_command(context, word)
        if command is None or command.hidden:
            continue
        inner = click.Context(command, info_name=word, parent=context)
        yield f"{name} {word}", command, inner
        if isinstance(command, click.Group):
            yield from _below(f"{name} {word}", command, inner)


def page(_root: Path) -> str:
    """All of them."""
    return _HEAD + "".join(_chapter(*each) for each in commands())


def _chapter(name: str, command: click.Command, context: click.Context) -> str:
    level = "#" * (1 + name.count(" "))
    usage = command.get_usage(context).removeprefix("Usage: ")
    parts = [f"{level} {name}", f"```text\n{' '.join(usage.split())}\n```", *_paragraphs(command)]
    rows = list(_options(command, context))
    if rows:
        parts.append(table(("option", "does"), rows))
    return "\n" + "\n\n".join(parts) + "\n"


def _paragraphs(command: click.Command) -> Iterator[str]:
    """The help; a paragraph that click leaves alone, because of the mark for that, keeps its lines."""
    for paragraph in re.split(r"\n\s*\n", (command.help or "").strip()):
        lines = [line.strip() for line in paragraph.splitlines()]
        if lines and lines[0] == "\b":
            yield "```text\n" + "\n".join(lines[1:]) + "\n```"
        elif lines != [""]:
            yield _linked(" ".join(lines))


def _options(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if isinstance(parameter, click.Option) and record:
            yield code(record[0]).replace("&#124;", "&#124;<wbr>"), _linked(record[1])


def _linked(text: str) -> str:
    """Plain text in which a page of the documentation is a link."""
    return re.sub(r"docs/([\w-]+)\.md", r"[\1](../\1.md)", plain(text))
