"""A finished request of PKW as the transaction of the report: its state, its parameter, its frames and times.

What was wrong with it is not said here.
"""

from __future__ import annotations

from typing import cast

from ds47 import spec
from ds47.cyclic import handshake, pkw
from ds47.cyclic.handshake import PkwJob
from ds47.cyclic.relations import SIEMENS, CyclicRelation
from ds47.model import PKW, Frames, Parameter, ParameterError, State, Transaction
from ds47.profidrive.dictionary import unit_of
from ds47.spec import cyclic
from ds47.spec.units import uuid_text

_OPERATIONS: dict[str, spec.Operation] = {
    "read": "read",
    "description": "read",
    "count": "read",
    "text": "read",
    "change": "change",
}
_ATTRIBUTES = {"description": "description", "text": "text"}
_FORMATS = {16: "Word", 32: "DoubleWord"}


def build(relation: CyclicRelation, job: PkwJob, layout: str = pkw.CYCLIC) -> Transaction:
    """The transaction of a request that is over."""
    asked = pkw.decode(job.request.data, answer=False, layout=layout)
    access = cyclic.requests()[asked.ak].access
    answer = job.answer or (job.odd if job.state == handshake.MISMATCH else None)
    return Transaction(
        operation=_OPERATIONS.get(access, "unknown"),
        state=cast(State, job.state),
        controller=relation.controller,
        device=relation.device,
        station=relation.station,
        ar=None if relation.ar is None else uuid_text(relation.ar),
        api=relation.api,
        slot=relation.slot,
        subslot=relation.subslot,
        index=None,
        request_reference=None,
        axis=None,
        frames=Frames(job.request.at.frame, read_response=answer and answer.at.frame),
        start_ns=job.request.at.time_ns,
        duration_ns=job.duration_ns,
        request=job.request.data,
        response=answer and answer.data,
        write_status=None,
        read_status=None,
        parameters=[_parameter(relation, asked, access, job, layout)],
        channel=PKW,
        cycles=job.cycles if relation.input.cycle_ns else None,
    )


def _parameter(
    relation: CyclicRelation, asked: pkw.PkwMessage, access: str, job: PkwJob, layout: str
) -> Parameter:
    """The parameter, with the value that was written or is answered."""
    answer = None if job.answer is None else pkw.decode(job.answer.data, answer=True, layout=layout)
    error = None
    if answer is not None and answer.error is not None:
        error = ParameterError(answer.error.code, None, relation.vendor_id, ak=answer.ak)
    source = asked if access == "change" else answer
    value = None if source is None or (error and access != "change") else source.value
    count = access == "count"  # the number of elements is no value of the parameter
    known, family = None, relation.drives
    if relation.vendor_id == SIEMENS and asked.pnu is not None:
        known = spec.parameter(asked.pnu, family)
    format_name = None if value is None or count else _format(source, value)
    return Parameter(
        pnu=asked.pnu,
        subindex=asked.subindex,
        attribute=_ATTRIBUTES.get(access, "value"),
        element_count=None,
        listed=known,
        unit=unit_of(known, format_name),
        format=format_name,
        value_count=None if value is None else 1,
        values=[] if value is None else [value],
        error=error,
        family=family,
    )


def _format(source: pkw.PkwMessage | None, value: int | float) -> str | None:
    assert source is not None
    if isinstance(value, float):
        return "Float32"
    table = cyclic.answers() if source.answer else cyclic.requests()
    return _FORMATS[table[source.ak].width or 16]
