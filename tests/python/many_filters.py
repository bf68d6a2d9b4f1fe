"""Many display filters in one start of tshark: the frames that each of them finds, or what is wrong with it.

A script gives each filter to a tap, which tshark asks for each frame as it asks a filter of its command line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

SCRIPT = """
local filters = {{ {} }}
local proto = Proto("many_filters", "Many filters")
local function ask(number, filter)
  local known, tap = pcall(Listener.new, "frame", filter)
  if not known then
    print(("WRONG %d: %s"):format(number, tostring(tap):gsub("%s+", " ")))
    return
  end
  local frames = {{}}
  function tap.packet(pinfo) frames[#frames + 1] = pinfo.number end
  function tap.draw() print(("FOUND %d: %s"):format(number, table.concat(frames, " "))) end
end
function proto.init() -- sooner no filter knows a field of a script
  for number, filter in ipairs(filters) do ask(number, filter) end
  filters = {{}}
end
"""


def many(
    shark: Callable[..., str], folder: Path, filters: Iterable[str], *arguments: str | Path
) -> dict[str, list[int] | str]:
    """By filter: numbers of frames, or the text of the error."""
    wanted = list(dict.fromkeys(filters))
    script = folder / "many.lua"
    script.write_text(SCRIPT.format(", ".join(f"[==[{each}]==]" for each in wanted)), "utf-8")
    said = shark("-q", "-X", f"lua_script:{script}", *arguments)
    found: dict[str, list[int] | str] = {}
    for kind, number, text in re.findall(r"^(FOUND|WRONG) (\d+): (.*)$", said, re.MULTILINE):
        found[wanted[int(number) - 1]] = text if kind == "WRONG" else [*map(int, text.split())]
    assert found.keys() == set(wanted), said
    return found
