"""The plugin's short way of usual frames (ds47_ws/glance.lua): it says what the analysis says.

Every frame is given to two trackers in plain Lua: one that takes what it can at a glance, and one that analyses
each frame. Texts, findings and the result in the end are compared. Captures as they are; a plant of usual
transactions; and both broken by chance (seeded).
"""

from __future__ import annotations

import json
import random
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal
from uuid import UUID

import pytest
from lua_program import LUAS, lua_program
from plant import frames_of, plant

from ds47.capture.scan import ETHERNET, IPV4, network_layer
from ds47.lab import message
from ds47.lab.client import Client, drive
from ds47.lab.stage import Stage
from ds47.lab.wire import Channel

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests/lua/glance.lua"
SHARED = ROOT.parent / "shared" / "captures"
BROKEN = 80
"""Broken captures for each Lua version, other ones for each."""
CLICKS = 0.02
"""How many frames somebody clicks on while the file is read;"""
CLICKS_AT_MOST = 10
"""and how many of a capture: each takes as long as all that is open is large."""

RPC = 14 + 20 + 8
"""Where RPC begins in a frame of the lab."""
LENGTHS: dict[str, tuple[int, int, Literal["big"] | None]] = {
    "IP": (16, 2, "big"), "UDP": (38, 2, "big"), "RPC": (RPC + 74, 2, None),
    "record": (RPC + 80 + 20 + 36, 4, "big"),
}  # fmt: skip
"""Where such a frame says how long it is: the place, how many bytes, and their order if it is always the same."""

Shots = list[tuple[int, bytes]]


def stored() -> Iterator[tuple[str, Shots]]:
    for folder in (ROOT / "captures", SHARED):
        for path in sorted(folder.rglob("*.pcap*")):
            yield path.name, [(frame.time_ns, frame.data) for frame in frames_of(path)]


def lines(
    name: str,
    shots: Shots,
    chance: random.Random,
    most: int = 8192,
    clicks: float = CLICKS,
    **options: Any,
) -> Iterator[str]:
    """A capture as the Lua program takes it: its IPv4 frames."""
    yield json.dumps({"kind": "begin", "name": name, "options": options, "most": most})
    clicks = min(clicks, CLICKS_AT_MOST / max(1, len(shots)))
    for time_ns, data in shots:
        kind, offset = network_layer(data, 0, len(data), ETHERNET)
        if kind == IPV4:
            seconds, nanoseconds = divmod(time_ns, 10**9)
            frame = {"seconds": seconds, "nanoseconds": nanoseconds, "offset": offset}
            look = chance.random() < clicks
            yield json.dumps({"kind": "frame", **frame, "data": data.hex(), "look": look})
    yield json.dumps({"kind": "end"})


def run(lua: str, said: Iterable[str], folder: Path) -> list[dict[str, Any]]:
    """What the Lua program says of each capture; there are no differences."""
    path = folder / "frames.jsonl"
    path.write_text("\n".join(said) + "\n", encoding="utf-8")
    done = subprocess.run(
        [lua_program(lua), DRIVER, path], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    wrong = {each["name"]: each["differences"][:3] for each in told if each["differences"]}
    assert not wrong, json.dumps(wrong, indent=1)[:8000]
    return told


def broken(shots: Shots, chance: random.Random) -> Shots:
    """Some frames lost, doubled, swapped, cut, changed or delayed; few of them, or many."""
    made: Shots = []
    mercy = chance.choice((1, 4, 20))
    for time_ns, data in shots:
        fate = chance.random() * mercy
        if fate < 0.03:
            continue
        if fate < 0.06:
            made.append((time_ns, data))
        elif fate < 0.09 and made:
            (time_ns, data), made[-1] = made[-1], (made[-1][0], data)
        elif fate < 0.11:
            data = data[: chance.randrange(20, len(data))]
        elif fate < 0.16:
            place = chance.randrange(14, len(data))
            data = data[:place] + bytes([chance.randrange(256)]) + data[place + 1 :]
        elif fate < 0.18:
            time_ns += chance.randrange(-(10**9), 10**11)
        made.append((time_ns, data))
    return made


@pytest.mark.parametrize("lua", LUAS)
def test_stored_captures(lua: str, tmp_path: Path) -> None:
    chance = random.Random(47)
    said = [line for name, shots in stored() for line in lines(name, shots, chance)]
    together = sorted(shot for _, shots in stored() if len(shots) < 5000 for shot in shots)
    told = run(lua, [*said, *lines("all at once", together, chance)], tmp_path)
    assert len(told) > 50


@pytest.mark.parametrize("lua", LUAS)
@pytest.mark.parametrize(
    "options",
    [{}, {"lang": "zh", "slow_ms": 0.5}, {"ignore": ["DS4"], "codec": {"profile_v3_types": True}}],
)
def test_a_plant(lua: str, options: dict[str, Any], tmp_path: Path) -> None:
    told = run(lua, lines("plant", plant(120), random.Random(1), **options), tmp_path)
    assert told[0]["glanced"] > 0.6 * told[0]["frames"], "or nothing is tested here"


def test_little_memory(tmp_path: Path) -> None:
    """What is forgotten is learnt again."""
    shots = plant(60, devices=4)
    told = run("lua5.4", lines("plant", shots, random.Random(1), most=40), tmp_path)
    assert 0 < told[0]["glanced"] < told[0]["frames"] / 2
    told = run("lua5.4", lines("plant", shots, random.Random(1), most=0), tmp_path)
    assert told[0]["glanced"] == 0


@pytest.mark.parametrize("lua", LUAS)
def test_a_clock_that_is_set_by_decades(lua: str, tmp_path: Path) -> None:
    """Nothing is told at a glance where a double does not hold the time."""
    shots = plant(60)
    half = len(shots) // 2
    moved = [
        (time + 2**60 * (half <= at < half + 99), data) for at, (time, data) in enumerate(shots)
    ]
    told = run(lua, lines("decades", moved, random.Random(1)), tmp_path)
    assert 0.3 * len(shots) < told[0]["glanced"] < len(shots) - 99


def reads(counts: Sequence[int]) -> Shots:
    """One conversation: reads of so many parameters each; of the last one of them fails."""
    stage = Stage()
    client = Client(
        stage, device=drive(1), activity=UUID(int=4711 << 64), channel=Channel(UUID(int=47 << 64), index=47)
    )  # fmt: skip
    for number, count in enumerate(counts, 1):
        reference = (number - 1) % 255 + 1
        request = message.read(
            reference, 1, *[message.address(2 + place) for place in range(count)]
        )
        call = client.ask_write(request)
        client.accept_write(call, request)
        call = client.ask_read()
        failed, values = number == len(counts), [message.word(number) for number in range(count)]
        if failed:
            values[-1] = message.error(0x11)
        client.accept_read(call, message.answer(reference, 0x81 if failed else 1, 1, *values))
    return [(shot.time_ns, shot.data) for shot in stage.shots]


@pytest.mark.parametrize("lua", LUAS)
def test_frames_of_another_length(lua: str, tmp_path: Path) -> None:
    """Only the first transaction is analysed: what follows differs from it in lengths."""
    told = run(lua, lines("lengths", reads(range(1, 31)), random.Random(2)), tmp_path)
    assert told[0]["glanced"] == told[0]["frames"] - 4


def test_many_lengths_again_and_again(tmp_path: Path) -> None:
    """More of them than are kept side by side, in little memory."""
    chance = random.Random(4)
    shots = reads([chance.randrange(1, 31) for _ in range(300)])
    told = run("lua5.4", lines("lengths", shots, chance, most=100), tmp_path)
    assert told[0]["glanced"] == told[0]["frames"] - 4


@pytest.mark.parametrize("lua", LUAS)
def test_many_that_wait(lua: str, tmp_path: Path) -> None:
    """Nobody clicks before the end: more wait than are put away side by side."""
    shots = reads([1 + number % 3 for number in range(1300)])
    assert len(shots) > 128 * 32 + 128
    told = run(lua, lines("waiting", shots, random.Random(5), clicks=0), tmp_path)
    assert told[0]["glanced"] > len(shots) - 10


def wrong_ends(data: bytes) -> Iterator[tuple[str, bytes]]:
    """A frame with one length that is not its own, cut, with more behind it, or with a status."""
    little = data[RPC + 4] == 0x10
    for name, (place, size, order) in LENGTHS.items():
        byteorder = order or ("little" if little else "big")
        length = int.from_bytes(data[place : place + size], byteorder)
        for more in (-64, -1, 1, 8, 256):
            wrong = ((length + more) % 256**size).to_bytes(size, byteorder)
            yield f"{name} {more}", data[:place] + wrong + data[place + size :]
    for cut in (1, 3, 40):
        yield f"cut {cut}", data[:-cut]
    yield "padded", data + bytes(7)
    status = (0xDE80B500).to_bytes(4, "little" if little else "big")
    yield "status", data[: RPC + 80] + status + data[RPC + 84 :]


@pytest.mark.parametrize("lua", LUAS)
def test_ends_that_do_not_agree(lua: str, tmp_path: Path) -> None:
    """In each frame of the third transaction, whose lengths are new."""
    said: list[str] = []
    shots = reads(range(1, 6))
    for frame in range(8, 12):
        time_ns, data = shots[frame]
        for name, wrong in wrong_ends(data):
            made = [*shots[:frame], (time_ns, wrong), *shots[frame + 1 :]]
            said += lines(f"{frame} {name}", made, random.Random(3))
    told = run(lua, said, tmp_path)
    assert all(each["glanced"] > 0 for each in told)


@pytest.mark.parametrize("lua", LUAS)
def test_broken_captures(lua: str, tmp_path: Path) -> None:
    chance = random.Random(lua)
    captures = [shots for _, shots in stored() if len(shots) > 3]
    said: list[str] = []
    for number in range(BROKEN):
        shots = plant(40, devices=chance.randrange(1, 4), seed=chance.randrange(99))
        if number % 3 == 0:
            shots = sorted([*shots, *chance.choice(captures)])
        said += lines(f"broken {number}", broken(shots, chance), chance)
    told = run(lua, said, tmp_path)
    assert sum(each["glanced"] for each in told) > 2000, "or nothing is tested here"
