"""The hot path: walk over the frames of a buffer and let only those through that may matter.

Lives here: the predicate, and the two loops (pcap, pcapng) that apply it without making an object
for a frame that is none of our business. Not here: file headers, blocks other than the Enhanced
Packet Block, broken lengths (the loops stop in front of them; pcap.py and pcapng.py say why).

This is the only file where speed may cost beauty. One `unpack` per frame fetches the record header
*and* the first type fields of the Ethernet frame behind it, in the byte order of the file, so the
constants to compare with are swapped instead of the fields (`Reject`).

A frame matters when, after VLAN tags or a cooked header, it is
* IPv4 UDP with RPC version 4 and the PNIO interface UUID (docs/protocol.md E.2), on any port;
* any fragment of an IPv4 UDP datagram: only reassembly can tell;
* PROFINET DCP (0x8892, frame ids 0xFEFC..0xFEFF) or LLDP (0x88CC), which name the stations.
A frame that the snap length cut before the UUID matters while nothing in it contradicts; one that
was cut before the UUID begins must have the PROFINET port 34964 on one side.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Literal

ByteOrder = Literal["little", "big"]

ETHERNET, RAW, RAW_IPV4, SLL, SLL2 = 1, 101, 228, 113, 276
IPV4, PROFINET, LLDP = 0x0800, 0x8892, 0x88CC
VLAN_TAGS = frozenset((0x8100, 0x88A8, 0x9100, 0x9200))
DCP_FRAME_IDS = range(0xFEFC, 0xFF00)
PNIO_PORT = 34964
UDP = 17

MAX_FRAME = 1 << 18  # the limit of libpcap and Wireshark for these link types, in bytes

_UUID_TAIL = bytes.fromhex("827100a02442df7d")
_UUID_HEADS = frozenset(
    head
    for x in (1, 2, 3, 4)
    for head in (
        bytes.fromhex(f"dea0000{x}6c9711d1"),
        bytes.fromhex(f"0{x}00a0de976cd111"),
    )
)


def is_pnio(data: bytes, start: int, end: int, *, cut: bool = False, on_port: bool = False) -> bool:
    """True when data[start:end], a UDP payload, is an RPC PDU of PROFINET (docs/protocol.md E.2).

    `cut` says that bytes are missing at the end; then what is there only has to fit, and when
    not even the UUID has begun, `on_port` (port 34964 is involved) decides.
    """
    if end - start >= 40:
        return (
            data[start + 32 : start + 40] == _UUID_TAIL
            and data[start] == 4
            and data[start + 24 : start + 32] in _UUID_HEADS
        )
    if not cut or (end > start and data[start] != 4):
        return False
    piece = data[start + 24 : end]
    if not piece:
        return on_port
    return any((head + _UUID_TAIL).startswith(piece) for head in _UUID_HEADS)


def network_layer(data: bytes, start: int, end: int, link_type: int) -> tuple[int, int]:
    """Return (EtherType, offset of what follows it), after VLAN tags and cooked headers.

    The EtherType is 0 for a frame too short or of an unknown link type.
    """
    if link_type == ETHERNET:
        at = start + 14
        kind = data[at - 2] << 8 | data[at - 1] if at <= end else 0
    elif link_type == SLL:
        at = start + 16
        kind = data[at - 2] << 8 | data[at - 1] if at <= end else 0
    elif link_type == SLL2:
        at = start + 20
        kind = data[start] << 8 | data[start + 1] if at <= end else 0
    elif link_type in (RAW, RAW_IPV4):
        return (IPV4 if end > start and data[start] >> 4 == 4 else 0), start
    else:
        return 0, start
    while kind in VLAN_TAGS:
        at += 4
        if at > end:
            return 0, at
        kind = data[at - 2] << 8 | data[at - 1]
    return kind, at


def relevant(data: bytes, start: int, end: int, link_type: int, original: int) -> bool:
    """The exact predicate for the frame data[start:end] that was `original` bytes long."""
    kind, at = network_layer(data, start, end, link_type)
    if kind == IPV4:
        if end < at + 20 or data[at + 9] != UDP:
            return False
        if data[at + 7] or data[at + 6] & 0x3F:
            return True
        udp = at + (data[at] & 15) * 4
        cut = end - start < original
        ports = data[udp : min(udp + 4, end)]
        on_port = (
            PNIO_PORT in (ports[0] << 8 | ports[1], ports[2] << 8 | ports[3])
            if len(ports) == 4
            else False
        )
        return is_pnio(data, udp + 8, end, cut=cut, on_port=on_port)
    if kind == PROFINET:
        return end >= at + 2 and data[at] << 8 | data[at + 1] in DCP_FRAME_IDS
    return kind == LLDP


@dataclass(slots=True)
class Reject:
    """The constants of the cheap first test, as a file of that byte order shows them."""

    profinet: int
    dcp: Collection[int]
    tags: Collection[int]
    kept: Collection[int]

    @classmethod
    def build(cls, order: ByteOrder, link_type: int) -> Reject:
        """Constants for a link type; for others than Ethernet the test lets everything through."""

        def seen(values: Collection[int]) -> frozenset[int]:
            return frozenset(int.from_bytes(v.to_bytes(2, "big"), order) for v in values)

        if link_type != ETHERNET:
            return cls(-1, (), (), range(1 << 16))
        (profinet,) = seen((PROFINET,))
        return cls(profinet, seen(DCP_FRAME_IDS), seen(VLAN_TAGS), seen((IPV4, LLDP)))


@dataclass(slots=True)
class Cursor:
    """Where a loop stopped: offset in the buffer of the next record, and frames counted."""

    position: int = 0
    frames: int = 0


# Behind the record header: two MAC addresses, then type, frame id or tag, inner type, inner id.
_ETHERNET_TYPES = "12xHHHH"


def pcap_layout(order: ByteOrder, header: int) -> struct.Struct:
    """Captured length of a pcap record (`header` bytes long) and the types of the Ethernet frame in it."""
    return struct.Struct(f"{'<>'[order == 'big']}8xI{header - 12}x{_ETHERNET_TYPES}")


def scan_pcap(
    data: bytes,
    end: int,
    cursor: Cursor,
    layout: struct.Struct,
    header: int,
    link_type: int,
    reject: Reject,
) -> Iterator[tuple[int, int, int, int, int, int]]:
    """Yield (number, seconds, fraction, captured, original, offset) of the frames that matter.

    Stops in front of a record that is not wholly in data[:end] or is longer than MAX_FRAME.
    """
    unpack = layout.unpack_from
    profinet, dcp, tags, kept = reject.profinet, reject.dcp, reject.tags, reject.kept
    position, number, last = cursor.position, cursor.frames, end - header
    record = struct.Struct(f"{layout.format[0]}4I").unpack_from
    while position <= last:
        captured, kind, first, inner, second = unpack(data, position)
        start = position + header
        after = start + captured
        if after > end or captured > MAX_FRAME:
            break
        position = after
        number += 1
        if kind == profinet:
            if first not in dcp:
                continue
        elif kind in tags:
            if inner == profinet and second not in dcp:
                continue
        elif kind not in kept:
            continue
        seconds, fraction, _captured, original = record(data, start - header)
        if relevant(data, start, after, link_type, original):
            cursor.position, cursor.frames = position, number
            yield number, seconds, fraction, captured, original, start
    cursor.position, cursor.frames = position, number


def pcapng_layout(order: ByteOrder) -> struct.Struct:
    """The fields of an Enhanced Packet Block and of the Ethernet frame in it."""
    return struct.Struct(f"{'<>'[order == 'big']}7I{_ETHERNET_TYPES}")


@dataclass(slots=True)
class Links:
    """Link types of the interfaces of a section; `ethernet` holds the ids the cheap test is for."""

    types: list[int] = field(default_factory=list)
    ethernet: set[int] = field(default_factory=set)


ENHANCED_PACKET = 6


def scan_pcapng(
    data: bytes,
    end: int,
    cursor: Cursor,
    layout: struct.Struct,
    trailer: struct.Struct,
    links: Links,
    reject: Reject,
) -> Iterator[tuple[int, int, int, int, int, int, int]]:
    """Yield (number, interface, high, low, captured, original, offset) of the frames that matter.

    Stops in front of any block that is not a sound Enhanced Packet Block wholly in data[:end].
    """
    unpack, unpack_trailer, ethernet = layout.unpack_from, trailer.unpack_from, links.ethernet
    types, known = links.types, len(links.types)
    profinet, dcp, tags, kept = reject.profinet, reject.dcp, reject.tags, reject.kept
    position, number = cursor.position, cursor.frames
    while position <= end - 32:
        (block, total, interface, high, low, captured, original,
         kind, first, inner, second) = unpack(data, position)  # fmt: skip
        after = position + total
        if block != ENHANCED_PACKET or after > end or total & 3 or captured > total - 32 \
                or captured > MAX_FRAME or unpack_trailer(data, after - 4)[0] != total \
                or interface >= known:  # fmt: skip
            break
        start = position + 28
        position = after
        number += 1
        if interface in ethernet:
            if kind == profinet:
                if first not in dcp:
                    continue
            elif kind in tags:
                if inner == profinet and second not in dcp:
                    continue
            elif kind not in kept:
                continue
        if relevant(data, start, start + captured, types[interface], original):
            cursor.position, cursor.frames = position, number
            yield number, interface, high, low, captured, original, start
    cursor.position, cursor.frames = position, number
