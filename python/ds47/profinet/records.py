"""Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3, E.4).

Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from ds47.profinet.rpc import READ, READ_IMPLICIT, WRITE, Pdu

BLOCK_LENGTH: Final = 64
WRITE_MULTIPLE: Final = 0xE040
NIL_UUID: Final = bytes(16)

_BLOCK: Final = struct.Struct(">HHHH16sIHHHHI")
"""Type, length, version, sequence, AR, API, slot, subslot, padding, index, record data length."""
_STATUS: Final = {True: struct.Struct("<I"), False: struct.Struct(">I")}
READ_REQUEST: Final = 0x0009
WRITE_REQUEST: Final = 0x0008
READ_RESPONSE: Final = 0x8009
WRITE_RESPONSE: Final = 0x8008
_REQUEST_BLOCKS: Final = {READ: READ_REQUEST, READ_IMPLICIT: READ_REQUEST, WRITE: WRITE_REQUEST}
_READS: Final = (READ, READ_IMPLICIT)
_AR_BLOCK: Final = 0x0101
_ONLY_ARS: Final = (0x0001, 0x0010)
_RELEASE_BLOCKS: Final = (0x0114, 0x0117)


@dataclass(slots=True, init=False)
class Half:
    """The request or the response of a record call: where it stands, what it carries."""

    frame: int
    time_ns: int
    data: bytes
    stated: int
    """RecordDataLength: bytes that follow; in a Read request the most that is wanted."""
    missing: int
    """Bytes that are not there: cut off by the capture, or never sent."""
    cut: bool
    """Whether the capture cut them off, as far as somebody has looked."""
    status: int | None
    """PNIOStatus, ErrorCode first; None where the PDU carries none."""

    def __init__(
        self,
        frame: int,
        time_ns: int,
        data: bytes = b"",
        stated: int = 0,
        missing: int = 0,
        status: int | None = None,
    ) -> None:
        self.frame = frame
        self.time_ns = time_ns
        self.data = data
        self.stated = stated
        self.missing = missing
        self.cut = False
        self.status = status


@dataclass(slots=True, init=False)
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
    request: Half | None
    response: Half | None

    def __init__(
        self,
        write: bool,
        implicit: bool,
        ar: bytes,
        api: int,
        slot: int,
        subslot: int,
        index: int,
        position: int,
        request: Half | None = None,
        response: Half | None = None,
    ) -> None:
        self.write = write
        self.implicit = implicit
        self.ar = ar
        self.api = api
        self.slot = slot
        self.subslot = subslot
        self.index = index
        self.position = position
        self.request = request
        self.response = response


@dataclass(slots=True, init=False)
class RequestBody:
    """The records of one RPC request, in order."""

    records: list[Record]
    multiple: bool
    nested: bool
    """An IODWriteMultiple stands inside another: its records are not opened."""

    def __init__(
        self,
        records: list[Record] | None = None,
        multiple: bool = False,
        nested: bool = False,
    ) -> None:
        self.records = [] if records is None else records
        self.multiple = multiple
        self.nested = nested


def parse_request(pdu: Pdu) -> RequestBody:
    """The records of a Read, Write or ReadImplicit request. Never raises: what does not parse is absent."""
    expected = _REQUEST_BLOCKS.get(pdu.opnum)
    record = _request(pdu, pdu.body, 20, expected, 0)
    if record is None:
        return RequestBody()
    if not record.write or record.index != WRITE_MULTIPLE:
        return RequestBody([record])
    assert record.request is not None
    result = RequestBody(multiple=True)
    inner, offset = record.request.data, 0
    while (record := _request(pdu, inner, offset, expected, len(result.records) + 1)) is not None:
        assert record.request is not None
        if record.index == WRITE_MULTIPLE:
            result.nested = True
        result.records.append(record)
        offset += BLOCK_LENGTH + record.request.stated + -record.request.stated % 4
    return result


def _request(
    pdu: Pdu, data: bytes, offset: int, expected: int | None, position: int
) -> Record | None:
    """The record whose request block stands at an offset, None where none does."""
    if expected is None or len(data) < offset + _BLOCK.size:
        return None
    (kind, _length, _version, _seq, ar, api, slot, subslot, _pad, index,
     stated) = _BLOCK.unpack_from(data, offset)  # fmt: skip
    if kind != expected:
        return None
    if pdu.opnum == WRITE:
        start = offset + BLOCK_LENGTH
        payload = data[start : start + stated]
        half = Half(pdu.frame, pdu.time_ns, payload, stated, stated - len(payload))
        return Record(True, False, ar, api, slot, subslot, index, position, half)
    half = Half(pdu.frame, pdu.time_ns, b"", stated)
    implicit = pdu.opnum == READ_IMPLICIT
    if implicit:
        ar = NIL_UUID
    return Record(False, implicit, ar, api, slot, subslot, index, position, half)


def parse_response(pdu: Pdu) -> tuple[int | None, list[Record]]:
    """PNIOStatus of the NDR header (None for an empty body) and the response blocks as records.

    The blocks carry their own address, so that a response without its request can still be placed.
    An IODWriteMultiple gives its inner responses only.
    """
    body = pdu.body
    if len(body) < 20:
        status = body[:4]
        order = "little" if pdu.little else "big"
        return (int.from_bytes(status, order) if len(status) == 4 else None), []  # type: ignore[arg-type]
    ndr_status: int = _STATUS[pdu.little].unpack_from(body)[0]
    records: list[Record] = []
    if pdu.opnum == WRITE:
        offset = 20
        while (record := _write_response(pdu, offset, ndr_status, len(records))) is not None:
            records.append(record)
            offset += BLOCK_LENGTH
        if records and records[0].index == WRITE_MULTIPLE:
            outer = records.pop(0).response
            if not records and outer and outer.status:
                ndr_status = outer.status
    elif pdu.opnum in _READS and len(body) >= 20 + _BLOCK.size:
        (kind, _length, _version, _seq, ar, api, slot, subslot, _pad, index,
         length) = _BLOCK.unpack_from(body, 20)  # fmt: skip
        if kind == READ_RESPONSE:
            start = 20 + BLOCK_LENGTH
            data = body[start : start + length]
            half = Half(pdu.frame, pdu.time_ns, data, length, length - len(data), ndr_status)
            implicit = pdu.opnum == READ_IMPLICIT
            if implicit:
                ar = NIL_UUID
            records.append(Record(False, implicit, ar, api, slot, subslot, index, 0, None, half))
    return ndr_status, records


def _write_response(pdu: Pdu, offset: int, ndr_status: int, position: int) -> Record | None:
    """The response block at an offset, if there is one; its own status counts if the NDR header's is 0."""
    body = pdu.body
    if len(body) < offset + _BLOCK.size:
        return None
    (kind, _length, _version, _seq, ar, api, slot, subslot, _pad, index,
     _data) = _BLOCK.unpack_from(body, offset)  # fmt: skip
    if kind != WRITE_RESPONSE:
        return None
    status: int | None = ndr_status
    if not ndr_status:
        own = body[offset + 44 : offset + 48]
        status = int.from_bytes(own, "big") if len(own) == 4 else None
    half = Half(pdu.frame, pdu.time_ns, b"", 0, 0, status)
    return Record(True, False, ar, api, slot, subslot, index, position, None, half)


def released_ar(pdu: Pdu) -> bytes | None:
    """The AR that a Release request ends, None where its block does not parse."""
    block = pdu.body[20:44]
    if len(block) < 24 or int.from_bytes(block[:2], "big") not in _RELEASE_BLOCKS:
        return None
    return block[8:24]


def is_only_ar(pdu: Pdu) -> bool:
    """Whether a Connect request with an AR sets up one of which a controller has one with a device.

    That is the AR of cyclic data (IOCARSingle, also with IRT); of supervisors' ARs there may be more beside it.
    """
    return int.from_bytes(pdu.body[26:28], "big") in _ONLY_ARS


def connected_ar(pdu: Pdu) -> bytes | None:
    """The AR that a Connect request sets up, None where its first block is no ARBlockReq."""
    block = pdu.body[20:44]
    if len(block) < 24 or int.from_bytes(block[:2], "big") != _AR_BLOCK:
        return None
    return block[8:24]
