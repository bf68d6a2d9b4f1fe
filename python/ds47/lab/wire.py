"""Bytes of a DCE/RPC PDU, its NDR headers and PROFINET's record blocks, for captures of the lab.

Written apart from the parser in `ds47.profinet` on purpose: a wrong idea there must not confirm
itself here. Nothing below RPC (see `ether`) and nothing of the record's content (see `message`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal
from uuid import UUID

from ds47.lab.ether import Host

Order = Literal["<", ">"]
"""Byte order of a PDU, as `struct` writes it; blocks are big-endian whatever it says."""

REQUEST, PING, RESPONSE, FAULT, WORKING, REJECT = 0, 1, 2, 3, 4, 6
CONNECT, RELEASE, READ, WRITE, CONTROL, READ_IMPLICIT = range(6)
LAST_FRAGMENT, FRAGMENT, IDEMPOTENT = 0x02, 0x04, 0x20

DEVICE_INTERFACE = UUID("dea00001-6c97-11d1-8271-00a02442df7d")
NIL = UUID(int=0)
WRITE_MULTIPLE = 0xE040

WRITE_REQ, READ_REQ, WRITE_RES, READ_RES = 0x0008, 0x0009, 0x8008, 0x8009
IO_AR = 0x0001
"""Kind of AR: that of an IO controller (IOCARSingle)."""
NO_HINT = 0xFFFF


@dataclass(frozen=True, slots=True)
class RecordId:
    """Where a record lives: AR, API, slot, subslot, index."""

    ar: UUID
    slot: int = 1
    subslot: int = 1
    index: int = 47
    api: int = 0


def object_uuid(device_id: int, vendor_id: int) -> UUID:
    """The object UUID of a device's first instance (docs/protocol.md E.2)."""
    return UUID(f"dea00000-6c97-11d1-8271-0001{device_id:04x}{vendor_id:04x}")


def identity(value: UUID, order: Order) -> bytes:
    """A UUID as the PDU's byte order writes it: the last eight bytes never swap."""
    return value.bytes_le if order == "<" else value.bytes


@dataclass(frozen=True, slots=True)
class Call:
    """What every PDU of one RPC call has in common."""

    activity: UUID
    sequence: int
    opnum: int
    target: UUID


@dataclass(frozen=True, slots=True)
class PduContent:
    """What a PDU says, beside its bytes: for a page that tells of a scene."""

    call: Call
    to_device: bool
    controller: str
    """IP address."""
    target: RecordId | None = None
    """Where the record of a request lives; None for a request without one, and in every response."""
    record: bytes = b""
    room: int | None = None
    """Bytes that a Read leaves for the record."""
    status: int = 0
    """PNIOStatus of a response."""


def pdu(
    kind: int, order: Order, call: Call, body: bytes, *, flags: int = IDEMPOTENT, fragment: int = 0
) -> bytes:
    """One connectionless v4 PDU (docs/protocol.md E.2)."""
    head = bytes((4, kind, flags, 0, 0x10 if order == "<" else 0, 0, 0, 0))
    names = (call.target, DEVICE_INTERFACE, call.activity)
    tail = (0, 1, call.sequence, call.opnum, NO_HINT, NO_HINT, len(body), fragment, 0, 0)
    return (
        head
        + b"".join(identity(name, order) for name in names)
        + struct.pack(order + "IIIHHHHHBB", *tail)
        + body
    )


def pdus(kind: int, order: Order, call: Call, body: bytes, size: int | None = None) -> list[bytes]:
    """The PDU, or its RPC fragments of at most `size` bytes of body each."""
    if size is None or len(body) <= size:
        return [pdu(kind, order, call, body)]
    pieces = [body[start : start + size] for start in range(0, len(body), size)]
    flags = [FRAGMENT] * (len(pieces) - 1) + [FRAGMENT | LAST_FRAGMENT]
    return [
        pdu(kind, order, call, piece, flags=flag, fragment=number)
        for number, (piece, flag) in enumerate(zip(pieces, flags, strict=True))
    ]


def request_body(order: Order, blocks: bytes, maximum: int = 4160) -> bytes:
    """NDR header of a request and its blocks (docs/protocol.md E.3)."""
    return struct.pack(order + "5I", maximum, len(blocks), maximum, 0, len(blocks)) + blocks


def response_body(order: Order, status: int, blocks: bytes, maximum: int = 4160) -> bytes:
    """NDR header of a response and its blocks; the status swaps with the byte order."""
    return struct.pack(order + "5I", status, len(blocks), maximum, 0, len(blocks)) + blocks


def _block(kind: int, sequence: int, at: RecordId, length: int, tail: bytes) -> bytes:
    head = struct.pack(">HHBBH", kind, 60, 1, 0, sequence & 0xFFFF) + at.ar.bytes
    address = struct.pack(">IHHHH", at.api, at.slot, at.subslot, 0, at.index)
    return head + address + struct.pack(">I", length) + tail.ljust(24, b"\0")


def write_request(sequence: int, at: RecordId, data: bytes, stated: int | None = None) -> bytes:
    """IODWriteReq with its record; `stated` lies about the length."""
    return _block(WRITE_REQ, sequence, at, len(data) if stated is None else stated, b"") + data


def write_response(sequence: int, at: RecordId, length: int, status: int) -> bytes:
    """IODWriteRes."""
    return _block(WRITE_RES, sequence, at, length, struct.pack(">HHI", 0, 0, status))


def read_request(sequence: int, at: RecordId, maximum: int = 4096, target: UUID = NIL) -> bytes:
    """IODReadReq; an implicit read has a nil AR and may name a target AR."""
    return _block(READ_REQ, sequence, at, maximum, target.bytes)


def read_response(sequence: int, at: RecordId, data: bytes, stated: int | None = None) -> bytes:
    """IODReadRes with its record; `stated` lies about the length."""
    return _block(READ_RES, sequence, at, len(data) if stated is None else stated, b"") + data


def padded(blocks: list[bytes]) -> bytes:
    """Inner requests of an IODWriteMultiple, each but the last padded to four bytes."""
    inner = [block + bytes(-len(block) % 4) for block in blocks[:-1]]
    return b"".join([*inner, *blocks[-1:]])


# Blocks that begin and end an AR


def mac_bytes(host: Host) -> bytes:
    """The MAC address of a host."""
    return bytes.fromhex(host.mac.replace(":", ""))


def ar_request(ar: UUID, host: Host, station: str, kind: int = IO_AR) -> bytes:
    """ARBlockReq: an IO controller's AR (kind 6: a supervisor's), with its MAC and station name."""
    body = struct.pack(">BBH", 1, 0, kind) + ar.bytes + struct.pack(">H", 1) + mac_bytes(host)
    body += object_uuid(host.device_id, host.vendor_id).bytes
    body += struct.pack(">IHHH", 0x131, 600, 0x8892, len(station)) + station.encode("ascii")
    return struct.pack(">HH", 0x0101, len(body)) + body


def ar_response(ar: UUID, device: Host) -> bytes:
    """ARBlockRes: the device's MAC."""
    body = struct.pack(">BBH", 1, 0, 1) + ar.bytes + struct.pack(">H", 1) + mac_bytes(device)
    body += struct.pack(">H", 0x8892)
    return struct.pack(">HH", 0x8101, len(body)) + body


def release_request(ar: UUID) -> bytes:
    """IODReleaseReq: control command 4, release."""
    return _release(0x0114, ar, 4)


def release_response(ar: UUID) -> bytes:
    """IODReleaseRes: control command 8, done."""
    return _release(0x8114, ar, 8)


def _release(kind: int, ar: UUID, command: int) -> bytes:
    head = struct.pack(">HHBBH", kind, 28, 1, 0, 0)
    return head + ar.bytes + struct.pack(">HHHH", 1, 0, command, 0)
