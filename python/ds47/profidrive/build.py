"""Making messages: value blocks from values, requests from their parts; their bytes are made by `parameter`."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

from ds47.profidrive.model import ERROR, Address, Block, ErrorValue, Options, Request, Value
from ds47.profidrive.parameter import codecs

_DEFAULTS = Options()


def make_block(format_code: int, values: Sequence[Value], options: Options = _DEFAULTS) -> Block:
    """A value block from values as the decoder shows them (docs/protocol.md A.5, A.6).

    Args:
        format_code: a byte; for errors see `error_block`.
        values: numbers, or strings for texts, octets (hexadecimal) and whole numbers beyond 2^53.
            The one string of VisibleString and OctetString is a list of one.
        options: dialects.

    Raises:
        ValueError: unknown format, a value that does not fit it, or more than 255 values.
    """
    if not 0 <= format_code <= 0xFF:
        raise ValueError(f"format {format_code} does not fit a byte")
    meaning, found = codecs(options.legacy_g120_formats, options.profile_v3_types)[format_code]
    if found is None:
        raise ValueError(f"format 0x{format_code:02X} cannot carry values: its size is not known")
    try:
        raw = found.encode(values)
    except (TypeError, OverflowError) as problem:  # no numbers at all, or infinite ones
        raise ValueError(f"format 0x{format_code:02X}: {problem}") from problem
    count = len(raw) if found.whole else len(values)
    if count > 0xFF:
        raise ValueError(f"{count} values; a block holds at most 255")
    shown = found.decode(raw, count)
    scaled = found.scale(shown, raw) if found.scale else None
    pad = bytes(len(raw) % 2)
    return Block(format_code, count, shown, scaled, None, raw, pad=pad, meaning=meaning)


def error_block(code: int, info: int | None = 0) -> Block:
    """The block of a parameter that failed (docs/protocol.md A.7); `info` None: one word."""
    words = [code] if info is None else [code, info]
    raw = struct.pack(f">{len(words)}H", *words)
    return Block(ERROR, len(words), [], None, ErrorValue(code, info, words), raw)


def build_request(
    request_id: int,
    addresses: Iterable[Address],
    blocks: Iterable[Block] = (),
    *,
    reference: int = 1,
    axis: int = 1,
) -> Request:
    """A request with any request id. Raises ValueError where a field does not fit."""
    addresses, blocks = list(addresses), list(blocks)
    _check_byte(reference=reference, request_id=request_id, axis=axis, parameters=len(addresses))
    for number, address in enumerate(addresses):
        _check_byte(attribute=address.attribute, elements=address.element_count)
        if not (0 <= address.pnu <= 0xFFFF and 0 <= address.subindex <= 0xFFFF):
            raise ValueError(f"PNU {address.pnu}[{address.subindex}] does not fit 16 bits")
        address.offset = 4 + 6 * number
    length = 4 + 6 * len(addresses)
    for block in blocks:
        block.offset = length
        length += 2 + len(block.raw) + len(block.pad)
    head = (reference, request_id, axis, len(addresses))
    return Request(*head, addresses=addresses, blocks=blocks, length=length)


def _check_byte(**fields: int) -> None:
    for name, value in fields.items():
        if not 0 <= value <= 0xFF:
            raise ValueError(f"{name.replace('_', ' ')} {value} does not fit a byte")
