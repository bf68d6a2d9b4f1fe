"""What is wrong with S7 communication: connections, PDUs, jobs and transfers to findings DS9xx (docs/s7.md 7).

`moments` decides whether data is of one moment. A repeated problem is one remark with a count, reported at the end
of the capture. Problems of a job are reported with the job.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ds47.findings.remark import Remark
from ds47.s7 import model
from ds47.s7.addresses import text
from ds47.s7.areas import too_long
from ds47.s7.blocks import Blocks, BlockSize
from ds47.s7.drives import ADDRESSES, Drives, element
from ds47.s7.moments import Moments
from ds47.s7.notes import Notes
from ds47.spec import SINAMICS, s7
from ds47.spec.semantics import Limits

_OF_BYTES = ("DS905", "DS907", "DS916")
"""What is said of bytes that accesses share: elements of a drive share none."""
_NAMED = 4
"""Addresses of a job that a finding names."""


def areas(items: list[model.S7Item]) -> str:
    """What items name: DB1.DBB0..9, MB4; cut after four."""
    if not any(each.address for each in items):
        return f"{len(items)} x unknown address"
    named = [text(each.address) if each.address else "?" for each in items]
    return ", ".join([*named[:_NAMED], "..."] if len(named) > _NAMED else named) or "?"


@dataclass(slots=True, eq=False)
class _Crowd:
    """Jobs that were open at once, more than agreed: it counts when all are answered."""

    jobs: set[model.S7Job]
    open_now: int
    frame: int


class S7Judge(model.S7Listener):
    """Hears of connections.

    Args:
        bounds: times, and how much is kept.
        remark: gets each problem of a job at once.
        blocks: what partners copy at once, as the user says.
        readback: whether a read must return what was written (DS916).
        drives: which partners are drives, not CPUs; None: unknown.
    """

    def __init__(
        self,
        bounds: Limits,
        remark: Callable[[Remark], None],
        blocks: Blocks,
        readback: bool = False,
        drives: Drives | None = None,
    ) -> None:
        self._bounds, self._remark, self._blocks = bounds, remark, blocks
        self._drives = drives or Drives({}, lambda _: None, bounds.s7_memories)
        self._notes = Notes(bounds.s7_notes)
        self._moments = Moments(bounds, self._notes, readback, self._drives.forget)
        self._missing: dict[tuple[str, str, str], tuple[int, int]] = {}
        """What the capture lacks of connections of two stations: the first frame, and of how many of them, or of
        their jobs."""
        self._cut_at = 0
        """Bytes of frames that the capture cut, at the most."""
        self._unfinished: dict[int, dict[str, tuple[int, int]]] = {}
        """Jobs of a connection that may go on behind the end of the capture, or began before it."""
        self._without_setup: dict[int, int] = {}
        """The first job of connections without a captured setup."""
        self._open: dict[int, list[model.S7Job]] = {}
        """Jobs of the client of a connection."""
        self._crowds: dict[int, _Crowd] = {}
        self._sending: dict[tuple[int, bool, int | None], model.S7Job] = {}
        """Open BSEND by connection, direction and R_ID."""
        self._tangled: set[model.S7Job] = set()
        """Those of them with segments that cannot be assigned."""
        self._shapes: dict[tuple[int, bool, int | None], tuple[int, list[int]]] = {}
        """Frame and lengths of the last USEND likewise."""

    def finish(self) -> Iterator[Remark]:
        """What happened again and again, and what only the whole capture shows."""
        yield from self._half_captured()
        for remark in (*self._moments.finish(), *self._notes.finish()):
            if remark.rule not in _OF_BYTES or not self._drives.drive_of(remark.args["device"]):
                yield remark

    def _half_captured(self) -> Iterator[Remark]:
        """What the capture lacks of the connections of two stations."""
        for (controller, device, what), (frame, count) in self._missing.items():
            args = {"what": what, "count": count, "controller": controller, "device": device}
            if what == "s7_cut":
                args["bytes"] = self._cut_at
            yield Remark("DS725", frame, args)

    # Connections

    def agreed(self, connection: model.S7Connection) -> None:
        """The setup was seen."""
        self._without_setup.pop(connection.number, None)

    def refused(self, connection: model.S7Connection, why: str, at: model.At, code: int) -> None:
        """Nothing comes of a connection."""
        tsap = connection.server_tsap
        rack, slot = s7.rack_and_slot(tsap) or (None, None)
        case = f"refused_{why}" if tsap is not None or why == "setup" else f"refused_{why}_tcp"
        args = {
            "device": connection.server.ip, "controller": connection.client.ip, "case": case,
            "tsap": None if tsap is None else tsap.hex(".").upper(), "rack": rack, "slot": slot,
            "code": code,
        }  # fmt: skip
        key = (connection.server, connection.client.ip, case, tsap, code)
        self._notes.add("DS917", key, at.frame, args)

    def larger(
        self, connection: model.S7Connection, from_client: bool, at: model.At, size: int
    ) -> None:
        """A PDU is larger than was agreed."""
        if connection.setup is None:
            return
        args = {
            "device": connection.server.ip, "sender": connection.end(from_client).ip,
            "size": size, "agreed": connection.pdu_length, "frame": connection.setup.frame,
        }  # fmt: skip
        note = self._notes.add("DS902", (connection.number, from_client), at.frame, args)
        if note is not None:
            note.more("size", size, at.frame)

    def evidence(self, connection: model.S7Connection, found: model.SzlEvidence) -> None:
        """The server said what it is."""
        self._blocks.evidence(connection.server.ip, found)
        self._drives.evidence(connection.server.ip, found)

    def closed(self, connection: model.S7Connection) -> None:
        """A connection is over."""
        self._moments.closed(connection)
        unfinished = self._unfinished.pop(connection.number, {})
        cut = connection.cut
        if cut is not None:
            self._lacks(connection, "s7_cut", cut.frame, cut.frames)
            self._cut_at = max(self._cut_at, cut.captured)
        if connection.missing is not None and (
            cut is None or connection.missing != "s7_bytes_missing"
        ):
            self._lacks(connection, connection.missing, connection.opened.frame, 1)
        elif cut is None and not connection.disordered:
            for what, (first, count) in unfinished.items():
                self._lacks(connection, what, first, count)
        frame = self._without_setup.pop(connection.number, None)
        if frame is not None:
            args = {"device": connection.server.ip, "controller": connection.client.ip}
            self._notes.add("DS915", (connection.server, connection.client.ip), frame, args)
        self._open.pop(connection.number, None)
        self._crowds.pop(connection.number, None)
        for table in (self._sending, self._shapes):
            for key in [each for each in table if each[0] == connection.number]:
                del table[key]

    def _lacks(self, connection: model.S7Connection, what: str, frame: int, more: int) -> None:
        key = connection.client.ip, connection.server.ip, what
        first, count = self._missing.get(key, (frame, 0))
        if count or len(self._missing) < self._bounds.s7_notes:
            self._missing[key] = first, count + more

    # Jobs

    def asked(self, job: model.S7Job) -> None:
        """A request, or the first segment, was seen."""
        self._moments.asked(job)
        at = job.asked
        if at is None:
            return
        if job.connection.pdu_length is None:
            self._without_setup.setdefault(job.connection.number, at.frame)
        if job.operation == model.BSEND:
            self._begun(job, at)
        elif job.operation in (model.GET, model.PUT) and job.from_client:
            self._crowded(job, at)

    def over(self, job: model.S7Job) -> None:
        """Nothing more comes of a job."""
        self._moments.over(job)
        self._drives.over(job)
        self._unfinish(job)
        if job.operation == model.BSEND:
            key = job.connection.number, job.from_client, job.r_id
            if self._sending.get(key) is job:
                del self._sending[key]
            if job.state != model.ORPHAN and job not in self._tangled:
                self._sent(job)
            self._tangled.discard(job)
        elif job.operation == model.USEND:
            self._shape(job)
        elif job.state == model.ORPHAN:
            self._refused(job)
        else:
            self._settled(job)
            self._variables(job)

    def _unfinish(self, job: model.S7Job) -> None:
        """Where no byte of its connection is missing, what a job lacks is behind the end or before the begin."""
        at = job.asked or job.answered
        begins = job.state == model.ORPHAN and job.connection.setup is None
        if at is not None and (begins or job.state == model.INCOMPLETE):
            what = "s7_begins" if begins else "s7_ends"
            there = self._unfinished.setdefault(job.connection.number, {})
            first, count = there.get(what, (at.frame, 0))
            there[what] = min(first, at.frame), count + 1

    def _say(self, rule: str, job: model.S7Job, at: model.At, **args: Any) -> None:
        ends = {"device": job.partner.ip, "controller": job.asker.ip}
        self._remark(Remark(rule, at.frame, ends | args, job=job))

    # GET and PUT

    def _crowded(self, job: model.S7Job, at: model.At) -> None:
        number, parallel = job.connection.number, job.connection.parallel
        there = self._open.setdefault(number, [])
        there.append(job)
        connection = job.connection
        if parallel is None or len(there) <= parallel:
            return
        if connection.lost_bytes or connection.lacks(False):
            return
        crowd = self._crowds.get(number)
        if crowd is None or crowd.open_now < len(there):
            self._crowds[number] = _Crowd(set(there), len(there), at.frame)

    def _settled(self, job: model.S7Job) -> None:
        number = job.connection.number
        there, crowd = self._open.get(number), self._crowds.get(number)
        if there is not None and job in there:
            there.remove(job)
        if crowd is None or job not in crowd.jobs:
            return
        crowd.jobs.discard(job)
        if job.answered is None or not crowd.jobs:
            del self._crowds[number]
        if job.answered is None or crowd.jobs or job.connection.disordered:
            return
        args = {
            "device": job.partner.ip, "controller": job.asker.ip, "most": crowd.open_now,
            "agreed": job.connection.parallel,
        }  # fmt: skip
        note = self._notes.add("DS914", (number,), crowd.frame, args)
        if note is not None:
            note.more("most", crowd.open_now, crowd.frame)

    def _variables(self, job: model.S7Job) -> None:
        at, operation = job.answered or job.asked, job.operation.upper()
        if at is None or job.asked is None:
            return
        if job.state == model.UNANSWERED:
            self._say("DS901", job, job.asked, operation=operation, area=areas(job.items))
        if job.state in (model.UNANSWERED, model.INCOMPLETE):
            return
        self._refused(job)
        if job.error:
            return
        block = self._blocks.of(job.partner.ip)
        if block is not None:
            self._blocked(job, job.asked, operation, block)
        if len(job.items) > 1 and job.state == model.OK:
            args = {"device": job.partner.ip, "controller": job.asker.ip}
            key = (job.connection.number, job.from_client)
            self._notes.add("DS906", key, job.asked.frame, args)

    def _refused(self, job: model.S7Job) -> None:
        """What an answer refuses, whether its request is in the capture or not."""
        at, operation = job.answered, job.operation.upper()
        if at is None:
            return
        if job.error:
            of = areas(job.items)
            self._say(
                "DS909", job, at, operation=operation, area=of, code=job.error, **too_long(job)
            )
            return
        for code in dict.fromkeys(each.code for each in job.items):
            failed = [each for each in job.items if each.code == code]
            if code is None:
                args = {"count": len(failed), "of": len(job.items)}
                self._say("DS918", job, at, operation=operation, area=areas(failed), **args)
            elif code != model.DONE:
                self._items(failed, job, at, code)

    def _items(self, failed: list[model.S7Item], job: model.S7Job, at: model.At, code: int) -> None:
        """What is refused with one code: parameters of a drive, else items; a single item may be a parameter."""
        drive = self._drives.drive_of(job.partner.ip) if job.from_client else None
        named = [(element(each.address), each.address) for each in failed]
        elements = [(found, address) for found, address in named if found and address]
        if drive is None or len(elements) < len(failed):
            elements = []
        operation = job.operation.upper()
        if drive is None or drive[0] == ADDRESSES or not elements:
            one = {} if len(elements) != 1 else elements[0][0]._asdict() | {"family": SINAMICS}
            self._say("DS908", job, at, operation=operation, area=areas(failed), **one, code=code)
            return
        for found, address in elements:
            self._say(
                "DS919", job, at, operation=operation, **found._asdict(), family=SINAMICS,
                bytes=address.length, code=code,
            )  # fmt: skip

    def _blocked(self, job: model.S7Job, at: model.At, operation: str, block: BlockSize) -> None:
        """Items that are larger than what the partner copies at once."""
        for item in job.items:
            address = item.address
            if address is None or item.code != model.DONE or address.area in model.ELEMENTS:
                continue
            if address.length <= block.size:
                continue
            args = {
                "device": job.partner.ip, "controller": job.asker.ip, "operation": operation,
                "area": text(address), "bytes": address.length, "block": block.size,
                "case": block.source, "frame": block.frame, "name": block.name,
            }  # fmt: skip
            key = (job.connection.number, job.from_client, operation, args["area"], block)
            also = () if job.answered is None else (job.answered.frame,)
            self._notes.add("DS903", key, at.frame, args, also)

    # BSEND and USEND

    def _begun(self, job: model.S7Job, at: model.At) -> None:
        key = job.connection.number, job.from_client, job.r_id
        before = self._sending.get(key)
        lost = before is None or before.lost or job.connection.lacks(not job.from_client)
        if before is not None and before.asked is not None and not lost:
            self._say("DS912", job, at, r_id=job.r_id, case="r_id_open", frame=before.asked.frame)
            self._tangled |= {job, before}
        if before is not None or len(self._sending) < self._bounds.s7_notes:
            self._sending[key] = job

    def _sent(self, job: model.S7Job) -> None:
        at, parts = job.asked, job.segments
        if at is None or not parts:
            return
        if job.state == model.REFUSED:
            refused = job.answered or at
            self._say("DS912", job, refused, r_id=job.r_id, case="r_id_refused", code=job.error)
            return
        if job.lost:
            return
        size = sum(each.size for each in parts)
        case = _incomplete(job, parts, size)
        if case is not None:
            self._say(
                "DS910", job, parts[-1].at, r_id=job.r_id, case=case, total=job.total, size=size,
                segments=len(parts), first=at.frame,
            )  # fmt: skip
        silent = [each for each in parts if each.acknowledged is None]
        if silent:
            self._say(
                "DS911", job, silent[0].at, r_id=job.r_id, count=len(silent), segments=len(parts),
                frames=[each.at.frame for each in silent],
            )  # fmt: skip

    def _shape(self, job: model.S7Job) -> None:
        at, shape = job.asked, [len(each.value or b"") for each in job.items]
        if at is None or job.flaws:
            return
        key = job.connection.number, job.from_client, job.r_id
        before = self._shapes.get(key)
        if before is None and len(self._shapes) >= self._bounds.s7_notes:
            return
        self._shapes[key] = at.frame, shape
        if before is not None and before[1] != shape:
            self._say("DS913", job, at, r_id=job.r_id, before=before[1], now=shape, first=before[0])


def _incomplete(job: model.S7Job, parts: list[model.BsendSegment], size: int) -> str | None:
    """What a BSEND lacks that was sent, None for nothing."""
    if not parts[-1].last:
        return "bsend_open"
    if job.total is not None and size != job.total:
        return "bsend_sum"
    assigned = parts[0].assigned
    if assigned is not None and any(each.sequence != assigned for each in parts[1:]):
        return "bsend_sequence"
    return None
