"""Compares value blocks of Wireshark's own PROFIDrive decoder with those of ds47 (docs/developers/upstream.md).

    .venv/bin/python tools/compare_builtin.py TSHARK CAPTURE...

TSHARK is a command, in quotation marks where it has arguments. Of each frame with a DS47 message the format and
the number of values of each block have to be the same, and no block may be malformed. Printed is a line per
capture: how many frames agree, and the first that do not. Exit status 1: some do not.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from ds47.analysis import analyze
from ds47.model import Transaction
from ds47.profidrive import decode_request, decode_response

FIELDS = ("format", "no_of_values")
SHOWN = 3


def of_ds47(item: Transaction) -> Iterator[tuple[int, list[tuple[int, int]]]]:
    """Frames of a transaction with the value blocks in them: format and number of values."""
    frames = item.frames
    request = decode_request(item.request) if item.request else None
    if request is not None and request.blocks and frames.write_request:
        yield frames.write_request, [(each.format, each.value_count) for each in request.blocks]
    if item.response and frames.read_response:
        blocks = decode_response(item.response, request).blocks
        if blocks:
            yield frames.read_response, [(each.format, each.value_count) for each in blocks]


def of_builtin(command: str, path: Path) -> dict[int, tuple[list[tuple[int, int]], bool]]:
    """Frames with the value blocks that the built-in finds in them, and whether it calls them malformed."""
    names = [
        "frame.number",
        *(f"pn_io.profidrive.parameter.{name}" for name in FIELDS),
        "_ws.malformed",
    ]
    wanted = [part for name in names for part in ("-e", name)]
    done = subprocess.run(
        [*shlex.split(command), "-n", "-r", str(path), "-T", "fields", *wanted],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = {}
    for line in done.stdout.splitlines():
        number, formats, counts, malformed = line.split("\t")
        pairs = zip(formats.split(","), counts.split(","), strict=False)
        blocks = [(int(code, 0), int(count)) for code, count in pairs if code]
        found[int(number)] = (blocks, bool(malformed))
    return found


def main() -> int:
    command, *paths = sys.argv[1:]
    wrong = 0
    for path in map(Path, paths):
        told, same, other = of_builtin(command, path), 0, []
        for item in analyze(path).transactions:
            for frame, blocks in of_ds47(item):
                if told[frame] == (blocks, False):
                    same += 1
                else:
                    other.append(frame)
        more = ", ..." if len(other) > SHOWN else ""
        apart = f"; not frames {', '.join(map(str, other[:SHOWN]))}{more}" if other else ""
        print(f"{path.stem}: {same} of {same + len(other)} frames agree{apart}")
        wrong += len(other)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
