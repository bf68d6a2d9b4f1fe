"""A finished job as the transaction of the report: its state, its parameters, its frames and times.

States and parameters follow docs/pairing.md; findings are `ds47.rules`' business.
"""

from __future__ import annotations

from itertools import zip_longest

from ds47.model import Frames, Parameter, ParameterError, Transaction
from ds47.pairing import Job
from ds47.profidrive import Address, Block
from ds47.profinet.records import NIL_UUID, Half
from ds47.rules import NOT_SUPPORTED, is_mismatch
from ds47.spec import error_text, parameters, request_ids, response_ids

SIEMENS = 0x002A
"""PROFINET vendor id of the drives whose own parameters parameters.toml names."""


def build(job: Job, lang: str = "en") -> Transaction:
    """The transaction of a closed job; error texts in "en" or "zh"."""
    write, read = job.write_request, job.read_response
    response = job.response
    first = write or job.read_request or read
    assert first is not None
    reference = job.reference
    axis = job.message.axis if job.message else None
    if job.message is None and response is not None:
        reference, axis = response.request_reference, response.axis
    done = read is not None and bool(read.data) and write is not None
    parameters_ = _parameters(job, lang)
    return Transaction(
        operation=operation(job),
        state=state(job, parameters_),
        controller=job.peer.controller,
        device=job.peer.device,
        ar=None if job.record.ar == NIL_UUID else _uuid(job.record.ar),
        api=job.record.api,
        slot=job.record.slot,
        subslot=job.record.subslot,
        index=job.record.index,
        request_reference=reference,
        axis=axis,
        frames=_frames(job),
        start_ns=first.time_ns,
        duration_ns=read.time_ns - write.time_ns if done and read and write else None,
        request=write.data if write else None,
        response=read.data if read and read.data else None,
        write_status=job.write_response.status if job.write_response else None,
        read_status=read.status if read else None,
        parameters=parameters_,
        position=job.record.position,
    )


def operation(job: Job) -> str:
    """What was asked; for an orphan what its response id says."""
    if job.message is not None:
        return job.message.operation
    response_id = job.response.response_id if job.response else None
    for known in request_ids().values():
        if response_id in (known.positive, known.negative):
            return known.operation
    return "unknown"


def state(job: Job, parameters_: list[Parameter]) -> str:
    """The state of a closed job: the first of design order that applies."""
    read = job.read_response
    if job.message is None:
        return "orphan"
    if _refused(job):
        return "refused"
    if job.superseded_by is not None and read is None:
        return "superseded"
    if read is None:
        return "unanswered"
    if is_mismatch(job):
        return "mismatch"
    return _outcome(job, parameters_)


def _refused(job: Job) -> bool:
    return job.write_refused or bool(job.read_response and job.read_response.status)


def _outcome(job: Job, parameters_: list[Parameter]) -> str:
    response = job.response
    if response is None or response.response_id == NOT_SUPPORTED:
        return "error"
    blocks = response.blocks
    known = response_ids().get(response.response_id or 0)
    if not blocks and known and known.body != "blocks" and not known.negative:
        return "ok"  # a positive response that has nothing to carry
    done = sum(1 for block in blocks if block.error is None)
    asked = max(len(parameters_), len(job.message.addresses) if job.message else 0)
    if done == asked:
        return "ok"
    return "partial" if done else "error"


def _parameters(job: Job, lang: str) -> list[Parameter]:
    request, response = job.message, job.response
    blocks: list[Block] = response.blocks if response else []
    stray = is_mismatch(job)
    if stray and request is not None and request.operation == "change":
        blocks = request.blocks
    if request is None or (stray and not _refused(job)):
        return [_parameter(job, lang, None, block, block) for block in blocks]
    answers: list[Block | None] = [] if stray else list(blocks)
    values: list[Block | None] = list(request.blocks) if request.operation == "change" else answers
    rows = zip_longest(request.addresses, values[: len(request.addresses)], answers)
    return [_parameter(job, lang, *row) for row in rows if row[0] is not None]


def _parameter(
    job: Job, lang: str, address: Address | None, value: Block | None, answer: Block | None
) -> Parameter:
    known = parameters().get(address.pnu) if address else None
    if known and known.family != "profile" and job.peer.vendor_id != SIEMENS:
        known = None
    result = Parameter(
        pnu=address.pnu if address else None,
        subindex=address.subindex if address else None,
        attribute=address.attribute_name if address else None,
        element_count=address.element_count if address else None,
        name=(known.name_zh if lang == "zh" and known.name_zh else known.name_en)
        if known
        else None,
        unit=known.unit if known else None,
    )
    if value is not None and value.error is None:
        result.format = value.format_name
        result.value_count = value.value_count
        result.values = list(value.values)
        result.scaled = value.scaled
    if answer is not None and answer.error is not None:
        code, info = answer.error.code, answer.error.info
        text = "" if code is None else error_text(code, lang, job.peer.vendor_id)
        result.error = ParameterError(code, text, info)
    return result


def _frames(job: Job) -> Frames:
    def number(half: Half | None) -> int | None:
        return half.frame if half else None

    return Frames(
        write_request=number(job.write_request),
        write_response=number(job.write_response),
        read_request=number(job.read_request),
        read_response=number(job.read_response),
        polls=[(number(request), number(answer)) for request, answer in job.polls],
        rereads=[(number(request), number(answer)) for request, answer in job.rereads],
    )


def _uuid(raw: bytes) -> str:
    text = raw.hex()
    return f"{text[:8]}-{text[8:12]}-{text[12:16]}-{text[16:20]}-{text[20:]}"


def summarise(summary: dict[str, int], transaction: Transaction) -> None:
    """Counts a transaction: in all, by state and by operation."""
    for key in ("transactions", transaction.state, transaction.operation):
        summary[key] = summary.get(key, 0) + 1
