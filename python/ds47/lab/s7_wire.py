"""Bytes of S7 communication, for captures of the lab: TPKT, COTP, and the PDUs of S7.

Written apart from the parser in `ds47.s7` on purpose: a wrong idea there must not confirm itself here. Nothing
below TPKT (see `ether`), and nothing of who says what when (see `s7`).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

JOB, ACK, ANSWER, USERDATA = 1, 2, 3, 7
"""ROSCTR."""
SETUP, READ, WRITE = 0xF0, 0x04, 0x05
INPUTS, OUTPUTS, MEMORY, DB = 0x81, 0x82, 0x83, 0x84
DONE, MISSING, DENIED, OUT_OF_RANGE = 0xFF, 0x0A, 0x03, 0x05
"""Return codes of items."""
_BYTES, _BITS = 0x02, 0x04
"""Transport sizes: of an item in bytes, and of data whose length counts bits."""


class Var(NamedTuple):
    """Bytes of an area; `start` is the first one."""

    area: int
    db: int
    start: int
    size: int


def db(number: int, start: int, size: int) -> Var:
    """Bytes of a data block."""
    return Var(DB, number, start, size)


def flags(start: int, size: int) -> Var:
    """Bytes of bit memory (MB)."""
    return Var(MEMORY, 0, start, size)


# TPKT and COTP


def tpkt(payload: bytes) -> bytes:
    """A TPKT."""
    return struct.pack(">BBH", 3, 0, len(payload) + 4) + payload


def data(part: bytes, last: bool = True) -> bytes:
    """COTP DT with a part of a PDU."""
    return tpkt(bytes((2, 0xF0, 0x80 if last else 0)) + part)


def _connection(kind: int, references: tuple[int, int], options: bytes) -> bytes:
    head = struct.pack(">BHHB", kind, *references, 0) + options
    return tpkt(bytes((len(head),)) + head)


def connect(client: bytes, server: bytes, size: int = 10) -> bytes:
    """COTP CR from one TSAP to another; a TPDU has at most 2 ** size bytes."""
    options = (
        bytes((0xC0, 1, size, 0xC1, len(client))) + client + bytes((0xC2, len(server))) + server
    )
    return _connection(0xE0, (0, 1), options)


def confirm(client: bytes, server: bytes, size: int = 10) -> bytes:
    """COTP CC."""
    options = (
        bytes((0xC0, 1, size, 0xC1, len(client))) + client + bytes((0xC2, len(server))) + server
    )
    return _connection(0xD0, (1, 0x4431), options)


def disconnect(reason: int) -> bytes:
    """COTP DR."""
    return tpkt(struct.pack(">BBHHB", 6, 0x80, 1, 0, reason))


# PDUs


def pdu(kind: int, reference: int, parameter: bytes, content: bytes = b"", error: int = 0) -> bytes:
    """An S7 PDU; an acknowledge and an answer have error class and code."""
    head = struct.pack(">BBHHHH", 0x32, kind, 0, reference, len(parameter), len(content))
    if kind in (ACK, ANSWER):
        head += struct.pack(">H", error)
    return head + parameter + content


def setup(length: int, parallel: int) -> bytes:
    """Parameter of the setup and of its answer."""
    return struct.pack(">BBHHH", SETUP, 0, parallel, parallel, length)


def items(function: int, variables: Sequence[Var]) -> bytes:
    """Parameter of a read or write."""
    return bytes((function, len(variables))) + b"".join(_item(each) for each in variables)


def _item(variable: Var) -> bytes:
    place = (variable.area << 24 | variable.start * 8).to_bytes(4, "big")
    return (
        bytes((0x12, 0x0A, 0x10, _BYTES)) + struct.pack(">HH", variable.size, variable.db) + place
    )


def values(parts: Sequence[tuple[int, bytes]]) -> bytes:
    """Data items of a write or of the answer to a read: (return code, bytes); of an error there are none."""
    made = [
        struct.pack(">BBH", code, _BITS if part else 0, len(part) * 8) + part
        for code, part in parts
    ]
    return padded(made)


def padded(parts: Sequence[bytes]) -> bytes:
    """All but the last filled to an even length."""
    return b"".join([*(each + bytes(len(each) % 2) for each in parts[:-1]), *parts[-1:]])


# User data


def segment(
    r_id: int, part: bytes, number: int, sequence: int, last: bool, total: int | None
) -> tuple[bytes, bytes]:
    """Parameter and data of a segment of BSEND; the first one has `total`."""
    parameter = bytes((0, 1, 0x12, 8, 0x12, 0x46, 1, sequence, number, not last, 0, 0))
    content = struct.pack(">BBBBI", 0x12, 6, 0x13, 0, r_id)
    content += (b"" if total is None else struct.pack(">H", total)) + part
    return parameter, struct.pack(">BBH", DONE, 9, len(content)) + content


def acknowledge(sequence: int, error: int = 0) -> tuple[bytes, bytes]:
    """Parameter and data of the acknowledge of a segment."""
    parameter = bytes((0, 1, 0x12, 8, 0x12, 0x86, 1, sequence, 0, 0)) + struct.pack(">H", error)
    return parameter, bytes((MISSING, 0, 0, 0))


def usend(r_id: int, parts: Sequence[bytes]) -> tuple[bytes, bytes]:
    """Parameter and data of a USEND, as tshark 4.4 and later reads it; no stack at hand makes one."""
    parameter = struct.pack(">BBBBBBI", 0, 1, 0x12, 6, 0x13, 0, r_id)
    sent = padded([struct.pack(">BBH", 0, _BITS, len(part) * 8) + part for part in parts])
    return parameter, struct.pack(">BBH", DONE, 9, len(parts)) + sent


def ask_szl(number: int, index: int) -> tuple[bytes, bytes]:
    """Parameter and data of the question for a part of the system status list."""
    return bytes((0, 1, 0x12, 4, 0x11, 0x44, 1, 0)), struct.pack(
        ">BBHHH", DONE, 9, 4, number, index
    )


def tell_szl(number: int, index: int, size: int, parts: Sequence[bytes]) -> tuple[bytes, bytes]:
    """Parameter and data of the answer: parts of `size` bytes."""
    parameter = bytes((0, 1, 0x12, 8, 0x12, 0x84, 1, 1, 0, 0, 0, 0))
    content = struct.pack(">HHHH", number, index, size, len(parts)) + b"".join(parts)
    return parameter, struct.pack(">BBH", DONE, 9, len(content)) + content


def consistent(size: int) -> bytes:
    """Index 3 of SZL 0131: so many bytes can be read consistently."""
    return struct.pack(">HIHHHH", 3, 0x7FFC8301, size, 16, 1, 521) + bytes(26)
