"""The trail in the HTML page: it is that of `ds47 trail`, and a large capture does not make it large."""

from __future__ import annotations

import json
from copy import copy
from pathlib import Path
from typing import Any

import handmade
import pytest

from ds47.analysis import analyze
from ds47.cli import main
from ds47.model import CaptureResult, Parameter
from ds47.report.formatting import both_sides
from ds47.report.html.views import capture_view
from ds47.report.html.views import trail as view
from ds47.report.html.views.rows import packed_rows
from ds47.report.html.views.trail import TrailView
from ds47.report.targets import Targets

CAPTURES = sorted(Path(__file__).parents[2].joinpath("captures").rglob("*.pcapng"))
CHANGED = [
    path
    for path in CAPTURES
    if any(n in path.name for n in ("o1", "o2", "o3", "tour", "ppo", "read-back"))
]


def shown(result: CaptureResult) -> TrailView:
    listed = {each.id for each in result.transactions}
    return TrailView(result, Targets(result.transactions), listed)


def rows(found: TrailView) -> list[dict[str, Any]]:
    """The rows of the page with names in place of positions."""
    told = []
    for row in found.data["rows"]:
        each = dict(zip(found.data["row"], row, strict=True))
        device, _, number = found.data["objects"][each["object"]]
        told.append(
            each
            | {"device": device, "drive_object": number, "way": found.data["ways"][each["way"]]}
        )
    return told


@pytest.mark.parametrize("path", CHANGED, ids=lambda path: path.name)
def test_the_page_has_the_trail_of_the_command(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["trail", "-f", "json", str(path)]) == 0
    (capture,) = json.loads(capsys.readouterr().out)["captures"]
    found = shown(analyze(path))
    for mine, theirs in zip(rows(found), capture["changes"], strict=True):
        for name in ("device", "drive_object", "way", "pnu", "subindex"):
            assert mine[name] == theirs[name]
        assert mine["id"] == theirs["transaction"]
        assert view.OUTCOMES[mine["outcome"]] == theirs["outcome"]
        told = both_sides(theirs["old"], theirs["old_format"], theirs["new"], theirs["format"])
        assert (mine["old"] or "?", mine["new"] or "?") == told
        frame = {"read": 1, "written": -1, None: 0}[theirs["old_known"]] * (
            theirs["old_frame"] or 0
        )
        assert mine["old_from"] == frame
        reason = mine["reason"]
        assert (reason is not None) == (theirs["error"] is not None or theirs["status"] is not None)
        if theirs["error"] is not None:
            assert f"{theirs['error']:02X}" in found.data["reasons"][reason][0]
    assert found.left_out == 0


def test_what_has_no_room_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "MOST", 3)
    item = analyze(CAPTURES[0].parent / "tour-machine.pcapng").transactions[0]
    items = []
    for number in range(1, 8):
        made = copy(item)
        made.id, made.operation, made.state, made.findings = number, "change", "ok", []
        made.parameters = [
            Parameter(50303, 0, "value", 0, format="Integer32", value_count=1, values=[number])
        ]
        items.append(made)
    found = TrailView(CaptureResult("x", transactions=items), Targets(items), {2, 3, 5, 6, 7})
    assert [row[0] for row in found.data["rows"]] == [2, 3, 5]
    assert found.left_out == 4
    told = capture_view(CaptureResult("x", transactions=items), 1, 100)
    assert told.trail.left_out == 4
    assert told.trail.written == {(item.device, 2)} or told.trail.unproved


def test_a_page_of_many_changes_stays_small() -> None:
    items = []
    for number in range(1, 5001):
        one = handmade.transaction(
            id=number, start_ns=10**18 + number * 10**7, operation="change", state="ok"
        )
        one.parameters = [
            Parameter(50303, 0, "value", 0, format="Integer32", value_count=1, values=[number])
        ]
        items.append(one)
    result = CaptureResult("x", transactions=items)
    data = packed_rows(result, 10_000)
    plain, trail = (
        len(json.dumps(each, separators=(",", ":"))) for each in (data, shown(result).data)
    )
    assert trail < plain / 2
