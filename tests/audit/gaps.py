"""What a capture of PROFINET does not have, by its frames alone; and whether a sentence of absence may be said.

A client numbers the calls of an activity one after the other, whoever is called and by which interface. So a number
between two others that nobody saw is a call that nobody saw. It may be the one that a sentence says never was.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf
from uuid import UUID

from tests.audit import wire

RECORDS = (wire.READ, wire.WRITE, wire.IMPLICIT)


@dataclass(frozen=True)
class Gap:
    """Numbers that are missing, and the frames of the calls around them."""

    first: int
    last: int
    after: int
    before: int

    @property
    def text(self) -> str:
        return str(self.first) if self.first == self.last else f"{self.first}..{self.last}"


class Gaps:
    """What is missing of what stations say to each other."""

    def __init__(self, capture: wire.Capture) -> None:
        self._capture = capture
        self._seen: dict[tuple[str, UUID], dict[int, int]] = defaultdict(dict)
        """Of each activity its numbers, and in which frames they were seen first."""
        self._of: dict[tuple[str, str], set[UUID]] = defaultdict(set)
        for frame, client, server, activity, number in capture.numbers:
            self._seen[client, activity].setdefault(number, frame)
            self._of[client, server].add(activity)
        self._answered: dict[tuple[str, UUID], set[int]] = defaultdict(set)
        """The numbers of which a response came behind those of later calls: they are not missing."""
        for stray in capture.strays:
            key, number = (stray.client, stray.activity), stray.sequence
            seen = self._seen[key]
            before = [each for each, frame in seen.items() if frame < stray.frame]
            if before and number > max(before):
                seen.setdefault(number, stray.frame)
            elif before:
                self._answered[key].add(number)

    @cached_property
    def heard(self) -> set[tuple[str, str]]:
        """Who said anything to whom."""
        return {(each.source, each.target) for each in self._capture.pdus}

    def spoke(self, client: str, server: str) -> float:
        """The first frame in which a server said something to a client."""
        frames = (e.frame for e in self._capture.pdus if (e.source, e.target) == (server, client))
        return min(frames, default=inf)

    @cached_property
    def asked(self) -> set[tuple[str, str]]:
        """Who called whom."""
        return {pair for pair, activities in self._of.items() if activities}

    def of(self, client: str, server: str) -> list[Gap]:
        """The numbers that are missing of the activities in which a client calls a server."""
        found = []
        for activity in self._of[client, server]:
            seen = self._seen[client, activity]
            for one, two in pairwise(sorted(seen)):
                known = {one, two} | self._answered[client, activity]
                inside = sorted(each for each in known if one <= each <= two)
                found += [
                    Gap(low + 1, high - 1, seen[one], seen[two])
                    for low, high in pairwise(inside) if high > low + 1
                ]  # fmt: skip
        return sorted(found, key=lambda each: each.before)

    def began_behind(self, client: str, server: str, frame: int) -> bool:
        """Whether an activity has its first call behind a frame: of two nothing follows from their numbers."""
        activities = self._of[client, server]
        return any(min(self._seen[client, each].values()) > frame for each in activities)

    def strays(self, client: str, server: str) -> list[wire.Pdu]:
        """The responses without a request."""
        return [
            each for each in self._capture.strays
            if (each.target, each.source) == (client, server)
        ]  # fmt: skip

    def halves(self, client: str, server: str) -> list[int]:
        """The frames of calls of which one half is there: no request, or no response though its client went on."""
        # One that came twice is of one call.
        strays = {each.key: each.frame for each in reversed(self.strays(client, server))}
        found = [*strays.values()]
        newest = {each.request.key: each.request.frame for each in self._capture.calls}
        for call in self._capture.calls:
            asked = call.request
            mine = (asked.source, asked.target) == (client, server) and call.response is None
            seen = self._seen[client, asked.activity]
            anew = newest[asked.key] > asked.frame
            again = (
                asked.operation != wire.WRITE and strays.get(asked.key, asked.frame) < asked.frame
            )
            if mine and not again and (asked.sequence < max(seen, default=0) or anew):
                found.append(asked.frame)
        return sorted(found)

    def newest_call(self, client: str, server: str) -> int:
        """The frame of the newest call of a client to a server, by the numbers of its activities."""
        seen = (self._seen[client, each] for each in self._of[client, server])
        return max((each[max(each)] for each in seen), default=0)

    def cut(self, client: str, server: str) -> list[int]:
        """The frames of calls of which the capture cut off where they go, or some of their records."""
        return [
            call.request.frame for call in self._capture.calls
            if call.request.cut and call.request.operation in RECORDS and wire.is_placeless(call.request)
            and (call.request.source, call.request.target) == (client, server)
        ]  # fmt: skip

    def newest(self, server: str) -> int:
        """The frame behind which nothing is missing of what anybody asked of a server; 0 where nothing is."""
        if self._capture.line is not None:
            known = server.removeprefix("dp").isdigit()
            return max([0, *(self.turns(server) if known else [])])
        pairs = {(client, called) for client, called in self._of if called == server}
        pairs |= {
            (each.target, each.source) for each in self._capture.strays if each.source == server
        }
        found = [gap.before for pair in pairs for gap in self.of(*pair)]
        found += [frame for pair in pairs for frame in (*self.halves(*pair), *self.cut(*pair))]
        found += [
            each.request.frame for each in self._capture.calls
            if each.response is None and (each.request.source, each.request.target) in pairs
        ]  # fmt: skip
        return max([0, *found])

    def newest_gap(self, server: str) -> int:
        """The frame behind which no number of anybody, and no request to a server, is missing; 0 where none is."""
        found = [gap.before for pair in self._of for gap in self.of(*pair)]
        if self._capture.line is not None:
            return max([self.newest(server), *found])
        found += [each.frame for each in self._capture.strays if each.source == server]
        clients = {client for client, called in self._of if called == server}
        return max(
            [0, *found, *(frame for client in clients for frame in self.cut(client, server))]
        )

    def turns(self, station: str) -> list[int]:
        """Of a station of PROFIBUS the requests behind which an answer is missing, or an exchange before them.

        A master repeats what has no answer, and turns the FCB round with each new request. Of the last one nothing
        tells that.
        """
        line = self._capture.line
        newest = (
            max((each.asked.number for each in line.turns if not each.silent), default=0)
            if line
            else 0
        )
        turns = line.of(int(station.removeprefix("dp"))) if line is not None else []
        found = [
            each.asked.number + 1 for each in turns
            if each.asked.counts and each.answer is None and not each.repeats and not each.last
            and each.asked.number < newest
        ]  # fmt: skip
        cut = [each.number for each in line.flow if f"dp{each.torn}" == station] if line else []
        return found + [each.asked.number for each in turns if each.hole] + cut

    def late(self, client: str, server: str) -> list[int]:
        """The frames of responses that come before their requests."""
        return [
            call.response.frame for call in self._capture.calls
            if call.response is not None and call.response.frame < call.request.frame
            and (call.request.source, call.request.target) == (client, server)
        ]  # fmt: skip

    def unheard(self, client: str, server: str) -> Iterator[str]:
        """Whose part of a conversation is not in the capture at all."""
        if (client, server) not in self.asked:
            yield f"nothing that {client} asked is in the capture"
        elif (server, client) not in self.heard:
            yield f"nothing that {server} said is in the capture"

    def leaves_open(self, client: str, server: str, first: int, last: int) -> bool:
        """Whether a call may be missing between two frames, also by what another activity leaves open."""
        lacks = bool(self.halves(client, server) or self.of(client, server))
        other = lacks and self.began_behind(client, server, first)
        cut = any(first < each <= last for each in self.cut(client, server))
        return other or cut or any(self.between(client, server, first, last))

    def between(self, client: str, server: str, first: int, last: int) -> Iterator[str]:
        """Why a Write may be missing between two frames."""
        for gap in self.of(client, server):
            if first < gap.before <= last:
                yield f"calls {gap.text} are not in the capture (frames {gap.after} to {gap.before})"
        for stray in self.strays(client, server):
            reads = stray.operation in (wire.READ, wire.IMPLICIT)
            nowhere = reads and len(stray.body) < 20 + wire.HEAD
            if (stray.operation == wire.WRITE or nowhere) and first < stray.frame < last:
                yield f"the request answered in frame {stray.frame} is not in the capture"
