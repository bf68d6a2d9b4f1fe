"""Makers by name and by PROFINET vendor id: those with a file of their own, and those of vendors.toml.

Nothing is loaded before somebody names a maker, or a drive refuses with a number of its maker.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

from ds47.spec import _load, vendors


MOST_NEAR: Final = 8
"""Names that are offered where one is unclear."""


class Named(NamedTuple):
    """A maker by its name; the likeliest of its ids, None where no source gives one."""

    name: str
    id: int | None


class UnclearNameError(ValueError):
    """No maker has this name, or several do: `near` are the names that may be meant."""

    def __init__(self, text: str, near: list[str]) -> None:
        super().__init__(text)
        self.text, self.near = text, near


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


@cache
def by_id() -> Mapping[int, str]:
    """The name of each vendor id that is known."""
    listed = {number: name for name, ids in _load("vendors.toml")["ids"].items() for number in ids}
    return listed | {each.id: each.name for each in vendors() if each.id is not None}


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
    near = parts or difflib.get_close_matches(wanted, known)
    raise UnclearNameError(text, list(dict.fromkeys(known[name].name for name in near))[:MOST_NEAR])


def called(vendor_id: int, lang: str) -> str:
    """`Yaskawa`, or `the device` where nobody knows whose the id is."""
    of_none: Mapping[str, str] = _load("errors.toml")["no_maker"]
    return by_id().get(vendor_id) or of_none["zh" if lang == "zh" else "en"]
