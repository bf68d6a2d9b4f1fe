"""Judgement: a change that was not accepted because the drive was in operation, or was not (DS530, DS531).

An error number about a state, and the state that the status word shows at that time. Only where it is proven that
both are of the same drive object; docs/cyclic.md 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ds47.cyclic.channels import DriveWords
from ds47.cyclic.operation import state_key
from ds47.findings.remark import Remark
from ds47.model import Transaction
from ds47.spec import cyclic

_OF_SUBMODULE = 0xB02E
"""Record index that addresses the drive object of its submodule."""


@dataclass(frozen=True, slots=True)
class TurnedDown:
    """A change of a parameter with an error number about a state: from which frame to which."""

    device: str
    slot: int | None
    index: int | None
    pnu: int | None
    subindex: int | None
    request: int
    response: int
    family: str | None
    """The family of the drive's parameters."""


def turned_down(item: Transaction) -> TurnedDown | None:
    """The first parameter of a change with an error number about a state; None without one."""
    first, last = item.frames.write_request, item.frames.read_response
    if item.operation != "change" or first is None or last is None:
        return None
    for each in item.parameters:
        if each.error is not None and each.error.code in cyclic.state_errors():
            return TurnedDown(
                item.device, item.slot, item.index, each.pnu, each.subindex, first, last,
                each.family,
            )  # fmt: skip
    return None


def explain(it: TurnedDown, drives: Sequence[DriveWords]) -> Remark | None:
    """What the status word of the same drive object says; None where that is not known."""
    drive = _same(it, drives)
    if drive is None or not drive.recorder.has_sense:
        return None
    if drive.replaced is not None and drive.replaced < it.request:
        return None  # of what a later Connect set up nothing is known
    running = drive.recorder.running(it.request, it.response)
    if running is None:
        return None
    which = {"pnu": it.pnu, "subindex": it.subindex, "family": it.family}
    if running:
        since = drive.recorder.running_since(it.request)
        what = "pzd_since_ever" if since is None else "pzd_since"
        return Remark("DS530", it.response, which | {"what": what, "since": since})
    state = drive.recorder.state_at(it.response)
    return Remark("DS531", it.response, which | {"what": state_key(state or "not ready")})


def _same(it: TurnedDown, drives: Sequence[DriveWords]) -> DriveWords | None:
    """The drive in the slot that was asked, where no other one can be meant."""
    there = [each for each in drives if each.relation.device == it.device]
    slot = [each for each in there if each.relation.slot == it.slot]
    alone = len(there) == 1 or it.index == _OF_SUBMODULE or it.index is None
    return slot[0] if len(slot) == 1 and alone else None
