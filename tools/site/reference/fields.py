"""Fields of the Wireshark plugin: names and types are its own, meanings those of wireshark.md and fields.toml."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .markdown import code, plain, table

LUA = ("lua5.4", "lua5.3", "lua5.2", "lua")
MOST_WORDS = 24
"""A field with more words than these says how many; the tables that they come from have pages of their own."""
_HEAD = """# Fields in Wireshark

Every field that the plugin registers, with its type, as display filters, columns and `tshark -e` take it. How they
are used: [the plugin](../wireshark.md#filters).
"""
_TYPES = {
    "string": "text",
    "framenum": "frame",
    "relative_time": "duration",
    "ether": "MAC",
    "ipv4": "IPv4",
    "guid": "GUID",
}
_GROUPS = (
    ("pzd.", "Control and status word of drives"), ("pkw.", "PKW in cyclic frames"), ("profibus.", "PROFIBUS"),
    ("finding.", "Findings"), ("description.", "Descriptions of parameters"),
    ("frames.", "Frames of a transaction"),
)  # fmt: skip
_ROW = re.compile(r"^\| (`ds47[^|]*) \| ([^|]*) \| (.*) \|$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Field:
    """A field as the plugin registers it; `words` are those of its numbers."""

    name: str
    kind: str
    label: str
    words: tuple[str, ...]


def registered(root: Path) -> list[Field]:
    """All of them, in the order in which they are registered, each once.

    Raises:
        FileNotFoundError: there is no Lua.
    """
    program = next((each for each in LUA if shutil.which(each)), None)
    if program is None:
        raise FileNotFoundError(f"none of {', '.join(LUA)} is installed (Debian: lua5.4)")
    command = [program, str(root / "tools" / "site" / "fields.lua"), str(root)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, encoding="utf-8")
    found: dict[str, Field] = {}
    for line in done.stdout.splitlines():
        name, kind, label, words = line.split("\t")
        found[name] = Field(name, kind, label, tuple(words.split(";")) if words else ())
    return list(found.values())


def meanings(root: Path) -> dict[str, str]:
    """What docs/wireshark.md says of each field, and fields.toml of those that it leaves out, as Markdown."""
    text = (root / "docs" / "wireshark.md").read_text("utf-8")
    others = tomllib.loads((root / "tools" / "site" / "fields.toml").read_text("utf-8"))
    found = {f"ds47.{name}": says for names, says in others.items() for name in names.split()}
    for names, _kinds, says in _ROW.findall(text):
        moved = re.sub(r"\]\((?=[\w-]+\.md)", "](../", says)
        for name in re.findall(r"`(ds47[a-z0-9_.]*)`", names):
            found[name] = moved
    return found


def page(root: Path) -> str:
    """All fields by groups; what has no group stands first."""
    fields, says = registered(root), meanings(root)
    parts = [_HEAD, "## The parameter channel\n", _table(_ungrouped(fields), says)]
    for start, title in _GROUPS:
        chosen = [each for each in fields if _key(each).startswith((start, start[:-1] + " "))]
        parts += [f"## {title}\n", _table(chosen, says)]
    return "\n".join(parts)


def _key(field: Field) -> str:
    """The name without `ds47.`; a group's own name counts as of the group."""
    return field.name.removeprefix("ds47.") + " "


def _ungrouped(fields: list[Field]) -> list[Field]:
    starts = tuple(each for start, _ in _GROUPS for each in (start, start[:-1] + " "))
    return [field for field in fields if not _key(field).startswith(starts)]


def _table(fields: list[Field], says: dict[str, str]) -> str:
    return table(("field", "type", "label", "is"), (tuple(_row(each, says)) for each in fields))


def _row(field: Field, says: dict[str, str]) -> Iterator[str]:
    yield f'<span id="{field.name}">{code(field.name)}</span>'
    yield _TYPES.get(field.kind, field.kind)
    yield plain(field.label)
    few = len(field.words) <= MOST_WORDS
    words = ", ".join(code(each) for each in field.words) if few else f"{len(field.words)} words"
    yield "<br>".join(part for part in (says.get(field.name, ""), words) if part)
