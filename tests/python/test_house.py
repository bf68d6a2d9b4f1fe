"""The order of the rooms of the package: a room imports only from those below it (docs/development.md)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCES = REPOSITORY / "python" / "ds47"
LOOSE = {"__init__", "__main__", "analysis", "model"}
"""Modules that stand in no room: the door, and what joins the rooms."""


def modules() -> dict[str, Path]:
    """Names of all modules, and their files."""
    found = {}
    for file in sorted(SOURCES.rglob("*.py")):
        parts = file.relative_to(SOURCES.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imports(file: Path, known: dict[str, Path]) -> Iterator[str]:
    """The modules of the package that a file imports, inside functions and for the type checker too."""
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            for name in node.names:
                whole = f"{node.module}.{name.name}"
                yield whole if whole in known else node.module
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def room(module: str) -> str:
    """The room of a module: the first name behind that of the package."""
    return module.split(".")[1] if "." in module else "__init__"


def floors() -> list[str]:
    """The rooms in the order of the table in docs/development.md, the lowest first."""
    page = (REPOSITORY / "docs" / "development.md").read_text("utf-8")
    table = page[page.index("| room (under") :].split("\n\n", 1)[0]
    return re.findall(r"^\| `([a-z]+)(?:\.py|/)`", table, re.MULTILINE)


def test_every_room_stands_in_the_table() -> None:
    rooms = {room(module) for module in modules()} - {"__init__", "__main__"}
    assert rooms == set(floors())
    assert len(floors()) == len(rooms)


def test_a_room_imports_only_from_those_below_it() -> None:
    known, order = modules(), ["__init__", *floors(), "__main__"]
    upwards = {
        f"{module} -> {other}"
        for module, file in known.items()
        for other in imports(file, known)
        if other in known
        and module != "ds47"  # the door names what it hands out
        and room(other) != room(module)
        and order.index(room(other)) > order.index(room(module))
    }
    assert upwards == set()


def test_four_modules_stand_loose() -> None:
    assert {file.stem for file in SOURCES.glob("*.py")} == LOOSE
