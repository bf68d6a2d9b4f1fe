"""`ds47 encode`: a readable line to the bytes of a request, to put into a WRREC buffer.

The notation is `ds47.profidrive.notation`; here is only how the bytes are written.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import click

from ds47.cli.common import flaw_text, lang_option, rule_text, stdout, warn


@click.command("encode")
@click.argument("words", metavar="[LINE]...", nargs=-1)
@click.option(
    "--format",
    "-f",
    "format_name",
    type=click.Choice(["hex", "words", "scl"]),
    default="hex",
    show_default=True,
    help="Hex bytes, 16# words as a watch table shows them, or SCL assignments.",
)
@lang_option
def command(words: Sequence[str], format_name: str, lang: str) -> None:
    r"""Print the bytes of a request.

    It is a readable line like these, from stdin without an argument:

    \b
      read ref 3 axis 2 p50303[0]
      change ref 2 axis 2 p50304=Float32:100.0
      read axis 1 p2900 r2902[2]*4
    """
    from ds47.profidrive import encode_request
    from ds47.profidrive.notation import parse_request_line

    line = " ".join(words) if words else sys.stdin.read()
    try:
        data = encode_request(parse_request_line(line.strip()))
    except ValueError as problem:
        raise click.UsageError(str(problem)) from problem
    stdout().write(WAYS[format_name](data) + "\n")
    _warn_of_flaws(data, lang)


def hex_bytes(data: bytes) -> str:
    """`03 01 02 01`."""
    return data.hex(" ")


def plc_words(data: bytes) -> str:
    """`16#0301 16#0201`; a last odd byte stands alone, two digits."""
    from ds47.diagnosis.suggest import plc_words

    return " ".join(plc_words(data))


def scl(data: bytes) -> str:
    """Assignments to an array of bytes named `request`, and the length for WRREC."""
    from ds47.diagnosis.suggest import scl

    return scl(data)


WAYS: dict[str, Callable[[bytes], str]] = {"hex": hex_bytes, "words": plc_words, "scl": scl}
"""How bytes are written, by the name of the format."""


def _warn_of_flaws(data: bytes, lang: str) -> None:
    """Says on stderr what a drive would not like about the request."""
    from ds47 import spec
    from ds47.profidrive import decode_request
    from ds47.report.bilingual import say

    for flaw in decode_request(data).flaws:
        rule = rule_text(spec.rules()[flaw.rule], lang)
        text = flaw_text(rule.message, flaw.offset, flaw.args, lang)
        severity = say(f"severity_{rule.severity}")
        warn(say("flaw_warning", rule=rule.id, severity=severity, message=text).text(lang))
