"""The parameter channel, both directions: requests and responses (docs/protocol.md A).

Decoding takes any bytes and never raises: what is wrong becomes a `Flaw`, what cannot be decoded
stays in `rest`. Encoding a decoded message gives the same bytes again, whatever was wrong with it.
`formats` decodes single values; `ds47.acyclic.judge` compares a response with its request.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Final

from ds47 import spec
from ds47.profidrive.formats import Codec, codec
from ds47.profidrive.model import (
    DESCRIPTION,
    ERROR,
    VALUE,
    Address,
    Block,
    ErrorValue,
    Flaw,
    Options,
    Request,
    Response,
)
from ds47.spec.layouts import ADDRESS_SIZE, MESSAGE_SIZE
from ds47.spec.semantics import limits

_ADDRESS: Final = struct.Struct(">BBHH")
NOT_SUPPORTED: Final = 0x80
"""Response id of a device that does not know the request id."""
_SINGLE: Final = 0x23
"""The error number of a drive that takes only one parameter per request."""
_LONGEST_SHARED: Final = 512
"""The most bytes of a request that is cached in its decoded form."""
_DEFAULTS = Options()


def decode_request(data: bytes, options: Options = _DEFAULTS, *, cut: bool = False) -> Request:
    """Decodes the data of a Write record (docs/protocol.md A.1). Never raises.

    Args:
        data: the record, without the 64-byte header of the record block.
        options: dialects.
        cut: whether the capture cut off its end. Then two things stay undecoded, with everything after them,
            because only the whole message decides: a format with two sizes, and a byte that may be a pad.
    """
    request = Request(*_header(data), length=len(data))
    if cut:
        request.asked = request.parameter_count
    if len(data) < MESSAGE_SIZE:
        _missing(request.flaws, len(data), MESSAGE_SIZE - len(data), "header")
        return request
    known = spec.request_ids().get(data[1])
    _request_header_flaws(request, known is not None)
    vendor = known is not None and known.vendor
    offset = _addresses(request, data, check=not vendor)
    if not cut:
        request.asked = len(request.addresses)
    if len(request.addresses) == data[3]:
        body = _Body(data, offset, data[3], options, request.flaws, vendor, cut)
        body.decode(known.body if known else "free")
        request.blocks, request.rest = body.blocks, body.rest
        if known and known.operation == "change":
            _value_counts(request)
    return request


def shared_request(data: bytes, options: Options = _DEFAULTS, *, cut: bool = False) -> Request:
    """The same as `decode_request`, but cached, for programs that repeat requests.

    Requests that differ only in their reference share addresses and blocks, so these must not be changed.
    Reference 0 is a flaw, so such a request is decoded separately.
    """
    if cut or not data or not data[0] or len(data) > _LONGEST_SHARED:
        return decode_request(data, options, cut=cut)
    return _under_one(data[1:], options).asked_as(data[0])


@lru_cache(maxsize=4096)
def _under_one(behind: bytes, options: Options) -> Request:
    """A request under reference 1, from the bytes after its reference."""
    return decode_request(b"\x01" + behind, options)


def decode_response(
    data: bytes,
    request: Request | None = None,
    options: Options = _DEFAULTS,
    *,
    cut: bool = False,
) -> Response:
    """Decodes the data of a Read record (docs/protocol.md A.2). Never raises.

    Args:
        data: the record, without the 64-byte header of the record block.
        request: the request it answers. The error words in the answer to a vendor request are no
            error numbers of the profile, unless the answer is that it is not supported. Reference,
            axis and count are not compared here.
        options: dialects.
        cut: as for `decode_request`.
    """
    flaws: list[Flaw] = []
    if len(data) < MESSAGE_SIZE:
        _missing(flaws, len(data), MESSAGE_SIZE - len(data), "header")
        return Response(*_header(data), flaws=flaws, length=len(data))
    reference, code, axis, count = data[:MESSAGE_SIZE]
    known = spec.response_ids().get(code)
    if known is None:
        flaws.append(Flaw("DS319", 1, {"id": f"0x{code:02X}"}))
    unsupported = code == NOT_SUPPORTED
    if count == 0 and not unsupported:
        flaws.append(Flaw("DS303", 3, {}))
    vendor = (known is not None and known.vendor) or (
        # A drive that does not know the request answers as the profile says.
        request is not None and request.operation == "vendor" and not unsupported
    )
    kind = "all" if unsupported else known.body if known else "free"
    blocks = _sound_blocks(data, count if kind == "blocks" else 0, options, vendor)
    rest, lacking = b"", False
    if blocks is None:
        body = _Body(data, MESSAGE_SIZE, count, options, flaws, vendor, cut)
        body.decode(kind)
        blocks, rest, lacking = body.blocks, body.rest, body.cut
    response = Response(reference, code, axis, count, blocks, flaws, rest, len(data), lacking)
    if known and not unsupported and known.negative == (not response.failed):
        _sign(response)
    return response


@lru_cache(maxsize=4096)
def family_fits(request_id: int, response_id: int) -> bool:
    """Whether a response id belongs to a request id (docs/protocol.md A.3)."""
    known = spec.request_ids().get(request_id)
    if known is None:
        return response_id & 0x7F == request_id & 0x7F or response_id == NOT_SUPPORTED
    return response_id in (known.positive, known.negative, NOT_SUPPORTED)


def kind_fits(request: Request, data: bytes) -> bool | None:
    """Whether a response fits a request in response id, axis and number of parameters.

    The number after id 0x80 is not documented, so it does not count.

    Args:
        request: the request.
        data: the response. The result is None if either lacks a part of its header.
    """
    asked, count = request.request_id, request.parameter_count
    if asked is None or count is None or len(data) < MESSAGE_SIZE:
        return None
    counted = data[3] == count or data[1] == NOT_SUPPORTED
    return family_fits(asked, data[1]) and data[2] == request.axis and counted


def _header(data: bytes) -> tuple[int | None, int | None, int | None, int | None]:
    there: list[int | None] = [*data[:MESSAGE_SIZE], None, None, None, None]
    return there[0], there[1], there[2], there[3]


def _missing(flaws: list[Flaw], offset: int, need: int, what: str) -> None:
    flaws.append(Flaw("DS315", offset, {"need": need, "what": what}))


def _request_header_flaws(request: Request, known: bool) -> None:
    flaws, count = request.flaws, request.parameter_count
    if request.request_reference == 0:
        flaws.append(Flaw("DS301", 0, {}))
    if not known:
        flaws.append(Flaw("DS302", 1, {"id": f"0x{request.request_id:02X}"}))
    if count == 0:
        flaws.append(Flaw("DS303", 3, {}))
    elif count is not None and count > limits().parameters:
        flaws.append(Flaw("DS304", 3, {"count": count, "limit": limits().parameters}))


def _addresses(request: Request, data: bytes, check: bool) -> int:
    """Decodes the addresses that are there; returns where the rest of the message begins."""
    count = data[3]
    whole = min(count, (len(data) - MESSAGE_SIZE) // ADDRESS_SIZE)
    end = MESSAGE_SIZE + ADDRESS_SIZE * whole
    offset = MESSAGE_SIZE
    for attribute, elements, pnu, subindex in _ADDRESS.iter_unpack(data[MESSAGE_SIZE:end]):
        address = Address(attribute, elements, pnu, subindex, offset)
        request.addresses.append(address)
        request.describes = request.describes or address.attribute == DESCRIPTION
        if check:
            _address_flaws(request.flaws, address)
        offset += ADDRESS_SIZE
    if whole < count:
        need = MESSAGE_SIZE + ADDRESS_SIZE * count - len(data)
        _missing(request.flaws, len(data), need, f"address {whole + 1} of {count}")
        request.rest = data[end:]
    return end


@cache
def _known_attributes() -> frozenset[int]:
    return spec.vendor_attributes().union(spec.attributes())


def _address_flaws(flaws: list[Flaw], address: Address) -> None:
    """Flaws of one address of a standard request; vendors use the fields for other things."""
    at, count = address.offset, address.element_count
    if address.attribute not in _known_attributes():
        flaws.append(Flaw("DS305", at, {"attribute": f"0x{address.attribute:02X}"}))
    if address.pnu == 0:
        flaws.append(Flaw("DS306", at + 2, {}))
    if count > limits().elements:
        flaws.append(Flaw("DS307", at + 1, {"count": count, "limit": limits().elements}))
    if address.subindex + count > 0x10000:
        args: dict[str, object] = {"subindex": address.subindex, "count": count}
        flaws.append(Flaw("DS308", at + 4, args))


def _value_counts(request: Request) -> None:
    """Compares the numbers of values and of addressed elements; descriptions and texts count otherwise (C)."""
    for address, block in zip(request.addresses, request.blocks, strict=False):
        elements = address.element_count or 1
        if address.attribute == VALUE and block.value_count != elements:
            args: dict[str, object] = {"values": block.value_count, "elements": elements}
            request.flaws.append(Flaw("DS310", block.offset + 1, args))


def _sign(response: Response) -> None:
    """Bit 7 of the response id does not say whether an error is inside (A.2)."""
    if response.failed:
        response.flaws.append(Flaw("DS411", 1, {}))
    elif response.blocks and not any(flaw.rule in ("DS309", "DS315") for flaw in response.flaws):
        response.flaws.append(Flaw("DS412", 1, {}))


@cache
def codecs(legacy_g120: bool, profile_v3: bool) -> tuple[tuple[int | None, Codec | None], ...]:
    """For each format byte: the code that it stands for in the dialect (None: itself), and the codec."""
    other: dict[int, int] = {}
    if legacy_g120:
        other.update(spec.dialect("legacy_g120_formats"))
    if profile_v3:
        other.update(spec.dialect("profile_v3_types"))
    return tuple((other.get(code), codec(other.get(code, code))) for code in range(256))


@cache
def _alternatives(legacy_g120: bool, profile_v3: bool) -> Mapping[int, tuple[int, Codec]]:
    """Format bytes that also occur with another size -> meaning and codec of that size (A.6)."""
    table: dict[int, tuple[int, Codec]] = {}
    for code, (meaning, _) in enumerate(codecs(legacy_g120, profile_v3)):
        row = spec.formats().get(code if meaning is None else meaning)
        if row and row.other_size and (found := codec(row.code, row.other_size)):
            table[code] = (row.code, found)
    if not profile_v3:
        for code, meaning in spec.dialect("profile_v3_types").items():
            if found := codec(meaning):
                table[code] = (meaning, found)
    return table


@cache
def sound_codecs(
    legacy_g120: bool, profile_v3: bool
) -> tuple[tuple[int | None, Codec] | None, ...]:
    """For each format byte its meaning and codec; None if it is unknown, ambiguous or the error."""
    unsure = _alternatives(legacy_g120, profile_v3)
    return tuple(
        None if found is None or code in unsure or code == ERROR else (meaning, found)
        for code, (meaning, found) in enumerate(codecs(legacy_g120, profile_v3))
    )


def _sound_blocks(data: bytes, count: int, options: Options, vendor: bool) -> list[Block] | None:
    """The blocks of a usual response: known formats, whole, padded, nothing after them.

    None for every other response: `_Body` takes those, and would give the same result for these.
    """
    table = sound_codecs(options.legacy_g120_formats, options.profile_v3_types)
    blocks: list[Block] = []
    at, size = MESSAGE_SIZE, len(data)
    for _ in range(count):
        if at + 2 > size:
            return None
        code, values_in = data[at], data[at + 1]
        sound = table[code]
        if sound is not None:
            meaning, found = sound
            end = at + 2 + values_in * found.size
            if end > size:
                return None
            raw = data[at + 2 : end]
            if values_in == 1 and found.unpack is not None:
                values, scaled = list(found.unpack(raw)), None
            else:
                values = found.decode(raw, values_in)
                scaled = found.scale(values, raw) if found.scale else None
            block = Block(code, values_in, values, scaled, None, raw, at, b"", meaning)
            if len(raw) & 1:
                if end == size or data[end]:
                    return None
                block.pad = data[end : end + 1]
                end += 1
        elif code == ERROR and 1 <= values_in <= 2 and at + 2 + 2 * values_in <= size:
            end = at + 2 + 2 * values_in
            block = _error_block(data[at + 2 : end], values_in, at, vendor)
        else:
            return None
        blocks.append(block)
        at = end
    return blocks if at == size else None


def _is_single_access(blocks: list[Block]) -> bool:
    """Whether the only block is the error of a drive that takes one parameter per request (A.2)."""
    return len(blocks) == 1 and blocks[0].error is not None and blocks[0].error.code == _SINGLE


def _error_block(raw: bytes, count: int, start: int, vendor: bool) -> Block:
    """An error block. The error number is the whole word: a maker's 0x0811 is not the profile's 0x11.

    A vendor message has no error number up to 0xFF: it would look like one of the profile.
    """
    words = [word for (word,) in struct.iter_unpack(">H", raw[: len(raw) & ~1])]
    code = words[0] if words and not (vendor and words[0] <= 0xFF) else None
    info = words[1] if len(words) > 1 and code is not None else None
    return Block(ERROR, count, [], None, ErrorValue(code, info, words), raw, start)


class _Body:
    """Decodes the value blocks of one message, from `offset` to the end."""

    def __init__(
        self,
        data: bytes,
        offset: int,
        count: int,
        options: Options,
        flaws: list[Flaw],
        vendor: bool,
        cut_off: bool,
    ) -> None:
        self._data, self.offset, self._count = data, offset, count
        self._cut_off = cut_off
        self._sense = len(data.rstrip(b"\0"))  # nothing but zeros stands behind
        self._flags = (options.legacy_g120_formats, options.profile_v3_types)
        self._codecs = codecs(*self._flags)
        self._chosen: dict[int, tuple[int | None, Codec | None]] = {}
        self._vendor = vendor
        self.flaws = flaws
        self.blocks: list[Block] = []
        self.rest = b""
        self.cut = False

    def decode(self, body: str) -> None:
        """Decodes by the kind of spec/ids.toml; "all" means blocks while bytes remain."""
        size = len(self._data)
        if body == "blocks" or (body == "free" and not self._cut_off and self._fits()):
            self._blocks(self._count)
        elif body == "all":
            while self.offset < size and self._data[self.offset] and self._block():
                pass
        if self.offset < size:
            self._left_over()

    def _blocks(self, count: int) -> None:
        for number in range(count):
            need = self.offset + 2 - len(self._data)
            if need > 0:
                if need == 2 and _is_single_access(self.blocks):
                    return
                what = f"value block {number + 1} of {count}"
                _missing(self.flaws, len(self._data), need, what)
                self.rest = self._data[self.offset :]
                self.offset = len(self._data)
                return
            if not self._block():
                return

    def _left_over(self) -> None:
        self.rest = self._data[self.offset :]
        rule = "DS313" if any(self.rest) else "DS314"
        self.flaws.append(Flaw(rule, self.offset, {"count": len(self.rest)}))

    def _block(self) -> bool:
        """Decodes one block; False if decoding cannot go on after it."""
        data, start = self._data, self.offset
        if start + 2 > len(data):
            _missing(self.flaws, len(data), 1, "block header")
            self.rest, self.offset = data[start:], len(data)
            return False
        code, count = data[start], data[start + 1]
        if code == ERROR:
            return self._error(start, count)
        meaning, found = self._codec(code, start)
        if found is None:
            if not (self._cut_off and code in _alternatives(*self._flags)):
                self.flaws.append(Flaw("DS309", start, {"format": f"0x{code:02X}"}))
            self.blocks.append(Block(code, count, [], None, None, b"", start, meaning=meaning))
            self.rest, self.offset = data[start + 2 :], len(data)
            return False
        raw, whole = self._take(start, count * found.size)
        # An incomplete string is no value: it would look like a whole one.
        there = count if whole else 0 if found.whole else len(raw) // found.size
        exact = raw if whole else raw[: there * found.size]
        values = found.decode(exact, there)
        scaled = found.scale(values, exact) if found.scale else None
        block = Block(code, count, values, scaled, None, raw, start, meaning=meaning)
        self.blocks.append(block)
        return whole and self._pad(block)

    def _error(self, start: int, count: int) -> bool:
        raw, whole = self._take(start, 2 * count)
        if not 1 <= count <= 2:
            self.flaws.append(Flaw("DS318", start + 1, {"count": count}))
        self.blocks.append(_error_block(raw, count, start, self._vendor))
        return whole

    def _take(self, start: int, size: int) -> tuple[bytes, bool]:
        """The value bytes of a block, and whether none is missing."""
        raw = self._data[start + 2 : start + 2 + size]
        self.offset = start + 2 + len(raw)
        if len(raw) == size:
            return raw, True
        what = f"values of block {len(self.blocks) + 1}"
        _missing(self.flaws, self.offset, size - len(raw), what)
        self.cut = True
        return raw, False

    def _pad(self, block: Block) -> bool:
        if len(block.raw) % 2 == 0:
            return True
        data, at = self._data, self.offset
        if self._cut_off and at < len(data) and data[at]:
            self.rest, self.offset = data[at:], len(data)
            return False
        if at >= len(data) or (data[at] and self._fits(at) and not self._fits(at + 1)):
            self.flaws.append(Flaw("DS311", at, {}))
        else:
            block.pad = data[at : at + 1]
            self.offset = at + 1
            if data[at]:
                self.flaws.append(Flaw("DS312", at, {"pad": f"0x{data[at]:02X}"}))
        return True

    def _codec(self, code: int, start: int) -> tuple[int | None, Codec | None]:
        chosen = self._chosen.get(code)
        if chosen is not None:
            return chosen
        default = self._codecs[code]
        other = _alternatives(*self._flags).get(code)
        if other is not None and self._cut_off:
            default = default[0], None
        elif other is not None:
            default = self._choose(code, start, default, other)
        self._chosen[code] = default
        return default

    def _choose(
        self,
        code: int,
        start: int,
        usual: tuple[int | None, Codec | None],
        other: tuple[int, Codec],
    ) -> tuple[int | None, Codec | None]:
        """Chooses the one of two sizes that fits the length of the message (A.6), once per message."""
        fits = [self._fits_with(code, start, choice) for choice in (usual, other)]
        exact = next((place for place, fit in enumerate(fits) if fit == 2), None)
        found: tuple[int | None, Codec | None] = other if exact == 1 else usual
        two_sizes = spec.formats()[other[0]].other_size is not None
        sure = exact == 0 or (exact == 1 and two_sizes)
        if found[1] is not None and not sure and fits != [1, 0]:
            args: dict[str, object] = {"format": f"0x{code:02X}", "size": found[1].size}
            self.flaws.append(Flaw("DS317", start, args))
        return found

    def _fits_with(self, code: int, start: int, choice: tuple[int | None, Codec | None]) -> int:
        """2: the message ends where it should; 1: it does and zeros follow; 0: it does not."""
        self._chosen[code] = choice
        fit = 2 if self._fits(start, exact=True) else int(self._fits(start))
        del self._chosen[code]
        return fit

    def _fits(self, offset: int | None = None, exact: bool = False) -> bool:
        """Whether the blocks still expected end with the message, or (not `exact`) in zeros."""
        data = self._data
        at = self.offset if offset is None else offset
        for _ in range(self._count - len(self.blocks)):
            if at + 2 > len(data):
                return False
            code, count = data[at], data[at + 1]
            found = (self._chosen.get(code) or self._codecs[code])[1]
            if code != ERROR and found is None:
                return False
            size = count * (found.size if found else 2)
            at += 2 + size
            if at > len(data):
                return False
            at = min(len(data), at + size % 2)
        return at == len(data) or (not exact and at >= self._sense)


def encode_request(request: Request) -> bytes:
    """The bytes of a request; if it was decoded, the same bytes."""
    addresses = b"".join(
        _ADDRESS.pack(a.attribute, a.element_count, a.pnu, a.subindex) for a in request.addresses
    )
    return _encode(request, request.request_id, addresses)


def encode_response(response: Response) -> bytes:
    """The bytes of a response; if it was decoded, the same bytes."""
    return _encode(response, response.response_id, b"")


def _encode(message: Request | Response, code: int | None, addresses: bytes) -> bytes:
    head = (message.request_reference, code, message.axis, message.parameter_count)
    parts = [bytes(field for field in head if field is not None), addresses]
    for block in message.blocks:
        parts += (bytes((block.format, block.value_count)), block.raw, block.pad)
    return b"".join((*parts, message.rest))
