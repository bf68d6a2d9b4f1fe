"""Requests of PKW and their answers (cyclic/handshake) in both implementations (docs/cyclic.md 4).

The conversations stand in tests/vectors/cyclic.json, with what is expected typed by hand: which answer counts,
and when none does. In them a frame has the number of its cycle, and a cycle takes 2 ms. A step without `out` or
`in` has no frame of that side; `skipped`: frames of the drive are missing between these two.
"""

from __future__ import annotations

import json
import random
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lua_program import LUAS, lua_program

from ds47.cyclic import judge, pkw
from ds47.cyclic.handshake import CycleMoment, PkwChannel, PkwJob, Sight
from ds47.cyclic.relations import CyclicRelation, CyclicSide
from ds47.spec import cyclic as spec

ROOT = Path(__file__).resolve().parents[2]
CONVERSATIONS = json.loads((ROOT / "tests/vectors/cyclic.json").read_text("utf-8"))["conversations"]
DRIVER = ROOT / "tests/lua/cyclic.lua"
CYCLE_NS = 2_000_000
PLAIN = dict.fromkeys(
    (
        "reason",
        "value",
        "error",
        "answer",
        "cycles",
        "newest",
        "halves",
        "late",
        "odd",
        "end",
        "hole",
    )
) | {"settled": False, "updates": 0, "heard": True}
"""What is not typed in a vector."""


def at(cycle: int) -> CycleMoment:
    return CycleMoment(cycle, cycle * CYCLE_NS, cycle)


def played(conversation: dict[str, Any]) -> list[PkwJob]:
    found: list[PkwJob] = []
    channel = PkwChannel(found.append)
    for step in conversation["steps"]:
        moment = at(step["cycle"])
        if step.get("lost"):
            side = step.get("side")
            channel.lost(moment, out=side != "in", answers=side != "out")
            continue
        if "out" in step:
            channel.sent(bytes.fromhex(step["out"]), moment)
        if "skipped" in step:
            channel.skipped(*step["skipped"])
        if "in" in step:
            channel.answered(bytes.fromhex(step["in"]), moment)
    channel.finish()
    return found


def shown(job: PkwJob) -> dict[str, Any]:
    """A transaction with the keys of the vectors."""
    request = pkw.decode(job.request.data, False)
    answer = None if job.answer is None else pkw.decode(job.answer.data, True)
    newest = None if job.newest is None else pkw.decode(job.newest.data, True)
    asked = spec.requests()[request.ak].access
    value = request.value if asked == "change" else answer and answer.value
    return {
        "access": asked, "pnu": request.pnu, "state": job.state, "reason": job.reason,
        "value": value, "error": answer and answer.error and answer.error.code,
        "start": job.request.at.cycle,
        "answer": None if job.answer is None or job.settled else job.answer.at.cycle,
        "cycles": job.cycles, "settled": job.settled, "updates": job.updates,
        "newest": newest and newest.value, "halves": job.halves, "late": job.late,
        "odd": job.odd and job.odd.at.frame, "end": job.ended and job.ended.cycle,
        "hole": job.hole and list(job.hole), "heard": job.heard,
    }  # fmt: skip


@pytest.mark.parametrize("conversation", CONVERSATIONS, ids=lambda each: str(each["id"]))
def test_a_conversation(conversation: dict[str, Any]) -> None:
    found = [shown(job) for job in played(conversation)]
    assert found == [PLAIN | each for each in conversation["expect"]]


@pytest.mark.parametrize("lua", LUAS)
def test_lua_pairs_the_same(lua: str) -> None:
    random_ones = [{"steps": steps(random.Random(seed))} for seed in range(300)]
    asked = [*({"steps": each["steps"]} for each in CONVERSATIONS), *random_ones]
    result = subprocess.run(
        [lua_program(lua), str(DRIVER)], capture_output=True, check=False,
        input="".join(json.dumps({"ask": "handshake", **each}) + "\n" for each in asked).encode(),
    )  # fmt: skip
    assert result.returncode == 0, result.stderr.decode()
    got = [json.loads(line)["jobs"] for line in result.stdout.decode().splitlines()]
    assert len(got) == len(asked)
    for conversation, found in zip(asked, got, strict=True):
        assert found == [bare(job) for job in played(conversation)], conversation


def bare(job: PkwJob) -> dict[str, Any]:
    """A transaction as tests/lua/cyclic.lua prints it."""
    return {
        "request": job.request.data.hex(), "start": job.request.at.cycle, "state": job.state,
        "answer": job.answer and job.answer.data.hex(), "settled": job.settled, "reason": job.reason,
        "updates": job.updates, "newest": job.newest and job.newest.data.hex(), "halves": job.halves,
        "odd": job.odd and job.odd.at.frame, "late": job.late, "end": job.ended and job.ended.cycle,
        "cycles": job.cycles, "duration": job.duration_ns, "hole": job.hole and list(job.hole),
        "heard": job.heard,
    }  # fmt: skip


def steps(chance: random.Random) -> list[dict[str, Any]]:
    """Requests and answers out of a few words, so that they fit each other often."""
    words = [bytes(8).hex()] + [
        f"{ak:x}43a{index}{value}"
        for ak in (1, 2, 3, 6, 7, 8)
        for index in ("0000", "0100")
        for value in ("00000000", "42200000", "42480000")
    ]
    out = answer = words[0]
    found, cycle = [], 0
    for _ in range(30):
        cycle += chance.choice((1, 1, 2, 5))
        if chance.random() < 0.03:
            side = chance.choice(("out", "in", None))
            found.append({"cycle": cycle, "lost": True, "side": side})
            continue
        out = chance.choice(words) if chance.random() < 0.5 else out
        answer = chance.choice(words) if chance.random() < 0.6 else answer
        if chance.random() < 0.3:  # the positive answer to what is asked
            ak = {"1": "2", "2": "1", "3": "2", "6": "5", "7": "4", "8": "5"}.get(out[0], "0")
            answer = ak + out[1:]
        step = {"cycle": cycle, "out": out, "in": answer}
        if chance.random() < 0.2:
            del step[chance.choice(("out", "in"))]
        if chance.random() < 0.1:
            step["skipped"] = [max(0, cycle - chance.randint(1, 9)), cycle]
        found.append(step)
    return found


def test_an_answer_takes_as_long_as_its_frames_say() -> None:
    (job,) = played(next(each for each in CONVERSATIONS if each["id"] == "k1-plain"))
    assert job.duration_ns == 6 * CYCLE_NS


@pytest.mark.parametrize(("end", "told"), [(None, [0.0]), (3, [2.0]), (1, [])])
def test_how_long_a_request_without_a_response_stood(end: int | None, told: list[float]) -> None:
    """Nothing where the clock was set back meanwhile."""
    job = PkwJob(Sight(bytes.fromhex("1" + "0" * 15), at(2)), None, True)
    side = CyclicSide(b"\2\3", 0, 0, 8, 8, None, None, 0)
    relation = CyclicRelation(
        "pkw", "dp2", "dp3", None, None, None, None, None, (), side, side, None
    )
    job.last = None if end is None else at(end)
    found = list(judge.unanswered(relation, job))
    assert [each.args["milliseconds"] for each in found] == told
    assert {each.rule for each in found} <= {"DS514"}


@pytest.mark.parametrize(("cycle", "state"), [(5, "incomplete"), (60, "mismatch")])
def test_an_answer_is_to_a_later_request_only_where_that_is_near(cycle: int, state: str) -> None:
    """Cycles that are missing show where there are many: a read came long after the odd answer."""
    found: list[PkwJob] = []
    channel = PkwChannel(found.append)
    channel.sent(bytes(8), at(1))
    channel.answered(bytes(8), at(1))
    channel.sent(bytes.fromhex("8460000000000005"), at(2))
    channel.answered(bytes.fromhex("2460000041200000"), at(3))
    channel.sent(bytes.fromhex("1460000000000000"), at(cycle))
    channel.finish()
    assert found[0].state == state
