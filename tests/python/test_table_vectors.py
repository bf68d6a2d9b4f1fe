"""Every entry of the protocol tables, in Python and in Lua, against tests/vectors/tables.json."""

from __future__ import annotations

import json
import runpy
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lua_program import LUAS, lua_program

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "tests/vectors/tables.json"
STORED = json.loads(FILE.read_text(encoding="utf-8"))
TOOL = runpy.run_path(str(ROOT / "tests/vectors/sources/tables.py"))
TABLES = ROOT / "lua/ds47/spec/tables.lua"
HOW = "if this is meant: tools/make_tables.py and tests/vectors/sources/tables.py"


def test_tables_of_python() -> None:
    found: dict[str, Any] = TOOL["flat"]()
    problems = TOOL["differences"](STORED["tables"], found)
    assert not problems, "\n".join([*problems, HOW])
    assert len(found) == STORED["count"]["all"]
    assert TOOL["text"]() == FILE.read_text(encoding="utf-8")


def run(lua: str, *more: Path) -> subprocess.CompletedProcess[str]:
    driver = ROOT / "tests/lua/tables.lua"
    command = [lua_program(lua), str(driver), str(FILE), *map(str, more)]
    return subprocess.run(command, capture_output=True, encoding="utf-8", check=False)


@pytest.mark.parametrize("lua", LUAS)
def test_tables_of_lua(lua: str) -> None:
    result = run(lua)
    assert result.stdout == f"{STORED['count']['lua']} entries\n", f"{result.stdout}{HOW}"
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    ("there", "changed", "named"),
    [
        ("drive object does not exist", "drive object is missing", "errors.0x19.en: table says"),
        ('name = "L2", ', 'name = "L3", ', "formats.0x74.name: table says L3, vector says L2"),
        ("copy_ns = 1000000,", "copy_ns = 1000001,", "limits.copy_ns: table says 1000001"),
        ('lost = "closed"', 'lost = "open"', "phases."),
        ("Unknown unit", "Unknown  unit", "vendors.SINAMICS.errors.0x6C.en: table says"),
    ],
)
def test_a_change_is_named(there: str, changed: str, named: str, tmp_path: Path) -> None:
    text = TABLES.read_text(encoding="utf-8")
    assert there in text
    copy = tmp_path / "tables.lua"
    copy.write_text(text.replace(there, changed, 1), encoding="utf-8")
    result = run("lua5.4", copy)
    assert result.returncode == 1
    assert result.stdout.startswith(named), result.stdout
    assert len(result.stdout.splitlines()) == 2


def test_a_change_in_python_is_named() -> None:
    changed = dict(STORED["tables"])
    changed["rules.DS301.advice"] = "Write 1 to 255."
    del changed["parameters.974.profile.name_en"]
    problems = TOOL["differences"](STORED["tables"], changed)
    assert [line.split(":")[0] for line in problems] == [
        "parameters.974.profile.name_en",
        "rules.DS301.advice",
    ]
    assert problems[0].startswith(
        "parameters.974.profile.name_en: table says nothing, vector says '"
    )
