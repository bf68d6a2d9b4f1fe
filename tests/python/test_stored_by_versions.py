"""Stored results of other versions: what comes of ds47 alone is told, does not fail, and is taken over by itself.

`tests/vectors/stored/` has results as 1.0.0 wrote them. What an older analysis did not find is made by taking
findings out of one, what it found and should not have by putting some in.
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
from ds47.spec.shell import shell_word
from ds47.version import __version__

NAME = "conversation-superseded-read"
GIVEN = Path(__file__).resolve().parents[3] / "shared/captures/sentences"
"""Captures that stand beside the project."""
REMADE = ["diagnosis-half-captured", *("lost-read-response", "lost-write-pair"),
          *("ppo1-asked-from-first-exchange", "ppo1-half-change")]  # fmt: skip
"""Results of 1.0.0 of captures that lack something, or in which a drive is asked by PKW."""
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


@pytest.fixture(params=REMADE)
def remade(request: pytest.FixtureRequest, tmp_path: Path, captures: Path, vectors: Path) -> Place:
    return stored_by_1_0(request.param, tmp_path, captures, vectors)


@pytest.fixture
def lost_writes(tmp_path: Path, captures: Path, vectors: Path) -> Place:
    return stored_by_1_0("lost-write-pair", tmp_path, captures, vectors)


def stored_by_1_0(name: str, folder: Path, captures: Path, vectors: Path) -> Place:
    """A capture with the result that 1.0.0 stored of it."""
    capture = captures / f"{name}.pcapng"
    if not capture.is_file():
        capture = GIVEN / f"{name}.pcap"
    if not capture.is_file():
        pytest.skip("shared/captures is missing")
    return Place(folder, capture, vectors / "stored" / f"{name}.1.0.0.json")


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


def unnamed(capture: dict[str, Any]) -> None:
    """Did not know what the first parameter is called."""
    first = capture["transactions"][0]["parameters"][0]
    assert first["name"]
    first["name"] = None


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
        "         stored by ds47 1.0.0; 3 changes come from the newer ds47 alone, from what changed in it: "
        "DS401, DS413, DS705 (2.0.0)\n"
        "1 capture: 1 as stored, 0 not; to accept what the version alone changes: "
        f"ds47 accept --by-version {shell_word(str(of_1_0.folder))}\n"
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
    assert (status, out.splitlines()[-1]) == (0, "accepted 1 change in 1 capture")
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
    assert "stored by ds47 1.0.0; 1 change comes from the newer ds47 alone" in out
    assert (
        f"ds47 accept {shell_word(str(tour.folder))}; to accept what the version alone changes"
        in out
    )
    status, out, _ = run(capsys, "accept", "--by-version", "--yes", tour.folder)
    assert (status, out.splitlines()[-1]) == (0, "accepted 1 change in 1 capture")
    assert "DS402" in out
    assert "transaction 1: p" not in out
    status, out, _ = run(capsys, "check", tour.folder)
    assert status == 1
    assert out.count("\n") == 3
    assert "transaction 1: p" in out
    assert tour.document()["tool"]["version"] == __version__
    assert run(capsys, "accept", "--by-version", "--yes", tour.folder)[1] == "nothing to accept\n"


def test_what_is_left_of_the_version_stays_known_as_such(tour: Place, capsys: Any) -> None:
    tour.edit(without("DS402"), value(1))
    assert run(capsys, "accept", "--where", "kind=value", "--yes", tour.folder)[0] == 0
    assert tour.document()["tool"]["version"] == "1.0.0"
    status, out, _ = run(capsys, "check", tour.folder)
    assert (status, "1 change comes from the newer ds47 alone" in out) == (0, True)


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
    assert (told, out) == (0, "nothing to accept\n")
    assert of_1_0.stored.read_bytes() == before


def test_what_is_put_together_of_other_frames_comes_of_the_version(
    remade: Place, capsys: Any
) -> None:
    status, out, _ = run(capsys, "check", remade.folder)
    assert (status, out.startswith(f"noted    {remade.capture}\n")) == (0, True)
    told = (
        "which requests are seen"
        if "asked" in remade.capture.name
        else "which frames belong to a transaction"
    )
    assert told in out
    assert run(capsys, "accept", "--by-version", "--yes", remade.folder)[0] == 0
    status, out, _ = run(capsys, "check", remade.folder, "--fail-on", "note")
    assert (status, out) == (0, "1 capture: 1 as stored, 0 not\n")


@pytest.mark.parametrize(
    "edit", [lambda place: place.edit(version=__version__), lambda place: place.edit(another_recording)],
    ids=["of this version", "of another recording"],
)  # fmt: skip
def test_but_not_where_nothing_or_something_else_may_explain_it(
    remade: Place, capsys: Any, edit: Callable[[Place], None]
) -> None:
    edit(remade)
    status, out, _ = run(capsys, "check", remade.folder)
    assert (status, "of the newer ds47 alone" in out) == (1, False)
    out = run(capsys, "accept", "--by-version", "--yes", remade.folder)[1]
    assert out == "nothing to accept\n"


def test_out_of_the_same_frames_the_same_is_read(lost_writes: Place, capsys: Any) -> None:
    lost_writes.edit(value(4))  # of which only a Read that was thought to be one more is gone
    status, out, _ = run(capsys, "check", lost_writes.folder)
    assert status == 1
    assert "transaction 4: p" in out
    out = run(capsys, "accept", "--by-version", "--yes", lost_writes.folder)[1]
    assert "transaction 4: p" not in out
    assert "transaction 5 is new" in out
    left = run(capsys, "check", lost_writes.folder)[1]
    assert "transaction 4: p" in left
    assert "transaction 5 is new" not in left


def test_a_name_that_a_version_knows(tour: Place, capsys: Any) -> None:
    tour.edit(unnamed)
    status, out, _ = run(capsys, "check", tour.folder)
    assert status == 0
    assert (
        "1 change comes from the newer ds47 alone, from what changed in it: known names of parameters (2.0.0)"
        in out
    )
    tour.edit(another_recording)
    status, out, _ = run(capsys, "check", tour.folder)
    assert (status, "since: known names of parameters (2.0.0). This is another" in out) == (1, True)


def test_a_name_that_is_not_known_any_more_is_of_the_options() -> None:
    result = {"transactions": [READ]}
    change = Change("field", "", stored=0, now=0, path=("parameters", 0, "name"), was="speed")
    (found,) = Origin("1.0.0", same_file=True, now="2.0.0").explained([change], result, result)
    assert found.version is None


def test_another_recording_is_said_to_leave_it_open(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS705"), another_recording)
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert status == 1
    assert "stored by ds47 1.0.0; 1 change is about what changed in ds47 since: DS705" in out
    assert "the capture or the device may be the reason as well" in out


def test_a_result_of_a_newer_version_is_named(of_1_0: Place, capsys: Any) -> None:
    of_1_0.edit(without("DS705"), version="99.0.0")
    status, out, _ = run(capsys, "check", of_1_0.folder)
    assert status == 1
    assert f"stored by ds47 99.0.0, newer than this one ({__version__})" in out
    assert run(capsys, "accept", "--by-version", of_1_0.folder)[1] == "nothing to accept\n"
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
    assert f"ds47 accept --by-version {of_1_0.folder}" in out


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
        "stored by ds47 1.0.0; 2 changes come from the newer ds47 alone, from what changed in it: "
        "state incomplete, DS401 (2.0.0)"
    )
    assert not list(Origin("1.0.0", same_file=False, now="1.9.0").lines([new]))


def transaction(state: str, channel: str = "ds47", **frames: int | None) -> dict[str, Any]:
    every = dict.fromkeys(("write_request", "write_response", "read_request", "read_response"))
    return {"state": state, "channel": channel, "frames": every | frames}


READ = transaction("ok", write_request=1, read_response=4)


@pytest.mark.parametrize(
    ("was", "changes", "known"),
    [
        pytest.param(READ, [("field", "frames"), ("value", "parameters"), ("field", "bytes")], True,
                     id="what other frames carry"),
        pytest.param(transaction("ok", write_request=1, read_request=3, read_response=6),
                     [("field", "frames"), ("value", "parameters")], False, id="what the same frames carry"),
        pytest.param(transaction("ok", write_request=1, read_request=3, read_response=6),
                     [("field", "frames"), ("state", "state"), ("timing", "duration_ms")], True,
                     id="state and duration follow from any frame"),
        pytest.param(transaction("ok", write_request=1, write_response=2, read_response=6),
                     [("field", "frames"), ("field", "status")], True, id="a status of another response"),
        pytest.param(transaction("ok", "s7", write_request=1), [("field", "frames")], True,
                     id="by the channel of today"),
    ],
)  # fmt: skip
def test_what_follows_from_other_frames(
    was: dict[str, Any], changes: list[tuple[str, str]], known: bool
) -> None:
    now = transaction("incomplete", write_request=1, read_response=6)
    told = [Change(kind, "", stored=0, now=0, path=(path,)) for kind, path in changes]
    origin = Origin("1.0.0", same_file=True, now="2.0.0")
    found = origin.explained(told, {"transactions": [was]}, {"transactions": [now]})
    assert {each.version for each in found[1:]} <= {"2.0.0" if known else None}
    assert found[0].because in ("frames", None)


@pytest.mark.parametrize(
    ("item", "what"),
    [
        (transaction("orphan", read_response=9), "frames"),
        (transaction("ok", write_request=3, read_response=4), "frames"),
        (transaction("ok", write_request=8, read_response=9), None),
        (transaction("ok", "pkw", write_request=8, read_response=9), "requests"),
        (transaction("orphan", "s7", read_response=9), None),
        (transaction("ok", "s7", write_request=1), None),
    ],
)
@pytest.mark.parametrize("new", [True, False])
def test_a_transaction_that_only_one_version_sees(
    item: dict[str, Any], what: str | None, new: bool
) -> None:
    one, both = {"transactions": [READ]}, {"transactions": [READ, item]}
    finding = {"rule": "DS410", "frame": 9, "transaction": 2}
    if new:
        changes = [
            Change("transaction_new", "", now=1, is_now=item),
            Change("finding_new", "", is_now=finding),
        ]
    else:
        changes = [
            Change("transaction_gone", "", stored=1, was=item),
            Change("finding_gone", "", was=finding),
        ]
    origin = Origin("1.0.0", same_file=True, now="2.0.0")
    found = origin.explained(changes, *((one, both) if new else (both, one)))
    assert [each.because for each in found] == [what, what]


def test_a_change_of_the_version_never_fails() -> None:
    change = Change("finding_new", "", is_now={"severity": "error"}, version="2.0.0")
    assert not fails(change, "note")


def test_rules_say_where_they_changed(capsys: Any) -> None:
    assert spec.rules()["DS401"].changed == ("2.0.0",)
    assert run(capsys, "rules", "DS401")[1].endswith(
        "Finds more or less than before since 2.0.0.\n"
    )
    _, out, _ = run(capsys, "rules", "DS40", "-f", "json")
    assert {each["id"]: each["changed"] for each in json.loads(out)}["DS401"] == ["2.0.0"]
    assert (
        "Changed     2.0.0 finds more or less than before\n" in run(capsys, "explain", "DS401")[1]
    )
    assert "Changed" not in run(capsys, "explain", "DS410")[1]
