"""`ds47 decode --as s7`: a PDU of S7 in words or as JSON.

Here: the layout. Decoding is `ds47.s7`, the words for it `ds47.report.s7_pdu`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ds47.cli.dump import dump

if TYPE_CHECKING:
    from ds47.report.s7_pdu import Decoded

S7 = "s7"
"""What --as takes."""


def s7_words(data: bytes, format_name: str, lang: str) -> str:
    """The PDU, as text or as JSON."""
    from ds47.report import s7_pdu

    found = s7_pdu.decode(data)
    if format_name == "json":
        from ds47.report.json import text

        return text(s7_pdu.document(found)) + "\n"
    return "\n".join(_lines(found, lang)) + "\n"


def _lines(found: Decoded, lang: str) -> Iterator[str]:
    from ds47.report import s7_pdu
    from ds47.report.bilingual import say

    yield say("decode_head", kind=s7_pdu.headline(found), n=len(found.data)).text(lang)
    rows = [(at, words.text(lang)) for at, words in s7_pdu.lines(found)]
    rows = rows or [(0, say("decode_rest").text(lang))]
    ends = [at for at, _ in rows[1:]] + [len(found.data)]
    for (at, meaning), end in zip(rows, ends, strict=True):
        yield from dump(found.data, at, end, meaning)
    for each in found.flaws:
        yield say("dp_flaw", offset=str(each.offset), text=s7_pdu.flaw(each)).text(lang)
