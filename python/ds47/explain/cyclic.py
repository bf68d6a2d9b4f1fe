"""What words and telegrams of cyclic frames mean: the control word, the status word, PKW, and telegrams."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from ds47 import spec
from ds47.cyclic.pzd import missing, signed, state
from ds47.explain.answer import CodeMeaning, CodePart, answer
from ds47.explain.forms import PKW, TELEGRAM, WORD, Reading
from ds47.spec import cyclic, explanations

OUT, IN, SOURCE = "out", "in", "source"
"""What the part of a telegram is: a word of the controller, one of the drive, where that was read."""
_NEAR = 4


def named(name: str, value: int, lang: str, vendor_id: int | None = None) -> CodeMeaning:
    """A word of cyclic frames whose name is given: the first one of PKW, or one of bits, of a drive of a maker."""
    return pkw(value, lang) if name == PKW else word(name, value, lang, vendor_id)


def word(name: str, value: int, lang: str, vendor_id: int | None = None) -> CodeMeaning:
    """A control word or a status word: its bits; of a drive the state, and what is missing to the next one."""
    words, code = explanations.words(lang), f"16#{value:04X}"
    given = {"code": code, "decimal": signed(value)}
    advice = None
    if name == "stw1":
        lacking = [row.text(lang) for row in missing(value)]
        needs = words["stw1_missing"].format(list=words["list_separator"].join(lacking))
        title = words["stw1"].format_map(given)
        advice = needs if lacking else words["stw1_complete"]
    elif name == "zsw1":
        found = state(value)
        step = cyclic.next_step(found.state, found.overlays, lang)
        shown = cyclic.state_text(found.state, found.overlays, lang)
        title = words["zsw1"].format_map(given | {"state": shown})
        advice = words["zsw1_next"].format(text=step) if step else words["zsw1_last"]
    else:
        what = cyclic.telegram_word(name.upper(), lang)
        title = words["cyclic_word"].format_map(given | {"name": name.upper(), "text": what})
    parts = tuple(
        CodePart(str(row.bit), "", text)
        for row in cyclic.bits(name, cyclic.family_of_words(vendor_id))
        if (text := row.said(value, lang))
    )
    entry = explanations.of_number(name, value) or explanations.of_unknown()
    return answer(
        name, code, f"{name} {code}", title, True, entry, lang, rank="index", parts=parts, advice=advice
    )  # fmt: skip


def telegram(number: int, lang: str) -> CodeMeaning:
    """A telegram by its number: whose it is, what it is for, its words both ways, and where that was read."""
    words, row = explanations.words(lang), cyclic.telegrams().get(number)
    if row is None:
        key = "unknown_telegram" if number < _OWN else "unknown_own_telegram"
        near = words["list_separator"].join(map(str, _near(number)))
        near = words["near_telegrams"].format(list=near)
        return _telegram(number, words[key].format(n=number), lang, advice=near)
    makers = {each.id: each.name for each in spec.vendors() if each.id is not None}
    vendor = None if row.vendor is None else makers.get(row.vendor)
    key = "telegram" if vendor is None else "own_telegram"
    title = words[key].format(n=number, vendor=vendor, text=row.text(lang))
    parts = [*_words(OUT, row.out, row, lang), *_words(IN, row.inward, row, lang)]
    parts += [CodePart("", SOURCE, each) for each in row.sources]
    return _telegram(
        number, title, lang, known=True, vendor=vendor, parts=tuple(parts), advice=_advice(row, lang),
        filter_name="telegram" if row.is_of_drive else "",
    )  # fmt: skip


def _telegram(
    number: int, title: str, lang: str, *, known: bool = False, **more: Any
) -> CodeMeaning:
    name = f"{explanations.kind_word(TELEGRAM)} {number}"
    entry = explanations.of_number(TELEGRAM, number) or explanations.of_unknown()
    return answer(
        TELEGRAM, str(number), name, title, known, entry, lang, rank="index", values={"value": str(number)}, **more
    )  # fmt: skip


_OWN = 100
"""From here on a number is its maker's."""


def _near(number: int) -> list[int]:
    """The numbers of known telegrams that are the nearest to one."""
    known = sorted(cyclic.telegrams(), key=lambda each: (abs(each - number), each))
    return sorted(known[:_NEAR])


def _words(
    side: str, names: tuple[str, ...], row: cyclic.PzdTelegram, lang: str
) -> Iterator[CodePart]:
    """The words of a side, each with its places: `out 2-3`; without them where these are not known."""
    first = 1
    for name in names:
        last = first + cyclic.size((name,)) // 2 - 1
        place = "" if row.unordered else f" {first}" if first == last else f" {first}-{last}"
        yield CodePart(cyclic.bare(name), side + place, cyclic.telegram_word(name, lang))
        first = last + 1


def _advice(row: cyclic.PzdTelegram, lang: str) -> str | None:
    """What the table lacks, and how the bits of its words are explained."""
    words = explanations.words(lang)
    if row.unordered:
        return words["telegram_unordered"]
    if not row.is_known:
        return words["telegram_free" if row.number == _FREE else "telegram_without_words"]
    first = next((each.lower() for each in (*row.out, *row.inward)), "")
    return words["telegram_bits"].format(name=first) if first in cyclic.bit_words() else None


_FREE = 999


_NEGATIVE = 0x8000
"""From this word on an INT is negative: a positive decimal number is hardly a word of bits."""
_CONTROL, _REQUESTED, _NO_OFF = 1 << 10, 1 << 9, 0b110
_NOT_EXECUTED = 7


def likely(readings: Iterable[Reading], lang: str) -> Iterator[CodeMeaning]:
    """What a word that is nothing else looks like: a control word, a status word, the first word of PKW."""
    for reading in readings:
        value = reading.value
        if reading.size != WORD or (reading.decimal and value < _NEGATIVE):
            continue
        shown = state(value)
        if value & _CONTROL and value & _NO_OFF == _NO_OFF:
            yield word("stw1", value, lang)
        if value & _REQUESTED and shown.state != "not ready" and len(shown.overlays) < len(_OFF):
            yield word("zsw1", value, lang)
        if value >> 12 == _NOT_EXECUTED and value & _PKE_NUMBER:
            yield pkw(value, lang)


_OFF = ("OFF2", "OFF3")
"""Both at once say that the drive is off, or that it is no status word."""
_PKE_NUMBER = 0x07FF


def pkw(value: int, lang: str) -> CodeMeaning:
    """The first word of PKW: what it is as an answer, and as a request."""
    words, code, ak = explanations.words(lang), f"16#{value:04X}", value >> 12
    named = {"answer": cyclic.answers()[ak].text(lang), "request": cyclic.requests()[ak].text(lang)}
    texts = {name: f"{ak}{words['bracket'].format(text=text)}" for name, text in named.items()}
    title = words["pkw"].format(code=code, number=value & _PKE_NUMBER, **texts)
    entry = explanations.of_number(PKW, value) or explanations.of_unknown()
    return answer(
        PKW, code, f"{PKW} {code}", title, True, entry, lang, rank="index",
        advice=words["pkw_page"].format(word=f"{value:04X}"),
    )  # fmt: skip
