"""TOML that users write: settings and lists.

`tomllib` says what is wrong of most texts. What it cannot take, or only with all memory, becomes a ValueError
here, so that who reads a file has one error to catch.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_LONG_KEY: Final = re.compile(rf"(?:^|[\[{{,])[ \t]*+(?:{_PART}\.[ \t]*+){{64}}", re.MULTILINE)
"""tomllib needs the square of the parts of a key in time and memory."""
_LARGEST: Final = 1 << 64
"""TOML has numbers of 64 bits. Python takes more, but does not write all of them."""


def parse(text: str) -> dict[str, Any]:
    """The document of a text. Raises ValueError where it is none, or one that nobody means."""
    if (key := _LONG_KEY.search(text)) is not None:
        line = text.count("\n", 0, key.start()) + 1
        raise ValueError(f"a key has more than 64 parts (at line {line})")
    try:
        document = tomllib.loads(text)
    except RecursionError:
        raise ValueError("brackets are nested too deeply") from None
    _check(document)
    return document


def _check(document: dict[str, Any]) -> None:
    waiting: list[Any] = [document]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            waiting += each.values()
        elif isinstance(each, list):
            waiting += each
        elif isinstance(each, int) and abs(each) >= _LARGEST:
            raise ValueError("a number has more than 64 bits")
