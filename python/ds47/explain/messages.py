"""What a fault or an alarm of a drive means: those of the bus are in explain.toml, all others in no table."""

from __future__ import annotations

from ds47.explain.answer import CodeMeaning, answer
from ds47.explain.forms import FAULT, MESSAGES
from ds47.spec import explanations

_FIVE_DIGITS = 1000
"""From this number on faults and alarms are those of SINAMICS, which has five digits; MICROMASTER 4 has four."""


def meaning(kind: str, number: int, lang: str) -> CodeMeaning:
    """A fault or an alarm; where nothing else is known of it, where to look it up."""
    words, entry = explanations.words(lang), explanations.of_number(kind, number)
    assert entry is not None
    letter = next(letter for letter, each in MESSAGES.items() if each == kind)
    code = f"{letter}{number:0{4 if number < _FIVE_DIGITS else 5}d}"
    title = words["fault"].format(
        code=code, decimal=number, hex=f"{number:04X}", text=entry.headline(lang)
    )
    return answer(
        kind, code, f"{explanations.kind_word(kind)} {number}", title, True, entry, lang, rank=FAULT,
        filter_name=entry.filter, values={"value": "945" if kind == FAULT else "2122"},
        advice=None if entry.causes else words["fault_advice"].format(code=code),
    )  # fmt: skip
