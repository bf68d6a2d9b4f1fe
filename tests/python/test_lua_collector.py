"""The plugin's pace of Lua's collector (ds47_ws/collector.lua), without the one that Lua has itself."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

DRIVER = Path(__file__).resolve().parents[2] / "tests/lua/collector.lua"
FRAMES, OBJECTS = 50_000, 3


@pytest.mark.parametrize("lua", LUAS)
def test_nothing_piles_up(lua: str) -> None:
    done = subprocess.run(
        [lua_program(lua), str(DRIVER)], capture_output=True, text=True, check=True, timeout=60
    )
    most, large, after, closed = map(int, done.stdout.split())
    assert most < 1500, "150,000 objects would be 20 MB"
    assert large > 3000 > 1000 > after
    assert closed > FRAMES * OBJECTS * 0.9
