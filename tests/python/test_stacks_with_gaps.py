"""Captures of real stacks, damaged as users' captures are, say nothing that the whole ones do not say.

The whole capture is the truth: its findings were compared with what the clients logged (test_real_stacks.py,
test_lossy_stacks.py). A damaged one may know less, and say so. It must not charge a frame with what the whole one
does not charge it with, nor end a transaction otherwise.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from ds47.analysis import analyze
from ds47.capture import Frame, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
NAMES = (
    "real-stacks/o1_profinetpy062_be", "real-stacks/o2_pyprofinet_le", "real-stacks/o3_two_controllers",
    "lossy-stacks/l1_replay.device", "lossy-stacks/l3_once", "lossy-stacks/l4_harsh",
    "lossy-stacks/lossy_nodes7", "lossy-stacks/s7connector",
)  # fmt: skip
OF_THE_CAPTURE = {
    "DS101", "DS102", "DS105", "DS106", "DS107", "DS108", "DS110", "DS111", "DS209", "DS403", "DS725", "DS915",
}  # fmt: skip
"""What says that something is missing, cut or out of order."""
COLLECTED = {"DS701", "DS704", "DS710", "DS717", "DS721", "DS904", "DS906"}
"""Findings of many frames: the first one moves when some are missing."""
DOUBLED = {"DS702", "DS704"}
"""If the wire doubles calls, and the device executes both, the second response may be the only one there."""
AGAIN = "DS410"
"""What was read twice is charged with its errors where it was read first: that may be missing."""

KNOWN = {("lossy-stacks/l1_replay.device", "one in five lost", 5)}
"""A Write is repeated behind its Read. Its first copy and the record are missing: it counts as superseded."""

Damage = Callable[[list[Frame], random.Random], list[Frame]]


def _sender(frame: Frame) -> bytes:
    """The IPv4 address that sent a frame; empty for none."""
    data = frame.data
    at = 14 + 4 * (data[12:14] == b"\x81\x00")
    return data[at + 12 : at + 16] if data[at - 2 : at] == b"\x08\x00" else b""


def _some_sender(frames: list[Frame], chance: random.Random) -> bytes:
    return chance.choice(sorted({_sender(frame) for frame in frames} - {b""}))


def _lossy(share: float) -> Damage:
    return lambda frames, chance: [frame for frame in frames if chance.random() > share]


def _bursts(frames: list[Frame], chance: random.Random) -> list[Frame]:
    left, skip = [], 0
    for frame in frames:
        skip = skip - 1 if skip else chance.randint(2, 40) * (chance.random() < 0.01)
        if not skip:
            left.append(frame)
    return left


def _each_nth(frames: list[Frame], chance: random.Random) -> list[Frame]:
    n = chance.randint(3, 12)
    first = chance.randrange(n)
    return [frame for number, frame in enumerate(frames) if number % n != first]


def _one_direction(frames: list[Frame], chance: random.Random) -> list[Frame]:
    lost = _some_sender(frames, chance)
    return [frame for frame in frames if _sender(frame) != lost]


def _lossy_direction(frames: list[Frame], chance: random.Random) -> list[Frame]:
    lossy, share = _some_sender(frames, chance), chance.choice((0.05, 0.2, 0.5))
    return [frame for frame in frames if _sender(frame) != lossy or chance.random() > share]


def _snapped(frames: list[Frame], chance: random.Random) -> list[Frame]:
    length = chance.choice((60, 64, 96, 128, 150, 180, 200, 256))
    return [
        Frame(f.number, f.time_ns, f.link_type, f.data[:length], f.original_length) for f in frames
    ]


def _middle(frames: list[Frame], chance: random.Random) -> list[Frame]:
    first, last = sorted(chance.sample(range(len(frames)), 2))
    return frames[first : last + 1]


def _twice(frames: list[Frame], chance: random.Random) -> list[Frame]:
    later = chance.choice((0, 1_000, 20_000, 500_000))
    copies = [
        Frame(f.number, f.time_ns + later, f.link_type, f.data, f.original_length) for f in frames
    ]
    return sorted([*frames, *copies], key=lambda frame: frame.time_ns)


def _swapped(frames: list[Frame], chance: random.Random) -> list[Frame]:
    left = list(frames)
    for at in range(1, len(left), 2):
        if chance.random() < 0.1:
            left[at - 1 : at + 1] = reversed(left[at - 1 : at + 1])
    return left


DAMAGES: dict[str, Damage] = {
    "one in a hundred lost": _lossy(0.01), "one in twenty lost": _lossy(0.05), "one in five lost": _lossy(0.2),
    "bursts lost": _bursts, "each nth lost": _each_nth, "one direction": _one_direction,
    "one direction loses": _lossy_direction, "cut": _snapped, "a part": _middle, "each frame twice": _twice,
    "swapped": _swapped,
}  # fmt: skip


class Whole(NamedTuple):
    """A whole capture: its frames, what was found, and for each number the first frame with the same datagram."""

    frames: list[Frame]
    result: CaptureResult
    first: dict[int, int]

    def charged(self) -> set[tuple[str, int | None]]:
        """Rule and frame of each finding; no frame for those of many."""
        found = self.result.findings
        return {(each.rule, self.first[each.frame]) for each in found} | {
            (each.rule, None) for each in found if each.rule in COLLECTED
        }

    def states(self) -> dict[int, str]:
        """The frame of each request, and how its transaction ended."""
        asked = {each.frames.write_request: each.state for each in self.result.transactions}
        return {self.first[frame]: state for frame, state in asked.items() if frame}


@cache
def whole(name: str) -> Whole:
    path, first, seen = CAPTURES / f"{name}.pcapng", dict[int, int](), dict[bytes, int]()
    with open_capture(path) as capture:
        frames = [
            Frame(f.number, f.time_ns, f.link_type, bytes(f.data), f.original_length)
            for f in capture.everything()
        ]
    for frame in frames:
        sender = _sender(frame)
        datagram = frame.data[frame.data.index(sender, 14) :] if sender else frame.data
        first[frame.number] = seen.setdefault(datagram, frame.number)
    return Whole(frames, analyze(path), first)


def charges(name: str, kind: str, seed: int, tmp_path: Path) -> list[tuple[str, int]]:
    """What a damaged capture says and the whole one does not: rule or state, and frame of the whole one."""
    frames, _, first = truth = whole(name)
    damaged = DAMAGES[kind](frames, random.Random(f"{name} {kind} {seed}"))
    path = tmp_path / "damaged.pcapng"
    with PcapngWriter(path) as writer:
        for frame in damaged:
            writer.write(frame.time_ns, frame.data, frame.original_length)
    result, charged, states = analyze(path), truth.charged(), truth.states()
    found = [(each.rule, first[damaged[each.frame - 1].number]) for each in result.findings]
    found = [
        each for each in found
        if each[0] not in OF_THE_CAPTURE and each not in charged and (each[0], None) not in charged
    ]  # fmt: skip
    for each in result.transactions:
        asked = each.frames.write_request
        ended = states.get(first[damaged[asked - 1].number]) if asked else None
        if ended not in (None, each.state, "incomplete") and each.state != "incomplete":
            found.append((each.state, first[damaged[asked - 1].number]))  # type: ignore[operator]
    excused = {AGAIN, *DOUBLED} if "l3" in name or "l4" in name else {AGAIN}
    return [each for each in found if each[0] not in excused]


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_capture_charges_nobody_anew(name: str, kind: str, tmp_path: Path) -> None:
    assert charges(name, kind, 0, tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("name", NAMES)
def test_nor_does_any_of_many(name: str, kind: str, tmp_path: Path) -> None:
    seeds = [seed for seed in range(1, 9) if (name, kind, seed) not in KNOWN]
    assert {seed: charges(name, kind, seed, tmp_path) for seed in seeds} == {
        seed: [] for seed in seeds
    }
