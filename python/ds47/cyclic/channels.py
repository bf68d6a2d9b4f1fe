"""Cyclic frames to PKW transactions: which bytes of which frame are a channel, and what changed in them.

Relations come from Connects; a later Connect of the same stations replaces what an earlier one said. Transactions
are handed out when a relation is proven: a request and the response that followed it were seen. What a change of
the bytes means is the business of `handshake`; frames are found by `ds47.capture`, which is told what to watch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from ds47.capture.scan import Watch
from ds47.cyclic.handshake import ERROR, OK, Channel, Job, Moment
from ds47.cyclic.relations import Relation, Side, parameter_channels, side
from ds47.model import SEEN
from ds47.profinet.connect import parse_request, parse_response
from ds47.profinet.link import Packet
from ds47.profinet.rpc import Pdu, device_identity

_FRAME_ID = 2
_VALID, _GOOD = 0x04, 0x80
"""The bit of the status of a frame that says that its data is valid, and that of IOPS."""
_KEPT = 256
"""Transactions that wait for the proof."""


@dataclass(slots=True)
class _Line:
    """One relation at work."""

    relation: Relation
    channel: Channel
    waiting: list[Job] = field(default_factory=list)
    last: dict[bool, bytes] = field(default_factory=dict)
    """What was there last, of the controller (True) and of the device; nothing of one that is not valid."""


class ParameterChannels:
    """All parameter channels of a capture.

    Args:
        closed: is told of each transaction of a proven relation when it is over.
        watch: is told which cyclic frames to give from now on.
        most: relations that are kept.
    """

    def __init__(
        self,
        closed: Callable[[Relation, Job], None],
        watch: Callable[[Sequence[Watch]], None],
        most: int,
    ) -> None:
        self._closed = closed
        self._watch = watch
        self._most = most
        self._lines: list[_Line] = []
        self._sides: dict[tuple[str, int], list[tuple[_Line, Side, bool]]] = {}
        self._start_ns = 0
        self.relations: list[Relation] = []
        """All that there were, those that a later Connect replaced too."""

    def connected(self, request: Pdu, response: Pdu) -> None:
        """A Connect and its response; nothing happens where it was refused, or sets up no such channel."""
        asked, told = parse_request(request), parse_response(response)
        if asked is None or told is None or told[0] != asked.ar:
            return
        device_mac, frame_ids = told[1:]
        identity = device_identity(response.object_uuid)
        self._replace(asked.controller_mac, device_mac)
        for submodule, telegrams in parameter_channels(asked.answered(frame_ids)):
            if len(self.relations) >= self._most:
                break
            assert submodule.output is not None
            assert submodule.input is not None
            relation = Relation(
                request.client, request.server, identity and identity[0], asked.ar, submodule.api,
                submodule.slot, submodule.subslot, telegrams,
                side(submodule.output, asked.controller_mac), side(submodule.input, device_mac),
                response.frame,
            )  # fmt: skip
            self._add(relation)
        self._tell()

    def _replace(self, controller: str, device: str) -> None:
        """The stations set up all their channels anew."""
        macs = [bytes.fromhex(each.replace(":", "")) for each in (controller, device)]
        for line in list(self._lines):
            relation = line.relation
            if [relation.output.source, relation.input.source] == macs:
                line.channel.finish()
                self._lines.remove(line)

    def _add(self, relation: Relation) -> None:
        self.relations.append(relation)
        line = _Line(relation, Channel(lambda job: self._over(line, job)))
        self._lines.append(line)

    def _tell(self) -> None:
        self._sides = {}
        for line in self._lines:
            for each, sent in ((line.relation.output, True), (line.relation.input, False)):
                key = each.source.hex(":"), each.frame_id
                self._sides.setdefault(key, []).append((line, each, sent))
        self._watch([
            Watch(bytes.fromhex(mac.replace(":", "")), frame_id, _apart(each.parts for _, each, _ in found))
            for (mac, frame_id), found in self._sides.items()
        ])  # fmt: skip

    def frame(self, packet: Packet) -> None:
        """A cyclic frame."""
        data = packet.payload
        found = self._sides.get((packet.src_mac or "", int.from_bytes(data[:_FRAME_ID])))
        for line, each, sent in found or ():
            if len(data) >= _FRAME_ID + max(each.offset + each.length, each.status + 1):
                self._take(line, each, sent, data[_FRAME_ID:], packet)

    def _take(self, line: _Line, each: Side, sent: bool, data: bytes, packet: Packet) -> None:
        self._start_ns = self._start_ns or packet.time_ns
        cycle = round((packet.time_ns - self._start_ns) / max(each.cycle_ns, 1))
        at = Moment(packet.frame, packet.time_ns, cycle)
        valid = data[each.status] & _VALID and (each.iops is None or data[each.iops] & _GOOD)
        if not valid:
            if sent in line.last:
                line.last.clear()
                line.channel.lost(at)
            return
        words = data[each.offset : each.offset + each.length]
        line.last[sent] = words
        (line.channel.sent if sent else line.channel.answered)(words, at)

    def _over(self, line: _Line, job: Job) -> None:
        """A transaction is over; it waits until one of them proves the relation."""
        if line.relation.certainty != SEEN and _proves(job):
            line.relation.certainty = SEEN
        if len(line.waiting) < _KEPT:
            line.waiting.append(job)
        if line.relation.certainty == SEEN:
            for each in line.waiting:
                self._closed(line.relation, each)
            line.waiting.clear()

    def finish(self) -> None:
        """The capture ends."""
        for line in self._lines:
            line.channel.finish()


def _proves(job: Job) -> bool:
    """Whether the drive responded to a request that was seen to begin, and with an edge of its own."""
    return job.state in (OK, ERROR) and job.began and not job.settled


def _apart(parts: Iterable[tuple[tuple[int, int], ...]]) -> tuple[tuple[int, int], ...]:
    """Parts of several channels of one frame in order, each byte in one of them."""
    bytes_ = sorted({
        at for several in parts for first, count in several for at in range(first, first + count)
    })  # fmt: skip
    found: list[tuple[int, int]] = []
    for at in bytes_:
        if found and sum(found[-1]) == at:
            found[-1] = found[-1][0], found[-1][1] + 1
        else:
            found.append((at, 1))
    return tuple(found)
