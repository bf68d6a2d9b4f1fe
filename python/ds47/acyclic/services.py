"""Reads and writes of records by MS1 and MS2, from the exchanges of a line (docs/profibus.md 6).

A service is asked once and polled until its answer is there: SC, no data and empty answers say that it is not.
What is asked of a record, and what "not ready" (B5) means for it, is not here: every DS_Read is a call of its own.
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
"""Polls of a call that are kept,"""
MOST_OPEN = 1_024
"""and calls without an answer: eight for each station that a line can have."""


@dataclass(slots=True, eq=False)
class ServiceCall:
    """A DS_Read or DS_Write with its answer; `record` is what the pairing takes.

    `record.response.status` is 0 or that of the refusal (docs/profibus.md 4), `record.ar` is empty.
    """

    master: int
    station: int
    """Of the slave,"""
    sap: int
    """and its SAP: 51 for MS1."""
    record: Record
    polls: list[Exchange] = field(default_factory=list)
    """Exchanges that brought no answer yet, that of the request first: the first ones,"""
    polled: int = 0
    """and how many there are."""
    fault: int | None = None
    """The function code that refused it below MS1: 3 where the SAP is not enabled."""


Became = tuple[Literal["asked", "answered", "failed", "lost", "unasked"], ServiceCall]
"""What became of a call:

    asked      its request
    answered   it has its answer, positive or negative
    failed     the station refused it before MS1 (`fault`); `record.response` has the place alone
    lost       another service began, or nothing came any more; or it is the oldest of too many
    unasked    an answer without its request; a negative one has neither slot nor index, and is left out
"""


class ServiceTracker:
    """Takes the exchanges of a line and returns what becomes of the calls in them."""

    SERVICES: ClassVar = frozenset({dp.RECORD, dp.MS2})

    def __init__(self) -> None:
        self._open: dict[tuple[int, int, int], ServiceCall] = {}

    def take(self, exchange: Exchange) -> list[Became]:
        """What becomes of calls by an exchange; those of other services than MS1 and MS2 say nothing here."""
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
        """No exchange comes any more."""
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
    """Whether an answer is one to a request; a refusal names no place. Else the request it is to was not seen."""
    place = answer.slot, answer.index
    same = place in ((None, None), (record.slot, record.index))
    return same and record.write == (answer.function == "write")


def _may_be_of_another(
    call: ServiceCall, exchange: Exchange, answer: ms1.Ms1Message | None
) -> bool:
    """Whether a refusal, which names no place, may be for a request that was not seen."""
    seen, asked = exchange.answer, call.record.request
    if seen is None or asked is None or exchange.hole <= asked.frame:
        return False
    return dp.refuses(seen.item) or (answer is not None and answer.kind == ms1.REFUSAL)


def _half(seen: LineFrame, message: ms1.Ms1Message) -> Half:
    """A message as one half of a record call.

    A DS_Read carries nothing, and says how much it wants; the answer to a DS_Write repeats its length, and
    carries nothing either.
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
    """That of a refusal; error bytes that a short one does not have are 0, as it refuses without them, too."""
    errors = (refusal.error_decode, refusal.error_code_1, refusal.error_code_2)
    return int.from_bytes(bytes((refusal.code or 0, *(error or 0 for error in errors))))
