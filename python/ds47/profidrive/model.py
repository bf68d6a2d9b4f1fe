"""A decoded message of the parameter channel: plain data, no decoding.

`parameter` has the wire format, `formats` the values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.spec.plain import Plain

Value = int | float | str
"""One value as in JSON: whole numbers beyond 2^53, NaN and infinities are strings."""

VALUE: Final = 0x10
DESCRIPTION: Final = 0x20
TEXT: Final = 0x30
ZERO: Final = 0x40
ERROR: Final = 0x44


class Options(NamedTuple):
    """Known dialects (docs/protocol.md A.6) and the vendor whose error numbers apply (B)."""

    legacy_g120_formats: bool = False
    """0x10 is OctetString and 0x13 TimeDifference, as manuals of 2014/15 print them."""
    profile_v3_types: bool = False
    """0x21 to 0x2C are N2, N4, V2 ... as profile V3 numbers them."""
    vendor_id: int | None = None


@dataclass(slots=True, repr=False, eq=False)
class Flaw(Plain):
    """What is wrong in a message: the rule, the byte, and what the rule's message names."""

    rule: str
    offset: int
    args: dict[str, Any]


@dataclass(slots=True, repr=False, eq=False)
class Address(Plain):
    """One parameter address of a request (docs/protocol.md A.1, A.4)."""

    attribute: int
    element_count: int
    pnu: int
    subindex: int
    offset: int = 0

    @property
    def attribute_name(self) -> str:
        """The name, "value", "description" or "text", or the code as "0x50"."""
        return attribute_name(self.attribute)


@dataclass(slots=True, repr=False, eq=False)
class ErrorValue(Plain):
    """The words of an error block (docs/protocol.md A.7).

    `code` is the whole first word, 0..0xFFFF. `code` and `info` are None if the block lacks the word, and
    also in vendor messages with a first word up to 0xFF, which is not a PROFIdrive error number.
    `spec.error_hex` gives the number as people write it.
    """

    code: int | None
    info: int | None
    words: list[int]


@dataclass(slots=True, init=False, repr=False, eq=False)
class Block(Plain):
    """One value block (docs/protocol.md A.5 to A.7).

    `raw` and `pad` are the bytes on the wire, and what encoding writes. `values` and `scaled` are
    views of them. To change a value, make a new block with `make_block`.
    """

    format: int
    value_count: int
    values: list[Value]
    scaled: list[Value] | None
    error: ErrorValue | None
    raw: bytes
    offset: int
    pad: bytes
    meaning: int | None
    """The format code whose meaning was used, if a dialect changes the meaning of `format`."""

    def __init__(
        self,
        format: int,  # noqa: A002
        value_count: int,
        values: list[Value],
        scaled: list[Value] | None,
        error: ErrorValue | None,
        raw: bytes,
        offset: int = 0,
        pad: bytes = b"",
        meaning: int | None = None,
    ) -> None:
        self.format = format
        self.value_count = value_count
        self.values = values
        self.scaled = scaled
        self.error = error
        self.raw = raw
        self.offset = offset
        self.pad = pad
        self.meaning = meaning

    @property
    def format_name(self) -> str | None:
        """Name of the format, "0x7F" for an unknown one, None for an error."""
        return None if self.error is not None else format_name(self.format, self.meaning)


@dataclass(slots=True, init=False, repr=False, eq=False)
class Request(Plain):
    """A parameter request: the data of a Write record (docs/protocol.md A.1).

    Header fields are None if the message ends before them. `rest` holds the bytes that could
    not be decoded or do not belong to the message. `length` counts all bytes.
    """

    request_reference: int | None
    request_id: int | None
    axis: int | None
    parameter_count: int | None
    addresses: list[Address]
    blocks: list[Block]
    flaws: list[Flaw]
    rest: bytes
    length: int
    operation: spec.Operation
    """One of "read", "change", "vendor", or "unknown" for a request id in no table."""
    describes: bool
    """Whether it addresses a description."""
    asked: int | None
    """How many parameters it asks for, of a cut one by its header; None without that."""

    def __init__(
        self,
        request_reference: int | None,
        request_id: int | None,
        axis: int | None,
        parameter_count: int | None,
        addresses: list[Address] | None = None,
        blocks: list[Block] | None = None,
        flaws: list[Flaw] | None = None,
        rest: bytes = b"",
        length: int = 0,
    ) -> None:
        self.request_reference = request_reference
        self.request_id = request_id
        self.axis = axis
        self.parameter_count = parameter_count
        self.addresses = [] if addresses is None else addresses
        self.blocks = [] if blocks is None else blocks
        self.flaws = [] if flaws is None else flaws
        self.rest = rest
        self.length = length
        self.operation = _operations().get(request_id, "unknown")
        self.describes = False
        self.asked = len(self.addresses)

    def asked_as(self, reference: int) -> Request:
        """The same request under another reference. It shares the lists, which are never changed."""
        if self.request_reference == reference:
            return self
        other = Request(
            reference, self.request_id, self.axis, self.parameter_count, self.addresses,
            self.blocks, self.flaws, self.rest, self.length,
        )  # fmt: skip
        other.describes, other.asked = self.describes, self.asked
        return other

    @property
    def shaped(self) -> bool:
        """Whether this looks like a request: known id, at least one parameter, matching length."""
        return (
            self.operation != "unknown"
            and bool(self.parameter_count)
            and not any(flaw.rule in _SHAPELESS for flaw in self.flaws)
        )


@dataclass(slots=True, init=False, repr=False, eq=False)
class Response(Plain):
    """A parameter response: the data of a Read record (docs/protocol.md A.2). See `Request`."""

    request_reference: int | None
    response_id: int | None
    axis: int | None
    parameter_count: int | None
    blocks: list[Block]
    flaws: list[Flaw]
    rest: bytes
    length: int
    cut: bool
    """Whether the last block lacks bytes of its values."""
    failed: int
    """How many blocks are errors."""

    def __init__(
        self,
        request_reference: int | None,
        response_id: int | None,
        axis: int | None,
        parameter_count: int | None,
        blocks: list[Block] | None = None,
        flaws: list[Flaw] | None = None,
        rest: bytes = b"",
        length: int = 0,
        cut: bool = False,
    ) -> None:
        self.request_reference = request_reference
        self.response_id = response_id
        self.axis = axis
        self.parameter_count = parameter_count
        self.blocks = [] if blocks is None else blocks
        self.flaws = [] if flaws is None else flaws
        self.rest = rest
        self.length = length
        self.cut = cut
        self.failed = 0
        for block in self.blocks:
            if block.error is not None:
                self.failed += 1

    @property
    def shaped(self) -> bool:
        """Whether this looks like a response: known id, a parameter, whole blocks, no rest."""
        return (
            self.response_id in spec.response_ids()
            and bool(self.parameter_count)
            and not any(flaw.rule in _SHAPELESS for flaw in self.flaws)
        )


@lru_cache(maxsize=256)
def attribute_name(code: int) -> str:
    """The name of an attribute, or its code as "0x50"."""
    known = spec.attributes().get(code)
    return known.name if known else f"0x{code:02X}"


@lru_cache(maxsize=1024)
def format_name(code: int, meaning: int | None) -> str:
    """The name of a format, or its code as "0x7F"; `meaning` as in `Block`."""
    known = spec.formats().get(code if meaning is None else meaning)
    return known.name if known else f"0x{code:02X}"


@cache
def _operations() -> dict[int | None, spec.Operation]:
    return {code: known.operation for code, known in spec.request_ids().items()}


_SHAPELESS = frozenset(("DS309", "DS313", "DS315"))
"""Unknown format, bytes left over, bytes missing."""
