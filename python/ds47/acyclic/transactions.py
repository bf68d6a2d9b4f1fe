"""A finished job as the transaction of the report: its state, its parameters, its frames and times.

States and parameters follow docs/pairing.md; `judge` makes the findings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from itertools import zip_longest

from ds47.acyclic.pairing import Job
from ds47.model import Frames, Parameter, ParameterError, Read, State, Transaction, Value
from ds47.profidrive import Address, Block
from ds47.profidrive.dictionary import explain, family_of, unit_of
from ds47.profidrive.model import attribute_name, format_name
from ds47.profidrive.parameter import NOT_SUPPORTED
from ds47.profinet.records import NIL_UUID, NO_API, Half
from ds47.spec import Operation, Pnu, parameter, request_ids, response_ids
from ds47.spec.units import uuid_text


def build(job: Job) -> Transaction:
    """The transaction of a closed job."""
    message, response, record, peer = job.message, job.response, job.record, job.peer
    write, read = job.write_request, job.read_response
    first = write or job.read_request or read
    assert first is not None
    reference = axis = None
    if message is not None:
        reference, axis = message.request_reference, message.axis
    elif response is not None:
        reference, axis = response.request_reference, response.axis
    answer = (read.data or None) if read else None
    took = read.time_ns - write.time_ns if answer and read and write else None
    accepted, asked = job.write_response, job.read_request
    refused = job.write_refused or bool(read and read.status)
    parameters_ = _parameters(job, refused)
    for item, meaning in zip(parameters_, job.meanings, strict=False):
        if meaning is not None and item.pnu is not None:
            explain(item, meaning)
    frames = Frames(
        write.frame if write else None,
        accepted.frame if accepted else None,
        asked.frame if asked else None,
        read.frame if read else None,
        _pairs(job.polls) if job.polls else None,
        _pairs(job.rereads) if job.rereads else None,
    )
    nowhere = record.api == NO_API
    return Transaction(
        _operation(job) if message is None else message.operation,
        _state(job, refused),
        peer.controller,
        peer.device,
        None if record.ar == NIL_UUID else uuid_text(record.ar),
        None if nowhere else record.api,
        record.slot,
        None if nowhere else record.subslot,
        record.index,
        reference,
        axis,
        frames,
        first.time_ns,
        took,
        write.data if write else None,
        answer,
        accepted.status if accepted else None,
        read.status if read else None,
        parameters_,
        record.position,
        station=peer.station,
    )


def _operation(job: Job) -> Operation:
    """The operation of an orphan, according to its response id."""
    response_id = job.response.response_id if job.response else None
    for known in request_ids().values():
        if response_id in (known.positive, known.negative):
            return known.operation
    return "unknown"


def _state(job: Job, refused: bool) -> State:
    """The state of a closed job: the first of docs/pairing.md, P39 to P46, that applies."""
    read = job.read_response
    if job.message is None:
        return "orphan"
    if refused:
        return "refused"
    if job.usual:
        return "ok"
    if job.missing is not None:
        return "incomplete"
    if job.superseded_by is not None and read is None:
        return "superseded"
    if read is None:
        return "unanswered"
    return "mismatch" if job.stray else _outcome(job, job.message.asked)


def _outcome(job: Job, asked: int | None) -> State:
    response, half = job.response, job.read_response
    response_id = response.response_id if response else None
    if response is None or response_id is None or response_id == NOT_SUPPORTED:
        return "error"
    blocks = response.blocks
    known = response_ids().get(response_id)
    negative = known is not None and bool(known.negative)
    if not blocks and known and known.body != "blocks" and not negative:
        return "ok"  # a positive response without content
    failed = response.failed
    done = len(blocks) - failed
    if response.cut and blocks[-1].error is None:
        done -= 1  # the last value is incomplete
    if ((half is not None and half.cut) or asked is None) and done + failed != asked:
        sure = half is None or not half.cut or asked in (1, failed)
        count = response.parameter_count
        fewer = count is not None and asked is not None and count < asked
        return _outcome_as_far_as_seen(done, failed, negative or fewer, sure)
    if done == asked:
        return "error" if negative else "ok"
    return "partial" if done else "error"


def _outcome_as_far_as_seen(done: int, failed: int, negative: bool, sure: bool) -> State:
    """The state if the capture cut off the end of the response, or the number of parameters asked for.

    `sure`: if no parameter is seen to succeed, all have failed.
    """
    if not failed and not negative:
        return "ok"
    return "partial" if done else "error" if sure else "incomplete"


def _parameters(job: Job, refused: bool) -> list[Parameter]:
    request, peer = job.message, job.peer
    answers: Sequence[Block] = job.response.blocks if job.response else ()
    values, addresses = answers, list[Address]()
    if request is not None and (refused or not job.stray):
        addresses, most = request.addresses, len(request.addresses)
        answers = () if job.stray else answers[:most]
        values = request.blocks[:most] if request.operation == "change" else answers
    elif request is not None and request.operation == "change":
        answers = values = request.blocks
    found: list[Parameter] = []
    for address, value, answer in zip_longest(addresses, values, answers):
        if address is None:
            pnu = subindex = elements = attribute = None
        else:
            pnu, subindex, elements = address.pnu, address.subindex, address.element_count
            attribute = address.attribute
        shown: list[Value] = []
        if value is None or value.error is not None:
            code = meaning = count = scaled = None
        else:
            code, meaning = value.format, value.meaning
            shown, count, scaled = list(value.values), value.value_count, value.scaled
        failed = None if answer is None else answer.error
        error = None if failed is None else ParameterError(failed.code, failed.info, peer.vendor_id)
        own = _listed(pnu, attribute, code, meaning, peer.vendor_id, peer.family)
        name, listed, unit, format_text, family = own
        found.append(Parameter(
            pnu, subindex, name, elements, listed, unit, format_text, count, shown, scaled, error, None, None,
            family,
        ))  # fmt: skip
    return found


@lru_cache(maxsize=4096)
def _listed(
    pnu: int | None, attribute: int | None, code: int | None, meaning: int | None,
    vendor_id: int | None, family: str | None,
) -> tuple[str | None, Pnu | None, str | None, str | None, str | None]:  # fmt: skip
    """Attribute name, row of the PNU in the tables, unit, format name, and family of the tables."""
    format_text = None if code is None else format_name(code, meaning)
    if pnu is None or attribute is None:
        return None, None, None, format_text, None
    family = family_of(vendor_id, family)
    listed = parameter(pnu, family)
    return attribute_name(attribute), listed, unit_of(listed, format_text), format_text, family


def _pairs(reads: list[tuple[Half | None, Half]]) -> list[Read]:
    return [Read(request.frame if request else None, answer.frame) for request, answer in reads]


def summarise(ended: Counter[tuple[str, str]]) -> dict[str, int]:
    """The number of transactions: in all, by state and by operation; from the numbers for each pair."""
    summary = {"transactions": ended.total()}
    for pair, number in ended.items():
        for key in pair:
            summary[key] = summary.get(key, 0) + number
    return summary
