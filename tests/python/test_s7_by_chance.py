"""What is made by chance says what it said (tests/vectors/by_chance.json), and chance leaves nothing out.

Bytes and scenes of S7, and lines of PROFIBUS. Conversations that chance seldom makes are in test_s7_near.py.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import s7_by_chance
import s7_bytes_by_chance as by_chance
import s7_segments as s7
from s7_bytes_by_chance import decoded
from tests.vectors.sources import by_chance as source

from ds47.analysis import AnalysisOptions
from ds47.spec import s7 as spec
from ds47.spec.semantics import limits

WANTED: dict[str, Any] = json.loads(source.TARGET.read_text("utf-8"))
pytestmark = pytest.mark.slow
SHARED = Path(__file__).resolve().parents[3] / "shared" / "reference" / "channel_vectors.json"


@pytest.mark.parametrize("part", source.PARTS)
def test_what_is_said_is_what_was_said(part: str) -> None:
    found, wanted = source.PARTS[part](), WANTED[part]
    assert len(found) == len(wanted)
    for number, (one, other) in enumerate(zip(found, wanted, strict=True)):
        assert one == other, number


def test_a_sum_tells_results_apart() -> None:
    said = decoded(by_chance.pdus_by_chance()[:3])
    other = [*said[:-1], said[-1] | {"kind": "none"}]
    assert source.check_sum(said) != source.check_sum(other)


def test_printed_and_recorded_frames() -> None:
    """Each may be the answer to each: nothing that was printed is an exception."""
    if not SHARED.exists():
        pytest.skip("the reference is not here")
    vectors = [row for row in json.loads(SHARED.read_text("utf-8"))["vectors"] if row["row"] == 19]
    frames = [bytes.fromhex(each["hex"])[7:].hex() for each in vectors]
    pairs = [{"kind": "pdu", "data": one, "answer": other} for one in frames for other in frames]
    assert len(decoded(pairs)) == len(frames) ** 2 > 0


def usend(r_id: int, size: int) -> bytes:
    """A USEND of one area."""
    content = b"\xff\x09" + struct.pack(">H", 1) + s7.entry(bytes(size), 0)
    return s7.dt(s7.header(7, 0, b"\0\1\x12\6\x13\0" + struct.pack(">I", r_id), content))


def test_as_many_r_ids_are_remembered() -> None:
    """More R_IDs than are remembered, the areas of some of which change; some again when that is over."""
    most = limits().s7_notes
    talks = [s7.Talk(("10.0.0.1", port)).opened() for port in (49152, 49153)]
    for r_id in range(most + 2):
        talks[0].say(True, usend(r_id, 10))
    for r_id in (0, most - 1, most, most + 1):
        for talk, size in zip((talks[0], talks[1], talks[1]), (12, 10, 12), strict=True):
            talk.say(True, usend(r_id, size))
    talks[0].closed()
    result = source.result(s7.capture(*talks), AnalysisOptions())
    told = [each.args["r_id"] for each in result.findings if each.rule == "DS913"]
    assert told == [0, most - 1, 0, most - 1, most, most + 1]


def test_scenes_leave_nothing_out() -> None:
    rules: Counter[str] = Counter()
    states: Counter[tuple[str, str]] = Counter()
    for scene in s7_by_chance.scenes():
        result = source.result(*scene)
        rules.update({each.rule for each in result.findings})
        states.update((each.operation, each.state) for each in result.transactions)
    # DS917 is told only when a capture goes on for 10 s without a CC: scenes of test_s7 do, these do not.
    assert sorted({f"DS{number}" for number in range(901, 917)} - set(rules)) == []
    assert min(states[operation, "ok"] for operation in ("get", "put", "bsend", "usend")) > 20
    for state in ("unanswered", "refused", "orphan", "error"):
        assert sum(count for key, count in states.items() if key[1] == state) > 20, state


def test_questions_have_both_answers() -> None:
    said = [by_chance.answer_to(line) for line in by_chance.questions_by_chance()]
    assert 100 < sum(each["mixed"] is not None for each in said) < len(said) - 100
    assert said[0]["steps"] < 0


def test_bytes_leave_nothing_out() -> None:
    every = decoded(by_chance.pdus_by_chance())
    told = [each for each in every if "pdu" in each]
    kinds = Counter(flaw["kind"] for each in every for flaw in each.get("flaws", ()))
    kinds += Counter(
        flaw["kind"]
        for each in told
        for flaw in (*each["pdu"]["flaws"], *each["job"]["answer_flaws"], *each["job"]["settled"])
    )
    kinds += Counter(flaw["kind"] for each in told for flaw in each["job"]["request_flaws"])
    heard = decoded(by_chance.talks_by_chance())
    kinds += Counter(
        flaw["kind"]
        for each in heard
        for whole in each.get("whole", ())
        for flaw in whole["tpdu"]["flaws"]
    )
    assert {name: count for name, count in kinds.items() if count < 5} == {}
    assert set(spec.flaw_ids()) - set(kinds) <= {"tpkt"}
    for name in ("lost", "late", "reset", "over", "lost_of_reader"):
        assert sum(bool(each.get(name)) for each in heard) > 20, name
    for name in ("calling", "called", "size", "reason"):
        wholes = [whole["tpdu"][name] for each in heard for whole in each.get("whole", ())]
        assert sum(each is not None for each in wholes) > 20, name
    assert sum(whole["late"] for each in heard for whole in each.get("whole", ())) > 5
    for name in ("setup", "user_data", "usend"):
        assert sum(each["pdu"][name] is not None for each in told) > 50, name
