#!/usr/bin/env python3
"""Writes what a version promises to keep, a line each, into tests/vectors/surface.txt (docs/stability.md).

    python tools/make_surface.py        (make surface; needs a Lua)

Lines are only added: what is gone keeps its line, and tests/python/test_stability.py complains. A line that has to
go, because a major version comes, is taken out by hand, and CHANGELOG.md says so.
"""

from __future__ import annotations

import inspect
import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "vectors" / "surface.txt"
SCHEMAS = ("report-2", "transaction-2", "table-1", "summary-1", "overview-1")
LUAS = ("lua5.4", "lua5.3", "lua5.2", "lua")


def commands() -> Iterator[str]:
    """Commands, their arguments, and their options with the words that they take."""
    from ds47.cli import group

    yield from _command(
        "ds47", group, click.Context(group, info_name="ds47", **group.context_settings)
    )


def _command(name: str, command: click.Command, context: click.Context) -> Iterator[str]:
    for each in command.get_params(context):
        choices = each.type.choices if isinstance(each.type, click.Choice) else ()
        if isinstance(each, click.Argument):
            yield f"command {name} {each.make_metavar(context)}"
            continue
        if "--help" in each.opts:  # click's own: it has the names of the context that asked first
            continue
        for option in (*each.opts, *each.secondary_opts):
            yield f"command {name} {option}"
            yield from (f"command {name} {option} {choice}" for choice in choices)
    if isinstance(command, click.Group):
        for word in command.list_commands(context):
            found = command.get_command(context, word)
            assert found is not None
            yield f"command {name} {word}"
            yield from _command(
                f"{name} {word}", found, click.Context(found, context, info_name=word)
            )


def rules() -> Iterator[str]:
    """Rules: id, name and what a finding carries."""
    from ds47 import spec

    for rule in spec.rules().values():
        yield f"rule {rule.id} {rule.name}"
        yield from (f"rule {rule.id} argument {name} {kind}" for name, kind in rule.args.items())


def codes() -> Iterator[str]:
    """Numbers of the words that are fields of Wireshark."""
    from ds47.spec import codes as table

    for name in table.tables():
        yield from (f"code {name} {word} {number}" for word, number in table.codes(name).items())


def fields() -> Iterator[str]:
    """Fields of the plugin with their types, and its expert infos. SystemExit where there is no Lua."""
    program = next(filter(None, map(shutil.which, LUAS)), None)
    if program is None:
        sys.exit("no Lua is here (Debian: lua5.4)")
    told = subprocess.run(
        [program, ROOT / "tests" / "lua" / "fields.lua", ROOT], stdout=subprocess.PIPE, text=True, check=True
    )  # fmt: skip
    yield from (f"wireshark {line}" for line in told.stdout.splitlines())


def keys() -> Iterator[str]:
    """Keys of the JSON documents and of the tables, with the words that they may have."""
    for name in SCHEMAS:
        path = ROOT / "python" / "ds47" / "schema" / f"{name}.schema.json"
        schema = json.loads(path.read_text("utf-8"))
        yield from _keys(f"json {name}", schema)
        for part, content in schema.get("$defs", {}).items():
            yield from _keys(f"json {name} {part}", content)


def _keys(place: str, schema: Any) -> Iterator[str]:
    for word in schema.get("enum", ()):
        yield f"{place} = {json.dumps(word)}"
    for key, content in schema.get("properties", {}).items():
        yield f"{place}.{key}"
        yield from _keys(f"{place}.{key}", content)
    if isinstance(schema.get("items"), dict):
        yield from _keys(f"{place}[]", schema["items"])
    for other in ("anyOf", "oneOf", "allOf"):
        for content in schema.get(other, ()):
            yield from _keys(place, content)


def names() -> Iterator[str]:
    """What Python programs use: modules, classes with their attributes, functions with their parameters."""
    for module in ("ds47", "ds47.scapy"):
        loaded = import_module(module)
        for name in loaded.__all__:
            found = getattr(loaded, name)
            yield f"python {module}.{name}"
            if module != "ds47":
                continue  # layers: their fields are scapy's way
            if get_origin(found) is Literal:
                yield from (f"python {module}.{name} = {word}" for word in get_args(found))
            elif inspect.isclass(found):
                yield from _members(f"python {module}.{name}", found)
            elif callable(found):
                yield from _parameters(f"python {module}.{name}", found)


def _members(place: str, kind: type) -> Iterator[str]:
    """Of the classes of the result only what the JSON has, or what docs/python.md tells of."""
    told = set(re.findall(r"\w+", (ROOT / "docs" / "python.md").read_text("utf-8")))
    told |= {line.rpartition(".")[2] for line in keys()}
    for base in kind.__mro__[:-1]:
        if not base.__module__.startswith("ds47"):
            continue
        slots = (*getattr(base, "__annotations__", ()), *vars(base))
        for name in sorted({name for name in slots if not name.startswith("_")} & told):
            yield f"{place}.{name}"
            value = inspect.getattr_static(kind, name, None)
            if inspect.isfunction(value):
                yield from _parameters(f"{place}.{name}", value)


def _parameters(place: str, function: Any) -> Iterator[str]:
    for name in inspect.signature(function).parameters:
        if name != "self":
            yield f"{place}({name})"


def plugged() -> Iterator[str]:
    """What pytest gets, and how a shell and pytest find us."""
    from ds47.regression import pytest_plugin

    class Group:
        options: list[str] = []  # noqa: RUF012

        def addoption(self, *words: str, **_: object) -> None:
            self.options += words

        addini = addoption

        def getgroup(self, *_: str) -> Group:
            return self

    group = Group()
    pytest_plugin.pytest_addoption(group)  # type: ignore[arg-type]
    yield from (f"pytest {option}" for option in group.options if option.startswith("-"))
    yield "pytest fixture ds47_capture" if hasattr(pytest_plugin, "ds47_capture") else "pytest"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    yield from (f"script {name} = {value}" for name, value in project["scripts"].items())
    yield from (
        f"extra {name}" for name in project["optional-dependencies"] if name not in INTERNAL
    )


def variables() -> Iterator[str]:
    """Variables of the environment that the sources name."""
    for path in sorted((ROOT / "python" / "ds47").rglob("*.py")):
        found = re.findall(r"""["'](DS47_[A-Z_]+)["']""", path.read_text("utf-8"))
        yield from (f"environment {name}" for name in found)


INTERNAL = ("tests", "dev", "build", "oracle", "lab")
"""Extras for those who work on ds47."""


def surface() -> set[str]:
    """All lines of this checkout."""
    parts = (commands(), rules(), codes(), fields(), keys(), names(), variables(), plugged())
    return {line for part in parts for line in part}


def stored() -> set[str]:
    """All lines that were promised."""
    return set(LIST.read_text("utf-8").splitlines()) if LIST.exists() else set()


def main() -> int:
    before, now = stored(), surface()
    LIST.write_text("".join(f"{line}\n" for line in sorted(before | now)), "utf-8", newline="\n")
    print(f"{LIST}: {len(before | now)} lines, {len(now - before)} of them new")
    for line in sorted(before - now):
        print(f"gone: {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
