"""Text in lines of a terminal: a Chinese character takes two columns, and lines may break after any."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator

_STAYS = tuple("，。；：、）”")
"""Characters that never begin a line."""
_COLOR = re.compile(r"\x1b\[\d*m")
_CELLS = re.compile("(?<=  )(?! )")
_WHOLE = re.compile(r"[/\\\x1b]")
_WORDS = re.compile("(?<= )(?! )")


def wrap(text: str, width: int, hanging: int = 0) -> list[str]:
    """Lines of at most `width` columns; all but the first begin with `hanging` blanks."""
    if columns(text) <= width:
        return [text.rstrip()]
    return list(_filled(_short(_pieces(text), width - hanging), width, hanging))


def fitted(text: str, width: int | None, hanging: int = 4) -> list[str]:
    """A line of a report in lines that fit: all but the first are indented by `hanging` more columns.

    It is broken between cells, which have two blanks between them, before it is broken between words. Without a
    width it stays one line: nobody reads it on a terminal.
    """
    if width is None or columns(text) <= width:
        return [text]
    hanging += len(text) - len(text.lstrip())
    lines = _filled(_CELLS.split(text), width, hanging)
    return [part for line in lines for part in wrap(line, width, hanging)]


def _filled(pieces: Iterable[str], width: int, hanging: int) -> Iterator[str]:
    """Lines of as many pieces as have room."""
    line, taken = "", 0
    for piece in pieces:
        if line.strip() and taken + columns(piece.rstrip()) > width:
            yield line.rstrip()
            line, taken = " " * hanging, hanging
            piece = piece.lstrip()
        line += piece
        taken += columns(piece)
    yield line.rstrip()


def _short(pieces: Iterable[str], width: int) -> Iterator[str]:
    """The pieces; a name that is wider than a line is broken. A path stays whole: people copy it."""
    for piece in pieces:
        while columns(piece.rstrip()) > width and not _WHOLE.search(piece):
            yield piece[:width]
            piece = piece[width:]
        yield piece


def cut(text: str, width: int) -> str:
    """A line that fits: what has no room is left out."""
    return text if columns(text) <= width else wrap(text, width - 4)[0].rstrip() + " ..."


def end_of(text: str, width: int) -> str:
    """The end of a path, which says more than its beginning."""
    return text if columns(text) <= width else "..." + text[3 - width :]


def columns(text: str) -> int:
    """The width of a text on a terminal; colours have none."""
    if "\x1b" in text:
        text = _COLOR.sub("", text)
    if text.isascii():
        return len(text)
    return sum(2 if unicodedata.east_asian_width(each) in "WF" else 1 for each in text)


def padded(text: str, width: int) -> str:
    """The text, padded with blanks to `width` columns."""
    return text + " " * (width - columns(text))


def _pieces(text: str) -> Iterator[str]:
    """The text in unbreakable pieces: a word with the blanks after it, or a wide character."""
    for word in _WORDS.split(text):
        if word.isascii():
            yield word
            continue
        begin = 0
        for at in range(1, len(word) + 1):
            before, following = word[at - 1], word[at : at + 1]
            if 2 in (columns(before), columns(following)) and following not in _STAYS:
                yield word[begin:at]
                begin = at
        yield word[begin:]
