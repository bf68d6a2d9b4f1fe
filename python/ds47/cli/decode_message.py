"""A DS47 message in words for `ds47 decode`: its bytes with what they mean, and what is wrong with it.

Here is the layout. Decoding is `ds47.library`, how values are written `ds47.report.formatting`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ds47.cli.common import flaw_text
from ds47.cli.dump import dump
from ds47.model import SIEMENS, Parameter
from ds47.profidrive import Request
from ds47.profidrive.model import VALUE
from ds47.report import formatting
from ds47.report.bilingual import say

if TYPE_CHECKING:
    from ds47.library.message import Message


def text(message: Message, lang: str, vendor_id: int | None = None) -> str:
    """The whole message, of a device of this vendor."""
    kind = say(f"decode_{message.kind}")
    lines = [say("decode_head", kind=kind, n=len(message.data)).text(lang)]
    found = sorted(rows(message, lang), key=lambda row: row[0])
    ends = [row[0] for row in found[1:]] + [len(message.data)]
    for (start, meaning), end in zip(found, ends, strict=True):
        lines += dump(message.data, start, end, meaning)
    lines += _mlen(message, SIEMENS if vendor_id is None else vendor_id, lang)
    lines += flaw_lines(message, lang)
    return "\n".join(lines) + "\n"


def _mlen(message: Message, vendor_id: int, lang: str) -> Iterator[str]:
    """Of a read what its response needs: by the list of parameters, and 4 bytes a value that is not in it."""
    from ds47.diagnosis import format_of
    from ds47.diagnosis.length import answer_need
    from ds47.spec import formats

    request = message.plain
    if not isinstance(request, Request) or request.operation != "read" or request.flaws:
        return
    if any(each.attribute != VALUE for each in request.addresses):
        return  # descriptions and texts have sizes of their own
    sizes = {
        each.pnu: None if (code := format_of(each.pnu, vendor_id)) is None else formats()[code].size
        for each in request.addresses
    }
    least, usual = (
        answer_need(request, sizes.get),
        answer_need(request, lambda pnu: sizes[pnu] or 4),
    )
    key = "decode_mlen" if least == usual else "decode_mlen_usual"
    yield say(key, least=str(least), usual=str(usual)).text(lang)


def flaw_lines(message: Message, lang: str) -> Iterator[str]:
    """What is wrong with the message."""
    from ds47 import spec

    for flaw in message.flaws:
        words = formatting.escape(flaw_text(flaw, lang))
        severity = say(f"severity_{spec.rules()[flaw.rule].severity}")
        yield say("flaw_line", rule=flaw.rule, severity=severity, message=words).text(lang)


def rows(message: Message, lang: str) -> Iterator[tuple[int, str]]:
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
    words = say(
        "decode_elements",
        parameter=formatting.address(bare),
        attribute=_attribute_words(item.attribute, lang),
        n=item.element_count or 0,
    )
    return words.text(lang)


def _attribute_words(name: str | None, lang: str) -> str | None:
    """The name of an attribute; of one that no profile has also what makers with it call it."""
    if not name or not name.startswith("0x"):
        return name
    from ds47.explain.meanings import attributes_of_makers

    return name + attributes_of_makers(lang).get(int(name, 16), "")


def _block_words(item: Parameter, written: bool, lang: str) -> str:
    words = say(
        "decode_words" if item.error else "decode_values",
        format=item.format or "Error",
        n=item.value_count or 0,
        parameter=formatting.parameter(item, written, lang),
    )
    return words.text(lang)


def _id_words(kind: str, lang: str) -> Any:
    from ds47 import spec

    table: Any = spec.request_ids() if kind == "request" else spec.response_ids()
    unknown = say("decode_unknown").text(lang)

    def show(code: int) -> str:
        known = table.get(code)
        return f"0x{code:02X} {known.name if known else unknown}"

    return show
