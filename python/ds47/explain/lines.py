"""Codes in a line of a log or in a sentence, as people paste them: `Station 'x': CF81FD0B - Abort`."""

from __future__ import annotations

import re

from ds47.spec import snap7

_PAIR = 2
_INSIDE = re.compile(
    r"(?<![\w#])(?:16#[0-9A-F_]{2,9}|0X[0-9A-F]{4,8}|[0-9A-F]{8}|[0-9]{6,9}|[FA][0-9]{5}"
    r"|[PR][0-9]{4,5}(?:\[[0-9]{1,5}\])?)(?!\w)",
    re.IGNORECASE,
)
"""What looks like a code between other words: a byte or a word without a prefix may be anything there."""


def codes_in(text: str) -> list[str]:
    """What may be a code in a text, in its order; where no number stands, those of a library that it names.

    Of two words the first says what kind of code the second is: that is no line of a log.
    """
    line = len(text.split()) > _PAIR or "=" in text
    found = [each.group() for each in _INSIDE.finditer(text)] if line else []
    return list(dict.fromkeys(found)) or [f"s7 0x{each:08X}" for each in snap7.numbers_named(text)]
