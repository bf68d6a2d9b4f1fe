"""What the capture lacks, in Lua: the scenes of `test_completeness`, and whatever is heard and asked by chance."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Callable, Iterator
from copy import copy
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program
from talk import pdus
from test_completeness import ASK, SCENES, WHOLE, played
from test_lua_analysis import Source, compare

from ds47.profinet.completeness import Completeness, Missing, Numbers
from ds47.profinet.records import Peer
from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import RPC_CONNECT, RPC_READ, RPC_WRITE

DRIVER = Path(__file__).resolve().parents[1] / "lua/completeness.lua"
HEARD = ("add",) * 9 + (
    "began",
    "began",
    "heard",
    "unasked",
    "cut",
    "late",
    "disordered",
    "lost",
)
ASKED = ("behind", "behind", "behind", "spoke", "fills", "has", "holes")


def test_scenes_give_the_same_result(tmp_path: Path) -> None:
    scenes = [(play, frames) for play, frames, *_ in SCENES] + [(play, ()) for play, *_ in WHOLE]
    sources = [
        Source(f"{number}: {play.__name__} {frames}", played(play, *frames), False)
        for number, (play, frames) in enumerate(scenes)
    ]
    compare("5.4", "en", sources, tmp_path)


def lines(seed: int) -> Iterator[str]:
    """What is heard, and asked in between, of few stations and numbers; now and then with long gaps."""
    chance = random.Random(seed)
    stations, longest = chance.choice((2, 3)), chance.choice((1, 1, 2, 80))
    few = [each for each in dict.fromkeys(HEARD) if chance.random() < 0.7]
    yield f"new most={chance.choice((1, 2, 8))}"
    numbers = [chance.randrange(5, 20) for _ in range(chance.choice((1, 2, 2, 8)))]
    halves = [(0, 0, 1)]
    for activity, number in enumerate(numbers):
        yield f"add activity={activity} seq={number} frame=1 time=1"
    for frame in range(2, chance.choice((20, 60, 200))):
        what = chance.choice(HEARD)
        if what not in few and what != "add":
            continue
        activity = chance.randrange(len(numbers))
        client, server = chance.sample(range(stations), 2)
        steps = (1, 1, 1, 2, chance.randrange(-6, 7), longest * chance.randrange(9))
        if longest > 2 and chance.random() < 0.1:
            steps = (257, 258)  # holes that may be filled, and that may not
        numbers[activity] = max(0, numbers[activity] + chance.choice(steps))
        seen = frame
        if what == "late":
            seen, client, server = chance.choice(halves)
        elif what in ("unasked", "cut"):
            halves.append((frame, client, server))
        opnum = chance.choice((RPC_CONNECT, RPC_READ, RPC_WRITE))
        place = f"activity={activity} client={client} server={server}"
        told = f"seq={numbers[activity]} opnum={opnum} ptype={chance.choice((2, 2, 3))}"
        time = max(0, frame + chance.choice((0, 0, 0, -5)))
        yield f"{what} {place} {told} frame={seen} time={time} renewed={chance.randrange(2)}"
        for asked in chance.sample(ASKED, chance.choice((0, 1, 3))):
            since = chance.choice((0, frame, chance.randrange(frame)))
            number = max(0, numbers[activity] - chance.randrange(9))
            yield f"{asked} {place} seq={number} frame={since} renewed={chance.randrange(2)}"


def many(seed: int) -> Iterator[str]:
    """More holes than are kept, of which some are filled; more activities, of which one is heard."""
    chance, place = random.Random(seed), "client=1 server=2"
    yield "new most=8"
    number = 0
    for frame in range(1, 300):
        number += chance.choice((2, 2, 2, 1))
        old = max(0, number - chance.randrange(170))
        seq = old if chance.random() < 0.05 else number
        yield f"add activity=0 seq={seq} frame={frame} time={1000 - frame} renewed=0"
        yield "holes activity=0 frame=0"
    for seq in range(number - 170, number):  # all but the oldest ones, which are as one
        yield f"add activity=0 seq={seq} frame=299 time=1 renewed=0"
        yield "holes activity=0 frame=0"
    heard = chance.choice((0, 1, 65))
    for activity in range(66):
        yield f"add activity={activity + 1} seq=5 frame={300 + activity} time={900 - activity} renewed=0"
        yield f"began activity={activity + 1} {place} frame={300 + activity}"
        if activity == heard:
            yield f"heard activity={activity + 1} frame=0"
        yield f"spoke activity=1 {place} frame=0"
        yield f"behind activity=1 {place} frame={300 + activity} renewed=0"
    yield from (f"cut activity=1 {place} frame={frame}" for frame in range(400, 470))
    for frame in range(469, 399, -1):  # the newest ones are kept, and the oldest one
        yield f"late activity=1 {place} frame={frame}"
        yield f"behind activity=1 {place} frame=401 renewed=0"


def told(found: Missing | None) -> str:
    if found is None:
        return "nothing"
    return " ".join(str(each) if each else "-" for each in found)


class Python:
    """Hears and answers as the program in Lua does."""

    def __init__(self) -> None:
        (self.pdu,) = pdus(lambda client: client.ask_write(ASK))
        self.found = Completeness(1)
        self.activities: dict[int, Numbers] = {}

    def say(self, line: str) -> str | None:
        """One line; the answer, where it asks."""
        what, *words = line.split()
        said = {name: int(value) for name, _, value in (each.partition("=") for each in words)}
        if what == "new":
            self.found, self.activities = Completeness(said["most"]), {}
            return None
        pdu = copy(self.pdu)
        pdu.client, pdu.server = str(said.get("client")), str(said.get("server"))
        pdu.seq, pdu.frame, pdu.time_ns = said.get("seq", 0), said["frame"], said.get("time", 0)
        pdu.opnum, pdu.ptype = said.get("opnum", 0), said.get("ptype", 0)
        return self.take(what, pdu, said["activity"], bool(said.get("renewed")))

    def take(self, what: str, pdu: Pdu, number: int, flag: bool) -> str | None:
        """A message, and what became of it."""
        found, pair = self.found, (pdu.client, pdu.server)
        activity = self.activities.setdefault(number, Numbers(pdu))
        hears: dict[str, Callable[[], None]] = {
            "add": lambda: activity.add(pdu, renewed=flag),
            "began": lambda: found.began(pdu, activity),
            "heard": lambda: setattr(activity, "waited", 1),
            "unasked": lambda: found.unasked(pdu), "cut": lambda: found.cut(pdu),
            "late": lambda: found.asked_after_all(pdu), "disordered": lambda: found.disordered(pdu),
            "lost": lambda: found.lost(pdu, went_on=False),
        }  # fmt: skip
        if what in hears:
            return hears[what]()
        if what == "behind":
            return told(found.missing_after(Peer(*pair), pdu.frame, ordered=flag))
        if what == "has":
            return str(activity.has(pdu.seq)).lower()
        if what == "holes":
            holes = (f"{e.after}-{e.before} {e.first}..{e.last}" for e in activity.holes)
            return ", ".join(holes)
        if what == "fills":
            return str(activity.fills(pdu.seq)).lower()
        asked = found.spoke_ns(*pair)
        return "nil" if asked is None else str(asked)


@pytest.mark.parametrize("lua", LUAS)
def test_what_is_heard_by_chance_lacks_the_same(lua: str) -> None:
    said = [line for seed in range(150) for line in lines(seed)]
    said += [line for seed in range(8) for line in many(seed)]
    python = Python()
    answers = [(line, answer) for line in said if (answer := python.say(line)) is not None]
    command = [lua_program(lua), str(DRIVER)]
    text = "\n".join(said) + "\n"
    done = subprocess.run(
        command, input=text, capture_output=True, encoding="utf-8", check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    for (line, answer), other in zip(answers, done.stdout.splitlines(), strict=True):
        assert other == answer, line
    kinds = {answer.split()[0] for line, answer in answers if line.startswith("behind")}
    assert kinds == {"calls", "requests", "halves", "renewed", "one_direction", "nothing"}
