"""Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3, E.4).

Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any, Final

from ds47.profinet.rpc import READ, READ_IMPLICIT, WRITE, Pdu

BLOCK_LENGTH: Final = 64
WRITE_MULTIPLE: Final = 0xE040
NIL_UUID: Final = bytes(16)

_BLOCK: Final = struct.Struct(">HHHH16sIHHHHI")
"""Type, length, version, sequence, AR, API, slot, subslot, padding, index, record data length."""
_NDR: Final = {True: struct.Struct("<5I"), False: struct.Struct(">5I")}
_REQUEST_BLOCKS: Final = {READ: 0x0009, READ_IMPLICIT: 0x0009, WRITE: 0x0008}
_RESPONSE_BLOCKS: Final = {READ: 0x8009, READ_IMPLICIT: 0x8009, WRITE: 0x8008}
_RELEASE_BLOCKS: Final = (0x0114, 0x0117)


@dataclass(slots=True)
class Half:
    """The request or the response of a record call: where it stands, what it carries."""

    frame: int
    time_ns: int
    data: bytes = b""
    stated: int = 0
    """RecordDataLength: bytes that follow; in a Read request the most that is wanted."""
    missing: int = 0
    """Bytes that the capture cut off."""
    status: int | None = None
    """PNIOStatus, ErrorCode first; None where the PDU carries none."""


@dataclass(slots=True)
class Record:
    """One record call: where it goes, its request and its response."""

    write: bool
    implicit: bool
    ar: bytes
    api: int
    slot: int
    subslot: int
    index: int
    position: int
    """0, or the place inside an IODWriteMultiple."""
    request: Half | None = None
    response: Half | None = None


@dataclass(slots=True)
class RequestBody:
    """The records of one RPC request, in order."""

    records: list[Record] = field(default_factory=list)
    multiple: bool = False
    nested: bool = False
    """An IODWriteMultiple stands inside another: its records are not opened."""


def parse_request(pdu: Pdu) -> RequestBody:
    """The records of a Read, Write or ReadImplicit request. Never raises: what does not parse is absent."""
    result = RequestBody()
    expected = _REQUEST_BLOCKS.get(pdu.opnum)
    head = _block(pdu.body, 20, expected)
    if head is None:
        return result
    record = _record(pdu, head, 0)
    if not record.write or record.index != WRITE_MULTIPLE:
        result.records.append(_fill(record, pdu, pdu.body, 20 + BLOCK_LENGTH, head[-1]))
        return result
    result.multiple = True
    inner = pdu.body[20 + BLOCK_LENGTH : 20 + BLOCK_LENGTH + head[-1]]
    offset = 0
    while (head := _block(inner, offset, expected)) is not None:
        record = _record(pdu, head, len(result.records) + 1)
        if record.index == WRITE_MULTIPLE:
            result.nested = True
        result.records.append(_fill(record, pdu, inner, offset + BLOCK_LENGTH, head[-1]))
        offset += BLOCK_LENGTH + head[-1] + -head[-1] % 4
    return result


def parse_response(pdu: Pdu) -> tuple[int | None, list[Record]]:
    """PNIOStatus of the NDR header (None for an empty body) and the response blocks as records.

    The blocks carry their own address, so that a response without its request can still be placed.
    An IODWriteMultiple gives its inner responses only.
    """
    if len(pdu.body) < 20:
        status = pdu.body[:4]
        order = "little" if pdu.little else "big"
        return (int.from_bytes(status, order) if len(status) == 4 else None), []  # type: ignore[arg-type]
    ndr_status = _NDR[pdu.little].unpack_from(pdu.body)[0]
    expected = _RESPONSE_BLOCKS.get(pdu.opnum)
    records: list[Record] = []
    offset = 20
    while (head := _block(pdu.body, offset, expected)) is not None:
        record = _record(pdu, head, len(records))
        start = offset + BLOCK_LENGTH
        length = 0 if record.write else head[-1]
        data = pdu.body[start : start + length]
        own_status: int | None = ndr_status
        if record.write and not ndr_status:
            field_ = pdu.body[offset + 44 : offset + 48]
            own_status = int.from_bytes(field_, "big") if len(field_) == 4 else None
        record.response = Half(pdu.frame, pdu.time_ns, data, length, length - len(data), own_status)
        records.append(record)
        if not record.write:
            break
        offset = start
    if records and records[0].index == WRITE_MULTIPLE:
        outer = records.pop(0).response
        if not records and outer and outer.status:
            ndr_status = outer.status
    return ndr_status, records


def released_ar(pdu: Pdu) -> bytes | None:
    """The AR that a Release request ends, None where its block does not parse."""
    block = pdu.body[20:44]
    if len(block) < 24 or int.from_bytes(block[:2], "big") not in _RELEASE_BLOCKS:
        return None
    return block[8:24]


def _block(data: bytes, offset: int, expected: int | None) -> tuple[Any, ...] | None:
    if expected is None or len(data) < offset + _BLOCK.size:
        return None
    head = _BLOCK.unpack_from(data, offset)
    return head if head[0] == expected else None


def _record(pdu: Pdu, head: tuple[Any, ...], position: int) -> Record:
    _type, _length, _version, _seq, ar, api, slot, subslot, _pad, index, _size = head
    implicit = pdu.opnum == READ_IMPLICIT
    address = (NIL_UUID if implicit else ar, api, slot, subslot, index)
    return Record(pdu.opnum == WRITE, implicit, *address, position)


def _fill(record: Record, pdu: Pdu, data: bytes, start: int, stated: int) -> Record:
    payload = data[start : start + stated] if record.write else b""
    missing = stated - len(payload) if record.write else 0
    record.request = Half(pdu.frame, pdu.time_ns, payload, stated, missing)
    return record
