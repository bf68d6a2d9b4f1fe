"""`ds47 decode`: one parameter-channel message from hex, in words or as JSON.

Here: what the input is, and the layout. Decoding is `ds47.profidrive`, how values are written
`ds47.report.formatting`. Nothing here depends on a capture.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import (
    codec_options,
    dialect_options,
    flaw_text,
    lang_option,
    rule_text,
    stdout,
    warn,
)
from ds47.model import Parameter, ParameterError
from ds47.report import formatting
from ds47.report.bilingual import say

if TYPE_CHECKING:
    from ds47.cli.common import RuleText
    from ds47.profidrive import Address, Block, Options, Request, Response

BYTES_PER_LINE = 8


@click.command("decode")
@click.argument("message", metavar="[HEX]...", nargs=-1)
@click.option(
    "--as",
    "kind",
    type=click.Choice(["request", "response"]),
    help="Default: a guess, and says so.",
)
@click.option("--request", "request_hex", metavar="HEX", help="The request that it answers.")
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
@lang_option
@dialect_options
def command(
    message: Sequence[str],
    kind: str | None,
    request_hex: str | None,
    format_name: str,
    lang: str,
    legacy_g120_formats: bool,
    profile_v3_types: bool,
) -> None:
    """Decode one message, given in hex (stdin without an argument).

    Spacing does not matter; "16#0101 16#0102" (words of a PLC watch table) and "0x01, 0x02" are
    read too. With --request each value of a response gets its parameter number.
    """
    if kind == "request" and request_hex is not None:
        raise click.UsageError("--request is for a response; it does not go with --as request")
    options = codec_options(legacy_g120_formats, profile_v3_types)
    data = _bytes(" ".join(message) if message else sys.stdin.read(), "the message")
    question = None if request_hex is None else _bytes(request_hex, "--request")
    view, guessed = _view(data, kind, question, options, lang)
    if guessed:
        other = "response" if view.kind == "request" else "request"
        kind_name = say(f"decode_{view.kind}")
        warn(say("decode_guess", kind=kind_name, option=other).text(lang))
    stdout().write(_json(view) if format_name == "json" else _text(view))


@dataclass(frozen=True, slots=True)
class _View:
    """A decoded message with its addresses (its own, or those of its request)."""

    kind: str
    data: bytes
    message: Request | Response
    id_name: str
    id: int | None
    own_addresses: bool
    lang: str
    parameters: list[tuple[Address | None, Block | None, Parameter]] = field(default_factory=list)
    findings: list[tuple[RuleText, Any]] = field(default_factory=list)
    """Each rule that was broken, and where (a flaw of the codec)."""

    @property
    def writes(self) -> bool:
        """Whether its values are written ones."""
        return self.kind == "request"


def _bytes(text: str, what: str) -> bytes:
    from ds47.profidrive.notation import parse_hex

    try:
        data = parse_hex(text)
    except ValueError as problem:
        raise click.UsageError(f"{what}: {problem}") from problem
    if not data:
        raise click.UsageError(f"{what}: no bytes")
    return data


def _view(
    data: bytes, kind: str | None, question: bytes | None, options: Options, lang: str
) -> tuple[_View, bool]:
    """The decoded message, and whether what it is was guessed."""
    from ds47.profidrive import decode_request, decode_response

    asked = None if question is None else decode_request(question, options)
    request, response = decode_request(data, options), decode_response(data, asked, options)
    guessed = kind is None and asked is None
    if asked is not None or (kind or _guess(request, response)) == "response":
        addresses = asked.addresses if asked else []
        shown: Request | Response = response
        view = _View("response", data, response, "response_id", response.response_id, False, lang)
    else:
        addresses, shown = request.addresses, request
        view = _View("request", data, request, "request_id", request.request_id, True, lang)
    for address, block in zip_longest(addresses, shown.blocks):
        item = _parameter(address, block, lang, options.vendor_id)
        view.parameters.append((address, block, item))
    view.findings.extend(_findings(shown.flaws, lang))
    return view, guessed


def _guess(request: Request, response: Response) -> str:
    """Request or response: what has the shape; else what has fewer flaws; else a request."""
    if request.shaped != response.shaped:
        return "request" if request.shaped else "response"
    return "response" if len(response.flaws) < len(request.flaws) else "request"


def _parameter(
    address: Address | None, block: Block | None, lang: str, vendor_id: int | None
) -> Parameter:
    item = Parameter(None, None, None, None)
    if address is not None:
        item.pnu, item.subindex = address.pnu, address.subindex
        item.attribute, item.element_count = address.attribute_name, address.element_count
    if block is not None:
        item.format, item.value_count = block.format_name, block.value_count
        item.values, item.scaled = block.values, block.scaled
        item.error = _error(block, lang, vendor_id)
    return item


def _error(block: Block, lang: str, vendor_id: int | None) -> ParameterError | None:
    from ds47 import spec

    if block.error is None:
        return None
    code = block.error.code
    text = "" if code is None else spec.error_text(code, lang, vendor_id)
    return ParameterError(code, text, block.error.info)


def _findings(flaws: Sequence[Any], lang: str) -> list[tuple[RuleText, Any]]:
    from ds47 import spec

    return [(rule_text(spec.rules()[flaw.rule], lang), flaw) for flaw in flaws]


def _json(view: _View) -> str:
    """The message as docs/report.md says: what it does not carry is null."""
    from ds47.report import json

    parameters = []
    for _, block, item in view.parameters:
        plain = json.parameter(item)
        del plain["name"], plain["unit"]  # a lone message has no device to look them up for
        if block is None or item.error is not None:
            plain["values"] = None
        parameters.append(plain)
    document = {
        "kind": view.kind,
        "request_reference": view.message.request_reference,
        view.id_name: view.id,
        "axis": view.message.axis,
        "parameter_count": view.message.parameter_count,
        "parameters": parameters,
        "findings": [
            {
                "rule": rule.id,
                "severity": rule.severity,
                "message": flaw_text(flaw),
                "offset": flaw.offset,
            }
            for rule, flaw in view.findings
        ],
    }
    return json.text(document) + "\n"


def _text(view: _View) -> str:
    kind = say(f"decode_{view.kind}")
    lines = [say("decode_head", kind=kind, n=len(view.data)).text(view.lang)]
    rows = sorted(_rows(view), key=lambda row: row[0])
    ends = [row[0] for row in rows[1:]] + [len(view.data)]
    for (start, meaning), end in zip(rows, ends, strict=True):
        lines += _dump(view.data, start, end, meaning)
    for rule, flaw in view.findings:
        text = formatting.escape(flaw_text(flaw, view.lang))
        severity = say(f"severity_{rule.severity}")
        lines.append(
            say("flaw_line", rule=rule.id, severity=severity, message=text).text(view.lang)
        )
    return "\n".join(lines) + "\n"


def _rows(view: _View) -> Iterator[tuple[int, str]]:
    """Where each part of the message starts, and what it means."""
    message = view.message
    header = (
        ("request_reference", message.request_reference, str),
        (view.id_name, view.id, _id_words(view.kind, view.lang)),
        ("axis", message.axis, str),
        ("parameter_count", message.parameter_count, str),
    )
    for offset, (name, value, show) in enumerate(header):
        if value is not None:
            yield offset, f"{name} {show(value)}"
    for address, block, item in view.parameters:
        if address is not None and view.own_addresses:
            yield address.offset, _address_words(item, view.lang)
        if block is not None:
            yield block.offset, _block_words(item, view.writes, view.lang)
    if message.rest and len(view.data) > len(message.rest):
        yield len(view.data) - len(message.rest), say("decode_rest").text(view.lang)


def _address_words(item: Parameter, lang: str) -> str:
    bare = Parameter(item.pnu, item.subindex, item.attribute, item.element_count)
    told = say(
        "decode_elements",
        parameter=formatting.address(bare),
        attribute=item.attribute,
        n=item.element_count or 0,
    )
    return told.text(lang)


def _block_words(item: Parameter, written: bool, lang: str) -> str:
    told = say(
        "decode_words" if item.error else "decode_values",
        format=item.format or "Error",
        n=item.value_count or 0,
        parameter=formatting.parameter(item, written, lang),
    )
    return told.text(lang)


def _id_words(kind: str, lang: str) -> Any:
    from ds47 import spec

    table: Any = spec.request_ids() if kind == "request" else spec.response_ids()
    unknown = say("decode_unknown").text(lang)

    def show(code: int) -> str:
        known = table.get(code)
        return f"0x{code:02X} {known.name if known else unknown}"

    return show


def _dump(data: bytes, start: int, end: int, meaning: str) -> Iterator[str]:
    """Lines with offset, bytes and, beside the first, what they mean."""
    width = BYTES_PER_LINE * 3 - 1
    for at in range(start, max(end, start + 1), BYTES_PER_LINE):
        part = data[at : min(end, at + BYTES_PER_LINE)].hex(" ")
        yield f"{at:>6}  {part:<{width}}  {meaning if at == start else ''}".rstrip()
