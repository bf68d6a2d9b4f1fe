"""Parameter messages without names: values replaced, everything else as it was.

Some parameters hold what the rest of the capture hides: name and address of the station, texts that a
machine builder wrote. Their values are always replaced; all values only where that is asked for, or
where nobody can tell of which parameter they are. What cannot be read as a message does not stay.
"""

from __future__ import annotations

from dataclasses import dataclass

from ds47 import spec
from ds47.model import SIEMENS
from ds47.profidrive import Block, Options, Request, Response, decode_request, decode_response
from ds47.profidrive.model import ERROR, VALUE, Address
from ds47.spec.layouts import MESSAGE_SIZE

from .mapping import Replacements

_NAMES = frozenset((61000,))
_NAMES_SIEMENS = frozenset((199, 8806, 8807, 8808, 8809, 8900, 8910, 8920, 8930))
"""Names of drive objects, identification and maintenance, names of station of both Ethernet ports."""
_ADDRESSES = frozenset((61001, 61003))
_ADDRESSES_SIEMENS = frozenset((8901, 8902, 8911, 8912, 8921, 8922, 8931, 8932))
_MACS = frozenset((61002,))
_MACS_SIEMENS = frozenset((8915, 8935))
_DOUBTS = frozenset(("DS303", "DS305", "DS309", "DS313", "DS315"))
"""No parameter, unknown attribute, unknown format, bytes left over, bytes missing."""
_ERROR_WORDS = 4
"""Bytes of an error block that say what is wrong: error number and additional information."""
_LIMITS, _LAST_LIMIT = 974, 2
"""How long a message may be: it says nothing about the machine, and the analysis goes by it.

Subindices 0 to 2 of the profile; whatever else a drive puts there may be a text.
"""
_NUMBERS = frozenset(
    ("Integer8", "Integer16", "Integer32", "Unsigned8", "Unsigned16", "Unsigned32")
)


@dataclass(frozen=True, slots=True)
class Rewriter:
    """Changes messages with one key.

    Attributes:
        key: what stands for what.
        options: dialects of the messages.
        everything: whether all values are replaced.
    """

    key: Replacements
    options: Options
    everything: bool

    def request(self, data: bytes, vendor: int | None) -> bytes:
        """The data of a Write record to a device of this vendor."""
        message = decode_request(data, self.options)
        if message.operation == "unknown" and _doubtful(message):
            return data[:MESSAGE_SIZE] + _unread(data[MESSAGE_SIZE:])
        return self._changed(data, message, message.blocks, message.rest, vendor)

    def response(self, data: bytes, asked: bytes | None, vendor: int | None) -> bytes:
        """The data of a Read record; `asked` is the request that it answers, where that is known."""
        question = None if asked is None else decode_request(asked, self.options)
        message = decode_response(data, question, self.options)
        if message.response_id not in spec.response_ids() and _doubtful(message):
            return data[:MESSAGE_SIZE] + _unread(data[MESSAGE_SIZE:])
        if question is not None and not _answers(message, question):
            question = None
        return self._changed(data, question, message.blocks, message.rest, vendor)

    def _changed(
        self,
        data: bytes,
        question: Request | None,
        blocks: list[Block],
        rest: bytes,
        vendor: int | None,
    ) -> bytes:
        out = bytearray(data)
        addresses = question.addresses if question else []
        for number, block in enumerate(blocks):
            address = addresses[number] if number < len(addresses) else None
            raw = self._block(block, address, vendor) + _unread(block.pad)
            start = block.offset + 2
            out[start : start + len(raw)] = raw
        if rest:
            out[len(out) - len(rest) :] = _unread(rest)
        return bytes(out)

    def _block(self, block: Block, address: Address | None, vendor: int | None) -> bytes:
        """The values of a block; `address` is None if their parameter is unknown."""
        if block.format == ERROR:
            return block.raw[:_ERROR_WORDS] + _unread(block.raw[_ERROR_WORDS:])
        if address is None:
            return _values(self.key, block)
        raw = _identity(self.key, address.pnu, vendor, block.raw)
        if raw is not None:
            return raw
        change = self.everything and not _limits(address, block)
        return _values(self.key, block) if change else block.raw


def _limits(address: Address, block: Block) -> bool:
    """Whether the values are the limits of a message (PNU 974) as numbers, and nothing else."""
    return (
        address.pnu == _LIMITS
        and address.attribute == VALUE
        and block.format_name in _NUMBERS
        and address.subindex + block.value_count <= _LAST_LIMIT + 1
    )


def _unread(data: bytes) -> bytes:
    """For undecodable bytes: non-zero bytes stay non-zero."""
    return bytes(0xA5 if byte else 0 for byte in data)


def _doubtful(message: Request | Response) -> bool:
    """Whether a message of an unknown kind does not read like one of the known kinds either."""
    return any(flaw.rule in _DOUBTS for flaw in message.flaws)


def _answers(response: Response, request: Request) -> bool:
    """Whether the values are of the parameters that were asked for; a frame between may be lost."""
    return (
        response.request_reference == request.request_reference
        and response.parameter_count == request.parameter_count
        and (response.response_id or 0) & 0x7F == request.request_id
    )


def _identity(key: Replacements, pnu: int | None, vendor: int | None, raw: bytes) -> bytes | None:
    """An address or a name, None where it is neither; one character or number of it alone becomes zeros."""
    siemens = vendor in (SIEMENS, None)
    if pnu in _NAMES or (siemens and pnu in _NAMES_SIEMENS):
        return _text(key, raw)
    if pnu in _ADDRESSES or (siemens and pnu in _ADDRESSES_SIEMENS):
        return key.ip(raw) if len(raw) == 4 else bytes(len(raw))
    if pnu in _MACS or (siemens and pnu in _MACS_SIEMENS):
        return key.mac(raw) if len(raw) == 6 else bytes(len(raw))
    return None


def _text(key: Replacements, raw: bytes) -> bytes:
    """A text, of characters of one byte, or of two as 16-bit words."""
    if len(raw) > 3 and not len(raw) % 2 and not any(raw[::2]):
        return b"".join(bytes((0, char)) for char in _text(key, raw[1::2]))
    return key.name(raw) if len(raw.rstrip(b"\0 ")) > 1 else bytes(len(raw))


def _values(key: Replacements, block: Block) -> bytes:
    """Equal values become equal ones, whatever their format says: what was written is read back."""
    known = spec.formats().get(block.format if block.meaning is None else block.meaning)
    raw, count = block.raw, block.value_count
    if known is not None and known.kind == "text":
        return key.name(raw)
    size = len(raw) // count if count and not len(raw) % count else len(raw)
    if known is not None and known.whole:
        size = len(raw)
    return b"".join(
        key.value(str(size), raw[at : at + size]) for at in range(0, len(raw), max(size, 1))
    )
