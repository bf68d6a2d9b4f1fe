"""Messages, error texts and names in both languages, though an analysis speaks only one.

A message was made from a template of the catalogue: the template gives the values back, and the
template of the other language takes them. Where that fails, the message stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache, lru_cache

from ds47 import spec
from ds47.model import Diagnosis, Finding, Parameter
from ds47.profinet.status import status_text
from ds47.report import at_offset
from ds47.report.html.texts import LANGUAGES, Both
from ds47.report.words import escape
from ds47.spec.semantics import diagnosis_words, reasons

_FIELD = re.compile(r"\{(\w+)\}")
_WORDED = ("what", "place", "other")
"""Values of a message that are filled with words of diagnoses.toml."""


def message(finding: Finding, lang: str, vendor_id: int | None = None) -> Both:
    """The message of a finding in both languages, escaped for the eye."""
    return _translated(finding.rule, escape(finding.message), lang, vendor_id)


def diagnosis(item: Diagnosis, lang: str, vendor_id: int | None = None) -> Both:
    """The message of a diagnosis in both languages, escaped for the eye."""
    return _translated(item.rule, escape(item.message), lang, vendor_id)


def with_offset(finding: Finding, lang: str, vendor_id: int | None = None) -> Both:
    """The same with the byte it is about in front."""
    text = message(finding, lang, vendor_id)
    if finding.offset is None:
        return text
    return Both(at_offset(finding.offset, text.en), at_offset(finding.offset, text.zh))


def values(finding: Finding, lang: str) -> dict[str, str]:
    """The values that stand in the message of a finding, by their names in the template."""
    pattern = _patterns(finding.rule, lang)
    found = pattern.fullmatch(finding.message) if pattern else None
    return found.groupdict() if found else {}


@lru_cache(maxsize=4096)
def _translated(rule: str, text: str, lang: str, vendor_id: int | None) -> Both:
    return Both(
        *(text if each == lang else _other(rule, text, lang, each, vendor_id) for each in LANGUAGES)
    )


def _other(rule: str, text: str, lang: str, other: str, vendor_id: int | None) -> str:
    patterns = _patterns(rule, lang)
    found = patterns.fullmatch(text) if patterns else None
    if found is None:
        return text
    values = found.groupdict()
    words = {
        key: _word(key, value, values, lang, other, vendor_id) for key, value in values.items()
    }
    template = _template(rule, other)
    return template.format_map(words) if template else text


def _word(
    key: str, value: str, values: Mapping[str, str], lang: str, other: str, vendor_id: int | None
) -> str:
    """One value of a message in another language: most have none."""
    if key == "reason":
        now, then = reasons(lang), reasons(other)
        return "; ".join(
            next((then[name] for name, words in now.items() if words == part), part)
            for part in value.split("; ")
        )
    if key in _WORDED:
        return _diagnosis_word(value, lang, other)
    if key == "text" and _hex(values.get("status")) is not None:
        return status_text(_hex(values["status"]) or 0, other)
    if key == "text" and _hex(values.get("code")) is not None:
        return spec.error_text(_hex(values["code"]) or 0, other, vendor_id)
    return value


def _diagnosis_word(text: str, lang: str, other: str) -> str:
    """A place, or a part of a request or of a capture, that a diagnosis names."""
    then = diagnosis_words(other)
    for name, words in diagnosis_words(lang).items():
        found = _pattern(words).fullmatch(text)
        if found is not None:
            return then[name].format_map(found.groupdict())
    return text


def _hex(text: str | None) -> int | None:
    try:
        return int(text or "", 16)
    except ValueError:
        return None


@cache
def _patterns(rule: str, lang: str) -> re.Pattern[str] | None:
    template = _template(rule, lang)
    return _pattern(template) if template else None


@cache
def _pattern(template: str) -> re.Pattern[str]:
    """What finds the values in a text that was made from a template."""
    parts = _FIELD.split(template)
    seen: set[str] = set()
    pattern = ""
    for number, part in enumerate(parts):
        if number % 2 == 0:
            pattern += re.escape(part)
        else:
            pattern += f"(?P={part})" if part in seen else f"(?P<{part}>.*?)"
            seen.add(part)
    return re.compile(pattern, re.DOTALL)


def _template(rule: str, lang: str) -> str | None:
    known = spec.rules().get(rule)
    if known is None:
        return None
    return known.message_zh if lang == "zh" else known.message


def rule_name(rule: str) -> str:
    """The short name of a rule, empty for one that is not in the catalogue."""
    known = spec.rules().get(rule)
    return known.name if known else ""


def cause(rule: str) -> Both:
    """What usually causes it."""
    known = spec.rules().get(rule)
    return Both(known.cause, known.cause_zh) if known else Both("", "")


def advice(rule: str) -> Both:
    """What to do."""
    known = spec.rules().get(rule)
    return Both(known.advice, known.advice_zh) if known else Both("", "")


def error(code: int | None, text: str, vendor_id: int | None) -> Both:
    """The error number of a drive in words."""
    if code is None:
        return Both.same(escape(text))
    return Both(*(escape(spec.error_text(code, lang, vendor_id)) for lang in LANGUAGES))


def status(word: int) -> Both:
    """A PNIO status in words."""
    return Both(*(status_text(word, lang) for lang in LANGUAGES))


def name(item: Parameter) -> Both:
    """The name of a well-known parameter; empty for any other."""
    if not item.name:
        return Both("", "")
    known = spec.parameters().get(item.pnu) if item.pnu is not None else None
    if known is None or item.name not in (known.name_en, known.name_zh):
        return Both.same(escape(item.name))
    return Both(known.name_en, known.name_zh or known.name_en)
