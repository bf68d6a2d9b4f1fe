"""What of a conversation is not in the capture: one judgement, asked by every rule of absence.

Lives here: calls whose sequence numbers are missing, Writes whose requests are, and who was never heard. A missing
number shows that a call may be missing, and says nothing of responses; that none is missing proves nothing across
activities. What that means for a transaction is the business of `ds47.acyclic.pairing` (docs/pairing.md, P73).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Final, Literal

from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import RPC_READ, RPC_READ_IMPLICIT, RPC_WRITE

What = Literal["one_direction", "requests", "renewed", "halves"]
"""All that one side sent; requests of Writes; calls whose numbers came twice; the other halves of calls."""
STATION: Final = "dp"
"""What the name of a station of PROFIBUS begins with; its address follows."""
_RESPONSE: Final = 2
_KEPT: Final = 64
"""Holes of one activity, and responses without requests of a pair, that are kept by themselves."""
_RARELY: Final = 4
"""One of so many calls is none of a habit."""


class Hole:
    """Sequence numbers of an activity that are missing between two of its requests.

    Attributes:
        after: frame of the request before it, 0 where that is not known,
        before: and of the one behind it.
        first: the first number that is missing,
        last: and the last one.
        over: whether its client counts anew since: what comes is none of these.
    """

    __slots__ = ("after", "before", "first", "last", "over")

    def __init__(self, after: int, before: int, first: int, last: int) -> None:
        self.after, self.before, self.first, self.last = after, before, first, last
        self.over = False

    def has(self, number: int) -> bool:
        """Whether a number is missing that may still come."""
        return self.first <= number <= self.last and not self.over

    def without(self, number: int) -> list[Hole]:
        """What is left of it, when one of its numbers came."""
        parts = (self.first, number - 1), (number + 1, self.last)
        return [Hole(self.after, self.before, *each) for each in parts if each[0] <= each[1]]

    def told(self) -> str:
        """Its numbers, for a sentence."""
        return str(self.first) if self.first == self.last else f"{self.first}..{self.last}"

    def take_in(self, older: Hole) -> None:
        """Covers an older one, too, and what is between them."""
        self.after, self.first = older.after, min(older.first, self.first)
        self.last = max(older.last, self.last)


class Numbers:
    """The sequence numbers of one activity, as a set: they may come out of order."""

    __slots__ = (
        "ahead", "anew", "answered", "below", "following", "highest", "holes", "lowest", "newest",
        "under", "waited",
    )  # fmt: skip

    def __init__(self, pdu: Pdu) -> None:
        self.lowest = self.highest = pdu.seq
        self.following: int | None = None
        """The number behind the newest one that was there before: it tells that the client counts anew."""
        self.anew = 0
        """The newest frame from which on a client counts anew: what came up to there nobody knows. 0 for none."""
        self.newest = pdu
        """The request with the highest number."""
        self.answered = -1
        """The highest one that was answered, since its client counts so: it has gone on from those before it."""
        self.waited = self.ahead = 0
        """How many calls were answered before the next one was sent, and how many behind that."""
        self.holes: list[Hole] = []
        """In the order of their frames."""
        self.below: list[Hole] = []
        """Numbers below the first one that was there: they may have come before the capture began;"""
        self.under = -1
        """and the newest of those that were there."""

    def add(self, pdu: Pdu, *, renewed: bool = False) -> None:
        """One more number: that of a request, or of a response whose request is not there.

        `renewed`: it stands for another call, if it was there before.
        """
        number = pdu.seq
        if number > self.highest:
            if number > self.highest + 1:
                _put(self.holes, Hole(self.newest.frame, pdu.frame, self.highest + 1, number - 1))
            self.highest, self.newest = number, pdu
        elif pdu is self.newest:
            return  # its first one
        elif number < self.lowest:
            if number < self.lowest - 1:
                _put(self.below, Hole(0, pdu.frame, number + 1, self.lowest - 1))
            self.lowest = self.under = number
        elif number == self.following:
            self.lowest, self.highest, self.newest, self.answered = number - 1, number, pdu, -1
            for hole in (*self.holes, *self.below):
                hole.over = True
        elif _fills(self.below, number):
            if number == self.under + 1:
                self.following = number + 1  # it counts up from there
            self.under = number
        elif not _fills(self.holes, number) and renewed:
            self.following, self.answered = number + 1, -1
            # One number for all calls does not count.
            if self.lowest < self.highest or not self.anew:
                self.anew = pdu.frame

    @property
    def heard(self) -> bool:
        """Whether one of its calls was answered."""
        return self.waited + self.ahead > 0

    def is_late(self, pdu: Pdu) -> bool:
        """Whether a message is of a call before the newest one, by its number and by the clock."""
        return pdu.seq < self.highest and pdu.time_ns < self.newest.time_ns

    def has(self, number: int) -> bool:
        """Whether a number was there."""
        return self.lowest <= number <= self.highest and not any(
            each.has(number) for each in self.holes
        )

    def fills(self, number: int) -> bool:
        """Whether a number was missing up to now; now it is there."""
        return _fills(self.holes, number) or _fills(self.below, number)


def _fills(holes: list[Hole], number: int) -> bool:
    for place, hole in enumerate(holes):
        if hole.has(number):
            holes[place : place + 1] = hole.without(number)
            _put(holes)
            return True
    return False


def _put(holes: list[Hole], *more: Hole) -> None:
    """More holes; the oldest are as one where there are too many."""
    holes += more
    while len(holes) > _KEPT:
        holes[1].take_in(holes.pop(0))


class Pair:
    """What one station says to another one."""

    __slots__ = (
        "activities", "disorder", "doubled", "half", "halves", "heard", "lost", "since", "unasked", "unread",
    )  # fmt: skip

    def __init__(self) -> None:
        self.activities: list[Numbers] = []
        self.since = 0
        """Since which frame all calls are of activities that were there before."""
        self.heard = False
        """Whether the station that is called has said anything,"""
        self.unasked: list[int] = []
        """and in which frames to a Write that is not there: the oldest one, and the newest ones."""
        self.unread: list[int] = []
        """The same of Reads that are not there,"""
        self.lost: list[int] = []
        """and the frames of calls without their responses: what was asked is known of those."""
        self.disorder = 0
        """The newest frame that was sent before one that comes before it; 0 for none."""
        self.doubled = False
        """Whether a response came twice on the wire, one behind the other."""
        self.half = self.halves = 0
        """The first frame of any call with one half, and how many there are."""

    @property
    def hears(self) -> bool:
        """Whether anything that the server sent to the client is in the capture up to now."""
        self.heard = self.heard or any(each.heard for each in self.activities)
        return self.heard

    @property
    def asks(self) -> bool:
        """Whether a call of the client is."""
        return bool(self.activities)

    @property
    def holes(self) -> list[Hole]:
        """All of them in the order of their frames."""
        return sorted(
            (hole for each in self.activities for hole in each.holes), key=lambda hole: hole.before
        )

    @property
    def newest_call(self) -> int:
        """The frame of the newest call of the client."""
        return max((each.newest.frame for each in self.activities), default=0)

    def has_half(self, frame: int) -> None:
        """A call is there in one half."""
        self.half = min(self.half or frame, frame)
        self.halves += 1

    def unknown(self, frame: int) -> None:
        """A Write was sent, and nobody knows where."""
        _keep(self.unasked, frame)

    @property
    def newest(self) -> int:
        """The newest frame behind which something may be missing; 0 for none."""
        holes = (each.holes[-1].before for each in self.activities if each.holes)
        return max([0, *self.lost, *self.unasked, *self.unread, *holes])


def _keep(frames: list[int], frame: int) -> None:
    frames.append(frame)
    if len(frames) > _KEPT:
        del frames[1]  # the newest ones are asked for


class Completeness:
    """Of every client and server, what is missing between them.

    Args:
        most: pairs and their activities that are remembered; the oldest goes first.
    """

    def __init__(self, most: int, lost_on_line: Callable[[int], int] = lambda _: 0) -> None:
        self._most = most
        self.lost_on_line = lost_on_line
        """The newest frame behind which something may be missing that was said with a station of PROFIBUS."""
        self._pairs: OrderedDict[tuple[str, str], Pair] = OrderedDict()
        self.late = self.first_late = 0
        """How many responses come before their request, and the frame of the first one."""

    # What is heard

    def began(self, pdu: Pdu, numbers: Numbers) -> None:
        """The first call of an activity to a server."""
        pair = self._pair(pdu.client, pdu.server)
        if numbers not in pair.activities:
            pair.activities.append(numbers)
            pair.since = pdu.frame
            if len(pair.activities) > _KEPT:
                pair.heard |= pair.activities.pop(0).heard
        back = self._pairs.get((pdu.server, pdu.client))
        if back is not None:
            back.heard = True

    def unasked(self, pdu: Pdu) -> None:
        """A response or fault whose request is not in the capture, as far as is known."""
        pair = self._pair(pdu.client, pdu.server)
        pair.heard = True
        pair.has_half(pdu.frame)
        if pdu.opnum == RPC_WRITE or pdu.ptype != _RESPONSE:  # a fault tells no place
            pair.unknown(pdu.frame)
        else:
            _keep(pair.unread, pdu.frame)

    def cut(self, pdu: Pdu) -> None:
        """A call of which nobody knows where it goes: a Write that is cut, or a response without a record."""
        self._pair(pdu.client, pdu.server).unknown(pdu.frame)

    def asked_after_all(self, response: Pdu) -> None:
        """The request of such a response came behind it."""
        pair = self._pair(response.client, response.server)
        for frames in (pair.unasked, pair.unread):
            if response.frame in frames:
                frames.remove(response.frame)
        pair.halves -= 1
        self.late += 1
        self.first_late = min(self.first_late or response.frame, response.frame)

    def disordered(self, pdu: Pdu) -> None:
        """A call of records stands behind one made later, by its number, and by the clock or an answer."""
        if pdu.opnum in (RPC_READ, RPC_WRITE, RPC_READ_IMPLICIT):
            pair = self._pair(pdu.client, pdu.server)
            pair.disorder = max(pair.disorder, pdu.frame)

    def doubled(self, response: Pdu) -> None:
        """A response came once more, later than a mirror port brings one."""
        self._pair(response.client, response.server).doubled = True

    def lost(self, request: Pdu, *, went_on: bool) -> None:
        """A call has no response; where its client went on, the capture lacks one half."""
        pair = self._pair(request.client, request.server)
        _keep(pair.lost, request.frame)
        if went_on:
            pair.has_half(request.frame)

    def _pair(self, client: str, server: str) -> Pair:
        pair = self._pairs.get((client, server))
        if pair is None:
            pair = self._pairs[client, server] = Pair()
            back = self._pairs.get((server, client))
            pair.heard = back is not None and back.asks
            if len(self._pairs) > self._most:
                self._pairs.popitem(last=False)
        return pair

    # What is asked

    def lacks(self, client: str, server: str) -> Pair:
        """What is missing between two stations."""
        return self._pairs.get((client, server)) or Pair()

    def behind(
        self, client: str, server: str, since: int, *, ordered: bool = False
    ) -> What | Hole | None:
        """What may be missing of the calls of a client behind a frame; None where nothing can be.

        That calls are out of order does not count where they are known to be `ordered`.

        Of two activities nothing follows from their numbers. There it counts whether the capture lacks anything of
        this pair.
        """
        pair = self._pairs.get((client, server))
        if pair is None or not pair.activities:
            return "requests"
        across, anew = since < pair.since, 0
        for numbers in pair.activities:
            if numbers.holes and (across or numbers.holes[-1].before > since):
                return numbers.holes[-1]
            anew = max(anew, numbers.anew)
        if pair.unasked and (across or pair.unasked[-1] > since):
            return "requests"
        if pair.disorder and pair.disorder >= since and not ordered:
            return "halves"
        if anew > since:
            return "renewed"
        if not (pair.heard or pair.hears):
            return "one_direction"
        return "halves" if across and (pair.lost or pair.unread) else None

    def waits(self, client: str, server: str) -> bool:
        """Whether a client waits for each response as a rule, on a wire that doubles them.

        Then one that came behind its next call may be the second one, and the first is not in the capture.
        """
        pair = self._pairs.get((client, server))
        if pair is None or not pair.doubled:
            return False
        ahead = sum(each.ahead for each in pair.activities)
        return _RARELY * ahead < sum(each.waited for each in pair.activities)

    def spoke_ns(self, client: str, server: str) -> int | None:
        """The time of the newest call of a client to a server, by the numbers; None for none."""
        pair = self._pairs.get((client, server))
        times = [each.newest.time_ns for each in pair.activities] if pair is not None else []
        return max(times, default=None)

    def newest(self, server: str) -> int:
        """The newest frame behind which something that was said with a server may be missing; 0 for none."""
        if server.startswith(STATION):
            return self.lost_on_line(int(server.removeprefix(STATION)))
        pairs = (pair for (_, called), pair in self._pairs.items() if called == server)
        return max((pair.newest for pair in pairs), default=0)

    def newest_gap(self, server: str) -> int:
        """The newest frame before which a request to a server may be missing; 0 for none.

        So it is before numbers that are missing of anybody. A call without its response hides none.
        """
        found = [hole.before for pair in self._pairs.values() for hole in pair.holes]
        if server.startswith(STATION):
            found.append(self.newest(server))
        for (_, called), pair in self._pairs.items():
            found += [*pair.unasked, *pair.unread] if called == server else ()
        return max(found, default=0)
