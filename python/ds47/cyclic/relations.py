"""Where PKW and PZD are in cyclic frames: what a Connect sets up, as relations (docs/cyclic.md 5).

Lengths alone make candidates only: which of them is a PKW channel, its first request with a response shows, and
which is PZD, the words themselves (`ds47.cyclic.channels`). Bytes of frames are not looked at here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

from ds47 import model
from ds47.cyclic.pkw import LENGTH
from ds47.model import LENGTHS, NAMED, ODD, REFUTED
from ds47.profidrive.dictionary import family_of
from ds47.profinet.connect import Connect, Data, Submodule
from ds47.spec.cyclic import PzdTelegram, drive_telegrams, size

_LEAST_PZD = 4
_PPO = ((12, 12), (20, 20))
"""Lengths of one submodule with PKW in front of its process data."""
_WORD = 2
_STATIONS = 2
"""Bytes of a sender on PROFIBUS; a MAC address has six."""
SIEMENS = 0x002A
"""PROFINET vendor id."""
_LONGEST = 1440
"""Bytes of data that a cyclic frame has at the most."""


class CyclicSide(NamedTuple):
    """One direction: the sender's MAC address and frame id, and where the channel is behind the frame id.

    Of `length` bytes only the first `watched` matter when they change. `iops` is where the state of the data
    stands, None where there is none or nobody knows; `status` where that of the frame does, None where nobody
    knows. A `cycle_ns` of 0 is not known.
    """

    source: bytes
    frame_id: int
    offset: int
    length: int
    watched: int
    iops: int | None
    status: int | None
    cycle_ns: int

    @property
    def parts(self) -> tuple[tuple[int, int], ...]:
        """Offsets and lengths of what matters, in order, apart from each other."""
        states = sorted(at for at in (self.iops, self.status) if at is not None)
        return ((self.offset, self.watched), *((at, 1) for at in states))

    def behind(self, other: CyclicSide) -> int | None:
        """How many bytes behind another one it begins, where both have bytes in common."""
        distance = self.offset - other.offset
        same = (self.source, self.frame_id) == (other.source, other.frame_id)
        return distance if same and -self.length < distance < other.length else None

    def result(self) -> model.Side:
        """The side in the form of the report."""
        if len(self.source) == _STATIONS:
            return model.Side(f"dp{self.source[0]}", None, self.offset, self.length)
        return model.Side(self.source.hex(":"), self.frame_id, self.offset, self.length)


@dataclass(slots=True)
class CyclicRelation:
    """A channel in cyclic frames between a controller and a device: `model.PKW` or `model.PZD`.

    `telegrams` are those that the lengths allow; none where no telegram has them. `frame` is that of the
    response to the Connect, `certainty` one of those of `model.Relation`. A channel that was named by hand has no
    AR and no submodule, and `frame` is its first one.
    """

    channel: model.Channel
    controller: str
    device: str
    vendor_id: int | None
    ar: bytes | None
    api: int | None
    slot: int | None
    subslot: int | None
    telegrams: tuple[int, ...]
    output: CyclicSide
    input: CyclicSide
    frame: int | None
    certainty: str = LENGTHS
    family: str | None = None
    """Of the parameters of the device, where PROFIBUS says it (`ds47.profibus.idents`)."""

    @property
    def drive_key(self) -> tuple[str, str, int | None, int | None]:
        """What PKW and PZD of one drive share: the stations and the slot, on PROFIBUS only the stations."""
        if self.is_bus:
            return self.controller, self.device, None, None
        return self.controller, self.device, self.api, self.slot

    @property
    def spot(self) -> tuple[int | None, int | None]:
        """Channels at different spots have no bytes in common: slot and subslot, on PROFIBUS the offsets."""
        if self.is_bus:
            return self.output.offset, self.input.offset
        return self.slot, self.subslot

    def meets(self, other: CyclicRelation) -> tuple[bool, bool]:
        """Whether both have bytes in common, in either direction; whether they are the same channel there."""
        distances = self.output.behind(other.output), self.input.behind(other.input)
        return distances != (None, None), self.channel == other.channel and distances == (0, 0)

    @property
    def is_bus(self) -> bool:
        """Whether it is one of PROFIBUS: senders are stations, two bytes with the receiver."""
        return len(self.output.source) == _STATIONS

    @property
    def station(self) -> int | None:
        """The slave on PROFIBUS."""
        return self.input.source[0] if self.is_bus else None

    @property
    def drives(self) -> str:
        """The family of its parameters, if known."""
        return family_of(self.vendor_id, self.family)

    @property
    def is_named(self) -> bool:
        """Whether a user said that it is a drive."""
        return self.certainty in (NAMED, ODD, REFUTED)

    @property
    def is_foreign(self) -> bool:
        """Whether nothing shows Siemens as its maker, the only one with tables here."""
        return self.vendor_id != SIEMENS

    @property
    def is_of_others(self) -> bool:
        """Whether it is known to be of another maker: from bit 11 on its words are not those of the profile."""
        return self.vendor_id not in (None, SIEMENS)

    def result(self) -> model.Relation:
        """The relation in the form of the report."""
        return model.Relation(
            channel=self.channel, controller=self.controller, device=self.device, api=self.api,
            slot=self.slot, subslot=self.subslot, telegrams=list(self.telegrams),
            output=self.output.result(), input=self.input.result(),
            cycle_ms=self.input.cycle_ns / 1e6 or None, frame=self.frame, certainty=self.certainty,
        )  # fmt: skip


class Found(NamedTuple):
    """A candidate: the channel, where it is in the data of a submodule, and what its lengths allow."""

    channel: model.Channel
    submodule: Submodule
    offset: int
    telegrams: tuple[int, ...]


def channels(connect: Connect, vendor_id: int | None) -> Iterator[Found]:
    """What may be a channel of a drive in the data that a Connect sets up.

    PKW: eight bytes beside process data in one slot; or twelve or twenty in one submodule, as PPO1 and PPO2 have
    them. PZD: what stands beside or behind them, or has the lengths of a telegram, whosever it is.

    Args:
        connect: what it sets up.
        vendor_id: of the device, None where nothing says it. Only telegrams that its maker has are named.
    """
    both = [each for each in connect.submodules if _fits(each.input) and _fits(each.output)]
    both.sort(key=lambda each: (each.api, each.slot, each.subslot))
    for _, slot in groupby(both, key=lambda each: (each.api, each.slot)):
        yield from _of_slot(list(slot), vendor_id)


def _of_slot(there: list[Submodule], maker: int | None) -> Iterator[Found]:
    pzd = [lengths for each in there if min(lengths := _lengths(each)) >= _LEAST_PZD]
    words = (LENGTH, LENGTH)
    others = (
        [lengths for lengths in pzd if lengths != words] if words in map(_lengths, there) else []
    )
    for each in there:
        lengths = _lengths(each)
        if lengths == words and others:
            yield Found(model.PKW, each, 0, fitting_telegrams(others, maker, pkw=True))
            continue
        if lengths in _PPO:
            rest = (lengths[0] - LENGTH, lengths[1] - LENGTH)
            yield Found(model.PKW, each, 0, fitting_telegrams([rest], maker, pkw=True))
            yield Found(model.PZD, each, LENGTH, fitting_telegrams([rest], maker, pkw=True))
        may_be = (others and min(lengths) >= _LEAST_PZD) or any(_rows([lengths], bool(others)))
        if may_be:
            numbers = fitting_telegrams([lengths], maker, pkw=bool(others))
            yield Found(model.PZD, each, 0, numbers)


def _fits(data: Data | None) -> bool:
    """Whether data lies in its frame: what a device sets up does, a broken capture may say anything."""
    return (
        data is not None and data.offset + data.length + data.iops <= data.frame_length <= _LONGEST
    )


def _lengths(submodule: Submodule) -> tuple[int, int]:
    assert submodule.output is not None
    assert submodule.input is not None
    return submodule.output.length, submodule.input.length


def fitting_telegrams(
    lengths: list[tuple[int, int]], vendor_id: int | None, pkw: bool
) -> tuple[int, ...]:
    """The telegrams that a maker has, with or without PKW, with process data of one of these lengths.

    Args:
        lengths: bytes, output and input.
        vendor_id: the maker, None where nothing says it: a number above those of the profile is somebody's.
        pkw: whether PKW stands beside or before it.
    """
    return tuple(row.number for row in _rows(lengths, pkw) if row.is_of(vendor_id))


def _rows(lengths: list[tuple[int, int]], pkw: bool) -> Iterator[PzdTelegram]:
    """The telegrams of drives of any maker with these lengths."""
    for each in lengths:
        for row in drive_telegrams().values():
            if row.pkw == pkw and row.sizes == each:
                yield row


def sizes() -> set[tuple[int, int]]:
    """Bytes of process data, out and in, that telegrams of drives have."""
    return {row.sizes for row in drive_telegrams().values()}


def side(data: Data, source: str, channel: str = model.PKW, offset: int = 0) -> CyclicSide:
    """A direction of a channel that begins `offset` bytes behind the data of a submodule."""
    whole = LENGTH if channel == model.PKW else data.length - offset
    return CyclicSide(
        source=bytes.fromhex(source.replace(":", "")),
        frame_id=data.frame_id,
        offset=data.offset + offset,
        length=whole,
        watched=LENGTH if channel == model.PKW else _WORD,
        iops=data.offset + data.length if data.iops else None,
        status=data.frame_length + 2,  # behind the cycle counter
        cycle_ns=data.cycle_ns,
    )


def offset_of(word: str, telegram_numbers: tuple[int, ...]) -> int | None:
    """The offset of a word in the drive's data, if only one telegram is possible and has the word; else None."""
    if len(telegram_numbers) != 1:
        return None
    words = drive_telegrams()[telegram_numbers[0]].inward
    return size(words[: words.index(word)]) if word in words else None
