"""The headers of a usual frame of a record call, all at one go: Ethernet, IPv4, UDP, RPC, record block.

Lives here: which frames of one direction of a conversation are built like the one that was seen before, and
the fields in which they differ. Not here: what they mean (`ds47.usual`), and every other frame
(`rpc.from_frame`, `rpc.parse`), which is read layer by layer.

Every frame of a conversation comes by here. So this is plain Python, and with the types of headers.pxd beside it
also what Cython compiles; the two differ in how the fields are fetched. A test holds both to the same answer.
"""

from __future__ import annotations

import struct
from typing import Final

from ds47.profinet import rpc
from ds47.profinet.records import READ_REQUEST, READ_RESPONSE, WRITE_REQUEST, WRITE_RESPONSE

DatagramKey = object
"""A hash of all that two copies of a datagram have in common (`datagram_key`). Not called an `int`: nobody counts
with it, and compiled it would be unpacked and packed for each use."""
Fields = tuple[int, int, int, DatagramKey]
"""Type of the record block, sequence number, the data length of the block, and the key of the datagram."""

RPC_START: Final = 42
IDENTITY_END: Final = 106
"""Up to the interface version the RPC header says who talks to whom."""
BODY_START: Final = 122
AR_START: Final = 150
"""Of a record block,"""
STATED: Final = 178
"""where the index is over and the data length stands."""
DATA_START: Final = 206
"""Of the data of a record."""

_OUTER: Final = struct.Struct(">6x10sHHHxB2x8s4xH102xH34xI").unpack_from
"""Source MAC to type of service; total length, id, fragment; protocol, addresses; UDP length; type of the record
block, and its data length."""
_INNER: Final = (
    struct.Struct(">IH4xHH2xI").unpack_from,
    struct.Struct("<IH4xHH2xI").unpack_from,
)
"""Sequence number, opnum, length of the body, fragment; the first word of the NDR header: a status."""

# As C integers where this file is compiled
_INNER_START = 106
_UDP_START = 34
_BODY, _DATA = BODY_START, DATA_START
_UDP = 17
_READ, _WRITE = rpc.READ, rpc.WRITE
_READ_REQUEST, _READ_RESPONSE = READ_REQUEST, READ_RESPONSE
_WRITE_REQUEST, _WRITE_RESPONSE = WRITE_REQUEST, WRITE_RESPONSE
_BLOCK_END = 84  # bytes of a body that ends with its record block,
_SECOND_BLOCK = 124  # and from which on there can be a second one


def conversation_key(source: str, destination: str, activity: bytes, ptype: int) -> int:
    """The part of a `DatagramKey` that the PDUs of one side of a conversation share."""
    return hash((source, destination, activity, ptype))


def datagram_key(
    conversation: int, ip_id: int, fragment: int, seq: int, body: bytes
) -> DatagramKey:
    """What tells a datagram from the others of the last milliseconds; `conversation_key` goes before."""
    return hash((conversation, ip_id, fragment, seq, body))


class Headers:
    """Those of one direction of a conversation, learnt from a frame that `rpc.from_frame` takes."""

    __slots__ = (
        "_conversation",
        "_front",
        "_hosts",
        "_little",
        "_read_kind",
        "_request",
        "_write_kind",
    )

    def __init__(self, data: bytes, conversation: int, request: bool, little: bool) -> None:
        """`conversation` is its `conversation_key`."""
        self._conversation = conversation
        self._front = data[6:16]
        self._hosts = data[26:34]
        self._read_kind = _READ_REQUEST if request else _READ_RESPONSE
        self._write_kind = _WRITE_REQUEST if request else _WRITE_RESPONSE
        self._request = request
        self._little = little

    def read(self, data: bytes) -> Fields | None:
        """The fields of a frame that says the same up to IDENTITY_END; None where anything is unusual.

        Then it is one datagram and one fragment, all lengths fit each other, the block is the one that belongs
        to the operation, what it says to be its data is there, and a response has status 0.
        """
        if _COMPILED:
            return self._compiled(data)
        if len(data) < DATA_START:
            return None
        front, total, ip_id, fragment, protocol, hosts, udp, kind, stated = _OUTER(data)
        seq, opnum, length, part, status = _INNER[self._little](data, _INNER_START)
        end: int = BODY_START + length
        if (
            front != self._front or hosts != self._hosts or protocol != _UDP or fragment & 0x3FFF
            or part or total != udp + 20 or end > _UDP_START + udp or _UDP_START + udp > len(data)
            or length < _BLOCK_END or (status and not self._request)
        ):  # fmt: skip
            return None
        if kind == self._read_kind:
            fits = opnum == _READ and (self._request or DATA_START + stated <= end)
        else:
            fits = kind == self._write_kind and opnum == _WRITE and (
                DATA_START + stated <= end if self._request else length < _SECOND_BLOCK
            )  # fmt: skip
        if not fits:
            return None
        return (
            kind,
            seq,
            stated,
            datagram_key(self._conversation, ip_id, 0, seq, data[BODY_START:end]),
        )

    def _compiled(self, data: bytes) -> Fields | None:
        """The same over bytes. Runs uncompiled too, slowly."""
        size = len(data)
        if size < _DATA:
            return None
        view, front, hosts = data, self._front, self._hosts
        for at in range(10):
            if view[6 + at] != front[at]:
                return None
        for at in range(8):
            if view[26 + at] != hosts[at]:
                return None
        udp = _u16(view, 38)
        opnum = _word(view, 110, self._little)
        length = _word(view, 116, self._little)
        end = _BODY + length
        if (
            view[23] != _UDP or _u16(view, 20) & 0x3FFF or _u16(view, 118)
            or _u16(view, 16) != udp + 20 or end > _UDP_START + udp or _UDP_START + udp > size
            or length < _BLOCK_END
        ):  # fmt: skip
            return None
        if not self._request and (_u16(view, 122) or _u16(view, 124)):
            return None
        kind = _u16(view, 142)
        stated = _u16(view, 178) << 16 | _u16(view, 180)
        if kind == self._read_kind:
            fits = opnum == _READ and (self._request or _DATA + stated <= end)
        elif kind == self._write_kind and opnum == _WRITE:
            fits = _DATA + stated <= end if self._request else length < _SECOND_BLOCK
        else:
            fits = False
        if not fits:
            return None
        if self._little:
            seq = _word(view, 108, True) << 16 | _word(view, 106, True)
        else:
            seq = _u16(view, 106) << 16 | _u16(view, 108)
        key = datagram_key(self._conversation, _u16(view, 18), 0, seq, view[_BODY:end])
        return kind, seq, stated, key


def _u16(data: bytes, at: int) -> int:
    return data[at] << 8 | data[at + 1]


def _word(data: bytes, at: int, little: bool) -> int:
    return data[at + 1] << 8 | data[at] if little else data[at] << 8 | data[at + 1]


_COMPILED = type(_u16).__name__ != "function"
"""Whether this file runs compiled."""
