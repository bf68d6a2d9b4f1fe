"""Which frames make up a message: datagrams to RPC messages, and DCP and LLDP frames.

The analysis forgets the pieces once it has the whole; here they are kept, so that all frames of a
message can be exported, and a change of the message can be written back into every one of them.
Copies (mirror ports) belong to the message that they copy. Nothing is interpreted beyond the RPC header.
IP fragments are the business of `datagrams`.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Iterable, Iterator
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

from .datagrams import MOST_COPIES, Datagram, Datagrams, Entry, Recent

Kind = Literal["rpc", "dcp", "lldp", "foreign"]


@dataclass(slots=True, eq=False)
class Message:
    """What frames say together. `parts` of an RPC message: by fragment, each with its copies.

    `pdu` is that of the first fragment, with the body up to the first byte that was not captured; None
    for a frame that was cut inside the RPC header, and for the other kinds.
    """

    kind: Kind
    entries: list[Entry]
    frame: int
    time_ns: int
    pdu: rpc.Pdu | None = None
    parts: list[list[Datagram]] = field(default_factory=list)
    rewritten: bool = False
    """Whether its datagrams hold what may leave the house."""

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


@dataclass(slots=True, eq=False)
class _Part:
    """One RPC fragment and the datagrams that brought it."""

    pdu: rpc.Pdu
    body: bytes
    datagrams: list[Datagram]


@dataclass(slots=True)
class _Partial:
    """An RPC message so far: its parts by fragment number."""

    newest_ns: int
    parts: dict[int, _Part] = field(default_factory=dict)
    last: int | None = None

    @property
    def whole(self) -> bool:
        """Whether every fragment is there."""
        return self.last is not None and len(self.parts) > self.last

    @property
    def datagrams(self) -> list[Datagram]:
        """Those of all parts."""
        return [each for part in self.parts.values() for each in part.datagrams]

    def add(self, pdu: rpc.Pdu, datagram: Datagram) -> list[Datagram]:
        """Takes a fragment; returns the datagrams that are none of this message, or copies too many."""
        refused = []
        if pdu.last and self.last is None:
            self.last = pdu.fragment
            for number in [number for number in self.parts if number > pdu.fragment]:
                refused += self.parts.pop(number).datagrams
        if self.last is not None and pdu.fragment > self.last:
            return [*refused, datagram]
        part = self.parts.setdefault(pdu.fragment, _Part(pdu, pdu.body, []))
        if len(part.datagrams) == MOST_COPIES:
            return [*refused, datagram]
        part.datagrams.append(datagram)
        return refused


_Call = tuple[str, bytes, int, int]


class Tracker:
    """Takes the frames of a capture in their order; holds as many as the analysis does (`limits`).

    `given_up` collects what never became whole, each the frames of it; who wants them takes them out.
    """

    def __init__(self) -> None:
        self._limits = limits()
        self.given_up: list[list[Entry]] = []
        self._datagrams = Datagrams(self.given_up)
        self._partial: OrderedDict[_Call, _Partial] = OrderedDict()
        self._done: Recent[_Call, tuple[int, _Partial]] = Recent()
        self._fragments = 0
        self._bytes = 0

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
        if not part.whole:
            return self._fragment(part, entry, payload_at)
        whole = Datagram(part.source, part.destination, part.identification, entry.time_ns)
        whole.add(0, entry, payload_at, len(part.payload))
        whole.data, whole.missing = part.payload, part.missing
        return self._rpc(whole, entry)

    def finish(self) -> None:
        """The capture is over: what is open will never be whole."""
        self._datagrams.finish()
        while self._partial:
            self._drop(next(iter(self._partial)))

    # IP

    def _fragment(self, part: ip.Datagram, entry: Entry, at: int) -> Message | Copy | None:
        before = self._datagrams.before(part, entry.time_ns)
        if before is not None:
            return self._late(before, part, entry, at)
        self._expire(entry.time_ns)
        datagram = self._datagrams.feed(part, entry, at)
        return None if datagram is None else self._rpc(datagram, entry)

    def _late(self, before: Datagram, part: ip.Datagram, entry: Entry, at: int) -> Copy | None:
        length = len(part.payload)
        if before.message is not None:
            copy = Datagram(before.source, before.destination, before.ip_id, entry.time_ns)
            copy.add(part.offset, entry, at, length)
            return Copy(before.message, copy, before)
        if before.lost or not before.add(part.offset, entry, at, length):
            self.given_up.append([entry])
        else:  # it waits for more RPC fragments
            self._bytes += length
            self._make_room()
        return None

    # RPC

    def _rpc(self, datagram: Datagram, entry: Entry) -> Message | Copy | None:
        data = datagram.data
        payload, missing = _udp_payload(datagram)
        ports = struct.unpack(">2H", data[:4]) if len(data) >= 8 else ()
        if len(data) < 8 or not is_pnio(
            payload, 0, len(payload), cut=missing > 0, on_port=PNIO_PORT in ports
        ):
            return _message("foreign", [[datagram]], entry)
        pdu = rpc.parse(
            Packet(
                "udp", entry.number, entry.time_ns, payload,
                src_ip=datagram.source, dst_ip=datagram.destination, ip_id=datagram.ip_id,
                missing=missing,
            )
        )  # fmt: skip
        if pdu is None or not pdu.fragmented:
            return _message("rpc", [[datagram]], entry, pdu)
        return self._rpc_fragment(pdu, datagram, entry)

    def _rpc_fragment(
        self, pdu: rpc.Pdu, datagram: Datagram, entry: Entry
    ) -> Message | Copy | None:
        key = (pdu.source, pdu.activity, pdu.seq, pdu.ptype)
        copy = self._copy(key, pdu, datagram, entry)
        if copy is not None:
            return copy
        self._expire(entry.time_ns)
        known = self._partial.get(key)
        if known is not None and self._is_old(known, entry.time_ns):
            self._drop(key)  # the sequence number came round: this is another message
        partial = self._partial.setdefault(key, _Partial(entry.time_ns))
        partial.newest_ns = entry.time_ns
        self._hold([datagram], 1)
        refused = partial.add(pdu, datagram)
        if refused:
            self._hold(refused, -1)
            self._datagrams.lose(refused)
        if not partial.whole:
            self._make_room()
            return None
        del self._partial[key]
        self._hold(partial.datagrams, -1)
        size = sum(len(part.body) for part in partial.parts.values())
        self._done.add(key, (entry.time_ns, partial), size)
        parts = [partial.parts[number] for number in sorted(partial.parts)]
        return _message(
            "rpc", [part.datagrams for part in parts], entry, rpc.join([part.pdu for part in parts])
        )

    def _copy(self, key: _Call, pdu: rpc.Pdu, datagram: Datagram, entry: Entry) -> Copy | None:
        """A fragment of a message that just became whole, once more."""
        done = self._done.get(key)
        if done is None or abs(entry.time_ns - done[0]) > self._limits.copy_ns:
            return None
        before = done[1]
        known = before.parts.get(pdu.fragment)
        if known is None or known.body != pdu.body:
            return None
        message = known.datagrams[0].message
        if message is None:
            return None
        datagram.message = message
        return Copy(message, datagram, known.datagrams[0])

    # What never becomes whole

    def _hold(self, datagrams: Iterable[Datagram], sign: Literal[1, -1]) -> None:
        for each in datagrams:
            self._fragments += sign
            self._bytes += sign * each.size

    def _expire(self, now: int) -> None:
        self._datagrams.expire(now)
        while self._partial:
            key, oldest = next(iter(self._partial.items()))
            if not self._is_old(oldest, now):
                return
            self._drop(key)

    def _is_old(self, partial: _Partial, now: int) -> bool:
        """The clock may have stepped back, so far ahead of it is old too."""
        return abs(now - partial.newest_ns) > self._limits.fragment_expiry_ns

    def _make_room(self) -> None:
        bounds = self._limits
        while (
            len(self._partial) > bounds.rpc_messages
            or self._fragments > bounds.rpc_fragments
            or self._bytes > bounds.fragment_bytes
        ):
            self._drop(next(iter(self._partial)))

    def _drop(self, key: _Call) -> None:
        datagrams = self._partial.pop(key).datagrams
        self._hold(datagrams, -1)
        self._datagrams.lose(datagrams)


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


def _udp_payload(datagram: Datagram) -> tuple[bytes, int]:
    """The payload of the UDP datagram, and how many bytes of it were not captured."""
    data = datagram.data
    stated = int.from_bytes(data[4:6], "big")
    length = stated if stated >= 8 else len(data) + datagram.missing
    payload = data[8:length]
    return payload, max(0, length - 8 - len(payload))
