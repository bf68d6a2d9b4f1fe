"""How the modules of the package depend on each other: in no circle, and a room only on those below it
(docs/developers/development.md).

Imports inside functions and for the type checker count as all others.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
SOURCES = REPOSITORY / "python" / "ds47"
PURE = REPOSITORY / "lua" / "ds47"
LOOSE = {"__init__", "__main__", "analysis", "model", "version"}
"""Modules that stand in no room: the door, what joins the rooms, and what all of them may ask for."""


def modules(sources: Path = SOURCES) -> dict[str, Path]:
    """Names of all modules of a package, and their files."""
    found = {}
    for file in sorted(sources.rglob("*.py")):
        parts = file.relative_to(sources.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imports(sources: Path = SOURCES) -> dict[str, set[str]]:
    """Module -> the modules of the package that it imports.

    `from a import b` is the module a.b where there is one, else a. What Python runs beside that, the packages
    above a module, is not counted.
    """
    known = modules(sources)
    return {
        module: {name if name in known else name.rpartition(".")[0] for name in named(module, file)}
        & known.keys()
        for module, file in known.items()
    }


def named(module: str, file: Path) -> Iterator[str]:
    """What a module imports, by full names; a dot in front of a name is resolved."""
    package = module.split(".")[: None if file.name == "__init__.py" else -1]
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            origin = ".".join([*above, *filter(None, [node.module])])
            yield from (f"{origin}.{each.name}" for each in node.names)


def circle(graph: Mapping[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle, the first one again at the end; empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def room(module: str) -> str:
    """The room of a module: the first name behind that of the package."""
    return module.split(".")[1] if "." in module else "__init__"


def floors() -> list[str]:
    """The rooms in the order of the table in docs/developers/development.md, the lowest first."""
    page = (REPOSITORY / "docs/developers/development.md").read_text("utf-8")
    table = page[page.index("| room (under") :].split("\n\n", 1)[0]
    return re.findall(r"^\| `([a-z][a-z0-9]*)(?:\.py|/)`", table, re.MULTILINE)


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert not circle(imports())


def test_a_circle_is_found(tmp_path: Path) -> None:
    package = tmp_path / "house"
    (package / "room").mkdir(parents=True)
    for name, text in {
        "__init__": "import house.door",
        "door": "from house.room.bed import sleep",
        "room/__init__": "from .bed import sleep",
        "room/bed": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .. import wall",
        "wall": "def late():\n    from .room import chair",
        "room/chair": "from . import bed",
    }.items():
        (package / f"{name}.py").write_text(text)
    graph = imports(package)
    assert graph == {
        "house": {"house.door"},
        "house.door": {"house.room.bed"},
        "house.room": {"house.room.bed"},
        "house.room.bed": {"house.wall"},
        "house.wall": {"house.room.chair"},
        "house.room.chair": {"house.room.bed"},
    }
    assert set(circle(graph)) == {"house.room.bed", "house.wall", "house.room.chair"}
    assert not circle({**graph, "house.wall": set()})


def test_every_room_stands_in_the_table() -> None:
    rooms = {room(module) for module in modules()} - {"__init__", "__main__"}
    assert rooms == set(floors())
    assert len(floors()) == len(rooms)


def test_a_room_imports_only_from_those_below_it() -> None:
    """Above all stands the door, which hands out names of the library: users enter there, no room does."""
    order = [*floors(), "__init__", "__main__"]
    upwards = {
        f"{module} -> {other}"
        for module, others in imports().items()
        for other in others
        if room(other) != room(module) and order.index(room(other)) > order.index(room(module))
    }
    assert upwards == set()


def test_few_modules_stand_loose() -> None:
    assert {file.stem for file in SOURCES.glob("*.py")} == LOOSE


ANALYSIS = (
    "capture",
    "profinet",
    "profibus",
    "profidrive",
    "s7",
    "cyclic",
    "acyclic",
    "findings",
    "diagnosis",
    "analysis",
)
"""The rooms without words, in both languages of the code: the report words what they find."""
LANGUAGE = re.compile(r"\b(lang|zh|\w+_zh|\w+_en|error_text|status_text)\b")
"""A language of people, or what has texts in several."""


def naming_a_language(sources: Path) -> set[str]:
    """The files of the analysis in a folder that name a language, comments included."""
    found = set()
    for file in [*sources.rglob("*.py"), *sources.rglob("*.lua")]:
        place = file.relative_to(sources)
        if place.with_suffix("").parts[0] in ANALYSIS and LANGUAGE.search(file.read_text("utf-8")):
            found.add(place.as_posix())
    return found


def test_the_analysis_knows_no_language() -> None:
    assert naming_a_language(SOURCES) == naming_a_language(PURE) == set()


def test_a_language_in_the_analysis_is_found(tmp_path: Path) -> None:
    for name in ("acyclic/judge.py", "analysis.lua", "report/text.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("build(job, lang)")
    (tmp_path / "acyclic" / "pairing.py").write_text("build(job, slang)")
    assert naming_a_language(tmp_path) == {"acyclic/judge.py", "analysis.lua"}


# The same house in Lua

SUPPORT = {"support"}
"""Rooms of Lua alone, below all others: what Python has in its standard library."""


def lua_imports() -> dict[str, set[str]]:
    """Module -> the modules that it requires, at once or when they are used."""
    wanted = re.compile(r'(?:require|later|entries)\("(ds47\.[\w.]+)"')
    return {
        ".".join(file.relative_to(PURE.parent).with_suffix("").parts): set(
            wanted.findall(file.read_text("utf-8"))
        )
        for file in sorted(PURE.rglob("*.lua"))
    }


def test_no_modules_of_lua_require_each_other_in_a_circle() -> None:
    graph = lua_imports()
    assert {other for others in graph.values() for other in others} <= graph.keys()
    assert not circle(graph)


def test_the_rooms_of_lua_are_those_of_python_in_the_same_order() -> None:
    order = [*SUPPORT, *floors()]
    assert {room(module) for module in lua_imports()} <= set(order)
    upwards = {
        f"{module} -> {other}"
        for module, others in lua_imports().items()
        for other in others
        if order.index(room(other)) > order.index(room(module))
    }
    assert upwards == set()


def test_a_module_of_lua_has_its_twin_in_python() -> None:
    own = {
        "ds47.acyclic.ending", "ds47.diagnosis.memory", "ds47.diagnosis.transaction", "ds47.profidrive.layouts",
        "ds47.report.statistics", "ds47.spec.lookup", "ds47.spec.tables",
    }  # fmt: skip
    alone = {
        module
        for module in lua_imports()
        if module not in modules() and room(module) not in SUPPORT
    }
    assert alone == own


PATH = re.compile(
    r"(?<![\w/.-])(?:(?:python|lua)/ds47|dissector|tests|tools|bench)/[\w/]+\.(?:py|lua|toml)\b"
    r"|(?<![\w/])test_[a-z0-9_]+\.py\b"
)
INVENTIVE = ("test_house.py", "test_matrix_tools.py", "test_pytest_plugin.py")
"""Files that name some that never were."""


def paths_to_nothing(path: Path) -> set[str]:
    """The files that a text names and the checkout lacks; of a test its name is enough."""
    folders = (REPOSITORY, REPOSITORY / "tests/python", REPOSITORY / "tests/browser")
    named = set(PATH.findall(path.read_text("utf-8")))
    return {name for name in named if not any((folder / name).is_file() for folder in folders)}


def test_files_that_comments_and_pages_name_are_there() -> None:
    rooms = ("python", "lua", "dissector", "tests", "tools", "bench", "docs")
    texts = [REPOSITORY / "pyproject.toml", REPOSITORY / "Makefile"]
    texts += [
        path
        for room in rooms
        for kind in ("py", "lua", "toml", "md")
        for path in (REPOSITORY / room).rglob(f"*.{kind}")
        if path.name not in INVENTIVE
    ]
    gone = {path.name: missing for path in texts if (missing := paths_to_nothing(path))}
    assert gone == {}


def test_a_file_that_is_gone_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("As python/ds47/gone.py, test_gone.py, tools/matrix.py and test_house.py say.")
    assert paths_to_nothing(page) == {"python/ds47/gone.py", "test_gone.py"}
