"""Whether a drive would take a corrected request, and whether the capture proves it.

Of a simulated drive the request is really asked. Of every other capture the auditor knows what the capture itself
shows: a parameter that was refused is refused again where nothing of it was changed.
"""

from __future__ import annotations

import contextlib
import copy
import io
import shlex
from collections.abc import Iterator
from typing import Any

from tests.audit import message
from tests.audit.causes import formats
from tests.audit.drive import Drive
from tests.audit.memory import Memory
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
    deals = [reading.by_id[number] for number in plain["transactions"] if number in reading.by_id]
    deals = [each for each in deals if each.asked is not None]
    if not deals or deals[0].asked is None:
        yield "belongs to no request"
        return
    deal, asked = deals[0], deals[0].asked
    head = asked.data[1::-1] if plain["args"].get("what") == "all_bytes" else asked.data[:1]
    if data[:1] != head[:1] and plain["rule"] not in ("DS715", "DS716"):
        yield f"the request of #{deal.id}, to which it stands, has reference {asked.reference}"
        return
    if new.changes and new.axis != asked.axis and plain["rule"] not in ("DS715", "DS716"):
        yield f"changes drive object {new.axis} instead of {asked.axis}"
    yield from _dangerous(new)
    yield from _refused_again(new, deal)
    if new.changes:
        yield from _unproven(new, deal, reading, memory)
    device = drives.get(deal.device)
    if device is not None:
        yield from _asked(data, deal, device, reading)


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
    for part, block in zip(_parts(deal.asked), deal.answer.blocks, strict=False):
        if block.failed and block.code != 0x15 and part in kept:
            yield f"keeps p{part[2]}[{part[3]}], which is refused with 0x{block.code or 0:02X}"


def _unproven(new: message.Message, deal: Deal, reading: Reading, memory: Memory) -> Iterator[str]:
    """A change whose format the capture does not prove, by a read of the parameter or a change that was taken."""
    for address, block in zip(new.addresses, new.blocks, strict=False):
        seen = formats(memory, reading, deal, address.pnu)
        taken = {
            each.asked.blocks[number].format
            for each in reading.deals if each.asked and each.device == deal.device
            for number, other in enumerate(each.asked.addresses)
            if other.pnu == address.pnu and each.asked.changes and _took(each, number)
        }  # fmt: skip
        if block.format not in seen | taken:
            yield f"nothing proves format 0x{block.format:02X} of p{address.pnu}"


def _took(deal: Deal, number: int) -> bool:
    answer, asked = deal.answer, deal.asked
    if answer is None or asked is None or not deal.fits or answer.id == 0x80:
        return False
    if number >= len(asked.blocks):
        return False
    return not answer.blocks or (number < len(answer.blocks) and not answer.blocks[number].failed)


def _asked(data: bytes, deal: Deal, device: Drive, reading: Reading) -> Iterator[str]:
    """The simulated drive is really asked, at the same place."""
    answer = copy.deepcopy(device).answer(deal.slot, deal.index, data)
    if answer is None:
        yield "the drive refuses the Write"
        return
    if not answer[1] & 0x80:
        return
    shown = {
        (address.pnu, block.code)
        for each in reading.deals
        if each.device == deal.device
        for address, block in each.pairs()
        if block.failed
    }
    asked = zip(message.request(data).addresses, message.response(answer).blocks, strict=False)
    new = {(address.pnu, block.code) for address, block in asked if block.failed}
    known = "" if new & shown else ", of which this capture shows nothing"
    yield f"the drive answers {answer.hex()}{known}"
