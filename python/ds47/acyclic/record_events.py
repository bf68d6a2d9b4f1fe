"""What happens to a record that may be ours: tells the pairing once the record is known to be ours.

Takes records from `record_calls` (RPC) and `ms1_calls` (PROFIBUS). Holds back what is not known to be ours yet
(`index47`), decodes each request once, and reports a wrong length of a record or a wrong order of the capture
(DS106, DS107, DS202). Compares nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from ds47.acyclic.index47 import ALWAYS, SHARED_INDEX, ArKey, Index47
from ds47.acyclic.pairing import Moment, Outcome, Pairing
from ds47.findings.remark import Remark
from ds47.profidrive import Options, Request
from ds47.profidrive.parameter import shared_request
from ds47.profinet.ip import Cut
from ds47.profinet.records import Half, Record


class RecordEvents:
    """Tells the pairing what happens to records, once they are known to be ours.

    Args:
        index47: decides which records are ours.
        pairing: hears of every Write and Read that is ours.
        codec: dialects of the messages.
        outcomes: gets the findings.
    """

    def __init__(
        self, index47: Index47, pairing: Pairing, codec: Options, outcomes: list[Outcome]
    ) -> None:
        self._index47 = index47
        self._pairing = pairing
        self._codec = codec
        self._outcomes = outcomes
        self._happens: dict[str, Callable[[Any, Any], object]] = {
            "asked": self._asked, "answered": self._answered,
            "write_failed": self._write_failed, "write_unasked": lambda record, _: pairing.write_unasked(record),
            "read_over": lambda record, _: pairing.read_over(record),
            "read_lost": lambda record, _: pairing.read_lost(record), "read_asked_late": pairing.read_asked_late,
            "answered_twice": _answered_twice,
            "pushed_out": lambda _, what: self.push_out(*what), "remark": self._remark, "about": self._about,
            "release": lambda ar, at: pairing.release(ar[0], ar[1], ar[2], at, SHARED_INDEX),
        }  # fmt: skip
        """The name of an event -> what takes the record (or its AR) and one more object, once it is ours."""
        self.pushed_out: dict[str, list[int]] = {}
        """Name of a limit (spec/limits.toml) -> the frame of the first thing that it pushed out, and how many."""
        self.concerned = index47.concerned
        """The indices that can carry the parameter channel."""
        self.newest_ns = 0
        """The time of the newest frame of a call that is ours; 0 for none."""
        self.newest_frame = 0
        """The number of that frame."""
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
        """An AR is over. If its events wait, its release waits behind them."""
        self._pairing.release(*ar, at)
        self._index47.follow(ar, ("release", ar, at))

    def asked(self, record: Record, cut: Cut | None) -> None:
        """A request with one of our indices. `cut`: the frame that the capture cut; None for none."""
        half, message, index47 = record.request, None, self._index47
        assert half is not None
        if half.missing:
            self._length(record, half, cut)
        if record.write:
            message = shared_request(half.data, self._codec, cut=half.cut)
        if record.index in index47.always or index47.passes(record.relation, record.index):
            record.proven = True
            self._asked(record, message)
            return
        asks = message is not None and index47.is_question_here(
            record.peer.device, record.place, message
        )
        self.pass_on(record, "asked", message, asks=asks)
        if message is not None:
            index47.asked(record, message)
        index47.heard(record.relation, half.frame, asks=True)

    def answered(self, record: Record, cut: Cut | None) -> None:
        """A response, with or without its request; arguments as for `asked`."""
        half, write = record.response, record.write
        assert half is not None
        if (half.missing and not write) or (half.cut and half.cut_before_status):
            self._length(record, half, cut)
        if record.proven:
            self._answered(record, half)
        else:
            self.pass_on(record, "answered", half, proves=not write and self._proves(record, half))

    def unasked(self, record: Record, cut: Cut | None) -> None:
        """A response without its request."""
        half = record.response
        assert half is not None
        if record.write:
            self.pass_on(record, "write_unasked")
        else:
            self.answered(record, cut)
        if record.index == SHARED_INDEX:
            self._index47.heard(record.relation, half.frame, asks=False)

    def asked_late(self, record: Record, answer: int) -> None:
        """The request of a Read came after its response, which was in the frame `answer`."""
        self.pass_on(record, "read_asked_late", answer)
        if record.index == SHARED_INDEX:
            self._index47.heard(record.relation, answer, asks=True)

    def not_unasked(self, record: Record) -> None:
        """The request of a response came late: that response no longer counts as one without a request."""
        if record.index == SHARED_INDEX:
            self._index47.unheard(record.relation)

    def finish(self) -> None:
        """The capture is over: it is unknown whether what still waits is ours (DS209)."""
        for device, (first, records, asks) in self._index47.unproven():
            what = "unproven_calls" if asks else "unproven_responses"
            args = {"device": device, "count": records, "what": what}
            self._remark(None, Remark("DS209", first, args))

    # What happens once it is ours

    def _asked(self, record: Record, message: Request | None) -> None:
        half = record.request
        assert half is not None
        if half.frame < self.newest_frame or half.time_ns < self.newest_ns:
            self._back(record, half)
        else:
            self.newest_ns, self.newest_frame = half.time_ns, half.frame
        if message is None:
            self._pairing.read_request(record)
        else:
            record.job = self._pairing.write_request(record, message)

    def _answered(self, record: Record, half: Half) -> None:
        if half.frame < self.newest_frame or half.time_ns < self.newest_ns:
            self._back(record, half)
        else:
            self.newest_ns, self.newest_frame = half.time_ns, half.frame
        if record.write:
            if record.job is not None:
                self._pairing.write_response(record.job, half)
        elif half.cut and half.cut_before_status:
            self._pairing.read_cut_before_status(record)
        else:
            if record.index in ALWAYS and half.data:
                spot = record.channel[1], record.channel[3:6]
                if not self._index47.drives.get(spot):
                    self._index47.responded(*spot, half.data, self._codec)
            self._pairing.read_response(record)

    def _write_failed(self, record: Record, half: Half) -> None:
        if record.job is not None:
            self._pairing.write_response(record.job, half, fault=True)

    def _proves(self, record: Record, half: Half) -> bool:
        """Whether the record of a Read proves that its AR uses the parameter channel."""
        index47 = self._index47
        if not half.data or index47.passes(record.relation, record.index):
            return False
        if self._is_echo(record, half) or half.missing:
            return False
        place = record.place
        answers = index47.answers(record.relation, place, half.data, self._codec)
        return answers or self._pairing.is_again(record)

    def _is_echo(self, record: Record, half: Half) -> bool:
        """Whether a Read shows a store, which only returns what was written: its ARs wait again (P20)."""
        index47, place = self._index47, record.place
        drive = index47.is_of_drive(record.peer.device, place)
        ars = None if drive else index47.echoed(record.relation, place, half.data)
        for ar in ars or ():
            self._pairing.release(*ar, index=SHARED_INDEX)
            self._outcomes.append(("no_drive", ar, None))
        return ars is not None

    def _about(self, record: Record, remark: Remark) -> None:
        remark.job = record.job
        self._remark(record, remark)

    def _remark(self, record: Record | None, remark: Remark) -> None:
        self._outcomes.append(("remark", remark, record))

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

    def _back(self, record: Record, half: Half) -> None:
        """A frame is out of order, by its number or its time (DS107)."""
        if half.frame < self.newest_frame:  # its AR proved itself late
            return
        if self.newest_frame:
            back = (self.newest_ns - half.time_ns) / 1e6
            args = {"milliseconds": back, "first": self.newest_frame}
            self._remark(record, Remark("DS107", half.frame, args))
        self.newest_ns, self.newest_frame = half.time_ns, half.frame


def _answered_twice(record: Record, _: object) -> None:
    asked = record.request
    if record.job is not None and asked is not None:
        record.job.doubled_frame = asked.frame
