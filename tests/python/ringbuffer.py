"""Captures cut into the files of a ring buffer, as dumpcap -b would have written them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from frames import whole_frames

from ds47.capture import PcapngWriter, WholeFrame

NIGHT = "20240101020000"


def ring(number: int, time: str, stem: str = "ring", ending: str = ".pcapng") -> str:
    return f"{stem}_{number:05}_{time}{ending}"


def write(path: Path, frames: Iterable[WholeFrame]) -> Path:
    """The frames as a pcapng of their own; each interface once."""
    with PcapngWriter(path, None) as writer:
        numbers: dict[int, int] = {}
        for frame in frames:
            about = frame.interface
            if id(about) not in numbers:
                numbers[id(about)] = writer.add_interface(about.link_type, about.snap_length)
            interface = numbers[id(about)]
            writer.write(frame.time_ns, frame.data, frame.original_length, interface=interface)
    return path


def pieces(folder: Path, frames: Sequence[WholeFrame], cuts: Sequence[int]) -> list[Path]:
    """The files of a ring buffer that has gone on to the next file before each of `cuts`."""
    bounds = [0, *cuts, len(frames)]
    return [
        write(folder / ring(number + 1, NIGHT), frames[bounds[number] : bounds[number + 1]])
        for number in range(len(bounds) - 1)
    ]


def recording(folder: Path, captures: Path) -> Path:
    """The tour of a machine as a ring buffer of four files; the third ends within a transaction."""
    folder.mkdir()
    pieces(folder, list(whole_frames(captures / "tour-machine.pcapng")), [8, 20, 31])
    return folder
