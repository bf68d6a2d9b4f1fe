"""What of a frame is in its anonymised export: every field by name, as the standards lay them out.

Written apart from `ds47.export`: this is the list that test_anonymise_bytes.py holds against it. What is neither
KEPT nor REPLACED is of no use to anybody who reads the export, and must not be in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

KEPT, REPLACED, MARKED, UNREAD = "kept", "replaced", "marked", "unread"
"""As it is; another value; A5 for what is not zero; the same whatever the original had."""

Layout = Iterable[tuple[str, int, str]]
"""Names, sizes and what becomes of the field."""

ETHERNET = (("destination", 6, REPLACED), ("source", 6, REPLACED))
IPV4 = (
    ("version and length of header", 1, KEPT), ("kind of service", 1, UNREAD), ("total length", 2, KEPT),
    ("identification", 2, KEPT), ("fragment", 2, KEPT), ("time to live", 1, UNREAD), ("protocol", 1, KEPT),
    ("header checksum", 2, UNREAD), ("source address", 4, REPLACED), ("destination address", 4, REPLACED),
)  # fmt: skip
UDP = (("ports", 4, KEPT), ("UDP length", 2, KEPT), ("UDP checksum", 2, UNREAD))
RPC = (
    ("RPC version", 1, KEPT), ("PDU type", 1, KEPT), ("flags", 1, KEPT), ("more flags", 1, UNREAD),
    ("byte order", 1, KEPT), ("kind of numbers, reserved, serial number", 3, UNREAD),
    ("object UUID", 16, KEPT), ("interface UUID", 16, KEPT), ("activity UUID", 16, REPLACED),
    ("boot time", 4, UNREAD), ("interface version", 4, UNREAD), ("sequence number", 4, KEPT),
    ("operation", 2, KEPT), ("hints", 4, UNREAD), ("length of body", 2, KEPT), ("fragment number", 2, KEPT),
    ("authentication, serial number", 2, UNREAD),
)  # fmt: skip
NDR = (
    ("maximum or status", 4, KEPT), ("length of arguments", 4, KEPT), ("size of array", 4, KEPT),
    ("offset of array", 4, UNREAD), ("length of array", 4, KEPT),
)  # fmt: skip
BLOCK = (("block type", 2, KEPT), ("block length", 2, KEPT), ("block version", 2, KEPT))
RECORD = (
    ("record sequence number", 2, KEPT), ("AR UUID", 16, REPLACED), ("API", 4, KEPT), ("slot", 2, KEPT),
    ("subslot", 2, KEPT), ("padding of place", 2, UNREAD), ("index", 2, KEPT), ("record data length", 4, KEPT),
)  # fmt: skip
TARGET = "target AR UUID"
ADDITIONAL = ("additional values", 4, KEPT)
OF_RECORD: dict[int, Layout] = {
    0x0008: (("padding of record", 24, UNREAD),),
    0x0009: ((TARGET, 16, REPLACED), ("padding of record", 8, UNREAD)),
    0x8008: (ADDITIONAL, ("status", 4, KEPT), ("padding of record", 16, UNREAD)),
    0x8009: (ADDITIONAL, ("padding of record", 20, UNREAD)),
}
AR_REQUEST = (
    ("AR type", 2, KEPT), ("AR UUID", 16, REPLACED), ("session key", 2, KEPT), ("MAC address", 6, REPLACED),
    ("object UUID", 16, KEPT), ("AR properties", 4, KEPT), ("timeout", 2, KEPT), ("port", 2, KEPT),
    ("length of name", 2, KEPT),
)  # fmt: skip
AR_RESPONSE = (
    ("AR type", 2, KEPT), ("AR UUID", 16, REPLACED), ("session key", 2, KEPT), ("MAC address", 6, REPLACED),
    ("port", 2, KEPT),
)  # fmt: skip
LIFE = (
    ("reserved", 2, UNREAD), ("AR UUID", 16, REPLACED), ("session key", 2, KEPT), ("reserved", 2, UNREAD),
    ("control command", 2, KEPT), ("control properties", 2, KEPT),
)  # fmt: skip
RELATION = ("communication relation", -1, KEPT)
"""Numbers of data and time, slots and offsets; -1: up to the end of the block."""
OF_BLOCK: dict[int, Layout] = {
    0x0101: (*AR_REQUEST, ("station name", -1, REPLACED)),
    0x8101: AR_RESPONSE,
    0x0102: (RELATION,), 0x8102: (RELATION,), 0x0104: (("expected submodules", -1, KEPT),),
    0x0114: LIFE, 0x8114: LIFE,
}  # fmt: skip
DCP_OPTIONS: dict[tuple[int, int], Layout] = {
    (1, 2): (("address", 4, REPLACED), ("mask", 4, KEPT), ("gateway", 4, REPLACED)),
    (2, 2): (("station name", -1, REPLACED),),
    (2, 3): (("vendor and device id", 4, KEPT),),
    (2, 4): (("role", 1, KEPT), ("reserved", 1, UNREAD)),
}


class Field(NamedTuple):
    """A field of a frame, and what becomes of it."""

    name: str
    start: int
    end: int
    kind: str


@dataclass
class Walk:
    """Goes through the bytes of a frame, and names each."""

    data: bytes
    fields: list[Field] = field(default_factory=list)

    @property
    def at(self) -> int:
        """Where the next field begins."""
        return self.fields[-1].end if self.fields else 0

    def number(self, offset: int, size: int = 2) -> int:
        """A number, so many bytes behind."""
        start = self.at + offset
        return int.from_bytes(self.data[start : start + size], "big")

    def take(self, name: str, size: int, kind: str) -> None:
        """The next field."""
        if size:
            self.fields.append(Field(name, self.at, self.at + size, kind))

    def all(self, layout: Layout, end: int = 0) -> None:
        """The next fields; -1 as a size is up to the end."""
        for name, size, kind in layout:
            self.take(name, end - self.at if size < 0 else size, kind)


def fields_of(data: bytes) -> list[Field]:
    """All fields of an Ethernet frame with DCP, LLDP, or RPC that is not fragmented, one after another."""
    walk = Walk(data)
    walk.all(ETHERNET)
    while walk.number(0) == 0x8100:
        walk.take("type", 2, KEPT)
        walk.take("priority and VLAN", 2, UNREAD)
    ethertype = walk.number(0)
    walk.take("type", 2, KEPT)
    bodies: dict[int, Callable[[Walk], None]] = {0x0800: _rpc, 0x8892: _dcp, 0x88CC: _lldp}
    bodies[ethertype](walk)
    walk.take("padding of frame", len(data) - walk.at, UNREAD)
    return walk.fields


def _rpc(walk: Walk) -> None:
    end = walk.at + walk.number(2)
    options = (walk.number(0, 1) & 15) * 4 - 20
    walk.all(IPV4)
    walk.take("IP options", options, UNREAD)
    walk.all(UDP)
    operation = walk.data[walk.at + 68 : walk.at + 70]
    walk.all(RPC)
    walk.all(NDR)
    if operation in (b"\0\2", b"\2\0", b"\0\3", b"\3\0"):
        _record(walk, end)
    else:
        while walk.at < end:
            kind, stop = walk.number(0), walk.at + 4 + walk.number(2)
            walk.all(BLOCK)
            walk.all(OF_BLOCK[kind], stop)


def _record(walk: Walk, end: int) -> None:
    kind = walk.number(0)
    walk.all(BLOCK)
    index = walk.number(28)
    walk.all(RECORD)
    if kind == 0x0009 and not any(walk.data[walk.at : walk.at + 16]):
        walk.take("no " + TARGET, 16, KEPT)
        walk.take("padding of record", 8, UNREAD)
    else:
        walk.all(OF_RECORD[kind])
    if index != 47:
        walk.take("another record", end - walk.at, UNREAD)
    elif walk.at < end:
        _message(walk, end, request=kind == 0x0008)


def _message(walk: Walk, end: int, *, request: bool) -> None:
    """A message of parameters; a response has no addresses."""
    count = walk.number(3, 1)
    walk.take("reference, service, axis, number of parameters", 4, KEPT)
    if request:
        walk.take("addresses of parameters", 6 * count, KEPT)
    while walk.at < end:
        form, values = walk.data[walk.at : walk.at + 2]
        size = values * {0x05: 1, 0x08: 4, 0x41: 1, 0x42: 2, 0x44: 2}[form]
        walk.take("format, number of values", 2, KEPT)
        walk.take("values", size, KEPT)
        walk.take("padding of values", size % 2, MARKED)


def _dcp(walk: Walk) -> None:
    service, kind = walk.data[walk.at + 2 : walk.at + 4]
    end = walk.at + 12 + walk.number(10)
    walk.take("frame id, service, transaction", 8, KEPT)
    walk.take("delay", 2, KEPT if (service, kind) == (5, 0) else UNREAD)
    walk.take("length of DCP", 2, KEPT)
    while walk.at < end:
        option, length = (walk.number(0, 1), walk.number(1, 1)), walk.number(2)
        stop = walk.at + 4 + length
        walk.take("option, length", 4, KEPT)
        if (service, kind) != (5, 0):
            walk.take("block information", 2, KEPT)
        walk.all(DCP_OPTIONS.get(option, (("unknown option", -1, UNREAD),)), stop)
        walk.take("padding of option", length % 2, UNREAD)


def _lldp(walk: Walk) -> None:
    while True:
        head = walk.number(0)
        kind, end = head >> 9, walk.at + 2 + (head & 0x1FF)
        walk.take("type and length", 2, KEPT)
        if kind == 0:
            return
        walk.all(_of_tlv(kind, walk), end)


def _of_tlv(kind: int, walk: Walk) -> Layout:
    subtype = ("subtype", 1, KEPT)
    if kind == 127:
        known = walk.data[walk.at : walk.at + 4] == b"\x00\x0e\xcf\5"
        content = ("MAC address", 6, REPLACED) if known else ("unknown", -1, UNREAD)
        return (("organisation, subtype", 4, KEPT), content)
    return {
        1: (subtype, ("chassis", -1, REPLACED)),
        2: (subtype, ("port", -1, KEPT)),
        3: (("time to live of LLDP", 2, KEPT),),
        8: (("length, subtype", 2, KEPT), ("address", 4, REPLACED), ("interface", 6, KEPT)),
    }.get(kind, (("unknown", -1, UNREAD),))
