"""Diagnoses that need the whole capture: DS703, 706 to 708, 710, 721, 723 to 725.

Collects while the capture is read, in bounded memory, and speaks when it is over. One remark for each
cause, on the first frame in which it shows.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from ds47.acyclic.index47 import SHARED_INDEX
from ds47.acyclic.judge import Ways, asker
from ds47.acyclic.pairing import STATUS_NOT_READY, Job
from ds47.diagnosis.repetition import Repetition, place_args
from ds47.diagnosis.saving import Unsaved
from ds47.diagnosis.targets import reach_of, target_of
from ds47.findings.remark import Remark
from ds47.profidrive import Request, Response, decode_request
from ds47.profidrive.dictionary import changes_itself
from ds47.profidrive.drive_objects import LOCAL, put
from ds47.profidrive.model import Address
from ds47.profidrive.parameter import NOT_SUPPORTED
from ds47.profinet.completeness import Completeness, Hole, Missing
from ds47.profinet.completeness import Pair as Lacking
from ds47.profinet.ip import Cut
from ds47.profinet.records import Record
from ds47.spec.semantics import known, limits
from ds47.spec.statuses import status_hex

CHANGED = 0x02
_OF_CHANGES = CHANGED, 0x82
"""Response ids of a change."""
_INVALID_SLOT = 0xB2
_NO_ACCESS = 0xDF80B600
_TOLD = 8
"""Holes of which the numbers are told."""
_OF_CALLS = ("write_answer", "read_answer")
"""What is missing of a transaction where a call has no response."""
_NO_AXIS = -1
"""Stands among axes where the device has said that there is no such axis: then the axis byte counts."""

Pair = tuple[str, str]
"""Controller and device."""
Place = tuple[int, int, int, int]
"""API, slot, subslot and record index."""
Spot = tuple[int, int, int]
"""The same without the API, which is not told everywhere."""
_V = TypeVar("_V")


class _Open(NamedTuple):
    """A request that nobody read the response of at its place."""

    ar: bytes
    place: Place
    reference: int | None
    axis: int | None
    frame: int
    until: int | None


class _Read(NamedTuple):
    """A Read that had no request at its place; reference and axis where it brought a record."""

    ar: bytes | None
    """None of a ReadImplicit, which any program may send."""
    place: Place
    reference: int | None
    axis: int | None
    frame: int
    sure: bool = True
    """Whether nothing that was asked at its place is missing."""


class _Seen:
    """What was seen of two stations."""

    __slots__ = ("asked", "before", "behind", "call", "first", "orphans", "since", "station")

    def __init__(self) -> None:
        self.asked = self.orphans = self.first = 0
        """Transactions with and without their request, and the first frame of any."""
        self.since = 0
        """The first frame in which anything is asked for,"""
        self.before: list[int] = []
        """and first responses, and Reads for nothing, whose request may lie before the begin of the capture."""
        self.behind = _Tally()
        """Requests of which the response may lie behind its end,"""
        self.call = 0
        """and the newest call without its response of one: the end is why, if no other call followed."""
        self.station: int | None = None
        """The address of the device on PROFIBUS."""

    def add(self, job: Job) -> None:
        first = job.record.request if job.message is not None else job.read_response
        if job.message is not None:
            self.asked += 1
        else:
            self.orphans += 1
        if first is not None:
            self.first = min(self.first or first.frame, first.frame)
        self.station = job.peer.station
        self._may_go_on(job)

    def _may_go_on(self, job: Job) -> None:
        """Whether the begin or the end of the capture may be why a transaction is not whole."""
        asked, read, missing = job.write_request, job.read_response, job.missing
        alone = job.message is None and job.previous is None and job.repeats is None
        if alone and read is not None and not job.record.implicit:
            self.begun_before(read.frame)
        if asked is not None:
            self.since = min(self.since or asked.frame, asked.frame)
        if asked is None or missing is None:
            return
        if missing.what == "ends":
            self.behind.add(asked.frame)
        elif missing.what in _OF_CALLS:
            self.call = max(self.call, missing.first or 0)

    def begun_before(self, frame: int) -> None:
        """What was asked for before this frame may lie before the begin of the capture."""
        if len(self.before) < known().history:
            self.before.append(frame)


class _Tally:
    """How often, and where first and last."""

    __slots__ = ("count", "first", "last")

    def __init__(self) -> None:
        self.count = self.first = self.last = 0

    def add(self, frame: int) -> None:
        self.count += 1
        self.first = min(self.first or frame, frame)
        self.last = max(self.last, frame)


class WholeCapture:
    """Sees every closed job, every Read for nothing and every Write to a foreign index."""

    def __init__(self, completeness: Completeness | None = None, ways: Ways | None = None) -> None:
        self._completeness = completeness
        self._ways: Ways = OrderedDict() if ways is None else ways
        self._opened: OrderedDict[Pair, list[_Open]] = OrderedDict()
        self._idle: OrderedDict[Pair, list[_Read]] = OrderedDict()
        self._idle_reads: OrderedDict[str, _Tally] = OrderedDict()
        """All of them by device, however many are kept."""
        self._explained: set[Pair] = set()
        """Whose Reads for nothing DS706 explains, all of them,"""
        self._elsewhere: set[Pair] = set()
        """and of whom it is said at all."""
        self._orphans: OrderedDict[Pair, list[_Read]] = OrderedDict()
        self._foreign: OrderedDict[tuple[str, int], tuple[_Tally, dict[str, Any]]] = OrderedDict()
        self._answering: OrderedDict[tuple[str, int, int], Place] = OrderedDict()
        self._refusing: OrderedDict[tuple[str, Place], tuple[_Tally, int]] = OrderedDict()
        self._accepting: OrderedDict[tuple[str, Spot], bool] = OrderedDict()
        self._axes: OrderedDict[tuple[str, Place], dict[int, int]] = OrderedDict()
        self._unsaved: OrderedDict[str, Unsaved] = OrderedDict()
        self._asking: OrderedDict[tuple[str, str, Spot], bool] = OrderedDict()
        self.repetition = Repetition()
        self._seen: OrderedDict[Pair, _Seen] = OrderedDict()
        """By pair of stations."""
        self._cut = _Tally()
        self._disorder = _Tally()
        self._cut_at: int | None = None
        """Bytes of each frame that was cut, where all have as many."""

    def asked(self, job: Job) -> None:
        """A Write request asks for something."""
        if job.message is not None and job.message.operation == "change":
            self.repetition.asked(job, _place(job.record))

    def closed(self, job: Job) -> None:
        """A job is over; a usual one is nothing new where others were before, as long as it changes nothing."""
        message, asked, ways = job.message, job.write_request, self._ways
        if not job.usual or message is None or asked is None:
            self._heard(job)
        else:
            way = asker(job, message.axis)
            if way not in ways or ways[way][0] > asked.frame:
                put(ways, way, (asked.frame, reach_of(job.key, message.axis)))
                self._heard(job)
        if message is not None and (message.operation == "change" or message.request_id is None):
            self._change(job)
        if message is not None and (job.polls or self.repetition.storms):
            self.repetition.closed(job, _place(job.record))

    def _heard(self, job: Job) -> None:
        """Where it asked, and what it got."""
        message, record, device = job.message, job.record, job.peer.device
        place = _place(record)
        pair = job.peer.controller, device
        self._seen_of(pair).add(job)
        if message is None:
            self._accept(device, place, job)
            self._orphan(pair, place, job)
            self._changed_unseen(job)
            return
        asks = job.peer.controller, device, place[1:]
        if asks not in self._asking:
            put(self._asking, asks, True)
        self._slot(device, place, job)
        if job.read_response is None:
            self._open(pair, place, job)
        elif record.index == LOCAL:
            self._axis(device, place, job)

    def nothing_to_read(self, record: Record, missing: Missing | None) -> None:
        """A Read without record on a channel that has no request, as far as none is missing."""
        peer = record.peer
        half = record.response
        if half is None or half.status is None:
            return
        place, pair = _place(record), (peer.controller, peer.device)
        if missing is not None and missing.what == "begins":
            self._seen_of(pair).begun_before(half.frame)
        if half.status == STATUS_NOT_READY:
            tally = self._idle_reads.get(peer.device)
            sure = missing is None
            if sure:
                (tally or put(self._idle_reads, peer.device, _Tally())).add(half.frame)
            _append(self._idle, pair, _Read(_ar(record), place, None, None, half.frame, sure))
        else:
            self._refusal(peer.device, place, half.status, half.frame)

    def foreign(self, record: Record) -> None:
        """A Write that is no job has been answered: its index is not ours, or its request is missing.

        Or it is one to index 47 that the capture cut: it may have been a change, and so a save.
        """
        peer = record.peer
        asked, answer = record.request, record.response
        if asked is not None and record.index == SHARED_INDEX:
            if answer is None or not answer.status:
                self._unsaved_of(peer.device).save((asked.frame, 0), None, seen=False)
            return
        if asked is None:
            spot = _place(record)[1:]
            asks = peer.controller, peer.device, spot
            if asks not in self._asking:
                put(self._asking, asks, True)
            if answer is not None and answer.status == 0:
                put(self._accepting, (peer.device, spot), True)
            return
        if answer is None or len(asked.data) > known().channel_bytes:
            return
        if not answer.status and record.index not in known().confused_indices:
            return
        message = decode_request(asked.data)
        if not message.shaped or message.flaws:
            return
        key = peer.device, record.index
        status = None if answer.status is None else status_hex(answer.status)
        args = {"index": record.index, "device": peer.device, "status": status}
        tally, _ = self._foreign.get(key) or put(self._foreign, key, (_Tally(), args))
        tally.add(asked.frame)

    def cut(self, cut: Cut) -> None:
        """The capture cut a frame of ours."""
        frame, captured, _ = cut
        self._cut_at = captured if self._cut_at == captured or not self._cut.count else None
        self._cut.add(frame)

    def steps_back(self, frame: int, milliseconds: float) -> None:
        """The time steps back in a frame of ours: by so little only where frames are not in their order."""
        if milliseconds * 1e6 < limits().disorder_ns:
            self._disorder.add(frame)

    def finish(
        self, dropped: int | None, gaps: bool, complete: bool = True, *, excerpt: bool = False
    ) -> Iterator[Remark]:
        """All that can be said now; of frames that the file says are missing, and whether some are inside it.

        A file that could not be read to its end may have a save there. In an excerpt gaps are intended.
        """
        yield from self._read_there(gaps)
        yield from self._nothing()
        for _, (tally, args) in self._foreign.items():
            yield Remark("DS707", tally.first, args)
        yield from self._slots()
        yield from self._ignored_axes()
        if complete:
            yield from self._lost()
        yield from self.repetition.finish()
        left_out = False
        for remark in self._missing(dropped):
            if not excerpt or remark.args["what"] in ("cut", "disorder"):
                yield remark
            elif not left_out:
                left_out = True
                yield Remark("DS725", remark.frame, {"what": "excerpt"})

    def _seen_of(self, pair: Pair) -> _Seen:
        return self._seen.get(pair) or put(self._seen, pair, _Seen())

    def _newest_hole(self, device: str) -> int:
        """The newest frame behind which something of a device may be missing; 0 for none."""
        return 0 if self._completeness is None else self._completeness.newest(device)

    # Requests here, Reads there (DS706), Reads for nothing (DS703)

    def _open(self, pair: Pair, place: Place, job: Job) -> None:
        asked, message = job.write_request, job.message
        if job.write_refused or asked is None or message is None:
            return
        reference, axis = message.request_reference, message.axis
        opened = _Open(job.record.ar, place, reference, axis, asked.frame, job.superseded_by)
        _append(self._opened, pair, opened)

    def _orphan(self, pair: Pair, place: Place, job: Job) -> None:
        half, response = job.read_response, job.response
        if half is not None and response is not None:
            reference, axis = response.request_reference, response.axis
            read = _Read(_ar(job.record), place, reference, axis, half.frame)
            _append(self._orphans, pair, read)

    def _read_there(self, gaps: bool) -> Iterator[Remark]:
        """Only places where nothing is asked: elsewhere a Read may belong to a request of its own.

        Where frames are missing that request may be among them.
        """
        for pair, opened in [] if gaps else self._opened.items():
            if self._newest_hole(pair[1]):
                continue
            idle = list(self._idle.get(pair) or [])
            orphans = self._orphans.get(pair) or []
            strays = self._unasked(pair, orphans)
            for each in opened:
                if any(read.place == each.place and read.frame > each.frame for read in orphans):
                    continue  # its own place has a response that may be its own
                read = _elsewhere(each, strays, answer=True)
                read = read or _elsewhere(each, self._unasked(pair, idle))
                if read is None or not (read.sure or _is_habit(each, read, opened, idle)):
                    continue
                idle = [other for other in idle if other.place != read.place]
                self._elsewhere.add(pair)
                yield Remark("DS706", read.frame, {
                    "device": pair[1], "request": each.frame, "frame": read.frame,
                    "place": place_args(each.place), "other": place_args(read.place),
                })  # fmt: skip
            if not idle:
                self._explained.add(pair)

    def _unasked(self, pair: Pair, reads: list[_Read]) -> list[_Read]:
        return [read for read in reads if self._asking.get((*pair, read.place[1:])) is None]

    def _nothing(self) -> Iterator[Remark]:
        """All of a device, unless each of them is explained."""
        puzzling = {
            pair[1] for pair, reads in self._idle.items()
            if pair not in self._explained or len(reads) >= known().of_pair
        }  # fmt: skip
        for device, tally in self._idle_reads.items():
            if device in puzzling:
                yield Remark("DS703", tally.first, {"count": tally.count, "device": device})

    # The place: slot (DS708) and axis (DS710)

    def _slot(self, device: str, place: Place, job: Job) -> None:
        answer, read = job.write_response, job.read_response
        spot = device, place[1], place[2]
        self._accept(device, place, job)
        if read is not None and read.data and spot not in self._answering:
            put(self._answering, spot, place)
        if answer is not None and answer.status:
            self._refusal(device, place, answer.status, answer.frame)
        if read is not None and read.status:
            self._refusal(device, place, read.status, read.frame)

    def _refusal(self, device: str, place: Place, status: int, frame: int) -> None:
        if (status >> 8) & 0xFF != _INVALID_SLOT and status & 0xFFFFFF00 != _NO_ACCESS:
            return
        key = device, place
        tally, first = self._refusing.get(key) or put(self._refusing, key, (_Tally(), status))
        if frame < tally.first:  # jobs are not closed in the order of their frames
            first = status
        self._refusing[key] = tally, first
        tally.add(frame)

    def _accept(self, device: str, place: Place, job: Job) -> None:
        """Whether a request to the place was accepted, or a response read there, in any API: none is told."""
        answer, read, spot = job.write_response, job.read_response, (device, place[1:])
        taken = answer is not None and answer.status == 0
        if spot not in self._accepting and (taken or (read is not None and read.data)):
            put(self._accepting, spot, True)

    def _slots(self) -> Iterator[Remark]:
        for (device, place), (tally, status) in self._refusing.items():
            if self._accepting.get((device, place[1:])) or self._newest_hole(device):
                continue
            other = next(
                (there for (who, *spot), there in self._answering.items()
                 if who == device and tuple(spot) != place[1:3]), None,
            )  # fmt: skip
            if other is not None:
                yield Remark("DS708", tally.first, {
                    "device": device, "place": place_args(place),
                    "status": status_hex(status), "other": place_args(other),
                })  # fmt: skip

    def _axis(self, device: str, place: Place, job: Job) -> None:
        message, response, read = job.message, job.response, job.read_response
        if message is None or not message.axis or response is None or read is None:
            return  # axis 0 names no drive object
        axes = self._axes.get((device, place)) or put(self._axes, (device, place), {})
        missing = any(b.error and b.error.code == known().axis_error for b in response.blocks)
        axes.setdefault(_NO_AXIS if missing else message.axis, read.frame)

    def _ignored_axes(self) -> Iterator[Remark]:
        for (device, place), axes in self._axes.items():
            if len(axes) > 1 and _NO_AXIS not in axes:  # else the axis counts there
                args = {"axes": sorted(axes), "device": device, "place": place_args(place)}
                yield Remark("DS710", sorted(axes.values())[1], args)

    # Changes that are not saved (DS721)

    def _change(self, job: Job) -> None:
        message, asked = job.message, job.write_request
        if message is None or asked is None or job.write_refused:
            return
        response = None if job.stray else job.response
        outcome = _outcome(message, response) if message.operation == "change" else ()
        who = job.peer
        effect = _effect(
            tuple(
                (each.pnu, done, changes_itself(each.pnu, who.vendor_id, who.family))
                for each, done in outcome
            ),
            asked.cut and _may_change_more(message, response),
        )
        if not (effect.saves or effect.changes):
            return
        unsaved = self._unsaved_of(job.peer.device)
        unsaved.family = who.drives
        moment = asked.frame, job.record.position
        target = target_of(*_place(job.record)[1:], message.axis)
        for whole, seen in effect.saves:
            unsaved.save(moment, None if whole else target, seen=seen)
        for seen, pnus in effect.changes:
            unsaved.change(moment, target, pnus, seen=seen)

    def _changed_unseen(self, job: Job) -> None:
        """The response to a change whose request is not known: that may have been a save."""
        read, response = job.read_response, job.response
        if read is None or job.repeats is not None:
            return
        known = None if response is None else response.response_id
        if known in _OF_CHANGES or (known is None and read.cut):
            moment = read.frame, job.record.position
            self._unsaved_of(job.peer.device).save(moment, None, seen=False)

    def _unsaved_of(self, device: str) -> Unsaved:
        return self._unsaved.get(device) or put(self._unsaved, device, Unsaved())

    def _lost(self) -> Iterator[Remark]:
        lacks = self._completeness
        for device, unsaved in self._unsaved.items():
            if lacks is not None and (hole := lacks.newest_gap(device)):
                unsaved.save((hole, 0), None, seen=False)
            facts = unsaved.told()
            if facts is not None:
                first = facts.pop("first")
                case = "unsaved" if facts["targets"] == 1 else "unsaved_targets"
                if facts["axis"] is not None:
                    case = "unsaved_object"
                more = "all_known" if not facts["unknown"] else "some_unknown"
                who = {"device": device, "family": unsaved.family}
                yield Remark("DS721", first, {**who, "case": case, "more": more, **facts})

    # What the capture does not have (DS725)

    def _missing(self, dropped: int | None) -> Iterator[Remark]:
        if dropped:
            yield Remark("DS725", 1, {"what": "dropped", "count": dropped})
        if self._cut.count:
            args = {"what": "cut", "count": self._cut.count, "bytes": self._cut_at}
            yield Remark("DS725", self._cut.first, args)
        if self._completeness is not None and self._completeness.late:
            self._disorder.add(self._completeness.first_late)
            self._disorder.count += self._completeness.late - 1
        if self._disorder.count and self._seen:
            args = {"what": "disorder", "count": self._disorder.count}
            yield Remark("DS725", self._disorder.first, args)
        for pair, seen in self._seen.items():
            for what, frame, args in self._missing_of(pair, seen):
                who = {"controller": pair[0], "device": pair[1]}
                yield Remark("DS725", frame, {"what": what, **who, **args})

    def _missing_of(self, pair: Pair, seen: _Seen) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """What the capture lacks of two stations, each with its first frame."""
        lacks = None
        if seen.station is None and self._completeness is not None:
            lacks = self._completeness.lacks(*pair)
        if lacks is not None and seen.asked and not lacks.hears:
            yield "only_requests", seen.first, {"count": seen.asked}
        elif lacks is not None and seen.orphans and not lacks.asks:
            yield "only_responses", seen.first, {"count": seen.orphans}
        elif seen.orphans and not seen.asked:
            yield "no_write", seen.first, {"count": seen.orphans}
        elif lacks is not None and lacks.halves:
            yield "half_calls", lacks.half, {"count": lacks.halves}
        elif not self._has_holes(pair, lacks):
            before = [each for each in seen.before if each < seen.since or not seen.since]
            if before:
                yield "file_begins", min(before), {"count": len(before)}
        if lacks is not None and lacks.holes:
            yield "gaps", lacks.holes[0].before, {"numbers": _numbers(lacks.holes)}
        if (lacks is None or lacks.hears) and not self._cut.count:  # else a response may be cut off
            yield from self._ends(seen, lacks)

    def _ends(
        self, seen: _Seen, lacks: Lacking | None
    ) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """Requests, and a last call, of which the response may lie behind the end of the capture."""
        frames = [seen.behind.first] if seen.behind.count else []
        last = lacks is not None and 0 < seen.call >= lacks.newest_call
        if last:
            frames.append(seen.call)
        if frames:
            yield "file_ends", min(frames), {"count": seen.behind.count + last}

    def _has_holes(self, pair: Pair, lacks: Lacking | None) -> bool:
        """Whether a request may be missing inside the capture, or stand at another place."""
        if self._disorder.count or pair in self._elsewhere:
            return True
        return bool(self._newest_hole(pair[1]) if lacks is None else lacks.holes or lacks.unasked)


def _numbers(holes: list[Hole]) -> str:
    """The sequence numbers that are missing, of some holes only where these are many."""
    told = dict.fromkeys(hole.numbers() for hole in holes[:_TOLD])
    return ", ".join([*told, "..."] if len(holes) > _TOLD else told)


def _outcome(message: Request, response: Response | None) -> Iterator[tuple[Address, bool | None]]:
    """Each parameter of a change, and whether it was changed; None where that is not known."""
    blocks = response.blocks if response is not None else []
    accepted = response is not None and not blocks and response.response_id == CHANGED
    for number, address in enumerate(message.addresses):
        if response is not None and response.response_id == NOT_SUPPORTED:
            yield address, False
        elif number < len(blocks):
            yield address, blocks[number].error is None
        else:
            yield address, True if accepted else None


def _may_change_more(message: Request, response: Response | None) -> bool:
    """Whether what the capture cut off a request may have changed parameters; without its id: any of it."""
    told, count = len(message.addresses), message.asked
    if count == told:
        return False
    if response is None or response.response_id is None:
        return True
    answer = response.response_id
    if answer == NOT_SUPPORTED or (message.request_id is None and answer not in _OF_CHANGES):
        return False
    count, behind = count or response.parameter_count, response.blocks[told:]
    if count is None or len(behind) < count - told:
        return True
    return any(each.error is None for each in behind)


class _Effect(NamedTuple):
    """What a request did to what is lost at power-off.

    Attributes:
        saves: for each kind of save in it whether it saves all drive objects, and whether it is known to
            have been accepted.
        changes: those behind the last save, whether they are known to have been accepted, and of what: none of
            what an unknown save may have reached, or of what is not known.
    """

    saves: tuple[tuple[bool, bool], ...]
    changes: tuple[tuple[bool, tuple[int, ...]], ...]


@lru_cache(maxsize=4096)
def _effect(parts: tuple[tuple[int, bool | None, bool], ...], more: bool) -> _Effect:
    """Of the numbers of parameters, in their order, their outcomes, and whether the drive changes them itself.

    `more`: what was changed behind them is not known; it may be a save, too.
    """
    saving, whole = known().saving, known().saving_all
    saves: set[tuple[bool, bool]] = set()
    changes: dict[bool, tuple[int, ...]] = {}
    for pnu, done, changing in parts:
        if done is False:
            continue
        if pnu in saving:
            saves.add((pnu == whole, bool(done)))
            changes = {} if done or not changes else {False: ()}
        elif not changing:
            changes[bool(done)] = (*changes.get(bool(done), ()), pnu)
    if more:
        saves.add((True, False))
        changes = {False: ()}
    return _Effect(tuple(sorted(saves)), tuple(sorted(changes.items())))


def _place(record: Record) -> Place:
    return (record.api, record.slot, record.subslot, record.index)


def _ar(record: Record) -> bytes | None:
    return None if record.implicit else record.ar


def _append(memory: OrderedDict[Pair, list[_V]], key: Pair, item: _V) -> None:
    """Keeps the first of each pair of stations: later ones of the same cause say no more."""
    items = memory.get(key) or put(memory, key, [])
    if len(items) < known().of_pair:
        items.append(item)


def _elsewhere(opened: _Open, reads: list[_Read], *, answer: bool = False) -> _Read | None:
    """The first Read at another place while the request was open; an answer must be that to it.

    A place where Reads were before has a request of its own, perhaps from before the capture.
    """
    before = {read.place[1:] for read in reads if read.frame < opened.frame and not answer}
    for read in reads:
        if read.place[1:] == opened.place[1:] or read.frame < opened.frame:
            continue  # the API is not told
        if read.place[1:] in before:
            continue
        if read.ar not in (opened.ar, None):
            continue  # another program reads there
        if opened.until is not None and read.frame > opened.until:
            return None
        if not answer or (read.reference, read.axis) == (opened.reference, opened.axis):
            return read
    return None


def _is_habit(first: _Open, read: _Read, opened: list[_Open], reads: list[_Read]) -> bool:
    """Whether a later request went to the same place, and was looked for at the same other one."""
    return any(
        first.place == each.place and read.place == later.place
        and read.frame < each.frame < later.frame
        for each in opened for later in reads
    )  # fmt: skip
