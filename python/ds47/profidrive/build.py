"""Making messages: value blocks from values, requests and responses from their parts.

The bytes of a finished message come from `parameter.encode_request` and `encode_response`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

from ds47 import spec
from ds47.profidrive.model import (
    ERROR,
    ZERO,
    Address,
    Block,
    ErrorValue,
    Options,
    Request,
    Response,
    Value,
)
from ds47.profidrive.parameter import codecs

_DEFAULTS = Options()
_READ, _CHANGE = 0x01, 0x02


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


def zero_block() -> Block:
    """The block of a parameter that was changed, inside a 0x82 response."""
    return Block(ZERO, 0, [], None, None, b"")


def encode_block(format_code: int, values: Sequence[Value], options: Options = _DEFAULTS) -> bytes:
    """The bytes of a value block, padded. Raises ValueError like `make_block`."""
    block = make_block(format_code, values, options)
    return bytes((block.format, block.value_count)) + block.raw + block.pad


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
    length = _place(blocks, 4 + 6 * len(addresses))
    head = (reference, request_id, axis, len(addresses))
    return Request(*head, addresses=addresses, blocks=blocks, length=length)


def build_read(addresses: Iterable[Address], *, reference: int = 1, axis: int = 1) -> Request:
    """A read request (docs/protocol.md A.1). Raises ValueError like `build_request`."""
    return build_request(_READ, addresses, reference=reference, axis=axis)


def build_change(
    items: Iterable[tuple[Address, int, Sequence[Value]]], *, reference: int = 1, axis: int = 1
) -> Request:
    """A change request from (address, format, values). Raises ValueError like `make_block`."""
    parts = [(address, make_block(code, values)) for address, code, values in items]
    addresses, blocks = [a for a, _ in parts], [b for _, b in parts]
    return build_request(_CHANGE, addresses, blocks, reference=reference, axis=axis)


def build_response(
    request: Request, blocks: Iterable[Block], *, response_id: int | None = None
) -> Response:
    """The response to a request: one block per parameter, in its order (docs/protocol.md A.2).

    Args:
        request: what is answered; reference and axis are mirrored.
        blocks: values, errors or zeros. A change without any error is answered by a header alone.
        response_id: to answer with another id than the request asks for.

    Raises:
        ValueError: the request has an incomplete header or an id without a known answer, or too many
            blocks.
    """
    blocks = list(blocks)
    failed = any(block.error is not None for block in blocks)
    known = spec.request_ids().get(-1 if request.request_id is None else request.request_id)
    if response_id is None:
        if known is None:
            raise ValueError("the request id has no known response id")
        response_id = known.negative if failed else known.positive
    count = len(blocks) or request.parameter_count or 0
    reference, axis = request.request_reference, request.axis
    if reference is None or axis is None:
        raise ValueError("the header of the request is incomplete")
    _check_byte(response_id=response_id, parameters=count)
    answer = spec.response_ids().get(response_id)
    if answer and answer.body == "none":
        blocks = []
    length = _place(blocks, 4)
    return Response(reference, response_id, axis, count, blocks=blocks, length=length)


def _place(blocks: list[Block], offset: int) -> int:
    for block in blocks:
        block.offset = offset
        offset += 2 + len(block.raw) + len(block.pad)
    return offset


def _check_byte(**fields: int) -> None:
    for name, value in fields.items():
        if not 0 <= value <= 0xFF:
            raise ValueError(f"{name.replace('_', ' ')} {value} does not fit a byte")
