"""A capture of a line of PROFIBUS: one master, one drive with PPO1, in data exchange.

Shares no code with the lab and the package, so that nothing is quick only because our own generator
writes it. Behind the start-up (Slave_Diag, Set_Prm, Chk_Cfg) there is nothing but data exchange. 200
requests by PKW are spread over the capture; the drive is started and stopped eight times. Setpoint and
actual value move in every cycle. Same arguments, same bytes. A plain pcap of link type 257.
"""

from __future__ import annotations

import argparse
import struct
from collections.abc import Iterator
from pathlib import Path

FRAMES = 1_000_000
REQUESTS = 200
STARTS = 8
CYCLE_US = 2_000
START = 1_750_000_000
LINK_TYPE = 257

MASTER, DRIVE = 2, 3
IDLE = bytes(8)
SHORT = b"\xe5"
FIRST_PNU = 700
"""A parameter that the drive has for each request: p0700 and so on."""


def frame(target: int, source: int, control: int, data: bytes, saps: bytes = b"") -> bytes:
    """SD2 with the SAPs of both sides, or without."""
    bit = 0x80 if saps else 0
    body = bytes((target | bit, source | bit, control)) + saps + data
    length = len(body)
    return bytes((0x68, length, length, 0x68)) + body + bytes((sum(body) & 0xFF, 0x16))


def start_up() -> list[bytes]:
    """FDL_Status, Slave_Diag, Set_Prm of a MICROMASTER 4, Chk_Cfg of PPO1, Slave_Diag."""
    told = bytes.fromhex("000c000280b5")
    return [
        bytes.fromhex("100302494e16"), bytes.fromhex("100203000516"),
        frame(DRIVE, MASTER, 0x6D, b"", b"\x3c\x3e"), frame(MASTER, DRIVE, 8, told, b"\x3e\x3c"),
        frame(DRIVE, MASTER, 0x5D, bytes.fromhex("b81e010080b501"), b"\x3d\x3e"), SHORT,
        frame(DRIVE, MASTER, 0x7D, b"\xf3\xf1", b"\x3e\x3e"), SHORT,
        frame(DRIVE, MASTER, 0x5D, b"", b"\x3c\x3e"), frame(MASTER, DRIVE, 8, told, b"\x3e\x3c"),
    ]  # fmt: skip


def exchange(cycle: int, cycles: int) -> tuple[bytes, bytes]:
    """What goes to the drive and what comes from it in a cycle: PKW, control and status word, values."""
    every = max(8, cycles // REQUESTS)
    number, place = divmod(cycle, every)
    asked, answered = every // 4 <= place, every // 4 + 3 <= place
    head = struct.pack(">HH", 0x1000 | FIRST_PNU + number % REQUESTS, 0)
    out = head + bytes(4) if asked else IDLE
    back = head + struct.pack(">I", number) if answered else IDLE
    number, place = divmod(cycle, max(4, cycles // STARTS))
    quarter = max(4, cycles // STARTS) // 4
    on, runs = quarter <= place < 3 * quarter, quarter < place <= 3 * quarter
    values = struct.pack(">HH", 0x047F if on else 0x047E, cycle & 0x3FFF)
    actual = struct.pack(">HH", 0xFB37 if runs else 0xFB31, cycle + 7 & 0x3FFF)
    return out + values, back + actual


def line(frames: int) -> Iterator[tuple[int, bytes]]:
    """Microseconds and bytes of each frame."""
    now = 0
    for now, data in enumerate(start_up()):
        yield now * 100, data
    cycles = frames // 2
    now *= 100
    for cycle in range(cycles):
        now += CYCLE_US
        out, back = exchange(cycle, cycles)
        yield now, frame(DRIVE, MASTER, 0x7D if cycle & 1 == 0 else 0x5D, out)
        yield now + 40, frame(MASTER, DRIVE, 8, back)


def write(path: Path, frames: int = FRAMES) -> None:
    """Write a capture of about so many frames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65_535, LINK_TYPE))
        for time_us, data in line(frames):
            seconds, rest = divmod(time_us, 1_000_000)
            file.write(struct.pack("<4I", START + seconds, rest, len(data), len(data)) + data)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--frames", type=int, default=FRAMES)
    arguments = parser.parse_args()
    write(arguments.path, arguments.frames)


if __name__ == "__main__":
    main()
