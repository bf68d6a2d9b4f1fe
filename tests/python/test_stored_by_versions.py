"""Stored results of other versions: what comes of ds47 alone is told, does not fail, and is taken over by itself.

`tests/vectors/stored/` has a result as 1.0.0 wrote it. What an older analysis did not find is made by taking
findings out of it, what it found and should not have by putting some in.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from test_cli_check import run

from ds47 import spec
from ds47.regression.compare import Change
from ds47.regression.run import fails
from ds47.regression.versions import Origin
from ds47.version import __version__

NAME = "conversation-superseded-read"
Edit = Callable[[dict[str, Any]], None]


class Place:
    """A folder with one capture and its stored result."""

    def __init__(self, folder: Path, capture: Path, stored: Path) -> None:
        self.folder = folder
        self.capture = folder / capture.name
        self.stored = folder / f"{capture.stem}.ds47.json"
        shutil.copy(capture, self.capture)
        shutil.copy(stored, self.stored)

    def document(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self.stored.read_text("utf-8"))
        return document

    def edit(self, *edits: Edit, version: str | None = "1.0.0") -> None:
        document = self.document()
        for change in edits:
            change(document["capture"])
        document["tool"]["version"] = version
        self.stored.write_text(json.dumps(document), "utf-8")


@pytest.fixture
def of_1_0(tmp_path: Path, captures: Path, vectors: Path) -> Place:
    return Place(tmp_path, captures / f"{NAME}.pcapng", vectors / "stored" / f"{NAME}.1.0.0.json")


@pytest.fixture
def tour(tmp_path: Path, captures: Path) -> Place:
    return Place(tmp_path, captures / "tour-machine.pcapng", captures / "tour-machine.ds47.json")


def without(*rules: str) -> Edit:
    """Did not find these yet."""

    def edit(capture: dict[str, Any]) -> None:
        kept = [each for each in capture["findings"] if each["rule"] not in rules]
        assert len(kept) < len(capture["findings"])
        capture["findings"] = kept

    return edit


def with_finding(rule: str, transaction: int | None = None, frame: int = 1) -> Edit:
    """Found something that is not so."""

    def edit(capture: dict[str, Any]) -> None:
        capture["findings"].append({
            "rule": rule, "severity": "error", "message": "m", "args": {}, "frame": frame, "frames": [frame],
            "transaction": transaction, "offset": None, "filter": f"frame.number == {frame}",
        })  # fmt: skip

    return edit


def value(number: int) -> Edit:
    """Read another value there."""

    def edit(capture: dict[str, Any]) -> None:
        item = capture["transactions"][number - 1]
        item["parameters"][0]["values"][0] += 1

    return edit


def another_recording(capture: dict[str, Any]) -> None:
    capture["sha256"] = "0" * 64


def test_what_is_only_new_is_no_difference(of_1_0: Place, capsys: Any) -> None:
    assert of_1_0.document()["tool"]["version"] == "1.0.0"
    assert "drive_object" not in of_1_0.document()["capture"]["transactions"][0]
    assert run(capsys, "check", of_1_0.folder)[:2] == (0, "1 capture: 1 as stored, 0 not\n")


def test_what_comes_of_the_version_is_told_and_is_green(
    of_1_0: Place, capsys: Any, tmp_path: Path
) -> None:
    of_1_0.edit(without("DS413", "DS705"), with_finding("DS401", 2))
    junit, sarif = tmp_path / "j.xml", tmp_path / "s.sarif"
    arguments = ["check", of_1_0.folder, "--fail-on", "note", "--junit", junit, "--sarif", sarif]
    status, out, _ = run(capsys, *arguments)
    assert (status, out) == (0, (
        f"noted    {of_1_0.capture}\n"
        "         stored by ds47 1.0.0; 3 changes come of the newer ds47 alone, by what changed in it: "
        "DS401, DS413, DS705 (2.0.0)\n"
        "1 capture: 1 as stored, 0 not; to take over what comes of the version alone: "
        "ds47 accept --by-version PATH...\n"
    ))  # fmt: skip
    suite = ET.parse(junit).getroot()[0]
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("1", "0", "0")
    results = json.loads(sarif.read_text("utf-8"))["runs"][0]["results"]
    assert [each["level"] for each in results] == ["note"] * 3
    status, out, _ = run(capsys, "check", of_1_0.folder, "--all")
    assert out.count("           new finding: DS413") == out.count("finding gone: DS401") == 1
    status, out, _ = run(capsys, "check", of_1_0.folder, "-f", "json")
    (told,) = json.loads(out)["captures"]
    assert (told["stored_by"], told["failed"]) == ("1.0.0", False)
    assert {(each["by_version"], each["fails"]) for each in told["changes"]} == {("2.0.0", False)}


def test_by_version_takes_it_over_and_the_result_is_of_this_version(
    of_1_0: Place, capsys: Any
) -> None:
    of_1_0.edit(without("DS413"))
    status, out, _ = run(capsys, "accept", "--by-version", "--yes", of_1_0.folder)
    assert (status, out.splitlines()[-1]) == (0, "took over 1 change in 1 capture")
    assert of_1_0.document()["tool"]["version"] == __version__
    assert "drive_object" in of_1_0.document()["capture"]["transactions"][0]
    assert run(capsys, "check", of_1_0.folder)[:2] == (0, "1 capture: 1 as stored, 0 not\n")


def test_of_two_differences_only_that_of_the_version_is_taken_over(
    tour: Place, capsys: Any
) -> None:
    tour.edit(without("DS402"), value(1))
    status, out, _ = run(capsys, "check", tour.folder)
    assert status == 1
    assert out.startswith("CHANGED")
    assert "transaction 1: p" in out
    assert "stored by ds47 1.0.0; 1 change comes of the newer ds47 alone" in out
    assert "ds47 accept PATH...; to take over what comes of the version alone" in out
    status, out, _ = run(capsys, "accept", "--by-version", "--yes", tour.folder)
    assert (status, out.splitlines()[-1]) == (0, "took over 1 change in 1 capture")
    assert "DS402" in out
    assert "transaction 1: p" not in out
    status, out, _ = run(capsys, "check", tour.folder)
    assert status == 1
    assert out.count("\n") == 3
    assert "transaction 1: p" in out
    assert tour.document()["tool"]["version"] == __version__
    assert (
        run(capsys, "accept", "--by-version", "--yes", tour.folder)[1] == "nothing to take over\n"
    )


def test_what_is_left_of_the_version_stays_known_as_such(tour: Place, capsys: Any) -> None:
    tour.edit(without("DS402"), value(1))
    assert run(capsys, "accept", "--where", "kind=value", "--yes", tour.folder)[0] == 0
    assert tour.document()["tool"]["version"] == "1.0.0"
    status, out, _ = run(capsys, "check", tour.folder)
    assert (status, "1 change comes of the newer ds47 alone" in out) == (0, True)


def test_where_counts_too(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS413", "DS705"))
    run(capsys, "accept", "--by-version", "--where", "rule=DS705", "--yes", of_1_0.folder)
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert status == 0
    assert "DS413 (2.0.0)" in out
    assert "DS705" not in out


@pytest.mark.parametrize(("edits", "status"), [
    pytest.param([with_finding("DS410", 2)], 0, id="gone of a rule that did not change"),
    pytest.param([without("DS413"), another_recording], 1, id="another recording"),
    pytest.param([with_finding("DS401", 2), value(2)], 1, id="of a transaction with another value"),
    pytest.param([with_finding("DS101", None, 6), value(2)], 1, id="of a frame of such a transaction"),
    pytest.param([lambda capture: capture["transactions"].pop()], 1, id="a transaction more"),
    pytest.param([lambda capture: capture.update(frames=7)], 1, id="other counts"),
])  # fmt: skip
def test_everything_else_stays_a_difference(
    of_1_0: Place, capsys: Any, edits: list[Edit], status: int
) -> None:
    of_1_0.edit(*edits)
    before = of_1_0.stored.read_bytes()
    told, out, _ = run(capsys, "check", of_1_0.folder, "--fail-on", "note")
    assert told == status
    assert "of the newer ds47 alone" not in out
    told, out, _ = run(capsys, "accept", "--by-version", "--yes", of_1_0.folder)
    assert (told, out) == (0, "nothing to take over\n")
    assert of_1_0.stored.read_bytes() == before


def test_another_recording_is_said_to_leave_it_open(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS705"), another_recording)
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert status == 1
    assert "stored by ds47 1.0.0; 1 change is about what changed in ds47 since: DS705" in out
    assert "it may also come of the capture or the device" in out


def test_a_result_of_a_newer_version_is_named(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS705"), version="99.0.0")
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert status == 1
    assert f"stored by ds47 99.0.0, newer than this one ({__version__})" in out
    assert run(capsys, "accept", "--by-version", of_1_0.folder)[1] == "nothing to take over\n"
    assert run(capsys, "accept", "--yes", of_1_0.folder)[0] == 0
    assert of_1_0.document()["tool"]["version"] == __version__


@pytest.mark.parametrize("version", [None, "", "x", __version__, "2", 7])
def test_a_version_that_says_nothing_explains_nothing(
    of_1_0: Place, capsys: Any, version: Any
) -> None:
    of_1_0.edit(without("DS705"), version=version)
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert (status, "stored by" in out) == (1, False)


def test_in_chinese(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS413"))
    _, out, _ = run(capsys, "check", of_1_0.folder, "--lang", "zh")
    assert "结果由 ds47 1.0.0 存储；1 项变化仅由新版本引起，其中有变更的是：DS413 (2.0.0)" in out
    assert "ds47 accept --by-version PATH..." in out


@pytest.mark.parametrize(
    ("stored", "now", "changed", "newer"),
    [
        ("1.0.0", "2.0.0.dev0", True, False), ("1.0.0", "2.0.0", True, False), ("1.0.0", "2.3.1", True, False),
        ("2.0.0.dev0", "2.0.0", True, False), ("2.0.0.dev0", "2.0.0.dev0", False, False),
        ("2.0.0", "2.1.0", False, False), ("2.0.0", "2.0.0", False, False), ("2.10.0", "2.9.0", False, True),
        ("2.0.0", "2.0.0.dev0", False, True), ("1.0.0", "1.9.0", False, False),
    ],
)  # fmt: skip
def test_which_rules_changed_between_two_versions(
    stored: str, now: str, changed: bool, newer: bool
) -> None:
    origin = Origin(stored, same_file=True, now=now)
    assert (origin.rules.get("DS401") == "2.0.0", origin.newer) == (changed, newer)
    assert "DS410" not in origin.rules


def test_a_state_that_a_version_brought() -> None:
    result = {"transactions": [{"frames": {"write_request": 1}}, {"frames": {"write_request": 2}}]}
    new, known = (
        Change("state", "", stored=at, now=at, was="unanswered", is_now=state)
        for at, state in ((0, "incomplete"), (1, "superseded"))
    )
    value = Change("value", "", stored=0, now=0)
    finding = Change(
        "finding_gone", "", rule="DS401", was={"rule": "DS401", "frame": 1, "transaction": 1}
    )
    origin = Origin("1.0.0", same_file=True, now="2.0.0")

    def explained(*changes: Change) -> list[str | None]:
        return [each.version for each in origin.explained(changes, result, result)]

    assert explained(new, known, finding) == ["2.0.0", None, "2.0.0"]
    assert explained(new, value, finding) == [None, None, None]
    (line,) = origin.lines(origin.explained([new, finding], result, result))
    assert line.en == (
        "stored by ds47 1.0.0; 2 changes come of the newer ds47 alone, by what changed in it: "
        "state incomplete, DS401 (2.0.0)"
    )
    assert not list(Origin("1.0.0", same_file=False, now="1.9.0").lines([new]))


def test_a_change_of_the_version_never_fails() -> None:
    change = Change("finding_new", "", is_now={"severity": "error"}, version="2.0.0")
    assert not fails(change, "note")


def test_rules_say_where_they_changed(capsys: Any) -> None:
    assert spec.rules()["DS401"].changed == ("2.0.0",)
    assert run(capsys, "rules", "DS401")[1].endswith(
        "Finds more or less than before from 2.0.0 on.\n"
    )
    _, out, _ = run(capsys, "rules", "DS40", "-f", "json")
    assert {each["id"]: each["changed"] for each in json.loads(out)}["DS401"] == ["2.0.0"]
    assert (
        "Changed     2.0.0 finds more or less than before\n" in run(capsys, "explain", "DS401")[1]
    )
    assert "Changed" not in run(capsys, "explain", "DS410")[1]
