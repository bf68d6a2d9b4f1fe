"""What the plugin does in a window alone, tried in tshark: it is told there that it has one.

In a window each frame is dissected for somebody else: the list, the tree of the frame that is looked at, a
filter. So the plugin asks each time which fields are wanted, and has to show the same as where it asks once.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from fake_tshark import real_tshark

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "dissector/ds47.lua"
CAPTURE = ROOT / "captures/tour-machine.pcapng"
IN_A_WINDOW = """
_G.gui_enabled = function() return true end
_G.get_filter = function() return "" end
dofile(...)
"""
ADVICE = "[Second pass: later frames may add"
"""The beginning of a line that nobody needs who has a window."""
COMPLAINTS = ("Lua Error", "Lua: Error", "Error during loading")

FIELDS = ("frame.number", "ds47.pnu", "ds47.value.number", "ds47.state", "ds47.finding")
COLUMNS = 'gui.column.format:"No.","%m","State","%Cus:ds47.state:1:R","Value","%Cus:ds47.value:0:R","Info","%i"'
READ_WITH = {
    "print": (),
    "tree": ("-V",),
    "filter": ("-Y", "ds47.pnu > 900"),
    "columns": ("-o", COLUMNS),
    "fields": ("-T", "fields", *(part for name in FIELDS for part in ("-e", name))),
    "two passes": ("-2", "-o", COLUMNS),
    "another question in the second pass": ("-2", "-R", "ds47.pnu > 0", "-V"),
    "another filter in the second pass": ("-2", "-R", "ds47.pnu", "-Y", "ds47.finding"),
}


@pytest.mark.parametrize("way", READ_WITH)
def test_a_window_shows_the_same(way: str, tmp_path: Path) -> None:
    script = tmp_path / "window.lua"
    script.write_text(IN_A_WINDOW, encoding="utf-8")
    shown = [
        read(tmp_path, f"lua_script:{PLUGIN}", *READ_WITH[way]),
        read(tmp_path, f"lua_script:{script}", "-X", f"lua_script1:{PLUGIN}", *READ_WITH[way]),
    ]
    assert shown[0] == shown[1] != ""


def read(home: Path, *arguments: str) -> str:
    """What tshark prints of the tour with the settings of nobody."""
    environment = os.environ | {
        "HOME": str(home), "XDG_CONFIG_HOME": str(home), "LC_ALL": "C.UTF-8", "TZ": "UTC",
    }  # fmt: skip
    environment.pop("WIRESHARK_CONFIG_DIR", None)
    command = [real_tshark(), "-n", "-r", str(CAPTURE), "-X", *arguments]
    result = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    assert not any(text in result.stderr + result.stdout for text in COMPLAINTS)
    return "".join(line for line in result.stdout.splitlines(True) if ADVICE not in line)
