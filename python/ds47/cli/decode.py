"""`ds47 decode`: one parameter-channel message from hex, in words or as JSON.

Here: what the input is, and the layout. Decoding is `ds47.library`, how values are written
`ds47.report.formatting`. Nothing here depends on a capture.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import (
    codec_options,
    dialect_options,
    flaw_text,
    lang_option,
    pkw_layout_option,
    stdout,
    warn,
)
from ds47.cli.decode_cyclic import CYCLIC, cyclic_words
from ds47.cli.dump import dump
from ds47.model import Parameter
from ds47.report import formatting
from ds47.report.bilingual import say

if TYPE_CHECKING:
    from ds47.library.message import Message
    from ds47.profidrive import Options


@click.command("decode")
@click.argument("message", metavar="[HEX]...", nargs=-1)
@click.option(
    "--as",
    "kind",
    type=click.Choice(["request", "response", *CYCLIC]),
    help="Default: request or response of DS47, a guess, and says so.",
)
@click.option("--request", "request_hex", metavar="HEX", help="The request that it answers.")
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
@pkw_layout_option
@lang_option
@dialect_options
def command(
    message: Sequence[str],
    kind: str | None,
    request_hex: str | None,
    format_name: str,
    pkw_layout: str,
    lang: str,
    legacy_g120_formats: bool,
    profile_v3_types: bool,
) -> None:
    """Decode one message, given in hex (stdin without an argument).

    Spacing does not matter; "16#0101 16#0102" (words of a PLC watch table) and "0x01, 0x02" are
    read too. With --request each value of a response gets its parameter number.

    Words of cyclic frames: --as pkw and pkw-answer take 8 bytes, stw1 and zsw1 a word with or without
    its setpoint or actual value, ppo1-out and ppo1-in 12 bytes.
    """
    if request_hex is not None and kind in CYCLIC:
        raise click.UsageError(
            f"--request is for a response of DS47; it does not go with --as {kind}"
        )
    if kind == "request" and request_hex is not None:
        raise click.UsageError("--request is for a response; it does not go with --as request")
    from ds47.report import json

    options = codec_options(legacy_g120_formats, profile_v3_types)
    data = _bytes(" ".join(message) if message else sys.stdin.read(), "the message")
    if kind in CYCLIC:
        stdout().write(cyclic_words(data, kind, pkw_layout, format_name, lang))
        return
    question = None if request_hex is None else _bytes(request_hex, "--request")
    found = _decoded(data, "response" if question else kind, question, options)
    if kind is None and question is None:
        other = "response" if found.kind == "request" else "request"
        kind_name = say(f"decode_{found.kind}")
        warn(say("decode_guess", kind=kind_name, option=other).text(lang))
    as_json = format_name == "json"
    stdout().write(json.text(found.to_dict()) + "\n" if as_json else _text(found, lang))


def _decoded(data: bytes, kind: str | None, question: bytes | None, options: Options) -> Message:
    """The message; of no kind: what has the shape; else what has fewer flaws; else a request."""
    from ds47.library.message import decode_request, decode_response

    request, response = decode_request(data, options), decode_response(data, question, options)
    if kind is not None:
        return request if kind == "request" else response
    if request.plain.shaped != response.plain.shaped:
        return request if request.plain.shaped else response
    return response if len(response.flaws) < len(request.flaws) else request


def _bytes(text: str, what: str) -> bytes:
    from ds47.profidrive.notation import parse_hex

    try:
        data = parse_hex(text)
    except ValueError as problem:
        raise click.UsageError(f"{what}: {problem}") from problem
    if not data:
        raise click.UsageError(f"{what}: no bytes")
    return data


def _text(message: Message, lang: str) -> str:
    from ds47 import spec

    kind = say(f"decode_{message.kind}")
    lines = [say("decode_head", kind=kind, n=len(message.data)).text(lang)]
    rows = sorted(_rows(message, lang), key=lambda row: row[0])
    ends = [row[0] for row in rows[1:]] + [len(message.data)]
    for (start, meaning), end in zip(rows, ends, strict=True):
        lines += dump(message.data, start, end, meaning)
    for flaw in message.flaws:
        text = formatting.escape(flaw_text(flaw, lang))
        severity = say(f"severity_{spec.rules()[flaw.rule].severity}")
        lines.append(say("flaw_line", rule=flaw.rule, severity=severity, message=text).text(lang))
    return "\n".join(lines) + "\n"


def _rows(message: Message, lang: str) -> Iterator[tuple[int, str]]:
    """Where each part of the message starts, and what it means."""
    own, plain, asks = f"{message.kind}_id", message.plain, message.kind == "request"
    header = (
        ("request_reference", message.request_reference, str),
        (own, getattr(message, own), _id_words(message.kind, lang)),
        ("axis", message.axis, str),
        ("parameter_count", message.parameter_count, str),
    )
    for offset, (name, value, show) in enumerate(header):
        if value is not None:
            yield offset, f"{name} {show(value)}"
    for address, block, item in message.rows():
        if address is not None and asks:
            yield address.offset, _address_words(item, lang)
        if block is not None:
            yield block.offset, _block_words(item, asks, lang)
    if plain.rest and len(message.data) > len(plain.rest):
        yield len(message.data) - len(plain.rest), say("decode_rest").text(lang)


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
