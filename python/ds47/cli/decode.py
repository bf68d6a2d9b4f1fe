"""`ds47 decode`: one parameter-channel message from hex, in words or as JSON.

Here: what the input is. The layout is in `decode_message`, `decode_cyclic`, `decode_profibus` and `decode_s7`,
decoding `ds47.library`. Nothing here depends on a capture.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from ds47.cli.common import (
    codec_options,
    dialect_options,
    lang_option,
    refused,
    stdout,
    tell,
    warn,
)
from ds47.cli.decode_cyclic import CYCLIC, cyclic_words
from ds47.cli.decode_message import text
from ds47.cli.decode_profibus import PROFIBUS, profibus_words
from ds47.cli.decode_s7 import S7, s7_words
from ds47.cli.helping import helped
from ds47.report.bilingual import say
from ds47.spec.pkw_layouts import maker_layouts

if TYPE_CHECKING:
    from ds47.library.message import Message
    from ds47.profidrive import Options


@helped("decode", ("ds47 decode 01 01 02 01 10 01 03 A9 00 00", "the bytes of a request"))
@click.argument("message", metavar="[HEX]...", nargs=-1)
@click.option(
    "--as",
    "kind",
    type=click.Choice(["request", "response", *CYCLIC, PROFIBUS, S7]),
    help="Kind of message.  [default: request or response, guessed]",
)
@click.option("--request", "request_hex", metavar="HEX", help="The request that it answers.")
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
@click.option("--vendor", metavar="NAME|ID", help="Vendor of the device: SINAMICS, ABB, 0x002A.")
@click.option(
    "--pkw-layout",
    type=click.Choice(["cyclic", "uss", *maker_layouts()]),
    metavar="LAYOUT",
    default="cyclic",
    show_default=True,
    help="PKW: cyclic, uss (page in the high byte of IND), inovance, rexroth-efc, rexroth-fv.",
)
@lang_option
@dialect_options
def command(
    message: Sequence[str],
    kind: str | None,
    request_hex: str | None,
    format_name: str,
    vendor: str | None,
    pkw_layout: str,
    lang: str,
    legacy_g120_formats: bool,
    profile_v3_types: bool,
) -> None:
    """Decode one message, given in hex (stdin without an argument).

    Spacing does not matter. Words of a PLC watch table ("16#0101 16#0102"), "0x01, 0x02", hex dumps
    with offsets and lists of decimal numbers work, too. With --request each value of a response gets
    its parameter number.

    Error numbers from 101 (0x65) on, and bits of STW1 and ZSW1 from 11 on, depend on the vendor: give
    --vendor.

    Words of cyclic frames: --as pkw and pkw-answer take 8 bytes, stw1 and zsw1 a word with or without
    its setpoint or actual value, ppo1-out and ppo1-in 12 bytes.

    --as profibus takes one or more frames of PROFIBUS DP, each from start byte to end byte.

    --as s7 takes a PDU of S7 that starts with its TPKT (03 00) or with its first byte (32).
    """
    if request_hex is not None and kind in (*CYCLIC, PROFIBUS, S7):
        raise click.UsageError(
            f"--request is for a response of DS47; it does not go with --as {kind}"
        )
    if kind == "request" and request_hex is not None:
        raise click.UsageError("--request is for a response; it does not go with --as request")
    from ds47.report import json

    options = codec_options(legacy_g120_formats, profile_v3_types, vendor)
    data = _bytes(" ".join(message) if message else sys.stdin.read(), "the message", lang)
    as_json = format_name == "json"
    if kind in CYCLIC:
        _print(cyclic_words(data, kind, pkw_layout, format_name, lang, options.vendor_id), as_json)
        return
    if kind == PROFIBUS:
        _print(profibus_words(data, format_name, options, lang), as_json)
        return
    if kind == S7:
        _print(s7_words(data, format_name, lang), as_json)
        return
    question = None if request_hex is None else _bytes(request_hex, "--request", lang)
    found = _decoded(data, "response" if question else kind, question, options)
    if kind is None and question is None:
        other = "response" if found.kind == "request" else "request"
        kind_name = say(f"decode_{found.kind}")
        warn(say("decode_guess", kind=kind_name, option=other).text(lang))
    _print(
        json.text(found.to_dict()) + "\n" if as_json else text(found, lang, options.vendor_id),
        as_json,
    )


def _print(shown: str, as_json: bool) -> None:
    """JSON is for programs; text fits the terminal."""
    if as_json:
        stdout().write(shown)
    else:
        tell(shown.splitlines())


def _decoded(data: bytes, kind: str | None, question: bytes | None, options: Options) -> Message:
    """The message; of no kind: what has the shape; else what has fewer flaws; else a request."""
    from ds47.library.message import decode_request, decode_response

    request, response = decode_request(data, options), decode_response(data, question, options)
    if kind is not None:
        return request if kind == "request" else response
    if request.plain.shaped != response.plain.shaped:
        return request if request.plain.shaped else response
    return response if len(response.flaws) < len(request.flaws) else request


def _bytes(text: str, what: str, lang: str) -> bytes:
    from ds47.cli.pasted import read

    with refused(ValueError, said=f"{what}: ", usage=True):
        pasted = read(text)
    if not pasted.data:
        raise click.UsageError(f"{what}: no bytes. Try: ds47 decode 0102030110010460")
    if pasted.decimal:
        warn(say("decode_decimal").text(lang))
    return pasted.data
