"""Lines of PROFIBUS in both implementations: the same frames, exchanges, calls and jobs (docs/profibus.md 6).

The lines that test_profibus_calls.py makes by hand, those of printed frames, and lines by chance (seeded):
masters and slaves whose services are retried, polled, refused and not ready, with frames that are lost,
doubled, too early and damaged. What single frames are is compared in test_profibus.py.
"""

from __future__ import annotations

import inspect
import json
import random
import subprocess
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import test_profibus_calls as by_hand
from lua_program import LUAS, lua_program
from test_profibus_calls import MS, NOT_READY, SHORT, Talk

from ds47.acyclic.pairing import Job, Outcome, Pairing
from ds47.acyclic.services import Became, ServiceCall, ServiceTracker
from ds47.profibus import telegram
from ds47.profibus.line import Exchange, Line, LineFrame
from ds47.profidrive import decode_request
from ds47.profidrive.model import Options
from ds47.profinet.records import Half, Peer, Record
from ds47.spec.semantics import limits

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests/lua/profibus_calls.lua"
SEEDS = range(60)
TOKEN = b"\xdc\x02\x05"


# What Python says


def half_of(half: Half | None) -> dict[str, Any] | None:
    if half is None:
        return None
    names = ("frame", "time_ns", "stated", "missing", "status")
    return {name: getattr(half, name) for name in names} | {"data": half.data.hex()}


def record_of(record: Record) -> dict[str, Any]:
    names = ("write", "implicit", "api", "slot", "subslot", "index", "position")
    return {name: getattr(record, name) for name in names} | {
        "ar": record.ar.hex(),
        "request": half_of(record.request),
        "response": half_of(record.response),
    }


class Ear:
    """Hears of the calls of one line and gives them to a pairing, as `Ear` of the Lua script does."""

    def __init__(self) -> None:
        self.told: list[dict[str, Any]] = []
        self._calls: list[ServiceCall] = []
        self._jobs: dict[int, Job] = {}
        self._outcomes: list[Outcome] = []
        self.pairing = Pairing(limits(), self._outcomes)

    def run(self, frames: Iterable[bytes], cut: bool = False) -> list[dict[str, Any]]:
        line, calls = Line(), ServiceTracker()
        for number, data in enumerate(frames, start=1):
            for exchange in line.take(LineFrame(number, number * MS, telegram.decode(data)), cut):
                self._exchange(exchange)
                self._heard(calls.take(exchange))
        for exchange in line.finish():
            self._exchange(exchange)
            self._heard(calls.take(exchange))
        self._heard(calls.finish())
        self.pairing.finish()
        self._close()
        self._tell("end", unsure=line.unsure)
        return self.told

    def _heard(self, told: list[Became]) -> None:
        for what, call in told:
            getattr(self, f"_{what}")(call)
            self._close()

    def _close(self) -> None:
        for what, job, _ in self._outcomes:
            if what == "closed":
                self._closed(job)
        self._outcomes.clear()

    def _tell(self, event: str, **content: Any) -> None:
        self.told.append({"event": event, **content})

    def _exchange(self, item: Exchange) -> None:
        self._tell(
            "exchange", request=item.request.frame, answer=item.answer and item.answer.frame,
            again=item.again, silent=item.silent,
        )  # fmt: skip

    def _call(self, event: str, call: ServiceCall) -> None:
        record, fault = record_of(call.record), call.fault
        if event == "asked":  # the answer may be there already: it is told next
            self._calls.append(call)
            record, fault = {**record, "response": None}, None
        (number,) = (at for at, each in enumerate(self._calls, start=1) if each is call)
        self._tell(
            event, call=number, master=call.master, station=call.station, sap=call.sap, fault=fault,
            record=record,
        )  # fmt: skip

    def _asked(self, call: ServiceCall) -> None:
        self._call("asked", call)
        access, half = self._access(call), call.record.request
        assert half is not None
        if call.record.write:
            message = decode_request(half.data, Options())
            self._jobs[id(call)] = self.pairing.write_request(access, message)

    def _answered(self, call: ServiceCall) -> None:
        self._call("answered", call)
        if call.record.write:
            self.pairing.write_response(self._jobs[id(call)], call.record.response)
        else:
            self.pairing.read_response(self._access(call))

    def _failed(self, call: ServiceCall) -> None:
        self._call("failed", call)
        if call.record.write:
            self.pairing.write_response(self._jobs[id(call)], None, fault=True)

    def _lost(self, call: ServiceCall) -> None:
        self._call("lost", call)
        if not call.record.write:
            self.pairing.read_lost(self._access(call))

    def _unasked(self, call: ServiceCall) -> None:
        self._tell(
            "unasked", master=call.master, station=call.station, sap=call.sap,
            record=record_of(call.record),
        )  # fmt: skip

    def _closed(self, job: Job) -> None:
        self._tell(
            "closed", controller=job.peer.controller, device=job.peer.device, phase=job.phase,
            reason=job.reason, request=half_of(job.write_request), write_response=half_of(job.write_response),
            refused=job.write_refused, read_request=half_of(job.read_request),
            read_response=half_of(job.read_response), reference=job.reference,
            polls=[response.frame for _, response in job.polls],
            rereads=[response.frame for _, response in job.rereads], superseded_by=job.superseded_by,
        )  # fmt: skip

    @staticmethod
    def _access(call: ServiceCall) -> Record:
        return call.record.of(Peer(str(call.master), str(call.station)))


# Lines by chance


def service(talk: Talk, chance: random.Random) -> None:
    """A DS_Write or DS_Read, or what else begins so, with its retries, its polls and its end."""
    reference = chance.randrange(1, 4)
    asked = bytes((reference, 1, 2, 1, 0x10, 1, 0xC4, 0x7F, 0, 0)).hex()
    given = bytes((reference, 1, 2, 1, 8, 1, 0x41, 0x20, 0, 0)).hex()
    write = chance.random() < 0.5
    place = chance.choice(("002f",) * 6 + ("012f", "00ff"))
    length = chance.choice(("0a",) * 6 + ("14", "04", ""))
    du = f"5f{place}{length}{asked if length else ''}" if write else f"5e{place}f0"
    du = chance.choice((du,) * 20 + ("48", "51aabb", "58", "99", "5f00", "5e", f"{du}00"))
    ends = (
        ["5f" + place + length]
        if write
        else [f"5e{place}{length}{given}", "5e" + place + "00", NOT_READY]
    )
    ends = ends * 8 + [
        "df80b000" if write else "de80b700", "df80b500", "df80", "de", "58", "48", "d100", "99", "5f",
        "5e002f0a" + given, "5f002f0a",
    ]  # fmt: skip
    for repeated in [False, *[True] * chance.choice((0,) * 9 + (1, 3))]:
        talk.ask(du, repeated)
    for _ in range(chance.choice((0, 1, 1, 1, 2, 4))):
        waiting(talk, chance)
        for repeated in [False, *[True] * chance.choice((0,) * 9 + (1, 3))]:
            talk.ask("", repeated)
    if chance.random() < 0.9:
        talk.answer(chance.choice(ends))


def waiting(talk: Talk, chance: random.Random) -> None:
    """What a slave says that has no answer yet; one of many refuses, and some of it the master does not get."""
    answers: list[tuple[str | None, int]] = [(None, 8)] * 20 + [("", 8)] * 5 + [(None, 9)] * 5
    talk.answer(*chance.choice([*answers, (None, 1), (None, 2), (None, 3), ("48", 8)]))


def others(chance: random.Random) -> list[bytes]:
    """What else is on a line: data exchange, diagnosis, control, tokens, the first request to a station."""
    station, fc = chance.choice((3, 4)), chance.choice((0x5D, 0x7D))
    return chance.choice((
        [telegram.encode(station, 2, fc, b"\0\0"), telegram.encode(2, station, 8, b"\1\2")],
        [telegram.encode(station, 2, 0x6D, b"", 60, 62), telegram.encode(2, station, 8, bytes(6), 62, 60)],
        [telegram.encode(station, 2, 0x49), telegram.encode(2, station, 0)],
        [telegram.encode(station, 2, 0x6D, b"", 51, 51), SHORT],
        [telegram.encode(127, 2, chance.choice((0x46, 0x7D)), b"\x20\0", 58, 62)],
        [telegram.encode(station, 2, 0x40)], [TOKEN], [SHORT], [TOKEN, TOKEN],
        [telegram.encode(2, chance.choice((3, 4, 9)), 8, b"\x5f\0\x2f\x0a", 51, chance.choice((51, 50)))],
    ))  # fmt: skip


def turns(chance: random.Random) -> list[bytes]:
    """The services of some masters and slaves, taking turns."""
    shapes = [(3, 51, 2), (4, 51, 2), (3, 51, 5), (3, 7, 2)]
    talks, frames = [Talk(*shape) for shape in shapes[: chance.randrange(1, 5)]], []
    for _ in range(chance.randrange(10, 40)):
        service(chance.choice(talks), chance)
        while any(talk.frames for talk in talks) and chance.random() < 0.97:
            talk = chance.choice(talks)
            frames += talk.frames[:2]
            del talk.frames[:2]
            frames += others(chance) if chance.random() < 0.1 else []
    return frames


def disturbed(frames: list[bytes], chance: random.Random) -> Iterator[bytes]:
    """The same with lost, doubled and damaged frames, and some that are there too early."""
    much = chance.choice((0, 0.01, 0.05))
    for at, frame in enumerate(frames):
        kind = chance.randrange(5) if chance.random() < 5 * much else None
        place = chance.randrange(len(frame))
        if kind == 0:
            continue
        if kind == 1:
            yield frame
        if kind == 2:
            yield frames[min(at + 1, len(frames) - 1)]
        if kind == 3:
            yield frame[:place] + bytes((chance.randrange(256),)) + frame[place + 1 :]
        else:
            yield frame[:place] if kind == 4 else frame


@cache
def by_chance() -> list[list[bytes]]:
    """Lines that make sense as far as nothing disturbs them, and the frames of each in any order."""
    lines = []
    for seed in SEEDS:
        chance = random.Random(seed)
        frames = list(disturbed(turns(chance), chance))
        lines += [frames, chance.choices(frames, k=200)]
    return lines


# Comparing


def lua_says(lua: str, lines: list[list[bytes]], cut: bool) -> list[list[dict[str, Any]]]:
    front = "cut\n" if cut else ""
    text = "".join(
        front + "".join(f"{frame.hex()}\n" for frame in frames) + "end\n" for frames in lines
    )
    result = subprocess.run(
        [lua_program(lua), str(DRIVER)], input=text.encode(), capture_output=True, check=False
    )
    assert result.returncode == 0, result.stderr.decode()
    told: list[list[dict[str, Any]]] = [[]]
    for line in result.stdout.decode().splitlines():
        told[-1].append(json.loads(line))
        if told[-1][-1]["event"] == "end":
            told.append([])
    assert told.pop() == []
    return told


def compare(lua: str, lines: list[list[bytes]], *, cut: bool = False) -> None:
    """`cut`: the recording did not keep the frames whole that end too early."""
    for number, (frames, told) in enumerate(zip(lines, lua_says(lua, lines, cut), strict=True)):
        expected = Ear().run(frames, cut)
        for one, other in zip(told, expected, strict=False):
            assert one == other, f"line {number}"
        assert len(told) == len(expected), f"line {number}"


@pytest.mark.parametrize("lua", LUAS)
def test_lines_by_hand(lua: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[list[bytes]] = []

    def listening(frames: Iterable[bytes], line: Line | None = None) -> list[Exchange]:
        lines.append(list(frames))
        return real(lines[-1], line)

    real = by_hand.exchanges
    monkeypatch.setattr(by_hand, "exchanges", listening)
    for name, test in vars(by_hand).items():
        plain = name.startswith("test_") and not hasattr(test, "hypothesis")
        if plain and not inspect.signature(test).parameters:
            test()
    assert len(lines) > 20
    compare(lua, lines)


@pytest.mark.parametrize("lua", LUAS)
def test_lines_of_printed_frames(lua: str) -> None:
    file = ROOT.parent / "shared" / "reference" / "channel_vectors.json"
    if not file.exists():
        pytest.skip("the reference is not here")
    vectors = json.loads(file.read_text("utf-8"))["vectors"]
    frames = [bytes.fromhex(each["hex"]) for each in vectors if each["channel"] == "profibus"]
    assert frames
    shuffled = [random.Random(seed).choices(frames, k=200) for seed in range(20)]
    compare(lua, [frames, *shuffled])


@pytest.mark.slow
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("lua", LUAS)
def test_lines_by_chance(lua: str, cut: bool) -> None:
    compare(lua, by_chance(), cut=cut)


def test_chance_leaves_nothing_out() -> None:
    told = [each for frames in by_chance() for each in Ear().run(frames)]
    events = Counter(each["event"] for each in told)
    assert min(
        events[name] for name in ("asked", "answered", "failed", "lost", "unasked", "closed")
    ) > 100  # fmt: skip
    for name in ("answer", "again", "silent", "unsure"):
        assert sum(bool(each.get(name)) for each in told) > 50, name
    jobs = [each for each in told if each["event"] == "closed"]
    for name in ("refused", "read_response", "polls", "superseded_by"):
        assert sum(bool(each[name]) for each in jobs) > 20, name
