"""Which parameter is meant, under every mapping of submodules to drive objects; and what was written to it last.

Index 47 and 0xB02F reach the drive object of the axis byte, 0xB02E that of its submodule. Which submodule is which
drive object is known only where PNU 975[7] was read through it. Axis 0 may be any drive object, and so may every
axis of a device that never said that an axis does not exist (0x19).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from tests.audit import wire
from tests.audit.message import VALUE, Address, Block
from tests.audit.reading import Deal, Reading

LOCAL = 0xB02E
DO_ID = (975, 7)
NO_SUCH_AXIS = 0x19
OF_THE_DEVICE = (964, 974, 976, 977, 978, *range(61000, 61005))
"""Parameters that a device has once, whichever drive object is asked."""
RECOMPUTE = frozenset((10, 15, 340, 809, 819, 970, 976, 3900))
"""Parameters whose change changes others."""
SURE, MAYBE, NEVER = "sure", "maybe", "never"


@dataclass(frozen=True)
class Target:
    """A drive object as it is addressed: by its axis, or by its submodule (then `axis` is what was proven)."""

    device: str
    axis: int | None
    submodule: tuple[int, int] | None
    through: tuple[int, int] | None = None
    """The submodule that was asked for axis 0, which names no drive object."""


def by_axis(deal: Deal, axis: int) -> Target:
    """The drive object that an axis names in a request at the place of a transaction."""
    return Target(deal.device, axis, None, None if axis else (deal.slot or 0, deal.subslot or 0))


@dataclass
class Event:
    """Something that may have set a parameter: a change of one element, or of all (`pnu` None).

    `bits` is None where the value is not known afterwards: then it is `tried`, or as it was before, where that is
    not None either. It happened between the frames `start` and `end`.
    """

    target: Target | None
    pnu: int | None
    element: int | None
    bits: bytes | None
    start: int
    end: int
    device: str
    tried: bytes | None = None


class Memory:
    """The parameters of one capture: who may be who, and what may have been written."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self.heeding = self._devices_that_refuse_axes()
        self.proven = self._proven()
        self.events = sorted(self._all(), key=lambda each: each.start)
        self._sameness = cache(self._same)

    def _devices_that_refuse_axes(self) -> set[str]:
        return {
            deal.device for deal in self._reading.deals if deal.answer and deal.index != LOCAL
            for block in deal.answer.blocks if block.code == NO_SUCH_AXIS
        }  # fmt: skip

    def _proven(self) -> dict[tuple[str, tuple[int, int]], int | None]:
        """What a submodule says it is; None where it says two things."""
        found: dict[tuple[str, tuple[int, int]], int | None] = {}
        for deal in self._reading.deals:
            if deal.index != LOCAL or deal.operation != "read":
                continue
            for address, block in deal.pairs():
                for element, bits in elements(address, block):
                    if (address.pnu, element) == DO_ID and len(bits) <= 4:
                        key = deal.device, (deal.slot, deal.subslot)
                        said = int.from_bytes(bits)
                        found[key] = said if found.get(key, said) == said else None
        return found

    def target(self, deal: Deal) -> Target | None:
        """The drive object of a transaction; None where its request has no axis."""
        if deal.index == LOCAL:
            place = (deal.slot, deal.subslot)
            return Target(deal.device, self.proven.get((deal.device, place)), place)
        return None if deal.asked is None else by_axis(deal, deal.asked.axis)

    def same(self, one: Target | None, other: Target | None) -> str:
        """Whether two are one drive object: sure, maybe or never."""
        if one is None or other is None:
            return MAYBE
        return self._sameness(one, other)

    def _same(self, one: Target, other: Target) -> str:
        if one.device != other.device:
            return NEVER
        if one.submodule is not None and one.submodule == other.submodule:
            return SURE
        if one.axis is None or other.axis is None or not one.axis or not other.axis:
            return SURE if one == other and one.submodule is None and one.axis == 0 else MAYBE
        if one.axis == other.axis:
            return SURE
        both = one.submodule is not None and other.submodule is not None
        return NEVER if both or one.device in self.heeding else MAYBE

    # What was written

    def _all(self) -> Iterator[Event]:
        for deal in self._reading.deals:
            yield from self._of(deal)
        for call in self._reading.capture.calls:
            if call.request.operation == wire.CONNECT:
                device = call.request.target
                yield Event(None, None, None, None, call.request.frame, call.request.frame, device)

    def _of(self, deal: Deal) -> Iterator[Event]:
        asked, answer = deal.asked, deal.answer
        if asked is None:
            if answer is not None and answer.id in (0x02, 0x82, 0x42, 0xC2):
                # somebody changed something that this capture does not show
                frame = deal.read or 0
                yield Event(None, None, None, None, frame, frame, deal.device)
            return
        if not asked.changes or deal.write is None or deal.write_status or self._rejected(deal):
            return
        target, known = self.target(deal), deal.fits and not deal.read_status
        end = deal.read if known and deal.read is not None else deal.write
        for number, address in enumerate(asked.addresses):
            value = asked.blocks[number] if number < len(asked.blocks) else None
            done = outcome(deal, number) if known else None
            if done is False:
                continue
            if address.pnu in RECOMPUTE:
                yield Event(None, None, None, None, deal.write, end, deal.device)
            if value is None or address.attribute != VALUE:
                continue
            written = list(elements(address, value))
            for element, bits in written:
                kept = bits if done else None
                yield Event(target, address.pnu, element, kept, deal.write, end, deal.device, bits)
            for element in range(address.subindex, address.subindex + max(1, address.elements)):
                if element not in dict(written):
                    yield Event(target, address.pnu, element, None, deal.write, end, deal.device)

    def _rejected(self, deal: Deal) -> bool:
        """Whether the Write was answered by a fault or a reject of RPC."""
        answered = self._reading.by_frame.get(deal.frames["write_response"] or 0, [])
        return any(each.kind in (wire.FAULT, wire.REJECT) for each in answered)

    def last(self, deal: Deal, pnu: int, element: int) -> list[Event]:
        """The events any of which may be the last one before the read; empty where none is sure."""
        target, begin, until = self.target(deal), deal.write or 0, deal.read or 0
        may: list[tuple[Event, str]] = []
        for each in self.events:
            if each.start >= until or each.device != deal.device:
                continue
            if each.pnu is not None and (each.pnu, each.element) != (pnu, element):
                continue
            same = MAYBE if each.pnu is None else self.same(each.target, target)
            if same != NEVER:
                may.append((each, same))
        sure = [
            each for each, same in may
            if same == SURE and each.bits is not None and each.end < begin
        ]  # fmt: skip
        if not sure:
            return []
        border = max(each.start for each in sure)
        left = [each for each, _ in may if each.end >= border]
        return [each for each in left if not self._written_over(each, left, begin)]

    def _written_over(self, event: Event, others: list[Event], begin: int) -> bool:
        """Whether another change of the same drive object, whichever that is, came surely behind it."""
        return event.pnu is not None and any(
            each.pnu is not None and each.bits is not None and event.end < each.start and each.end < begin
            and self.same(each.target, event.target) == SURE
            for each in others
        )  # fmt: skip


def outcome(deal: Deal, number: int) -> bool | None:
    """Whether a parameter was changed; None where the response does not tell."""
    answer, asked = deal.answer, deal.asked
    assert answer is not None
    assert asked is not None
    if answer.id == 0x80:
        return False
    if number < len(answer.blocks):
        return not answer.blocks[number].failed
    if answer.id == asked.id and not answer.blocks and answer.sound:
        return True
    return None


def elements(address: Address, block: Block) -> Iterator[tuple[int, bytes]]:
    """Subindex and bytes of each element of a block that is whole; a text is none of numbers."""
    if address.attribute != VALUE or block.failed or not block.size or not block.count:
        return
    if len(block.raw) == block.size * block.count:
        for number, bits in enumerate(block.elements()):
            yield address.subindex + number, bits
