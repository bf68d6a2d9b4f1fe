"""From frames to packets: Ethernet, VLAN tags, cooked headers, IPv4, UDP, and raw TCP segments.

Lives here: `Packet`, `dissect`, and `Packets`, which puts fragments together. Not here: which frames
matter (ds47.capture.scan), fragments (ip.py), payloads (rpc.py, dcp.py, lldp.py).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from ds47.capture import Frame
from ds47.capture.scan import (
    DCP_FRAME_IDS,
    ETHERNET,
    IPV4,
    LLDP,
    PNIO_PORT,
    PROFINET,
    SLL,
    SLL2,
    is_pnio,
    network_layer,
)
from ds47.spec.plain import Plain

from . import ip

GROUP = 0x01
"""The bit in the first byte of a MAC address that marks a group of stations."""
Kind = Literal["udp", "tcp", "dcp", "lldp", "rt"]


@dataclass(slots=True, repr=False, eq=False)
class Packet(Plain):
    """The content of one frame, or of several fragments.

    * "udp": `payload` is the payload of the UDP datagram, a PROFINET RPC PDU (docs/protocol.md E.2);
    * "tcp": `payload` is a TCP segment from its header on; fragmented segments are dropped;
    * "dcp": `payload` begins with the frame id;
    * "lldp": `payload` is the LLDPDU;
    * "rt": `payload` begins with the frame id of a cyclic frame.
    `missing` counts the payload bytes that the snap length cut off, `cut` is the truncated frame.
    `frame` and `time_ns` (nanoseconds since 1970) belong to the frame that completes the packet. MAC addresses
    are None if the link type has none.
    """

    kind: Kind
    frame: int
    time_ns: int
    payload: bytes
    src_mac: str | None = None
    dst_mac: str | None = None
    src_ip: str = ""
    dst_ip: str = ""
    src_port: int = 0
    dst_port: int = 0
    ip_id: int = 0
    missing: int = 0
    cut: ip.Cut | None = None


def dissect(
    frame: Frame,
    reassembler: ip.Reassembler | None = None,
    begun: list[Packet] | None = None,
) -> Packet | None:
    """Return the packet that a frame completes; None if it is irrelevant or not whole yet.

    A fragment goes into `reassembler`, or is dropped without one. `begun` gets each fragment that
    begins a datagram without completing it. Never raises on any bytes.
    """
    data = frame.data
    kind, at = network_layer(data, 0, len(data), frame.link_type)
    if kind == IPV4:
        datagram = ip.parse(data, at)
        if datagram is None:
            return None
        if datagram.protocol != ip.UDP:
            return _tcp(datagram, frame)
        if frame.original_length > len(data):
            datagram.cut = (frame.number, len(data), frame.original_length)
        if not datagram.whole:
            packet = None if reassembler is None else _joined(datagram, frame, reassembler, begun)
        else:
            if reassembler is not None and reassembler.traces is not None:
                from .traces import DatagramPiece  # only an export needs it

                piece = DatagramPiece(
                    frame.number, frame.time_ns, datagram.at, 0, len(datagram.payload)
                )
                reassembler.traces.begin(piece).close(datagram.payload)
            packet = _udp(datagram, frame.number, frame.time_ns)
    elif kind == PROFINET and len(data) >= at + 2:
        is_dcp = int.from_bytes(data[at : at + 2], "big") in DCP_FRAME_IDS
        packet = Packet("dcp" if is_dcp else "rt", frame.number, frame.time_ns, data[at:])
    elif kind == LLDP:
        packet = Packet("lldp", frame.number, frame.time_ns, data[at:])
    else:
        return None
    if packet is not None:
        packet.src_mac, packet.dst_mac = addresses(frame)
        if kind != IPV4:
            packet.missing = max(0, frame.original_length - len(data))
    return packet


def _joined(
    part: ip.Datagram,
    frame: Frame,
    reassembler: ip.Reassembler,
    begun: list[Packet] | None,
) -> Packet | None:
    """The packet that a fragment completes; a first fragment goes to `begun`."""
    whole = reassembler.feed(part, frame.number, frame.time_ns)
    if whole is not None:
        return _udp(whole, frame.number, frame.time_ns)
    if begun is not None and part.offset == 0:
        first = _udp(part, frame.number, frame.time_ns)
        if first is not None:
            begun.append(first)
    return None


def _udp(datagram: ip.Datagram, frame: int, time_ns: int) -> Packet | None:
    """The packet of a UDP datagram; None if its payload is not a PROFINET RPC PDU."""
    data = datagram.payload
    if len(data) < 8:
        return None
    source, destination, stated = struct.unpack_from(">3H", data)
    length = stated if stated >= 8 else datagram.length  # 0 if left to the network card
    payload = data[8:length]
    missing = max(0, length - 8 - len(payload))
    on_port = PNIO_PORT in (source, destination)
    if not is_pnio(payload, 0, len(payload), cut=missing > 0, on_port=on_port):
        return None
    return Packet(
        "udp", frame, time_ns, payload,
        src_ip=datagram.source, dst_ip=datagram.destination,
        src_port=source, dst_port=destination,
        ip_id=datagram.identification, missing=missing, cut=datagram.cut,
    )  # fmt: skip


def _tcp(datagram: ip.Datagram, frame: Frame) -> Packet | None:
    """The packet of a TCP segment; None for anything else, and for a fragment."""
    if datagram.protocol != ip.TCP or not datagram.whole:
        return None
    have, sent = len(frame.data), frame.original_length
    cut = (frame.number, have, sent) if sent > have else None
    return Packet(
        "tcp", frame.number, frame.time_ns, datagram.payload,
        src_ip=datagram.source, dst_ip=datagram.destination, missing=datagram.missing, cut=cut,
    )  # fmt: skip


def addresses(frame: Frame) -> tuple[str | None, str | None]:
    """Source and destination MAC address; a cooked header has only the source."""
    data = frame.data
    if frame.link_type == ETHERNET:
        return mac(data[6:12]), mac(data[:6])
    if frame.link_type == SLL and data[4:6] == b"\0\6":
        return mac(data[6:12]), None
    if frame.link_type == SLL2 and data[11] == 6:
        return mac(data[12:18]), None
    return None, None


def mac(data: bytes) -> str:
    """Six bytes as text: 00:0e:cf:01:02:03."""
    return data.hex(":")


class Packets:
    """The packets in frames, with fragments put together.

    Args:
        reassembler: puts IP fragments together.
    """

    def __init__(self, reassembler: ip.Reassembler | None = None) -> None:
        self._reassembler = reassembler or ip.Reassembler()
        self._begun: list[Packet] = []

    def of(self, frames: Iterable[Frame]) -> Iterator[Packet]:
        """The packets of frames, one after the other."""
        for frame in frames:
            packet = self.packet(frame)
            if packet is not None:
                yield packet

    def packet(self, frame: Frame) -> Packet | None:
        """The packet that a frame completes; None if there is none."""
        return dissect(frame, self._reassembler, self._begun)

    def begun(self) -> list[Packet]:
        """Fragments that begin a datagram and do not complete it, each once."""
        begun, self._begun = self._begun, []
        return begun

    def given_up(self) -> list[tuple[Packet, int, str]]:
        """PROFINET datagrams that were given up, each returned once.

        Packet and number of fragments as in `unfinished`; then the name of the limit that evicted the
        datagram (spec/limits.toml), "" if it expired.
        """
        entries = self._reassembler.given_up
        if not entries:
            return []
        self._reassembler.given_up = []
        return [
            (packet, len(entry.pieces), entry.limit)
            for entry in entries
            if (packet := _as_far_as_it_goes(entry)) is not None
        ]

    def unfinished(self) -> list[tuple[Packet, int]]:
        """PROFINET datagrams that are still incomplete, with the number of fragments seen.

        The packet holds the payload up to the first hole; `missing` counts the bytes known to be missing.
        Its frame and time are those of the last fragment seen. MAC addresses are not kept.
        """
        return [
            (packet, len(entry.pieces))
            for entry in self._reassembler.unfinished()
            if (packet := _as_far_as_it_goes(entry)) is not None
        ]


def _as_far_as_it_goes(entry: ip.Unfinished) -> Packet | None:
    head = entry.head()
    total = entry.total if entry.total is not None else entry.have
    datagram = ip.Datagram(
        entry.source, entry.destination, ip.UDP, entry.identification, 0, False, head,
        max(0, total - len(head)),
    )  # fmt: skip
    return _udp(datagram, entry.frame, entry.time_ns)
