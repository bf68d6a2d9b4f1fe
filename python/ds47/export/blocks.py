"""The body of an RPC message without names: Connect, Release, Control, and record calls.

Block by block: what is known keeps its meaning, what is not known becomes zeros, and so do the contents
of records that are no parameter channel. Lengths never change. docs/protocol.md E.3, E.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ds47.profinet import rpc
from ds47.spec import layouts

from .mapping import Replacements
from .stations import blank

_RECORD = {
    layouts.BLOCK_WRITE_REQUEST, layouts.BLOCK_READ_REQUEST,
    layouts.BLOCK_WRITE_RESPONSE, layouts.BLOCK_READ_RESPONSE,
}  # fmt: skip
_NDR_OFFSET, _NDR_COUNT = 12, 16
"""Where the NDR header has the offset of an array, which is always 0, and then its length."""
_AR_UUID = slice(layouts.BLOCK_AR, layouts.BLOCK_AR + 16)

Record = Callable[[rpc.Pdu, bytes, int, bytes], bytes]
"""(message, AR, index, content) -> the content to write."""


_Part = int | tuple["_Part", ...]
"""So many bytes; or a list of such parts, with the number of its items (two bytes) in front."""
_DESCRIPTIONS = 0
"""The descriptions of the data of a submodule: two, if it has input and output (`_end`)."""


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
    """Of the whole block, or of what stands in front of its lists; what stands behind is not known."""
    lists: tuple[_Part, ...] = ()
    words: tuple[int, ...] = ()
    """Words (two bytes) that nobody needs: padding, or reserved."""


_LIFE = _Layout(uuids=(layouts.BLOCK_AR,), size=32, words=(6, 26))
_BLOCKS: Mapping[int, _Layout] = {
    layouts.BLOCK_AR_REQUEST: _Layout(
        macs=(26,), uuids=(layouts.BLOCK_AR,), objects=(32,), name=56
    ),
    layouts.BLOCK_AR_RESPONSE: _Layout(macs=(26,), uuids=(layouts.BLOCK_AR,), size=34),
    layouts.BLOCK_IOCR_REQUEST: _Layout(macs=(38,), size=44, lists=((4, (6,), (6,)),)),
    layouts.BLOCK_IOCR_RESPONSE: _Layout(size=12),
    0x0103: _Layout(size=26),  # AlarmCRBlockReq
    0x8103: _Layout(size=12),  # AlarmCRBlockRes
    layouts.BLOCK_EXPECTED_SUBMODULES: _Layout(size=6, lists=((12, (8, _DESCRIPTIONS)),)),
    0x8104: _Layout(size=6, lists=((4, (8, (8,))),)),  # ModuleDiffBlock
    0x0105: _Layout(objects=(6,), name=28),  # PrmServerBlock
    0x0106: _Layout(name=14),  # MCRBlockReq
    0x8106: _Layout(name=6),  # ARServerBlock
    **{kind | answer: _LIFE for kind in range(0x0110, 0x0119) for answer in (0, 0x8000)},
}
"""Blocks of Connect, Release and Control that are known; of all others only the head stays."""


def body(key: Replacements, pdu: rpc.Pdu, record: Record) -> bytes:
    """The captured body of a whole request or response."""
    data = pdu.body
    if pdu.ptype not in (0, 2):
        return data[:4] + blank(data[4:])  # a status at the most
    if pdu.opnum == rpc.NO_OPERATION:  # of the endpoint mapper: names of interfaces and stations
        return blank(data)
    out, rest = data[:_NDR_OFFSET] + blank(data[_NDR_OFFSET:_NDR_COUNT]), data[layouts.NDR_SIZE :]
    out += data[_NDR_COUNT : layouts.NDR_SIZE]
    if pdu.opnum in (layouts.RPC_READ, layouts.RPC_WRITE, layouts.RPC_READ_IMPLICIT):
        return out + _records(key, pdu, rest, record)
    return out + _blocks(key, rest)


def object_uuid(key: Replacements, data: bytes) -> bytes:
    """An object UUID of PROFINET says vendor and device, nothing else: it stays. Network order."""
    known = len(data) == 16 and rpc.device_identity(data) is not None
    return data if known else key.uuid(data)


def _blocks(key: Replacements, data: bytes) -> bytes:
    out = b""
    while len(out) + layouts.BLOCK_SIZE <= len(data):
        at = len(out)
        kind = int.from_bytes(data[at : at + 2], "big")
        length = int.from_bytes(data[at + layouts.BLOCK_LENGTH : at + layouts.BLOCK_VERSION], "big")
        if length < 2:
            break
        block = data[at : at + 4 + length]
        layout = _BLOCKS.get(kind)
        out += (
            block[: layouts.BLOCK_SIZE] + blank(block[layouts.BLOCK_SIZE :])
            if layout is None
            else _block(key, block, layout)
        )
    return out + blank(data[len(out) :])


def _block(key: Replacements, block: bytes, layout: _Layout) -> bytes:
    out = bytearray(block)
    for at in layout.macs:
        out[at : at + 6] = key.mac(block[at : at + 6])
    for at in layout.uuids:
        out[at : at + 16] = key.uuid(block[at : at + 16])
    for at in layout.objects:
        out[at : at + 16] = object_uuid(key, block[at : at + 16])
    for at in layout.words:
        out[at : at + 2] = b"\0\0"
    if layout.name is not None:
        start = layout.name + 2
        end = start + int.from_bytes(block[layout.name : start], "big")
        out[start:end] = key.name(block[start:end])
        out[end:] = blank(block[end:])
    if layout.size is not None:
        end = _end(block, layout.size, layout.lists)
        out[end:] = blank(block[end:])
    return bytes(out[: len(block)])


def _end(block: bytes, at: int, parts: tuple[_Part, ...]) -> int:
    """Where what begins at a place ends."""
    for part in parts:
        if isinstance(part, tuple):
            count = int.from_bytes(block[at : at + 2], "big")
            at += 2
            while count and at < len(block):
                at, count = _end(block, at, part), count - 1
        elif part == _DESCRIPTIONS:
            both = at <= len(block) and block[at - 1] & 3 == 3
            at += 12 if both else 6
        else:
            at += part
    return at


def _records(key: Replacements, pdu: rpc.Pdu, data: bytes, record: Record) -> bytes:
    """Record blocks one after another; IODWriteMultiple holds more of them, padded to four."""
    out, request = b"", pdu.ptype == 0
    while len(out) + layouts.RECORD_SIZE <= len(data):
        at = len(out)
        head = data[at : at + layouts.RECORD_SIZE]
        kind = int.from_bytes(head[:2], "big")
        if kind not in _RECORD:
            break
        index = int.from_bytes(head[layouts.RECORD_INDEX : layouts.RECORD_INDEX + 2], "big")
        out += _record_head(key, head)
        if request and index == layouts.RECORD_WRITE_MULTIPLE and at == 0:
            continue  # its records follow
        stated = int.from_bytes(head[layouts.RECORD_DATA : layouts.RECORD_DATA + 4], "big")
        if kind in (layouts.BLOCK_WRITE_REQUEST, layouts.BLOCK_READ_RESPONSE):
            content = data[at + layouts.RECORD_SIZE : at + layouts.RECORD_SIZE + stated]
            out += record(pdu, head[_AR_UUID], index, content)
        if request and len(out) < len(data):
            out += bytes(min(-len(out) % 4, len(data) - len(out)))
    return out + blank(data[len(out) :])


def _record_head(key: Replacements, head: bytes) -> bytes:
    out = head[:8] + key.uuid(head[_AR_UUID]) + head[24 : layouts.RECORD_PADDING]
    out += (
        blank(head[layouts.RECORD_PADDING : layouts.RECORD_INDEX]) + head[layouts.RECORD_INDEX : 40]
    )
    if head[:2] == b"\0\x09":  # a Read request: the AR it is about, then padding
        return out + key.uuid(head[40:56]) + blank(head[56:])
    if head[:2] == b"\0\x08":
        return out + blank(head[40:])
    known = layouts.RECORD_STATUS + 4 if head[:2] == b"\x80\x08" else layouts.RECORD_STATUS
    return out + head[40:known] + blank(head[known:])  # additional values, status of a Write
