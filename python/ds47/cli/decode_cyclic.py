"""`ds47 decode --as pkw`, pkw-answer, stw1, zsw1, ppo1-out, ppo1-in: the words of cyclic frames.

Here: how many bytes there have to be, and the layout. What they mean is `ds47.cyclic`, the words for it
`ds47.report.cyclic`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click

from ds47.cli.dump import dump

CYCLIC = ("pkw", "pkw-answer", "stw1", "zsw1", "ppo1-out", "ppo1-in")
"""What --as takes beside the messages of DS47."""
_LENGTHS = {
    "pkw": (8,), "pkw-answer": (8,), "stw1": (2, 4), "zsw1": (2, 4), "ppo1-out": (12,), "ppo1-in": (12,),
}  # fmt: skip
_PKW = {"pkw": False, "pkw-answer": True, "ppo1-out": False, "ppo1-in": True}
_PZD = {"stw1": "stw1", "zsw1": "zsw1", "ppo1-out": "stw1", "ppo1-in": "zsw1"}


def cyclic_words(
    data: bytes,
    kind: str,
    layout: str,
    format_name: str,
    lang: str,
    vendor_id: int | None = None,
) -> str:
    """What the words mean, as text or as JSON; `vendor_id`: the maker of the error numbers of PKW."""
    wanted = _LENGTHS[kind]
    if len(data) not in wanted:
        several = " or ".join(map(str, wanted))
        raise click.UsageError(f"--as {kind} takes {several} bytes, and here are {len(data)}")
    if format_name == "json":
        from ds47.report.json import text

        return text(_document(data, kind, layout, vendor_id)) + "\n"
    return "\n".join(_lines(data, kind, layout, lang, vendor_id)) + "\n"


def _parts(data: bytes, kind: str) -> tuple[bytes, int, bytes]:
    """The PKW words, where the PZD words begin, and those."""
    start = 8 if kind in _PKW else 0
    return data[:start], start, data[start:]


def _document(data: bytes, kind: str, layout: str, vendor_id: int | None) -> dict[str, Any]:
    from ds47.cyclic.pkw import decode
    from ds47.cyclic.pzd import percent
    from ds47.report import cyclic
    from ds47.spec.pkw_layouts import maker_layouts

    first, _, words = _parts(data, kind)
    if first and layout in maker_layouts():
        found = cyclic.own_document(first, _PKW[kind], layout)
    else:
        found = cyclic.pkw_document(decode(first, _PKW[kind], layout), vendor_id) if first else {}
    if not words:
        return found
    name = _PZD[kind]
    shown = cyclic.word_document(name, int.from_bytes(words[:2]))
    if len(words) == cyclic.PZD_LENGTH:
        key = "setpoint_percent" if name == "stw1" else "actual_percent"
        shown[key] = round(percent(int.from_bytes(words[2:])), 6)
    return {"pkw": found, "pzd": shown} if first else shown


def _lines(data: bytes, kind: str, layout: str, lang: str, vendor_id: int | None) -> Iterator[str]:
    from ds47.cyclic.pkw import decode
    from ds47.report import cyclic
    from ds47.report.bilingual import say
    from ds47.spec.pkw_layouts import maker_layouts

    first, start, words = _parts(data, kind)
    yield say("decode_head", kind=say(f"decode_{kind}"), n=len(data)).text(lang)
    if first:
        if layout in maker_layouts():
            rows = list(cyclic.own_lines(first, _PKW[kind], layout))
        else:
            rows = list(cyclic.pkw_lines(decode(first, _PKW[kind], layout), vendor_id))
        ends = [row[0] for row in rows[1:]] + [len(first)]
        for (at, meaning), end in zip(rows, ends, strict=True):
            yield from dump(data, at, end, meaning.text(lang))
    if not words:
        return
    name, word = _PZD[kind], int.from_bytes(words[:2])
    lines = [each.text(lang) for each in cyclic.word_lines(name, word)]
    yield from dump(data, start, start + 2, lines[0])
    if len(words) == cyclic.PZD_LENGTH:
        raw = int.from_bytes(words[2:])
        yield from dump(data, start + 2, start + 4, cyclic.scaled(name, word, raw).text(lang))
    yield from lines[1:]
