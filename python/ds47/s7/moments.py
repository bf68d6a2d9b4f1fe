"""Whether data is of one moment: areas that were split, data that mixes two moments, two writers (docs/s7.md 6).

Hears of all jobs, applies them to the memories of each partner (`memory`), and makes the remarks DS904, DS905,
DS907 and DS916.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ds47.findings.remark import Remark
from ds47.s7.addresses import text
from ds47.s7.areas import AreaPart, SplitArea, Splits, accesses, byte_text, is_clear
from ds47.s7.consistency import ItemAccess
from ds47.s7.memory import Memory, MixedBytes
from ds47.s7.model import GET, ORPHAN, PUT, End, S7Connection, S7Job
from ds47.s7.notes import Notes
from ds47.spec import s7
from ds47.spec.semantics import Limits

SPLIT, ONE_JOB, SPLIT_PUT = "mixed_split", "mixed_job", "mixed_put"
"""What mixes two moments: an area read in parts, one job, what was read while an area was written in parts."""
_RECENT = 8
"""Areas read, and written, in parts that may still meet others."""
_KNOWN = 256


class _Put(NamedTuple):
    """An area that was written in parts, and wants to be one."""

    parts: Sequence[ItemAccess]
    whole: ItemAccess


@dataclass(slots=True, eq=False)
class _MemoryLog:
    """A memory of a partner, the latest accesses to it, and the remarks about it."""

    memory: Memory
    gets: deque[Sequence[ItemAccess]] = field(default_factory=lambda: deque(maxlen=_RECENT))
    puts: deque[_Put] = field(default_factory=lambda: deque(maxlen=_RECENT))
    mixed: list[tuple[MixedBytes, Remark]] = field(default_factory=list)
    known: deque[int] = field(default_factory=lambda: deque(maxlen=_KNOWN))
    """Numbers of accesses that have a remark already."""

    def remarks(self) -> Iterator[Remark]:
        """What mixes two moments, unless another writer of these bytes was seen."""
        for mixed, remark in self.mixed:
            if not self.memory.foreign & (1 << mixed.first | 1 << mixed.second):
                yield remark


@dataclass(slots=True, eq=False)
class _Partner:
    """Who answers, with what makes its memories doubtful."""

    connections: dict[int, S7Connection] = field(default_factory=dict)
    doubt: int = 0
    left: int = 0
    """The doubt of connections that are over."""
    latest: int = -1
    """The time of the last frame."""
    tsap: bytes | None = None
    """The last one that it was asked by,"""
    slots: set[tuple[int, int]] = field(default_factory=set)
    """and the slots in all of them, up to two."""

    def doubts(self) -> int:
        """Counts what was not heard, or not understood, on all its connections."""
        found = self.left
        for each in self.connections.values():
            found += _doubt(each)
        return found


def _doubt(connection: S7Connection) -> int:
    return connection.lost_bytes + connection.plus + connection.other


class Moments:
    """Hears of jobs in the order of their frames.

    Args:
        bounds: times, and how much is kept.
        notes: what happens again and again.
        readback: whether a read must return what was written (DS916).
        forgotten: gets the IP address of each partner whose written values were all forgotten.
    """

    def __init__(
        self,
        bounds: Limits,
        notes: Notes,
        readback: bool = False,
        forgotten: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._bounds, self._notes, self._readback = bounds, notes, readback
        self._forgotten = forgotten
        self._logs: OrderedDict[tuple[End, int, int], _MemoryLog] = OrderedDict()
        self._partners: OrderedDict[End, _Partner] = OrderedDict()
        self._splits: dict[tuple[int, bool], Splits] = {}
        self._numbers: dict[S7Job, int] = {}
        self._number = 0
        self._remarks: list[Remark] = []

    # What is heard

    def asked(self, job: S7Job) -> None:
        """A request was seen."""
        if job.operation not in (GET, PUT) or job.asked is None:
            return
        number = self._numbers[job] = self._number
        self._number += len(job.items) + 1
        partner = self._heard(job, job.asked.time_ns)
        self._complete(self._side(job).asked(AreaPart(job, number)))
        if job.operation == PUT:
            for access in _of(partner, job, number):
                self._log(job, access).memory.sent(access)

    def over(self, job: S7Job) -> None:
        """Nothing more comes of a job."""
        number = self._numbers.pop(job, None)
        at = job.answered or job.asked
        if at is None:
            return
        partner = self._heard(job, at.time_ns)
        if job.operation != GET and (job.operation != PUT or not _is_known(job)):
            self._forget(job.partner.ip, at.time_ns)
        if number is None or job.operation not in (GET, PUT):
            return
        if job.operation == PUT:
            self._written(job, _of(partner, job, number))
        else:
            self._read(job, _of(partner, job, number))
        self._complete(self._side(job).over(job))

    def closed(self, connection: S7Connection) -> None:
        """A connection is over."""
        for from_client in (True, False):
            splits = self._splits.pop((connection.number, from_client), None)
            self._complete(splits.finish() if splits else None)
        partner = self._partners.get(connection.server)
        if partner is not None and partner.connections.pop(connection.number, None) is not None:
            partner.left += _doubt(connection)

    def finish(self) -> Iterator[Remark]:
        """What was found, when nothing more comes."""
        for splits in self._splits.values():
            self._complete(splits.finish())
        yield from self._remarks
        for log in self._logs.values():
            yield from log.remarks()

    # Partners and their memories

    def _heard(self, job: S7Job, time_ns: int) -> _Partner:
        """Whose memories a job is about; forgets them where something was not heard, or time steps back."""
        connection = job.connection
        partner = self._partner(connection)
        partner.connections[connection.number] = connection
        if connection.server_tsap != partner.tsap:
            partner.tsap = connection.server_tsap
            slot = s7.rack_and_slot(partner.tsap)
            if slot is not None and len(partner.slots) < 2:
                partner.slots.add(slot)
        doubt, latest = partner.doubts(), max(time_ns, partner.latest)
        if doubt != partner.doubt or time_ns < latest:
            partner.doubt = doubt
            self._forget(connection.server.ip, latest)
        partner.latest = latest
        return partner

    def _partner(self, connection: S7Connection) -> _Partner:
        """Who answers on a connection; where there are too many, the one that was heard first is forgotten."""
        key = connection.server
        partner = self._partners.get(key)
        if partner is None:
            if len(self._partners) >= self._bounds.s7_memories:
                self._give_up(next(iter(self._partners)))
            partner = self._partners[key] = _Partner()
        self._partners.move_to_end(key)
        return partner

    def _give_up(self, partner: End) -> None:
        del self._partners[partner]
        for key in [each for each in self._logs if each[0] == partner]:
            self._remarks += self._logs.pop(key).remarks()

    def _forget(self, ip: str, time_ns: int) -> None:
        self._forgotten(ip)
        for (key, _, _), log in self._logs.items():
            if key[0] == ip:
                log.memory.forget(time_ns)
                log.puts.clear()

    def _log(self, job: S7Job, access: ItemAccess) -> _MemoryLog:
        key = job.connection.server, access.area, access.db
        log = self._logs.get(key)
        if log is not None:
            self._logs.move_to_end(key)
            return log
        log = self._logs[key] = _MemoryLog(Memory(self._bounds.s7_accesses))
        if len(self._logs) > self._bounds.s7_memories:
            self._remarks += self._logs.popitem(last=False)[1].remarks()
        return log

    def _side(self, job: S7Job) -> Splits:
        key = job.connection.number, job.from_client
        splits = self._splits.get(key)
        if splits is None:
            bounds = self._bounds
            splits = self._splits[key] = Splits(bounds.s7_split_ns, bounds.s7_parts)
        return splits

    # Jobs

    def _written(self, job: S7Job, writes: Sequence[ItemAccess]) -> None:
        for access in writes:
            memory = self._log(job, access).memory
            if access.answered_ns is None:
                memory.gave_up(access)
                continue
            if access.sure and access.known:
                self._two_writers(job, access, memory)
            memory.written(access)

    def _read(self, job: S7Job, reads: list[ItemAccess]) -> None:
        """What was read by one job, of each memory."""
        parts: dict[tuple[int, int], list[ItemAccess]] = {}
        for access in reads:
            parts.setdefault((access.area, access.db), []).append(access)
        for each in parts.values():
            log = self._log(job, each[0])
            for access in each:
                if self._readback:
                    self._compared(job, access, log.memory)
                log.memory.read(access)
            self._mixed(log, job, each)

    def _mixed(self, log: _MemoryLog, job: S7Job, parts: Sequence[ItemAccess]) -> None:
        """Whether what was read mixes two moments, by the writes as they are, or by one in parts taken as one."""
        for put in (None, *log.puts):
            if self._mixes(log, parts, put, job.connection, job):
                return

    def _mixes(
        self, log: _MemoryLog, parts: Sequence[ItemAccess], put: _Put | None, reader: S7Connection,
        job: S7Job | None = None,
    ) -> bool:  # fmt: skip
        """The same for one of them; each access gets one remark."""
        if put is None and log.memory.is_quiet(parts):
            return False
        if any(each.order in log.known for each in parts):
            return False
        found = log.memory.mixed(parts, put.parts if put else (), put.whole if put else None)
        if found is None:
            return False
        log.known.extend(each.order for each in parts)
        last = max(parts, key=lambda each: each.until)
        frame = last.request if last.response is None else last.response
        ends = {"device": reader.server.ip, "controller": reader.client.ip}
        args = ends | _arguments(found, parts, put.parts if put else ())
        log.mixed.append((found, Remark("DS905", frame, args, job=job)))
        return True

    def _two_writers(self, job: S7Job, access: ItemAccess, memory: Memory) -> None:
        """Other stations wrote other values to the same bytes shortly before: each gets one remark."""
        partner, named = self._partner(job.connection), {job.connection.client.ip}
        for other in memory.writes():
            connection = partner.connections.get(other.connection)
            if connection is None or connection.client.ip in named:
                continue
            if (
                not (other.sure and other.known)
                or other.until < access.asked_ns - self._bounds.s7_writers_ns
            ):
                continue
            first, end = max(access.start, other.start), min(access.end, other.end)
            common = [each.data[first - each.start : end - each.start] for each in (access, other)]
            if first >= end or common[0] == common[1]:
                continue
            at = next(n for n in range(end - first) if common[0][n] != common[1][n])
            stations = sorted((job.connection.client.ip, connection.client.ip))
            args = {
                "device": job.partner.ip, "controller": stations[0], "other": stations[1],
                "byte": byte_text(access.area, access.db, first + at),
            }  # fmt: skip
            key = (job.connection.server, access.area, access.db, *stations)
            self._notes.add("DS907", key, access.request, args, (other.request,))
            named.add(connection.client.ip)

    def _compared(self, job: S7Job, access: ItemAccess, memory: Memory) -> None:
        """The first read after a write has other values."""
        for write in memory.unread(access):
            first, end = max(access.start, write.start), min(access.end, write.end)
            for at in range(first, end):
                written, read = write.data[at - write.start], access.data[at - access.start]
                if written != read:
                    args = {
                        "device": job.partner.ip, "controller": job.asker.ip,
                        "byte": byte_text(access.area, access.db, at), "written": written, "read": read,
                        "by": write.request,
                    }  # fmt: skip
                    frame = access.response or access.request
                    self._remarks.append(Remark("DS916", frame, args, job=job))
                    break

    # Areas in parts

    def _complete(self, whole: SplitArea | None) -> None:
        """An area was read or written in parts."""
        if whole is None:
            return
        job, address = whole.parts[-1].job, whole.address
        self._split(whole, job, text(address))
        parts = whole.accesses() if job.from_client else []
        if len(parts) != len(whole.parts):
            return
        log = self._log(job, parts[0])
        if job.operation == GET:
            log.gets.append(parts)
            self._mixed(log, job, parts)
        else:
            self._put(self._partner(job.connection), log, parts)

    def _split(self, whole: SplitArea, job: S7Job, area: str) -> None:
        jobs = [each.job for each in whole.parts]
        args = {
            "device": job.partner.ip, "controller": job.asker.ip, "operation": job.operation.upper(),
            "area": area, "jobs": len(jobs),
        }  # fmt: skip
        frames = [at.frame for each in jobs for at in (each.asked, each.answered) if at]
        key = (job.connection.number, job.from_client, job.operation, area)
        self._notes.add("DS904", key, frames[0], args, tuple(frames[1:]))

    def _put(self, partner: _Partner, log: _MemoryLog, parts: Sequence[ItemAccess]) -> None:
        """An area was written in parts: was it read meanwhile?"""
        first, last = parts[0], parts[-1]
        if any(not (each.sure and each.known) for each in parts):
            return
        self._number += 1
        whole = ItemAccess(
            self._number, first.connection, True, first.area, first.db, first.start,
            b"".join(each.data for each in parts), min(each.asked_ns for each in parts),
            max(each.answered_ns or 0 for each in parts), first.request, last.response,
        )  # fmt: skip
        put = _Put(parts, whole)
        log.puts.append(put)
        for read in [*log.gets, *([each] for each in log.memory.reads(whole))]:
            reader = partner.connections.get(read[0].connection)
            if reader is not None:
                self._mixes(log, read, put, reader)


def _arguments(
    found: MixedBytes, parts: Sequence[ItemAccess], put: Sequence[ItemAccess]
) -> dict[str, Any]:
    """What DS905 says: the two bytes, the write, and all frames."""
    values = {at: byte for each in parts for at, byte in enumerate(each.data, each.start)}
    area, db, write = parts[0].area, parts[0].db, found.write
    jobs = len({each.request for each in parts})
    frames = {frame for each in (*parts, *put, write) for frame in (each.request, each.response)}
    return {
        "case": SPLIT_PUT if put else SPLIT if jobs > 1 else ONE_JOB, "jobs": jobs,
        "first": byte_text(area, db, found.first), "first_value": values[found.first],
        "second": byte_text(area, db, found.second), "second_value": values[found.second],
        "write": write.request, "frames": sorted(each for each in frames if each is not None),
    }  # fmt: skip


def _is_known(job: S7Job) -> bool:
    """Whether it is known what a PUT wrote, and where."""
    return job.from_client and job.state != ORPHAN and is_clear(job)


def _of(partner: _Partner, job: S7Job, number: int) -> list[ItemAccess]:
    """What a job of a client does to memories of a partner; nothing if their owner is unclear."""
    return [] if not job.from_client or len(partner.slots) > 1 else accesses(job, number)
