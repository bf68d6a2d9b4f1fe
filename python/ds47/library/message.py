"""One message of the parameter channel: bytes to fields and back, without a capture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import zip_longest
from typing import Any

from ds47 import profidrive
from ds47.model import Parameter, ParameterError
from ds47.profidrive import Address, Block, Flaw, Options, Request, Response
from ds47.profidrive.notation import parse_hex, read_request_line
from ds47.report.contract import PARAMETER
from ds47.report.sentences import at_offset, words
from ds47.spec import rules

Hex = bytes | bytearray | memoryview | str
"""Bytes, or hex digits as people write them: `03 01 02 01`, `16#0301 16#0201`."""
Row = tuple[Address | None, Block | None, Parameter]
"""A parameter with what the message has of it: its address, its value or error block."""


@dataclass(frozen=True, slots=True)
class MessageFinding:
    """What is wrong with a message: a rule of the catalogue, and the byte at which it shows."""

    rule: str
    severity: str
    message: str
    offset: int | None


class Message:
    """A decoded request or response. What it does not carry is None.

    Attributes:
        kind: "request" or "response".
        data: its bytes.
        plain: it, as the codec gives it: addresses, blocks, flaws.
        asked: the request that a response answers; None where it is not known.
    """

    def __init__(
        self, data: bytes, plain: Request | Response, asked: Request | None, options: Options
    ) -> None:
        self.data = data
        self.plain = plain
        self.asked = asked
        self._vendor_id = options.vendor_id

    def __repr__(self) -> str:
        return f"<ds47 {self.kind}: {self.data.hex(' ')}>"

    @property
    def kind(self) -> str:
        """Which of the two it is."""
        return "request" if isinstance(self.plain, Request) else "response"

    @property
    def request_reference(self) -> int | None:
        """The request reference, 1 to 255."""
        return self.plain.request_reference

    @property
    def request_id(self) -> int | None:
        """Of a request: 1 read, 2 change; else None."""
        return self.plain.request_id if isinstance(self.plain, Request) else None

    @property
    def response_id(self) -> int | None:
        """Of a response: as the request id, with 0x80 where it is negative; else None."""
        return self.plain.response_id if isinstance(self.plain, Response) else None

    @property
    def axis(self) -> int | None:
        """The axis number or DO-ID."""
        return self.plain.axis

    @property
    def parameter_count(self) -> int | None:
        """How many parameters its header announces."""
        return self.plain.parameter_count

    @property
    def parameters(self) -> list[Parameter]:
        """Its parameters; those of a response have addresses where the request is known."""
        return [item for _, _, item in self.rows()]

    @property
    def flaws(self) -> list[Flaw]:
        """What is wrong with it, with arguments instead of words."""
        return self.plain.flaws

    @property
    def findings(self) -> list[MessageFinding]:
        """What is wrong with it, in words."""
        return [
            MessageFinding(
                each.rule, rules()[each.rule].severity,
                at_offset(each.offset, words(each.rule, each.args)), each.offset,
            )
            for each in self.flaws
        ]  # fmt: skip

    def rows(self) -> Iterator[Row]:
        """Its parameters with their parts of the message."""
        shown = self.plain if isinstance(self.plain, Request) else self.asked
        addresses = shown.addresses if shown is not None else []
        for address, block in zip_longest(addresses, self.plain.blocks):
            yield address, block, self._parameter(address, block)

    def _parameter(self, address: Address | None, block: Block | None) -> Parameter:
        item = Parameter(None, None, None, None)
        if address is not None:
            item.pnu, item.subindex = address.pnu, address.subindex
            item.attribute, item.element_count = address.attribute_name, address.element_count
        if block is not None:
            item.format, item.value_count = block.format_name, block.value_count
            item.values, item.scaled = block.values, block.scaled
            if block.error is not None:
                item.error = ParameterError(block.error.code, block.error.info, self._vendor_id)
        return item

    def to_dict(self) -> dict[str, Any]:
        """The message as `ds47 decode -f json` prints it (docs/report.md)."""
        own = "request_id" if self.kind == "request" else "response_id"
        return {
            "kind": self.kind,
            "request_reference": self.request_reference,
            own: getattr(self, own),
            "axis": self.axis,
            "parameter_count": self.parameter_count,
            "parameters": [_plain(block, item) for _, block, item in self.rows()],
            "findings": [asdict(each) for each in self.findings],
        }


def _plain(block: Block | None, item: Parameter) -> dict[str, Any]:
    plain = PARAMETER.plain(item)
    del plain["name"], plain["unit"]  # a lone message has no device to look them up for
    if block is None or item.error is not None:
        plain["values"] = None
    return plain


def decode_request(data: Hex, options: Options | None = None) -> Message:
    """Decodes a request (docs/protocol.md A). Broken bytes are findings, never an exception.

    Args:
        data: the record data, as bytes or in hex.
        options: dialects of the parameter channel.

    Raises:
        ValueError: a text that is no hex.
    """
    raw, options = _bytes(data), options or Options()
    return Message(raw, profidrive.decode_request(raw, options), None, options)


def decode_response(
    data: Hex, request: Message | Hex | None = None, options: Options | None = None
) -> Message:
    """Decodes a response; with its request each value gets its PNU, which a response does not carry.

    Args:
        data: the record data, as bytes or in hex.
        request: what it answers.
        options: dialects of the parameter channel.

    Raises:
        ValueError: a text that is no hex; `request` is a response.
    """
    raw, options = _bytes(data), options or Options()
    if request is not None and not isinstance(request, Message):
        request = decode_request(request, options)
    asked = None if request is None else request.plain
    if isinstance(asked, Response):
        raise ValueError("the request of a response cannot be a response")
    return Message(raw, profidrive.decode_response(raw, asked, options), asked, options)


def encode(line: str) -> bytes:
    """The bytes of a request written as a line (docs/encode.md): `read ref 3 axis 2 p945[0..7]`.

    As the command `ds47 encode` it knows the formats of usual parameters, and requests by PKW (`pkw read p1082`).

    Raises:
        ValueError: the line cannot be understood; the text says where.
    """
    from ds47.cyclic.notation import encode_line, is_pkw  # few lines are

    if is_pkw(line):
        return encode_line(line)
    return profidrive.encode_request(read_request_line(line.strip()).request)


def _bytes(data: Hex) -> bytes:
    if not isinstance(data, str):
        return bytes(data)
    found = parse_hex(data)
    if not found:
        raise ValueError("no bytes")
    return found
