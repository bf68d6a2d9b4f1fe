"""Which segments of TCP are wanted: those in which the PDUs of chosen jobs of S7 stand.

The capture is read again for that: a result only has the frames that complete a PDU. Frames of PROFINET are
`tracking`, those of PROFIBUS `bus`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ds47.capture import Frame
from ds47.export.selection import Chosen, Selection
from ds47.model import S7
from ds47.profinet.link import dissect
from ds47.s7 import tcp
from ds47.s7.connections import Connections
from ds47.s7.model import At, S7Job
from ds47.spec.semantics import limits


class S7Frames:
    """Tells which frames of a capture with S7 are wanted.

    Args:
        ports: of servers.
        selection: what is wanted,
        chosen: and what that is in this capture.
    """

    def __init__(self, ports: Sequence[int], selection: Selection, chosen: Chosen) -> None:
        self._ports = frozenset(ports)
        self._selection = selection
        self._chosen = chosen
        self._complete = {
            (each.frames.first(), each.request_reference)
            for each in chosen.transactions
            if each.channel == S7
        }
        self._connections = Connections(self._ports, limits(), self._over)
        self.wanted: set[int] = set()
        """Numbers of the frames, all of them after `finish`."""

    def feed(self, frame: Frame) -> None:
        """The next frame of the capture."""
        packet = dissect(frame)
        if packet is None or packet.kind != "tcp":
            return
        segment = tcp.parse(packet.src_ip, packet.dst_ip, packet.payload, packet.missing)
        if segment is None or not {segment.source.port, segment.destination.port} & self._ports:
            return
        if self._selection.by_frame:
            ips = self._chosen.ips
            touched = not ips or not ips.isdisjoint((packet.src_ip, packet.dst_ip))
            if touched and self._selection.in_time(frame.time_ns):
                self.wanted.add(frame.number)
            return
        self._connections.feed(segment, At(packet.frame, packet.time_ns))

    def finish(self) -> None:
        """The capture is over."""
        self._connections.finish()

    def _over(self, job: S7Job) -> None:
        """A job with all its frames."""
        first = min(each.frame for each in (job.asked, job.answered) if each is not None)
        if (first, job.reference) not in self._complete:
            return
        self.wanted.update(job.frames)
        for frame in job.frames:
            if frame not in self._chosen.notes:
                self._chosen.notes[frame] = ["part of a PDU of S7"]
