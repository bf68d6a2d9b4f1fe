"""Services of MS1 and MS2 on PROFIBUS to the same events as RPC calls on PROFINET (docs/profibus.md 6).

Passes services (`services`) to the records (`record_events`), as `record_calls` does for RPC. Not here: the
frames of a service, and what is wrong with them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar

from ds47.acyclic.pairing import Moment, Outcome
from ds47.acyclic.record_events import RecordEvents
from ds47.acyclic.services import Became, ServiceCall
from ds47.findings.remark import Remark
from ds47.profibus import dp
from ds47.profibus.idents import Idents
from ds47.profibus.judge import LineJudge
from ds47.profibus.line import Exchange
from ds47.profibus.ms1 import MOST_DATA
from ds47.profidrive.dictionary import family_of
from ds47.profinet.completeness import STATION
from ds47.profinet.records import Peer, Record


class Ms1Calls:
    """Takes what happens to services (`services.Became`).

    Args:
        events: hears of every record that may be ours.
        outcomes: gets what is wrong with a request, and answered Writes that cannot be ours, or have no request.
        judge: hears of polls, and of refused services that are not ours.
        idents: knows the makers of stations.
    """

    def __init__(
        self,
        events: RecordEvents,
        outcomes: list[Outcome],
        judge: LineJudge,
        idents: Idents,
    ) -> None:
        self._events = events
        self._idents = idents
        self._outcomes = outcomes
        self._judge = judge
        self._written: dict[tuple[str, int], int] = {}
        """Station and index -> the frame of the first Write."""
        self._open: dict[ServiceCall, Record] = {}
        """The open services that are ours."""

    def take(self, became: Became) -> None:
        """Something happened to a service."""
        what, call = became
        if what == "asked":
            self._asked(call)
        elif what == "answered":
            self._answered(call)
        elif what == "failed":
            self._failed(call)
        elif what == "lost":
            self._lost(call)
        else:
            self._unasked(call)

    def was_written(self, device: str, index: int, before: int) -> bool:
        """Whether a record was written to an index of a station before a frame."""
        return self._written.get((device, index), before) < before

    def _whose(self, call: ServiceCall) -> Record:
        """The record of a call, now with its peer."""
        who = peer(call.master, call.station, *self._idents.whose(call.station))
        call.record = call.record.of(who, may_be_ours=call.record.index in self._events.concerned)
        return call.record

    def _asked(self, call: ServiceCall) -> None:
        record = self._whose(call)
        if record.write:
            self._writing(record)
        self._events.requests[record.index, record.write] += 1
        if record.may_be_ours:
            self._open[call] = record
            self._events.asked(record, None)

    def _writing(self, record: Record) -> None:
        device, half = record.peer.device, record.request
        if half is None:
            return
        self._written.setdefault((device, record.index), half.frame)
        if half.stated > MOST_DATA:
            args = {"device": device, "length": half.stated, "most": MOST_DATA}
            self._outcomes.append(("remark", Remark("DS809", half.frame, args), None))

    def _judged(self, call: ServiceCall, ours: bool) -> None:
        """Tells the judge how long the answer took, and of a refusal that is not ours."""
        record, half = call.record, call.record.response
        if half is None:
            return
        self._judge.answered(call.station, call.polled, half.frame)
        if half.status and not ours:
            self._judge.refused(
                call.station, record.write, record.slot, record.index, half.status, half.frame
            )

    def _answered(self, call: ServiceCall) -> None:
        record = self._open.pop(call, None)
        self._judged(call, record is not None)
        if record is not None:
            self._events.answered(record, None)
        elif call.record.write:
            self._outcomes.append(("foreign", self._whose(call), None))

    def _failed(self, call: ServiceCall) -> None:
        record, half = self._open.pop(call, None), call.record.response
        if record is None or half is None:
            return
        if record.write:
            self._events.pass_on(record, "write_failed", half)
        else:
            self._events.pass_on(record, "read_over")
            self._events.pass_on(record, "read_lost")

    def _lost(self, call: ServiceCall) -> None:
        record = self._open.pop(call, None)
        if record is not None and not record.write:
            self._events.pass_on(record, "read_lost")

    def _unasked(self, call: ServiceCall) -> None:
        record = self._whose(call)
        if call.record.write:
            self._outcomes.append(("foreign", record, None))
        if record.may_be_ours:
            self._events.unasked(record, None)


class StartUps:
    """Takes the exchanges of a line, and finds stations that get their parameters (Set_Prm).

    A station may have been switched off and on before that, like a device before its Connect.

    Args:
        started: gets the station, and the frame.
    """

    SERVICES: ClassVar = frozenset({dp.PARAMETERS})

    def __init__(self, started: Callable[[str, Moment], None]) -> None:
        self._started = started
        self._seen: dict[str, int] = {}

    def seen(self, device: str, before: int, behind: int) -> bool:
        """Whether the capture has a start-up of a station between two frames."""
        return behind < self._seen.get(device, before) < before

    def take(self, exchange: Exchange) -> None:
        """Takes an exchange; other services, and refused ones, do not count."""
        item = exchange.request.item
        answer = exchange.answer
        if dp.service(item) != dp.PARAMETERS or answer is None or dp.refuses(answer.item):
            return
        if item.sa is not None and item.da is not None:
            who = peer(item.sa, item.da)
            self._seen.setdefault(who.device, exchange.request.frame)
            at = Moment(exchange.request.frame, exchange.request.time_ns)
            self._started(who.device, at)


@lru_cache(maxsize=4096)
def peer(
    master: int, station: int, vendor_id: int | None = None, family: str | None = None
) -> Peer:
    """The two stations of a call: `dp2` is the station with the address 2.

    MICROMASTER is of Siemens, but has none of the error numbers of SINAMICS: its calls have no vendor.
    """
    whose = vendor_id if family in (None, family_of(vendor_id)) else None
    return Peer(f"{STATION}{master}", f"{STATION}{station}", whose, station=station, family=family)
