"""Reads and writes of variables with their answers (docs/s7.md 4).

An answer belongs to the open job of its connection that the other end asked with the same PDU reference.
References have no order to rely on, and some clients use one for all: a new job ends the open one of the same.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from ds47.s7 import model
from ds47.s7 import pdu as pdus
from ds47.s7.pdu import READ, WRITE, S7Pdu
from ds47.spec.semantics import Limits

OPERATIONS = {READ: model.GET, WRITE: model.PUT}
_Key = tuple[int, bool, int]
"""Number of the connection, whether its client asks, reference."""
Hear = Callable[[model.S7Job], None]


class Jobs:
    """The open jobs of all connections.

    Args:
        bounds: how many may be open, how long, and how many bytes they may take.
        asked: gets each job at its request.
        over: gets each finished job.
    """

    def __init__(self, bounds: Limits, asked: Hear, over: Hear) -> None:
        self._bounds = bounds
        self._asked = asked
        self._over = over
        self._open: OrderedDict[_Key, model.S7Job] = OrderedDict()
        """In the order in which they were asked."""
        self._count: dict[tuple[int, bool], int] = {}
        self._newest: dict[tuple[int, bool], int] = {}
        """Number of a connection, whether its client asks -> the reference of the newest job."""
        self._bytes = 0

    def asked(
        self, connection: model.S7Connection, from_client: bool, pdu: S7Pdu, at: model.At
    ) -> None:
        """A read or a write."""
        found = pdus.variables(pdu)
        job = model.S7Job(
            OPERATIONS[pdu.parameter[0]], connection, from_client, pdu.reference, at, found.items,
            request=pdu.data, groups=found.groups, flaws=pdu.flaws,
            frames=pdu.frames,
        )  # fmt: skip
        side = connection.number, from_client
        key = connection.number, from_client, pdu.reference
        job.same_reference = self._newest.get(side) == pdu.reference
        self._newest[side] = pdu.reference
        if self._open:
            self._give_up(key)
            self._expire(at)
        self._open[key] = job
        self._bytes += len(job.request)
        open_now = self._count[side] = self._count.get(side, 0) + 1
        if open_now > connection.most_open:
            connection.most_open = open_now
        self._asked(job)
        if open_now > self._bounds.s7_jobs:
            self._give_up(next(each for each in self._open if each[:2] == side))
        while self._bytes > self._bounds.s7_bytes:
            self._give_up(next(iter(self._open)))

    def answered(
        self, connection: model.S7Connection, from_client: bool, pdu: S7Pdu, at: model.At
    ) -> bool:
        """An answer; False where it is none to a read or a write."""
        key = connection.number, not from_client, pdu.reference
        job, function = self._open.get(key), pdu.function
        if job is not None and job.same_reference and connection.lacks(job.from_client):
            self._give_up(key, lost=True)  # the answer may be that to a missing request
            job = None
        if function in OPERATIONS and (job is None or OPERATIONS[function] != job.operation):
            self._orphan(connection, from_client, pdu, at)
            return True
        if job is None or (function is not None and function not in OPERATIONS):
            return False
        self._take(key)
        job.answered, job.response, job.error = at, pdu.data, pdu.error
        job.frames += pdu.frames
        results = pdus.results(pdu) if function is not None else []
        job.answer_flaws = pdu.flaws
        if pdu.error:
            job.state = model.REFUSED
        else:
            job.answer_flaws += pdus.settle(job.items, job.groups, results)
            job.state = _state(job.items)
        self._close(job)
        return True

    def lose(self, connection: model.S7Connection) -> None:
        """Bytes of a connection are lost: the answers to its open jobs may be among them."""
        for key, job in self._open.items():
            if key[0] == connection.number:
                job.lost = True

    def close(self, connection: model.S7Connection, since: int | None) -> None:
        """A connection is over; where there is a time, the capture is: an answer to what is younger may come."""
        for key in [each for each in self._open if each[0] == connection.number]:
            job = self._open[key]
            job.lost = job.lost or is_recent(job, since)
            self._give_up(key)
        for from_client in (True, False):
            self._count.pop((connection.number, from_client), None)
            self._newest.pop((connection.number, from_client), None)

    def _orphan(
        self, connection: model.S7Connection, from_client: bool, pdu: S7Pdu, at: model.At
    ) -> None:
        """An answer to which there is no job."""
        items = [model.S7Item(None, each.data, each.code) for each in pdus.results(pdu)]
        job = model.S7Job(
            OPERATIONS[pdu.parameter[0]], connection, not from_client, pdu.reference, None, items,
            answered=at, response=pdu.data, error=pdu.error, state=model.ORPHAN, answer_flaws=pdu.flaws,
            frames=pdu.frames,
        )  # fmt: skip
        self._close(job)

    def _expire(self, now: model.At) -> None:
        while self._open:
            key, job = next(iter(self._open.items()))
            if (
                job.asked is None
                or abs(now.time_ns - job.asked.time_ns) <= self._bounds.call_expiry_ns
            ):
                return
            self._give_up(key)

    def _take(self, key: _Key) -> model.S7Job | None:
        job = self._open.pop(key, None)
        if job is not None:
            self._bytes -= len(job.request)
            self._count[key[0], key[1]] -= 1
        return job

    def _give_up(self, key: _Key, *, lost: bool = False) -> None:
        job = self._take(key)
        if job is not None:
            job.lost = lost or job.lost or job.connection.lacks(not job.from_client)
            job.state = model.INCOMPLETE if job.lost else model.UNANSWERED
            self._close(job)

    def _close(self, job: model.S7Job) -> None:
        self._over(job)
        job.phase = "closed"


def is_recent(job: model.S7Job, since: int | None) -> bool:
    """Whether a job was asked, or a segment of it sent, at this time or later."""
    last = job.segments[-1].at if job.segments else job.asked
    return since is not None and last is not None and last.time_ns >= since


def _state(items: list[model.S7Item]) -> str:
    """The state of a job from the results of its items."""
    done = 0
    for item in items:
        done += item.code == model.DONE
    if done == len(items):
        return model.OK
    return model.PARTIAL if done else model.ERROR
