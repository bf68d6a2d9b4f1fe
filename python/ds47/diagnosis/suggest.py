"""Corrected requests: how they are made from the one that was sent, and how they are shown.

Which correction a request needs is decided elsewhere (`repair`, `refusal`, `length`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

from ds47 import spec
from ds47.profidrive import (
    Address,
    Block,
    Request,
    Value,
    decode_request,
    encode_request,
    make_block,
)
from ds47.spec.semantics import never_written

_PER_ROW: Final = 4
_ID: Final = 1
_AXIS: Final = 2
_LONGEST: Final = 240


@dataclass(frozen=True, slots=True)
class Corrected:
    """A request as an engineer can use it.

    Attributes:
        hex: the bytes, two digits each, nothing between them.
        words: 16-bit words for a watch table, "16#0301"; a last odd byte is "16#01".
        scl: statements to paste into an SCL block of TIA Portal, see `scl`.
        encode: the command line that prints these bytes; None where no readable line gives them.
        block: whether that command also makes a function block of them.
    """

    hex: str
    words: list[str]
    scl: str
    encode: str | None
    block: bool


def corrected(request: bytes, family: str | None = None) -> Corrected:
    """A request in the forms in which it is shown; `family`: whose parameters the drive has."""
    line = encode_command(request, family)
    # what ds47 encode -f scl-fb takes: a read or a change that one record holds everywhere
    block = line is not None and request[_ID] in (0x01, 0x02) and len(request) <= _LONGEST
    return Corrected(request.hex(), plc_words(request), scl(request), line, block)


def plc_words(data: bytes) -> list[str]:
    """The 16-bit words as a watch table takes them, the odd last byte on its own."""
    return [f"16#{data[at : at + 2].hex().upper()}" for at in range(0, len(data), 2)]


def scl(data: bytes) -> str:
    """SCL that fills an array of bytes named `request`, and `length` for LEN of WRREC.

    Assignments, because TIA Portal takes those wherever they are pasted in the body of a block; a
    list `[16#03, ...]` it takes in source files and in the default of an interface only.
    """
    rows = [f"// #request : Array[0..{max(len(data) - 1, 0)}] of Byte"]
    for start in range(0, len(data), _PER_ROW):
        row = enumerate(data[start : start + _PER_ROW], start)
        rows.append(" ".join(f"#request[{at}] := 16#{byte:02X};" for at, byte in row))
    return "\n".join([*rows, f"#length := {len(data)};"])


def encode_command(data: bytes, family: str | None = None) -> str | None:
    """The `ds47 encode` line that gives exactly these bytes, for a POSIX shell; None if none does."""
    from shlex import quote

    from ds47.profidrive.notation import format_request_line, parse_request_line

    try:
        line = format_request_line(decode_request(data), family)
        same = encode_request(parse_request_line(line)) == data
    except ValueError:
        return None
    return f"ds47 encode {quote(line)}" if same else None


def with_blocks(message: Request, blocks: Mapping[int, Block]) -> bytes:
    """The request with some of its value blocks, numbered from 0, replaced."""
    kept = [blocks.get(number, block) for number, block in enumerate(message.blocks)]
    return _encoded(message, message.addresses, kept, message.rest)


def is_harmless(request: Request) -> bool:
    """Whether a request changes nothing that must never be changed on somebody's advice."""
    if request.operation == "read":
        return True
    pnus, values = never_written()
    written = zip_longest(request.addresses, request.blocks)
    return request.operation == "change" and not any(
        any(address.pnu in each for each in pnus)
        or (block is not None and any((address.pnu, value) in values for value in block.values))
        for address, block in written
        if address is not None
    )


def as_format(format_code: int, values: list[Value]) -> Block | None:
    """The same numbers as a block of another format; None where that cannot hold them exactly."""
    try:
        block = make_block(format_code, values)
    except ValueError:
        return None
    return block if block.values == values else None


def only(message: Request, numbers: Sequence[int]) -> bytes:
    """The request with some of its parameters, numbered from 0, and nothing behind them.

    Args:
        message: a decoded request with a whole header; a change with a block for each parameter.
        numbers: which to keep, in their order.
    """
    addresses = [message.addresses[number] for number in numbers]
    blocks = [message.blocks[number] for number in numbers if number < len(message.blocks)]
    return _encoded(message, addresses, blocks)


def with_axis(data: bytes, axis: int) -> bytes:
    """The request for another drive object; a request without that byte stays as it is."""
    if len(data) <= _AXIS:
        return data
    return data[:_AXIS] + bytes((axis,)) + data[_AXIS + 1 :]


def with_elements(
    message: Request, data: bytes, number: int, subindex: int, elements: int
) -> bytes | None:
    """The request with another subindex and number of elements for one parameter.

    A change keeps as many values as there are elements then (0 elements: one value).

    Args:
        message: the decoded request.
        data: its bytes.
        number: the parameter, from 0.
        subindex: of its first element.
        elements: their number.

    Returns:
        None where there is no such parameter, the fields do not fit, or the change has too few
        values, does not decode, or writes a text or octets, of which no part is meant.
    """
    fits = 0 <= subindex <= 0xFFFF and 0 <= elements <= 0xFF
    if not fits or not 0 <= number < len(message.addresses):
        return None
    old = message.addresses[number]
    at = old.offset
    if message.operation != "change":
        address = bytes((old.attribute, elements)) + old.pnu.to_bytes(2) + subindex.to_bytes(2)
        return data[:at] + address + data[at + 6 :]
    if not message.shaped:
        return None
    block = _shortened(message.blocks[number], max(elements, 1))
    if block is None:
        return None
    addresses = list(message.addresses)
    addresses[number] = Address(old.attribute, elements, old.pnu, subindex, at)
    blocks = [block if i == number else kept for i, kept in enumerate(message.blocks)]
    return _encoded(message, addresses, blocks, message.rest)


def _shortened(block: Block, count: int) -> Block | None:
    """The block with its first `count` values."""
    there = block.value_count
    row = spec.formats().get(block.format if block.meaning is None else block.meaning)
    if count > there or row is None or row.whole or block.error is not None:
        return None
    raw = block.raw[: len(block.raw) // there * count]
    pad = bytes(len(raw) % 2)
    return Block(block.format, count, block.values[:count], None, None, raw, block.offset, pad)


def _encoded(
    message: Request, addresses: Iterable[Address], blocks: Iterable[Block], rest: bytes = b""
) -> bytes:
    kept = list(addresses)
    head = (message.request_reference, message.request_id, message.axis, len(kept))
    return encode_request(Request(*head, addresses=kept, blocks=list(blocks), rest=rest))
