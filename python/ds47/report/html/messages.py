"""Sentences, error texts and names in both languages: the page shows either."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ds47 import spec
from ds47.model import Diagnosis, Finding, Parameter, ParameterError
from ds47.report.formatting import escape
from ds47.report.formatting import name as parameter_name
from ds47.report.html.texts import LANGUAGES, Both
from ds47.report.sentences import advice as rule_advice
from ds47.report.sentences import at_offset, error_words, sentence
from ds47.spec.statuses import status_text


def message(item: Finding | Diagnosis) -> Both:
    """What a finding or a diagnosis says, escaped for the eye."""
    return Both(*(escape(sentence(item, lang)) for lang in LANGUAGES))


def with_offset(finding: Finding) -> Both:
    """The same with the byte it is about in front."""
    text = message(finding)
    return Both(*(at_offset(finding.offset, text.text(lang), lang) for lang in LANGUAGES))


def rule_name(rule: str) -> str:
    """The short name of a rule, empty for one that is not in the catalogue."""
    known = spec.rules().get(rule)
    return known.name if known else ""


def cause(rule: str) -> Both:
    """What usually causes it."""
    known = spec.rules().get(rule)
    return Both(known.cause, known.cause_zh) if known else Both("", "")


def advice(rule: str, args: Mapping[str, Any] | None = None) -> Both:
    """What to do."""
    known = spec.rules().get(rule)
    if known is None:
        return Both("", "")
    return Both.of(rule_advice, known, args or {})


def error(item: ParameterError) -> Both:
    """The error number of a drive in words."""
    return Both(*(escape(error_words(item, lang)) for lang in LANGUAGES))


def status(word: int) -> Both:
    """A PNIO status in words."""
    return Both.of(status_text, word)


def name(item: Parameter) -> Both:
    """The name of a parameter, in quotes as the drive calls it; empty where it has none."""
    return Both.of(parameter_name, item)
