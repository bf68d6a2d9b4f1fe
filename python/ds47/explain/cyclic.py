"""What words and telegrams of cyclic frames mean: titles, parts and advice for `ds47.explain.meanings`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ds47 import spec
from ds47.cyclic.pzd import missing, signed, state
from ds47.spec import cyclic, explanations

OUT, IN, SOURCE = "out", "in", "source"
"""What the part of a telegram is: a word of the controller, one of the drive, where that was read."""
_NEAR = 4


class Said(NamedTuple):
    """What is said of a word or a telegram; each part with its value, its place, and what it says."""

    title: str
    known: bool
    parts: list[tuple[str, str, str]]
    advice: str | None
    vendor: str | None = None


def word(name: str, value: int, lang: str) -> Said:
    """A control word or a status word: its bits; of a drive the state, and what is missing to the next one."""
    words = explanations.words(lang)
    given = {"code": f"16#{value:04X}", "decimal": signed(value)}
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
    parts = [
        (str(row.bit), "", text) for row in cyclic.bits(name) if (text := row.said(value, lang))
    ]
    return Said(title, True, parts, advice)


def telegram(number: int, lang: str) -> Said:
    """A telegram by its number: whose it is, what it is for, its words both ways, and where that was read."""
    words, row = explanations.words(lang), cyclic.telegrams().get(number)
    if row is None:
        key = "unknown_telegram" if number < _OWN else "unknown_own_telegram"
        near = words["list_separator"].join(map(str, _near(number)))
        return Said(
            words[key].format(n=number), False, [], words["near_telegrams"].format(list=near)
        )
    makers = {each.id: each.name for each in spec.vendors() if each.id is not None}
    vendor = None if row.vendor is None else makers.get(row.vendor)
    key = "telegram" if vendor is None else "own_telegram"
    title = words[key].format(n=number, vendor=vendor, text=row.text(lang))
    parts = [*_words(OUT, row.out, row, lang), *_words(IN, row.inward, row, lang)]
    parts += [("", SOURCE, each) for each in row.sources]
    return Said(title, True, parts, _advice(row, lang), vendor)


_OWN = 100
"""From here on a number is its maker's."""


def _near(number: int) -> list[int]:
    """The numbers of known telegrams that are the nearest to one."""
    known = sorted(cyclic.telegrams(), key=lambda each: (abs(each - number), each))
    return sorted(known[:_NEAR])


def _words(
    side: str, names: tuple[str, ...], row: cyclic.PzdTelegram, lang: str
) -> Iterator[tuple[str, str, str]]:
    """The words of a side, each with its places: `out 2-3`; without them where these are not known."""
    first = 1
    for name in names:
        last = first + cyclic.size((name,)) // 2 - 1
        place = "" if row.unordered else f" {first}" if first == last else f" {first}-{last}"
        yield cyclic.bare(name), side + place, cyclic.telegram_word(name, lang)
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
