"""`ds47 decode --as profibus`: frames of PROFIBUS DP in words or as JSON, with the DS47 messages inside.

Here: the layout, and which record is a message. Decoding is `ds47.profibus`, the words for it
`ds47.report.profibus`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ds47.cli.decode_message import flaw_lines, rows
from ds47.cli.dump import dump

if TYPE_CHECKING:
    from ds47.library.message import Message
    from ds47.profibus.stream import LinePiece
    from ds47.profibus.telegram import Telegram
    from ds47.profidrive import Options

PROFIBUS = "profibus"
"""What --as takes."""


def profibus_words(data: bytes, format_name: str, options: Options, lang: str) -> str:
    """The frames and what is between them, as text or as JSON."""
    from ds47.profibus.stream import split

    pieces = split(data)
    if format_name == "json":
        from ds47.report.json import text

        return text({"telegrams": [_document(piece, options) for piece in pieces]}) + "\n"
    parts = ["\n".join(_lines(piece, options, lang)) + "\n" for piece in pieces]
    return "\n".join(parts)


def _record(item: Telegram, options: Options) -> Message | None:
    """The DS47 message that a frame carries: what a write brings, or what a read answers."""
    from ds47.acyclic.index47 import SHARED_INDEX
    from ds47.library.message import decode_request, decode_response
    from ds47.profibus import ms1
    from ds47.report import profibus as shown

    found = shown.record(item)
    if found is None or found.index != SHARED_INDEX or not found.data:
        return None
    if found.kind == ms1.REQUEST and found.code == ms1.WRITE:
        return decode_request(found.data, options)
    if found.kind == ms1.ANSWER and found.code == ms1.READ:
        return decode_response(found.data, None, options)
    return None


def _document(piece: LinePiece, options: Options) -> dict[str, Any]:
    from ds47.report import profibus as shown

    item = piece.telegram
    found: dict[str, Any] = {"offset": piece.offset, "hex": item.data.hex(), **shown.document(item)}
    if found["ms1"] is not None:
        message = _record(item, options)
        found["ms1"]["ds47"] = None if message is None else message.to_dict()
    return found


def _lines(piece: LinePiece, options: Options, lang: str) -> Iterator[str]:
    from ds47.report import profibus as shown
    from ds47.report.bilingual import say

    item = piece.telegram
    head = say("decode_head", kind=shown.headline(item), n=len(item.data))
    yield (
        head.text(lang)
        if not piece.offset
        else say("dp_at", offset=str(piece.offset), text=head).text(lang)
    )
    message = _record(item, options)
    found = [(at, text.text(lang)) for at, text in shown.lines(item)]
    if message is not None:
        start = shown.record_start(item)
        inside = sorted((start + at, text) for at, text in rows(message, lang))
        found = sorted([row for row in found if row[0] != start] + inside, key=lambda row: row[0])
    ends = [row[0] for row in found[1:]] + [len(item.data)]
    for (at, meaning), end in zip(found, ends, strict=True):
        yield from dump(item.data, at, end, meaning)
    yield from (text.text(lang) for text in shown.beside(item))
    for line in flaw_lines(message, lang) if message is not None else ():
        yield say("dp_record_flaw", text=line).text(lang)
