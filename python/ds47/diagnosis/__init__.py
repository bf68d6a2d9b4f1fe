"""Diagnoses: what went wrong and what to change, from findings, frames and their history (docs/diagnoses.md).

A finding names a symptom, a diagnosis its cause. Diagnoses are rules like the others (DS7xx). Those about one
message or transaction are made when a job is closed: `order` (frames), `length`, `refusal` (error
numbers) and `repair` (what the bytes were meant to be). Those that need the whole capture are in `capture`
and `repetition`; `grouping` makes one line of all findings of one cause. Nothing is printed here.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Final, TypeVar

from ds47.diagnosis import length, order, refusal
from ds47.diagnosis.capture import WholeCapture
from ds47.pairing import Alike, Job, Peer, Place, UsualJob
from ds47.profidrive import Options, Request, Response
from ds47.profidrive.model import VALUE, Block
from ds47.profinet.records import Record
from ds47.rules import PNU_ACCESS_IDENTIFICATION, Remark, is_mismatch
from ds47.spec import formats, parameters
from ds47.spec.semantics import known

_LEAST_NORMAL: Final = {0x08: 2.0**-126, 0x0F: 2.0**-1022}
"""Float32 and Float64: what is nearer to zero is no number that anybody typed."""
_MOST: Final = 1e30
_MOST_KNOWN: Final = 65_536
_NOTHING: Final[tuple[Remark, ...]] = ()


class Diagnoses:
    """Takes jobs as they are closed, and what belongs to no job.

    Args:
        codec: dialects of the messages.
    """

    def __init__(self, codec: Options) -> None:
        self._codec = codec
        self._known: set[tuple[Place, Alike]] = set()
        """Usual jobs that showed nothing; one more of them adds nothing, as long as nothing is forgotten."""
        self._whole = WholeCapture(self._known.clear)
        self._formats: OrderedDict[tuple[str, int], int] = OrderedDict()
        """Format in which a parameter of a device was read last."""
        self._limits: OrderedDict[str, int] = OrderedDict()
        """r0974 of a device: bytes of its longest message."""
        self._axes: OrderedDict[str, set[int]] = OrderedDict()
        """Axes of a device that answered."""

    def closed(self, job: Job) -> list[Remark]:
        """What a closed job shows, and the findings it has, were caused by."""
        self._whole.closed(job)
        remarks = [] if order.is_usual(job) else list(order.of(job))
        response = job.response
        usual = response is not None and not response.flaws and response.response_id in (1, 2)
        if not usual or _is_odd(job):
            remarks += self._cause(job)
        self._learn(job)
        for remark in remarks:
            remark.job = job
        return remarks

    def usual(
        self, job: UsualJob, alike: Alike, careful: Callable[[UsualJob], Job]
    ) -> Sequence[Remark]:
        """`closed` of a usual job; `careful` makes a `Job` of it, which most often is not needed.

        What `closed` remembers of a read is who asked whom for which parameters where, with which axis and
        which formats, each of them once: all that is equal in two jobs that are alike at one place. Of a
        change it is the frame and the bytes too. So only the first such job goes there, and the next one
        after anything of that was forgotten (the oldest entry of a full memory) or overwritten (the
        format of a parameter).
        """
        known_job = job.place, alike
        if known_job in self._known:
            self._whole.usual(job)
            return _NOTHING
        if len(self._known) >= _MOST_KNOWN:
            self._known.clear()
        self._known.add(known_job)
        remarks = self.closed(careful(job))  # which clears it where something is forgotten
        if remarks:
            self._known.discard(known_job)
        return remarks

    def nothing_to_read(self, peer: Peer, record: Record) -> None:
        """A Read without record on a channel that has no request."""
        self._whole.nothing_to_read(peer, record)

    def foreign(self, peer: Peer, record: Record) -> None:
        """A Write to an index that is not ours has been answered."""
        self._whole.foreign(peer, record)

    def cut(self, frame: int) -> None:
        """A frame of ours was cut by the capture."""
        self._whole.cut(frame)

    def finish(
        self, dropped: int | None, gaps: bool, requests: int, responses: int
    ) -> Iterator[Remark]:
        """The diagnoses of the whole capture; its RPC calls in numbers.

        `gaps`: frames are missing inside, dropped ones or a file of a series.
        """
        return self._whole.finish(dropped, gaps, requests, responses)

    def _cause(self, job: Job) -> Iterator[Remark]:
        """One cause explains a job: a repair all of it, then lengths, then each refusal by its number."""
        refused = refusal.refusals(job)
        repaired = self._repair(job, refused)
        if repaired is not None:
            yield repaired
            return
        device = job.peer.device
        size_of = partial(self._size, device)
        remarks = [
            *length.request_too_short(job, [each.code for each in refused]),
            *length.answer_cut(job, size_of),
            *length.answer_too_long(job, self._limits.get(device), size_of),
            *refusal.of(job, refused),
        ]
        for remark in remarks:
            if remark.rule == "DS709":
                self._suggest_axis(job, remark)
        yield from remarks or refusal.not_seen(job)

    def _repair(self, job: Job, refused: list[refusal.Refusal]) -> Remark | None:
        half, message = job.write_request, job.message
        if half is None or message is None or half.missing:
            return None
        from ds47.diagnosis import repair  # only here: most captures need no repair

        device = job.peer.device
        errors = {each.number: each.code for each in refused}
        found = repair.find(
            half.data, message, errors, partial(self._is_known, device),
            partial(self._format, device), replace(self._codec, vendor_id=job.peer.vendor_id),
        )  # fmt: skip
        if found is None:
            return None
        args = {"what": found.what, **found.args} if found.what else found.args
        return Remark(found.rule, half.frame, args, corrected=found.request)

    def _suggest_axis(self, job: Job, remark: Remark) -> None:
        """Where exactly one axis of the device answered, it is the one to ask."""
        axes, half = self._axes.get(job.peer.device, set()), job.write_request
        if len(axes) == 1 and half is not None:
            from ds47.diagnosis import suggest

            remark.corrected = suggest.with_axis(half.data, next(iter(axes)))

    # What was seen before

    def _learn(self, job: Job) -> None:
        request, response = job.message, job.response
        if request is None or response is None or response.response_id not in (1, 2, 0x81, 0x82):
            return
        device, formats_ = job.peer.device, self._formats
        if not self._is_new(device, request, response) or is_mismatch(job):
            return
        if request.axis is not None:
            self._learn_axis(device, request.axis, response.blocks)
        if request.operation != "read":
            return
        for address, block in zip(request.addresses, response.blocks, strict=False):
            if address.attribute != VALUE or block.error is not None:
                continue
            key = device, address.pnu
            before = formats_.get(key)
            if before != block.format:
                if before is not None or len(formats_) >= known().history:
                    self._known.clear()
                _put(formats_, key, block.format)
            if address.pnu == PNU_ACCESS_IDENTIFICATION and address.subindex == 0 and block.values:
                longest = block.values[0]
                if isinstance(longest, int) and longest > 0:
                    _put(self._limits, device, longest)

    def _is_new(self, device: str, request: Request, response: Response) -> bool:
        """Whether there is something to learn if the response belongs to the request; most often not."""
        axes, formats_ = self._axes.get(device), self._formats
        if axes is None or request.axis not in axes:
            return True
        if request.operation == "read":
            for address, block in zip(request.addresses, response.blocks, strict=False):
                if address.attribute == VALUE and block.error is None:
                    pnu = address.pnu
                    if formats_.get((device, pnu)) != block.format:
                        return True
                    if pnu == PNU_ACCESS_IDENTIFICATION:
                        return True
        return False

    def _learn_axis(self, device: str, axis: int, blocks: list[Block]) -> None:
        axes = self._axes.get(device)
        if axes is None:
            if len(self._axes) >= known().history:
                self._known.clear()
            axes = _put(self._axes, device, set())
        if axis in axes:
            return
        error = known().axis_error
        if all(block.error is None or block.error.code != error for block in blocks):
            axes.add(axis)

    def _is_known(self, device: str, pnu: int) -> bool:
        return pnu in parameters() or (device, pnu) in self._formats

    def _format(self, device: str, pnu: int) -> int | None:
        seen = self._formats.get((device, pnu))
        if seen is not None:
            return seen
        row = parameters().get(pnu)
        return _codes().get(row.type.removesuffix("[]")) if row else None

    def _size(self, device: str, pnu: int) -> int | None:
        code = self._format(device, pnu)
        row = formats().get(code) if code is not None else None
        return row.size if row else None


def _is_odd(job: Job) -> bool:
    """Whether a job that was answered well may have something to be repaired all the same."""
    message = job.message
    if message is None or (not message.flaws and message.operation == "read"):
        # Fewer blocks than asked: the response may have been too long.
        response = job.response
        return bool(message and response and len(response.blocks) < len(message.addresses))
    if message.flaws:
        return True
    return any(map(is_unlikely, message.blocks))


def is_unlikely(block: Block) -> bool:
    """Whether a value to be written is none that anybody means: not finite, denormal, or huge."""
    least = _LEAST_NORMAL.get(block.format)
    if least is None:
        return False
    for value in block.values:
        if isinstance(value, str):  # NaN or infinite
            return True
        if value and not least <= abs(value) <= _MOST:
            return True
    return False


_K = TypeVar("_K")
_V = TypeVar("_V")


def _put(memory: OrderedDict[_K, _V], key: _K, value: _V) -> _V:
    memory[key] = value
    memory.move_to_end(key)
    if len(memory) > known().history:
        memory.popitem(last=False)
    return value


@cache
def _codes() -> dict[str, int]:
    return {row.name: code for code, row in formats().items()}
