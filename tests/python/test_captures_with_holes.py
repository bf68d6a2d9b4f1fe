"""Captures that lack something: what has to be said of them, and what must not, as their README has it.

They stand beside the project and are none of its own; tests of cuts that are made here are in test_audit_holes.py.
"""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from ds47.analysis import analyze
from ds47.model import CaptureResult
from ds47.report.html.verdict import quality

FOLDER = Path(__file__).resolve().parents[3] / "shared/captures/sentences"
OF_THE_PROGRAM = frozenset(
    (
        "DS206",
        "DS401",
        "DS402",
        "DS404",
        "DS405",
        "DS406",
        "DS407",
        "DS413",
        "DS414",
        "DS702",
        "DS703",
        "DS704",
        "DS705",
        "DS706",
        "DS708",
        "DS722",
    )
)
"""What charges program, drive or cable with what did not come."""

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="shared/captures is missing")


@cache
def result(name: str) -> CaptureResult:
    return analyze(FOLDER / name)


def states(name: str) -> dict[str, int]:
    return dict(Counter(each.state for each in result(name).transactions))


def lacks(name: str) -> list[tuple[str, object]]:
    """What the first diagnoses say of the capture: the case, and its number or numbers."""
    told = []
    for each in result(name).diagnoses:
        if each.rule != "DS725":
            break
        told.append((each.args["what"], each.args.get("numbers") or each.args.get("count")))
    return told


def rules(name: str) -> set[str]:
    return {each.rule for each in result(name).findings}


@pytest.mark.parametrize(
    "name",
    [
        "lost-write-pair.pcap",
        "lost-read-response.pcap",
        "out-of-order.pcap",
        "one-direction-from-controllers.pcapng",
        "one-direction-from-device.pcapng",
    ],
)
def test_nobody_is_charged_with_what_the_capture_lacks(name: str) -> None:
    told = rules(name) & OF_THE_PROGRAM
    assert told <= ({"DS704"} if name == "out-of-order.pcap" else set())  # which is so there


def test_lost_writes_are_missing_numbers() -> None:
    name = "lost-write-pair.pcap"
    assert lacks(name) == [("gaps", "5008, 5016")]
    assert states(name) == {"ok": 10, "orphan": 2}


def test_a_read_without_its_response_is_a_read() -> None:
    name = "lost-read-response.pcap"
    assert states(name) == {"ok": 10, "incomplete": 2}
    assert [each.frame for each in result(name).findings if each.rule == "DS101"] == [19, 34]
    assert lacks(name) == [("half_calls", 2)]


@pytest.mark.parametrize(
    ("sender", "what", "state"),
    [("controllers", "only_requests", "incomplete"), ("device", "only_responses", "orphan")],
)
def test_one_direction_is_told_for_each_controller(sender: str, what: str, state: str) -> None:
    name = f"one-direction-from-{sender}.pcapng"
    assert [case for case, _ in lacks(name)] == [what] * 2
    assert set(states(name)) == {state}


def test_calls_across_the_disorder_are_whole() -> None:
    name = "out-of-order.pcap"
    assert [case for case, _ in lacks(name)] == ["disorder"]
    assert rules(name) & {"DS101", "DS102", "DS403"} == set()
    assert "orphan" not in states(name)


@pytest.mark.parametrize(
    ("sender", "said"),
    [
        ("controllers", "Only requests (164), no response: mirror both directions of the port."),
        ("device", "Only responses (164), no request: mirror both directions of the port."),
    ],
)
def test_the_page_knows_one_direction(sender: str, said: str) -> None:
    lines = [each.text.en for each in quality(result(f"one-direction-from-{sender}.pcapng"))]
    assert said in lines
    assert not [each for each in lines if "Both directions" in each]
