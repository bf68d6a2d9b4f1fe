"""A line whose frames another stack made: pyprofibus as the master of a drive with PPO1 (captures/profibus).

What is expected is typed here, from the telegrams of the textbook and from the script of the slave. The program
that makes the frames runs in a process of its own; without pyprofibus the stored captures are read alone.
"""

from __future__ import annotations

import io
import json
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
import test_lua_analysis
import test_profibus
from lua_program import LUAS, lua_program
from test_lua_analysis import Source

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult
from ds47.profibus import PROFIBUS_DL, USER0, dp, telegram
from ds47.profibus.stream import split

FOLDER = Path(__file__).resolve().parents[2] / "captures/profibus"
CAPTURES = {"pyprofibus_ppo1": PROFIBUS_DL, "pyprofibus_ppo1_user0": USER0}
PROGRAM = Path(__file__).with_name("pyprofibus_master.py")
FRAMES = 206

START_UP = [
    ("SD1", None, True, ""), ("SD1", None, False, ""),
    ("SD2", "diagnosis", True, ""), ("SD3", "diagnosis", False, "020500ff80b5"),
    ("SD2", "parameters", True, "881e010080b501000000"), ("SC", None, None, ""),
    ("SD2", "configuration", True, "f3f1"), ("SC", None, None, ""),
    ("SD2", "diagnosis", True, ""), ("SD3", "diagnosis", False, "000c000280b5"),
]  # fmt: skip
"""Frames 1 to 10: kind, service, whether it is a request, data."""
TRANSACTIONS = [
    ("read", 700, 0, [2], (15, 22)),
    ("read", 2010, 1, [50.0], (31, 38)),
    ("read", 1082, 0, [50.0], (47, 54)),
    ("change", 1082, 0, [40.0], (59, 66)),
    ("read", 25, 0, [230.0], (75, 82)),
]
"""Of PKW: operation, parameter, subindex, values, the frames in which request and response begin."""
ANSWER_NS = 3 * 2_000_000 + 179_077
"""Three cycles, and what the request takes on the wire with the pause behind it."""
EVENTS = [
    (11, "first", None, 0x047E), (12, "first", None, 0xFB31),
    (107, "on", 0x047E, 0x047F), (108, "ready", 0xFB31, 0xFB37), (108, "running", 0xFB31, 0xFB37),
    (167, "off1", 0x047F, 0x047E), (192, "not-ready", 0xFB37, 0xFB31), (192, "stopped", 0xFB37, 0xFB31),
]  # fmt: skip
"""Of PZD: frame, name, the word before and after."""
SETPOINT = 0x3333


@cache
def stored(name: str) -> tuple[tuple[int, bytes], ...]:
    """Time and bytes of the frames of a capture."""
    with open_capture(FOLDER / f"{name}.pcapng") as capture:
        return tuple((each.time_ns, each.data) for each in capture)


def written(frames: list[tuple[int, bytes]], link_type: int = PROFIBUS_DL) -> bytes:
    target = io.BytesIO()
    with PcapngWriter(target, link_type=link_type) as writer:
        for each in frames:
            writer.write(*each)
    return target.getvalue()


def log() -> str:
    """What pyprofibus says here and now."""
    if find_spec("pyprofibus") is None:
        missing = pytest.fail if os.environ.get("DS47_CI") == "1" else pytest.skip
        missing("pyprofibus is missing")
    done = subprocess.run(
        [sys.executable, str(PROGRAM)], capture_output=True, check=True, text=True
    )
    assert done.stderr == ""
    return done.stdout


def transactions(result: CaptureResult) -> list[object]:
    found: list[object] = []
    for each in result.transactions:
        (one,) = each.parameters
        place = each.frames.write_request, each.frames.read_response
        assert (each.channel, each.device, each.state) == ("pkw", "dp3", "ok")
        found.append((each.operation, one.pnu, one.subindex, one.values, place))
    return found


def events(result: CaptureResult) -> list[object]:
    (timeline,) = result.timelines
    return [(each.frame, each.name, each.before, each.after) for each in timeline.events]


def test_what_pyprofibus_says_is_what_is_stored() -> None:
    with open_capture(io.BytesIO(log().encode())) as capture:
        live = [(each.time_ns, each.data) for each in capture]
    for name in CAPTURES:
        assert list(stored(name)) == live


@pytest.mark.parametrize("name", CAPTURES)
def test_the_start_up(name: str) -> None:
    told = []
    for _, data in stored(name)[: len(START_UP)]:
        item = telegram.decode(data)
        told.append((item.kind, dp.service(item), item.request, item.du.hex()))
    assert told == START_UP


@pytest.mark.parametrize("name", CAPTURES)
def test_all_other_frames_are_data_exchange(name: str) -> None:
    for number, (_, data) in enumerate(stored(name)[len(START_UP) :]):
        item = telegram.decode(data)
        assert (item.flaws, dp.service(item), len(item.du)) == ((), "exchange", 12)
        assert item.request == (number % 2 == 0)


@pytest.mark.parametrize("name", CAPTURES)
def test_the_line(name: str) -> None:
    with open_capture(FOLDER / f"{name}.pcapng") as capture:
        assert {each.link_type for each in capture} == {CAPTURES[name]}
    bus = analyze(FOLDER / f"{name}.pcapng").bus
    assert bus is not None
    assert (bus.frames, bus.tokens, bus.damaged, bus.stray) == (FRAMES, 0, 0, 0)
    master, drive = bus.stations
    assert (master.address, master.role, drive.address, drive.role) == (2, "master", 3, "slave")
    assert (drive.ident, drive.ppo, drive.watchdog_ms) == (0x80B5, 1, 300)
    # FDL_Status, Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag, and data exchange
    assert (drive.requests, drive.exchanges) == (5 + 98, 98)
    assert (drive.unanswered, drive.damaged, drive.retries) == (0, 0, 0)
    assert (drive.parameters, drive.configuration) == (5, 7)
    assert drive.cycle is not None
    assert (drive.cycle.least_ns, drive.cycle.most_ns) == (2_000_000, 2_000_000)


@pytest.mark.parametrize("name", CAPTURES)
def test_pkw_and_pzd(name: str) -> None:
    result = analyze(FOLDER / f"{name}.pcapng")
    assert transactions(result) == TRANSACTIONS
    assert {each.duration_ns for each in result.transactions} == {ANSWER_NS}
    assert events(result) == EVENTS
    assert result.findings == []
    assert [(each.channel, each.certainty, each.frame) for each in result.relations] == [
        ("pkw", "seen", 7), ("pzd", "seen", 7),
    ]  # fmt: skip
    (timeline,) = result.timelines
    assert max(each.most for each in timeline.setpoint) == SETPOINT
    assert max(each.most for each in timeline.actual) == SETPOINT


@pytest.mark.parametrize("lua", LUAS)
def test_lua_says_the_same(lua: str, tmp_path: Path) -> None:
    lua_program(lua)
    sources = [
        Source(name, (FOLDER / f"{name}.pcapng").read_bytes(), look=True) for name in CAPTURES
    ]
    test_lua_analysis.compare(lua.removeprefix("lua"), "en", sources, tmp_path)


# Damage


def damaged(place: int, chance: random.Random) -> tuple[int, list[tuple[int, bytes]]]:
    """The capture with another byte at this place of all of them; and the number of the frame, from 1."""
    frames = list(stored("pyprofibus_ppo1"))
    for number, (time_ns, data) in enumerate(frames):
        if place < len(data):
            wrong = bytes((data[place] ^ chance.randrange(1, 256),))
            frames[number] = time_ns, data[:place] + wrong + data[place + 1 :]
            return number + 1, frames
        place -= len(data)
    raise AssertionError("no such place")


def places() -> range:
    return range(sum(len(data) for _, data in stored("pyprofibus_ppo1")))


STEP = 11
"""From place to place of those that stand for all of them. It has no divisor in common with 42, the bytes of a
data exchange and its answer: so it comes by each byte of both, and by each frame once at least."""


def sampled() -> list[int]:
    """Every so-manieth place, the last one, and each byte of the frames in which something begins: the start-up,
    what PKW asks and answers, the events. An exchange that says the same again differs from them in its time.
    """
    special = {*range(1, len(START_UP) + 1), *(frame for each in TRANSACTIONS for frame in each[4])}
    special |= {event[0] for event in EVENTS}
    found, at = {*places()[::STEP], places()[-1]}, 0
    for number, (_, data) in enumerate(stored("pyprofibus_ppo1"), 1):
        if number in special:
            found |= {*range(at, at + len(data))}
        at += len(data)
    return sorted(found)


@pytest.mark.slow
def test_every_wrong_byte_is_noticed() -> None:
    """Exhaustive: each byte of each frame as each other one."""
    for data in {data for _, data in stored("pyprofibus_ppo1")}:
        for at in range(len(data)):
            for byte in set(range(256)) - {data[at]}:
                wrong = data[:at] + bytes((byte,)) + data[at + 1 :]
                if data != b"\xe5" or byte not in b"\xe5":
                    assert telegram.decode(wrong).flaws, (data.hex(), at, byte)


def check_damage(place: int, chance: random.Random) -> None:
    """A wrong byte costs its frame: an edge in it is seen a cycle later, and all else is as it was."""
    number, frames = damaged(place, chance)
    result = analyze(io.BytesIO(written(frames)))
    bus = result.bus
    assert bus is not None
    assert (bus.frames, bus.damaged, bus.stray) == (FRAMES, 1, int(is_asked(number))), number
    if number in (7, 8):  # without Chk_Cfg nothing is known of the data, and nothing is guessed
        assert (result.transactions, result.relations) == ([], [])
        return
    assert [each[:4] for each in transactions(result)] == [each[:4] for each in TRANSACTIONS]  # type: ignore[index]
    exchange = {number - (number + 1) % 2, number + number % 2}
    for found, expected in zip(transactions(result), TRANSACTIONS, strict=True):
        assert found == expected or exchange & set(expected[4]), number
    names = [(each[1], each[2], each[3]) for each in events(result)]  # type: ignore[index]
    assert names == [(each[1], each[2], each[3]) for each in EVENTS]
    for found, event in zip(events(result), EVENTS, strict=True):
        assert found == event or event[0] in exchange, number


def is_asked(number: int) -> bool:
    """Whether the frame with this number is a request: its answer belongs to nobody when it is damaged."""
    return number % 2 == 1


@pytest.mark.parametrize("seed", range(40))
def test_a_wrong_byte_costs_its_frame(seed: int) -> None:
    chance = random.Random(seed)
    check_damage(chance.choice(places()), chance)


@pytest.mark.slow
def test_a_wrong_byte_anywhere_costs_its_frame() -> None:
    chance = random.Random(257)
    for place in sampled():
        check_damage(place, chance)


def lost(data: bytes, place: int, byte: int) -> Iterator[bytes]:
    """The frames of a recording without borders that are not found when one byte is another one."""
    wrong = data[:place] + bytes((byte,)) + data[place + 1 :]
    found = {(each.offset, each.telegram.data) for each in split(wrong) if not each.telegram.flaws}
    at = 0
    for _, frame in stored("pyprofibus_ppo1"):
        if not at <= place < at + len(frame) and (at, frame) not in found:
            yield frame
        at += len(frame)


@pytest.mark.slow
def test_a_wrong_byte_without_borders_costs_its_frame() -> None:
    """The same frames as a serial port gives them: what begins and ends where is found again."""
    chance, data = random.Random(147), b"".join(each for _, each in stored("pyprofibus_ppo1"))
    for place in sampled():
        for byte in {data[place] ^ chance.randrange(1, 256), 0x68, 0xE5, 0x16} - {data[place]}:
            assert list(lost(data, place, byte)) == [], (place, byte)


@cache
def wrong_bits() -> dict[bytes, object]:
    """Each bit of each frame, turned, and what Python says of it."""
    frames = sorted({data for _, data in stored("pyprofibus_ppo1")}, key=bytes.hex)
    wrong = [
        data[:at] + bytes((data[at] ^ 1 << bit,)) + data[at + 1 :]
        for data in frames for at in range(len(data)) for bit in range(8)
    ]  # fmt: skip
    return {data: test_profibus.python_says(data) for data in wrong}


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_lua_notices_every_wrong_bit(lua: str) -> None:
    """Lua says what Python says, and that is that the frame is wrong."""
    wrong = wrong_bits()
    done = subprocess.run(
        [lua_program(lua), str(test_profibus.DRIVER)],
        input="".join(f"{each.hex()}\n" for each in wrong).encode(), capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    for (data, said), line in zip(wrong.items(), done.stdout.decode().splitlines(), strict=True):
        told = json.loads(line)
        assert told["flaws"], data.hex()
        assert all(told.pop(lang) for lang in test_profibus.LANGUAGES)
        assert told == said, data.hex()


@cache
def damaged_lines() -> list[Source]:
    """The same for each Lua, so that Python reads them once."""
    chance, sources = random.Random(47), []
    for _ in range(150):
        place = chance.choice(places())
        _, frames = damaged(place, chance)
        sources.append(Source(f"byte {place}", written(frames), look=False))
    return sources


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_lua_says_the_same_of_damaged_lines(lua: str, tmp_path: Path) -> None:
    lua_program(lua)
    sources = damaged_lines()
    test_lua_analysis.compare(lua.removeprefix("lua"), "en", sources, tmp_path)
