"""Frames of a line in their order: which answer belongs to which request, and which request is a retry.

On a line one station asks at a time, and the answer follows at once (docs/profibus.md 6). What is asked and
answered is not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from ds47.profibus.telegram import ALL_STATIONS, SC, SD4, Telegram
from ds47.spec import profibus

CUT = "cut"
"""The flaw of a frame of which the end is missing."""
MOST_RETRIES = 16
"""Retries of an exchange that are kept; masters repeat a request up to 15 times."""

_Way = tuple[int | None, int | None]
"""Who asks whom."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A frame with its place in the capture."""

    frame: int
    time_ns: int
    item: Telegram


@dataclass(slots=True, eq=False)
class Exchange:
    """A request and what became of it."""

    request: Seen
    answer: Seen | None = None
    """None where none came, or nobody answers such a request."""
    retries: list[Seen] = field(default_factory=list)
    """The same request again, because the master got no answer: the first ones,"""
    retried: int = 0
    """and how many there are."""
    again: bool = False
    """Whether it repeats the exchange before between the two: the master has no answer to that."""
    silent: bool = False
    """Whether nobody answers such a request."""
    damaged: int = 0
    """The first damaged frame that stands where its answer should; 0 for none."""
    cut: bool = False
    """Whether a frame that the recording did not keep whole stands there: it may be its answer."""
    unfinished: bool = False
    """Whether nothing came behind it: its answer may be missing for that."""


class Line:
    """Takes the frames of one line and gives their exchanges, each when it is over.

    Damaged frames are none: a request behind whose answer was damaged stays without it.
    """

    def __init__(self) -> None:
        self._open: Exchange | None = None
        self._last: dict[_Way, Telegram] = {}
        self.tokens = 0
        """How many tokens went round,"""
        self.damaged = 0
        """how many frames are damaged,"""
        self.stray = 0
        """and how many answers nobody asked for,"""
        self.echoes = 0
        """those among them that stand directly behind the same answer."""
        self.unsure = 0
        """The last such answer or damaged frame: before it something may have been that was not seen."""
        self._before = b""
        """The bytes of the frame before,"""
        self._same = False
        """whether the frame has them, too,"""
        self._echo = False
        """and whether it is so the second of two, the fourth of four and so on."""

    def take(self, seen: Seen, cut: bool = False) -> Iterator[Exchange]:
        """A frame; gives the exchanges that are over with it, up to two.

        Args:
            seen: the frame.
            cut: whether the recording did not keep all of it.
        """
        data = seen.item.data
        self._same = data == self._before
        self._echo = self._same and not self._echo
        self._before = data
        yield from self._take(seen, cut)

    def _take(self, seen: Seen, cut: bool) -> Iterator[Exchange]:
        item = seen.item
        if item.flaws:
            self.damaged += 1
            self._damaged(seen, cut)
        elif item.kind == SD4:
            self.tokens += 1
        elif item.request:
            yield from self._request(seen)
        else:
            yield from self._answer(seen)

    def finish(self) -> Iterator[Exchange]:
        """No frame comes any more."""
        if self._open is not None:
            self._open.unfinished = True
            yield from self._give_up()

    def _damaged(self, seen: Seen, cut: bool) -> None:
        """A frame of which nothing is proved: it may be an answer, or a request that nobody knows then."""
        self.unsure = seen.frame
        if self._open is None:
            self._last.clear()
        elif cut and any(each.kind == CUT for each in seen.item.flaws):
            self._open.cut = True
        else:
            self._open.damaged = self._open.damaged or seen.frame

    def _give_up(self) -> Iterator[Exchange]:
        """The exchange that is open stays without an answer."""
        if self._open is not None:
            over, self._open = self._open, None
            yield over

    def _request(self, seen: Seen) -> Iterator[Exchange]:
        item, way = seen.item, (seen.item.sa, seen.item.da)
        counts = item.fcv == 1 or self._same
        if self._open is not None and counts and self._open.request.item == item:
            self._open.retried += 1
            if self._open.retried <= MOST_RETRIES:
                self._open.retries.append(seen)
            return
        yield from self._give_up()
        row = profibus.codes("request").get(item.code or 0)
        silent = item.da == ALL_STATIONS or (row is not None and row.silent)
        again = item.fcv == 1 and self._last.get(way) == item
        exchange = Exchange(seen, again=again, silent=silent)
        if silent:
            yield exchange
            return
        self._last[way] = item
        self._open = exchange

    def _answer(self, seen: Seen) -> Iterator[Exchange]:
        over, item = self._open, seen.item
        if over is None or not _fits(over.request.item, item):
            self.stray += 1
            self.echoes += self._echo
            self.unsure = seen.frame
            self._forget(item)
            return
        self._open = None
        over.answer = seen
        yield over

    def _forget(self, answer: Telegram) -> None:
        """Between the requests before and behind this answer was one that was not seen.

        They may be alike, FCB included, and the second is no repetition of the first.
        """
        if answer.kind == SC:
            self._last.clear()
        else:
            self._last.pop((answer.da, answer.sa), None)


def _fits(request: Telegram, answer: Telegram) -> bool:
    """Whether an answer is one to a request: SC names nobody, others have stations and SAPs turned round."""
    if answer.kind == SC:
        return True
    if (answer.sa, answer.da) != (request.da, request.sa):
        return False
    saps = (answer.ssap, answer.dsap)
    return saps in ((request.dsap, request.ssap), (None, None))
