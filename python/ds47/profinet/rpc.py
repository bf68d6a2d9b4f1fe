"""DCE/RPC connectionless v4: one UDP payload to one PDU, fragments to one message (docs/protocol.md E.2).

Recognised by content (version 4 and a PNIO interface UUID), never by port. Each PDU states its own byte
order; what leaves this file is normalised, so that a request and its answer compare equal.
Which response belongs to which request is decided in `calls`.
"""

from __future__ import annotations

import struct
from collections import OrderedDict, deque
from dataclasses import dataclass
from typing import Final

from ds47.profinet.link import Packet

HEADER_LENGTH: Final = 80
PTYPES: Final = {
    0: "request",
    1: "ping",
    2: "response",
    3: "fault",
    4: "working",
    5: "nocall",
    6: "reject",
    7: "ack",
    8: "cancel",
    9: "fack",
    10: "cancel_ack",
}
READ, WRITE, READ_IMPLICIT = 2, 3, 5
CONNECT, RELEASE, CONTROL = 0, 1, 4

_LITTLE: Final = struct.Struct("<IHH8sIHH8sIHH8sIIIHHHHH")
_BIG: Final = struct.Struct(">IHH8sIHH8sIHH8sIIIHHHHH")
_UUID: Final = struct.Struct(">IHH8s")
_LAST_FRAGMENT, _FRAGMENT = 0x02, 0x04
_PNIO_NODE = bytes.fromhex("827100a02442df7d")


@dataclass(slots=True)
class Pdu:
    """One DCE/RPC PDU, or one message put together from its fragments.

    `body` is what follows the 80-byte header, `missing` the bytes of it that the capture cut off.
    UUIDs are in network order whatever the PDU used; `little` tells the order of the NDR header.
    """

    ptype: int
    little: bool
    object_uuid: bytes
    activity: bytes
    seq: int
    opnum: int
    fragment: int
    last: bool
    fragmented: bool
    body: bytes
    missing: int
    frame: int
    time_ns: int
    source: str
    destination: str
    ip_id: int
    source_mac: str | None

    @property
    def client(self) -> str:
        """The IP address of the side that called."""
        return self.source if self.ptype in (0, 1, 8, 9) else self.destination

    @property
    def server(self) -> str:
        """The IP address of the side that was called."""
        return self.destination if self.ptype in (0, 1, 8, 9) else self.source


def parse(packet: Packet) -> Pdu | None:
    """The PDU in a UDP packet; None where it is not PNIO RPC or its header is cut off."""
    data = packet.payload
    if len(data) < HEADER_LENGTH or data[0] != 4 or data[1] & 0x1F not in PTYPES:
        return None
    little = data[4] & 0x10 != 0
    layout = _LITTLE if little else _BIG
    (
        o1, o2, o3, o4, i1, i2, _i3, i4, a1, a2, a3, a4,
        _boot, _version, seq, opnum, _ihint, _ahint, length, fragment,
    ) = layout.unpack_from(data, 8)  # fmt: skip
    if i4 != _PNIO_NODE or i1 & 0xFFFFFFF0 != 0xDEA00000 or i2 != 0x6C97:
        return None
    flags = data[2]
    fragmented = flags & _FRAGMENT != 0
    body = data[HEADER_LENGTH : HEADER_LENGTH + length]
    return Pdu(
        data[1] & 0x1F, little, _UUID.pack(o1, o2, o3, o4), _UUID.pack(a1, a2, a3, a4), seq, opnum,
        fragment, flags & _LAST_FRAGMENT != 0, fragmented, body, length - len(body),
        packet.frame, packet.time_ns, packet.src_ip, packet.dst_ip, packet.ip_id, packet.src_mac,
    )  # fmt: skip


def device_identity(object_uuid: bytes) -> tuple[int, int] | None:
    """Vendor id and device id out of an RPC object UUID (docs/protocol.md E.2), None for a foreign one."""
    if object_uuid[:8] != b"\xde\xa0\x00\x00\x6c\x97\x11\xd1":
        return None
    device_id, vendor_id = struct.unpack(">HH", object_uuid[12:16])
    return vendor_id, device_id


@dataclass(slots=True)
class _Partial:
    first: Pdu
    parts: dict[int, Pdu]
    last: int | None
    newest: Pdu

    def add(self, pdu: Pdu) -> None:
        """Takes a fragment, once; what stands behind the last one is none of this message."""
        if pdu.last and self.last is None:
            self.last = pdu.fragment
            for number in [number for number in self.parts if number > pdu.fragment]:
                del self.parts[number]
        if self.last is None or pdu.fragment <= self.last:
            self.parts.setdefault(pdu.fragment, pdu)


class Fragments:
    """Puts fragmented RPC messages together; bounded in number and in capture time.

    Args:
        expiry_ns: how long an incomplete message is kept, nanoseconds of capture time.
        limit: how many incomplete messages are kept.
        fragments: how many fragments of incomplete messages are kept; the oldest message goes first.
    """

    def __init__(self, expiry_ns: int, limit: int = 1024, fragments: int = 16_384) -> None:
        self._expiry_ns = expiry_ns
        self._limit = limit
        self._most_fragments = fragments
        self._partial: OrderedDict[tuple[str, bytes, int, int], _Partial] = OrderedDict()
        self._given_up: deque[tuple[Pdu, int]] = deque(maxlen=limit)
        self._fragments = 0

    def feed(self, pdu: Pdu) -> Pdu | None:
        """The whole message, as soon as there is one. Its frame and time are the completing frame's."""
        if not pdu.fragmented:
            return pdu
        key = (pdu.source, pdu.activity, pdu.seq, pdu.ptype)
        partial = self._partial.get(key)
        if partial is None:
            self._make_room(pdu.time_ns)
            partial = self._partial[key] = _Partial(pdu, {}, None, pdu)
        before = len(partial.parts)
        partial.add(pdu)
        partial.newest = pdu
        self._fragments += len(partial.parts) - before
        if partial.last is None or len(partial.parts) <= partial.last:
            while self._fragments > self._most_fragments:
                self._give_up()
            return None
        del self._partial[key]
        self._fragments -= len(partial.parts)
        return _join(partial, pdu)

    def _make_room(self, now: int) -> None:
        while self._partial:
            oldest = next(iter(self._partial.values()))
            fresh = now - oldest.newest.time_ns <= self._expiry_ns
            if fresh and len(self._partial) < self._limit:
                return
            self._give_up()

    def _give_up(self) -> None:
        partial = self._partial.popitem(last=False)[1]
        self._fragments -= len(partial.parts)
        self._given_up.append(_beginning(partial))

    def unfinished(self) -> list[tuple[Pdu, int]]:
        """First fragment (or the first seen) and number of fragments of all that never became whole."""
        return [*self._given_up, *map(_beginning, self._partial.values())]


def _beginning(partial: _Partial) -> tuple[Pdu, int]:
    return partial.parts.get(0, partial.first), len(partial.parts)


def _join(partial: _Partial, newest: Pdu) -> Pdu:
    parts = [partial.parts[number] for number in sorted(partial.parts)]
    whole = parts[0]
    whole.body = b"".join(part.body for part in parts)
    whole.missing = sum(part.missing for part in parts)
    whole.frame, whole.time_ns = newest.frame, newest.time_ns
    whole.fragmented = False
    return whole
