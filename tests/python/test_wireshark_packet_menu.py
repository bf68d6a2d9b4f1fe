"""The menu of a packet, in a real tshark: what each of its entries does with each frame of a capture.

tshark has no menus, so a script registers the entries with functions of its own, and calls them with the fields
of each frame in the second pass. Filters are then given to tshark.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_tshark import real_tshark
from many_filters import many

from ds47.analysis import analyze
from ds47.cyclic.notation import encode_line
from ds47.diagnosis.suggest import scl
from ds47.explain import explain, find_vendor
from ds47.model import Transaction
from ds47.profidrive import encode_request
from ds47.profidrive.drive_objects import DriveObjects, access_of
from ds47.profidrive.notation import parse_request_line
from ds47.report.explanation import lines

SCRIPT = """
local json = require("ds47.support.json")
local entries, said = {}, nil
function _G.register_packet_menu(name, action, needed) entries[name:match("/(.*)$")] = { action, needed } end
function _G.set_filter(text) said = text end
function _G.apply_filter() end
_G.copy_to_clipboard = _G.set_filter
_G.TextWindow = { new = function() return { set = function(_, text) said = "window: " .. text end } end }
require("ds47_ws.packet_menu").register(require("ds47_ws.track"))
local fields = {}
for _, name in ipairs({
  "frame.number", "ds47.transaction", "ds47.device", "ds47.device.mac", "pn_io.status", "pn_io.error_code",
}) do
  local known, field = pcall(Field.new, name) -- not every version of the plugin has all
  fields[#fields + 1] = known and field or nil
end
local listener = Listener.new("frame")
function listener.packet()
  if fields[2]() == nil then return end
  local infos, found = {}, {}
  for _, field in ipairs(fields) do infos[#infos + 1] = field() end
  for name, entry in pairs(entries) do
    said = nil
    entry[1](table.unpack(infos))
    found[name] = { said = said, needed = entry[2] }
  end
  io.stdout:write(json.encode({ frame = tostring(infos[1].value), entries = found }), "\\n")
end
"""
TRANSACTION, DRIVE = "Only this transaction", "Only this drive"
PARAMETERS = "Only these parameters on this drive object"
LINE, SCL, STATUS = "Copy request as ds47 encode line", "Copy request as SCL", "Explain this status"
INSTEAD = "Copy what to send instead as SCL"
NOTHING = "The capture does not prove which request to send instead of this one."

Run = Callable[..., str]
Said = dict[int, dict[str, str]]


@pytest.fixture
def shark(tmp_path: Path, repository: Path) -> Run:
    program = real_tshark()
    environment = {
        **os.environ,
        "HOME": str(tmp_path),
        "XDG_CONFIG_HOME": str(tmp_path),
        "LC_ALL": "C.UTF-8",
    }

    def run(*arguments: str | Path) -> str:
        plugin = ["-X", f"lua_script:{repository / 'dissector' / 'ds47.lua'}"]
        done = subprocess.run(
            [program, "-2", "-R", "frame", *plugin, *map(str, arguments)],
            env=environment, capture_output=True, encoding="utf-8", timeout=120, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "Lua Error" not in done.stdout + done.stderr, done.stdout + done.stderr
        assert "Error during" not in done.stderr, done.stderr
        return done.stdout

    return run


@pytest.fixture
def menu(shark: Run, tmp_path: Path) -> Callable[[Path], Said]:
    """What the entries do with each frame: filter, clipboard, or `window: ` and its text."""
    script = tmp_path / "menu.lua"
    script.write_text(SCRIPT, encoding="utf-8")

    def ask(capture: Path) -> Said:
        out = shark("-q", "-X", f"lua_script:{script}", "-r", capture)
        rows: list[dict[str, Any]] = [json.loads(line) for line in out.splitlines()]
        for row in rows:
            for name, entry in row["entries"].items():
                assert (name, entry["needed"]) == (name, "ds47.transaction")
        return {
            int(row["frame"]): {name: entry["said"] for name, entry in row["entries"].items()}
            for row in rows
        }

    return ask


def elements(parameter: Any) -> range:
    first = parameter.subindex
    if first is None:
        return range(0)
    return range(first, first + max(parameter.element_count or 1, 1))


def expected(item: Transaction, transactions: list[Transaction]) -> set[int]:
    """The frames in which one of the parameters stands, of the drive object that the request reaches."""
    shown = DriveObjects.of(transactions)
    mine, found = access_of(item), set()
    for parameter in item.parameters:
        for other in transactions:
            for each in other.parameters:
                same = each.pnu == parameter.pnu and each.pnu is not None
                same = same and shown.same(mine, access_of(other), each.pnu)
                if same and set(elements(each)) & set(elements(parameter)):
                    found |= {other.frames.write_request, other.frames.read_response}
    return found - {None}


CAPTURES = (
    "tour-machine",
    "conversation-wrong-axis",
    "diagnosis-axis-byte-ignored",
    "record-local",
    "transport-two-controllers",
    "naming-all",
    "cyclic-changed-after-off1",
    "profibus-ppo1-start",
    "profibus-ppo3-and-records",
    "profibus-refused-records",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", CAPTURES)
def test_filters_show_what_they_say(
    shark: Run, menu: Callable[[Path], Said], captures: Path, tmp_path: Path, name: str
) -> None:
    capture = captures / f"{name}.pcapng"
    said, transactions = menu(capture), analyze(capture).transactions
    asked: dict[str, set[int]] = {}
    for item in transactions:
        frame = item.frames.write_request or item.frames.read_response
        if frame is None:
            continue
        told = said[frame]
        own = {each for each in said if said[each][TRANSACTION] == told[TRANSACTION]}
        asked[told[TRANSACTION]] = own
        assert told[TRANSACTION].startswith("ds47.transaction ")
        of_drive = [each for each in transactions if each.device == item.device]
        asked.setdefault(told[DRIVE], set()).update(
            each
            for other in of_drive
            for each in (other.frames.write_request, other.frames.read_response)
            if each
        )
        if any(each.pnu is not None for each in item.parameters):
            asked.setdefault(told[PARAMETERS], set()).update(expected(item, transactions))
        else:
            assert told[PARAMETERS].startswith("window: ")
    assert asked
    found = many(shark, tmp_path, asked, "-r", capture)
    for shown, frames in asked.items():
        got = set(found[shown])
        assert frames <= got, shown
        if "ds47.pnu" in shown or shown.startswith("ds47.transaction"):
            assert got == frames, shown


def test_what_is_copied_gives_the_same_bytes(menu: Callable[[Path], Said], captures: Path) -> None:
    capture = captures / "tour-machine.pcapng"
    said, copied = menu(capture), 0
    for item in analyze(capture).transactions:
        for frame in (
            item.frames.write_request,
            item.frames.write_response,
            item.frames.read_response,
        ):
            if frame is None or item.request is None:
                continue
            ds47, encode, line = shlex.split(said[frame][LINE])
            assert (ds47, encode) == ("ds47", "encode")
            assert encode_request(parse_request_line(line)) == item.request
            assert said[frame][SCL] == scl(item.request)
            copied += 1
    assert copied > 15


def test_what_to_send_instead_is_copied(menu: Callable[[Path], Said], captures: Path) -> None:
    """From each frame of the transaction, wherever its finding stands."""
    capture = captures / "diagnosis-index-and-count.pcapng"
    said, result, copied = menu(capture), analyze(capture), 0
    better = {each.corrected_in: each.corrected for each in result.diagnoses if each.corrected}
    assert better
    for item in result.transactions:
        wanted = better.get(item.id)
        for frame in (item.frames.write_request, item.frames.read_response):
            if frame is not None:
                assert said[frame][INSTEAD] == (scl(wanted) if wanted else f"window: {NOTHING}\n")
                copied += wanted is not None
    assert copied > 1


def test_a_request_of_pkw_is_copied_too(menu: Callable[[Path], Said], captures: Path) -> None:
    capture = captures / "profibus-ppo1-start.pcapng"
    said, copied = menu(capture), 0
    for item in analyze(capture).transactions:
        if item.channel == "pkw" and item.frames.write_request:
            line = shlex.split(said[item.frames.write_request][LINE])[2]
            assert encode_line(line) == item.request
            copied += 1
    assert copied > 2


def test_statuses_are_explained(menu: Callable[[Path], Said], captures: Path) -> None:
    said = menu(captures / "tour-machine.pcapng")

    def explained(frame: int, code: str) -> bool:
        text = "\n".join(lines(explain(code, "en", find_vendor("SINAMICS")), "en", 80))
        return text in said[frame][STATUS]

    assert explained(23, "DF80B500")  # the refused Write
    assert explained(22, "DF80B500")
    assert explained(21, "DE80B500")  # a poll of a transaction that ends well
    assert explained(25, "00000000")
    assert explained(33, "error 0x00")
    assert said[23][STATUS].startswith("window: Transaction 5: refused. ")
    assert "00000000:" not in said[33][STATUS]
