"""Words of the text report: numbers, values and addresses as a person reads them.

Also used by the text output of `ds47 decode`. `lang` is "en" or "zh". Layout lives in `ds47.report.text`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from ds47.model import Parameter, ParameterError, Value
from ds47.profidrive.formats import codec
from ds47.profidrive.naming import spelling
from ds47.report import descriptions, is_text
from ds47.report import values as meanings
from ds47.report.bilingual import Both, say, say_in
from ds47.report.escaping import escape as escape
from ds47.report.escaping import quoted
from ds47.report.sentences import error_words
from ds47.report.sentences import name as parameter_name
from ds47.spec import format_named

VALUES_SHOWN = 8
"""A longer list of values is cut, and its length given."""


def count(number: int, noun: str) -> str:
    """`1 frame`, `4 frames`, `12,000 frames`."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def duration(nanoseconds: int) -> str:
    """A duration in a suitable unit: `0.412 ms`, `12.4 ms`, `1.23 s`, `12.3 s`."""
    milliseconds = nanoseconds / 1e6
    if abs(milliseconds) >= 1_000:
        return f"{milliseconds / 1000:.{1 if abs(milliseconds) >= 10_000 else 2}f} s"
    return f"{milliseconds:.3f} ms" if abs(milliseconds) < 1 else f"{milliseconds:.1f} ms"


def address(item: Parameter) -> str:
    """`p50303[0]`, `r2902[2..5]`, `P0700[0]`, `r0944[0].text`; `p?` if no request names it."""
    if item.pnu is None:
        return "p?"
    first, elements = item.subindex, item.element_count or 0
    index = "" if first is None else f"[{first}]"
    if first is not None and elements > 1:
        index = f"[{first}..{first + elements - 1}]"
    attribute = "" if item.attribute in (None, "value") else f".{item.attribute}"
    return f"{spelling(item.pnu, item.family)}{index}{attribute}"


def value(item: Value, format_name: str | None) -> str:
    """One value; text from the drive in quotes."""
    if isinstance(item, str):
        return quoted(item) if is_text(format_name) else escape(item)
    return str(item)


def both_sides(
    old: Value | None, old_format: str | None, new: Value | None, new_format: str | None
) -> tuple[str, str]:
    """A value before and after a change, in one format where that can be: `40.0`, `45.5 (DoubleWord 1110835200)`.

    A bit string is shown as the other side reads its bits. Between a floating-point number and another format of
    its own, both formats are named. A side that is not known is `?`.
    """
    given = ((old, old_format), (new, new_format))
    sides = ["?" if each is None else value(each, of) for each, of in given]
    if old is None or new is None or not old_format or not new_format or old_format == new_format:
        return sides[0], sides[1]
    for at, bits, of, other in ((1, new, new_format, old_format), (0, old, old_format, new_format)):
        same = _read_as(bits, of, other)
        if same is not None:
            shown = value(same, other)
            sides[at] = shown if shown == sides[at] else f"{shown} ({of} {sides[at]})"
            return sides[0], sides[1]
    if isinstance(old, float) is not isinstance(new, float):
        return f"{sides[0]} ({old_format})", f"{sides[1]} ({new_format})"
    return sides[0], sides[1]


_BIT_STRINGS = ("Byte", "Word", "DoubleWord")


def _read_as(bits: Value, of: str, other: str) -> Value | None:
    """A bit string in a format with a type; None where it is not one, or has another length."""
    rows = format_named(of), format_named(other)
    if of not in _BIT_STRINGS or other in _BIT_STRINGS or None in rows:
        return None
    here, there = (codec(row.code) for row in rows if row is not None)
    if here is None or there is None or here.size != there.size or there.whole:
        return None
    return there.decode(here.encode([bits]), 1)[0]


def values(
    items: Sequence[Value], format_name: str | None, lang: str = "en", stated: int = 0
) -> str:
    """A list of values, shortened if it is long or its record is cut: `1, 2, 3, ... (40 values)`."""
    first = items[:VALUES_SHOWN]
    texts = (
        [value(each, format_name) for each in first] if str in map(type, first) else map(str, first)
    )
    shown, many = ", ".join(texts), max(len(items), stated)
    if many <= min(len(items), VALUES_SHOWN):
        return shown
    return say_in(lang, "values_cut", values=shown, n=many)


def error(item: ParameterError, lang: str = "en") -> str:
    """`error 0x11: request cannot be executed (info 3)`."""
    shown = say("parameter_error")
    if item.number is not None:
        shown = shown.joined(Both.same(item.number), zh=" ")
    if text := error_words(item, lang):
        shown = shown.joined(Both.same(escape(text)), ": ", "：")
    if item.info:
        shown = shown.joined(say("parameter_error_info", info=str(item.info)))
    return shown.text(lang)


def name(item: Parameter, lang: str = "en") -> str | None:
    """`Maximum speed`; a name from the drive in quotes, `"Max_frequency"`; None without a name."""
    found, said = parameter_name(item, lang), item.described
    if found is None or said is None or said.name is None:
        return found
    return quoted(found) if said.frames else escape(found)


def parameter(item: Parameter, written: bool, lang: str = "en") -> str:
    """A parameter with its values or error: `p50303[0] = 10.0`, with `:=` if it was written."""
    known = meanings.about(item)
    shown = _shown(item, known, lang)
    given = f" {':=' if written else '='} {shown}" if shown else ""
    failed = f" {error(item.error, lang)}" if item.error else ""
    return f"{_called(known, lang)}{given}{failed}"


@lru_cache(maxsize=4096)
def _called(known: tuple[Any, ...], lang: str) -> str:
    """Its address, and its name in brackets if it has one."""
    item = meanings.of_kind(known)
    called = name(item, lang)
    return f"{address(item)} ({called})" if called else address(item)


def _shown(item: Parameter, known: tuple[Any, ...], lang: str) -> str:
    """Values with their unit, or the description they form; empty without values."""
    if item.attribute != "value" and (described := descriptions.words(item)) is not None:
        return described.text(lang)
    if not item.values:
        return ""
    unit = f" {escape(item.unit)}" if item.unit else ""
    scaled = f" ({values(item.scaled, item.format, lang)}{unit})" if item.scaled else unit
    meant = meanings.meaning(item) if meanings.may_mean(known, bool(item.value_texts)) else None
    shown = values(item.values, item.format, lang, descriptions.stated(item)) + scaled
    return shown if meant is None else say_in(lang, "parameter_meant", value=shown, text=meant)
