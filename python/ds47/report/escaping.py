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


def visible(document: str) -> str:
    """A JSON text that says the same, with escapes of JSON for what `escape` escapes; line ends stay."""
    if (document.isascii() and "\x7f" not in document) or document.isprintable():
        return document
    if "\n" in document:
        return "\n".join(map(visible, document.split("\n")))
    return "".join(char if char.isprintable() else _of_json(char) for char in document)


def _of_json(char: str) -> str:
    r"""`\\u009b`; two of these for a character beyond 16 bits."""
    units = char.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[at : at + 4]}" for at in range(0, len(units), 4))


def quoted(text: str) -> str:
    """A text from a drive, escaped and in quotation marks."""
    return '"' + escape(text).replace('"', '\\"') + '"'
