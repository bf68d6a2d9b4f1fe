"""`ds47 encode`: a readable line to the bytes of a request, to put into a WRREC buffer.

The notation is `ds47.profidrive.notation`; here is only how the bytes are written.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from ds47.cli.common import (
    flaw_text,
    format_option,
    lang_option,
    pkw_layout_option,
    refused,
    rule_text,
    stdout,
    warn,
)
from ds47.cli.helping import helped

if TYPE_CHECKING:
    from ds47.profidrive import Request
    from ds47.profidrive.notation import RequestLine
    from ds47.report.bilingual import Both


HELP = """Print the bytes of a request.

The request is a line like these, from stdin without an argument:

\b
  read ref 3 axis 2 p50303[0]
  read axis 1 r0945[0..7] r2902[2]*4
  change ref 2 axis 2 p50304=Float32:100.0
  change axis 2 p2900[0..1]=REAL:10.0,5.0

A read without an index asks for 0 elements, which is right for a parameter that is not an array. [0]
asks for one element, [0..7] and [0]*8 for eight. A change has as many elements as values.

The format comes before the value: Float32, Integer16, Unsigned32, Word, VisibleString and so on, or the
PLC type: REAL, INT, UDINT, WORD. Leave it out if ds47 knows the parameter: p2900=10.0.
Whole numbers may be 16#0A, 2#1010 or 0x0A. The decimal sign is a point: a comma separates values.

The eight bytes of a PKW request, for the cyclic channel:

\b
  pkw read p2010[1]
  pkw change p1082=Float32:40.0
"""


@helped(
    "encode",
    ("ds47 encode 'change DO 3 p1120=5.0'", "a request as bytes"),
    ("ds47 encode -f scl-fb 'read DO 3 r0945[0..7]'", "a block for the PLC"),
    help=HELP,
)
@click.argument("words", metavar="[LINE]...", nargs=-1)
@format_option(
    "hex",
    "words",
    "scl",
    "scl-fb",
    about="Hex bytes, 16# words as a watch table shows them, SCL assignments, or a function block in SCL.",
)
@click.option("--eeprom", is_flag=True, help="Change by PKW that survives power-off (AK 11 to 14).")
@pkw_layout_option
@lang_option
def command(
    words: Sequence[str], format_name: str, eeprom: bool, pkw_layout: str, lang: str
) -> None:
    """Prints the bytes of a request; HELP says how it is written."""
    from ds47.cyclic.notation import is_pkw
    from ds47.profidrive import encode_request
    from ds47.profidrive.notation import read_request_line

    line = _unquoted(" ".join(words)) if words else sys.stdin.read()
    if is_pkw(line):
        if format_name == "scl-fb":
            raise click.UsageError(
                "a function block is made of a read or a change by DS47, not of PKW"
            )
        stdout().write(written(_pkw(line, pkw_layout, eeprom, lang), format_name) + "\n")
        return
    if eeprom:
        raise click.UsageError("--eeprom is for a change by PKW: pkw change p1082=Float32:40.0")
    with refused(ValueError, usage=True):
        asked = read_request_line(line.strip())
    request = asked.request
    data = encode_request(request)
    if format_name == "scl-fb":
        stdout().write(_function_block(request, lang))
    else:
        stdout().write(written(data, format_name) + "\n")
    for remark in (*_assumed(asked), *_remarks(request)):
        warn(remark.text(lang))
    _warn_of_flaws(data, lang)


def _function_block(request: Request, lang: str) -> str:
    from ds47.profidrive.notation import format_request_line
    from ds47.report.scl import function_block

    with refused(ValueError, usage=True):
        return function_block(request, format_request_line(request), lang)


def _unquoted(line: str) -> str:
    """The line without the quotes of a POSIX shell, which cmd.exe leaves where a line was pasted."""
    return line[1:-1] if len(line) > 1 and line[0] == line[-1] == "'" else line


def _pkw(line: str, layout: str, eeprom: bool, lang: str) -> bytes:
    """The bytes of a PKW request, with a word where a drive may want another AK."""
    from ds47.cyclic.notation import encode_line
    from ds47.cyclic.pkw import decode
    from ds47.report.bilingual import say

    with refused(ValueError, usage=True):
        data = encode_line(line, layout, eeprom)
    message = decode(data, answer=False, layout=layout)
    if message.ak == 1 and message.subindex:
        warn(say("pkw_read_index").text(lang))
    return data


def written(data: bytes, way: str) -> str:
    """`03 01 02 01`, `16#0301 16#0201`, or assignments to an array of bytes named `request`."""
    from ds47.diagnosis.suggest import plc_words, scl

    if way == "hex":
        return data.hex(" ")
    return scl(data) if way == "scl" else " ".join(plc_words(data))


def _assumed(asked: RequestLine) -> Iterator[Both]:
    """What the line leaves out and a change depends on: formats that the tables know, and the drive object."""
    from ds47 import spec
    from ds47.profidrive import naming
    from ds47.report.bilingual import Both, say
    from ds47.spec import explanations

    request = asked.request
    for position in asked.taken:
        known = spec.usual(request.addresses[position].pnu)
        assert known is not None
        key = f"family_{known.family}"
        yield say(
            "encode_known_type",
            name=naming.spelling(
                known.number, known.family if known.family in spec.FAMILIES else None
            ),
            format=request.blocks[position].format_name,
            parameter=Both(known.name_en, known.name_zh),
            family=Both(explanations.words("en")[key], explanations.words("zh")[key]),
        )
    if request.blocks and not asked.axis_given:
        yield say("encode_no_axis", axis=str(request.axis))


def _remarks(request: Request) -> Iterator[Both]:
    """What was understood, where someone may have meant something else."""
    from ds47 import spec
    from ds47.model import Parameter
    from ds47.profidrive import naming
    from ds47.profidrive.model import VALUE
    from ds47.report import formatting
    from ds47.report.bilingual import Both, say

    for number, at in enumerate(request.addresses):
        item = Parameter(at.pnu, at.subindex, at.attribute_name, at.element_count)
        if request.blocks:
            block = request.blocks[number]
            item.values, item.format = block.values, block.format_name
            if len(item.values) > 1:
                yield Both.same(formatting.parameter(item, written=True))
            continue
        known = spec.usual(at.pnu)
        if at.element_count == 0 and at.attribute == VALUE and known and known.type.endswith("]"):
            yield say("encode_no_elements", name=naming.spelling(at.pnu))


def _warn_of_flaws(data: bytes, lang: str) -> None:
    """Says on stderr what a drive would not like about the request."""
    from ds47 import spec
    from ds47.profidrive import decode_request
    from ds47.report.bilingual import say

    for flaw in decode_request(data).flaws:
        rule = rule_text(spec.rules()[flaw.rule], lang)
        text = flaw_text(flaw, lang)
        severity = say(f"severity_{rule.severity}")
        warn(say("flaw_warning", rule=rule.id, severity=severity, message=text).text(lang))
