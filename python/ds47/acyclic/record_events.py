"""What happens to a record that may be ours; once it is known to be ours, the jobs hear of it.

Stands between those who know how a record travels (`record_calls` for RPC, `ms1_calls` for PROFIBUS) and the
jobs (`pairing`). Holds back what is not known to be ours yet (`index47`), decodes a request once, and says where
the length of a record or the order of the capture is wrong (DS106, DS107, DS202). Compares nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, Final

from ds47.acyclic.index47 import ALWAYS, SHARED_INDEX, ArKey, Index47
from ds47.acyclic.pairing import Moment, Pairing, Told
from ds47.findings.remark import Remark
from ds47.profidrive import Options, Request, decode_request
from ds47.profinet.ip import Cut
from ds47.profinet.records import Half, Record

_MOST_SHARED: Final = 4_096
"""Decoded requests that are kept to be used again,"""
_LONGEST_SHARED: Final = 512
"""and how many bytes each of them may have."""


class RecordEvents:
    """Tells the pairing what happens to records, once they are known to be ours.

    Args:
        index47: which records are ours.
        pairing: hears of every Write and Read that is ours.
        codec: dialects of the messages.
        told: gets the findings.
    """

    def __init__(
        self, index47: Index47, pairing: Pairing, codec: Options, told: list[Told]
    ) -> None:
        self._index47 = index47
        self._pairing = pairing
        self._codec = codec
        self._told = told
        self._happens: dict[str, Callable[[Any, Any], object]] = {
            "write_asked": self._write_asked, "write_answered": self._write_answered,
            "write_failed": self._write_failed, "write_unasked": lambda record, _: pairing.write_unasked(record),
            "read_asked": self._read_asked, "read_answered": self._read, "read_over": _read_over,
            "read_lost": lambda record, _: pairing.read_lost(record), "read_asked_late": pairing.read_asked_late,
            "answered_twice": _answered_twice,
            "pushed_out": lambda _, what: self.push_out(*what), "remark": self._remark, "about": self._about,
            "release": lambda ar, at: pairing.release(ar[0], ar[1], ar[2], at, SHARED_INDEX),
        }  # fmt: skip
        """What may happen to a record, or to its AR, once it is ours, with what it is about."""
        self.pushed_out: dict[str, list[int]] = {}
        """By the name of a limit (spec/limits.toml): where the first of what it pushed out began, and how much."""
        self.concerned = index47.concerned
        """The indices of which a record can be ours at all."""
        self.newest_ns: int | None = None
        """The time of the newest frame of a call that is ours,"""
        self.newest_frame = 0
        """and its number."""
        self._requests: dict[bytes, Request] = {}
        self.requests: Counter[tuple[int, bool]] = Counter()
        """Record requests, ours or not, by index and whether they write."""

    def pass_on(
        self,
        record: Record,
        what: str,
        about: Any = None,
        *,
        proves: bool = False,
        asks: bool = False,
    ) -> None:
        """Lets something happen now, or once the AR has proved itself; `proves`, `asks`: see `Index47`."""
        ar, index = record.relation, record.index
        if record.proven or self._index47.passes(ar, index):
            self._happens[what](record, about)
            return
        proves = proves or self._index47.is_of_drive(record.peer.device, record.place)
        now = what, record, about
        for event in self._index47.pass_on(ar, now, proves=proves, asks=asks):
            self._happens[event[0]](*event[1:])

    def released(self, ar: ArKey, at: Moment) -> None:
        """An AR is over; what waits of it, too, once it goes on."""
        self._pairing.release(*ar, at)
        self._index47.follow(ar, ("release", ar, at))

    def asked(self, record: Record, cut: Cut | None) -> None:
        """A request; its index concerns us. `cut`: where the capture cut the message; None where it did not."""
        half = record.request
        assert half is not None
        if half.missing:
            self._length(record, half, cut)
        message = self.decoded(half.data, cut=half.cut) if record.write else None
        if self._index47.passes(record.relation, record.index):
            record.proven = True
            if message is None:
                self._read_asked(record, half)
            else:
                self._write_asked(record, message)
            return
        if message is None:
            self.pass_on(record, "read_asked", half)
        else:
            asks = self._index47.asks(record.peer.device, record.place, message)
            self.pass_on(record, "write_asked", message, asks=asks)
            self._index47.asked(record.relation, record.place, message, half.data)
        self._index47.heard(record.relation, half.frame, asks=True)

    def answered(self, record: Record, cut: Cut | None) -> None:
        """The response to a request; arguments as for `asked`."""
        half = record.response
        assert half is not None
        if not record.write:
            self._read_answered(record, half, cut)
            return
        if half.cut and half.untold:
            self._length(record, half, cut)
        if record.proven:
            self._write_answered(record, half)
        else:
            self.pass_on(record, "write_answered", half)

    def unasked(self, record: Record, cut: Cut | None) -> None:
        """A response without its request."""
        half = record.response
        assert half is not None
        if record.write:
            self.pass_on(record, "write_unasked")
        else:
            self._read_answered(record, half, cut)
        if record.index == SHARED_INDEX:
            self._index47.heard(record.relation, half.frame, asks=False)

    def asked_late(self, record: Record, answer: int) -> None:
        """The request of a Read whose response was in an earlier frame, with that frame."""
        self.pass_on(record, "read_asked_late", answer)
        if record.index == SHARED_INDEX:
            self._index47.heard(record.relation, answer, asks=True)

    def not_unasked(self, record: Record) -> None:
        """A response was no one without its request: that came late, and is told next."""
        if record.index == SHARED_INDEX:
            self._index47.unheard(record.relation)

    def decoded(self, data: bytes, *, cut: bool = False) -> Request:
        """The request; the same question is asked again and again, often with a reference that counts.

        So the messages that differ in nothing else share their addresses and blocks, which nobody
        changes.
        """
        if cut or not data or not data[0]:  # reference 0 is a flaw
            return decode_request(data, self._codec, cut=cut)
        known = self._requests.get(data[1:])
        if known is None:
            known = decode_request(data, self._codec)
            if len(data) <= _LONGEST_SHARED:
                if len(self._requests) >= _MOST_SHARED:
                    self._requests.clear()
                self._requests[data[1:]] = known
        return known.asked_as(data[0])

    def finish(self) -> None:
        """The capture is over: what still waits is not known to be ours (DS209)."""
        for device, (first, records, asks) in self._index47.unproven():
            what = "unproven_calls" if asks else "unproven_responses"
            args = {"device": device, "count": records, "what": what}
            self._remark(None, Remark("DS209", first, args))

    # What happens once it is ours

    def _read_asked(self, record: Record, half: Half) -> None:
        self._clock(record, half)
        job = record.job = self._pairing.expected(record)
        if job is not None:
            job.fetching.append(half)

    def _write_asked(self, record: Record, message: Request) -> None:
        half = record.request
        assert half is not None
        self._clock(record, half)
        record.job = self._pairing.write_request(record, message)

    def _write_answered(self, record: Record, half: Half) -> None:
        self._clock(record, half)
        if record.job is not None:
            self._pairing.write_response(record.job, half)

    def _write_failed(self, record: Record, half: Half) -> None:
        if record.job is not None:
            self._pairing.write_response(record.job, half, fault=True)

    def _read_answered(self, record: Record, half: Half, cut: Cut | None) -> None:
        if half.missing or (half.cut and half.untold):
            self._length(record, half, cut)
        if record.proven:
            self._read(record, half)
            return
        ours = self._index47.passes(record.relation, record.index)
        proves = False
        if half.data and not (ours or self._is_echo(record, half)) and not half.missing:
            answers = self._index47.answers(record.relation, record.place, half.data, self._codec)
            proves = answers or self._pairing.is_again(record)
        self.pass_on(record, "read_answered", half, proves=proves)

    def _is_echo(self, record: Record, half: Half) -> bool:
        """Whether a Read shows a store: nothing of that is judged, and its ARs wait again (P20)."""
        index47, place = self._index47, record.place
        drive = index47.is_of_drive(record.peer.device, place)
        ars = None if drive else index47.echoed(record.relation, place, half.data)
        for ar in ars or ():
            self._pairing.release(*ar, index=SHARED_INDEX)
            self._told.append(("no_drive", ar, None))
        return ars is not None

    def _read(self, record: Record, half: Half) -> None:
        self._clock(record, half)
        if half.cut and half.untold:
            self._pairing.read_untold(record)
            return
        if record.job is not None:
            _read_over(record)
        if record.index in ALWAYS and half.data:
            self._index47.responded(record.peer.device, record.place, half.data, self._codec)
        self._pairing.read_response(record)

    def _about(self, record: Record, remark: Remark) -> None:
        remark.job = record.job
        self._remark(record, remark)

    def _remark(self, record: Record | None, remark: Remark) -> None:
        self._told.append(("remark", remark, record))

    def push_out(self, limit: str, frame: int) -> None:
        """A limit (spec/limits.toml) pushed out something of ours that began in this frame."""
        self.pushed_out.setdefault(limit, [frame, 0])[1] += 1

    # Small things

    def _length(self, record: Record, half: Half, cut: Cut | None) -> None:
        if cut is not None:
            frame, captured, original = cut
            args = {
                "captured": captured, "original": original, "length": half.stated if half.missing else None,
                "completed": half.frame,
            }  # fmt: skip
            remark = Remark("DS106", frame, args)
        else:
            args = {"stated": half.stated, "present": len(half.data)}
            remark = Remark("DS202", half.frame, args)
        self.pass_on(record, "remark", remark)

    def _clock(self, record: Record, half: Half) -> None:
        newest, before = self.newest_ns, self.newest_frame
        if half.frame < before:  # that of an AR that proved itself late
            return
        if newest is not None and half.time_ns < newest:
            args = {"milliseconds": (newest - half.time_ns) / 1e6, "first": before}
            self._remark(record, Remark("DS107", half.frame, args))
        self.newest_ns, self.newest_frame = half.time_ns, half.frame


def _read_over(record: Record, _: object = None) -> None:
    """A Read is over, to whomever its response goes."""
    job = record.job
    if job is not None and record.request in job.fetching:
        job.fetching.remove(record.request)


def _answered_twice(record: Record, _: object) -> None:
    asked = record.request
    if record.job is not None and asked is not None:
        record.job.twice = asked.frame
