"""PKW and PZD words for people and for JSON: what stands at which byte, and what it means.

Of single messages, as `ds47 decode` shows them. Decoding is `ds47.cyclic`; what a capture shows of a
channel is not here.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from ds47.cyclic import pkw, pzd
from ds47.model import Parameter
from ds47.report import formatting
from ds47.report.bilingual import Both, say
from ds47.spec import cyclic
from ds47.spec.pkw_layouts import MakerLayout, maker_layouts

Line = tuple[int, Both]
"""Where something stands, and what it means."""
PZD_LENGTH = 4
"""Control or status word, and setpoint or actual value."""


def pkw_document(item: pkw.PkwMessage, vendor_id: int | None = None) -> dict[str, Any]:
    """A PKW request or answer for JSON."""
    error, connector = item.error, item.connector
    return {
        "ak": item.ak,
        "meaning": cyclic.meaning(item.ak, item.answer),
        "spm": item.spm,
        "pnu": item.pnu,
        "subindex": item.subindex,
        "layout": item.layout,
        "pwe1": item.pwe1,
        "pwe2": item.pwe2,
        "value": item.value,
        "error": None if error is None else _error_document(error, vendor_id),
        "connector": None if connector is None else {"pnu": connector[0], "index": connector[1]},
    }


def _error_document(error: pkw.Error, vendor_id: int | None) -> dict[str, Any]:
    text = None if error.code is None else cyclic.error_text(error.code, "en", vendor_id)
    return {"code": error.code, "text": text}


def pkw_lines(item: pkw.PkwMessage, vendor_id: int | None = None) -> Iterator[Line]:
    """The four words in words."""
    meaning = Both.of(cyclic.meaning, item.ak, item.answer)
    yield 0, say("pkw_pke", ak=str(item.ak), meaning=meaning, spm=str(item.spm))
    known = item.pnu is not None
    name = formatting.address(Parameter(item.pnu, item.subindex, "value", 1)) if known else "?"
    key = "pkw_ind" if item.fits_layout else "pkw_ind_odd"
    yield 2, say(key, parameter=name, page=f"{item.page:02X}", layout=item.layout)
    yield 4, _pwe(item, vendor_id)


def own_document(data: bytes, answer: bool, layout: str) -> dict[str, Any]:
    """PKW in a layout of a maker for JSON."""
    own, operation, group, index, value = _own(data, layout)
    what = (own.answers if answer else own.requests).get(operation)
    error = own.errors.get(value) if answer and what == "failed" else None
    return {
        "operation": operation, "meaning": what, "group": group, "index": index, "layout": layout,
        "value": None if answer and what == "failed" else value,
        "error": {"code": value, "text": error.en if error else None} if answer and what == "failed" else None,
    }  # fmt: skip


def own_lines(data: bytes, answer: bool, layout: str) -> Iterator[Line]:
    """The four words in words, in a layout of a maker."""
    own, operation, group, index, value = _own(data, layout)
    what = (own.answers if answer else own.requests).get(operation, "unknown")
    yield 0, say("pkw_own_operation", code=str(operation), what=say(f"pkw_own_{what}"))
    parameter = {"group": f"{group:02X}", "index": f"{index:02X}"}
    yield 2, say("pkw_own_parameter", **parameter, layout=layout, maker=own.maker)
    error = own.errors.get(value)
    if not (answer and what == "failed"):
        yield 4, say("pkw_own_value", value=str(value), hex=f"{value:04X}")
    elif error is None:
        yield 4, say("pkw_own_error_unknown", code=str(value), maker=own.maker)
    else:
        yield 4, say("pkw_own_error", code=str(value), text=Both(error.en, error.zh))


def _own(data: bytes, layout: str) -> tuple[MakerLayout, int, int, int, int]:
    own, words = maker_layouts()[layout], struct.unpack(">4H", data)
    return own, own.operation.of(words), own.group.of(words), own.number.of(words), words[3]


def _pwe(item: pkw.PkwMessage, vendor_id: int | None) -> Both:
    hexadecimal = f"{item.pwe1:04X}_{item.pwe2:04X}"
    if item.error is not None:
        if item.ak == pkw.NO_RIGHTS:
            return say("pkw_no_rights", hex=hexadecimal)
        code = item.error.code
        if code is None:
            return say("pkw_no_error", hex=hexadecimal)
        text = Both.of(lambda lang: cyclic.error_text(code, lang, vendor_id))
        return say("pkw_error", code=str(code), text=text, hex=hexadecimal)
    if item.connector is not None:
        pnu, index = item.connector
        return say("pkw_connector", parameter=f"r{pnu:04}", index=str(index), hex=hexadecimal)
    if item.value is None:
        return say("pkw_no_value", hex=hexadecimal)
    return say("pkw_value", value=formatting.value(item.value, None), hex=hexadecimal)


def word_document(name: str, word: int, family: str | None = None) -> dict[str, Any]:
    """STW1 or ZSW1 for JSON: the bits, and what the drive is in or waits for."""
    bits = [
        {"bit": row.bit, "value": word >> row.bit & 1, "text": row.said(word) or None}
        for row in cyclic.bits(name, family)
    ]
    document = {
        "word": name.upper(),
        "hex": f"{word:04X}",
        "signed": pzd.signed(word),
        "bits": bits,
    }
    if name == "stw1":
        return document | {"missing": [row.en for row in pzd.missing(word)]}
    found = pzd.state(word)
    step = cyclic.next_step(found.state, found.overlays)
    beside = list(found.overlays)
    return document | {"state": found.state, "overlays": beside, "next": step or None}


def word_lines(name: str, word: int, family: str | None = None) -> Iterator[Both]:
    """STW1 or ZSW1 in words: the whole, each bit that says something, and what is missing."""
    yield headline(name, word)
    for row in cyclic.bits(name, family):
        value = word >> row.bit & 1
        words = Both.of(row.said, word)
        if words.en:
            yield say("pzd_bit", bit=f"{row.bit:>2}", value=str(value), text=words)
    lacking = needs(name, word)
    if lacking.en:
        yield lacking


def headline(name: str, word: int) -> Both:
    """`STW1 16#047F = 1151`, and of a status word the state."""
    plain = say("pzd_word", name=name.upper(), hex=f"{word:04X}", number=str(pzd.signed(word)))
    if name == "stw1":
        return plain
    found = pzd.state(word)
    words = Both.of(cyclic.state_text, found.state, found.overlays)
    return plain.joined(words, ": ", "：")


def needs(name: str, word: int) -> Both:
    """What is missing to the next state, empty where nothing is."""
    if name == "stw1":
        rows = pzd.missing(word)
        lists = Both(", ".join(row.en for row in rows), "、".join(row.zh for row in rows))
        return say("pzd_missing", text=lists) if rows else say("pzd_complete")
    found = pzd.state(word)
    step = Both.of(cyclic.next_step, found.state, found.overlays)
    return say("pzd_next", text=step) if step.en else Both.same("")


def scaled(name: str, word: int, raw: int, family: str | None = None) -> Both:
    """The setpoint behind a control word, or the actual value behind a status word, in percent of p2000."""
    percent = f"{pzd.percent(raw):.6g}"
    key = "pzd_setpoint" if name == "stw1" else "pzd_actual"
    if name == "stw1" and pzd.turns(word, family == cyclic.OTHERS):
        key = "pzd_setpoint_reversed"
    return say(key, percent=percent, hex=f"{raw:04X}", number=str(pzd.signed(raw)))
