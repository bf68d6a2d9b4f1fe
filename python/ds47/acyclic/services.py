"""Reads and writes of records by MS1 and MS2, from the exchanges of a line (docs/profibus.md 6).

A master requests a service once, and polls until the answer is there. SC, no data and empty answers mean: not yet.
Not here: what a record asks for, and what "not ready" (B5) means for it. Every DS_Read is a call of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from ds47.profibus import dp, ms1
from ds47.profibus.line import Exchange, LineFrame
from ds47.profinet.records import NIL_UUID, NO_API, Half, Record

_IDLE = "idle"
"""The function that keeps a connection of MS2 alive: no service, and no answer to one."""
MOST_POLLS = 64
"""How many polls of a call are kept."""
MOST_OPEN = 1_024
"""How many open calls are kept: eight for each station that a line can have."""


@dataclass(slots=True, eq=False)
class ServiceCall:
    """A DS_Read or DS_Write with its answer; the pairing takes its `record`.

    `record.response.status` is 0, or the status of the refusal (docs/profibus.md 4); `record.ar` is empty.
    """

    master: int
    station: int
    """The address of the slave."""
    sap: int
    """The SAP of the slave: 51 for MS1."""
    record: Record
    polls: list[Exchange] = field(default_factory=list)
    """The first exchanges without an answer, beginning with that of the request."""
    polled: int = 0
    """The number of exchanges without an answer."""
    fault: int | None = None
    """The function code that refused it below MS1: 3 if the SAP is not enabled."""


Became = tuple[Literal["asked", "answered", "failed", "lost", "unasked"], ServiceCall]
"""What happened to a call:

    asked      its request
    answered   it has its answer, positive or negative
    failed     the station refused it below MS1 (`fault`); `record.response` only has frame and time
    lost       another service began, or nothing came any more; or it is the oldest of too many
    unasked    an answer without its request; a negative one has neither slot nor index, and is left out
"""


class ServiceTracker:
    """Takes the exchanges of a line and returns what happens to the calls in them."""

    SERVICES: ClassVar = frozenset({dp.RECORD, dp.MS2})

    def __init__(self) -> None:
        self._open: dict[tuple[int, int, int], ServiceCall] = {}

    def take(self, exchange: Exchange) -> list[Became]:
        """Takes an exchange. Returns what happened to calls; only MS1 and MS2 count."""
        item, news = exchange.request.item, list[Became]()
        if dp.service(item) not in self.SERVICES or not item.request:
            return news
        station, sap, master = item.da, item.dsap, item.sa
        if station is None or sap is None or master is None:
            return news
        key = (master, station, sap)
        asked = ms1.decode(item.du, request=True)
        if asked.kind == ms1.REQUEST and asked.function != _IDLE and not exchange.again:
            self._asked(key, asked, exchange, news)
        self._answer(key, exchange, news)
        return news

    def finish(self) -> list[Became]:
        """The capture is over."""
        news: list[Became] = []
        for key in list(self._open):
            self._lose(key, news)
        return news

    def _asked(
        self,
        key: tuple[int, int, int],
        asked: ms1.Ms1Message,
        exchange: Exchange,
        news: list[Became],
    ) -> None:
        self._lose(key, news)
        if asked.code not in (ms1.READ, ms1.WRITE) or asked.slot is None or asked.index is None:
            return
        write = asked.code == ms1.WRITE
        half = _half(exchange.request, asked)
        record = Record(write, False, NIL_UUID, NO_API, asked.slot, 0, asked.index, 0, half)
        master, station, sap = key
        call = self._open[key] = ServiceCall(master, station, sap, record)
        news.append(("asked", call))
        if len(self._open) > MOST_OPEN:
            self._lose(next(iter(self._open)), news)

    def _answer(self, key: tuple[int, int, int], exchange: Exchange, news: list[Became]) -> None:
        seen, call = exchange.answer, self._open.get(key)
        answer = None if seen is None else ms1.decode(seen.item.du, request=False)
        if call is not None and _may_be_of_another(call, exchange, answer):
            self._lose(key, news)
            return
        if call is not None and seen is not None and dp.refuses(seen.item):
            call.fault = seen.item.code
            call.record.response = Half(seen.frame, seen.time_ns)
            del self._open[key]
            news.append(("failed", call))
            return
        if seen is None or answer is None or answer.kind == ms1.TAKEN or answer.function == _IDLE:
            if call is not None:
                call.polled += 1
                if call.polled <= MOST_POLLS:
                    call.polls.append(exchange)
        elif answer.function not in ("read", "write"):
            self._lose(key, news)
        elif call is not None and _is_of(call.record, answer):
            del self._open[key]
            call.record.response = _half(seen, answer)
            news.append(("answered", call))
        elif not exchange.again:
            self._unasked(key, answer, seen, news)

    def _unasked(
        self, key: tuple[int, int, int], answer: ms1.Ms1Message, seen: LineFrame, news: list[Became]
    ) -> None:
        if answer.slot is not None and answer.index is not None:
            self._lose(key, news)
            write = answer.function == "write"
            record = Record(write, False, NIL_UUID, NO_API, answer.slot, 0, answer.index, 0)
            record.response = _half(seen, answer)
            news.append(("unasked", ServiceCall(*key, record)))

    def _lose(self, key: tuple[int, int, int], news: list[Became]) -> None:
        call = self._open.pop(key, None)
        if call is not None:
            news.append(("lost", call))


def _is_of(record: Record, answer: ms1.Ms1Message) -> bool:
    """Whether an answer belongs to a request; a refusal names no place. If not, its request was not captured."""
    place = answer.slot, answer.index
    same = place in ((None, None), (record.slot, record.index))
    return same and record.write == (answer.function == "write")


def _may_be_of_another(
    call: ServiceCall, exchange: Exchange, answer: ms1.Ms1Message | None
) -> bool:
    """Whether a refusal, which names no place, may be for a request that was not captured."""
    seen, asked = exchange.answer, call.record.request
    if seen is None or asked is None or exchange.hole <= asked.frame:
        return False
    return dp.refuses(seen.item) or (answer is not None and answer.kind == ms1.REFUSAL)


def _half(seen: LineFrame, message: ms1.Ms1Message) -> Half:
    """A message as one half of a record call.

    A DS_Read carries no data, and says how many bytes it wants. The answer to a DS_Write repeats the length, and
    carries no data either.
    """
    if message.kind == ms1.REFUSAL:
        return Half(seen.frame, seen.time_ns, status=_status(message))
    asked = message.kind == ms1.REQUEST
    write, status, stated = message.code == ms1.WRITE, None if asked else 0, message.length or 0
    if write == asked:
        missing = stated - len(message.data)  # never below 0: ms1 takes no more than is stated
        return Half(seen.frame, seen.time_ns, message.data, stated, missing, status)
    return Half(seen.frame, seen.time_ns, stated=stated if asked else 0, status=status)


def _status(refusal: ms1.Ms1Message) -> int:
    """The status of a refusal. Missing error bytes count as 0: a short refusal is a refusal, too."""
    errors = (refusal.error_decode, refusal.error_code_1, refusal.error_code_2)
    return int.from_bytes(bytes((refusal.code or 0, *(error or 0 for error in errors))))
