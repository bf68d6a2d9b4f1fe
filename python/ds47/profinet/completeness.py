"""What the capture lacks of a conversation: one judgement for every rule about absence.

Lives here: missing sequence numbers of calls, Writes without their requests, and stations that were never heard. A
missing number shows that a call may be missing, and says nothing about responses. Gapless numbers prove nothing
across activities. `ds47.acyclic.pairing` decides what that means for a transaction (docs/pairing.md, P73).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Final, NamedTuple

from ds47.profinet.records import Peer
from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import RPC_READ, RPC_READ_IMPLICIT, RPC_WRITE

STATION: Final = "dp"
"""The prefix of the name of a PROFIBUS station; its address follows."""
_RESPONSE: Final = 2
_KEPT: Final = 64
"""How many holes of an activity, and lone responses of a pair, are kept one by one."""
_RARELY: Final = 4
"""If only one in so many calls is an exception, there is a habit."""


class Missing(NamedTuple):
    """What is not in the capture, so that nobody can say that it did not come (docs/pairing.md, P73).

    Attributes:
        what: a key of diagnoses.toml.
        first: the frame behind which it is missing,
        last: the frame before which it is,
        numbers: and the RPC sequence numbers, as far as these are known.
    """

    what: str
    first: int | None = None
    last: int | None = None
    numbers: str | None = None


class Hole:
    """Missing sequence numbers of an activity, between two of its requests.

    Attributes:
        after: frame of the request before the hole, 0 if unknown.
        before: frame of the request after it.
        first: the first missing number.
        last: the last missing number.
        over: whether the client has restarted its numbers since, so that none of these can come any more.
    """

    __slots__ = ("after", "before", "first", "last", "over")

    def __init__(self, after: int, before: int, first: int, last: int) -> None:
        self.after, self.before, self.first, self.last = after, before, first, last
        self.over = False

    def has(self, number: int) -> bool:
        """Whether a number is missing, and may still come."""
        return self.first <= number <= self.last and not self.over

    def without(self, number: int) -> list[Hole]:
        """What is left of it after one of its numbers came."""
        parts = (self.first, number - 1), (number + 1, self.last)
        return [Hole(self.after, self.before, *each) for each in parts if each[0] <= each[1]]

    def numbers(self) -> str:
        """Its numbers, for a sentence."""
        return str(self.first) if self.first == self.last else f"{self.first}..{self.last}"

    def take_in(self, older: Hole) -> None:
        """Merges an older hole and everything between."""
        self.after, self.first = older.after, min(older.first, self.first)
        self.last = max(older.last, self.last)


class Numbers:
    """The sequence numbers of one activity, as a set: they may come out of order."""

    __slots__ = (
        "ahead", "anew", "answered", "below", "following", "highest", "holes", "lowest", "newest",
        "passed", "sure", "under", "waited",
    )  # fmt: skip

    def __init__(self, pdu: Pdu) -> None:
        self.lowest = self.highest = pdu.seq
        self.following: int | None = None
        """If this number comes, the client has restarted its numbers."""
        self.anew = 0
        """The newest frame at which a client may have restarted: calls up to there are unknown. 0 for none."""
        self.newest = pdu
        """The request with the highest number."""
        self.answered = -1
        """The highest answered number since the last restart: the client has moved on from those before it."""
        self.passed = False
        """Whether a call was answered before a call with a lower number."""
        self.waited = self.ahead = 0
        """How many calls were answered before the next one was sent, and how many after it."""
        self.holes: list[Hole] = []
        """In the order of their frames."""
        self.below: list[Hole] = []
        """Missing numbers below the first one seen: they may be from before the capture."""
        self.under = -1
        """The newest number seen below the first one."""
        self.sure: dict[tuple[str, str], int] = {}
        """`Completeness.sure`, which no longer holds once a number is missing."""

    def add(self, pdu: Pdu, *, renewed: bool = False) -> None:
        """One more number, of a request, or of a response without its request.

        `renewed`: if the number was there before, this is another call.
        """
        number = pdu.seq
        self.sure.clear()
        if number > self.highest:
            if number > self.highest + 1:
                _put(self.holes, Hole(self.newest.frame, pdu.frame, self.highest + 1, number - 1))
            self.highest, self.newest = number, pdu
        elif pdu is self.newest:
            return  # the first request of the activity
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
                self.following = number + 1  # the client counts up from there
            self.under = number
        elif not _fills(self.holes, number) and renewed:
            self.following, self.answered = number + 1, -1
            # One number for all calls does not count.
            if self.lowest < self.highest or not self.anew:
                self.anew = pdu.frame

    @property
    def heard(self) -> bool:
        """Whether any of its calls was answered."""
        return self.waited + self.ahead > 0

    def is_late(self, pdu: Pdu) -> bool:
        """Whether a message belongs to a call before the newest one, by number and by clock."""
        return pdu.seq < self.highest and pdu.time_ns < self.newest.time_ns

    def has(self, number: int) -> bool:
        """Whether a number was there."""
        return self.lowest <= number <= self.highest and not any(
            each.has(number) for each in self.holes
        )

    def sent_before(self, number: int) -> int:
        """The frame of the first call after a missing one; 0 if none is known."""
        return next((each.before for each in (*self.holes, *self.below) if each.has(number)), 0)

    def fills(self, number: int) -> bool:
        """Whether a number was missing until now, and fills its hole."""
        return _fills(self.holes, number) or _fills(self.below, number)


def _fills(holes: list[Hole], number: int) -> bool:
    for at, hole in enumerate(holes):
        if hole.has(number):
            holes[at : at + 1] = hole.without(number)
            _put(holes)
            return True
    return False


def _put(holes: list[Hole], *more: Hole) -> None:
    """Adds holes; beyond the limit the oldest ones are merged."""
    holes += more
    while len(holes) > _KEPT:
        holes[1].take_in(holes.pop(0))


class Pair:
    """What one station has said to another, as client to server."""

    __slots__ = (
        "activities", "disorder", "doubled", "half", "halves", "heard", "lost", "since", "unasked", "unended",
        "unread",
    )  # fmt: skip

    def __init__(self) -> None:
        self.activities: list[Numbers] = []
        self.since = 0
        """The frame of the first call of the newest activity."""
        self.heard = False
        """Whether the server has said anything."""
        self.unasked: list[int] = []
        """Frames of responses to a missing Write: the oldest one, and the newest ones."""
        self.unread: list[int] = []
        """Frames of responses to a missing Read, likewise."""
        self.lost: list[int] = []
        """Frames of calls without their responses; their requests are known."""
        self.unended: list[int] = []
        """The same of calls that were the last ones of their activities when the capture ended."""
        self.disorder = 0
        """The newest frame that was sent earlier than a frame before it; 0 for none."""
        self.doubled = False
        """Whether a response came twice on the wire, one after the other."""
        self.half = self.halves = 0
        """The first frame of a call with only one half, and the number of such calls."""

    @property
    def hears(self) -> bool:
        """Whether the capture so far has anything that the server sent to the client."""
        self.heard = self.heard or any(each.heard for each in self.activities)
        return self.heard

    @property
    def asks(self) -> bool:
        """Whether the capture so far has a call of the client."""
        return bool(self.activities)

    @property
    def holes(self) -> list[Hole]:
        """All holes in the order of their frames."""
        return sorted(
            (hole for each in self.activities for hole in each.holes), key=lambda hole: hole.before
        )

    @property
    def newest_call(self) -> int:
        """The frame of the client's newest call."""
        return max((each.newest.frame for each in self.activities), default=0)

    def has_half(self, frame: int) -> None:
        """A call has only one half."""
        self.half = min(self.half or frame, frame)
        self.halves += 1

    def unknown(self, frame: int) -> None:
        """A Write went to an unknown place."""
        _keep(self.unasked, frame)

    def sure_since(self) -> int:
        """A frame behind which nothing is missing, once the server was heard."""
        gaps = [each.holes[-1].before for each in self.activities if each.holes] + self.unasked[-1:]
        if gaps or self.lost or self.unread:
            gaps.append(self.since)
        return max([self.disorder + 1, *gaps, *(each.anew for each in self.activities)])

    @property
    def newest(self) -> int:
        """The newest frame at a possible gap; 0 for none."""
        holes = (each.holes[-1].before for each in self.activities if each.holes)
        return max([0, *self.lost, *self.unended, *self.unasked, *self.unread, *holes])


def _keep(frames: list[int], frame: int) -> None:
    frames.append(frame)
    if len(frames) > _KEPT:
        del frames[1]  # the newest ones are needed


class Completeness:
    """What is missing between each client and server.

    Args:
        most: how many pairs to remember; the oldest goes first.
    """

    def __init__(self, most: int, lost_on_line: Callable[[int], int] = lambda _: 0) -> None:
        self._most = most
        self.lost_on_line = lost_on_line
        """The newest frame at a possible gap in the traffic of a PROFIBUS station."""
        self._pairs: OrderedDict[tuple[str, str], Pair] = OrderedDict()
        self.late = self.first_late = 0
        """How many responses come before their requests, and the frame of the first one."""
        self.sure: dict[tuple[str, str], int] = {}
        """Client and server -> a frame behind which nothing is missing; forgotten once anything is."""

    # What is heard

    def began(self, pdu: Pdu, numbers: Numbers) -> None:
        """The first call of an activity to a server."""
        pair, numbers.sure = self._pair(pdu.client, pdu.server), self.sure
        if numbers not in pair.activities:
            pair.activities.append(numbers)
            pair.since = pdu.frame
            if len(pair.activities) > _KEPT:
                pair.heard |= pair.activities.pop(0).heard
        back = self._pairs.get((pdu.server, pdu.client))
        if back is not None:
            back.heard = True

    def unasked(self, pdu: Pdu) -> None:
        """A response or fault without its request in the capture, so far."""
        pair = self._pair(pdu.client, pdu.server)
        pair.heard = True
        pair.has_half(pdu.frame)
        if pdu.opnum == RPC_WRITE or pdu.ptype != _RESPONSE:  # a fault names no place
            pair.unknown(pdu.frame)
        else:
            _keep(pair.unread, pdu.frame)

    def cut(self, pdu: Pdu) -> None:
        """A call to an unknown place: a truncated Write, or a response without a record."""
        self._pair(pdu.client, pdu.server).unknown(pdu.frame)

    def asked_after_all(self, response: Pdu) -> None:
        """The request of such a response came after it."""
        pair = self._pair(response.client, response.server)
        for frames in (pair.unasked, pair.unread):
            if response.frame in frames:
                frames.remove(response.frame)
        pair.halves -= 1
        self.late += 1
        self.first_late = min(self.first_late or response.frame, response.frame)

    def disordered(self, pdu: Pdu) -> None:
        """A record call comes after one that was made later, by its number, and by the clock or an answer."""
        if pdu.opnum in (RPC_READ, RPC_WRITE, RPC_READ_IMPLICIT):
            pair = self._pair(pdu.client, pdu.server)
            pair.disorder = max(pair.disorder, pdu.frame)

    def doubled(self, response: Pdu) -> None:
        """A response came once more, too late for a copy of a mirror port."""
        self._pair(response.client, response.server).doubled = True

    def lost(self, request: Pdu, *, went_on: bool, ended: bool = False) -> None:
        """A call has no response; if its client went on, the capture lacks one half, else maybe only its end."""
        pair = self._pair(request.client, request.server)
        _keep(pair.unended if ended and not went_on else pair.lost, request.frame)
        if went_on:
            pair.has_half(request.frame)

    def _pair(self, client: str, server: str) -> Pair:
        """The pair, about to learn what is missing."""
        self.sure.clear()
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

    def missing_after(self, peer: Peer, since: int, *, ordered: bool = False) -> Missing | None:
        """What may be missing of the calls of a controller after a frame; None for nothing.

        Out-of-order calls do not count if the calls are known to be `ordered`.

        Numbers prove nothing across activities. There it counts whether the capture lacks anything of this pair.
        """
        if peer.station is not None:
            return Missing("line") if self.lost_on_line(peer.station) > since else None
        pair = self._pairs.get(peer[:2])
        if pair is None or not pair.activities:
            return Missing("requests")
        across, anew = since < pair.since, 0
        for numbers in pair.activities:
            if numbers.holes and (across or numbers.holes[-1].before > since):
                hole = numbers.holes[-1]
                return Missing("calls", hole.after or None, hole.before, hole.numbers())
            anew = max(anew, numbers.anew)
        if pair.unasked and (across or pair.unasked[-1] > since):
            return Missing("requests")
        if pair.disorder and pair.disorder >= since and not ordered:
            return Missing("halves")
        if anew > since:
            return Missing("renewed")
        if not (pair.heard or pair.hears):
            return Missing("one_direction")
        if across and (pair.lost or pair.unread):
            return Missing("halves")
        self.sure[peer[:2]] = pair.sure_since()
        return None

    def waits(self, client: str, server: str) -> bool:
        """Whether a client usually waits for each response, on a wire that doubles or a capture that lacks some.

        Then a response after the client's next call may be the second copy, with the first one not captured.
        """
        pair = self._pairs.get((client, server))
        if pair is None:
            return False
        lacking = pair.doubled or pair.newest or any(each.passed for each in pair.activities)
        ahead = sum(each.ahead for each in pair.activities)
        return bool(lacking) and _RARELY * ahead < sum(each.waited for each in pair.activities)

    def spoke_ns(self, client: str, server: str) -> int | None:
        """The time of the newest call of a client to a server, by its number; None for none."""
        pair = self._pairs.get((client, server))
        times = [each.newest.time_ns for each in pair.activities] if pair is not None else []
        return max(times, default=None)

    def newest(self, server: str) -> int:
        """The newest frame at a possible gap in the traffic of a server; 0 for none."""
        if server.startswith(STATION):
            return self.lost_on_line(int(server.removeprefix(STATION)))
        pairs = (pair for (_, called), pair in self._pairs.items() if called == server)
        return max((pair.newest for pair in pairs), default=0)

    def newest_gap(self, server: str) -> int:
        """The newest frame with a request to a server possibly missing before it; 0 for none.

        Missing numbers of any pair count. A call without its response hides no request.
        """
        found = [hole.before for pair in self._pairs.values() for hole in pair.holes]
        if server.startswith(STATION):
            found.append(self.newest(server))
        for (_, called), pair in self._pairs.items():
            found += [*pair.unasked, *pair.unread] if called == server else ()
        return max(found, default=0)
