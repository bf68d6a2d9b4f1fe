"""What `ds47 params` says of parameters and messages: each thing that is known, with where it is from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import NamedTuple

from ds47 import spec
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedMessage, ListedParameter, ParameterList
from ds47.profidrive.naming import WRITABLE, spelled
from ds47.report.bilingual import LANGUAGES, say
from ds47.report.formatting import escape
from ds47.spec import explanations

_MOST = 200
"""Parameters that a search finds; of more the first ones."""


class SourceEntry(NamedTuple):
    """What one source says of a parameter, or of a message (`letter` and `number` are then those of the fault).

    `source` is in words; `values` are texts of values.
    """

    kind: str
    letter: str | None
    number: int
    name: str
    unit: str | None
    type: str | None
    values: dict[str, str]
    source: str


def known(text: str, catalogue: Catalogue, lang: str = "en") -> list[SourceEntry]:
    """All that is known under a number (`2900`, `r0945`, `F07900`) or a word of a name."""
    number = spelled(text)
    if number is not None:
        return [*_shipped(number.number, lang), *listed(text, catalogue, lang)]
    if _is_message(text):
        return listed(text, catalogue, lang)
    return list(_search(text, catalogue, lang))


def listed(text: str, catalogue: Catalogue, lang: str = "en") -> list[SourceEntry]:
    """What lists say of a parameter (`2900`, `r0945`) or a message (`F07900`); nothing of any other text."""
    number = spelled(text)
    if number is not None:
        return list(_of_lists(catalogue, number.number, lang))
    if not _is_message(text):
        return []
    texts = catalogue.messages(int(text[1:]), text[0].upper())
    return [_message(each, found, lang) for each, found in texts]


def messages(number: int, catalogue: Catalogue, lang: str = "en") -> list[SourceEntry]:
    """What lists say of a number as that of a fault or an alarm."""
    return [_message(each, found, lang) for each, found in catalogue.messages(number)]


def _is_message(text: str) -> bool:
    digits = text[1:].strip()
    return text[:1].upper() in ("F", "A", "C", "N") and digits.isdecimal() and len(digits) <= 6


def _shipped(number: int, lang: str) -> Iterator[SourceEntry]:
    """What the tables say of a number, on each family of drives."""
    sources = spec.parameter_sources()
    for row in spec.of_families(number):
        name, texts = row.name_en, row.values_en
        if lang == "zh":
            name, texts = row.name_zh, row.values_zh
        source = explanations.words(lang)[f"family_{row.family}"]
        source = "; ".join((source, *(sources[each] for each in row.sources)))
        values = {str(value): text for value, text in texts.items()}
        kind = None if row.type == "unknown" else row.type
        letter = WRITABLE.get(row.family, row.access) if row.access == "p" else row.access
        yield SourceEntry("parameter", letter, number, name, row.unit, kind, values, source)


def _of_lists(catalogue: Catalogue, number: int, lang: str) -> Iterator[SourceEntry]:
    for row, found in catalogue.entries(number):
        yield _parameter(row, found, lang)


def _parameter(row: ListedParameter, found: ParameterList, lang: str) -> SourceEntry:
    values = {str(number): text for number, text in sorted(row.values.items())}
    source = say("params_of_list", name=escape(found.name), about=about(found, lang)).text(lang)
    return SourceEntry(
        "parameter", row.access, row.number, row.name, row.unit, row.type, values, source
    )


def _message(each: ListedMessage, found: ParameterList, lang: str) -> SourceEntry:
    source = say("params_of_list", name=escape(found.name), about=about(found, lang)).text(lang)
    return SourceEntry("message", each.letter, each.number, each.text, None, None, {}, source)


def _letters(text: str) -> str:
    """A text without blanks and hyphens: `ramp-up time` is `ramp up time` and `rampup time`."""
    return "".join(each for each in text.casefold() if each.isalnum())


def _search(text: str, catalogue: Catalogue, lang: str) -> Iterator[SourceEntry]:
    """Parameters with a word in their names, in any language: who reads Chinese knows `ramp`, too."""
    wanted = _letters(text)
    numbers = sorted({*spec.parameters(), *catalogue.numbers()})
    all_ = (
        forms
        for number in numbers
        for forms in (
            *zip(*(_shipped(number, each) for each in (lang, *LANGUAGES)), strict=True),
            *((each,) for each in _of_lists(catalogue, number, lang)),
        )
    )
    found = (forms[0] for forms in all_ if any(wanted in _letters(each.name) for each in forms))
    yield from islice(found, _MOST)


def about(found: ParameterList, lang: str) -> str:
    """Which devices a list is for: `vendor 0x002A, device 0x0501, firmware 4.7, from g120.csv`."""
    parts = []
    if found.vendor_id is not None:
        parts.append(say("params_vendor", id=f"0x{found.vendor_id:04X}"))
    if found.device_ids:
        parts.append(
            say("params_device", ids=", ".join(f"0x{each:04X}" for each in found.device_ids))
        )
    if found.firmware:
        parts.append(say("params_firmware", version=escape(found.firmware)))
    if found.source:
        parts.append(say("params_from", file=escape(found.source)))
    return ", ".join(each.text(lang) for each in parts) or say("params_any").text(lang)


def heading(each: SourceEntry) -> str:
    """Number, name, type and unit: `p1120  Ramp-function generator, ramp-up time  (Float32, s)`."""
    number = (
        f"{each.letter}{each.number:05}"
        if each.kind == "message"
        else f"{each.letter or 'p'}{each.number:04}"
    )
    about_ = ", ".join(
        part for part in (each.type, escape(each.unit) if each.unit else None) if part
    )
    return f"{number}  {escape(each.name)}{f'  ({about_})' if about_ else ''}"


def lines(all_: Iterable[SourceEntry]) -> Iterator[str]:
    """Each of them: number, name, type and unit, then texts of values, then where it is from."""
    for each in all_:
        yield heading(each)
        yield from (f"      {value} = {escape(text)}" for value, text in each.values.items())
        yield f"      {each.source}"
