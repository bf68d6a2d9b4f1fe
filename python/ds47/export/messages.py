"""Which frames make up a message: IP fragments to datagrams, RPC fragments to messages.

The analysis forgets the pieces once it has the whole; here they are kept, so that all frames of a
message can be exported, and a change of the message can be written back into every one of them.
Copies (mirror ports) belong to the message that they copy. Nothing is interpreted beyond the RPC header.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from ds47.capture.scan import (
    DCP_FRAME_IDS,
    IPV4,
    LLDP,
    PNIO_PORT,
    PROFINET,
    UDP,
    is_pnio,
    network_layer,
)
from ds47.profinet import ip, rpc
from ds47.profinet.link import Packet
from ds47.spec.semantics import limits

Kind = Literal["rpc", "dcp", "lldp", "foreign"]

_MOST_OPEN = 1024
"""Unfinished datagrams, and unfinished RPC messages, that are kept; the oldest goes first."""
_REMEMBERED = 64
"""Finished ones that are kept for their copies."""


@dataclass(slots=True, eq=False)
class Entry:
    """One captured frame on its way. `layer` is where the network layer begins in `data`."""

    number: int
    time_ns: int
    link_type: int
    data: bytearray
    original_length: int
    layer: int = 0
    finished: bool = False
    kept: bool = False


@dataclass(slots=True, eq=False)
class Datagram:
    """An IPv4 UDP datagram and where its bytes lie: (offset in it, entry, offset there, length)."""

    source: str
    destination: str
    ip_id: int
    first_ns: int
    pieces: list[tuple[int, Entry, int, int]] = field(default_factory=list)
    data: bytes = b""
    """UDP header and payload up to the first byte that was not captured, once the datagram is whole."""
    missing: int = 0
    message: Message | None = None

    def entries(self) -> Iterator[Entry]:
        """The frames of it, in the order of the capture."""
        for _, entry, _, _ in self.pieces:
            yield entry

    def write(self, data: bytes) -> None:
        """Puts other bytes of the same length in place, in every frame."""
        self.data = data
        for offset, entry, at, length in self.pieces:
            part = data[offset : offset + length]
            entry.data[at : at + len(part)] = part


@dataclass(slots=True, eq=False)
class Message:
    """What frames say together. `parts` of an RPC message: by fragment, each with its copies.

    `pdu` is that of the first fragment with the whole body; None for a frame that was cut inside the
    RPC header, and for the other kinds.
    """

    kind: Kind
    entries: list[Entry]
    frame: int
    time_ns: int
    pdu: rpc.Pdu | None = None
    parts: list[list[Datagram]] = field(default_factory=list)

    @property
    def datagrams(self) -> Iterator[Datagram]:
        """Every datagram of it, copies too."""
        for copies in self.parts:
            yield from copies


@dataclass(slots=True, eq=False)
class Copy:
    """A datagram, or one piece of it, that came again after its message was whole."""

    message: Message
    datagram: Datagram
    sibling: Datagram


@dataclass(slots=True)
class _Partial:
    """An RPC message so far: datagrams and PDU by fragment number."""

    first_ns: int
    parts: dict[int, tuple[rpc.Pdu, list[Datagram]]] = field(default_factory=dict)
    last: int | None = None


class Tracker:
    """Takes the frames of a capture in their order.

    `given_up` collects what never became whole, each the frames of it; who wants them takes them out.
    """

    def __init__(self) -> None:
        bounds = limits()
        self._expiry_ns = bounds.fragment_expiry_ns
        self._copy_ns = bounds.copy_ns
        self._open: OrderedDict[tuple[str, str, int], Datagram] = OrderedDict()
        self._ends: dict[tuple[str, str, int], int] = {}
        self._whole: OrderedDict[tuple[str, str, int], Datagram] = OrderedDict()
        self._partial: OrderedDict[tuple[str, bytes, int, int], _Partial] = OrderedDict()
        self._done: OrderedDict[tuple[str, bytes, int, int], tuple[int, _Partial]] = OrderedDict()
        self.given_up: list[list[Entry]] = []

    def feed(self, entry: Entry) -> Message | Copy | None:
        """The message that this frame completes; None where more has to come."""
        data = entry.data
        kind, entry.layer = network_layer(data, 0, len(data), entry.link_type)
        at = entry.layer
        if kind == PROFINET and int.from_bytes(data[at : at + 2], "big") in DCP_FRAME_IDS:
            return Message("dcp", [entry], entry.number, entry.time_ns)
        if kind == LLDP:
            return Message("lldp", [entry], entry.number, entry.time_ns)
        part = ip.parse(bytes(data), at) if kind == IPV4 else None
        if part is None or part.protocol != UDP:
            return Message("foreign", [entry], entry.number, entry.time_ns)
        payload_at = at + (data[at] & 15) * 4
        if part.whole:
            whole = self._datagram(part, entry)
            whole.pieces.append((0, entry, payload_at, len(part.payload)))
            whole.data, whole.missing = part.payload, part.missing
            return self._rpc(whole, entry)
        return self._fragment(part, entry, payload_at)

    def finish(self) -> None:
        """The capture is over: what is open will never be whole."""
        while self._open:
            self._drop_datagram()
        while self._partial:
            self._drop_message()

    @staticmethod
    def _datagram(part: ip.Datagram, entry: Entry) -> Datagram:
        return Datagram(part.source, part.destination, part.identification, entry.time_ns)

    # IP

    def _fragment(self, part: ip.Datagram, entry: Entry, at: int) -> Message | Copy | None:
        key = (part.source, part.destination, part.identification)
        piece = (part.offset, entry, at, len(part.payload))
        before = self._whole.get(key)
        if before is not None and self._same(before, part, entry):
            return self._late(before, piece, entry)
        self._expire(entry.time_ns)
        datagram = self._open.get(key)
        if datagram is None:
            datagram = self._open[key] = self._datagram(part, entry)
        datagram.pieces.append(piece)
        if not part.more:
            self._ends.setdefault(key, part.offset + part.length)
        end = self._ends.get(key)
        if end is None or not _covered(datagram, end):
            if len(self._open) > _MOST_OPEN:
                self._drop_datagram()
            return None
        del self._open[key], self._ends[key]
        datagram.data = _joined(datagram)[:end]
        datagram.missing = end - len(datagram.data)
        self._whole[key] = datagram
        while len(self._whole) > _REMEMBERED:
            self._whole.popitem(last=False)
        return self._rpc(datagram, entry)

    def _same(self, before: Datagram, part: ip.Datagram, entry: Entry) -> bool:
        """Whether a fragment copies one of a datagram that just became whole."""
        newest = max(each.time_ns for each in before.entries())
        return entry.time_ns - newest <= self._copy_ns and any(
            offset == part.offset and length == len(part.payload)
            for offset, _, _, length in before.pieces
        )

    @staticmethod
    def _late(before: Datagram, piece: tuple[int, Entry, int, int], entry: Entry) -> Copy | None:
        if before.message is None:  # waits for more RPC fragments
            before.pieces.append(piece)
            return None
        copy = Datagram(before.source, before.destination, before.ip_id, entry.time_ns, [piece])
        return Copy(before.message, copy, before)

    # RPC

    def _rpc(self, datagram: Datagram, entry: Entry) -> Message | Copy | None:
        data = datagram.data
        payload, missing = _udp_payload(datagram)
        ports = struct.unpack(">2H", data[:4]) if len(data) >= 8 else ()
        if len(data) < 8 or not is_pnio(
            payload, 0, len(payload), cut=missing > 0, on_port=PNIO_PORT in ports
        ):
            return self._message("foreign", [[datagram]], entry)
        pdu = rpc.parse(
            Packet(
                "udp", entry.number, entry.time_ns, payload,
                src_ip=datagram.source, dst_ip=datagram.destination, ip_id=datagram.ip_id,
                missing=missing,
            )
        )  # fmt: skip
        if pdu is None or not pdu.fragmented:
            return self._message("rpc", [[datagram]], entry, pdu)
        return self._rpc_fragment(pdu, datagram, entry)

    def _rpc_fragment(
        self, pdu: rpc.Pdu, datagram: Datagram, entry: Entry
    ) -> Message | Copy | None:
        key = (pdu.source, pdu.activity, pdu.seq, pdu.ptype)
        when, before = self._done.get(key, (0, None))
        if before is not None and entry.time_ns - when <= self._copy_ns:
            known = before.parts.get(pdu.fragment)
            if known is not None and known[0].body == pdu.body and known[1][0].message is not None:
                return Copy(known[1][0].message, datagram, known[1][0])
        self._expire(entry.time_ns)
        partial = self._partial.get(key)
        if partial is None:
            partial = self._partial[key] = _Partial(entry.time_ns)
            if len(self._partial) > _MOST_OPEN:
                self._drop_message()
        partial.parts.setdefault(pdu.fragment, (pdu, []))[1].append(datagram)
        if pdu.last and partial.last is None:
            partial.last = pdu.fragment
        last = partial.last
        if last is None or any(number not in partial.parts for number in range(last + 1)):
            return None
        del self._partial[key]
        for number in [number for number in partial.parts if number > last]:
            self._give_up(partial.parts.pop(number)[1])
        self._done[key] = (entry.time_ns, partial)
        while len(self._done) > _REMEMBERED:
            self._done.popitem(last=False)
        pieces = [partial.parts[number] for number in range(last + 1)]
        whole = pieces[0][0]
        whole.body = b"".join(pdu.body for pdu, _ in pieces)
        whole.missing = sum(pdu.missing for pdu, _ in pieces)
        return self._message("rpc", [copies for _, copies in pieces], entry, whole)

    @staticmethod
    def _message(
        kind: Kind, parts: list[list[Datagram]], entry: Entry, pdu: rpc.Pdu | None = None
    ) -> Message:
        message = Message(kind, [], entry.number, entry.time_ns, pdu, parts)
        seen: dict[int, Entry] = {}
        for datagram in message.datagrams:
            datagram.message = message
            for each in datagram.entries():
                seen[each.number] = each
        message.entries = [seen[number] for number in sorted(seen)]
        return message

    # What never becomes whole

    def _expire(self, now: int) -> None:
        while self._open and now - next(iter(self._open.values())).first_ns > self._expiry_ns:
            self._drop_datagram()
        while self._partial and now - next(iter(self._partial.values())).first_ns > self._expiry_ns:
            self._drop_message()

    def _drop_datagram(self) -> None:
        key, datagram = self._open.popitem(last=False)
        self._ends.pop(key, None)
        self._give_up([datagram])

    def _drop_message(self) -> None:
        partial = self._partial.popitem(last=False)[1]
        self._give_up([each for _, datagrams in partial.parts.values() for each in datagrams])

    def _give_up(self, datagrams: list[Datagram]) -> None:
        self.given_up.append([entry for datagram in datagrams for entry in datagram.entries()])


def _udp_payload(datagram: Datagram) -> tuple[bytes, int]:
    """The payload of the UDP datagram, and how many bytes of it were not captured."""
    data = datagram.data
    stated = int.from_bytes(data[4:6], "big")
    length = stated if stated >= 8 else len(data) + datagram.missing
    payload = data[8:length]
    return payload, max(0, length - 8 - len(payload))


def _covered(datagram: Datagram, end: int) -> bool:
    """Whether the wire lengths of the pieces leave no hole; what the capture cut off counts as there."""
    reach = 0
    for offset, entry, at, length in sorted(datagram.pieces, key=lambda piece: piece[0]):
        if offset > reach:
            return False
        cut = entry.original_length > len(entry.data)
        stated = int.from_bytes(entry.data[entry.layer + 2 : entry.layer + 4], "big")
        wire = max(length, stated - (at - entry.layer)) if cut else length
        reach = max(reach, offset + wire)
    return reach >= end


def _joined(datagram: Datagram) -> bytes:
    """The captured bytes up to the first hole."""
    longest: dict[int, bytes] = {}
    for offset, entry, at, length in datagram.pieces:
        part = bytes(entry.data[at : at + length])
        if len(part) > len(longest.get(offset, b"")):
            longest[offset] = part
    joined = b""
    for offset in sorted(longest):
        if offset > len(joined):
            break
        joined += longest[offset][len(joined) - offset :]
    return joined
