"""What a code may mean, as text: the layout of `ds47 explain`, which Wireshark shows too.

The meanings are `ds47.explain`. The likeliest is shown in full, the others in short: an answer fits on a
screen and begins with the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Final

from ds47.explain import BlockOutputs, CodeMeaning, Reason
from ds47.report.wrap import columns, wrap
from ds47.spec import explanations

WIDTH = 100
_LABEL = 12
_WITH_CAUSE = 2
_TELEGRAM = "telegram"
_ONE_LINE = 140
"""Columns of the line where nothing is known: it stays one even where the others are shorter."""

_LABELS: Final[Mapping[str, str]] = {
    "format": "names", "parameter": "values", "rule": "since",
}  # fmt: skip
"""Kinds of codes -> the word before their parts, where these are something of their own."""


def lines(meanings: Sequence[CodeMeaning], lang: str, width: int = WIDTH) -> Iterator[str]:
    """The first meaning in full, of the others what they are, those without meaning in one line.

    Args:
        meanings: what `ds47.explain.explain` gives.
        lang: "en" or "zh".
        width: columns of a line; a filter may be longer.
    """
    words = explanations.words(lang)
    if _says_nothing(meanings, words):
        yield from wrap(meanings[0].title, max(width, _ONE_LINE), 2)
        return
    yield from _full(meanings[0], words, width)
    if len(meanings) > 1:
        yield ""
    others = [each for each in meanings[1:] if each.known]
    for number, meaning in enumerate(others):
        yield from wrap(f"{words['or']} {meaning.title}", width, 2)
        if number < _WITH_CAUSE and meaning.causes:
            yield from _labelled(words["causes"], _cause(meaning.causes[0], words), width)
    empty = [each.title for each in meanings[1:] if not each.known]
    if empty:
        yield from wrap(words["nothing"].format(list=words["list_separator"].join(empty)), width, 2)
    more = [each.name for each in others if each.name != meanings[0].name]
    if more:
        yield from wrap(words["more"].format(command=more[0]), width)


def _says_nothing(meanings: Sequence[CodeMeaning], words: Mapping[str, str]) -> bool:
    """Whether neither the number nor any part of it has a meaning: one line is enough."""
    silent = ("", words["unknown_part"], words["second"])
    first = meanings[0]
    parts = any(part.text not in silent for part in first.parts)
    return not (parts or first.advice or any(each.known for each in meanings))


def _full(meaning: CodeMeaning, words: Mapping[str, str], width: int) -> Iterator[str]:
    yield from wrap(meaning.title, width, 2)
    for label, parts in _parts(meaning):
        yield from _labelled(words[label], words["part_separator"].join(parts), width)
    for label, block in zip([words["plc"], "", ""], meaning.plc, strict=False):
        yield from _labelled(label, _block(block, words), width, 2)
    numbered = len(meaning.causes) > 1
    for number, cause in enumerate(meaning.causes, 1):
        text = _cause(cause, words)
        label = words["causes"] if number == 1 else ""
        yield from _labelled(label, f"{number}. {text}" if numbered else text, width, 3 * numbered)
    if meaning.advice:
        yield from _labelled(words["advice"], meaning.advice, width)
    yield from _labelled(words["look"], meaning.look, width)
    if meaning.filter:
        yield _label(words["filter"]) + meaning.filter
    if meaning.plugin_filter:
        label = words["plugin_filter" if meaning.filter else "filter"]
        yield _label(label) + meaning.plugin_filter


def _parts(meaning: CodeMeaning) -> Iterator[tuple[str, list[str]]]:
    """The label and the parts of each line; those of a telegram by their direction."""
    if meaning.kind != _TELEGRAM:
        parts = [" ".join(filter(None, (p.value, p.name, p.text))) for p in meaning.parts]
        if parts:
            yield _LABELS.get(meaning.kind, "parts"), parts
        return
    for side, of_side in groupby(meaning.parts, key=lambda part: part.name.split()[0]):
        places = ((part.name.partition(" ")[2], part.value, part.text) for part in of_side)
        yield f"telegram_{side}", [" ".join(filter(None, each)) for each in places]


def _cause(cause: Reason, words: Mapping[str, str]) -> str:
    return cause.text + words["bracket"].format(text=words[cause.basis])


def _block(block: BlockOutputs, words: Mapping[str, str]) -> str:
    """`RDREC VALID 0  BUSY 0  ERROR 1  STATUS 16#DE80B500  (for one call only)`."""
    if not block.block:
        return block.note
    if block.done is None:
        return f"{block.block}  {block.note}"
    done = "VALID" if block.block == "RDREC" else "DONE"
    outputs = ((done, block.done), ("BUSY", block.busy), ("ERROR", block.error))
    shown = "  ".join(f"{name} {int(bool(value))}" for name, value in outputs)
    note = words["bracket"].format(text=block.note)
    return f"{block.block}  {shown:<24}  STATUS 16#{block.status} {note}"


def _labelled(label: str, text: str, width: int, hanging: int = 0) -> Iterator[str]:
    for number, line in enumerate(wrap(text, width - _LABEL - 2, hanging)):
        yield _label(label if number == 0 else "") + line


def _label(text: str) -> str:
    return "  " + text + " " * max(1, _LABEL - columns(text))
