"""What the Lua modules have in common (lua/ds47/support), where no vector reaches it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

LUA = Path(__file__).resolve().parents[2] / "lua"
ENTRIES = """
package.path = arg[1] .. "/?.lua"
local made = 0
local entries = require("ds47.support.later").entries(function(key)
  made = made + 1
  return key * 10
end, 3)
for key = 1, 7 do assert(entries[key] == key * 10 and entries[key] == key * 10) end
local kept = {}
for key in pairs(entries) do kept[#kept + 1] = key end
print(made, #kept, entries[1], made)
"""


@pytest.mark.parametrize("lua", LUAS)
def test_entries_begin_anew_behind_their_limit(lua: str, tmp_path: Path) -> None:
    script = tmp_path / "entries.lua"
    script.write_text(ENTRIES, encoding="utf-8")
    done = subprocess.run(
        [lua_program(lua), str(script), str(LUA)], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["7", "1", "10", "8"]
