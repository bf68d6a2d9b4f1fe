"""From frames to messages that know their frames, so that all can be exported and written again.

`ds47.profinet` puts the messages together and keeps their traces. Copies (mirror ports) belong to the message
that they copy. Nothing is interpreted beyond the RPC header.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal

from ds47.capture import Frame
from ds47.profinet import rpc
from ds47.profinet.ip import Reassembler
from ds47.profinet.link import Packet, dissect
from ds47.profinet.traces import Trace, Traces
from ds47.spec.semantics import limits

Kind = Literal["rpc", "dcp", "lldp", "foreign"]

_REMEMBERED: Final = 64
"""Finished RPC messages to remember, so that repeated fragments are recognised; fewer if they are long."""


@dataclass(slots=True, eq=False)
class TrackedMessage:
    """What frames say together. `parts` of an RPC message: by fragment, each with its copies.

    `packet` is what the last of the frames brought, None for a foreign one. `pdu` is that of the first
    fragment, with the body up to the first byte that was not captured; None for a frame that was cut
    inside the RPC header, and for the other kinds.
    """

    kind: Kind
    frame: int
    time_ns: int
    packet: Packet | None = None
    pdu: rpc.Pdu | None = None
    parts: list[list[Trace]] = field(default_factory=list)
    rewritten: bool = False
    """Whether its frames hold what may leave the house."""

    def __post_init__(self) -> None:
        for trace in self.traces:
            trace.context = self

    @property
    def traces(self) -> Iterator[Trace]:
        """Those of all datagrams, copies too."""
        for copies in self.parts:
            yield from copies

    @property
    def frames(self) -> list[int]:
        """Numbers of all its frames, in the order of the capture."""
        return sorted({self.frame, *(frame for trace in self.traces for frame in trace.frames)})


@dataclass(frozen=True, slots=True)
class _Done:
    """A message that was whole: when, how long, and by number, body and IP id of each fragment its trace."""

    time_ns: int
    size: int
    fragments: dict[tuple[int, bytes, int], Trace]


@dataclass(slots=True, eq=False)
class Copy:
    """A datagram, or one piece of it, that came again after its message was whole."""

    message: TrackedMessage
    trace: Trace
    sibling: Trace


_Call = tuple[str, bytes, int, int]


class Tracker:
    """Takes the frames of a capture in their order; holds as many as the analysis does (`limits`).

    `lost` is that of `Traces`: the reader empties it.
    """

    def __init__(self) -> None:
        bounds, self._traces = limits(), Traces()
        self.lost = self._traces.lost
        self._limits = bounds
        self._datagrams = Reassembler(
            bounds.fragment_expiry_ns, bounds.ip_datagrams, bounds.ip_fragments,
            bounds.fragment_bytes, self._traces,
        )  # fmt: skip
        self._fragments = rpc.Fragments(
            bounds.fragment_expiry_ns, bounds.rpc_messages, bounds.rpc_fragments,
            bounds.fragment_bytes, self._traces,
        )  # fmt: skip
        self._done: OrderedDict[_Call, _Done] = OrderedDict()

    def feed(self, frame: Frame) -> TrackedMessage | Copy | None:
        """The message that this frame completes; None where more has to come."""
        packet = dissect(frame, self._datagrams)
        trace = self._traces.take()
        if packet is not None and packet.kind in ("dcp", "lldp"):
            return TrackedMessage(packet.kind, frame.number, frame.time_ns, packet)
        if trace is None:  # cyclic frames, too
            return TrackedMessage("foreign", frame.number, frame.time_ns)
        if packet is not None:
            return self._rpc(packet, trace)
        if trace.copy_of is not None:
            return self._late(trace, trace.copy_of)
        if trace.whole:
            return TrackedMessage("foreign", frame.number, frame.time_ns, parts=[[trace]])
        return None

    def finish(self) -> None:
        """The capture is over: open messages will never be whole."""
        self._datagrams.finish()
        self._fragments.finish()

    def _late(self, copy: Trace, before: Trace) -> Copy | None:
        """A fragment of a datagram that is whole came again."""
        if before.context is not None:
            return Copy(before.context, copy, before)
        if before.lost:
            self._traces.lose([copy])
        else:  # it waits for more RPC fragments
            self._traces.add(before, *copy.pieces)
        return None

    def _rpc(self, packet: Packet, trace: Trace) -> TrackedMessage | Copy | None:
        pdu = rpc.parse(packet)
        if pdu is not None and pdu.fragmented:
            return self._fragment(packet, pdu, trace)
        return TrackedMessage("rpc", packet.frame, packet.time_ns, packet, pdu, [[trace]])

    def _fragment(self, packet: Packet, pdu: rpc.Pdu, trace: Trace) -> TrackedMessage | Copy | None:
        key = (pdu.source, pdu.activity, pdu.seq, pdu.ptype)
        done = self._done.get(key)
        soon = done is not None and abs(pdu.time_ns - done.time_ns) <= self._limits.copy_ns
        if done is not None and (pdu.ip_id or soon):
            before = done.fragments.get((pdu.fragment, pdu.body, pdu.ip_id))
            if before is not None:
                trace.context = before.context
                return Copy(before.context, trace, before)
        whole = self._fragments.complete(pdu, trace)
        if whole is None:
            return None
        self._remember(key, pdu.time_ns, whole)
        parts = [whole.traces[number] for number in sorted(whole.traces)]
        return TrackedMessage("rpc", packet.frame, packet.time_ns, packet, whole.joined(pdu), parts)

    def _remember(self, key: _Call, time_ns: int, whole: rpc.Partial) -> None:
        fragments = {(part.fragment, part.body, part.ip_id): whole.traces[part.fragment][0]
                     for part in whole.parts.values()}  # fmt: skip
        done = self._done
        done.pop(key, None)
        done[key] = _Done(time_ns, sum(len(body) for _, body, _ in fragments), fragments)
        most = self._limits.fragment_bytes
        while len(done) > _REMEMBERED or sum(each.size for each in done.values()) > most:
            done.popitem(last=False)
