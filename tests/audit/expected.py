"""A golden list (`--expect`), recounted: which elements of DS47 are not as it has them, and what DS602 claims.

A list is here no more than numbers of parameters with a number each, for every drive object of every drive (no scaling).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from tests.audit.claims import Case, means
from tests.audit.memory import Memory, Target, elements, outcome
from tests.audit.reading import Complaint, Deal, Reading

PLAIN = (*range(0x02, 0x09), 0x41, 0x42, 0x43)
"""Formats whose bytes are the value: whole numbers, Float32, words."""
Shown = tuple[int, bytes, int]
"""The frame that shows a value, its bytes and their format."""


def of(case: Case) -> Iterator[str]:
    """What of one finding is not so; of a transaction that is none of DS47 only what it says itself."""
    told, wanted = case.args.get("value"), str(case.args.get("expected"))
    if re.fullmatch(r"-?\d+(\.\d+)?", wanted) and told == float(wanted):
        yield f"{told!r} is {wanted}"
    yield from case.wrong("by", case.frame)
    deal = case.deal
    if deal is None or deal.cyclic:
        return
    yield from case.wrong("device", deal.device)
    yield from case.wrong("how", f"expected_{'read' if deal.operation == 'read' else 'written'}")
    element = case.args.get("pnu"), case.args.get("subindex")
    here = [
        (bits, code) for each, (frame, bits, code) in _shown(deal)
        if each == element and frame == case.frame
    ]  # fmt: skip
    if not here:
        yield f"no value of p{element[0]}[{element[1]}] is in this frame"
    elif not any(code not in PLAIN or means(told, bits, code) for bits, code in here):
        yield f"value {told!r} is none of {[bits.hex() for bits, _ in here]}"


def check(item: Reading, memory: Memory, wanted: Mapping[int, float]) -> Iterator[Complaint]:
    """Of each element with a plain format DS602 is said if its last value is not the wanted one, and only then.

    Not of captures with values that nobody asked for, that are cut off, or of which a rule says that they are stale.
    """
    last: dict[tuple[str, Target | None, int, int], Shown] = {}
    for deal in item.deals:
        for (pnu, subindex), shown in () if deal.cyclic else _shown(deal):
            element = deal.device, memory.target(deal), pnu, subindex
            if element not in last or last[element][0] <= shown[0]:
                last[element] = shown
    true = {
        (device, pnu, subindex, frame) for (device, _, pnu, subindex), (frame, bits, code) in last.items()
        if pnu in wanted and code in PLAIN and not means(wanted[pnu], bits, code)
    }  # fmt: skip
    told = {
        (each.args["device"], each.args["pnu"], each.args["subindex"], each.frame)
        for each in item.findings
        if each.rule == "DS602" and (deal := item.deal(each)) is not None and not deal.cyclic
    }
    known = {
        (device, pnu, subindex) for (device, _, pnu, subindex), (*_, code) in last.items() if code in PLAIN
    }  # fmt: skip
    for device, pnu, subindex, frame in sorted(true ^ {each for each in told if each[:3] in known}):
        what = "is not" if (device, pnu, subindex, frame) in told else "is"
        yield Complaint(
            "DS602",
            f"frame {frame}",
            f"p{pnu}[{subindex}] of {device} {what} otherwise than wanted",
        )


def _shown(deal: Deal) -> Iterator[tuple[tuple[int, int], Shown]]:
    """Each element of which a transaction shows the value: read from the drive, or written and accepted."""
    if deal.asked is None or deal.answer is None or deal.read is None or not deal.fits:
        return
    blocks = deal.answer.blocks if deal.operation == "read" else deal.asked.blocks
    for number, (address, block) in enumerate(zip(deal.asked.addresses, blocks, strict=False)):
        if deal.operation != "read" and not outcome(deal, number):
            continue
        for subindex, bits in elements(address, block):
            yield (address.pnu, subindex), (deal.read, bits, block.format)
