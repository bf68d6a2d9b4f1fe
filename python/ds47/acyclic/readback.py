"""What was written last to a parameter, and whether a later read brings something else (DS417).

A parameter belongs to a drive object (`profidrive.drive_objects`), for any controller and record index. A change
takes effect between its Write request and its response, or perhaps, if the response was not fetched. So there is
a finding only if the last written value is the same in every order that the capture allows, and for every drive
object that a request may have reached.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from ds47.acyclic.pairing import Job
from ds47.profidrive import Address, Block, Request, Response
from ds47.profidrive.dictionary import changes_itself
from ds47.profidrive.drive_objects import DO_IDENTIFICATION, DriveAccess, DriveObjects, access
from ds47.profidrive.model import VALUE, Value
from ds47.profinet.records import Peer
from ds47.spec.semantics import known

_NEGATIVE: Final = 0x80
"""The first response id that is negative."""
NEVER: Final = 1 << 62
"""A frame number beyond every capture."""
_OF_CHANGES: Final = (0x02, 0x82, 0x42, 0xC2)
"""Response IDs of changes."""
_KEPT: Final = 8
"""How many Writes may compete for the last value of a parameter; with more the value is unknown."""

Element = tuple[str, int, int]
"""Device, PNU and subindex."""


@dataclass(slots=True, eq=False, repr=False)
class Written:
    """One value that was written. If accepted, it takes effect at some moment between `asked` and `until`."""

    access: DriveAccess
    number: int
    """Its place in the request, from 0: a request may name a parameter twice."""
    raw: bytes
    format: int
    value: Value
    asked: int
    """Frame of the Write request."""
    until: int = NEVER
    """From this frame on it is in force, or never will be; NEVER while that is open."""
    certain: bool = False
    """Whether the response says that it was accepted."""
    replaces: bool = False
    """Whether it replaced a value that is forgotten: a read that was open then may return that value."""


@dataclass(slots=True)
class _Device:
    """What applies to all parameters of a device."""

    forgotten: int = 0
    """Values written up to this frame no longer count."""
    recomputing: set[Job] = field(default_factory=set)
    """Changes without a response that make the drive recompute other parameters."""


class ReadBack:
    """Remembers what was written, and compares what is read.

    Args:
        most: how many parameters to remember; the one written longest ago is forgotten first.
        unseen: whether an unknown change may have come after a frame: a call to the device is missing, or waits
            until its AR has proved itself.
    """

    def __init__(self, most: int, unseen: Callable[[Peer, int], bool]) -> None:
        self._most = most
        self._unseen = unseen
        self.objects = DriveObjects()
        self._written: OrderedDict[Element, list[Written]] = OrderedDict()
        self._open: dict[Job, list[tuple[Element, Written]]] = {}
        """Changes without a response, by parameter number."""
        self._devices: OrderedDict[str, _Device] = OrderedDict()
        self.pnus: set[int] = set()
        """All PNUs written so far, and those with data about the device: most reads are of other PNUs."""

    def asked(self, job: Job) -> None:
        """A Write request asks for a change."""
        message, half = job.message, job.write_request
        assert message is not None
        if message.operation != "change":
            return
        assert half is not None
        reached, told = access_of(job), list[tuple[Element, Written]]()
        if _is_broken(message):
            self._device(reached.device).recomputing.add(job)  # its values are unknown
        pairs = zip(message.addresses, message.blocks, strict=False)
        for number, (address, block) in enumerate(pairs):
            if address.pnu in known().recomputing:
                self._device(reached.device).recomputing.add(job)
            if changes_itself(address.pnu, job.peer.vendor_id, job.peer.family):
                continue
            for element, raw, value in elements(address, block):
                key = reached.device, address.pnu, element
                written = Written(reached, number, raw, block.format, value, half.frame)
                told.append((key, written))
                self._remember(key, written)
            self.pnus.add(address.pnu)
        self._open[job] = told

    def _remember(self, key: Element, written: Written) -> None:
        there = self._written.setdefault(key, [])
        self._written.move_to_end(key)
        if len(there) == _KEPT:
            written = Written(
                written.access, written.number, b"", written.format, "", written.asked
            )
            there.clear()  # too many at once: the value is unknown now
        there.append(written)
        if len(self._written) > self._most:
            self._written.popitem(last=False)

    def connected(self, device: str, frame: int) -> None:
        """A Connect: the drive may have been switched off and on before it."""
        self._device(device).forgotten = frame

    def unasked(self, job: Job) -> None:
        """A response without its request: if it may be that of a change, an unknown value has changed."""
        half, response = job.read_response, job.response
        assert half is not None
        known = None if response is None else response.response_id
        if known in _OF_CHANGES or (known is None and half.cut):
            device = self._device(job.peer.device)
            device.forgotten = max(device.forgotten, half.frame)

    def settled(self, job: Job, *, stray: bool) -> None:
        """A change has its response, or is over without one; `stray`: the response belongs to another request."""
        device = self._device(job.peer.device)
        response, read = job.response, job.read_response
        frame = (job.superseded_by or NEVER) if read is None else read.frame
        if job in device.recomputing:
            device.recomputing.discard(job)
            device.forgotten = max(device.forgotten, _last_frame(job) if frame == NEVER else frame)
        refused, sure = _outcome(job, stray)
        if response is not None and response.failed and not stray:
            for block in response.blocks:
                if block.error is not None:
                    self.objects.refused(access_of(job), block.error.code)
        for key, written in self._open.pop(job, ()):
            written.until = frame
            if refused is None or written.number in refused:
                self._drop(key, written)
            elif written.number < sure:
                self._in_force(key, written)

    def _in_force(self, key: Element, written: Written) -> None:
        """A value was accepted: earlier values written in the same way no longer count."""
        written.certain = True
        there, kept = self._written.get(key, []), list[Written]()
        for each in there:
            if each.access != written.access or each.until >= written.asked:
                kept.append(each)
            elif each.replaces or each.raw != written.raw:
                written.replaces = True
        there[:] = kept

    def _drop(self, key: Element, written: Written) -> None:
        there = self._written.get(key, [])
        there[:] = [each for each in there if each is not written]

    def read(self, job: Job) -> Iterator[dict[str, Any]]:
        """The arguments of a finding, with the `offset` of its block, for each value that differs."""
        request, response, asked = job.message, job.response, job.write_request
        if request is None or response is None or asked is None or request.operation != "read":
            return
        pnus = self.pnus
        for address, block in zip(request.addresses, response.blocks, strict=False):
            pnu = address.pnu
            if block.error is not None:
                self.objects.refused(access_of(job), block.error.code)
            elif pnu == DO_IDENTIFICATION and address.attribute == VALUE:
                self.objects.identified(access_of(job), address.subindex, block.values)
            if pnu in pnus:
                yield from self._compared(access_of(job), job.peer, asked.frame, address, block)

    def _compared(
        self, reached: DriveAccess, peer: Peer, asked: int, address: Address, block: Block
    ) -> Iterator[dict[str, Any]]:
        device = self._device(reached.device)
        if device.recomputing:
            return
        for element, raw, value in elements(address, block):
            key = reached.device, address.pnu, element
            last = self._last(key, reached, device.forgotten, asked)
            if last is None or len(last.raw) != len(raw):
                continue
            if last.raw == raw or (last.format != block.format and last.value == value):
                continue
            if not self._unseen(peer, last.asked):
                there = self._written[key]
                there[:] = [each for each in there if each.until == NEVER]
                yield {
                    "pnu": address.pnu, "subindex": element, "read": value,
                    "written": last.value, "by": last.asked, "family": peer.drives, "offset": block.offset,
                }  # fmt: skip

    def _last(self, key: Element, reached: DriveAccess, since: int, asked: int) -> Written | None:
        """The value that was written last between two frames; None if that is not sure."""
        objects, pnu = self.objects, key[1]
        near = [
            each
            for each in self._written.get(key, ())
            if not objects.other(reached, each.access, pnu)
        ]
        same = [
            each
            for each in near
            if since < each.asked and each.until < asked and objects.same(reached, each.access, pnu)
        ]
        if not any(each.certain for each in same):
            return None
        last = max((each for each in same if each.certain), key=lambda each: each.asked)
        for each in near:
            if each.raw != last.raw and each.until >= last.asked:
                return None  # may have come later
            if each.replaces and each.until >= asked:
                return None  # the value that it replaced may have come later, too
        return max((each for each in same if each.raw == last.raw), key=lambda each: each.asked)

    def _device(self, device: str) -> _Device:
        found = self._devices.get(device)
        if found is None:
            found = self._devices[device] = _Device()
            if len(self._devices) > known().history:
                gone, _ = self._devices.popitem(last=False)
                for key in [key for key in self._written if key[0] == gone]:
                    del self._written[key]
        return found


def access_of(job: Job) -> DriveAccess:
    """How the request of a job reaches its parameters."""
    record = job.record
    axis = job.message.axis if job.message else None
    return access(job.peer.device, record.index, record.slot, record.subslot, axis)


def _last_frame(job: Job) -> int:
    """The last frame of a job without a fetched response."""
    half = job.write_response or job.write_request
    assert half is not None
    return half.frame


def _outcome(job: Job, stray: bool) -> tuple[set[int] | None, int]:
    """Which parameters (from 0) did not take effect, None: all; and for how many, from the first, that is sure."""
    message, response, half = job.message, job.response, job.read_response
    assert message is not None
    if job.write_refused:
        return None, 0
    if response is None or half is None or response.response_id is None or stray:
        return set(), 0
    if half.missing or half.status or (response.flaws and _has(response, "DS309", "DS313")):
        return set(), 0  # then even its blocks are not sure
    blocks, failed = response.blocks, set[int]()
    if response.failed:
        failed.update(number for number, block in enumerate(blocks) if block.error is not None)
    ends = response.response_id >= _NEGATIVE or (response.flaws and _has(response, "DS315"))
    return failed, len(blocks) if ends else len(message.addresses)


def _is_broken(message: Request | Response) -> bool:
    """Whether a message is not decoded to its end."""
    return _has(message, "DS309", "DS313", "DS315")


def _has(message: Request | Response, *rules: str) -> bool:
    return any(flaw.rule in rules for flaw in message.flaws)


def elements(address: Address, block: Block) -> Iterator[tuple[int, bytes, Value]]:
    """Subindex, bytes and value of each element of a block; nothing for errors, texts and strings."""
    values = block.values
    if address.attribute != VALUE or not values or len(values) != block.value_count:
        return
    size = len(block.raw) // len(values)
    for number, value in enumerate(values):
        yield address.subindex + number, block.raw[number * size : (number + 1) * size], value
