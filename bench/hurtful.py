"""What conversations cost that want memory and time (make_hurtful.py): microseconds of CPU a frame, and peak MiB.

Every kind by each format of the report and by watch, at one size or several (default 20,000 frames; a million
takes hours). A time a frame that has grown by more than half since the size before is marked with !; so is a peak
above what a million frames may take. What the command takes for an empty capture is taken off.
Not a test: it fails where the command fails, not where it is slow. POSIX only (wait4).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import make_hurtful
import run

FORMATS = ("ndjson", "csv", "json", "text", "html", "watch")
MOST = {"ndjson": 200, "csv": 200, "watch": 200, "json": 300, "text": 300, "html": 300}
"""MiB that a million frames may take."""
GROWTH = 1.5
"""From one size to the next, in time a frame."""
ENDED = "sys.exit(main(sys.argv[1:]) not in (0, 1, 3))"
"""An exit status that says something of the capture is no failure."""


def cost(form: str, capture: Path) -> run.Run:
    """A command on a capture, in a process of its own."""
    words = (
        ["watch", "--no-follow"] if form == "watch" else ["report", "-f", form, "-o", "/dev/null"]
    )
    code = f"import sys; from ds47.cli import main; {ENDED}"
    command = [sys.executable, "-c", code, *words, str(capture)]
    return run.once(run.Row(f"{form} of {capture.name}", command, package=run.ROOT / "python"))


def row(name: str, form: str, sizes: list[int], bare: run.Run) -> str:
    """The line of a kind and a format."""
    cells, before = [], float("inf")
    for frames in sizes:
        capture = run.made(f"{name}-{frames}.pcap", "make_hurtful.py", frames, "--kind", name)
        found = cost(form, capture)
        each = max(0.1, (found.cpu - bare.cpu) / frames * 1e6)
        slow, large = each > GROWTH * before, found.peak > MOST[form]
        before = each
        cells.append(
            f"{each:6.1f} us{'!' if slow else ' '}{found.peak:6.0f} MiB{'!' if large else ' '}"
        )
    return f"{name:20}{form:7} " + "  ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, nargs="+", default=[20_000], help="default 20000")
    parser.add_argument(
        "--kinds", nargs="+", choices=make_hurtful.KINDS, default=[*make_hurtful.KINDS]
    )
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=FORMATS)
    parser.add_argument(
        "--trial", action="store_true", help="100 frames by one format, to see that it runs"
    )
    arguments = parser.parse_args()
    if arguments.trial:
        arguments.frames, arguments.formats = [100], ["ndjson"]
    run.DATA.mkdir(exist_ok=True)
    print(" " * 28 + "  ".join(f"{frames:>14,} frames" for frames in arguments.frames))
    nothing = run.made("bus_tokens-1.pcap", "make_hurtful.py", 1, "--kind", "bus_tokens")
    for form in arguments.formats:
        bare = cost(form, nothing)
        for name in arguments.kinds:
            print(row(name, form, arguments.frames, bare), flush=True)


if __name__ == "__main__":
    main()
