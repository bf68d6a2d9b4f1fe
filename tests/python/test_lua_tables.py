"""lua/ds47/spec/tables.lua is what tools/make_tables.py writes, and loads under every Lua."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from lua_program import LUAS, QUICK, lua_program

from ds47 import __version__, spec
from ds47.spec import semantics

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "make_tables.py"
TABLES = ROOT / "lua" / "ds47" / "spec" / "tables.lua"

COUNTS = """
local t = dofile(arg[1])
local function count(items)
  local n = 0
  for _ in pairs(items) do n = n + 1 end
  return n
end
print(t.version, count(t.limits), count(t.phases), count(t.reasons), count(t.formats))
print(count(t.request_ids), count(t.response_ids), count(t.errors), count(t.vendors[1].errors))
local numbers = {}
for _, made in ipairs({t.parameters, t.drives}) do
  for number in pairs(made) do numbers[number] = true end
end
for name in io.open(arg[1]):read("*a"):gmatch("later%.([%w_]+) = %[=%[") do assert(t[name], name) end
print(count(numbers), count(t.rules), #t.experts.plugin, t.limits.transaction_expiry_ns)
"""


def check() -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(TOOL), "--check"], capture_output=True, text=True, check=False
    )


def test_tables_are_up_to_date() -> None:
    result = check()
    assert result.returncode == 0, result.stderr


def test_a_stale_file_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = tmp_path / "tables.lua"
    copy.write_text(TABLES.read_text("utf-8").replace("polls = 10", "polls = 11"), "utf-8")
    code = (
        "import runpy, sys, pathlib;"
        f"tool = runpy.run_path({str(TOOL)!r});"
        f"tool['main'].__globals__['TARGET'] = pathlib.Path({str(copy)!r});"
        "sys.argv = ['make_tables.py', '--check']; sys.exit(tool['main']())"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    assert "stale" in result.stderr


def test_any_text_is_a_key() -> None:
    keys = ("name", "end", "two words", "a-b", "7th", 'a "quoted" one', "名称")
    literal = runpy.run_path(str(TOOL))["literal"]
    asked = f"local t = {literal(dict.fromkeys(keys, 1))} for _, key in ipairs({literal(keys)})"
    program = [lua_program(QUICK), "-e", f"{asked} do assert(t[key] == 1, key) end"]
    subprocess.run(program, check=True)


@pytest.mark.parametrize("lua", LUAS)
def test_every_lua_loads_the_same(lua: str, tmp_path: Path) -> None:
    script = tmp_path / "counts.lua"
    script.write_text(COUNTS, "utf-8")
    printed = subprocess.run(
        [lua_program(lua), str(script), str(TABLES)], capture_output=True, text=True, check=True
    ).stdout.split()
    limits = semantics.limits()
    read = runpy.run_path(str(TOOL))["read_by_lua"]("limits", limits)
    rules = [each for each in spec.rules().values() if not each.analyzer_only]
    experts = len(rules) + len(("pzd.event", "pzd.fault"))
    sizes = (
        *(len(read), len(semantics.phases()), len(semantics.reasons("en"))),
        *(len(spec.formats()), len(spec.request_ids()), len(spec.response_ids())),
        *(len(spec.errors()), len(spec.vendors()[0].errors), len(spec.parameters())),
        *(len(rules), experts, limits.transaction_expiry_ns),
    )
    assert printed == [__version__, *map(str, sizes)]
