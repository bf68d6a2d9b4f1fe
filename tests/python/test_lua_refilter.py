"""When a window applies its display filter again (ds47_ws/refilter.lua), under plain Lua, with a Wireshark that is
played."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

DRIVER = Path(__file__).resolve().parents[2] / "tests/lua/refilter.lua"
TOLD = "window, The list of frames is not "
SCENES = {
    "a short file": "applied",
    "a long file": f"{TOLD}, applied, The list of frames is comp",
    "a macro": "applied",
    "a filter that asks for nothing of ours": "nothing",
    "another filter, and a graph of ours": "nothing",
    "no filter": "nothing",
    "two files": "applied, applied",
    "a file after long idleness": "applied",
    "half typed": TOLD,
    "still being typed": "applied",
    "captured for ten minutes": f"{TOLD}, applied, The list of frames is comp",
    "captured with pauses": ", ".join(["applied"] * 12),
}


@pytest.mark.parametrize("lua", LUAS)
def test_a_filter_is_applied_once_when_all_frames_are_there(lua: str) -> None:
    done = subprocess.run(
        [lua_program(lua), str(DRIVER)], capture_output=True, text=True, check=True, timeout=60
    )
    assert dict(line.split(": ", 1) for line in done.stdout.splitlines()) == SCENES
