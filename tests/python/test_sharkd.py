"""The plugin in sharkd, the Wireshark behind web pages: it asks for rows, filters and trees in any order.

Who reads the frames changes there from one request to the next, and what the plugin has learnt of one reader
(columns, fields that are wanted, a tree that somebody sees) does not count for another one.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
from lua_program import lua_program
from test_wireshark_plugin import BROKEN, CAPTURES

from ds47.analysis import analyze
from ds47.cli import main

pytestmark = pytest.mark.plugin
TOUR = CAPTURES["tour-machine.pcapng"]
COLUMNS = '"No.","%m","Protocol","%p","PNU","%Cus:ds47.pnu:0:R","Device","%Cus:ds47.device:0:R"'

Ask = Callable[..., list[Any]]


def program() -> str:
    """sharkd, where it loads scripts; else the test is skipped, or fails where there has to be one."""
    found = lua_program("sharkd")
    told = subprocess.run([found, "-v"], capture_output=True, text=True, check=False).stdout
    version = re.search(r"(\d+)\.(\d+)\.\d+", told)
    assert version, told
    is_root = hasattr(os, "geteuid") and os.geteuid() == 0
    if is_root and tuple(map(int, version.groups())) >= (4, 4):
        pytest.skip("sharkd 4.4 and later load no scripts as root")
    return found


@pytest.fixture(scope="module")
def ask(tmp_path_factory: pytest.TempPathFactory) -> Ask:
    """What sharkd answers to requests about the tour, each (method, parameters), in their order."""
    sharkd, home = program(), tmp_path_factory.mktemp("home")
    folder = home / ".local" / "lib" / "wireshark" / "plugins"
    assert main(["plugin", "install", "--no-profile", "--folder", str(folder)]) == 0
    (home / ".config" / "wireshark").mkdir(parents=True)
    preferences = home / ".config" / "wireshark" / "preferences"
    preferences.write_text(f"gui.column.format: {COLUMNS}\n", encoding="utf-8")
    environment = os.environ | {"HOME": str(home), "XDG_CONFIG_HOME": str(home / ".config")}

    def answers(*requests: tuple[str, dict[str, Any]]) -> list[Any]:
        asked = [("load", {"file": str(TOUR)}), *requests]
        lines = [
            json.dumps({"jsonrpc": "2.0", "id": number, "method": method, "params": parameters})
            for number, (method, parameters) in enumerate(asked, 1)
        ]
        text = "\n".join(lines) + "\n"
        run = subprocess.run(
            [sharkd, "-"], input=text, capture_output=True, text=True, check=True, env=environment
        )
        assert not [text for text in BROKEN if text in run.stderr]
        told = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
        assert [each["id"] for each in told] == list(range(1, len(asked) + 1))
        return [each["result"] for each in told[1:]]

    return answers


def numbers(rows: list[dict[str, Any]]) -> list[int]:
    """The frames of rows."""
    return [row["num"] for row in rows]


def labels(nodes: list[dict[str, Any]]) -> list[str]:
    """All lines of a tree."""
    return [line for node in nodes for line in (node["l"], *labels(node.get("n", [])))]


def frames_with(wanted: Callable[[Any], bool]) -> set[int]:
    """Frames in which the analysis has a request or a response of such transactions."""
    found = [each.frames for each in analyze(TOUR).transactions if wanted(each)]
    return {frame for each in found for frame in (each.write_request, each.read_response) if frame}


def test_each_filter_finds_its_frames(ask: Ask) -> None:
    """A second filter asks for other fields than the first one, and rows ask for others again."""
    first, second, third = ask(
        ("frames", {"filter": "ds47.pnu == 50304"}),
        ("frames", {"filter": "ds47.frames.write_request"}),
        ("frames", {"filter": "ds47.pnu == 50303"}),
    )
    pnus = {
        pnu: frames_with(lambda each, pnu=pnu: any(p.pnu == pnu for p in each.parameters))
        for pnu in (50304, 50303)
    }
    assert set(numbers(first)) == pnus[50304] != set()
    assert set(numbers(third)) == pnus[50303] != set()
    assert set(numbers(second)) >= pnus[50303]


def test_rows_have_their_columns_behind_a_filter(ask: Ask) -> None:
    """A filter reads frames without columns; the rows behind it have them all the same."""
    *_, rows = ask(
        ("frames", {"limit": 2}),
        ("frames", {"filter": "ds47.frames.write_request"}),
        ("frames", {}),
    )
    ours = frames_with(lambda each: True)
    assert {row["num"] for row in rows if row["c"][1] == "DS47"} >= ours
    assert {row["num"] for row in rows if row["c"][2]} == frames_with(
        lambda each: bool(each.parameters)
    )


def test_a_tree_is_whole_behind_rows(ask: Ask) -> None:
    """Rows ask for the fields of their columns alone; whoever looks at a frame sees all."""
    rows, tree = ("frames", {}), ("frame", {"frame": 5, "proto": True})
    _, _, frame, _, again = ask(rows, rows, tree, rows, tree)
    shown = labels([node for node in frame["tree"] if node["l"].startswith("DS47")])
    assert any(line.startswith("Parameter number (PNU): 50303") for line in shown)
    assert any(line.startswith("Write request: ") for line in shown)
    assert again["tree"] == frame["tree"]


REFUSED = {"filter": 'ds47.state == "refused"'}


@pytest.mark.parametrize("first", [[33], [33, 6], [33, 9, 21], [21, 33, 5]])
def test_a_frame_out_of_order_does_not_spoil_the_session(ask: Ask, first: list[int]) -> None:
    """Frames count in their order: one that is asked for first must not be the only one that is known."""
    rows, again = ("frames", {}), ("frames", REFUSED)
    *_, right_rows, right = ask(rows, rows, again)
    early = [("frame", {"frame": number, "proto": True}) for number in first]
    *trees, _, shown, refused = ask(*early, rows, rows, again)
    assert [each["c"] for each in shown] == [each["c"] for each in right_rows]
    assert numbers(refused) == numbers(right) != []
    if first[1:] == [6]:  # a request, which says by itself what it is
        assert [node for node in trees[1]["tree"] if node["l"].startswith("DS47")]
