"""Frames to whole RPC messages: datagrams and fragments put together, copies left out, stations named.

Each step is a module of its own (`link`, `ip`, `rpc`, `calls`); here they are only joined. What a message
carries, and whose it is, is the business of the listeners.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from ds47.capture import Frame
from ds47.profinet import rpc
from ds47.profinet.calls import Became, CallTracker, RpcCall
from ds47.profinet.ip import Cut, Reassembler
from ds47.profinet.link import Packet, Packets
from ds47.profinet.records import Record
from ds47.profinet.stations import Stations
from ds47.spec.layouts import RPC_CONNECT, RPC_READ, RPC_READ_IMPLICIT, RPC_WRITE
from ds47.spec.semantics import Limits

_RECORD_CALLS = (RPC_READ, RPC_WRITE, RPC_READ_IMPLICIT)


class Listener(Protocol):
    """Hears of messages that do not become whole."""

    def first_record(self, pdu: rpc.Pdu) -> Record | None:
        """The first record in the beginning of a message; None where that tells of none that can be ours."""
        ...

    def incomplete(
        self, pdu: rpc.Pdu, have: int, kind: str, limit: str = "", call: RpcCall | None = None
    ) -> None:
        """A message that nobody waits for any more.

        Args:
            pdu: it, as far as it goes.
            have: number of fragments that were seen.
            kind: "IP" or "RPC".
            limit: the number of spec/limits.toml that pushed it out; "" where its time was over.
            call: the open call to which it belongs, if there is one.
        """
        ...


class Segments(Protocol):
    """Takes segments of TCP."""

    def frame(self, frame: Frame) -> bool:
        """The next frame of the capture; False where it has no segment, or not as nearly all have one."""
        ...

    def packet(self, packet: Packet) -> None:
        """A segment in any other frame."""
        ...


class Transport:
    """Feeds a call tracker with the messages of a capture, in the order of its frames.

    Args:
        limits: numbers of spec/limits.toml.
        calls: takes the messages.
        stations: takes what names a device.
        listener: hears of messages that do not become whole.
        cut: is told of each frame that the capture cut inside a record call.
        cyclic: takes cyclic frames,
        tcp: and segments of TCP.
    """

    def __init__(
        self,
        limits: Limits,
        calls: CallTracker,
        stations: Stations,
        listener: Listener,
        cut: Callable[[Cut], None],
        cyclic: Callable[[Packet], None],
        tcp: Segments,
    ) -> None:
        self._calls = calls
        self._stations, self._known = stations, stations.known
        self._listener = listener
        self._cut = cut
        self._cyclic = cyclic
        self._tcp = tcp
        self._fragments = rpc.Fragments(
            limits.fragment_expiry_ns, limits.rpc_messages, limits.rpc_fragments,
            limits.fragment_bytes,
        )  # fmt: skip
        self._datagrams = Reassembler(
            limits.fragment_expiry_ns, limits.ip_datagrams, limits.ip_fragments,
            limits.fragment_bytes,
        )  # fmt: skip
        self._packets = Packets(self._datagrams, self._begun)

    def take_frame(self, frame: Frame) -> Sequence[Became]:
        """What becomes of calls by the next frame of a capture."""
        pdu = rpc.from_frame(frame)
        if pdu is not None:
            return self._pdu(pdu)
        if self._tcp.frame(frame):
            return ()
        packet = self._packets.packet(frame)
        if self._datagrams.given_up:
            self._tell_given_up()
        return () if packet is None else self._packet(packet)

    def finish(self) -> None:
        """The capture is over: nobody waits any more."""
        for pdu, have in self._fragments.unfinished():
            self._incomplete(pdu, have, "RPC")
        for packet, have in self._packets.unfinished():
            part = rpc.parse(packet)
            if part is not None:
                self._incomplete(part, have, "IP")

    def _packet(self, packet: Packet) -> Sequence[Became]:
        """Takes what one frame or several brought: a whole datagram, or what names a station."""
        if packet.kind == "rt":
            self._cyclic(packet)
        elif packet.kind == "tcp":
            self._tcp.packet(packet)
        elif packet.kind != "udp":
            self._stations.station(packet)
        elif (pdu := rpc.parse(packet)) is not None:
            return self._pdu(pdu)
        elif packet.missing and packet.cut is not None:
            self._cut(packet.cut)
        return ()

    def _pdu(self, pdu: rpc.Pdu) -> Sequence[Became]:
        if pdu.opnum == rpc.NO_OPERATION:
            return self._calls.passes(pdu) if pdu.ptype == 0 else ()
        if pdu.missing and pdu.cut is not None and pdu.opnum in _RECORD_CALLS:
            self._cut(pdu.cut)  # a copy, too: it counts frames
        if self._calls.is_copy(pdu):
            return ()
        whole = self._joined(pdu) if pdu.fragmented else pdu
        if whole is None:
            return ()
        if (whole.ptype == 2 and whole.source not in self._known) or whole.opnum == RPC_CONNECT:
            self._stations.message(whole)
        return self._calls.take(whole)

    def _joined(self, pdu: rpc.Pdu) -> rpc.Pdu | None:
        """The message that an RPC fragment completes."""
        fragments = self._fragments
        whole = fragments.feed(pdu)
        if fragments.given_up:
            given_up, fragments.given_up = fragments.given_up, []
            for beginning, have, limit in given_up:
                self._incomplete(beginning, have, "RPC", limit)
        if whole is None:
            self._begins(pdu)
        return whole

    def _begun(self, packet: Packet) -> None:
        """The first IP fragment of a message."""
        pdu = rpc.parse(packet)
        if pdu is not None:
            self._begins(pdu)

    def _begins(self, pdu: rpc.Pdu) -> None:
        if pdu.ptype or self._listener.first_record(pdu) is not None:
            self._calls.begun(pdu)

    def _tell_given_up(self) -> None:
        for packet, have, limit in self._packets.given_up():
            pdu = rpc.parse(packet)
            if pdu is not None:
                self._incomplete(pdu, have, "IP", limit)

    def _incomplete(self, pdu: rpc.Pdu, have: int, kind: str, limit: str = "") -> None:
        self._listener.incomplete(pdu, have, kind, limit, self._calls.open_call(pdu))
