"""Whether frames of a sender are missing between two that were looked at, by the steps from one to the next.

Not every frame is looked at, so a step is many cycles wide, and how wide steps are the capture itself shows. One
that is much wider than nearly all others is a hole. Of a frame or two that are missing it says nothing.
"""

from __future__ import annotations

from bisect import insort

_TICK_NS = 31_250
_COUNTERS = 1 << 16
_USUAL = 4
"""Cycles of the widest steps, as long as no wider ones are known."""
_WIDER = 2
"""Later in a long capture half as many frames are looked at, which is no hole."""
_HOLES = 8
"""Steps that are wider than usual because of holes, before they are taken for usual ones."""


class Steps:
    """The steps between the frames of one sender, by its cycle counter, or by the time where that does not tell.

    Args:
        cycle_ns: from one frame to the next.
    """

    def __init__(self, cycle_ns: int) -> None:
        self._cycle = max(cycle_ns // _TICK_NS, 1)
        self._last: tuple[int, int] | None = None
        self._widest = [_USUAL * self._cycle] * _HOLES
        """Of all steps up to now, in order."""

    def skips(self, counter: int, time_ns: int) -> bool:
        """Whether more frames lie between the last one and this one than usual."""
        last, self._last = self._last, (counter, time_ns)
        if last is None:
            return False
        step, passed = (counter - last[0]) % _COUNTERS, (time_ns - last[1]) // _TICK_NS
        counts = step > 0 and passed < _COUNTERS // 2
        if counts and step >= _COUNTERS // 2:
            return False  # out of order, or it began anew
        width = step if counts else passed
        usual = self._widest[0]
        if width > usual:
            insort(self._widest, width)
            del self._widest[0]
        return width > _WIDER * usual + self._cycle
