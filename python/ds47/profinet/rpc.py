"""DCE/RPC connectionless v4: one UDP payload to one PDU, fragments to one message (docs/protocol.md E.2).

A PDU is recognised by content (version 4 and a PNIO interface UUID), never by port. Each PDU states its own
byte order; this file normalises it, so that a request and its answer compare equal. `calls` decides which
response belongs to which request.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

from ds47.capture import Frame
from ds47.capture.scan import ETHERNET, UUIDS, is_plain
from ds47.profinet.ip import Cut, address
from ds47.profinet.link import Packet, mac
from ds47.spec.layouts import (
    RPC_FLAGS,
    RPC_IS_FRAGMENT,
    RPC_LAST_FRAGMENT,
    RPC_LITTLE,
    RPC_OBJECT,
    RPC_ORDER,
    RPC_PTYPE,
    RPC_SIZE,
    RPC_STRUCT,
    RPC_VERSION,
    RPC_VERSION_4,
)
from ds47.spec.plain import Plain

if TYPE_CHECKING:
    from ds47.profinet.traces import Trace, Traces

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

_LITTLE: Final = struct.Struct(f"<IHH8sIHH8sIHH8s{RPC_STRUCT}")
_BIG: Final = struct.Struct(f">IHH8sIHH8sIHH8s{RPC_STRUCT}")
_UUID: Final = struct.Struct(">IHH8s")
_PTYPE_BITS: Final = 0x1F
_FROM_CLIENT: Final = frozenset((0, 1, 8, 9))
_PNIO_NODE: Final = UUIDS[8:16]
_MAPPER: Final = (0xE1AF8308, 0x5D1F, 0x11C9, bytes.fromhex("91a408002b14a0fa"))
"""The interface of the endpoint mapper."""
NO_OPERATION: Final = -1
"""`Pdu.opnum` of PDUs of the endpoint mapper."""


@dataclass(slots=True, init=False, repr=False, eq=False)
class Pdu(Plain):
    """One DCE/RPC PDU, or one message put together from its fragments.

    `body` follows the 80-byte header, and lacks `missing` bytes. `cut` is the frame, if the capture cut it;
    without `cut` the header announces more than the datagram holds. UUIDs are in network order, whatever order
    the PDU used; `little` is the order of the NDR header.
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
    port: int
    """The UDP port of the source."""
    source_mac: str | None
    client: str
    """The IP address of the side that called."""
    server: str
    """The IP address of the side that was called."""
    cut: Cut | None
    mark: int
    """A hash of what two copies of its datagram have in common."""

    def __init__(
        self,
        ptype: int,
        little: bool,
        object_uuid: bytes,
        activity: bytes,
        seq: int,
        opnum: int,
        fragment: int,
        last: bool,
        fragmented: bool,
        body: bytes,
        missing: int,
        frame: int,
        time_ns: int,
        source: str,
        destination: str,
        ip_id: int,
        port: int,
        source_mac: str | None,
        client: str,
        server: str,
        cut: Cut | None = None,
        mark: int = 0,
    ) -> None:
        self.ptype = ptype
        self.little = little
        self.object_uuid = object_uuid
        self.activity = activity
        self.seq = seq
        self.opnum = opnum
        self.fragment = fragment
        self.last = last
        self.fragmented = fragmented
        self.body = body
        self.missing = missing
        self.frame = frame
        self.time_ns = time_ns
        self.source = source
        self.destination = destination
        self.ip_id = ip_id
        self.port = port
        self.source_mac = source_mac
        self.client = client
        self.server = server
        self.cut = cut
        self.mark = mark


def parse(packet: Packet) -> Pdu | None:
    """The PDU in a UDP packet; None if it is not PROFINET or endpoint mapper, or its header is cut."""
    data = packet.payload
    if len(data) < RPC_SIZE or data[RPC_VERSION] != RPC_VERSION_4:
        return None
    ptype = data[RPC_PTYPE] & _PTYPE_BITS
    if ptype not in PTYPES:
        return None
    little = data[RPC_ORDER] & RPC_LITTLE != 0
    layout = _LITTLE if little else _BIG
    (
        o1, o2, o3, o4, i1, i2, i3, i4, a1, a2, a3, a4,
        boot, _version, seq, opnum, _ihint, _ahint, length, fragment,
    ) = layout.unpack_from(data, RPC_OBJECT)  # fmt: skip
    if (i1, i2, i3, i4) == _MAPPER:
        opnum = NO_OPERATION
    elif i4 != _PNIO_NODE or i1 & 0xFFFFFFF0 != 0xDEA00000 or i2 != 0x6C97:
        return None
    flags = data[RPC_FLAGS]
    fragmented = flags & RPC_IS_FRAGMENT != 0
    body = data[RPC_SIZE : RPC_SIZE + length]
    source, destination, activity = packet.src_ip, packet.dst_ip, _UUID.pack(a1, a2, a3, a4)
    client, server = (source, destination) if ptype in _FROM_CLIENT else (destination, source)
    ip_id, port = packet.ip_id, packet.src_port
    mark = hash((source, destination, activity, ptype, ip_id, port, boot, fragment, seq, body))
    return Pdu(
        ptype, little, _UUID.pack(o1, o2, o3, o4), activity, seq, opnum,
        fragment, flags & RPC_LAST_FRAGMENT != 0, fragmented, body, length - len(body),
        packet.frame, packet.time_ns, source, destination, ip_id,
        port, packet.src_mac, client, server, packet.cut if length > len(body) else None,
        mark,
    )  # fmt: skip


_USUAL: Final = struct.Struct("<xBB5x48sI4xIH4xHH"), struct.Struct(">xBB5x48sI4xIH4xHH")
_LOWER: Final = struct.Struct(">16xHH6x8sHxxH")
_INTERFACES: Final = {  # the first of each pair in network order, the second of a little-endian sender
    little: frozenset(UUIDS[at : at + 16] for at in range(16 if little else 0, len(UUIDS), 32))
    for little in (True, False)
}
_UDP_START: Final = 34
_RPC_START: Final = 42
_BODY_START: Final = _RPC_START + RPC_SIZE


def from_frame(frame: Frame) -> Pdu | None:
    """The PDU of a usual frame: whole, Ethernet without a tag, IPv4 without options.

    None for every other frame: `link.dissect` and `parse` take those, and would give the same result.
    """
    data = frame.data
    if frame.link_type != ETHERNET or len(data) < _BODY_START or not is_plain(data):
        return None
    total, ip_id, hosts, port, stated = _LOWER.unpack_from(data)
    end = _UDP_START + stated
    if total != stated + 20 or not _BODY_START <= end <= len(data):
        return None
    little = data[_RPC_START + RPC_ORDER] & RPC_LITTLE != 0
    (ptype, flags, identity, boot, seq, opnum, length, fragment,
     ) = _USUAL[not little].unpack_from(data, _RPC_START)  # fmt: skip
    names = data[6:12], hosts, identity
    known = _KNOWN[little].get(names) or _learnt(little, *names)
    ptype &= _PTYPE_BITS
    if known is None or ptype not in PTYPES:
        return None
    object_uuid, activity, station, source, destination = known
    client, server = source, destination
    if ptype not in _FROM_CLIENT:
        client, server = destination, source
    missing, cut = _BODY_START + length - end, None
    if missing < 0:
        end, missing = end + missing, 0
    elif missing and frame.original_length > len(data):
        cut = (frame.number, len(data), frame.original_length)
    body = data[_BODY_START:end]
    mark = hash((source, destination, activity, ptype, ip_id, port, boot, fragment, seq, body))
    return Pdu(
        ptype, little, object_uuid, activity, seq, opnum, fragment,
        flags & RPC_LAST_FRAGMENT != 0, flags & RPC_IS_FRAGMENT != 0,
        body, missing, frame.number, frame.time_ns,
        source, destination, ip_id, port, station, client, server, cut, mark,
    )  # fmt: skip


_Names = tuple[bytes, bytes, str, str, str]
_KNOWN: Final[tuple[dict[tuple[bytes, bytes, bytes], _Names], ...]] = {}, {}
"""What many frames repeat, already converted, by byte order; emptied when it gets too large."""
_MOST_KNOWN: Final = 4096


def _learnt(little: bool, station: bytes, hosts: bytes, identity: bytes) -> _Names | None:
    """Object and activity in network order, MAC address of the sender, and who talks to whom.

    Args:
        little: the byte order of the UUIDs.
        station: the MAC address.
        hosts: the IP addresses of source and destination.
        identity: object, interface and activity.

    Returns:
        None for a foreign interface.
    """
    if identity[16:32] not in _INTERFACES[little]:
        return None
    known = _KNOWN[little]
    if len(known) >= _MOST_KNOWN:
        known.clear()
    names = (
        _normalised(identity[:16], little), _normalised(identity[32:], little),
        mac(station), address(hosts[:4]), address(hosts[4:]),
    )  # fmt: skip
    known[station, hosts, identity] = names
    return names


def _normalised(uuid: bytes, little: bool) -> bytes:
    return _UUID.pack(*struct.unpack("<IHH8s", uuid)) if little else uuid


@lru_cache(maxsize=4096)
def device_identity(object_uuid: bytes) -> tuple[int, int] | None:
    """Vendor id and device id out of an RPC object UUID (docs/protocol.md E.2), None for a foreign one."""
    if object_uuid[:8] != b"\xde\xa0\x00\x00\x6c\x97\x11\xd1":
        return None
    device_id, vendor_id = struct.unpack(">HH", object_uuid[12:16])
    return vendor_id, device_id


@dataclass(slots=True, repr=False, eq=False)
class Partial(Plain):
    """A fragmented RPC message so far; `traces` are those of each fragment, if frames are kept."""

    first: Pdu
    newest_ns: int
    parts: dict[int, Pdu] = field(default_factory=dict)
    last: int | None = None
    fragments: int = 0
    bytes: int = 0
    """Of the bodies of the parts."""
    traces: dict[int, list[Trace]] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether every fragment is there."""
        return self.last is not None and len(self.parts) > self.last

    def add(self, pdu: Pdu, trace: Trace | None = None) -> list[Trace]:
        """Takes a fragment once, and the traces of its copies. Returns the traces that do not belong here.

        A fragment after the last one belongs to another message.
        """
        none_of_this: list[Trace] = []
        if pdu.last and self.last is None:
            self.last = pdu.fragment
            for number in [number for number in self.parts if number > pdu.fragment]:
                none_of_this += self._drop(number)
        if self.last is not None and pdu.fragment > self.last:
            return none_of_this if trace is None else [*none_of_this, trace]
        known = self.parts.setdefault(pdu.fragment, pdu)
        if trace is not None:
            traces = self.traces.setdefault(pdu.fragment, [])
            from ds47.profinet.traces import MOST_COPIES  # only an export wants them

            if len(traces) == MOST_COPIES:
                return [*none_of_this, trace]
            traces.append(trace)
        elif known is not pdu:
            return none_of_this
        self.fragments += 1
        self.bytes += len(known.body)
        return none_of_this

    def _drop(self, number: int) -> list[Trace]:
        """Forgets a fragment."""
        traces = self.traces.pop(number, [])
        count = len(traces) or 1
        self.fragments -= count
        self.bytes -= count * len(self.parts.pop(number).body)
        return traces

    def joined(self, newest: Pdu) -> Pdu:
        """The whole message. Frame, time and sender are those of the fragment that completed it."""
        whole = join([self.parts[number] for number in sorted(self.parts)])
        whole.frame, whole.time_ns = newest.frame, newest.time_ns
        whole.source_mac, whole.fragmented = newest.source_mac, False
        return whole


class GivenUp(NamedTuple):
    """An incomplete RPC message that was given up.

    Attributes:
        pdu: its first fragment, or the first that was seen.
        have: number of its fragments.
        limit: name of the limit that pushed it out (spec/limits.toml); "" if its time was over.
    """

    pdu: Pdu
    have: int
    limit: str


class Fragments:
    """Puts fragmented RPC messages together; bounded in number and in capture time.

    The caller empties `given_up`.

    Args:
        expiry_ns: how long an incomplete message is kept, nanoseconds of capture time.
        limit: how many incomplete messages are kept.
        fragments: how many fragments of incomplete messages are kept; the oldest message goes first.
        most_bytes: how many bytes of such fragments.
        traces: keeps the frames of messages; it gets those of given-up messages, instead of `given_up`.
    """

    def __init__(
        self,
        expiry_ns: int,
        limit: int = 1024,
        fragments: int = 16_384,
        most_bytes: int = 1 << 24,
        traces: Traces | None = None,
    ) -> None:
        self._traces = traces
        self._expiry_ns = expiry_ns
        self._limit = limit
        self._most_fragments = fragments
        self._most_bytes = most_bytes
        self._partial: OrderedDict[tuple[str, bytes, int, int], Partial] = OrderedDict()
        self.given_up: list[GivenUp] = []
        self._fragments = 0
        self._bytes = 0

    def feed(self, pdu: Pdu) -> Pdu | None:
        """The whole message, when it is complete. Its frame and time are those of the completing frame."""
        if not pdu.fragmented:
            return pdu
        partial = self.complete(pdu)
        return None if partial is None else partial.joined(pdu)

    def complete(self, pdu: Pdu, trace: Trace | None = None) -> Partial | None:
        """The message that a fragment completes; `trace` is that of its datagram, if frames are kept."""
        key = (pdu.source, pdu.activity, pdu.seq, pdu.ptype)
        partial = self._partial.get(key)
        if partial is not None and self._is_old(partial, pdu.time_ns):
            self._give_up(key, "")  # the sequence number came round: this is another message
            partial = None
        if partial is None:
            self._make_room(pdu.time_ns)
            partial = self._partial[key] = Partial(pdu, pdu.time_ns)
        before, bytes_before = partial.fragments, partial.bytes
        none_of_this = partial.add(pdu, trace)
        if none_of_this and self._traces is not None:
            self._traces.lose(none_of_this)
        partial.newest_ns = pdu.time_ns
        self._fragments += partial.fragments - before
        self._bytes += partial.bytes - bytes_before
        if partial.whole:
            return self._close(key)
        while limit := self._over():
            self._give_up(next(iter(self._partial)), limit)
        return None

    def finish(self) -> None:
        """Give up every open message."""
        while self._partial:
            self._give_up(next(iter(self._partial)), "")

    def _is_old(self, partial: Partial, now: int) -> bool:
        """The clock may have stepped back, so far ahead of it is old too."""
        return abs(now - partial.newest_ns) > self._expiry_ns

    def _make_room(self, now: int) -> None:
        while self._partial:
            key, oldest = next(iter(self._partial.items()))
            old = self._is_old(oldest, now)
            if not old and len(self._partial) < self._limit:
                return
            self._give_up(key, "" if old else "rpc_messages")

    def _over(self) -> str:
        """The limit that is exceeded, "" for none."""
        if self._fragments > self._most_fragments:
            return "rpc_fragments"
        return "fragment_bytes" if self._bytes > self._most_bytes else ""

    def _give_up(self, key: tuple[str, bytes, int, int], limit: str) -> None:
        partial = self._close(key)
        if self._traces is not None:
            self._traces.lose([each for traces in partial.traces.values() for each in traces])
        else:
            self.given_up.append(GivenUp(*_beginning(partial), limit))

    def _close(self, key: tuple[str, bytes, int, int]) -> Partial:
        partial = self._partial.pop(key)
        self._fragments -= partial.fragments
        self._bytes -= partial.bytes
        return partial

    def unfinished(self) -> list[tuple[Pdu, int]]:
        """First fragment (or the first seen) and number of fragments, for each incomplete message."""
        return [_beginning(partial) for partial in self._partial.values()]


def _beginning(partial: Partial) -> tuple[Pdu, int]:
    return partial.parts.get(0, partial.first), len(partial.parts)


def join(parts: Sequence[Pdu]) -> Pdu:
    """The first fragment, with the body of all fragments up to the first hole.

    Bytes after a hole have no known place in the record: they count as missing too.
    """
    whole = parts[0]
    whole.cut = next((part.cut for part in parts if part.missing and part.cut), None)
    length = sum(len(part.body) + part.missing for part in parts)
    cut = next((number for number, part in enumerate(parts) if part.missing), len(parts))
    whole.body = b"".join(part.body for part in parts[: cut + 1])
    whole.missing = length - len(whole.body)
    return whole
