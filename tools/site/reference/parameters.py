"""The parameters that ds47 knows by itself, from spec/parameters.toml and drives.toml, with their sources."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from ds47 import spec
from ds47.profidrive.naming import spelling
from ds47.spec import Pnu, explanations

from .markdown import plain, table

_HEAD = """# Known parameters

Names and units that ds47 has of its own. What a drive says of its parameters comes first, then
[lists that you import](../parameters.md), then these. A number that means something else on another family of
drives is used only where the capture shows which family it is. `r` is printed where a source says that the
parameter may only be read, else `p`.
"""


def page(_root: Path) -> str:
    """A table for each family of drives."""
    words = explanations.words("en")
    by_family: dict[str, list[Pnu]] = {}
    for rows in spec.parameters().values():
        for each in rows.values():
            by_family.setdefault(each.family, []).append(each)
    parts = [_HEAD]
    for family, known in by_family.items():
        parts += [
            f"## {words[f'family_{family}']}\n",
            table(("number", "name", "type", "unit", "中文", "source"), _rows(known)),
        ]
    parts += [
        "## Sources\n",
        "Of the profile: [the channel on the wire](../protocol.md), D. Of the drives:\n",
    ]
    parts += [f"* {key}: {plain(title)}" for key, title in spec.parameter_sources().items()]
    return "\n".join(parts)


def _rows(known: list[Pnu]) -> Iterator[tuple[str, ...]]:
    """A row for each; numbers that follow each other and say the same are one."""
    ordered = sorted(known, key=lambda each: each.number)
    for _, same in groupby(
        enumerate(ordered),
        key=lambda each: (each[1].number - each[0], each[1].name_en, each[1].sources),
    ):
        run = [each for _, each in same]
        first, last = run[0], run[-1]
        number = spelling(first.number) + (
            f" to {spelling(last.number)}" if last is not first else ""
        )
        yield (
            number,
            plain(first.name_en),
            plain("" if first.type == "unknown" else first.type),
            plain(first.unit or ""),
            plain(first.name_zh),
            ", ".join(first.sources),
        )
