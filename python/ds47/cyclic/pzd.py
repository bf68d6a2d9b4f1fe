"""The control word and the status word: the state of the drive, and what it waits for (docs/cyclic.md 3).

One word, or one pair of words, at a time. Edges, times and who sent what are not here.
"""

from __future__ import annotations

from typing import NamedTuple

from ds47.spec import cyclic


class DriveStatus(NamedTuple):
    """What a status word says: the state, and what is shown beside it (ids of spec/pzd.toml)."""

    state: str
    overlays: tuple[str, ...]


def state(zsw1: int, stw1: int | None = None) -> DriveStatus:
    """The state of a drive by its status word; S5 only with the control word that goes with it."""
    found = next(row.id for row in cyclic.states() if zsw1 & row.mask == row.bits)
    ending = cyclic.stopping()
    if found in ending.states and stw1 is not None and _is_stopping(stw1, ending):
        found = ending.id
    beside = tuple(row.id for row in cyclic.overlays() if zsw1 & row.mask == row.bits)
    return DriveStatus(found, beside)


def _is_stopping(stw1: int, ending: cyclic.Stopping) -> bool:
    """Whether a control word that the drive heeds asks it to switch off."""
    if not stw1 >> ending.heeded & 1 or any(stw1 >> bit & 1 for bit in ending.unless):
        return False
    return not all(stw1 >> bit & 1 for bit in ending.bits)


def missing(stw1: int) -> tuple[cyclic.Needed, ...]:
    """The bits that a control word lacks, in the order in which a drive asks for them."""
    return tuple(row for row in cyclic.needed() if not stw1 >> row.bit & 1)


REVERSE = 11
"""The bit of STW1 that turns the sign of the setpoint."""


def turns(stw1: int, others: bool) -> bool:
    """Whether a control word turns the sign of the setpoint; of a drive of `others` nobody knows bit 11."""
    return bool(stw1 >> REVERSE & 1) and not others


def signed(word: int) -> int:
    """A word as PLC tables print it with a sign."""
    return word - 0x10000 if word & 0x8000 else word


def percent(raw: int) -> float:
    """A setpoint or actual value of one word in percent of p2000."""
    return signed(raw) / cyclic.full_scale() * 100
