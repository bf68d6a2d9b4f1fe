"""Judgement: a job, its request and its response to findings (spec/rules.toml has the catalogue).

Compares a request with its response, and a transaction with its history. The codec finds what is wrong inside
one message (`Flaw`); that is only passed on. `record_calls` and `record_events` report what is wrong with the
transport.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Final, NamedTuple, TypeVar

from ds47.acyclic.pairing import Job
from ds47.acyclic.readback import ReadBack
from ds47.findings.remark import Remark
from ds47.profidrive import Address, Block, Flaw, Request, Response
from ds47.profidrive.drive_objects import DO_IDENTIFICATION, SELECTION, DriveObjects
from ds47.profidrive.model import VALUE
from ds47.profidrive.parameter import NOT_SUPPORTED, family_fits
from ds47.profinet.records import Half, Peer
from ds47.spec.semantics import Limits, known
from ds47.spec.statuses import status_hex

PNU_ACCESS_IDENTIFICATION: Final = 974
"""r0974[0] is the longest message the device takes (docs/protocol.md A.5, D.1)."""
DONE: Final = (0x01, 0x02)
"""Response ids of a read and of a change that succeeded."""
WRONG_COUNT: Final = 0x18
"""The number of values does not fit (docs/protocol.md A.7)."""
TOO_MANY: Final = "DS304"
"""More parameters than usual."""
ABSENT: Final = frozenset(("DS311", "DS313", "DS314", "DS315", "DS412"))
"""Flaws that do not count in a message cut by the capture: pad, bytes left over or missing, error block."""


Reach = tuple[int, int, int]
"""A way to a drive object: slot, subslot and axis byte; -1 if the axis byte does not count.

Two requests that go the same way reach the same drive object, however the device uses the three.
"""

Asker = tuple[str, str, int, int, int, int, int | None]
"""Who asks where: controller, device, API, slot, subslot, index and axis byte; over any AR."""
Ways = OrderedDict[Asker, tuple[int, Reach]]
"""Asker of usual jobs -> the frame of the first request, and its way."""

_K = TypeVar("_K")
_V = TypeVar("_V")


def is_mismatch(job: Job) -> bool:
    """Whether the response cannot be the answer to the request (docs/pairing.md, states).

    Header fields that the capture cut off do not count.
    """
    request, response = job.message, job.response
    half, read = job.write_request, job.read_response
    if request is None or response is None or half is None or read is None:
        return False
    sent, got = request.request_reference, response.request_reference
    if sent != got and sent is not None and got is not None:
        return True
    sent, got = request.axis, response.axis
    if sent != got and sent is not None and got is not None:
        return True
    if request.asked is not None and len(response.blocks) > request.asked:
        return True
    sent, got = request.request_id, response.response_id
    if sent is not None and got is not None:
        return not family_fits(sent, got)
    return (sent is None and not half.cut) or (got is None and not read.cut)


def is_cut_off(half: Half, block: Block) -> bool:
    """Whether the capture cut off the error number of an error block."""
    error = block.error
    return half.cut and error is not None and block.value_count > 0 and not error.words


def drive_time_ns(job: Job) -> int | None:
    """The drive's share of the duration, in nanoseconds: without the pause of the program before its first Read.

    None if the duration, the time of the Write response or that of the first Read request is unknown.
    """
    write, accepted, read = job.write_request, job.write_response, job.read_response
    if write is None or accepted is None or read is None:
        return None
    first = job.polls[0][0] if job.polls else job.read_request
    if first is None:
        return None
    pause = max(0, first.time_ns - accepted.time_ns)
    return read.time_ns - write.time_ns - pause


def asker(job: Job, axis: int | None) -> Asker:
    """The asker of a job."""
    controller, device, _, api, slot, subslot, index = job.key
    return controller, device, api, slot, subslot, index, axis


class Seen(NamedTuple):
    """The format in which a parameter was read, or the type that its description says; and the frame."""

    format: int
    frame: int


class Shown:
    """What responses have shown about devices: `ds47.diagnosis` adds to it, and the judge looks it up."""

    def __init__(self) -> None:
        self.ways: Ways = OrderedDict()
        self.formats: OrderedDict[tuple[str, Reach, int], Seen] = OrderedDict()
        """Device, way and PNU -> the format of the last read."""
        self.longest: OrderedDict[str, int] = OrderedDict()
        """Device -> bytes of its longest response."""
        self.axes: OrderedDict[str, frozenset[int]] = OrderedDict()
        """Device -> axes that answered, if the axis byte counts."""


class Judge:
    """Judges jobs; keeps the little history that some rules need.

    Args:
        limits: numbers of spec/limits.toml.
        slow_ns: a transaction is slow if the drive's share is longer.
        unseen: whether an unknown change may have come after a frame (`ReadBack`).
    """

    def __init__(self, limits: Limits, slow_ns: int, unseen: Callable[[Peer, int], bool]) -> None:
        self._limits = limits
        self._slow_ns = slow_ns
        self._written = ReadBack(limits.written_values, unseen)
        self._written.pnus.update((PNU_ACCESS_IDENTIFICATION, DO_IDENTIFICATION, SELECTION))
        self.shown = Shown()
        self._longest: OrderedDict[str, int] = OrderedDict()
        """Device -> its r0974[0], bytes of a message."""
        self._most: OrderedDict[str, int] = OrderedDict()
        """Device -> its r0974[1], parameters of a request."""
        self._misfits: OrderedDict[tuple[str, int, int, int, int], Half] = OrderedDict()
        """Place -> the last change that was refused for its number of values."""

    @property
    def objects(self) -> DriveObjects:
        """What the capture shows about drive objects; it grows with each response."""
        return self._written.objects

    def asked(self, job: Job) -> None:
        """A Write asks for a change. Call in the order of the capture."""
        self._written.asked(job)

    def refused(self, job: Job) -> None:
        """A Write was refused."""
        if _is_change(job):
            self._written.settled(job, stray=False)

    def connected(self, device: str, frame: int) -> None:
        """A Connect to a device."""
        self._written.connected(device, frame)

    def answered(self, job: Job) -> list[Remark]:
        """The findings about the response of a job and its values. Call in the order of the capture."""
        remarks: list[Remark] = []
        message, response = job.message, job.response
        job.stray = is_mismatch(job)
        self._sent(job, remarks)
        told = self._response(job, remarks)
        write, read = job.write_request, job.read_response
        if job.polls or (write and read and read.time_ns - write.time_ns > self._slow_ns):
            self._time(job, remarks)
        if message is None:
            self._written.unasked(job)
        elif message.operation == "change":
            self._written.settled(job, stray=job.stray)
            if not job.stray and (told or self._misfits):
                self._other_length(job, remarks)
        elif told and not job.stray:
            self._read_back(job, remarks)
            self._learn_limit(job)
        if job.missing is not None and job.write_request is not None:
            remarks.append(Remark("DS110", job.write_request.frame, job.missing._asdict()))
        for remark in remarks:
            remark.job = job
        if message is not None and response is not None and response.response_id in DONE:
            wrong = job.stray or message.flaws or response.flaws
            job.usual = not (remarks or told or wrong)
        return remarks

    def unanswered(self, job: Job, *, dropped: bool) -> list[Remark]:
        """The findings about a job that is closed without a response.

        `dropped`: the capture says that frames are missing.
        """
        remarks: list[Remark] = []
        self._sent(job, remarks)
        if _is_change(job):
            self._written.settled(job, stray=False)
        write = job.write_request if job.read_response is None else None  # else refused (P34)
        if job.missing is not None and write is not None:
            remarks.append(Remark("DS110", write.frame, job.missing._asdict()))
        elif write is not None and not job.write_refused and not job.contested:
            change = _is_change(job)
            if job.superseded_by is not None:
                rule = "DS414" if change else "DS413"
                displaced = {"request": write.frame, "by": job.superseded_by}
                remarks.append(Remark(rule, job.superseded_by, displaced))
            elif not job.limit:  # else a response may have come later
                rule = "DS402" if change else "DS401"
                args = {"reason": job.reason or None, "dropped": dropped}
                remarks.append(Remark(rule, write.frame, args))
        for remark in remarks:
            remark.job = job
        return remarks

    def _sent(self, job: Job, remarks: list[Remark]) -> None:
        """The findings about the request, and about Reads that were refused or brought nothing."""
        half, message, read = job.write_request, job.message, job.read_response
        if half is not None and message is not None:
            if message.flaws:
                _flaws(message.flaws, half, remarks, self._most_parameters(job))
            limit = self._longest.get(job.peer.device)
            length = len(half.data) + half.missing
            if limit and length > limit:
                remarks.append(Remark("DS316", half.frame, {"length": length, "limit": limit}, 0))
            reference = message.request_reference
            if job.previous_reference is not None and job.previous_reference == reference:
                before = {"reference": reference, "first": job.previous}
                remarks.append(Remark("DS415", half.frame, before))
        for _, short in job.too_short if job.polls else ():
            remarks.append(_refused(short))
        if read is not None and read.status:
            remarks.append(_refused(read))
        for empty in job.empty_reads:
            remarks.append(Remark("DS207", empty.frame))

    def _most_parameters(self, job: Job) -> int | None:
        """The most parameters of one request that the device is known to take; None if unknown."""
        request, response = job.message, job.response
        most = self._most.get(job.peer.device)
        if request is None or response is None or job.stray:
            return most
        answered = len(response.blocks)
        return answered if answered == len(request.addresses) == request.parameter_count else most

    def closed(self, job: Job) -> list[Remark]:
        """The findings about the Write response of a closed job; that response may come after the Read."""
        half, read = job.write_response, job.polls[0][0] if job.polls else job.read_request
        if half is None or read is None or half.status or half.frame > read.frame or job.rereads:
            job.usual = False
        job.shows_nothing_new = job.usual and self._is_known(job)
        if half is None or not half.status:
            return []
        return [Remark("DS203", half.frame, {"status": status_hex(half.status)}, job=job)]

    def _is_known(self, job: Job) -> bool:
        """Whether a usual job shows nothing but values. A change never is: it has an effect."""
        asked, message = job.write_request, job.message
        read, response = job.read_response, job.response
        if asked is None or message is None or read is None or response is None:
            return False
        shown, device = self.shown, job.peer.device
        way = shown.ways.get(asker(job, message.axis))
        if way is None or way[0] > asked.frame or message.operation != "read":
            return False
        if len(job.polls) >= known().storm_polls:
            return False
        reach = way[1]
        if read.cut or len(read.data) > shown.longest.get(device, 0):
            return False
        if reach[2] >= 0 and reach[2] not in shown.axes.get(device, ()):
            return False
        formats = shown.formats
        for address, block in zip(message.addresses, response.blocks, strict=False):
            if address.attribute == VALUE:
                before = formats.get((device, reach, address.pnu))
                if before is None or before.format != block.format:
                    return False
        return True

    def _response(self, job: Job, remarks: list[Remark]) -> bool:
        """Returns whether the response has more than values: an error, data about the device, or a readback."""
        half, response, request = job.read_response, job.response, job.message
        assert half is not None
        if response is not None and response.flaws:
            _flaws(response.flaws, half, remarks, self._most_parameters(job))
        if request is None and job.certain:
            remarks.append(Remark("DS403", half.frame, _unasked(job)))
        if response is None:
            return False
        if request is not None and (
            job.stray
            or request.parameter_count != response.parameter_count
            or response.response_id == NOT_SUPPORTED
        ):
            _mirror(half.frame, request, response, remarks)
        addresses = request.addresses if request and not job.stray else []
        read = request is not None and request.operation == "read"
        again = request is None and job.repeats is not None
        telling, tells = self._written.pnus, response.failed > 0
        for number, block in enumerate(response.blocks):
            address = addresses[number] if number < len(addresses) else None
            if block.error is not None:
                if not (again or is_cut_off(half, block)):
                    args = _error_args(job, block, address)
                    remarks.append(Remark("DS410", half.frame, args, block.offset))
            elif address and read:
                if block.value_count != (address.element_count or 1):
                    _count(half.frame, job, block, address, remarks)
                if address.pnu in telling:
                    tells = True
        return tells

    def _time(self, job: Job, remarks: list[Remark]) -> None:
        """The findings about the time of a job that was slow, or was polled."""
        half, accepted = job.read_response, job.write_response
        assert half is not None
        polls = job.not_ready if job.polls else []
        if len(polls) >= self._limits.polls:
            remarks.append(Remark("DS204", half.frame, {"count": len(polls)}))
        if polls:
            since = half.time_ns - (polls[0][0] or polls[0][1]).time_ns
            if since > self._limits.polling_ns and not job.read_before:
                limit = self._limits.polling_ns // 1_000_000
                args = {"milliseconds": since / 1e6, "limit": limit}
                remarks.append(Remark("DS205", half.frame, args))
        late = accepted is not None and accepted.frame > half.frame  # it came after the response
        share = None if late else drive_time_ns(job)
        if share is not None and share > self._slow_ns and half.data and not job.read_before:
            args = {"milliseconds": share / 1e6, "limit": self._slow_ns // 1_000_000}
            remarks.append(Remark("DS416", half.frame, args))

    def _read_back(self, job: Job, remarks: list[Remark]) -> None:
        """Compares what was read with what was written last."""
        for args in self._written.read(job):
            assert job.read_response is not None
            offset = args.pop("offset")
            remarks.append(Remark("DS417", job.read_response.frame, args, offset))

    def _learn_limit(self, job: Job) -> None:
        request, response = job.message, job.response
        if request is None or response is None or request.operation != "read":
            return
        for address, block in zip(request.addresses, response.blocks, strict=False):
            if address.pnu != PNU_ACCESS_IDENTIFICATION or address.attribute != VALUE:
                continue
            for subindex, value in enumerate(block.values, address.subindex):
                memory = (self._longest, self._most)[subindex] if subindex < 2 else None
                if memory is not None and isinstance(value, int) and value > 0:
                    self._learn(memory, job.peer.device, value)

    def _other_length(self, job: Job, remarks: list[Remark]) -> None:
        """Finds an accepted change that differs from a refused one only in its length (DS419)."""
        half, response, record = job.write_request, job.response, job.record
        if half is None or response is None or half.missing:
            return
        place = job.peer.device, record.api, record.slot, record.subslot, record.index
        if response.response_id not in DONE:
            if any(each.error and each.error.code == WRONG_COUNT for each in response.blocks):
                self._learn(self._misfits, place, half)
            return
        before = self._misfits.pop(place, None)
        if before is None or len(before.data) == len(half.data):
            return
        if before.data[1:].startswith(half.data[1:]) or half.data[1:].startswith(before.data[1:]):
            args = {"first": before.frame, "refused": len(before.data), "accepted": len(half.data)}
            remarks.append(Remark("DS419", half.frame, args))

    def _learn(self, memory: OrderedDict[_K, _V], key: _K, value: _V) -> None:
        memory[key] = value
        memory.move_to_end(key)
        if len(memory) > self._limits.longest_messages:
            memory.popitem(last=False)


def _mirror(frame: int, request: Request, response: Response, remarks: list[Remark]) -> None:
    pairs = (
        ("DS404", request.request_reference, response.request_reference),
        ("DS406", request.axis, response.axis),
        ("DS407", request.parameter_count, response.parameter_count),
    )
    for rule, asked, told in pairs:
        if asked is not None and told is not None and asked != told:
            remarks.append(Remark(rule, frame, {"sent": asked, "got": told}))
    sent, got = request.request_id, response.response_id
    if sent is None or got is None:
        return
    if got == NOT_SUPPORTED:
        remarks.append(Remark("DS418", frame, {"id": sent}))
    elif not family_fits(sent, got):
        remarks.append(Remark("DS405", frame, {"sent": sent, "got": got}))


def _error_args(job: Job, block: Block, address: Address | None) -> dict[str, Any]:
    assert block.error is not None
    return {
        "pnu": address.pnu if address else None,
        "subindex": address.subindex if address else None,
        "code": block.error.code,
        "vendor_id": job.peer.vendor_id,
        "info": block.error.info,
        "family": job.peer.drives,
    }


def _unasked(job: Job) -> dict[str, Any]:
    """Why a response has no request: a key of diagnoses.toml, and the request before it."""
    if job.record.implicit:
        return {"case": "unasked_without_ar" if job.repeats is None else "unasked_again"}
    if job.previous is None:
        return {"case": "unasked"}
    return {"case": "unasked_behind", "first": job.previous}


def _flaws(flaws: list[Flaw], half: Half, remarks: list[Remark], most: int | None) -> None:
    """Adds what is wrong inside a message; what the capture cut off is not its fault.

    `most`: the most parameters that the device is known to take; None for the usual number.
    """
    for flaw in flaws:
        args = flaw.args
        if flaw.rule == TOO_MANY and most is not None:
            if args["count"] <= most:
                continue
            args = {**args, "limit": most}
        if not half.cut or flaw.rule not in ABSENT:
            remarks.append(Remark(flaw.rule, half.frame, args, flaw.offset))


def _refused(half: Half) -> Remark:
    return Remark("DS201", half.frame, {"status": status_hex(half.status or 0)})


def _is_change(job: Job) -> bool:
    return job.message is not None and job.message.operation == "change"


def _count(frame: int, job: Job, block: Block, address: Address, remarks: list[Remark]) -> None:
    """Finds fewer or more values than requested.

    Count 0 asks for a whole parameter without index: at least one value; a string has one for each character.
    """
    asked, got = address.element_count or 1, block.value_count
    if address.attribute != VALUE:
        return
    if got < asked:
        rule = "DS408"
    elif got > asked and address.element_count:
        rule = "DS409"
    else:
        return
    args = {"asked": asked, "got": got, "pnu": address.pnu, "family": job.peer.drives}
    remarks.append(Remark(rule, frame, args, block.offset))
