"""How people write the number of a parameter: p0945, r945[0], P700, PNU 945, 61000.

The letter is a habit of Siemens, as are the four digits: `p` may be written, `r` may only be read. On the wire
there is the number alone; which parameters may only be read is in the tables of spec, and any other is a `p`.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from ds47 import spec

LARGEST = 0xFFFF
BARE = 60000
"""From here on numbers are those of profiles, which have no letter."""
_FORM = re.compile(
    r"(?:(?P<letter>[pr])|pnu\.?)? ?0*(?P<number>\d{1,5})"
    r"(?:[\[.](?P<subindex>\d{1,5})(?:(?:\.\.\.?|-)[\w-]*)?\]?)?",
    re.IGNORECASE,
)


class Spelled(NamedTuple):
    """A number as it was written: `letter` is "p" or "r", None without; `subindex` None without an index."""

    number: int
    letter: str | None
    subindex: int | None


def spelled(text: str) -> Spelled | None:
    """What a text names, None where it is no parameter.

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


def spelling(number: int) -> str:
    """A number as it is printed: `p0010`, `r0945`, `p50303`, `61000` (also lua/ds47/profidrive/naming.lua)."""
    if number >= BARE:
        return str(number)
    return f"{'r' if number in spec.read_only() else 'p'}{number:04}"


def element(number: int, subindex: int) -> str:
    """One element of a parameter: `r0945[0]`."""
    return f"{spelling(number)}[{subindex}]"
