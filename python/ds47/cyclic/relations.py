"""Where PKW is in cyclic frames: what a Connect sets up, as relations (docs/cyclic.md 5).

Lengths alone make candidates only: which of them is a PKW channel, its first request with a response shows
(`ds47.cyclic.channels`). Bytes of frames are not looked at here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

from ds47 import model
from ds47.cyclic.pkw import LENGTH
from ds47.model import LENGTHS
from ds47.profinet.connect import Connect, Data, Submodule

_LEAST_PZD = 4
_LONGEST = 1440
"""Bytes of data that a cyclic frame has at the most."""


@dataclass(frozen=True, slots=True)
class Side:
    """One direction: the sender's MAC address and frame id, and where the channel is behind the frame id.

    `iops` is where the state of the data stands, None where there is none; `status` where that of the frame does.
    """

    source: bytes
    frame_id: int
    offset: int
    length: int
    iops: int | None
    status: int
    cycle_ns: int

    @property
    def parts(self) -> tuple[tuple[int, int], ...]:
        """Offsets and lengths of what matters, in order, apart from each other."""
        states = sorted(at for at in (self.iops, self.status) if at is not None)
        return ((self.offset, self.length), *((at, 1) for at in states))

    def told(self) -> model.Side:
        """As the report has it."""
        return model.Side(self.source.hex(":"), self.frame_id, self.offset, self.length)


@dataclass(slots=True)
class Relation:
    """A parameter channel in cyclic frames between a controller and a device.

    `telegrams` are those that the lengths allow; none where no telegram has them. `frame` is that of the
    response to the Connect, `certainty` one of `model.LENGTHS` and `model.SEEN`.
    """

    controller: str
    device: str
    vendor_id: int | None
    ar: bytes
    api: int
    slot: int
    subslot: int
    telegrams: tuple[int, ...]
    output: Side
    input: Side
    frame: int
    certainty: str = LENGTHS

    def told(self) -> model.Relation:
        """As the report has it."""
        return model.Relation(
            channel=model.PKW, controller=self.controller, device=self.device, api=self.api,
            slot=self.slot, subslot=self.subslot, telegrams=list(self.telegrams),
            output=self.output.told(), input=self.input.told(),
            cycle_ms=self.input.cycle_ns / 1e6, frame=self.frame, certainty=self.certainty,
        )  # fmt: skip


def parameter_channels(connect: Connect) -> Iterator[tuple[Submodule, tuple[int, ...]]]:
    """The submodules whose first eight bytes may be PKW, with the telegrams that their lengths allow.

    Eight bytes beside process data in one slot; or twelve or twenty in one submodule, as PPO1 and PPO2 have them.
    """
    both = [each for each in connect.submodules if _fits(each.input) and _fits(each.output)]
    both.sort(key=lambda each: (each.api, each.slot, each.subslot))
    for _, slot in groupby(both, key=lambda each: (each.api, each.slot)):
        there = list(slot)
        pzd = [lengths for each in there if min(lengths := _lengths(each)) >= _LEAST_PZD]
        for each in there:
            lengths = _lengths(each)
            if lengths == (LENGTH, LENGTH):
                others = [other for other in pzd if other != lengths]
                if others:
                    yield each, _telegrams(others)
            elif lengths in ((12, 12), (20, 20)):
                rest = lengths[0] - LENGTH
                yield each, _telegrams([(rest, rest)])


def _fits(data: Data | None) -> bool:
    """Whether data lies in its frame: what a device sets up does, a broken capture may say anything."""
    return (
        data is not None and data.offset + data.length + data.iops <= data.frame_length <= _LONGEST
    )


def _lengths(submodule: Submodule) -> tuple[int, int]:
    assert submodule.output is not None
    assert submodule.input is not None
    return submodule.output.length, submodule.input.length


def _telegrams(lengths: list[tuple[int, int]]) -> tuple[int, ...]:
    """The telegrams with PKW whose process data has one of these lengths."""
    known = {(4, 4): 353, (12, 12): 354}
    return tuple(known[each] for each in lengths if each in known)


def side(data: Data, source: str) -> Side:
    """A direction of a parameter channel at the beginning of the data of a submodule."""
    return Side(
        source=bytes.fromhex(source.replace(":", "")),
        frame_id=data.frame_id,
        offset=data.offset,
        length=LENGTH,
        iops=data.offset + data.length if data.iops else None,
        status=data.frame_length + 2,  # behind the cycle counter
        cycle_ns=data.cycle_ns,
    )
