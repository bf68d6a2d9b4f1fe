"""What a parameter-channel message is, once decoded: plain data without any decoding.

The wire is in `parameter`, the values of the formats are in `formats`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ds47 import spec

Value = int | float | str
"""One value as JSON shows it: whole numbers beyond 2^53, NaN and infinities are strings."""

VALUE, DESCRIPTION, TEXT = 0x10, 0x20, 0x30
ZERO, ERROR = 0x40, 0x44


@dataclass(frozen=True, slots=True)
class Options:
    """Known dialects (docs/protocol.md A.6) and the vendor whose error numbers apply (B)."""

    legacy_g120_formats: bool = False
    """0x10 is OctetString and 0x13 TimeDifference, as manuals of 2014/15 print them."""
    profile_v3_types: bool = False
    """0x21 to 0x2C are N2, N4, V2 ... as profile V3 numbers them."""
    vendor_id: int | None = None


@dataclass(slots=True)
class Flaw:
    """What is wrong in a message: the rule, the byte, and what the rule's message names."""

    rule: str
    offset: int
    args: dict[str, object]


@dataclass(slots=True)
class Address:
    """One parameter address of a request (docs/protocol.md A.1, A.4)."""

    attribute: int
    element_count: int
    pnu: int
    subindex: int
    offset: int = 0

    @property
    def attribute_name(self) -> str:
        """The name, "value", "description" or "text", or the code as "0x50"."""
        known = spec.attributes().get(self.attribute)
        return known.name if known else f"0x{self.attribute:02X}"


@dataclass(slots=True)
class ErrorValue:
    """The words of an error block (docs/protocol.md A.7).

    `code` and `info` are None where the block has no such word, and inside vendor messages, whose
    words are no PROFIdrive error numbers. `spec.error_text` has the text.
    """

    code: int | None
    info: int | None
    words: list[int]


@dataclass(slots=True)
class Block:
    """One value block (docs/protocol.md A.5 to A.7).

    `raw` and `pad` are the bytes of the wire and what encoding writes; `values` and `scaled` are
    views of them. To change a value make a new block with `make_block`.
    """

    format: int
    value_count: int
    values: list[Value]
    scaled: list[Value] | None
    error: ErrorValue | None
    raw: bytes
    offset: int = 0
    pad: bytes = b""
    meaning: int | None = None
    """The format code whose meaning was used, where a dialect gives this code another one."""

    @property
    def format_name(self) -> str | None:
        """Name of the format, "0x7F" where it has none, None for an error."""
        if self.error is not None:
            return None
        known = spec.formats().get(self.format if self.meaning is None else self.meaning)
        return known.name if known else f"0x{self.format:02X}"


@dataclass(slots=True)
class Request:
    """A parameter request: the data of a Write record (docs/protocol.md A.1).

    Header fields are None where the message ends before them. `rest` holds the bytes that could
    not be decoded or do not belong to the message, `length` is that of everything.
    """

    request_reference: int | None
    request_id: int | None
    axis: int | None
    parameter_count: int | None
    addresses: list[Address] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    flaws: list[Flaw] = field(default_factory=list)
    rest: bytes = b""
    length: int = 0

    @property
    def operation(self) -> str:
        """One of "read", "change", "vendor", or "unknown" where the request id is in no table."""
        known = None if self.request_id is None else spec.request_ids().get(self.request_id)
        return known.operation if known else "unknown"

    @property
    def shaped(self) -> bool:
        """Whether this looks like a request: known id, at least one parameter, length fits."""
        return (
            self.operation != "unknown"
            and bool(self.parameter_count)
            and not any(flaw.rule in _SHAPELESS for flaw in self.flaws)
        )


@dataclass(slots=True)
class Response:
    """A parameter response: the data of a Read record (docs/protocol.md A.2). See `Request`."""

    request_reference: int | None
    response_id: int | None
    axis: int | None
    parameter_count: int | None
    blocks: list[Block] = field(default_factory=list)
    flaws: list[Flaw] = field(default_factory=list)
    rest: bytes = b""
    length: int = 0

    @property
    def shaped(self) -> bool:
        """Whether this looks like a response: known id, a parameter, whole blocks, no rest."""
        return (
            self.response_id in spec.response_ids()
            and bool(self.parameter_count)
            and not any(flaw.rule in _SHAPELESS for flaw in self.flaws)
        )


_SHAPELESS = frozenset(("DS309", "DS313", "DS315"))
"""Unknown format, bytes left over, bytes missing."""
