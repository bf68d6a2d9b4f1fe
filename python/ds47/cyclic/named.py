"""Channels that a user names, where a capture has no Connect: their notation, and relations (docs/cyclic.md 5).

A name says who sends a channel and where it is; two of them make a relation, the first for the frames of the
controller. What a Connect would say besides (addresses, slot, IOPS, cycle time) nobody knows.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from ds47.cyclic.pkw import LENGTH
from ds47.cyclic.relations import CyclicRelation, CyclicSide
from ds47.model import NAMED, PKW, PZD, Channel
from ds47.spec import profibus

KINDS: Final = ("pkw", "pzd", "ppo1")
"""PKW; PZD that begins with a control or status word; PKW with PZD behind it."""
_NAME = re.compile(
    r"((?:[0-9a-f]{2}[:-]){5}[0-9a-f]{2})@(?:0x)?([0-9a-f]{1,4}):(\d{1,4}):(\w+)", re.IGNORECASE
)
_FORM = "MAC@FRAMEID:OFFSET:KIND, as in 00:1b:1b:11:22:33@8000:0:pkw"
_PPO = re.compile(r"([0-9]{1,3})=ppo([0-9])", re.IGNORECASE)
_LAST_STATION = 126
"""The highest address of a station of PROFIBUS."""
_FIRST, _LAST = 0x0100, 0xFBFF
"""Frame ids of cyclic frames."""
_LONGEST = 1440
_PZD_LENGTH = 4
"""STW1 and setpoint, ZSW1 and actual value: what all telegrams have."""


def parse_ppo(text: str) -> tuple[int, int]:
    """A station of PROFIBUS and its PPO as they are typed: `3=ppo1`.

    Raises:
        ValueError: what is wrong, and what is allowed.
    """
    found = _PPO.fullmatch(text.strip())
    known = {row.number for row in profibus.ppos()}
    if found is None or int(found[1]) > _LAST_STATION or int(found[2]) not in known:
        names = ", ".join(f"ppo{number}" for number in sorted(known))
        raise ValueError(
            f"{text!r} is not STATION=PPO, as in 3=ppo1: 0 to {_LAST_STATION}; {names}"
        )
    return int(found[1]), int(found[2])


class Name(NamedTuple):
    """One direction of a channel: the sender's MAC address and frame id, and where it is behind the frame id."""

    mac: str
    frame_id: int
    offset: int
    kind: str


def parse(text: str) -> Name:
    """A name as it is typed: `00:1b:1b:11:22:33@8000:0:pkw`, the frame id in hex.

    Raises:
        ValueError: what is wrong, and what a name looks like.
    """
    found = _NAME.fullmatch(text.strip())
    if found is None:
        raise ValueError(f"{text!r} is not {_FORM}")
    mac, frame_id, offset, kind = found.groups()
    if kind.lower() not in KINDS:
        raise ValueError(f"{text!r}: {kind!r} is none of {', '.join(KINDS)}")
    if not _FIRST <= int(frame_id, 16) <= _LAST:
        raise ValueError(
            f"{text!r}: cyclic frames have a frame id from {_FIRST:04X} to {_LAST:04X}"
        )
    if int(offset) >= _LONGEST:
        raise ValueError(f"{text!r}: a cyclic frame has at most {_LONGEST} bytes of data")
    return Name(mac.lower().replace("-", ":"), int(frame_id, 16), int(offset), kind.lower())


def pairs(names: Sequence[Name]) -> list[tuple[Name, Name]]:
    """Two and two of them: the direction from the controller, and that from the drive.

    Raises:
        ValueError: one is left over, or two differ in their kind.
    """
    if len(names) % 2:
        one = names[-1]
        raise ValueError(
            f"a channel has two directions: {one.mac}@{one.frame_id:04X} wants a second name,"
            " first the controller's frames, then the drive's"
        )
    found = list(zip(names[::2], names[1::2], strict=True))
    for output, input_ in found:
        if output.kind != input_.kind:
            raise ValueError(
                f"{output.kind} of {output.mac} and {input_.kind} of {input_.mac}:"
                " both directions of a channel are of one kind"
            )
    return found


def relations(names: Sequence[Name]) -> Iterator[CyclicRelation]:
    """The channels that names stand for; see `pairs`."""
    for output, input_ in pairs(names):
        if output.kind != "pzd":
            yield _relation(PKW, output, input_, 0, LENGTH)
        if output.kind != "pkw":
            behind = LENGTH if output.kind == "ppo1" else 0
            yield _relation(PZD, output, input_, behind, _PZD_LENGTH)


def _relation(
    channel: Channel, output: Name, input_: Name, behind: int, length: int
) -> CyclicRelation:
    sides = [
        CyclicSide(
            bytes.fromhex(name.mac.replace(":", "")), name.frame_id, name.offset + behind, length,
            watched=length if channel == PKW else 2, iops=None, status=None, cycle_ns=0,
        )
        for name in (output, input_)
    ]  # fmt: skip
    return CyclicRelation(
        channel, output.mac, input_.mac, vendor_id=None, ar=None, api=None, slot=None, subslot=None,
        telegrams=(), output=sides[0], input=sides[1], frame=None, certainty=NAMED,
    )  # fmt: skip
