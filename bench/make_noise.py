"""The benchmark's captures: cyclic PROFINET RT frames with transactions scattered among them.

Half of the RT frames carry a VLAN tag, as controllers send them. With --mixed they have many lengths
in no order, and every fourth frame is other traffic (TCP, UDP, ARP). The transactions come from the
lab. The plain pcap repeats one prepared second, in which only the time and the RPC frames change:
ten million frames take seconds. Same arguments, same bytes. A name that ends in .pcapng gives that format.
Needs the package.
"""

from __future__ import annotations

import argparse
import random
import struct
from collections.abc import Iterator
from pathlib import Path

from make_dense import QuickStage

from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import START_NS

FRAMES = 1_000_000
RPC_FRAMES_PER_TRANSACTION = 4
FRAMES_PER_TRANSACTION = 500
"""RT frames for each transaction: 2,000 transactions in a million."""
PERIOD_NS = 31_250
"""32 RT frames in a millisecond: 16 devices, both ways."""

RUN = FRAMES_PER_TRANSACTION // RPC_FRAMES_PER_TRANSACTION
"""RT frames in front of each RPC frame."""
SECOND = 1_000_000_000 // PERIOD_NS
"""RT frames in a second: a whole number of runs."""

RECORD = struct.Struct("<IIII")
PCAP_HEADER = struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262_144, 1)
MACS = bytes.fromhex("001ff8000001 001c06000001")
VLAN_TAG = bytes.fromhex("8100 c000")
RT_HEAD = bytes.fromhex("8892 8001") + bytes(range(40))
RT_STATUS = b"\x35\x00"


def transactions(count: int) -> list[bytes]:
    """The RPC frames of `count` reads of three parameters, in their order."""
    stage = QuickStage()
    client = Client(stage)
    addresses = [message.address(pnu) for pnu in (21, 27, 68)]
    for number in range(count):
        reference = number % 255 + 1
        values = [message.real(float(number + place)) for place in range(3)]
        request = message.read(reference, 1, *addresses)
        client.exchange(request, message.answer(reference, 1, 1, *values))
    return [shot.data for shot in stage.shots]


def rt_frames(count: int) -> Iterator[bytes]:
    """RT frames with a counting cycle, every second one with a VLAN tag."""
    heads = (MACS + RT_HEAD, MACS + VLAN_TAG + RT_HEAD)
    for number in range(count):
        yield heads[number & 1] + struct.pack(">H", number * 32 & 0xFFFF) + RT_STATUS


def plant_frames(count: int) -> Iterator[bytes]:
    """RT frames of 16 lengths in no order, with other traffic between."""
    chance = random.Random(47)
    lengths = [chance.randrange(40, 200) for _ in range(16)]
    heads = [
        (MACS + VLAN_TAG if number & 1 else MACS) + RT_HEAD[:4] + bytes(length)
        for number, length in enumerate(lengths)
    ]
    others = [MACS + bytes.fromhex("0806") + bytes(46)]
    for protocol in (6, 6, 17, 1):  # TCP, UDP, ICMP
        length = chance.randrange(60, 1400)
        head = struct.pack(">HBBHHHBBH", 0x0800, 0x45, 0, 20 + length, 1, 0, 64, protocol, 0)
        others.append(MACS + head + bytes([10, 0, 0, 1, 10, 0, 0, 2]) + bytes(length))
    for number in range(count):
        if number & 3 == 3:
            yield chance.choice(others)
        else:
            yield chance.choice(heads) + struct.pack(">H", number * 32 & 0xFFFF) + RT_STATUS


class Seconds:
    """RT frames as pcap records, a second at a time, in runs between which an RPC frame has its place."""

    def __init__(self) -> None:
        self._runs = [bytearray() for _ in range(SECOND // RUN)]
        self._places: list[list[slice]] = []
        for number, data in enumerate(rt_frames(SECOND)):
            record = RECORD.pack(0, number * PERIOD_NS, len(data), len(data))
            self._runs[number // RUN] += record + data
        for run in self._runs:
            sizes = [RECORD.size + run[at] for at in (8, 8 + RECORD.size + run[8])]
            self._places.append([slice(at, None, sum(sizes)) for at in (0, sizes[0])])

    def runs(self, second: int) -> Iterator[tuple[int, bytes]]:
        """The runs of a second, and the nanosecond that follows each."""
        now = second.to_bytes(4, "little")
        for number, (run, places) in enumerate(zip(self._runs, self._places, strict=True), start=1):
            for place in places:
                count = len(range(*place.indices(len(run))))
                for at, value in enumerate(now):
                    run[place.start + at :: place.step] = bytes((value,)) * count
            yield number * RUN * PERIOD_NS - PERIOD_NS // 2, bytes(run)


def repeated(frames: int) -> Iterator[bytes]:
    """The records of so many RT frames (in whole runs), with the RPC frames spread evenly among them."""
    calls = transactions(frames // FRAMES_PER_TRANSACTION)
    seconds, start = Seconds(), START_NS // 1_000_000_000
    for number, call in enumerate(calls):
        second, place = divmod(number, SECOND // RUN)
        if not place:
            runs = seconds.runs(start + second)
        after, run = next(runs)
        yield run
        yield RECORD.pack(start + second, after, len(call), len(call)) + call


def mixed(frames: int, cyclic: Iterator[bytes]) -> Iterator[bytes]:
    """Cyclic frames with the RPC frames spread evenly among them."""
    calls = iter(transactions(frames // FRAMES_PER_TRANSACTION))
    every = FRAMES_PER_TRANSACTION // RPC_FRAMES_PER_TRANSACTION
    for number, frame in enumerate(cyclic, start=1):
        yield frame
        if number % every == 0:
            call = next(calls, None)
            if call is not None:
                yield call


def write(path: Path, frames: int = FRAMES, many_lengths: bool = False) -> int:
    """Write a capture; the number of its frames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".pcap" and not many_lengths:
        with path.open("wb") as file:
            file.write(PCAP_HEADER)
            file.writelines(repeated(frames))
        return frames + frames // RUN
    traffic = mixed(frames, (plant_frames if many_lengths else rt_frames)(frames))
    written = 0
    if path.suffix == ".pcapng":
        with PcapngWriter(path) as capture:
            for written, data in enumerate(traffic, start=1):
                capture.write(START_NS + written * PERIOD_NS, data)
        return written
    with path.open("wb") as file:
        file.write(PCAP_HEADER)
        for written, data in enumerate(traffic, start=1):
            seconds, rest = divmod(START_NS + written * PERIOD_NS, 1_000_000_000)
            file.write(RECORD.pack(seconds, rest, len(data), len(data)) + data)
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--frames", type=int, default=FRAMES, help="RT frames")
    parser.add_argument("--mixed", action="store_true", help="many lengths, other traffic")
    arguments = parser.parse_args()
    written = write(arguments.path, arguments.frames, arguments.mixed)
    print(f"{arguments.path}: {written} frames")


if __name__ == "__main__":
    main()
