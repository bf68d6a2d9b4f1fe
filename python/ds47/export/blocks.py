"""The body of an RPC message without names: Connect, Release, Control, and record calls.

Block by block: what is known keeps its meaning, what is not known becomes zeros, and so do the contents
of records that are no parameter channel. Lengths never change. docs/protocol.md E.3, E.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ds47.profinet import rpc
from ds47.profinet.records import BLOCK_LENGTH, WRITE_MULTIPLE

from .mapping import Key
from .stations import blank

NDR = 20
_HEAD = 6
_RECORD = {0x0008, 0x0009, 0x8008, 0x8009}
_AR_UUID = slice(8, 24)

Record = Callable[[rpc.Pdu, bytes, int, bytes], bytes]
"""(message, AR, index, content) -> the content to write."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """Where a block has what; everything else in it stays. Offsets from its start."""

    macs: tuple[int, ...] = ()
    uuids: tuple[int, ...] = ()
    objects: tuple[int, ...] = ()
    """UUIDs that may be PROFINET object UUIDs."""
    name: int | None = None
    """Where the length (two bytes) of a station name stands, which ends the block."""
    size: int | None = None
    """Of the whole block, where that is fixed; what stands behind it is not known."""


_LIFE = _Layout(uuids=(8,), size=32)
_BLOCKS: Mapping[int, _Layout] = {
    0x0101: _Layout(macs=(26,), uuids=(8,), objects=(32,), name=56),  # ARBlockReq
    0x8101: _Layout(macs=(26,), uuids=(8,), size=34),  # ARBlockRes
    0x0102: _Layout(macs=(38,)),  # IOCRBlockReq
    0x8102: _Layout(size=12),  # IOCRBlockRes
    0x0103: _Layout(size=26),  # AlarmCRBlockReq
    0x8103: _Layout(size=12),  # AlarmCRBlockRes
    0x0104: _Layout(),  # ExpectedSubmoduleBlockReq
    0x8104: _Layout(),  # ModuleDiffBlock
    0x0105: _Layout(objects=(6,), name=28),  # PrmServerBlock
    0x0106: _Layout(name=14),  # MCRBlockReq
    0x8106: _Layout(name=6),  # ARServerBlock
    **{kind | answer: _LIFE for kind in range(0x0110, 0x0119) for answer in (0, 0x8000)},
}
"""Blocks of Connect, Release and Control that are known; of all others only the head stays."""


def body(key: Key, pdu: rpc.Pdu, record: Record) -> bytes:
    """The body of a whole request or response, as far as it was captured."""
    data = pdu.body
    if pdu.ptype not in (0, 2):
        return data[:4] + blank(data[4:])  # a status at the most
    out, rest = data[:NDR], data[NDR:]
    if pdu.opnum in (rpc.READ, rpc.WRITE, rpc.READ_IMPLICIT):
        return out + _records(key, pdu, rest, record)
    return out + _blocks(key, rest)


def object_uuid(key: Key, data: bytes) -> bytes:
    """An object UUID of PROFINET says vendor and device, nothing else: it stays. Network order."""
    known = len(data) == 16 and rpc.device_identity(data) is not None
    return data if known else key.uuid(data)


def _blocks(key: Key, data: bytes) -> bytes:
    out = b""
    while len(out) + _HEAD <= len(data):
        at = len(out)
        kind = int.from_bytes(data[at : at + 2], "big")
        length = int.from_bytes(data[at + 2 : at + 4], "big")
        if length < 2:
            break
        block = data[at : at + 4 + length]
        layout = _BLOCKS.get(kind)
        out += (
            block[:_HEAD] + blank(block[_HEAD:]) if layout is None else _block(key, block, layout)
        )
    return out + blank(data[len(out) :])


def _block(key: Key, block: bytes, layout: _Layout) -> bytes:
    out = bytearray(block)
    for at in layout.macs:
        out[at : at + 6] = key.mac(block[at : at + 6])
    for at in layout.uuids:
        out[at : at + 16] = key.uuid(block[at : at + 16])
    for at in layout.objects:
        out[at : at + 16] = object_uuid(key, block[at : at + 16])
    if layout.name is not None:
        start = layout.name + 2
        end = start + int.from_bytes(block[layout.name : start], "big")
        out[start:end] = key.name(block[start:end])
        out[end:] = blank(block[end:])
    if layout.size is not None:
        out[layout.size :] = blank(block[layout.size :])
    return bytes(out[: len(block)])


def _records(key: Key, pdu: rpc.Pdu, data: bytes, record: Record) -> bytes:
    """Record blocks one after another; IODWriteMultiple holds more of them, padded to four."""
    out, request = b"", pdu.ptype == 0
    while len(out) + BLOCK_LENGTH <= len(data):
        at = len(out)
        head = data[at : at + BLOCK_LENGTH]
        kind = int.from_bytes(head[:2], "big")
        if kind not in _RECORD:
            break
        index = int.from_bytes(head[34:36], "big")
        out += _record_head(key, head)
        if request and index == WRITE_MULTIPLE and at == 0:
            continue  # its records follow
        stated = int.from_bytes(head[36:40], "big")
        if kind in (0x0008, 0x8009):
            content = data[at + BLOCK_LENGTH : at + BLOCK_LENGTH + stated]
            out += record(pdu, head[_AR_UUID], index, content)
        if request and len(out) < len(data):
            out += bytes(min(-len(out) % 4, len(data) - len(out)))
    return out + blank(data[len(out) :])


def _record_head(key: Key, head: bytes) -> bytes:
    out = head[:8] + key.uuid(head[_AR_UUID]) + head[24:40]
    if head[:2] == b"\0\x09":  # a Read request: the AR it is about, then padding
        return out + key.uuid(head[40:56]) + blank(head[56:])
    if head[:2] == b"\0\x08":
        return out + blank(head[40:])
    return out + head[40:48] + blank(head[48:])  # additional values, status
