"""The names of `import ds47`: which there are, from the package. mkdocstrings has docstrings and signatures."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_origin

import ds47

_HEAD = """# Python names

Everything in `ds47.__all__`. [The library](../python.md) tells how they are used, with examples.
"""
_FIRST = (
    "analyze",
    "analyze_many",
    "watch",
    "Result",
    "decode_request",
    "decode_response",
    "encode",
    "Options",
)
"""What a program begins with."""


def names() -> list[str]:
    """Functions and classes: what a program begins with, then the others in the order of the alphabet."""
    rest = sorted(name for name in ds47.__all__ if name not in _FIRST and not name.startswith("_"))
    return [*_FIRST, *rest]


def _module(name: str) -> str:
    """The module that defines a name; a `Literal` does not know it."""
    found = getattr(ds47, name)
    if get_origin(found) is not Literal:
        return str(found.__module__)
    return next(module for module, its in ds47._ROOMS.items() if name in its)


def page(_root: Path) -> str:
    """A directive for each, of the module that defines it: the package has them only when they are asked for."""
    parts = [_HEAD]
    for name in names():
        parts.append(
            f"::: {_module(name)}.{name}\n    options:\n      heading: ds47.{name}\n      toc_label: {name}\n"
        )
    return "\n".join(parts)
