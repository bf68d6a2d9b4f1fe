"""Holes in a capture: what mirror ports, short captures and merged files make of a conversation.

A cut is a list of the frames that are left, in their order. Each keeps its number of the whole capture, so that
`holes` can ask the whole one whether what is said of the cut one is true.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from random import Random

from tests.audit import wire
from tests.audit.wire import Frame

Cut = list[Frame]
SECOND = 10**9
SNAP = 300
SNAPS = range(60, 341)
"""Where else frames are cut: before, in and behind each header, and among the values."""
LINES = (147, 257)
"""Link types of PROFIBUS."""


def every(step: int, start: int = 0) -> Callable[[Cut], Cut]:
    """Every so-manieth frame is lost."""
    return lambda frames: [each for at, each in enumerate(frames, 1) if (at - start) % step]


def servers(frames: Cut) -> set[bytes]:
    """The IP addresses to which Connects and record calls go, and S7."""
    return {
        packet[16:20] for each in frames
        if _asks(packet := wire.ip_packet(each)) or _is_to_s7(packet)
    }  # fmt: skip


def _is_to_s7(packet: bytes) -> bool:
    at = (packet[0] & 15) * 4 if packet[9:10] == b"\x06" else len(packet)
    return packet[at + 2 : at + 4] == (102).to_bytes(2, "big")


def _answers(frame: wire.Frame) -> bool:
    """Whether it is an answer on a line of PROFIBUS."""
    data = frame.data
    fc = {0x10: 3, 0x68: 6, 0xA2: 3}.get(data[0] if data else 0)
    return data[:1] == b"\xe5" or (fc is not None and len(data) > fc and not data[fc] & 0x40)


def _asks(packet: bytes) -> bool:
    if packet[9:10] != b"\x11":
        return False
    data = packet[(packet[0] & 15) * 4 + 8 :]
    if len(data) < 80 or data[:2] != b"\x04\x00":
        return False
    operation = int.from_bytes(data[68:70], "little" if data[4] >> 4 == 1 else "big")
    return operation in (wire.CONNECT, wire.READ, wire.WRITE, wire.IMPLICIT)


def to_devices(frames: Cut) -> Cut:
    """Nothing that a device sent."""
    if frames[0].link in LINES:
        return [each for each in frames if not _answers(each)]
    devices, macs = servers(frames), _macs(frames)
    return [
        each for each in frames
        if wire.ip_packet(each)[12:16] not in devices and wire.sender(each) not in macs
    ]  # fmt: skip


def from_devices(frames: Cut) -> Cut:
    """Nothing that was sent to a device."""
    if frames[0].link in LINES:
        return [each for each in frames if _answers(each)]
    devices, macs = servers(frames), _macs(frames)
    return [
        each for each in frames
        if wire.ip_packet(each)[16:20] not in devices
        and (wire.payload(each)[0] != wire.PROFINET or wire.sender(each) in macs)
    ]  # fmt: skip


def _macs(frames: Cut) -> set[bytes]:
    """The MAC addresses of devices: cyclic frames have no others."""
    devices = servers(frames)
    theirs = (wire.sender(each) for each in frames if wire.ip_packet(each)[12:16] in devices)
    return set(theirs) - {b""}


def without_middle(frames: Cut) -> Cut:
    """A hole in the middle."""
    return frames[: len(frames) // 3] + frames[len(frames) // 2 :]


def middle(frames: Cut) -> Cut:
    """Neither begin nor end."""
    return frames[len(frames) // 3 : 2 * len(frames) // 3]


def snapped(length: int) -> Callable[[Cut], Cut]:
    """No frame longer than a snap length."""
    return lambda frames: [replace(each, data=each.data[:length]) for each in frames]


def swapped(step: int) -> Callable[[Cut], Cut]:
    """Neighbours out of order, each with its own time; of those that were not in order the time would not tell."""

    def swap(frames: Cut) -> Cut:
        found = list(frames)
        for at in range(step, len(found), step):
            if found[at - 1].time_ns <= found[at].time_ns:
                found[at - 1], found[at] = found[at], found[at - 1]
        return found

    return swap


def moved(step: int, places: int) -> Callable[[Cut], Cut]:
    """Some frames stand several places behind their own, each with its own time."""

    def move(frames: Cut) -> Cut:
        found = list(frames)
        for at in range(len(found) - places - 1 - len(found) % step, 0, -step):
            found.insert(at + places, found.pop(at))
        return found

    return move


def clock_back(frames: Cut) -> Cut:
    """The clock of the capture is set back in the middle."""
    half = len(frames) // 2
    return frames[:half] + [
        replace(each, time_ns=each.time_ns - 5 * SECOND) for each in frames[half:]
    ]


def doubled(frames: Cut) -> Cut:
    """Seen at two ports and merged: each frame twice, the second 20 us later."""
    return [replace(each, time_ns=each.time_ns + late) for each in frames for late in (0, 20_000)]


def twice(frames: Cut) -> Cut:
    """Merged with itself a minute later."""
    late = frames[-1].time_ns - frames[0].time_ns + 90 * SECOND
    return frames + [replace(each, time_ns=each.time_ns + late) for each in frames]


def elsewhere(frames: Cut) -> Cut:
    """The same in another plant: the third byte of each IP address is another one, and the fourth of each MAC address.

    These also stand in what a Connect sets up.
    """
    found, macs = [], {wire.sender(each) for each in frames} - {b""}
    for each in frames:
        data, at = bytearray(each.data), len(each.data) - len(wire.ip_packet(each))
        for byte in (at + 14, at + 18):
            if byte < len(data):
                data[byte] ^= 1
        for mac in macs:
            data = data.replace(mac, mac[:3] + bytes((mac[3] ^ 1,)) + mac[4:])
        found.append(replace(each, data=bytes(data)))
    return found


def merged(one: Cut, two: Cut) -> Cut:
    """Two recordings as one: of the next frames always the earlier one."""
    first, second, found = list(reversed(one)), list(reversed(two)), Cut()
    while first and second:
        found.append((first if first[-1].time_ns <= second[-1].time_ns else second).pop())
    return found + first[::-1] + second[::-1]


ALL: dict[str, Callable[[Cut], Cut]] = {
    "every 5th lost": every(5),
    "every 11th lost": every(11),
    "every 17th lost": every(17, 5),
    "to devices": to_devices,
    "from devices": from_devices,
    "hole": without_middle,
    "middle": middle,
    "snapped": snapped(SNAP),
    "3rd swapped": swapped(3),
    "7th swapped": swapped(7),
    "clock back": clock_back,
    "doubled": doubled,
    "twice": twice,
}
"""What is made of a conversation, by its name."""
MOVED = {
    "5th moved by 2": moved(5, 2), "7th moved by 2": moved(7, 2), "7th moved by 3": moved(7, 3),
    "11th moved by 4": moved(11, 4),
}  # fmt: skip
"""Disorder by more than one place. Of what is so much out of order nothing is said that the times contradict."""
LONGER = ("twice",)
"""Of these the conversation goes on behind its end: of what is said there it is not the truth."""


def two(seed: int, names: Iterable[str] = ALL) -> list[str]:
    """Two kinds that stand behind each other, chosen by a seed; of "snapped" another length, too."""
    kinds = [*names] * 2
    start = seed % (len(kinds) // 2)
    found = kinds[start : start + 2]
    if "snapped" in found:
        found.append(snap(Random(f"snap {seed}").choice(SNAPS)))
    return found


def snap(length: int) -> str:
    """The name of a snap length."""
    return f"snapped {length}"


def _cut(name: str) -> Callable[[Cut], Cut]:
    kind, _, length = name.partition(" ")
    return snapped(int(length)) if kind == "snapped" and length else ALL[name]


def of(frames: Cut, names: Iterable[str] = ALL) -> Iterator[tuple[str, Cut]]:
    """Those that leave something and change something."""
    for name in names if frames else ():
        left = _cut(name)(frames)
        if left and left != frames:
            yield name, left


def write(path: Path, frames: Cut) -> None:
    """As a pcap file with nanoseconds."""
    parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, frames[0].link)]
    for each in frames:
        head = divmod(each.time_ns, SECOND)
        parts.append(struct.pack("<4I", *head, len(each.data), each.length) + each.data)
    path.write_bytes(b"".join(parts))
