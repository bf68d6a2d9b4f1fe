"""Parameter-channel messages for the lab, put together field by field.

Apart from `ds47.profidrive` for the same reason as `wire`: bytes that the codec made would agree
with the codec's mistakes. Values come with their `struct` letter, so no table of formats is here.
"""

from __future__ import annotations

import struct

VALUE, DESCRIPTION, TEXT = 0x10, 0x20, 0x30
READ, CHANGE = 1, 2
FLOAT32, UNSIGNED16, UNSIGNED8 = 0x08, 0x06, 0x05
ZERO, ERROR = 0x40, 0x44


def address(pnu: int, subindex: int = 0, elements: int = 1, attribute: int = VALUE) -> bytes:
    """One parameter address (docs/protocol.md A.1)."""
    return struct.pack(">BBHH", attribute, elements, pnu, subindex)


def raw_block(format_code: int, count: int, data: bytes) -> bytes:
    """A value block from the bytes of its values, with the pad byte of an odd one (A.5)."""
    return bytes((format_code, count)) + data + bytes(len(data) % 2)


def block(format_code: int, letter: str, *values: float) -> bytes:
    """A value block; `letter` is the `struct` letter of one value."""
    data = struct.pack(f">{len(values)}{letter}", *values)
    return raw_block(format_code, len(values), data)


def real(*values: float) -> bytes:
    """A block of Float32 values."""
    return block(FLOAT32, "f", *values)


def word(*values: int) -> bytes:
    """A block of Unsigned16 values."""
    return block(UNSIGNED16, "H", *values)


def error(code: int, info: int | None = 0) -> bytes:
    """An error block of two words, or of one where `info` is None (A.7)."""
    return block(ERROR, "H", code) if info is None else block(ERROR, "H", code, info)


def done() -> bytes:
    """The block of a parameter that was changed, inside a 0x82 answer."""
    return raw_block(ZERO, 0, b"")


def header(reference: int, identifier: int, axis: int, count: int) -> bytes:
    """The four bytes that open every message."""
    return bytes((reference, identifier, axis, count))


def read(reference: int, axis: int, *addresses: bytes) -> bytes:
    """A read request."""
    return header(reference, READ, axis, len(addresses)) + b"".join(addresses)


def change(reference: int, axis: int, *pairs: tuple[bytes, bytes]) -> bytes:
    """A change request from (address, value block) pairs: all addresses first, then all values."""
    addresses = b"".join(where for where, _ in pairs)
    return header(reference, CHANGE, axis, len(pairs)) + addresses + b"".join(v for _, v in pairs)


def answer(reference: int, identifier: int, axis: int, *blocks: bytes) -> bytes:
    """A response whose parameter count is that of its blocks."""
    return header(reference, identifier, axis, len(blocks)) + b"".join(blocks)


def changed(reference: int, axis: int, count: int = 1) -> bytes:
    """The positive answer to a change: a header and no block."""
    return header(reference, CHANGE, axis, count)
