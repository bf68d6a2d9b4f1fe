"""Words of cyclic frames: the control word, the status word, and the first word of PKW."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ds47.cyclic.pzd import missing, signed, state
from ds47.explain.answer import CodeMeaning, CodePart, answer
from ds47.explain.forms import PKW, WORD, Reading
from ds47.spec import cyclic, explanations


def cyclic_word(name: str, value: int, lang: str) -> CodeMeaning:
    """The control word or the status word: its bits, the state, and what is missing to the next one."""
    words = explanations.words(lang)
    code = f"16#{value:04X}"
    if name == "stw1":
        lacking = [row.zh if lang == "zh" else row.en for row in missing(value)]
        needs = words["stw1_missing"].format(list=words["list_separator"].join(lacking))
        title = words["stw1"].format(code=code, decimal=signed(value))
        advice = needs if lacking else words["stw1_complete"]
    else:
        found = state(value)
        step = cyclic.next_step(found.state, found.overlays, lang)
        shown = cyclic.state_text(found.state, found.overlays, lang)
        title = words["zsw1"].format(code=code, decimal=signed(value), state=shown)
        advice = words["zsw1_next"].format(text=step) if step else words["zsw1_last"]
    parts = tuple(
        CodePart(str(row.bit), "", text)
        for row in cyclic.bits(name)
        if (text := row.said(value, lang))
    )
    entry = explanations.of_number(name, value) or explanations.of_unknown()
    return answer(
        name, code, f"{name} {code}", title, True, entry, lang, rank="index", parts=parts, advice=advice
    )  # fmt: skip


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
            yield cyclic_word("stw1", value, lang)
        if value & _REQUESTED and shown.state != "not ready" and len(shown.overlays) < len(_OFF):
            yield cyclic_word("zsw1", value, lang)
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
