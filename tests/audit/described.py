"""Whether the names, units and physical values that a report takes from descriptions are those that the drive gave.

A description is one to its request, of the same parameter of the same drive object, whatever submodule that is; it came
by the response of the transaction that it names. Without one nothing says that the drive named it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, NamedTuple

from tests.audit import message
from tests.audit.memory import OF_THE_DEVICE, SURE, Memory
from tests.audit.reading import Complaint, Deal, Reading

UNITS = {
    4: "s", 8: "Wh", 9: "W", 11: "1/min", 16: "Nm", 17: "°C", 21: "V", 22: "A", 23: "Ohm", 24: "%", 27: "%",
    28: "Hz",
}  # fmt: skip
INTEGERS = range(0x02, 0x08)
NO_TYPES = (0x00, 0x40, 0x44)
IRRELEVANT = 1 << 8
WHOLE = struct.Struct(">HHfBb4x16s")


class Said(NamedTuple):
    """A whole description: which transaction brought it, and what is in it."""

    deal: Deal
    pnu: int
    word: int
    factor: float
    quantity: int
    conversion: int
    name: str


def check(reading: Reading, memory: Memory) -> Iterator[Complaint]:
    """All complaints about what a report has from descriptions."""
    known = list(_all(reading))
    for deal in reading.deals:
        if deal.cyclic or deal.asked is None:
            continue
        for number, told in enumerate(deal.parameters):
            for text in _parameter(deal, told, known, reading, memory):
                yield Complaint("described", f"#{deal.id}", f"parameter {number} {text}")


def _all(reading: Reading) -> Iterator[Said]:
    for deal in reading.deals:
        if (
            deal.operation != "read"
            or not deal.fits
            or deal.cyclic
            or deal.read_status
            or deal.read is None
        ):
            continue
        for address, block in deal.pairs():
            about = (
                address.attribute == message.DESCRIPTION
                and not address.subindex
                and len(block.raw) == 46
            )
            if about and address.elements <= 1 and not block.failed and not _is_broken(deal):
                word, _, factor, quantity, conversion, raw = WHOLE.unpack(block.raw[: WHOLE.size])
                name = raw.decode("latin-1").rstrip("\0 ")
                yield Said(deal, address.pnu, word, factor, quantity, conversion, name)


def _is_broken(deal: Deal) -> bool:
    answer = deal.answer
    return answer is None or bool(
        answer.missing or answer.rest or answer.unknown is not None or deal.short
    )


def _parameter(
    deal: Deal, told: dict[str, Any], known: list[Said], reading: Reading, memory: Memory
) -> Iterator[str]:
    frames = told.get("described_in")
    if frames is None:
        own = _latest(deal, told, known)
        if own is not None and _is_clear(own):
            yield f"is not named {own.name!r}, as frame {own.deal.read} says"
        return
    if told["attribute"] != "value":
        yield "is no value, and named by a description"
    for frame in frames:
        if deal.read is not None and frame > deal.read and deal.answer is not None:
            yield f"is named by frame {frame}, which came later"
        if not any(
            _describes(each, told["pnu"], deal, memory)
            for each in reading.deals
            if each.read == frame
        ):
            yield f"is not described in frame {frame}"
    own = _latest(deal, told, known)
    if own is not None and _is_clear(own) and len(frames) == 1 and frames[0] == own.deal.read:
        yield from _as_said(own, told)


def _describes(there: Deal, pnu: int, deal: Deal, memory: Memory) -> bool:
    if there.operation != "read" or not there.fits:
        return False
    if memory.same(memory.target(there), memory.target(deal)) != SURE and pnu not in OF_THE_DEVICE:
        return False
    return there.device == deal.device and any(
        address.pnu == pnu and address.attribute == message.DESCRIPTION and not block.failed
        for address, block in there.pairs()
    )


def _latest(deal: Deal, told: dict[str, Any], known: list[Said]) -> Said | None:
    """The newest whole description that was asked for in just the same way, up to the response."""
    if deal.answer is None or deal.read is None or told["attribute"] != "value" or not deal.fits:
        return None
    near = [
        each for each in known
        if each.pnu == told["pnu"] and (each.deal.read or 0) <= deal.read
        and (each.deal.place, each.deal.axis_told) == (deal.place, deal.axis_told)
    ]  # fmt: skip
    return max(near, key=lambda each: each.deal.read or 0, default=None)


def _is_clear(said: Said) -> bool:
    """Whether it names the parameter beyond all doubt."""
    kind = said.word & 0xFF
    return bool(said.name) and said.name.isascii() and said.name.isprintable() and (
        kind in message.SIZES and kind not in NO_TYPES
    )  # fmt: skip


def _as_said(said: Said, told: dict[str, Any]) -> Iterator[str]:
    if told["name"] != said.name:
        yield f"is named {told['name']!r}: frame {said.deal.read} says {said.name!r}"
    if not told["values"] or message.NAMES.get(str(told["format"])) != said.word & 0xFF:
        return
    unit = UNITS.get(said.quantity)
    measured = unit and not said.word & IRRELEVANT and said.factor == 1
    if said.word & 0xFF in INTEGERS and measured and said.conversion == -2 and said.quantity != 11:
        scaled = [float(Fraction(value, 100)) for value in told["values"]]
        if (told["unit"], told["scaled"]) != (unit, scaled):
            yield f"is {told['scaled']} {told['unit']}, not {scaled} {unit}"
    elif told["scaled"] is not None and said.word & 0xFF in INTEGERS and not measured:
        yield f"is scaled to {told['scaled']}: frame {said.deal.read} does not say how"
