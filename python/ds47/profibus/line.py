"""Frames of a line in their order: which answer belongs to which request, and which request is a retry.

On a line one station asks at a time, and the answer follows at once (docs/profibus.md 6). What is asked and
answered is not looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from ds47.profibus.telegram import SC, SD4, Front, Telegram

CUT: Final = "cut"
"""The flaw of a frame without its end."""
MOST_RETRIES = 16
"""Retries of an exchange that are kept; masters repeat a request up to 15 times."""


@dataclass(slots=True, init=False, eq=False)
class LineFrame:
    """A frame with its number and time in the capture."""

    frame: int
    time_ns: int
    item: Telegram

    def __init__(self, frame: int, time_ns: int, item: Telegram) -> None:
        self.frame = frame
        self.time_ns = time_ns
        self.item = item


@dataclass(slots=True, init=False, eq=False)
class Exchange:
    """A request and what became of it."""

    request: LineFrame
    answer: LineFrame | None
    """None if none came, or if such a request has no answer."""
    retries: list[LineFrame]
    """The same request again, because the master got no answer: the first ones,"""
    retried: int
    """and how many there are."""
    again: bool
    """Whether it repeats the exchange before: the master has no answer to that."""
    paused: int
    """Which of its repetitions stands behind the longest pause until then, and so may be none; 0 for none."""
    hole: int
    """The newest request to its station before which an exchange was not seen: it has the FCB of the one that was,
    and does not repeat that; 0 for none."""
    silent: bool
    """Whether such a request has no answer."""
    damaged: int
    """The first damaged frame that stands where its answer should; 0 for none."""
    spoiled: int
    """How many there are: of each retry one;"""
    copied: int
    """and how many of them stand directly behind the same frame."""
    cut: bool
    """Whether a frame that the recording did not keep whole stands there: it may be its answer."""
    due: bool
    """Whether the next such frame may be that: none was there since the newest request, and no token."""
    passed: bool
    """Whether a token or a broadcast came behind it and its retries: the master waits no more."""
    gone_ns: int | None
    """When the token came: what is sent from then on is no answer to this request."""
    unfinished: bool
    """Whether the recording ended before that and before another request: its answer may be missing for that."""

    def __init__(self, request: LineFrame, again: bool = False, silent: bool = False) -> None:
        self.request = request
        self.answer = None
        self.retries = []
        self.retried = 0
        self.again = again
        self.paused = 0
        self.hole = 0
        self.silent = silent
        self.damaged = 0
        self.spoiled = 0
        self.copied = 0
        self.cut = False
        self.due = True
        self.passed = False
        self.gone_ns = None
        self.unfinished = False


class Line:
    """Takes the frames of one line and gives their exchanges, each when it is over.

    Damaged frames do not count: a request with a damaged answer stays without one.
    """

    def __init__(self) -> None:
        self._open: Exchange | None = None
        self._last: Telegram | None = None
        """The request before, where nothing but its answer stands behind it."""
        self.tokens = 0
        """How many tokens went round,"""
        self.damaged = 0
        """how many frames are damaged,"""
        self._answers = 0
        """How many answers there are,"""
        self.stray = 0
        """how many of them nobody asked for,"""
        self.echoes = 0
        """those among them that stand directly behind the same answer."""
        self.unsure = 0
        """The last such answer or damaged frame: before it something may have been that was not seen."""
        self._lost: dict[int, int] = {}
        """Of a station the last frame before which an exchange with it, or a part of one, was not seen."""
        self._marks: dict[int, int] = {}
        """What the newest frame shows of that: it is behind the request of which it gives the exchange."""
        self._counted: dict[bytes, int | None] = {}
        """By who asks whom the FCB of the last request, where it counts."""
        self._holes: dict[int, int] = {}
        """By station the newest request before which an exchange was not seen."""
        self._heard_ns: int | None = None
        self._longest = self._second = 0
        """The two longest times between frames,"""
        self._behind = 0
        """and the first request behind the longest."""
        self._before = b""
        """The bytes of the frame before,"""
        self._same = False
        """whether the frame has them, too,"""
        self._echo = False
        """and whether it is so the second of two, the fourth of four and so on."""

    def take(self, seen: LineFrame, cut: bool = False) -> Sequence[Exchange]:
        """A frame; gives the exchanges that are over with it, up to two.

        Args:
            seen: the frame.
            cut: whether the recording did not keep all of it.
        """
        item = seen.item
        if self._marks:
            self._lost.update(self._marks)
            self._marks.clear()
        self._pause(seen)
        self._same = item.data == self._before
        self._echo = self._same and not self._echo
        self._before = item.data
        if item.flaws:
            return self._damage(seen, cut)
        if item.front.request:
            return self._request(seen)
        if item.front.kind != SD4:
            return self._answer(seen)
        self.tokens += 1
        self._last = None
        if self._open is not None:
            self._open.passed, self._open.due = True, False
            self._open.gone_ns = seen.time_ns
        return ()

    def lost(self, station: int) -> int:
        """The last frame before which something that was said with a station was not seen; 0 for none.

        A master repeats a request without an answer, and turns the FCB round with each new one.
        """
        return self._lost.get(station, 0)

    def paused(self) -> int:
        """The first request behind the one pause that is longer than others by half, as a hole is; 0 for none."""
        return self._behind if 2 * self._longest > 3 * self._second else 0

    def _pause(self, seen: LineFrame) -> None:
        pause = 0 if self._heard_ns is None else seen.time_ns - self._heard_ns
        self._heard_ns = seen.time_ns
        if pause > self._longest:
            self._longest, self._second, self._behind = pause, self._longest, 0
        elif pause > self._second:
            self._second = pause
        if not self._behind and seen.item.front.request and not seen.item.flaws:
            self._behind = seen.frame

    def _count(self, seen: LineFrame, again: bool) -> None:
        """Remembers whether the exchange before a request is not there, or its answer."""
        over, front = self._open, seen.item.front
        if over is not None and over.request.item.front.fcv == 1 and not over.retried:
            self._marks[_asked(over.request)] = seen.frame
        counted = front.fcb if front.fcv == 1 else None
        if counted is not None and counted == self._counted.get(front.way) and not again:
            self._marks[_asked(seen)] = self._holes[_asked(seen)] = seen.frame
        self._counted[front.way] = counted

    def finish(self) -> Sequence[Exchange]:
        """No frame comes any more."""
        self._lost.update(self._marks)
        over, self._open = self._open, None
        if over is None:
            return ()
        over.unfinished = not over.passed
        return (over,)

    def _damage(self, seen: LineFrame, cut: bool) -> Sequence[Exchange]:
        """A frame of which nothing is proved: it may be an answer, or a request that nobody knows then.

        One that the recording cut is sound on the line: where no answer is due any more, it is a request.
        """
        over = self._open
        self.damaged += 1
        self.unsure = seen.frame
        short = cut and any(each.kind == CUT for each in seen.item.flaws)
        front = seen.item.front
        station = front.da if front.request else front.sa
        if short and station is not None:
            self._lost[station] = seen.frame
        if over is None:
            self._last = None
        elif short and over.due:
            over.cut, over.due = True, False
        elif short and not (self._echo and 0 < self._answers <= 3 * self.echoes):  # not its copy
            self._last = None
            self._open = None
            return (over,)
        elif not (short or over.passed):
            over.damaged = over.damaged or seen.frame
            over.spoiled += 1
            over.copied += self._echo
        return ()

    def _request(self, seen: LineFrame) -> Sequence[Exchange]:
        item, front, over = seen.item, seen.item.front, self._open
        if (
            over is not None
            and over.request.item.data == item.data
            and (front.fcv == 1 or self._same)
        ):
            over.passed, over.due, over.gone_ns = False, True, None
            over.retried += 1
            if seen.frame == self._behind:
                over.paused = seen.frame
            if over.retried <= MOST_RETRIES:
                over.retries.append(seen)
            return ()
        if front.silent:  # the request before it may be repeated behind it
            self._last = None
            if over is not None:
                over.passed, over.due = True, False
            return (Exchange(seen, silent=True),)
        again = front.fcv == 1 and self._last is not None and self._last.data == item.data
        exchange = Exchange(seen, again)
        if again and seen.frame == self._behind:
            exchange.paused = seen.frame
        self._count(seen, again)
        exchange.hole = self._holes.get(_asked(seen), 0)
        self._last = item
        self._open = exchange
        return () if over is None else (over,)

    def _answer(self, seen: LineFrame) -> Sequence[Exchange]:
        over, item = self._open, seen.item
        self._answers += 1
        if (
            over is None
            or not _in_time(over, seen)
            or not _fits(over.request.item.front, item.front)
        ):
            self.stray += 1
            self.echoes += self._echo
            self.unsure = seen.frame
            self._last = None  # between the two was a request that was not seen: nothing repeats that before it
            return ()
        self._open = None
        over.answer = seen
        return (over,)


def _asked(request: LineFrame) -> int:
    """The station that a request goes to."""
    station = request.item.front.da
    assert station is not None
    return station


def _in_time(asked: Exchange, answer: LineFrame) -> bool:
    """Whether an answer was sent behind a request and before the token went on; frames may be out of order."""
    gone = asked.gone_ns is not None and answer.time_ns >= asked.gone_ns
    return answer.time_ns >= asked.request.time_ns and not gone


def _fits(request: Front, answer: Front) -> bool:
    """Whether an answer is one to a request: SC has no addresses, others have stations and SAPs reversed."""
    if answer.kind == SC:
        return True
    if answer.way != request.back:
        return False
    bare = answer.ssap is None and answer.dsap is None
    return bare or (answer.ssap == request.dsap and answer.dsap == request.ssap)
