"""Texts of a capture as a terminal may show them: nothing in them can talk to it. Values are in `formatting`."""

from __future__ import annotations


def escape(text: str) -> str:
    """The text with escapes for everything that a terminal might obey, or that is invisible.

    That is control characters (C0 and C1), marks that turn the direction of writing, line and
    paragraph separators, lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode() for char in text
    )


def quoted(text: str) -> str:
    """A text from a drive, escaped and in quotation marks."""
    return '"' + escape(text).replace('"', '\\"') + '"'
