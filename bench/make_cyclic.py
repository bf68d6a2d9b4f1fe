"""A capture of cyclic frames with a parameter channel in them: what finding it costs.

    python bench/make_cyclic.py FILE [FRAMES] [--no-connect]

One drive with telegram 353: 200 requests by PKW are spread over the capture, and the drive is started and stopped
eight times, which are 50 events. Setpoint, actual value and the counter move in every cycle. Without the Connect
the same frames have no relation that is known.
"""

from __future__ import annotations

import argparse
import struct
from pathlib import Path

from ds47.lab import wire
from ds47.lab.client import Client
from ds47.lab.cyclic import INPUT, OUTPUT, PKW, PZD, Cyclic
from ds47.lab.stage import Stage

REQUESTS = 200
STARTS = 8
CYCLE_NS = 4_000_000
IDLE = bytes(8)


def records(frames: int, connect: bool) -> list[bytes]:
    """The records of a pcap file with nanoseconds."""
    stage = Stage()
    line = Cyclic(Client(stage))
    line.connect()
    found = [record(shot.time_ns, shot.data) for shot in stage.shots] if connect else []
    heads = {
        OUTPUT: wire.mac_bytes(line.client.device) + wire.mac_bytes(line.client.host) + b"\x88\x92\x80\x02",
        INPUT: wire.mac_bytes(line.client.host) + wire.mac_bytes(line.client.device) + b"\x88\x92\x80\x01",
    }  # fmt: skip
    cycles = frames // 2
    every = max(1, cycles // REQUESTS)
    for cycle in range(cycles):
        place, number = cycle % every, cycle // every
        asked = place >= every // 4 and number < REQUESTS
        told = asked and place >= every // 4 + 3
        pke = struct.pack(">HHHH", 0x1000 | 700 + number, 0, 0, 0) if asked else IDLE
        answer = struct.pack(">HHI", 0x1000 | 700 + number, 0, number) if told else IDLE
        now, ticks = (
            stage.now_ns + cycle * CYCLE_NS,
            struct.pack(">HBB", cycle * 128 & 0xFFFF, 0x35, 0),
        )
        stw1, zsw1 = operation(cycle, max(4, cycles // STARTS))
        setpoint = struct.pack(">HH", stw1, cycle & 0x3FFF)
        actual = struct.pack(">HH", zsw1, cycle + 7 & 0x3FFF)
        for kind, words, values in ((OUTPUT, pke, setpoint), (INPUT, answer, actual)):
            data = (words + b"\x80" + values + b"\x80").ljust(line.length, b"\x80")
            found.append(record(now + kind * 10_000, heads[kind] + data + ticks))
    return found


def operation(cycle: int, every: int) -> tuple[int, int]:
    """Control and status word of a drive that runs in the middle of each period."""
    place = cycle % every
    on = every // 4 <= place < 3 * every // 4 and cycle // every < STARTS
    runs = every // 4 + 1 <= place < 3 * every // 4 + 1 and cycle // every < STARTS
    return 0x047F if on else 0x047E, 0xFB37 if runs else 0xFB31


def record(time_ns: int, data: bytes) -> bytes:
    return struct.pack("<4I", time_ns // 10**9, time_ns % 10**9, len(data), len(data)) + data


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("frames", type=int, nargs="?", default=1_000_000)
    parser.add_argument("--no-connect", action="store_true")
    given = parser.parse_args()
    head = struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1)
    given.file.write_bytes(head + b"".join(records(given.frames, not given.no_connect)))


if __name__ == "__main__":
    assert (PKW.length, PZD.length) == (8, 4)
    main()
