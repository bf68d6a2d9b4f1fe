"""What a Connect sets up: which bytes of which cyclic frames belong to which submodule (docs/protocol.md F.6).

Turns request and response into offsets in frames. `ds47.cyclic` decides whether the bytes are PKW, PZD or neither.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import (
    BLOCK_AR_REQUEST,
    BLOCK_AR_RESPONSE,
    BLOCK_EXPECTED_SUBMODULES,
    BLOCK_IOCR_REQUEST,
    BLOCK_IOCR_RESPONSE,
    NDR_SIZE,
)

INPUT, OUTPUT = 1, 2
"""Types of communication relations, and of data: device to controller, and the other way."""
_HEADER = struct.Struct(">HH2x")
"""Type, length (from the version on), version."""
_IOCR = struct.Struct(">HHHIHHHHHHIHHH6sH")
_OBJECT = struct.Struct(">HHH")
_SUBMODULE = struct.Struct(">HIH")
_DESCRIPTION = struct.Struct(">HHBB")
_TICK_NS = 31_250
SubmoduleKey = tuple[int, int, int]
"""API, slot and subslot."""
Described = tuple[int, dict[int, tuple[int, int]]]
"""The ident number of a submodule, and by direction the lengths of its data and of IOPS."""
_BOTH = 3
"""Properties of a submodule that has input and output."""


class Data(NamedTuple):
    """The place of a submodule's data in cyclic frames, in one direction.

    `offset` counts from the first byte after the frame id; `iops` bytes of IOPS follow the data. `cycle_ns` is
    the time between two frames, `reference` that of the communication relation. The status of the frame follows
    the `frame_length` bytes of data of all submodules.
    """

    reference: int
    frame_id: int
    offset: int
    length: int
    iops: int
    cycle_ns: int
    frame_length: int


class Submodule(NamedTuple):
    """A submodule that a Connect expects, with its data in either direction; None if it has none."""

    api: int
    slot: int
    subslot: int
    ident: int
    input: Data | None
    output: Data | None


class Connect(NamedTuple):
    """What a Connect request asks for: the AR, the MAC address of the controller, and the submodules with data."""

    ar: bytes
    controller_mac: str
    submodules: tuple[Submodule, ...]

    def answered(self, frame_ids: Mapping[int, int]) -> Connect:
        """The same with the frame ids that the device chose, by the reference of their relation."""
        submodules = (
            each._replace(input=_with(each.input, frame_ids), output=_with(each.output, frame_ids))
            for each in self.submodules
        )
        return self._replace(submodules=tuple(submodules))

    def frame_lengths(self) -> dict[int, int]:
        """Frame id -> bytes of data of all submodules."""
        both = (data for each in self.submodules for data in (each.input, each.output))
        return {data.frame_id: data.frame_length for data in both if data is not None}


def _with(data: Data | None, frame_ids: Mapping[int, int]) -> Data | None:
    if data is None:
        return None
    return data._replace(frame_id=frame_ids.get(data.reference, data.frame_id))


class _Relation(NamedTuple):
    """One IOCRBlockReq: the place of each submodule in its frames."""

    kind: int
    reference: int
    frame_id: int
    cycle_ns: int
    frame_length: int
    offsets: dict[SubmoduleKey, int]


def parse_request(pdu: Pdu) -> Connect | None:
    """What a Connect request asks for; None if it has no AR, or a block that is cut off or does not parse."""
    ar, mac = b"", ""
    relations: list[_Relation] = []
    expected: dict[SubmoduleKey, Described] = {}
    try:
        for kind, block in _blocks(pdu.body):
            if kind == BLOCK_AR_REQUEST:
                ar, mac = block[2:18], block[20:26].hex(":")
            elif kind == BLOCK_IOCR_REQUEST:
                relations.append(_relation(block))
            elif kind == BLOCK_EXPECTED_SUBMODULES:
                expected.update(_expected(block))
    except (struct.error, ValueError):
        return None
    if len(ar) < 16 or len(mac) < 17:
        return None
    return Connect(ar, mac, tuple(_submodules(relations, expected)))


def parse_response(pdu: Pdu) -> tuple[bytes, str, dict[int, int]] | None:
    """The AR, the MAC address of the device, and the frame id of each relation by its reference; None as above."""
    ar, mac = b"", ""
    frame_ids: dict[int, int] = {}
    try:
        for kind, block in _blocks(pdu.body):
            if kind == BLOCK_AR_RESPONSE:
                ar, mac = block[2:18], block[20:26].hex(":")
            elif kind == BLOCK_IOCR_RESPONSE:
                _, reference, frame_id = _OBJECT.unpack_from(block)
                frame_ids[reference] = frame_id
    except (struct.error, ValueError):
        return None
    return (ar, mac, frame_ids) if len(ar) == 16 and len(mac) == 17 else None


def _blocks(body: bytes) -> Iterator[tuple[int, bytes]]:
    """Type of each block, and its content after the version.

    Raises:
        ValueError: a block ends before it should.
    """
    offset = NDR_SIZE
    while offset + _HEADER.size <= len(body):
        kind, length = _HEADER.unpack_from(body, offset)
        end = offset + 4 + length
        if length < 2 or end > len(body):
            raise ValueError(f"a block of {length} bytes ends behind the message")
        yield kind, body[offset + _HEADER.size : end]
        offset = end


def _relation(block: bytes) -> _Relation:
    """An IOCRBlockReq after its version."""
    kind, reference, _, _, length, frame_id, clock, reduction, *_, apis = _IOCR.unpack_from(block)
    offsets: dict[SubmoduleKey, int] = {}
    at = _IOCR.size
    for _ in range(apis):
        (api,) = struct.unpack_from(">I", block, at)
        at += 4
        for is_data in (True, False):  # the data of submodules, then the IOCS of others
            (count,) = struct.unpack_from(">H", block, at)
            at += 2
            for _ in range(count):
                slot, subslot, offset = _OBJECT.unpack_from(block, at)
                at += _OBJECT.size
                if is_data:
                    offsets[api, slot, subslot] = offset
    return _Relation(kind, reference, frame_id, clock * reduction * _TICK_NS, length, offsets)


def _expected(
    block: bytes,
) -> Iterator[tuple[SubmoduleKey, Described]]:
    """Each submodule in an ExpectedSubmoduleBlockReq, and its description."""
    (apis,) = struct.unpack_from(">H", block)
    at = 2
    for _ in range(apis):
        api, slot, _, _, count = struct.unpack_from(">IHIHH", block, at)
        at += 14
        for _ in range(count):
            subslot, ident, properties = _SUBMODULE.unpack_from(block, at)
            at += _SUBMODULE.size
            lengths: dict[int, tuple[int, int]] = {}
            for _ in range(2 if properties & _BOTH == _BOTH else 1):
                direction, length, _, iops = _DESCRIPTION.unpack_from(block, at)
                at += _DESCRIPTION.size
                lengths[direction] = length, iops
            yield (api, slot, subslot), (ident, lengths)


def _submodules(
    relations: list[_Relation],
    expected: dict[SubmoduleKey, Described],
) -> Iterator[Submodule]:
    """The submodules that have data in a cyclic frame."""
    for key, (ident, lengths) in expected.items():
        found: dict[int, Data] = {}
        for relation in relations:
            offset, described = relation.offsets.get(key), lengths.get(relation.kind)
            if offset is not None and described is not None and described[0]:
                frame = relation.reference, relation.frame_id
                about = relation.cycle_ns, relation.frame_length
                found[relation.kind] = Data(*frame, offset, *described, *about)
        if found:
            yield Submodule(*key, ident, found.get(INPUT), found.get(OUTPUT))
