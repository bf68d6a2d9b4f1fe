"""What a fault or an alarm of a drive means, and the classes of them that the diagnosis of a drive has.

Those of the bus are in explain.toml, and the classes; all others in no table.
"""

from __future__ import annotations

from collections.abc import Iterator

from ds47.explain.answer import CodeMeaning, answer
from ds47.explain.forms import FAULT, MESSAGES
from ds47.spec import explanations

CLASS = "message_class"
_FIRST_CLASS = 0x8FFF
"""What is added to the number of a message class."""
_FIVE_DIGITS = 1000
"""From this number on faults and alarms are those of SINAMICS, which has five digits; MICROMASTER 4 has four."""

_LAST = 0xFFFF
_DIGITS = (4, 5)
"""So many digits a bare number of SINAMICS may have, the leading zero written or not."""


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


def likely(text: str, lang: str) -> Iterator[CodeMeaning]:
    """The fault with a bare number of SINAMICS, as r0945 has it: four or five decimal digits."""
    if text.isdecimal() and len(text) in _DIGITS and _FIVE_DIGITS <= int(text) <= _LAST:
        yield meaning(FAULT, int(text), lang)


def message_class(value: int, lang: str) -> Iterator[CodeMeaning]:
    """A channel error type of a drive: the class of its faults and alarms."""
    row, entry = explanations.message_classes().get(value), explanations.of_number(CLASS, value)
    if row is None or entry is None:
        return
    code = f"0x{value:04X}"
    title = explanations.words(lang)[CLASS].format(
        code=code, number=value - _FIRST_CLASS, digits=f"{value:04X}", text=row.text(lang)
    )
    values = {"value": code.lower()}
    yield answer(
        CLASS,
        code,
        code,
        title,
        True,
        entry,
        lang,
        rank=CLASS,
        filter_name=entry.filter,
        values=values,
    )
