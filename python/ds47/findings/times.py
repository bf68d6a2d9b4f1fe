"""The times of frames: of the newest one, and of as many before it as there is room for.

A finding is often reported long after its frame, so the times of frames are kept, but not their contents.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left


class FrameTimes:
    """Times of frames by their numbers, of the first `most` that were noted: 16 bytes a frame."""

    def __init__(self, most: int) -> None:
        self._room = most
        self._newest = 0
        self._newest_ns: int | None = None
        self._numbers, self._times = array("q"), array("q")

    def note(self, number: int, time_ns: int) -> None:
        """Takes the next frame; numbers grow."""
        self._newest, self._newest_ns = number, time_ns
        if self._room:
            try:
                self._times.append(time_ns)
            except OverflowError:  # no clock runs so long
                return
            self._numbers.append(number)
            self._room -= 1

    def of(self, number: int) -> int | None:
        """Nanoseconds since 1970; None where it is not known."""
        if number == self._newest:
            return self._newest_ns
        at = bisect_left(self._numbers, number)
        if at < len(self._numbers) and self._numbers[at] == number:
            return self._times[at]
        return None
