"""The times of frames: of the newest one, and of the first ones, as many as there is room for.

A finding is often reported long after its frame, so the times of frames are kept, but not their contents.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from typing import Final, Protocol

NO_CLOCK: Final = 2**63 - 1
"""Nanoseconds that no clock shows: a time beyond is a number in a broken file."""


class Timed(Protocol):
    """A frame, as far as it matters here."""

    number: int
    time_ns: int


class FrameTimes:
    """Times of frames by their numbers, of the first `room` frames: 16 bytes a frame."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.numbers, self.times = array("q"), array("q")
        self.newest: Timed | None = None

    def note(self, frame: Timed) -> None:
        """Takes the next frame; numbers grow. `Analysis` does the same in its loop: a call would be dear there."""
        self.newest = frame
        if self.room:
            self.room, now = self.room - 1, frame.time_ns
            self.numbers.append(frame.number)
            self.times.append(now if -NO_CLOCK < now < NO_CLOCK else NO_CLOCK)

    def of(self, number: int) -> int | None:
        """Nanoseconds since 1970; None where it is not known."""
        if self.newest is not None and number == self.newest.number:
            return self.newest.time_ns
        numbers, times = self.numbers, self.times
        at = bisect_left(numbers, number)
        if at < len(numbers) and numbers[at] == number and abs(times[at]) < NO_CLOCK:
            return times[at]
        return None
