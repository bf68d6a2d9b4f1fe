"""Diagnoses of what the drive refused: what has to be changed, by the error number (DS701, 709, 717 to 720).

One error block has one cause. What a repair of the whole request explains is not looked at here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from ds47.acyclic.judge import is_cut_off
from ds47.acyclic.pairing import Job
from ds47.findings.remark import Remark
from ds47.model import SIEMENS
from ds47.profidrive import Address, Request, Response, decode_request
from ds47.profidrive.model import Block
from ds47.profidrive.parameter import NOT_SUPPORTED
from ds47.spec import rules, vendor
from ds47.spec.semantics import known

WORD_ERRORS: Final = (0x05, 0x17)
"""Data type and format: what a connector written as a number is refused with."""
UNSIGNED_32: Final = "Unsigned32"
NO_PARAMETER: Final = 0x00
NO_SUBINDEX: Final = 0x03
WRONG_COUNT: Final = 0x18
"""Of the errors of index and count the one that depends on the values, too."""
NO_SUCH_ATTRIBUTE: Final = (0x09, 0x0F)
"""No description, no text."""


class Refusal(NamedTuple):
    """One error block with the address it belongs to, and the value that was to be written."""

    number: int
    code: int
    address: Address
    answer: Block
    value: Block | None


def refusals(job: Job) -> list[Refusal]:
    """The parameters of a job that the drive refused; none where the response is that of another request."""
    request, response = job.message, job.response
    if request is None or response is None or job.stray:
        return []
    return [
        Refusal(number, block.error.code, address, block, _value(request.blocks, number))
        for number, (address, block) in enumerate(
            zip(request.addresses, response.blocks, strict=False)
        )
        if block.error is not None and block.error.code is not None
    ]


def failed(response: Response) -> set[int]:
    """Which parameters have an error block, by their place: also one that ends before its error number."""
    return {number for number, block in enumerate(response.blocks) if block.error is not None}


def _value(blocks: list[Block], number: int) -> Block | None:
    return blocks[number] if number < len(blocks) else None


Sign = tuple[str, str, bytes]
"""Device, operation ("": both), and of what: PNU, attribute with PNU, address, or that with the value."""


def sign(device: str, request: Request, response: Response, refused: Refusal) -> Sign | None:
    """What a refusal says of further requests; None where it says nothing of the parameter."""
    code, facts = refused.code, known()
    if code in (facts.axis_error, facts.too_long) or response.response_id == NOT_SUPPORTED:
        return None
    pnu, place, whole = _signs(device, request, refused.address, refused.value)
    if code == NO_PARAMETER:
        return device, "", pnu[2]
    if code in facts.type_errors or code == WRONG_COUNT:
        return whole
    if code in NO_SUCH_ATTRIBUTE:
        return *pnu[:2], place[2][:1] + pnu[2]
    return place if code in facts.index_errors else pnu


def signs(device: str, request: Request) -> Iterator[Sign]:
    """All that `sign` may have said of the parameters of a request."""
    for number, address in enumerate(request.addresses):
        found = _signs(device, request, address, _value(request.blocks, number))
        pnu = found[0]
        yield from found
        yield from ((device, "", pnu[2]), (*pnu[:2], bytes((address.attribute,)) + pnu[2]))


def end(address: Address) -> int:
    """The subindex behind the last one that is asked for."""
    return address.subindex + max(1, address.element_count)


def _signs(
    device: str, request: Request, address: Address, value: Block | None
) -> tuple[Sign, Sign, Sign]:
    """The signs of a parameter for every request, for those with the same address, and for the same one."""
    pnu = address.pnu.to_bytes(2)
    place = bytes((address.attribute, address.element_count)) + pnu + address.subindex.to_bytes(2)
    whole = b"" if value is None else bytes((value.format, value.value_count)) + value.raw
    head = device, request.operation
    return (*head, pnu), (*head, place), (*head, place + b"=" + whole)


def of(job: Job, refused: list[Refusal]) -> Iterator[tuple[Refusal, Remark]]:
    """What the refusals of a job say: each parameter by itself, a missing drive object once."""
    half, given = job.read_response, set[str]()
    if half is None:
        return
    for refusal in refused:
        rule = _rule(job, refusal)
        if rule is None or (rule == "DS709" and rule in given):
            continue
        given.add(rule)
        args = _args(job, rule, refusal)
        yield refusal, Remark(rule, half.frame, args, refusal.answer.offset)


def not_seen(job: Job) -> Iterator[Remark]:
    """A refusal that no status tells of, and of which nothing better can be said."""
    half, response = job.read_response, job.response
    if half is None or response is None or response.response_id is None or job.stray:
        return
    if job.message is None and job.repeats is not None:  # told of the transaction that it repeats
        return
    quiet = half.status == 0 and not (job.write_response and job.write_response.status)
    if not response.response_id & 0x80 or response.response_id == NOT_SUPPORTED or not quiet:
        return
    errors = [
        block.error for block in response.blocks if block.error is not None and not is_cut_off(half, block)
    ]  # fmt: skip
    if not errors:
        return
    codes = [each.code for each in errors if each.code is not None]
    polls = len(job.not_ready)
    args = {
        "id": response.response_id, "code": codes[0] if codes else None,
        "among": len(set(codes)) > 1, "vendor_id": job.peer.vendor_id,
        "case": "status_zero_at_last" if polls else "status_zero", "polls": polls,
        "asked": job.message.parameter_count if job.message else None,
    }  # fmt: skip
    yield Remark("DS701", half.frame, args)


def _rule(job: Job, refusal: Refusal) -> str | None:
    facts, code = known(), refusal.code
    siemens = job.peer.vendor_id == SIEMENS
    change = job.message is not None and job.message.operation == "change"
    if code == facts.axis_error:
        return "DS709"
    if siemens and refusal.value is not None and refusal.value.values and _connector(refusal):
        return "DS720"
    if siemens and code in facts.commissioning:
        return "DS718"
    if change and (code in facts.running or (siemens and code in facts.running_siemens)):
        return "DS719"
    if code in facts.index_errors and _index_and_count(refusal) and not _by_subindex(job, refusal):
        return "DS717"
    return None


def _by_subindex(job: Job, refusal: Refusal) -> bool:
    """Whether the drive knows no parameter of this number, which is the subindex of a PNU of its maker."""
    maker = None if job.peer.vendor_id is None else vendor(job.peer.vendor_id)
    return (
        maker is not None
        and refusal.code == NO_SUBINDEX
        and refusal.address.pnu in maker.by_subindex
    )


def _connector(refusal: Refusal) -> bool:
    facts, value = known(), refusal.value
    if refusal.code == facts.connector_error:
        return True
    return (
        refusal.code in WORD_ERRORS
        and refusal.address.pnu in facts.connectors
        and value is not None
        and value.format_name != UNSIGNED_32
    )


def _index_and_count(refusal: Refusal) -> bool:
    """Whether index or count can be what the drive means: an address without both has neither."""
    address, code = refusal.address, refusal.code
    both = address.subindex > 0 or address.element_count > 1
    return code in (0x04, WRONG_COUNT) or (both and (code == NO_SUBINDEX or address.pnu != 0))


def _args(job: Job, rule: str, refusal: Refusal) -> dict[str, Any]:
    """What the rule carries, of all that a refusal shows."""
    address, value = refusal.address, refusal.value
    source = _source(value)
    counted = _counted(job, refusal) if rule == "DS717" else {}
    facts = {
        "axis": job.message.axis if job.message else None,
        "device": job.peer.device,
        "pnu": address.pnu,
        "subindex": address.subindex,
        "elements": address.element_count,
        "format": value.format_name if value else None,
        "value": value.values[0] if value and value.values else None,
        "case": "no_source" if source is None else "source_refused",
        "source": source,
        "state": known().commissioning.get(refusal.code),
        "code": refusal.code,
        "vendor_id": job.peer.vendor_id,
        "family": job.peer.drives,
        **counted,
    }
    return {name: facts[name] for name in rules()[rule].args}


def _counted(job: Job, refusal: Refusal) -> dict[str, Any]:
    """Whether the counts can be what 0x18 means; where they agree, how long record and message are."""
    value, half, message = refusal.value, job.write_request, job.message
    agree = value is not None and value.value_count == max(1, refusal.address.element_count)
    if refusal.code != WRONG_COUNT or half is None or message is None or not agree:
        return {"case": "counts", "have": None, "need": None}
    if half.missing or not message.rest:
        return {"case": "counts_agree", "have": None, "need": None}
    have = len(half.data)
    return {"case": "record_longer", "have": have, "need": have - len(message.rest)}


def _source(value: Block | None) -> int | None:
    """The PNU of the source that a connector was given; None where it was given a number."""
    if value is None or value.format_name != UNSIGNED_32 or not value.values:
        return None
    pnu = int(value.values[0]) >> 16
    return pnu if 0 < pnu <= known().source_most else None


def without_index(job: Job, number: int) -> bytes | None:
    """The request for a parameter that is no array, as that of a simple one; None where it is none.

    That one alone where others were refused, or where the response ends before it says what became of them. Of
    several values it is not known which is meant.
    """
    write, message, response = job.write_request, job.message, job.response
    if write is None or message is None or response is None:
        return None
    if number < len(message.blocks) and message.blocks[number].value_count != 1:
        return None
    from ds47.diagnosis import suggest  # only here: most captures need no correction

    whole = suggest.with_elements(message, write.data, number, 0, 1)
    if whole is None:
        return None
    request = decode_request(whole)
    told = len(response.blocks)
    if told < len(message.addresses) or failed(response) - {number}:
        return suggest.only(request, [number])
    # bytes behind its end belong to no request
    return suggest.only(request, range(len(request.addresses))) if any(request.rest) else whole
