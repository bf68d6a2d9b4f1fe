"""The scenes of S7: each says what it is made for and nothing else, and the words of some of it.

What tshark reads in them: test_wireshark_s7.py. The numbers here are counted by hand from what the scene says.
"""

from __future__ import annotations

import io
from typing import Any

import pytest
import s7_scenes

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab import s7_stories
from ds47.lab.scenario import Scenario
from ds47.model import CaptureResult, Finding
from ds47.s7.choices import Choices

SCENES = {
    each.name.removeprefix("s7-"): each
    for book in (s7_scenes.BOOK, s7_stories.BOOK)
    for each in book.scenarios
}
CPU, FIRST, SECOND = "192.168.134.1", "192.168.134.2", "192.168.134.3"


def capture(scene: Scenario) -> io.BytesIO:
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for shot in scene.play().shots:
            writer.write(shot.time_ns, shot.data, shot.original_length)
    target.seek(0)
    return target


def result(name: str, **choices: Any) -> CaptureResult:
    return analyze(capture(SCENES[name]), AnalysisOptions(s7=Choices(**choices)))


def rules(name: str, **choices: Any) -> set[str]:
    return {each.rule for each in result(name, **choices).findings}


def only(name: str, rule: str, **choices: Any) -> Finding:
    (found,) = [each for each in result(name, **choices).findings if each.rule == rule]
    return found


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_says_what_it_is_made_for(name: str) -> None:
    found, expect = result(name), SCENES[name].expect
    assert tuple((each.operation, each.state) for each in found.transactions) == expect.transactions
    assert {each.rule for each in found.findings} == expect.rules
    assert found.complete


def test_every_rule_has_a_scene() -> None:
    shown = {rule for each in SCENES.values() for rule in each.expect.rules}
    by_choice = {"DS916"}
    assert shown | by_choice == {f"DS9{number:02}" for number in range(1, 20)}


@pytest.mark.parametrize(
    ("name", "area", "size", "block"),
    [("figure-1", "DB10.DBB0..31", 32, 8), ("figure-2", "DB20.DBB0..63", 64, 32)],
)
def test_the_figures(name: str, area: str, size: int, block: int) -> None:
    """The CPU says its block in the answer to SZL 0131: frame 9."""
    args = only(name, "DS903").args
    assert (args["area"], args["bytes"], args["block"]) == (area, size, block)
    assert (args["device"], args["controller"], args["frame"]) == (CPU, FIRST, 9)


def test_a_block_that_is_named() -> None:
    name = "block-not-known"
    assert rules(name, blocks=(("", 8),)) == {"DS903"}
    assert rules(name, blocks=((CPU, 31),)) == {"DS903"}
    assert rules(name, blocks=((CPU, 32),)) == set()
    assert rules(name, blocks=((FIRST, 8),)) == set()
    # what is named stands above what the CPU says
    assert rules("figure-1", blocks=((CPU, 32),)) == set()
    assert rules("within-a-block", blocks=((CPU, 31),)) == {"DS903"}


def test_the_example_of_usend() -> None:
    there, back = result("usend-as-printed").transactions
    assert [item.value for item in there.items] == [b"\x02" * 10]
    assert [item.value for item in back.items] == [b"\x03" * 10]
    assert (there.controller, there.device, there.r_id) == (FIRST, CPU, 0)
    assert (back.controller, back.device, back.r_id) == (CPU, FIRST, 0)


@pytest.mark.parametrize(
    ("name", "operation", "area", "jobs"),
    [("split-read", "GET", "DB1.DBB0..599", 2), ("split-write", "PUT", "DB1.DBB0..999", 3)],
)
def test_a_split_is_told_as_a_whole(name: str, operation: str, area: str, jobs: int) -> None:
    args = only(name, "DS904").args
    assert (args["operation"], args["area"], args["jobs"]) == (operation, area, jobs)


def test_which_bytes_never_were_there_together() -> None:
    """The last old byte, a new one behind it, and the write between: byte n was (7 n + 3) mod 256 before."""
    finding = only("inconsistent-read", "DS905")
    told = [finding.args[name] for name in ("first", "first_value", "second", "second_value")]
    assert told == ["DB1.DBB461", (7 * 461 + 3) % 256, "DB1.DBB462", 0xEE]
    (written,) = [
        each for each in result("inconsistent-read").transactions if each.operation == "put"
    ]
    assert finding.args["write"] == written.frames.write_request
    args = only("inconsistent-write", "DS905").args
    first, second = (int(args[name].removeprefix("DB1.DBB")) for name in ("first", "second"))
    assert 440 <= first < 452 <= second < 464
    assert (args["first_value"], args["second_value"]) == (0xEE, (7 * second + 3) % 256)


def test_what_is_read_is_not_what_was_written() -> None:
    assert rules("reads-back", readback=True) == set()
    args = only("reads-back-differently", "DS916", readback=True).args
    assert (args["byte"], args["written"], args["read"]) == ("DB1.DBB3", 4, 5)


def test_two_writers() -> None:
    args = only("two-writers", "DS907").args
    assert {args["controller"], args["other"]} == {FIRST, SECOND}
    assert (args["count"], args["byte"]) == (1, "DB1.DBB4")


def test_a_pdu_is_one_byte_too_long() -> None:
    args = only("longer-than-agreed", "DS902").args
    assert (args["size"], args["agreed"], args["sender"]) == (481, 480, FIRST)


def test_sums_of_bsend() -> None:
    args = only("bsend-too-short", "DS910").args
    assert (args["total"], args["size"]) == (1000, 900)
    sent = result("bsends").transactions
    assert [len(each.segments) for each in sent] == [1, 3, 3]
    assert [len(each.items[0].value or b"") for each in sent] == [10, 1200, 1000]


@pytest.mark.parametrize(
    "name",
    ["closed-after-cr", "reset-after-cr", "disconnected-after-cr", "setup-refused"],
)
def test_where_a_refused_connection_wanted_to_go(name: str) -> None:
    """The TSAP 03 02: an operator station wants rack 0, slot 2."""
    args = only(name, "DS917").args
    assert (args["rack"], args["slot"], args["device"]) == (0, 2, CPU)
