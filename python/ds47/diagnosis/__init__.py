"""Diagnoses: what went wrong and what to change, from findings, frames and their history (docs/diagnoses.md).

A finding names a symptom, a diagnosis its cause. Diagnoses are rules like the others (DS7xx). Those about one
message or transaction are made when a job is closed: `order` (frames), `length`, `refusal` (error
numbers) and `repair` (what the bytes were meant to be). Those that need the whole capture are in `capture`
and `repetition`; `grouping` makes one line of all findings of one cause. Nothing is printed here.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from functools import cache, partial
from typing import TYPE_CHECKING, Final

from ds47.acyclic.judge import DONE, PNU_ACCESS_IDENTIFICATION, Reach, Seen, Shown
from ds47.acyclic.pairing import Job
from ds47.diagnosis import length, order, refusal
from ds47.diagnosis.capture import WholeCapture
from ds47.diagnosis.targets import reach_of
from ds47.findings.remark import Corrected, Remark
from ds47.profidrive import Options, Request, Response, decode_request
from ds47.profidrive.dictionary import is_known, listed
from ds47.profidrive.drive_objects import LOCAL, put
from ds47.profidrive.formats import is_unlikely
from ds47.profidrive.model import VALUE, Block
from ds47.profidrive.parameter import sound_codecs
from ds47.profinet.completeness import Completeness
from ds47.profinet.records import Peer
from ds47.spec import formats
from ds47.spec.semantics import known

if TYPE_CHECKING:
    from ds47.diagnosis.repair import Repair, Retyped

_NO_END: Final = 1 << 17
"""Behind every subindex."""
_TELLING: Final = (*DONE, 0x81, 0x82)
"""Response ids of reads and changes that succeeded, or were answered in part."""


class Diagnoses:
    """Takes jobs as they are closed; what is `over`, and what belongs to no job, goes to `WholeCapture`.

    Args:
        codec: dialects of the messages.
        completeness: what is missing of what stations say to each other.
        shown: what responses have shown up to now.
    """

    def __init__(
        self, codec: Options, completeness: Completeness | None = None, shown: Shown | None = None
    ) -> None:
        self._codec = codec
        shown = Shown() if shown is None else shown
        self._formats, self._axes, self._longest = shown.formats, shown.axes, shown.longest
        whole = WholeCapture(completeness, shown.ways)
        self.asked, self.over, self.finish = whole.asked, whole.closed, whole.finish
        self.foreign, self.nothing_to_read = whole.foreign, whole.nothing_to_read
        self.cut, self.steps_back = whole.cut, whole.steps_back
        self.storms = whole.repetition.storms
        """Polls that go on: any job of their channel may end them."""
        self._anywhere: OrderedDict[tuple[str, int], int | None] = OrderedDict()
        """Format in which a PNU was read on a device; None where these are several."""
        self._limits: OrderedDict[str, int] = OrderedDict()
        """r0974 of a device: bytes of its longest message."""
        self._missing: OrderedDict[str, frozenset[int]] = OrderedDict()
        """Axes of a device of which it said that there is no such drive object."""
        self._refused: OrderedDict[refusal.Sign, None] = OrderedDict()
        """What a device refused (`refusal.sign`),"""
        self._ends: OrderedDict[tuple[str, int], int] = OrderedDict()
        """and the least end of subindices with which a PNU was refused for them."""

    def closed(self, job: Job) -> list[Remark]:
        """What a closed job shows, and the findings it has, were caused by; of a usual one only what is new."""
        device, request, response = job.peer.device, job.message, job.response
        if (answer := job.read_response) is not None:
            size = answer.stated if answer.cut else len(answer.data)
            if size > self._longest.get(device, 0):
                put(self._longest, device, size)
        remarks: list[Remark] = []
        if not job.usual or (request and request.blocks and any(map(is_unlikely, request.blocks))):
            remarks = self._caused(job)
        if request is None or response is None or answer is None or job.stray:
            return remarks
        if response.response_id in _TELLING:
            self._learn(job, request, response, answer.frame)
        return remarks

    def _caused(self, job: Job) -> list[Remark]:
        remarks = list(order.of(job))
        if job.polls:
            remarks += length.read_too_short(job)
        response = job.response
        well = response is not None and not response.flaws and response.response_id in DONE
        if job.missing is None and (not well or _is_odd(job)):
            remarks += self._cause(job)
        for remark in remarks:
            remark.job, remark.args["family"] = job, job.peer.drives
            if remark.corrected is not None:
                remark.corrected = self._offer(job, remark.corrected)
        return remarks

    def _cause(self, job: Job) -> Iterator[Remark]:
        """One cause explains a job: a repair all of it, or lengths; else each refusal has its own."""
        refused = refusal.refusals(job)
        if refused:
            self._learn_refused(job, refused)
        found = self._repair(job, refused)
        if found is not None and not found.each:
            yield self._repaired(job, found)
            return
        meant = [] if found is None else [each for each in found.each if self._fits(job, each)]
        remarks = [] if found is None else list(self._retyped(job, found, meant, refused))
        told = {each.number for each in meant}
        others = [each for each in refused if each.number not in told]
        device = job.peer.device
        size_of, read = partial(self._size, job), partial(self._read_size, job)
        remarks += [
            *length.request_too_short(job, [each.code for each in others]),
            *length.answer_cut(job, read),
            *length.read_refused(job, size_of),
            *length.answer_too_long(
                job, self._limits.get(device), self._longest.get(device, 0), size_of, read
            ),
        ]
        for each, remark in refusal.of(job, others):
            if remark.rule == "DS709":
                self._suggest_axis(job, remark)
            elif remark.rule == "DS717" and each.code == known().no_array:
                remark.corrected = self._simple(job, each.number)
            remarks.append(remark)
        yield from remarks or refusal.not_seen(job)

    def _repair(self, job: Job, refused: list[refusal.Refusal]) -> Repair | None:
        half, message = job.write_request, job.message
        if half is None or message is None or half.missing:
            return None
        from ds47.diagnosis import repair  # only here: most captures need no repair

        errors = {each.number: each.code for each in refused}
        return repair.find(
            half.data, message, errors, partial(self._is_known, job.peer),
            partial(self._format, job), self._codec._replace(vendor_id=job.peer.vendor_id),
            job.peer.drives,
        )  # fmt: skip

    def _repaired(self, job: Job, found: Repair) -> Remark:
        """Of a request that was meant as a whole in another way (DS715, DS716)."""
        half = job.write_request
        assert half is not None
        request = decode_request(found.request, self._codec)
        proven = found.what != "values" and all(
            self._is_proven(job, request, number) for number in range(len(request.blocks))
        )
        corrected = found.request if request.operation == "read" or proven else None
        return Remark(
            found.rule, half.frame, {"what": found.what, **found.args}, corrected=corrected
        )

    def _retyped(
        self, job: Job, found: Repair, meant: list[Retyped], refused: list[refusal.Refusal]
    ) -> Iterator[Remark]:
        """A value under a format that is not that of the parameter, each by itself (DS714)."""
        half, errors = job.write_request, {each.number: each.code for each in refused}
        assert half is not None
        from ds47.diagnosis import suggest

        request = decode_request(found.request, self._codec)
        sure = {
            each.number: each.bits != "number_other" and self._is_proven(job, request, each.number)
            for each in found.each
        }
        told, failed = 0, set[int]()
        if job.response is not None:
            told, failed = len(job.response.blocks), refusal.failed(job.response)
        whole = all(sure.values()) and sure.keys() >= failed
        whole = whole and told >= len(request.addresses)  # of what is not answered nothing is known
        for each in meant:
            args = {**each.args, "better_code": each.args["code"], "bits": each.bits}
            args["code"] = errors.get(each.number)
            seen, said = self._seen(job, args["pnu"]), _described(job, args["pnu"])
            shown = seen or said
            args["seen"] = None if shown is None else shown.frame
            args["case"] = _format_case(seen, said, self._listed(job, args["pnu"]))
            corrected = None
            if sure[each.number]:
                corrected = found.request if whole else suggest.only(request, [each.number])
            yield Remark(found.rule, half.frame, args, corrected=corrected)

    def _fits(self, job: Job, each: Retyped) -> bool:
        """Whether nothing that was read speaks against the format that a value is meant to have."""
        pnu, code = each.args["pnu"], each.args["code"]
        read = self._anywhere.get((job.peer.device, pnu), code)
        return bool(read == code) or (self._seen(job, pnu) or _described(job, pnu)) is not None

    def _is_proven(self, job: Job, request: Request, number: int) -> bool:
        """Whether the parameter was read in this format in the way of the request, or is described so."""
        if number >= len(request.blocks):
            return False  # the request ends before this value
        address, block = request.addresses[number], request.blocks[number]
        seen = self._formats.get((job.peer.device, reach_of(job.key, request.axis), address.pnu))
        if seen is None and job.message is not None and request.axis == job.message.axis:
            seen = _described(job, address.pnu)
        return seen is not None and seen.format == block.format

    def _simple(self, job: Job, number: int) -> bytes | None:
        """The request for a parameter that is no array; a change only where its format is proven."""
        request = job.message
        if request is None or (request.blocks and not self._is_proven(job, request, number)):
            return None
        return refusal.without_index(job, number)

    def _suggest_axis(self, job: Job, remark: Remark) -> None:
        """A read may be asked of the only drive object that answers; a change never goes elsewhere."""
        half, message = job.write_request, job.message
        if half is None or message is None or message.operation != "read":
            return
        if job.key[-1] != LOCAL:
            remark.corrected = partial(self._only_axis, job, half.data)

    def _only_axis(self, job: Job, request: bytes) -> bytes | None:
        """The request for the only drive object that answered up to now, which read all of it; 0 names none."""
        device = job.peer.device
        axes = self._axes.get(device, frozenset()) - self._missing.get(device, frozenset())
        if len(axes) != 1 or axes == {0}:
            return None
        from ds47.diagnosis import suggest

        there = suggest.with_axis(request, *axes)
        wanted = decode_request(there, self._codec)
        if any(wanted.rest):  # bytes behind its end belong to no request
            there = suggest.only(wanted, range(len(wanted.addresses)))
        reach = reach_of(job.key, wanted.axis)
        read = all(
            each.attribute == VALUE and (device, reach, each.pnu) in self._formats
            for each in wanted.addresses
        )
        return self._unless_refused(job, there, wanted) if read else None

    # What may be offered instead

    def _offer(self, job: Job, corrected: Corrected) -> Corrected:
        """A corrected request, as far as the capture does not speak against it to its end."""
        from ds47.diagnosis import suggest

        if not isinstance(corrected, bytes):
            return corrected
        request = decode_request(corrected, self._codec)
        if not suggest.is_harmless(request):
            return None
        return partial(self._unless_refused, job, corrected, request)

    def _unless_refused(self, job: Job, corrected: bytes, request: Request) -> bytes | None:
        device = job.peer.device
        if job.key[-1] != LOCAL and request.axis in self._missing.get(device, ()):
            return None
        refused = any(each in self._refused for each in refusal.signs(device, request))
        behind = any(
            refusal.end(each) >= self._ends.get((device, each.pnu), _NO_END)
            for each in request.addresses
        )
        ends = any(flaw.rule == "DS315" for flaw in request.flaws)
        return None if refused or behind or ends else corrected

    def _learn_refused(self, job: Job, refused: list[refusal.Refusal]) -> None:
        device, request, response = job.peer.device, job.message, job.response
        assert request is not None
        assert response is not None
        for each in refused:
            sign = refusal.sign(device, request, response, each)
            if sign is not None:
                put(self._refused, sign, None)
            if each.code == refusal.NO_SUBINDEX:
                key, end = (device, each.address.pnu), refusal.end(each.address)
                put(self._ends, key, min(end, self._ends.get(key, end)))

    # What was seen before

    def _learn(self, job: Job, request: Request, response: Response, frame: int) -> None:
        device, reach = job.peer.device, reach_of(job.key, request.axis)
        axis = reach[-1]
        if axis >= 0 and (response.failed or axis not in self._axes.get(device, ())):
            self._learn_axis(device, axis, response.blocks)
        if request.operation != "read":
            return
        for address, block in zip(request.addresses, response.blocks, strict=False):
            if address.attribute != VALUE or block.error is not None:
                continue
            before = self._formats.get((device, reach, address.pnu))
            if before is None or before.format != block.format:
                self._learn_format(device, reach, address.pnu, block.format, frame)
            if address.pnu == PNU_ACCESS_IDENTIFICATION and address.subindex == 0 and block.values:
                longest = block.values[0]
                if isinstance(longest, int) and longest > 0:
                    put(self._limits, device, longest)

    def _learn_format(self, device: str, reach: Reach, pnu: int, code: int, frame: int) -> None:
        put(self._formats, (device, reach, pnu), Seen(code, frame))
        same = self._anywhere.get((device, pnu), code) == code
        put(self._anywhere, (device, pnu), code if same else None)

    def _learn_axis(self, device: str, axis: int, blocks: list[Block]) -> None:
        error = known().axis_error
        refused = any(block.error is not None and block.error.code == error for block in blocks)
        memory = self._missing if refused else self._axes
        before = memory.get(device, frozenset())
        if axis not in before:
            put(memory, device, before | {axis})

    def _is_known(self, peer: Peer, pnu: int) -> bool:
        found = is_known(pnu, peer.vendor_id, peer.family)
        return found or (peer.device, pnu) in self._anywhere

    def _seen(self, job: Job, pnu: int) -> Seen | None:
        """How the parameter was read in the way in which a request goes."""
        axis = job.message.axis if job.message else None
        return self._formats.get((job.peer.device, reach_of(job.key, axis), pnu))

    def _listed(self, job: Job, pnu: int) -> int | None:
        """The format by the list of parameters, where nothing that was read of the device differs from it."""
        code = format_of(pnu, job.peer.vendor_id, job.peer.family)
        return code if self._anywhere.get((job.peer.device, pnu), code) == code else None

    def _format(self, job: Job, pnu: int) -> int | None:
        shown = self._seen(job, pnu) or _described(job, pnu)
        return self._listed(job, pnu) if shown is None else shown.format

    def _size(self, job: Job, pnu: int) -> int | None:
        """Bytes of one value, as it was read, or by the list of parameters."""
        code = None if self._seen(job, pnu) is not None else self._listed(job, pnu)
        row = formats().get(code) if code is not None else None
        return self._read_size(job, pnu) if row is None else row.size

    def _read_size(self, job: Job, pnu: int) -> int | None:
        """Bytes of one value, as it was read in the way of a request; None of a format that has two sizes."""
        seen, options = self._seen(job, pnu), self._codec
        known = sound_codecs(options.legacy_g120_formats, options.profile_v3_types)
        found = None if seen is None else known[seen.format]
        return None if found is None else found[1].size or None


def _described(job: Job, pnu: int) -> Seen | None:
    """As which type the drive has described a parameter of a request, and where."""
    addresses = () if job.message is None else job.message.addresses
    for address, meaning in zip(addresses, job.meanings, strict=False):
        if address.pnu == pnu and meaning is not None and meaning.type is not None:
            code = _codes().get(meaning.type.value)
            return None if code is None else Seen(code, meaning.type.frame)
    return None


def _format_case(seen: Seen | None, described: Seen | None, listed: int | None) -> str:
    """Where the format of a parameter is known from: a key of diagnoses.toml."""
    if seen is not None:
        return "format_read"
    if described is not None:
        return "format_described"
    return "format_listed" if listed is not None else "format_bits"


def _is_odd(job: Job) -> bool:
    """Whether a job that was answered well may have something to be repaired all the same."""
    message, response = job.message, job.response
    if message is None or response is None:
        return False
    if message.flaws:
        return True
    if message.operation == "read":
        # Fewer blocks than asked: the response may have been too long.
        return len(response.blocks) < len(message.addresses)
    return any(map(is_unlikely, message.blocks))


def format_of(pnu: int, vendor_id: int | None, family: str | None = None) -> int | None:
    """The format of a parameter by parameters.toml, where it speaks of a device of this vendor."""
    row = listed(pnu, vendor_id, family)
    return None if row is None else _codes().get(row.type.removesuffix("[]"))


@cache
def _codes() -> dict[str, int]:
    return {row.name: code for code, row in formats().items()}
