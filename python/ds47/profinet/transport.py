"""Frames to datagrams: what is not simply one PDU in one frame goes where it belongs.

IP fragments are put together and stations named; cyclic frames and segments of TCP are handed on. Each step is a
module of its own (`link`, `ip`, `stations`). Nearly every PDU is one that `rpc.from_frame` takes, and never comes
here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ds47.capture import Frame
from ds47.profinet import rpc
from ds47.profinet.calls import CallTracker, RpcCall
from ds47.profinet.ip import Cut, Reassembler
from ds47.profinet.link import Packet, Packets
from ds47.profinet.stations import Stations
from ds47.spec.semantics import Limits


class Listener(Protocol):
    """Hears of messages that do not become whole."""

    def incomplete(self, given_up: rpc.GivenUp, kind: str, call: RpcCall | None = None) -> None:
        """A message that nobody waits for any more.

        Args:
            given_up: its beginning, or the first that was seen of it, and why.
            kind: "IP" or "RPC".
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
    """Takes the frames of a capture that are no whole PDU by themselves, in their order.

    Args:
        limits: numbers of spec/limits.toml.
        calls: hears of messages that begin and do not end.
        stations: takes what names a device.
        listener: hears of messages that do not become whole.
        cut: is told of each frame that the capture cut before it tells of which call it is.
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
        self._stations = stations
        self._listener = listener
        self._cut = cut
        self._cyclic = cyclic
        self._tcp = tcp
        self._datagrams = Reassembler(
            limits.fragment_expiry_ns, limits.ip_datagrams, limits.ip_fragments,
            limits.fragment_bytes,
        )  # fmt: skip
        self._packets = Packets(self._datagrams, self._begun)

    def datagram(self, frame: Frame) -> rpc.Pdu | None:
        """The PDU that the next frame of a capture has or completes; None where it is anything else."""
        if self._tcp.frame(frame):
            return None
        packet = self._packets.packet(frame)
        if self._datagrams.given_up:
            for whole, have, limit in self._packets.given_up():
                self._incomplete(whole, have, limit)
        return None if packet is None else self.packet(packet)

    def packet(self, packet: Packet) -> rpc.Pdu | None:
        """The same of what one frame or several brought: a whole datagram, or what names a station."""
        if packet.kind == "rt":
            self._cyclic(packet)
        elif packet.kind == "tcp":
            self._tcp.packet(packet)
        elif packet.kind != "udp":
            self._stations.station(packet)
        elif (pdu := rpc.parse(packet)) is not None:
            return pdu
        elif packet.missing and packet.cut is not None:
            self._cut(packet.cut)
        return None

    def finish(self) -> None:
        """The capture is over: nobody waits any more."""
        for packet, have in self._packets.unfinished():
            self._incomplete(packet, have)

    def _begun(self, packet: Packet) -> None:
        """The first IP fragment of a message."""
        pdu = rpc.parse(packet)
        if pdu is not None:
            self._calls.begun(pdu)

    def _incomplete(self, packet: Packet, have: int, limit: str = "") -> None:
        pdu = rpc.parse(packet)
        if pdu is not None:
            call = self._calls.open_call(pdu)
            self._listener.incomplete(rpc.GivenUp(pdu, have, limit), "IP", call)
