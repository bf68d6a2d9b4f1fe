"""Error numbers and the words of STATUS, from spec/errors.toml, makers/*.toml, status.toml and explain.toml."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from ds47 import spec
from ds47.spec import ErrorNumber, explanations

from .markdown import code, plain, table

_HEAD = """# Error numbers and STATUS

`ds47 explain CODE` says more about each: what the blocks of the PLC show, further causes, what to look for. Causes
are marked as *documented* (a manual or the profile says so), *usual* (what it mostly is) or *unconfirmed*.

A number up to 0x64 is of the profile and means the same on every drive; one from 0x65 on is of the vendor.
"""
_STATUS = """## STATUS

STATUS of WRREC and RDREC has four bytes: `DE 80 B5 00` is a Read (DE) of a record (80) that was refused because
of a state conflict (B5).
"""


def page(_root: Path) -> str:
    """Error numbers of the profile and of vendors, then what stands in a STATUS."""
    parts = [_HEAD, "## Error numbers of the profile\n", _numbers(spec.errors(), None)]
    for vendor in filter(lambda each: each.errors, spec.vendors()):
        parts += [f"## Error numbers of {vendor.name}\n", _numbers(vendor.errors, vendor.name)]
    return "\n".join([*parts, *_status()])


def _numbers(errors: Mapping[int, ErrorNumber], vendor: str | None) -> str:
    rows = []
    for number, error in errors.items():
        if number == error.code:
            rows.append(_row(error, vendor))
    return table(("number", "means", "most likely cause", "中文"), rows)


def _row(error: ErrorNumber, vendor: str | None) -> tuple[str, ...]:
    shown = spec.error_hex(error.code)
    last = f" to {spec.error_hex(error.last)}" if error.last else ""
    entry = explanations.of_error(error.code, vendor)
    cause = entry.causes[0] if entry.causes else None
    why = f"{plain(cause.en)} *({cause.basis})*" if cause and not entry.reserved else ""
    return (
        code(shown) + last,
        plain(_words_of(error, error.en)),
        why,
        plain(_words_of(error, error.zh)),
    )


def _words_of(error: ErrorNumber, text: str) -> str:
    """The words of a number; of a range `n` stands for what differs."""
    if error.last:
        return re.sub(r"\{\w+[^}]*\}", "n", text)
    return text.format(code=spec.error_hex(error.code), above=0)


def _status() -> Iterator[str]:
    """The four bytes of a STATUS, as tables."""
    english, chinese = spec.status("en"), spec.status("zh")
    yield _STATUS
    for title, name in (
        ("First byte: which call", "code"), ("Second byte: who says it", "decode"),
        ("Third byte, where the second is 80: record access", "access"),
        ("Third byte, where the second is 81: protocol", "protocol"),
    ):  # fmt: skip
        yield f"### {title}\n"
        yield _words(getattr(english, name), getattr(chinese, name))


def _words(english: Mapping[int, str], chinese: Mapping[int, str]) -> str:
    rows: Iterable[tuple[str, ...]] = (
        (code(f"{number:02X}"), plain(text), plain(chinese[number]))
        for number, text in english.items()
    )
    return table(("byte", "means", "中文"), rows)
