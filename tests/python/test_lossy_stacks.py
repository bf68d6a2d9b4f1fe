"""Captures of two stacks on a wire that loses, doubles and delays datagrams, against what their client logged.

Of `l3_once` only what its client asked for once and got an answer to: of a call that is given up after one
datagram the capture has answers that nobody took.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from test_real_stacks import result_of

from ds47.cli import main

WHOLE = {"l1_replay": "l1_replay.device.pcapng", "l4_harsh": "l4_harsh.pcapng"}
"""What was asked by name of the list, and where the wire was recorded."""
OF_THE_WIRE = {
    "DS102", "DS404", "DS405", "DS406", "DS407", "DS413", "DS414", "DS415", "DS703", "DS704", "DS705",
}  # fmt: skip
"""What was said of copies and late answers."""


@pytest.fixture
def stacks(captures: Path) -> Path:
    return captures / "lossy-stacks"


def logged(stacks: Path, name: str) -> list[dict[str, Any]]:
    lines = (stacks / "EXPECTED.jsonl").read_text("utf-8").splitlines()
    return [line for line in map(json.loads, lines) if line["capture"] == name]


def _hex(data: bytes | None) -> str | None:
    return None if data is None else data.hex()


@pytest.mark.parametrize("name", WHOLE)
def test_each_request_is_one_transaction_with_the_response_that_its_client_got(
    stacks: Path, name: str
) -> None:
    told = [
        (each.slot, each.subslot, each.index, _hex(each.request), _hex(each.response))
        for each in result_of(stacks / WHOLE[name]).transactions
    ]
    names = ("slot", "subslot", "index", "request_hex", "response_hex")
    assert told == [tuple(line[key] for key in names) for line in logged(stacks, name)]


@pytest.mark.parametrize("name", WHOLE)
def test_polls_are_those_of_the_client(stacks: Path, name: str) -> None:
    told = [len(each.frames.polls) for each in result_of(stacks / WHOLE[name]).transactions]
    assert told == [
        sum(read["status"] == "de80b500" for read in line["reads"]) for line in logged(stacks, name)
    ]


@pytest.mark.parametrize("name", WHOLE)
def test_nothing_is_said_of_what_the_wire_did(stacks: Path, name: str) -> None:
    assert {each.rule for each in result_of(stacks / WHOLE[name]).findings} & OF_THE_WIRE == set()


def test_a_request_that_was_written_again_says_so(stacks: Path) -> None:
    """Its Write response was lost, or the request; nobody ended a connection over it (P73)."""
    found = result_of(stacks / "l3_once.pcapng").findings
    again = {
        each.frame: each.args["last"] for each in found if each.args.get("what") == "written_again"
    }
    assert again == {
        121: 124, 145: 146, 180: 181, 223: 227, 368: 375, 424: 426, 833: 835, 856: 860, 1218: 1221,
        1264: 1267, 1345: 1348,
    }  # fmt: skip
    assert {each.rule for each in found} & {"DS401", "DS402", "DS722"} == set()


def test_a_second_answer_belongs_to_no_other_call(stacks: Path) -> None:
    found = result_of(stacks / "l3_once.pcapng").findings
    told = {each.frame: each.args["first"] for each in found if each.rule == "DS111"}
    assert told == {540: 534, 588: 587, 953: 950, 1404: 1402, 1417: 1414}
    assert {each.rule for each in found} & {"DS102", "DS704"} == set()


def test_answers_are_remembered_by_time_and_open_calls_by_themselves(stacks: Path) -> None:
    """59 calls of one activity without an answer."""
    assert "DS109" not in {each.rule for each in result_of(stacks / "l3_once.pcapng").findings}


def test_what_was_asked_once_and_answered_has_its_response(stacks: Path) -> None:
    told = {}
    for each in result_of(stacks / "l3_once.pcapng").transactions:
        told.setdefault((each.slot, each.index, _hex(each.request)), []).append(each)
    for line in logged(stacks, "l3_once"):
        sure = line["outcome"] == "answered" and all(
            each["outcome"] == "ok" for each in line["reads"]
        )
        if sure and line["write"]["outcome"] == "ok" and line["attempt"] == 0:
            found = told[line["slot"], line["index"], line["request_hex"]]
            assert line["response_hex"] in [_hex(each.response) for each in found]


# S7: bytes that clients of two libraries read and wrote


@pytest.mark.parametrize(
    ("name", "count", "margin"), [("lossy_nodes7", 180, 0.01), ("s7connector", 60, 0.001)]
)
def test_bytes_of_s7_are_those_that_the_client_had(
    stacks: Path, name: str, count: int, margin: float
) -> None:
    """Each area that was read or written well stands in the jobs of that time, in one or in several items."""
    jobs = result_of(stacks / f"{name}.pcapng").transactions
    asked = [each for each in logged(stacks, name) if each["op"] in ("read", "write")]
    assert len(asked) >= count
    for line in asked:
        there: dict[int, int] = {}
        for job in jobs:
            moment = job.start_ns / 1e9
            wanted = job.operation == {"read": "get", "write": "put"}[line["op"]]
            if wanted and line["t"] - margin <= moment <= line["t_end"] + margin:
                for item in job.items:
                    mine = (item.area, item.db or 0) == (line["area"], line["db"])
                    if mine and item.code == 0xFF and item.start is not None and item.value:
                        there |= dict(enumerate(item.value, item.start))
        span = range(line["start"], line["start"] + line["length"])
        if line["ok"] and line.get("bit") is None and line["bytes"] is not None:
            assert bytes(there[at] for at in span).hex() == line["bytes"], line
        elif line["ok"] is False:
            assert not set(span) <= set(there), line


def test_a_refusal_with_nothing_open_is_told_with_what_the_frames_show(
    stacks: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """DF80B500 behind a response that was fetched: no other request is in the capture, so none is claimed."""
    assert main(["report", "--all", str(stacks / "l3_once.pcapng")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert (
        "in frame 86 was refused with a state conflict; the capture shows no open request" in told
    )


def test_the_time_beside_a_frame_is_that_of_this_frame(
    stacks: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Frame 39 brings the response of #3, whose request came at 19:25:07.043."""
    assert main(["report", "--all", str(stacks / "l3_once.pcapng")]) == 0
    told = capsys.readouterr().out
    assert "look at frame 39 (#3, 19:25:07.232): " in told
    assert "frame 39 #3 19:25:07.232: offset 4: " in told
