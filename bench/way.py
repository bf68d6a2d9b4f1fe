"""Counts what a frame of a usual conversation passes: calls of Python a transaction, and files a frame enters.

    .venv/bin/python bench/way.py [CAPTURE | --trial]

Counts nothing but Python's own calls, from the first frame to the last line of ndjson, so that two runs say the
same. Without a capture it takes the one of bench/run.py with 20,000 record frames, or 2,000.
docs/developers/way.md has the numbers of today.
"""

from __future__ import annotations

import re
import statistics
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path
from types import FrameType

from run import DATA, made

KINDS = {
    (0, 3): "Write request", (2, 3): "Write response", (0, 2): "Read request", (2, 2): "Read response",
}  # fmt: skip
"""By type of PDU and operation."""
PACKAGE = "/ds47/"
OUTSIDE = re.compile(r"spec/|(.*/)?model\.py$")
"""Files that do not count: tables, and plain data."""


class Way:
    """What is entered while a command runs."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()
        """By file, since the first frame."""
        self.frames: dict[str, list[Counter[str]]] = defaultdict(list)
        """The same of each frame, by its kind."""
        self._now: Counter[str] | None = None

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """As `sys.setprofile` likes it."""
        path, code = frame.f_code.co_filename, frame.f_code
        if event != "call":
            return
        if code.co_name == "from_frame":
            self._now = Counter()
        if self._now is None:
            return
        name = path.rpartition(PACKAGE)[2] if PACKAGE in path else "elsewhere"
        self.calls[name] += 1
        self._now[name] += 1
        if code.co_name == "take" and (pdu := frame.f_locals.get("pdu")) is not None:
            self.frames[KINDS.get((pdu.ptype, pdu.opnum), "other")].append(self._now)


def walk(capture: Path) -> tuple[Way, int]:
    """The way of the frames of a capture, and how many transactions came out."""
    from ds47.cli import main

    way = Way()
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder, "out.ndjson")
        sys.argv = ["ds47", "report", str(capture), "-f", "ndjson", "-o", str(there)]
        sys.setprofile(way)
        try:
            main()
        except SystemExit:
            pass
        finally:
            sys.setprofile(None)
        lines = there.read_text(encoding="utf-8").splitlines()
    return way, sum('"transaction": {"id"' in each for each in lines)


def files(entered: Counter[str]) -> int:
    """How many files count."""
    return sum(not OUTSIDE.match(each) and each != "elsewhere" for each in entered)


def main() -> int:
    """Prints it."""
    DATA.mkdir(exist_ok=True)
    frames = 2_000 if sys.argv[1:2] == ["--trial"] else 20_000
    there = [Path(each) for each in sys.argv[1:] if not each.startswith("-")]
    capture = there[0] if there else made(f"dense-{frames}.pcapng", "make_dense.py", frames)
    way, transactions = walk(capture)
    print(
        f"{way.calls.total() / max(1, transactions):.0f} calls a transaction, {transactions} transactions"
    )
    print(f"{'':16}{'frames':>8}{'files':>8}{'most':>6}{'calls':>8}")
    for kind, entered in way.frames.items():
        count = [files(each) for each in entered]
        calls = statistics.median(each.total() for each in entered)
        print(f"{kind:16}{len(entered):8}{statistics.median(count):8.0f}{max(count):6}{calls:8.0f}")
    for name, calls in way.calls.most_common(12):
        print(f"{calls / max(1, transactions):8.1f}  {name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
