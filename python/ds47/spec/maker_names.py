"""Makers by what people call them: those with a file of their own, and those of vendors.toml."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

from ds47.spec import _load, vendors

LIKE: Final = 0.7
"""How alike a name must be to be offered."""
MOST_NEAR: Final = 8
"""Names that are offered where one is unclear."""


class Named(NamedTuple):
    """A maker by its name; the likeliest of its ids, None where no source gives one."""

    name: str
    id: int | None


class UnclearNameError(ValueError):
    """No maker has this name, or several do: `near` are the names that may be meant."""

    def __init__(self, text: str, near: list[str]) -> None:
        super().__init__(text, near)
        self.text, self.near = text, near

    def __str__(self) -> str:
        """What a person is told."""
        said = f"no vendor {self.text!r}: a PROFINET vendor id, or the name of a maker"
        if self.near:
            return f"{said}; did you mean {', '.join(self.near)}?"
        own = ", ".join(each.name for each in vendors())
        return f"{said}; those with tables of their own: {own}"


@cache
def by_name() -> Mapping[str, Named]:
    """All makers by each of their names, folded; those with a file of their own come first."""
    found: dict[str, Named] = {}
    for each in vendors():
        found |= {_folded(name): Named(each.name, each.id) for name in (each.name, *each.also)}
    for name, ids in _load("vendors.toml")["ids"].items():
        found.setdefault(_folded(name), Named(name, ids[0]))
    return found


def _folded(name: str) -> str:
    """A name as it is compared: Stöber is Stoeber."""
    return name.strip().lower().replace("ä", "ae").replace("ö", "oe").replace("ü", "ue")


def find(text: str) -> Named:
    """The maker that a name, or a part of one, means, in any case.

    Raises:
        UnclearNameError: it is part of several names, or of none.
    """
    wanted, known = _folded(text), by_name()
    if wanted in known:
        return known[wanted]
    parts = [name for name in known if wanted and wanted in name]
    if len({known[name] for name in parts}) == 1:
        return known[parts[0]]
    parts.sort(key=lambda name: (not name.startswith(wanted), name))
    near = parts or difflib.get_close_matches(wanted, known, cutoff=LIKE)
    raise UnclearNameError(text, list(dict.fromkeys(known[name].name for name in near))[:MOST_NEAR])


def number(text: str) -> int:
    """The PROFINET vendor id of the maker that `find` finds.

    Raises:
        ValueError: that says what is wrong, or that no source has its id.
    """
    found = find(text)
    if found.id is None:
        raise ValueError(f"no source gives the vendor id of {found.name}")
    return found.id
