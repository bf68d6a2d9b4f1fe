"""What one change makes of a request that went wrong: swapped bytes, spread fields, wrong types.

`find` looks for the one change after which the whole message decodes (DS714 to DS716). Nothing is
measured or remembered here; how a corrected request is shown is in `suggest`.

    DS715  all_bytes     every word with its bytes swapped
           fields        PNU, subindex and values little-endian, single bytes right
           values        only the values little-endian
    DS716  zeros         a zero before or behind each byte
           even_offsets  each single byte in a word of its own
    DS714                the values under another format
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.diagnosis.suggest import as_format, with_blocks
from ds47.model import SIEMENS
from ds47.profidrive import Block, Options, Request, Value, decode_request
from ds47.profidrive.formats import codec, is_unlikely
from ds47.profidrive.parameter import codecs
from ds47.spec.layouts import MESSAGE_SIZE
from ds47.spec.semantics import known

_READ, _CHANGE = 0x01, 0x02
_WRONG_TYPE: Final = frozenset((0x05, 0x17))
"""Of the type errors those that are about the format alone, never about the value."""
_NORMALISED: Final = 0x65
"""From this code on a whole number stands for something else, such as 16384 for 100 %."""
_BOOLEAN: Final = 0x01
_NUMBERS: Final = frozenset(("number", "float", "time_of_day", "duration"))
_OTHER: Final = {("number", 4): 0x08, ("number", 8): 0x0F, ("float", 4): 0x04, ("float", 8): 0x37}
"""Kind and size of a format -> Float32, Float64, Integer32 or Integer64, as which the bits may be meant."""
_MARGIN: Final = 2
"""Of two readings of the same bytes one is meant if it has so many significant digits fewer."""


class Retyped(NamedTuple):
    """One parameter under another format (DS714).

    Attributes:
        number: of the parameter, from 0.
        args: what was written, and what it is under the format.
        bits: how the two values hang together: a key of diagnoses.toml.
    """

    number: int
    args: dict[str, Any]
    bits: str


class Repair(NamedTuple):
    """The one change that makes sense of a request.

    Attributes:
        rule: DS714, DS715 or DS716.
        what: the key of `diagnosis_words` for what is swapped or too much; "" for DS714.
        request: the corrected request.
        args: those of the rule, `what` left out.
        number: the parameter concerned, from 0; the first of several.
        each: of DS714 all of them.
    """

    rule: str
    what: str
    request: bytes
    args: dict[str, Any]
    number: int
    each: tuple[Retyped, ...] = ()


def find(
    request: bytes,
    message: Request,
    errors: Mapping[int, int],
    known_pnu: Callable[[int], bool],
    known_format: Callable[[int], int | None],
    options: Options,
    family: str | None = None,
) -> Repair | None:
    """The repair of a request, None if nothing is wrong or if it is not certain. Never raises.

    Args:
        request: the data of the Write record.
        message: the same decoded with the same `options`.
        errors: number of the parameter, from 0 -> error number, of those that were refused.
        known_pnu: whether there is such a parameter, from a table or because it has answered.
        known_format: the format code of a parameter where it is known.
        options: dialects and vendor.
        family: whose parameters the drive has, for the readable line.
    """
    # Twice the channel: data with a fill byte for each one. What is longer no program of a channel
    # sends, and the search would go over all of it several times.
    if len(request) > 2 * known().channel_bytes:
        return None
    if message.shaped and not errors and not _absurd_inside(message):
        return None
    whole = _whole_message(request, message, known_pnu, options)
    if whole:
        return _read(whole[0], options, family) if len(whole) == 1 else None
    if message.request_id != _CHANGE or any(flaw.rule != "DS314" for flaw in message.flaws):
        return None
    job = _Change(request, message, errors, known_format, options)
    meant = _meant(job.values_swapped(), job.other_format())
    return meant if meant is None or meant.each else _read(meant, options, family)


def _read(found: Repair, options: Options, family: str | None) -> Repair:
    """A repair of a whole request with its readable line."""
    line = _line(found.request, decode_request(found.request, options), family)
    return found._replace(args={"meant": line})


# Numbers ----------------------------------------------------------------------------------------


def _digits(value: Value) -> int | None:
    """Significant digits of a number that a person may have typed (0: none), None for any other."""
    if isinstance(value, str):
        return None
    if value == 0:
        return 0
    limits = known()
    least, most = float(f"1e{limits.plausible_least}"), float(f"1e{limits.plausible_most}")
    if not least <= abs(value) <= most:
        return None
    count = len(repr(abs(value)).partition("e")[0].replace(".", "").strip("0"))
    return count if count <= limits.plausible_digits else None


def _row(block: Block) -> spec.Format | None:
    return spec.formats().get(block.format if block.meaning is None else block.meaning)


def _size(block: Block) -> int:
    """Bytes per value; of a block that is cut off, with which nothing can be done, fewer."""
    return len(block.raw) // max(block.value_count, 1)


def _kind(block: Block) -> str:
    row = _row(block)
    return "" if row is None else row.kind


def _numbers(block: Block) -> list[Value]:
    return block.values if _kind(block) in _NUMBERS else []


def _absurd_inside(message: Request) -> bool:
    return any(map(is_unlikely, message.blocks))


# The whole message ------------------------------------------------------------------------------


def _whole_message(
    request: bytes, message: Request, known_pnu: Callable[[int], bool], options: Options
) -> list[Repair]:
    """The repairs that concern more than values; equal requests count once."""
    found: dict[bytes, Repair] = {}
    for what, data in _swapped(request, message, known_pnu):
        fixed = _settled(data, options)
        if fixed is None or _absurd_inside(fixed[1]):
            continue
        if not all(known_pnu(address.pnu) for address in fixed[1].addresses):
            continue
        # With every word turned round the values stood elsewhere: there is nothing to compare.
        if what == "all_bytes" or not _worse(message, fixed[1]):
            found.setdefault(fixed[0], Repair("DS715", what, fixed[0], {}, 0))
    # Where each second byte is zero, that explains the fill bytes as well.
    halves = (request[at::2] for at in (0, 1) if not any(request[1 - at :: 2]))
    layouts = _layouts("zeros", halves, options)
    layouts = layouts or _layouts("even_offsets", _without_fill_bytes(request, options), options)
    return [*found.values(), *(each for each in layouts if each.request not in found)]


def _settled(data: bytes, options: Options) -> tuple[bytes, Request] | None:
    """A request without any flaw, zeros behind its end cut off; None for every other."""
    message = decode_request(data, options)
    if [flaw.rule for flaw in message.flaws] == ["DS314"]:
        data = data[: -len(message.rest)]
        message = decode_request(data, options)
    if message.flaws or message.request_id not in (_READ, _CHANGE):
        return None
    return data, message


def _line(data: bytes, message: Request, family: str | None) -> str:
    """The readable line; the bytes where there is none, as with dialects, which it does not know."""
    from ds47.profidrive.notation import format_request_line  # most requests have no repair

    try:
        if any(block.meaning is not None for block in message.blocks):
            raise ValueError("a dialect has no line")
        line = format_request_line(message, family)
    except ValueError:
        line = data.hex(" ")
    return line


def _swapped(
    request: bytes, message: Request, known_pnu: Callable[[int], bool]
) -> Iterator[tuple[str, bytes]]:
    if message.addresses and all(known_pnu(address.pnu) for address in message.addresses):
        return
    if len(request) % 2 == 0:
        count = len(request) // 2
        yield "all_bytes", struct.pack(f"<{count}H", *struct.unpack(f">{count}H", request))
    if len(message.addresses) == message.parameter_count:
        yield "fields", _little_endian(request, message, addresses=True)


def _little_endian(request: bytes, message: Request, addresses: bool) -> bytes:
    """The request with its values, and its PNU and subindex too, turned round."""
    fixed = bytearray(request)
    if addresses:
        for address in message.addresses:
            at = address.offset
            fixed[at + 2 : at + 6] = struct.pack("<HH", address.pnu, address.subindex)
    for block in message.blocks:
        start = block.offset + 2
        fixed[start : start + len(block.raw)] = _turned(block)
    return bytes(fixed)


def _turned(block: Block) -> bytes:
    size = _size(block)
    if _kind(block) not in _NUMBERS or size not in (2, 4, 8):
        return block.raw
    return b"".join(block.raw[i : i + size][::-1] for i in range(0, len(block.raw), size))


def _worse(before: Request, after: Request) -> bool:
    """Whether a number that somebody may have typed is none any more."""
    return any(
        _digits(old) is not None and _digits(new) is None
        for was, now in zip(before.blocks, after.blocks, strict=False)
        for old, new in zip(_numbers(was), _numbers(now), strict=False)
    )


def _layouts(what: str, candidates: Iterable[bytes | None], options: Options) -> list[Repair]:
    settled = [_settled(data, options) for data in candidates if data]
    return [
        Repair("DS716", what, each[0], {}, 0)
        for each in settled
        if each and not _absurd_inside(each[1])
    ]


def _without_fill_bytes(request: bytes, options: Options) -> Iterator[bytes | None]:
    """With the fill byte behind each single byte, then before it."""
    for place in (0, 1):
        try:
            yield _Spread(request, place, options).request()
        except ValueError:
            yield None


class _Spread:
    """Reads a request whose single bytes lie in words of their own, words and longer as they are."""

    def __init__(self, data: bytes, place: int, options: Options) -> None:
        self._data, self._place, self._at = data, place, 0
        self._codecs = codecs(options.legacy_g120_formats, options.profile_v3_types)

    def request(self) -> bytes:
        """The bytes without the fill bytes. Raises ValueError where there are no such words."""
        head = self._singles(MESSAGE_SIZE)
        fixed = bytearray(head)
        for _ in range(head[3]):
            fixed += self._singles(2) + self._take(4)
        for _ in range(head[3] if head[1] == _CHANGE else 0):
            fixed += self._block()
        if any(self._data[self._at :]):
            raise ValueError("bytes left over")
        return bytes(fixed)

    def _block(self) -> bytes:
        head = self._singles(2)
        found = self._codecs[head[0]][1]
        if found is None:
            raise ValueError("unknown format")
        size = head[1] * found.size
        single = found.size == 1 and not found.whole
        values = self._singles(size) if single else self._take(size)
        if not single and size % 2:
            self._take(1)
        return head + values + bytes(size % 2)

    def _take(self, size: int) -> bytes:
        part = self._data[self._at : self._at + size]
        if len(part) < size:
            raise ValueError("bytes missing")
        self._at += size
        return part

    def _singles(self, count: int) -> bytes:
        part = self._take(2 * count)
        if any(part[1 - self._place :: 2]):
            raise ValueError("not filled with zeros")
        return part[self._place :: 2]


# Values -----------------------------------------------------------------------------------------


class _Guess(NamedTuple):
    """A repair of values, and how many significant digits its longest number has."""

    repair: Repair
    digits: int


def _meant(swapped: _Guess | None, retyped: _Guess | None) -> Repair | None:
    """The one of two guesses; where both are left the one with clearly shorter numbers."""
    if swapped is None or retyped is None:
        only = swapped or retyped
        return only.repair if only else None
    if swapped.digits + _MARGIN <= retyped.digits:
        return swapped.repair
    return retyped.repair if retyped.digits + _MARGIN <= swapped.digits else None


class _Change(NamedTuple):
    """A change that decodes, and what may be wrong with its values."""

    request: bytes
    message: Request
    errors: Mapping[int, int]
    known_format: Callable[[int], int | None]
    options: Options

    def values_swapped(self) -> _Guess | None:
        """All values little-endian: at least one is absurd now, none is then."""
        data = _little_endian(self.request, self.message, addresses=False)
        fixed = _settled(data, self.options)
        if fixed is None or any(map(self._of_other_type, range(len(self.message.blocks)))):
            return None
        digits: list[int] = []
        first = None
        for number, block in enumerate(fixed[1].blocks):
            if block.raw == self.message.blocks[number].raw:
                continue
            for value in block.values:
                count = _digits(value)
                if count is None:
                    return None
                digits.append(count)
            if (
                first is None
                and self._wrong(number)
                and not self._connector(number, max(digits, default=0))
            ):
                first = number
        if first is None:
            return None
        return _Guess(Repair("DS715", "values", fixed[0], {}, first), max(digits, default=0))

    def other_format(self) -> _Guess | None:
        """The values that are absurd, or of a type that was refused, under another format."""
        changed: dict[int, Block] = {}
        for number, block in enumerate(self.message.blocks):
            new = self._retyped(number, block)
            if new is not None:
                changed[number] = new
        fixed = _settled(with_blocks(self.message, changed), self.options) if changed else None
        if fixed is None or _absurd_inside(fixed[1]):
            return None
        each = tuple(self._described(number, new) for number, new in changed.items())
        counts = [_digits(value) or 0 for block in changed.values() for value in block.values]
        first = each[0]
        return _Guess(Repair("DS714", "", fixed[0], first.args, first.number, each), max(counts))

    def _described(self, number: int, new: Block) -> Retyped:
        old, address = self.message.blocks[number], self.message.addresses[number]
        bits = "bits_same" if new.raw == old.raw else "number_other"
        if bits != "bits_same" and new.values == _numbers(old):
            bits = "number_same"
        args = {
            "pnu": address.pnu,
            "subindex": address.subindex,
            "format": old.format_name,
            "values": list(old.values),
            "better": new.format_name,
            "code": new.format,
            "meant": list(new.values),
        }
        return Retyped(number, args, bits)

    def _wrong(self, number: int) -> bool:
        """Whether values are absurd by themselves, or the drive refused numbers that nobody types."""
        block = self.message.blocks[number]
        if self._is_connector(number):
            return False
        refused = self.errors.get(number) in known().type_errors
        return is_unlikely(block) or (
            refused and any(_digits(value) is None for value in _numbers(block))
        )

    def _is_connector(self, number: int) -> bool:
        """Whether this is a known BICO input, whose value is no number (DS720 speaks of those)."""
        siemens = self.options.vendor_id in (None, SIEMENS)
        return siemens and self.message.addresses[number].pnu in known().connectors

    def _connector(self, number: int, digits: int) -> bool:
        """Whether values may be connectors, PNU in the upper word, rather than numbers turned round."""
        block = self.message.blocks[number]
        row = _row(block)
        if row is None or row.pack != "I":
            return False
        pnus = (_digits(value >> 16) for value in block.values if isinstance(value, int))
        return any(pnu and pnu < digits + _MARGIN for pnu in pnus)

    def _of_other_type(self, number: int) -> bool:
        """Whether the drive refused the type, and the parameter is known to have another one."""
        wanted = self.known_format(self.message.addresses[number].pnu)
        block = self.message.blocks[number]
        refused = self.errors.get(number) in _WRONG_TYPE
        return refused and wanted is not None and wanted != block.format

    def _retyped(self, number: int, block: Block) -> Block | None:
        wanted = self.known_format(self.message.addresses[number].pnu)
        if block.meaning is not None or not _numbers(block) or self._is_connector(number):
            return None
        other = _other_reading(block) if self._wrong(number) else None
        if other is not None:
            return _written(block, other.values, other.format if wanted is None else wanted)
        if wanted is None or not self._of_other_type(number) or is_unlikely(block):
            return None
        return _written(block, block.values, wanted)


def _other_reading(block: Block) -> Block | None:
    """The same bits as a float instead of a whole number or the reverse, if all are plausible."""
    code = _OTHER.get((_kind(block), _size(block)))
    if code is None:
        return None
    found = codec(code)
    assert found is not None  # these are numbers of a known size
    values = found.decode(block.raw, block.value_count)
    if any(_digits(value) is None for value in values):
        return None
    return Block(code, block.value_count, values, None, None, block.raw)


def _written(block: Block, values: list[Value], code: int) -> Block | None:
    """The values under a format: the same bits if they mean them there, else the same numbers."""
    found = codec(code)
    if found is None:
        return None
    count, raw = block.value_count, block.raw
    if len(raw) == count * found.size:
        same = found.decode(raw, count)
        if same == values:
            return Block(code, count, same, None, None, raw, block.offset, block.pad)
    plain = spec.formats()[code].kind in ("number", "float") and _BOOLEAN < code < _NORMALISED
    if not plain or block.format >= _NORMALISED or any(isinstance(value, str) for value in values):
        return None
    return as_format(code, values)
