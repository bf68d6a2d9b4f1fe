"""What a number means that Snap7, libnodave or a relative returns: `36700160`, `0xA274C`, `0xffffff7e`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ds47.explain.answer import BlockOutputs, CodeMeaning, CodePart, answer
from ds47.explain.forms import WORD, Reading
from ds47.spec import explanations, snap7
from ds47.spec.explanations import CodeCause, Explanation

KIND = "s7_error"
"""It is asked for, and ranked, as an error word of S7 communication."""


def named(reading: Reading, lang: str) -> Iterator[CodeMeaning]:
    """What a number with `s7` in front means; nothing where it is no number of the library, or hardly one."""
    parts = snap7.parts(reading.value)
    if parts and (reading.decimal or all(each.row is not None for each in parts)):
        yield _meaning(reading.value, parts, lang)


def below_zero(reading: Reading, lang: str) -> Iterator[CodeMeaning]:
    """What a number of libnodave means that was read as one of two bytes: `-1025`."""
    if reading.decimal and reading.size == WORD:
        yield from named(replace(reading, value=reading.value | 0xFFFF0000), lang)


def alone(reading: Reading, lang: str) -> Iterator[CodeMeaning]:
    """The same without a word in front of it."""
    parts = snap7.parts(reading.value)
    bare = len(parts) == 1 and parts[0].name == snap7.CONNECTION and not reading.decimal
    if parts and not bare and all(each.row is not None for each in parts):
        yield _meaning(reading.value, parts, lang)


def _meaning(number: int, parts: tuple[snap7.Part, ...], lang: str) -> CodeMeaning:
    words = explanations.words(lang)
    code = f"0x{number:08X}"
    text = words["part_separator"].join(each.text(lang) for each in parts)
    whole = parts[0].name == snap7.LIBNODAVE
    title = snap7.word("title_libnodave" if whole else "title", lang)
    title = title.format(code=code, decimal=parts[0].code if whole else number, text=text)
    causes = [cause for part in reversed(parts) for cause in (*part.causes(), *_handed_on(part))]
    entry = Explanation(
        tuple(causes) or (snap7.general_cause(parts[0].name),),
        snap7.word("look", "en"),
        snap7.word("look", "zh"),
    )
    found = answer(
        KIND, code, f"{explanations.kind_word(KIND)} {number}", title, True, entry, lang, rank=KIND, view="none",
        parts=tuple(_listed(parts, lang)), filter_name="s7",
    )  # fmt: skip
    return replace(found, plc=(BlockOutputs("", None, None, None, None, snap7.word("plc", lang)),))


def _handed_on(part: snap7.Part) -> Iterator[CodeCause]:
    """The causes of what the partner said, if the number stands for that."""
    for code in part.stands_for:
        entry = explanations.of_number("s7_error" if code > 0xFF else "s7_item", code)
        yield from entry.causes if entry is not None else ()
        return


def _listed(parts: tuple[snap7.Part, ...], lang: str) -> Iterator[CodePart]:
    for part in parts:
        text = part.text(lang)
        if part.stands_for:
            said = (f"0x{code:04X}" if code > 0xFF else f"0x{code:02X}" for code in part.stands_for)
            listed = explanations.words(lang)["list_separator"].join(said)
            text = snap7.word("stands_for", lang).format(list=listed)
        shown = (
            str(part.code) if part.name in (snap7.SOCKET, snap7.LIBNODAVE) else f"0x{part.code:X}"
        )
        yield CodePart(shown, snap7.word(part.name, lang), text)
