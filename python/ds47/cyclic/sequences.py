"""Whether the frames of one sender and frame id to one receiver are one sequence, by their cycle counters.

A counter goes on by a cycle from frame to frame, and keeps up with the time. Where two recordings were put into
one file, two sequences take turns, and there are more frames than cycles: nobody can tell what belongs to which.
A counter that does not count, or a sender that starts again, is no second sequence: both have to go on, in turn.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

_TICK_NS = 31_250
_COUNTERS = 1 << 16
_SLACK = 1024
"""Ticks by which a counter and the time may differ between two frames: 32 ms."""
_MOST = 4
"""Sequences that are followed."""
_TURN, _ENOUGH = 2, 6
"""What a turn to another sequence counts for; each frame that goes on with the same one takes 1 away."""
_FRAMES = 10
"""Frames of one sender do not come in less than three quarters of their cycles."""
_QUIET = 8
"""Frames of one sequence after which another one is over."""


class Head(NamedTuple):
    """The newest frame of a sequence."""

    counter: int
    time_ns: int
    data: bytes
    frame: int


class Sequences:
    """The sequences of counters among such frames, within limits. `cycle_ns`: from one frame to the next."""

    def __init__(self, cycle_ns: int) -> None:
        self._cycle = max(cycle_ns // _TICK_NS, 1)
        self._heads: list[Head] = []
        """The one of the newest frame stands last."""
        self._turns = 0
        self._alone = 0
        """Frames that went on with one sequence."""
        self.since: Head | None = None
        """The last frame before there was a second one."""
        self._times: deque[int] = deque(maxlen=_FRAMES)

    @property
    def are_doubtful(self) -> bool:
        """Whether there was a second one just now: what is found meanwhile may be of both."""
        return len(self._heads) > 1

    def are_several(self, counter: int, time_ns: int, data: bytes, frame: int) -> bool:
        """Whether it is proven with this frame that there are several, in turn."""
        heads, head = self._heads, Head(counter, time_ns, data, frame)
        newest = heads[-1] if heads else None
        if newest and (
            time_ns < newest.time_ns or (newest.counter == counter and newest.data == data)
        ):
            return False  # out of order, or a copy
        self._times.append(time_ns)
        if newest and len(heads) == 1:
            self.since = newest
            if self._off(newest, counter, time_ns) is not None:
                heads[0] = head
                return False
        at = self._continued(counter, time_ns)
        if at is None:
            self._turns = self._alone = 0
            del heads[: len(heads) - _MOST + 1]
        elif at < len(heads) - 1:
            self._turns, self._alone = self._turns + _TURN, 0
            del heads[at]
        else:
            self._turns, self._alone = max(self._turns - 1, 0), self._alone + 1
            del heads[at if self._alone < _QUIET else 0 :]
        heads.append(head)
        return self._turns >= _ENOUGH and self._are_many()

    def _are_many(self) -> bool:
        """Whether there are more frames than cycles."""
        least = (_FRAMES - 1) * self._cycle * 3 // 4
        passed = (self._times[-1] - self._times[0]) // _TICK_NS
        return len(self._times) == _FRAMES and passed < least

    def _continued(self, counter: int, time_ns: int) -> int | None:
        """Which sequence a frame goes on with: the one that it fits best, of several the newest."""
        best, least = None, 0
        for at in reversed(range(len(self._heads))):
            off = self._off(self._heads[at], counter, time_ns)
            if off is not None and (best is None or off < least):
                best, least = at, off
        return best

    def _off(self, head: Head, counter: int, time_ns: int) -> int | None:
        """By how much a counter differs from whole cycles and the time; None where it is none that comes later."""
        step = (counter - head.counter) % _COUNTERS
        passed = (time_ns - head.time_ns) // _TICK_NS
        ahead = (step - passed + _COUNTERS // 2) % _COUNTERS - _COUNTERS // 2
        is_later = self._cycle // 2 <= step < _COUNTERS // 2 or passed >= _COUNTERS // 2
        if abs(ahead) > _SLACK or not is_later:
            return None
        return min(step % self._cycle, -step % self._cycle) + abs(ahead)
