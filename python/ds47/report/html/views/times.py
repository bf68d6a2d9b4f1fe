"""The times of a capture for the page: what the script needs to say them, and when what it names was.

How a time is said is decided in `ds47.report.clock`; templates/report/clock.js says the same of rows.
"""

from __future__ import annotations

from typing import Any

from ds47.model import CaptureResult
from ds47.report.clock import Clock, seen_at

_MS = 1_000_000


def for_script(clock: Clock) -> dict[str, Any]:
    """The clock of a capture: its first frame in two parts, and from when on it is how far ahead of UTC."""
    first = clock.first_ns or 0
    return {
        "ms": first // _MS,
        "ns": first % _MS,
        "known": clock.known,
        "dated": clock.dated,
        "offset": clock.has_offsets,
        "zone": clock.zone_name,
        "ahead": [[(at - first) // 1000, seconds] for at, seconds in clock.changes()],
    }


class FrameClock:
    """The times of the frames of findings."""

    def __init__(self, result: CaptureResult, clock: Clock) -> None:
        self.clock = clock
        self._frames = seen_at(result)

    def moment(self, frame: int | None) -> str:
        """The time of a frame; empty if unknown."""
        known = self._frames.get(frame or 0)
        return "" if known is None else self.clock.moment(known)
