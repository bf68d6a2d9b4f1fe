"""The title block of a page: what it is about, for whom and by whom. What is not said is not there."""

from __future__ import annotations

from typing import Any, NamedTuple

LONGEST = 200
"""Characters of one entry."""


class Heading(NamedTuple):
    """What a person says of a report."""

    title: str = ""
    order: str = ""
    customer: str = ""
    author: str = ""

    def __bool__(self) -> bool:
        return self != Heading()

    def over(self, other: Heading) -> Heading:
        """What is said here, and what is not from another one."""
        return Heading(
            *(getattr(self, name) or getattr(other, name) for name in NAMES)
        )  # fmt: skip


NAMES = Heading._fields


def parse(table: Any) -> Heading:
    """That of a table `[report]` of a `ds47.toml`.

    Raises:
        ValueError: the key and what is allowed.
    """
    if not isinstance(table, dict):
        raise ValueError("report: write it as a table, [report]")
    unknown = set(table) - set(NAMES)
    if unknown:
        raise ValueError(
            f"[report]: unknown key {min(unknown)!r}; known are {', '.join(NAMES)}, tz"
        )
    for key, text in table.items():
        if not isinstance(text, str) or len(text) > LONGEST:
            raise ValueError(f"[report] {key}: write a text of at most {LONGEST} characters")
    return Heading(**table)
