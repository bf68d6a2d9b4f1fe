"""How people write the number of a parameter: p0945, r945[0], P700, PNU 945, 61000.

The letter is a habit of Siemens, as are the four digits: `p` can be written, `r` is read-only, and
MICROMASTER has a capital `P`. The wire has only the number. The tables of spec say which parameters of a family
are read-only; all others are a `p` (docs/protocol.md D.3).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final, NamedTuple

from ds47 import spec

LARGEST = 0xFFFF
BARE = 60000
"""Numbers from here on belong to profiles, and have no letter."""
WRITABLE: Final[Mapping[str | None, str]] = {spec.MICROMASTER: "P"}
"""The letter of writable parameters, if it is not `p`."""
_FORM = re.compile(
    r"(?:(?P<letter>[pr])|pnu\.?)? ?0*(?P<number>\d{1,5})"
    r"(?:[\[.](?P<subindex>\d{1,5})(?:(?:\.\.\.?|-)[\w-]*)?\]?)?",
    re.IGNORECASE,
)


class Spelled(NamedTuple):
    """A number as written: `letter` is "p", "r" or None, `subindex` is None without an index."""

    number: int
    letter: str | None
    subindex: int | None


def spelled(text: str) -> Spelled | None:
    """The parameter that a text names, None if it names none.

    Args:
        text: such as `p0945`, `r945[0]`, `P1120[0...3]`, `PNU 945`, `61000`.
    """
    match = _FORM.fullmatch(text.strip())
    if match is None or int(match["number"]) > LARGEST or int(match["subindex"] or 0) > LARGEST:
        return None
    letter = match["letter"]
    subindex = match["subindex"]
    return Spelled(
        int(match["number"]), letter and letter.lower(), None if subindex is None else int(subindex)
    )


def spelling(number: int, family: str | None = None) -> str:
    """A number in print: `p0010`, `r0945`, `P0700`, `61000` (also lua/ds47/profidrive/naming.lua).

    Args:
        number: of the parameter.
        family: of the drive (`ds47.profidrive.dictionary.family_of`); None if no drive is named.
    """
    if number >= BARE:
        return str(number)
    if number in spec.read_only(family):
        return f"r{number:04}"
    return f"{WRITABLE.get(family, 'p')}{number:04}"


def element(number: int, subindex: int, family: str | None = None) -> str:
    """One element of a parameter: `r0945[0]`."""
    return f"{spelling(number, family)}[{subindex}]"
