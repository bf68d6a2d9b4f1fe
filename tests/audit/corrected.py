"""Whether a drive would take a corrected request, and whether the capture proves it.

Of a simulated drive the request is really asked. Of every other capture the auditor knows what the capture itself
shows: a parameter that was refused is refused again where nothing of it was changed.

What a drive refuses, and no capture could show before it was asked, is no complaint: that a parameter does not
exist, or has no text, where nobody asked for it; that a parameter cannot be changed now, or not at all, where the
drive has looked at nothing but the format up to now. A corrected request mends what is known to be wrong.
"""

from __future__ import annotations

import contextlib
import copy
import io
import shlex
from collections.abc import Iterator
from typing import Any

from tests.audit import message
from tests.audit.causes import described, formats
from tests.audit.drive import Drive
from tests.audit.memory import LOCAL, NEVER, NO_SUCH_AXIS, Memory, Target, by_axis
from tests.audit.reading import Complaint, Deal, Reading

SAFETY = (*range(9300, 9400), *range(9500, 9950), *range(10000, 10300))
"""Parameters of safety and topology: no corrected change."""


def check(reading: Reading, memory: Memory, drives: dict[str, Drive]) -> Iterator[Complaint]:
    """All complaints about corrected requests."""
    for each in reading.plain["diagnoses"]:
        if each["corrected"] is None:
            continue
        for text in _corrected(each, reading, memory, drives):
            yield Complaint(each["rule"], "corrected", f"{text}: {each['corrected']['request']}")


def _corrected(
    plain: dict[str, Any], reading: Reading, memory: Memory, drives: dict[str, Drive]
) -> Iterator[str]:
    data = bytes.fromhex(plain["corrected"]["request"])
    new = message.request(data)
    yield from _forms(plain["corrected"], data)
    if not new.sound or any(new.rest):
        yield "does not decode"
        return
    deal = reading.by_id.get(plain["corrected"]["transaction"])
    if deal is None or deal.asked is None or deal.id not in plain["transactions"]:
        yield "belongs to no request"
        return
    asked = deal.asked
    head = asked.data[1::-1] if plain["args"].get("what") == "all_bytes" else asked.data[:1]
    if data[:1] != head[:1] and plain["rule"] not in ("DS715", "DS716"):
        yield f"the request of #{deal.id}, to which it stands, has reference {asked.reference}"
        return
    if new.changes and new.axis != asked.axis and plain["rule"] not in ("DS715", "DS716"):
        yield f"changes drive object {new.axis} instead of {asked.axis}"
    if plain["rule"] == "DS709":
        yield from _other_object(new, deal, reading)
    yield from _dangerous(new)
    yield from _refused_again(new, deal)
    if new.changes:
        yield from _unproven(new, deal, reading, memory)
    device = drives.get(deal.device)
    if device is not None:
        yield from _asked(data, deal, device, reading, memory)


def _forms(told: dict[str, Any], data: bytes) -> Iterator[str]:
    """Words, SCL and the command say the same bytes."""
    if "".join(word.removeprefix("16#") for word in told["words"]).lower() != data.hex():
        yield "the words are other bytes"
    scl = [
        part.split("16#")[1][:2]
        for part in told["scl"].replace(";", "\n").split("\n")
        if "16#" in part
    ]
    if "".join(scl).lower() != data.hex() or f"#length := {len(data)};" not in told["scl"]:
        yield "the SCL is other bytes"
    if told["encode"]:
        printed = _encoded(told["encode"])
        if printed != data.hex():
            yield f"the command prints {printed}"


def _encoded(command: str) -> str:
    from ds47.cli import main

    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        main(shlex.split(command)[1:])
    return "".join(out.getvalue().split())


def _dangerous(new: message.Message) -> Iterator[str]:
    if not new.changes:
        return
    for address, block in zip(new.addresses, new.blocks, strict=False):
        if address.pnu in SAFETY:
            yield f"changes p{address.pnu}"
        if address.pnu == 10 and any(int.from_bytes(bits) == 95 for bits in block.elements()):
            yield "sets p0010 = 95"


def _parts(asked: message.Message) -> list[tuple[object, ...]]:
    """Each parameter with all that is asked of it."""
    return [
        (
            each.attribute, each.elements, each.pnu, each.subindex,
            (asked.blocks[number].format, asked.blocks[number].raw) if asked.changes else None,
        )
        for number, each in enumerate(asked.addresses)
        if not asked.changes or number < len(asked.blocks)
    ]  # fmt: skip


def _refused_again(new: message.Message, deal: Deal) -> Iterator[str]:
    """What was refused in the same response, and stands in the correction unchanged."""
    if deal.asked is None or deal.answer is None or not deal.fits:
        return
    kept = _parts(new)
    # 0x15 speaks of the whole response, 0x19 of the drive object
    excused = {0x15} if new.axis == deal.asked.axis else {0x15, NO_SUCH_AXIS}
    for part, block in zip(_parts(deal.asked), deal.answer.blocks, strict=False):
        if block.failed and block.code not in excused and part in kept:
            yield f"keeps p{part[2]}[{part[3]}], which is refused with 0x{block.code or 0:02X}"


def _other_object(new: message.Message, deal: Deal, reading: Reading) -> Iterator[str]:
    """A read of another drive object: the only one that answers, and it was asked for each of these parameters."""
    there, missing, read = set(), set(), set()
    for each in reading.deals:
        if each.device != deal.device or each.index == LOCAL or not each.fits or not each.answer:
            continue
        if any(block.code == NO_SUCH_AXIS for block in each.answer.blocks):
            missing.add(each.axis_told)
        elif each.answer.id != 0x80:
            there.add(each.axis_told)
    for each in reading.deals:
        if (each.device, each.axis_told, each.operation) == (deal.device, new.axis, "read"):
            read |= {address.pnu for address, block in each.pairs() if not block.failed}
    if there - missing != {new.axis}:
        yield f"of the drive objects {sorted(there - missing)} one is chosen"
    for address in new.addresses:
        if address.pnu not in read:
            yield f"nothing proves p{address.pnu} of drive object {new.axis}"


def _unproven(new: message.Message, deal: Deal, reading: Reading, memory: Memory) -> Iterator[str]:
    """A change whose format the capture does not prove: by a read of the parameter, its description, a change taken."""
    for address, block in zip(new.addresses, new.blocks, strict=False):
        # what was meant may name another drive object than the bytes that were sent
        seen = formats(memory, reading, deal, address.pnu, target=_target(deal, new))
        taken = {
            each.asked.blocks[number].format
            for each in reading.deals if each.asked and each.device == deal.device
            for number, other in enumerate(each.asked.addresses)
            if other.pnu == address.pnu and each.asked.changes and _took(each, number)
        }  # fmt: skip
        said = set[int]().union(
            *(
                described(memory, deal, address.pnu, each, _target(deal, new))
                for each in reading.deals
            )
        )
        if block.format not in seen | taken | said:
            yield f"nothing proves format 0x{block.format:02X} of p{address.pnu}"


def _took(deal: Deal, number: int) -> bool:
    answer, asked = deal.answer, deal.asked
    if answer is None or asked is None or not deal.fits or answer.id == 0x80:
        return False
    if number >= len(asked.blocks):
        return False
    return not answer.blocks or (number < len(answer.blocks) and not answer.blocks[number].failed)


def _asked(
    data: bytes, deal: Deal, device: Drive, reading: Reading, memory: Memory
) -> Iterator[str]:
    """The simulated drive is really asked, at the same place."""
    answer = copy.deepcopy(device).answer(deal.slot, deal.index, data)
    if answer is None:
        yield "the drive refuses the Write"
        return
    if not answer[1] & 0x80:
        return
    new = message.request(data)
    for part, block in zip(_parts(new), message.response(answer).blocks, strict=False):
        where = _shown(new, part, block.code, deal, reading, memory) if block.failed else None
        if where is not None:
            yield f"the drive answers {answer.hex()}, as in frame {where}"


def _shown(
    new: message.Message, part: tuple[object, ...], code: int | None, deal: Deal, reading: Reading,
    memory: Memory,
) -> int | None:  # fmt: skip
    """The frame in which a parameter that may be this one was refused with this error before; None where none is."""
    for each in reading.deals:
        asked, answer = each.asked, each.answer
        if each.device != deal.device or asked is None or answer is None or not each.fits:
            continue
        if code == NO_SUCH_AXIS:
            there = any(block.code == code for block in answer.blocks)
            if there and asked.axis == new.axis and LOCAL not in (each.index, deal.index):
                return each.read
            continue
        if asked.id != new.id or memory.same(memory.target(each), _target(deal, new)) == NEVER:
            continue
        for other, block in zip(_parts(asked), answer.blocks, strict=False):
            if block.failed and block.code == code and _alike(part, other, code):
                return each.read
    return None


def _target(deal: Deal, new: message.Message) -> Target:
    local = Target(deal.device, None, (deal.slot, deal.subslot))
    return local if deal.index == LOCAL else by_axis(deal, new.axis)


def _alike(part: tuple[object, ...], other: tuple[object, ...], code: int | None) -> bool:
    """Whether the refusal of one parameter is that of the other, too."""
    if part[2] != other[2] or code == 0x15:  # which speaks of the whole response
        return False
    if code == 0x03:  # no such subindex: nor one behind it
        return _last(part) >= _last(other)
    if code in (0x09, 0x0F):
        return part[0] == other[0]
    if code in (0x04, 0x16):
        return part[:4] == other[:4]
    return part == other if code in (0x02, 0x05, 0x17, 0x18) else True


def _last(part: tuple[object, ...]) -> int:
    elements, subindex = part[1], part[3]
    assert isinstance(elements, int)
    assert isinstance(subindex, int)
    return subindex + max(1, elements)
