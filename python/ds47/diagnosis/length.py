"""Diagnoses of lengths: LEN, MLEN and the longest message of the device (DS711, 712, 713).

What fits is computed from the request alone: a value takes one byte at least, more where its format is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from ds47.acyclic.pairing import STATUS_SHORT, Job
from ds47.findings.remark import Remark
from ds47.profidrive import Address, Request, decode_request
from ds47.profidrive.formats import codec
from ds47.profidrive.model import VALUE, Block
from ds47.spec import request_ids
from ds47.spec.layouts import ADDRESS_SIZE, MESSAGE_COUNT, MESSAGE_SIZE, VALUE_SIZE
from ds47.spec.semantics import known

BLOCK: Final = 4
"""The shortest value block: format, number of values and one value, filled up to an even length."""
MISSING: Final = "DS315"
NO_PAD: Final = "DS311"
"""The byte that fills a value block up is not there."""

SizeOf = Callable[[int], int | None]
"""Bytes of one value of a PNU, as far as it is known, or as it was read."""


def request_too_short(job: Job, errors: Iterable[int]) -> Iterator[Remark]:
    """LEN of WRREC is too small: the record is whole, the request in it is not.

    A drive that refused a value for its type has read it: then the format is wrong, and not the length.
    """
    half, message = job.write_request, job.message
    if half is None or message is None or half.missing:
        return
    if any(code in known().type_errors for code in errors):
        return
    flaw = next((flaw for flaw in message.flaws if flaw.rule == MISSING), None)
    if flaw is not None:
        fits = _fitting_count(message, half.data)
        args = {
            "have": len(half.data), "need": _need(message, len(half.data), flaw.args["need"]),
            "count": message.parameter_count or 1, "fits": fits,
            "case": "length_short" if fits is None else "length_or_count",
        }  # fmt: skip
        yield Remark("DS711", half.frame, args, flaw.offset)


def _fitting_count(message: Request, data: bytes) -> int | None:
    """Of how many parameters the bytes are a whole request, if byte 3 were wrong; None for none.

    Of none where a value would begin with what is an address: its attribute is a format, too.
    """
    ends = range(MESSAGE_SIZE + ADDRESS_SIZE, len(data) + 1, ADDRESS_SIZE)
    for count, end in zip(range(1, message.parameter_count or 1), ends, strict=False):
        if data[end : end + 1] == bytes((VALUE,)):
            continue
        other = decode_request(data[:MESSAGE_COUNT] + bytes((count,)) + data[MESSAGE_COUNT + 1 :])
        if other.shaped and not other.flaws:
            return count
    return None


def _need(message: Request, have: int, more: int) -> int:
    """The least length of a request that ends too soon: what is cut, and the shortest form of what follows."""
    count, blocks = message.parameter_count or 1, message.blocks
    end = have + more - (0 if blocks and _is_cut(blocks[-1]) else VALUE_SIZE)
    end = max(end, MESSAGE_SIZE + ADDRESS_SIZE * count)
    row = request_ids().get(message.request_id or 0)
    left = count - len(blocks) if row is not None and row.body == "blocks" else 0
    return end + (end % 2 + BLOCK * left if left else 0)


def _is_cut(block: Block) -> bool:
    """Whether the message ends among the values of a block."""
    there = block.values if block.error is None else block.error.words
    return len(there) < block.value_count


def answer_cut(job: Job, read: SizeOf) -> Iterator[Remark]:
    """MLEN of RDREC is too small: the response was cut to it. Of a request all is said that it needs, if known."""
    asked, answer = job.read_request, job.read_response
    if asked is None or answer is None or not asked.stated or job.response is None:
        return
    if len(answer.data) != asked.stated or answer.missing:
        return
    flaw = next((flaw for flaw in job.response.flaws if flaw.rule == MISSING), None)
    if flaw is not None:
        pad = any(each.rule == NO_PAD and each.offset == flaw.offset for each in job.response.flaws)
        need = len(answer.data) + pad + int(flaw.args["need"])
        args: dict[str, Any] = {"asked": asked.stated, "need": need}
        if job.message is not None and job.message.operation == "read" and not job.stray:
            blocks = job.response.blocks
            sizes = list(_block_sizes(job.message, blocks, _shown(job.message, blocks, read)))
            known_sizes = [size for size in sizes if size is not None]
            whole = MESSAGE_SIZE + sum(known_sizes)
            if len(known_sizes) == len(sizes) and whole > need:
                args |= {"more": "mlen_whole", "whole": whole}
        yield Remark("DS712", answer.frame, args)


def read_too_short(job: Job) -> Iterator[Remark]:
    """The same: a Read was refused for it, and a later one brought the record, which is longer."""
    answer = job.read_response
    if answer is None or not answer.data:
        return
    need = len(answer.data) + answer.missing
    for asked, refused in job.too_short:
        if asked is not None and 0 < asked.stated < need:
            yield Remark("DS712", refused.frame, {"asked": asked.stated, "need": need})


def read_refused(job: Job, size_of: SizeOf) -> Iterator[Remark]:
    """The same, and none brought the record: what all values of the request need at least."""
    asked, answer, message = job.read_request, job.read_response, job.message
    if asked is None or answer is None or answer.status != STATUS_SHORT:
        return
    if message is None or message.operation != "read":
        return
    need = answer_need(message, size_of)
    if 0 < asked.stated < need:
        args = {"asked": asked.stated, "need": need, "more": "mlen_request"}
        yield Remark("DS712", answer.frame, args)


def answer_need(request: Request, size_of: SizeOf) -> int:
    """Bytes of a response with all values of a read; one byte a value at least where nobody knows their size."""
    return MESSAGE_SIZE + sum(_least_block(each, size_of) for each in request.addresses)


def _least_block(address: Address, size_of: SizeOf) -> int:
    if address.attribute != VALUE:
        return BLOCK
    size = (size_of(address.pnu) or 1) * max(1, address.element_count)
    return 2 + size + size % 2


def answer_too_long(
    job: Job, stated: int | None, longest: int, size_of: SizeOf, read: SizeOf
) -> Iterator[Remark]:
    """More was asked than one response can carry.

    Args:
        job: closed.
        stated: r0974 of the device, bytes, if it was read.
        longest: bytes of the longest response of the device, as far as it is known.
        size_of: bytes of one value of a PNU.
        read: the same, only as the capture shows it: for what there is room, no list says of this drive.
    """
    half, request, response = job.read_response, job.message, job.response
    if half is None or request is None or response is None or request.operation != "read":
        return
    if job.stray or half.missing:
        return  # it is the response to another request, or not all of it is there
    longest = max(longest, len(half.data))
    limit = stated if stated is not None and stated >= longest else None
    most = limit or max(longest, known().channel_bytes)
    found = _without_room(request, response.blocks, len(half.data), most, size_of)
    if found is None:
        return
    what, number = found
    address, good = request.addresses[number], answered(response.blocks)
    shown = _shown(request, response.blocks, read)
    fit, fits = _room_for(request, response.blocks, most, shown)
    args: dict[str, Any] = {
        "parameters": request.asked, "number": len(good), "what": what,
        "pnu": address.pnu, "subindex": address.subindex,
        "room": "room_seen" if limit is None else "room_stated", "limit": limit or longest,
        "fit": fit, "fits": fits, "most": None if fit is None else most,
    }  # fmt: skip
    corrected = None
    if good and len(good) < len(request.addresses) and good[-1] < len(request.addresses):
        from ds47.diagnosis import suggest  # only here: most captures need no correction

        corrected = suggest.only(request, good)
    yield Remark("DS713", half.frame, args, corrected=corrected)


def _room_for(
    request: Request, blocks: list[Block], room: int, shown: SizeOf
) -> tuple[str | None, int | None]:
    """For how many of the parameters, or of the elements of the first one, a response has room.

    Nobody knows that where the size of a value is not known; the parameters that were answered show theirs.
    """
    left = room - MESSAGE_SIZE
    for number, needs in enumerate(_block_sizes(request, blocks, shown)):
        if needs is None:
            break
        if needs > left:
            size = shown(request.addresses[0].pnu) if number == 0 else None
            if size:
                return "fit_elements", max(0, left - VALUE_SIZE) // size
            return "fit_parameters", number
        left -= needs
    return None, None


def _shown(request: Request, blocks: list[Block], read: SizeOf) -> SizeOf:
    """Bytes of one value by the response itself, else as it was read before."""
    own = {
        address.pnu: size
        for address, block in zip(request.addresses, blocks, strict=False)
        if address.attribute == VALUE and block.error is None and (size := _value_size(block))
    }
    return lambda pnu: own.get(pnu) or read(pnu)


def _value_size(block: Block) -> int | None:
    found = codec(block.format if block.meaning is None else block.meaning)
    return None if found is None else found.size


def _block_sizes(request: Request, blocks: list[Block], shown: SizeOf) -> Iterator[int | None]:
    """Bytes of the block of each parameter in a response with all values; None where nobody knows."""
    for number, address in enumerate(request.addresses):
        block = blocks[number] if number < len(blocks) else None
        if block is not None and block.error is None:  # it may be cut, and says what it has
            size = _value_size(block)
            size = None if size is None else size * block.value_count
            yield None if size is None else VALUE_SIZE + size + size % 2
        elif address.attribute == VALUE and shown(address.pnu) is not None:
            yield _least_block(address, shown)
        else:
            yield None


def answered(blocks: list[Block]) -> list[int]:
    """The numbers, from 0, of the parameters that have their values: one response could carry those."""
    return [number for number, block in enumerate(blocks) if block.error is None]


def _without_room(
    request: Request, blocks: list[Block], length: int, most: int, size_of: SizeOf
) -> tuple[str, int] | None:
    """How the device says that there was no room, and the first parameter of which it says so.

    None where room is not what was missing.
    """
    for number, block in enumerate(blocks[: len(request.addresses)]):
        if block.error is not None and block.error.code == known().too_long:
            return "too_long", number
    if len(blocks) >= len(request.addresses) or any(block.error is not None for block in blocks):
        return None
    following = _least_block(request.addresses[len(blocks)], size_of)
    return ("left_out", len(blocks)) if length + following > most else None
