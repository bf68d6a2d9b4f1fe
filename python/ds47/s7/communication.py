"""S7 of a capture: packets in, jobs that are over with what is wrong with them out.

Joins the steps of this room; the analysis needs no other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ds47 import model
from ds47.findings.remark import Remark
from ds47.profinet.link import Packet
from ds47.s7 import tcp
from ds47.s7.connections import Connections
from ds47.s7.model import At, Connection, Evidence, Job, Told
from ds47.s7.transactions import told
from ds47.spec.semantics import Limits

PORT = 102
"""ISO on TCP."""
Over = Callable[[Job, list[Remark]], None]


class Communication:
    """All connections of S7 of a capture.

    Args:
        ports: TCP ports of servers; without any, there are none.
        bounds: how much is kept.
        over: is told of each job that is over, with what is wrong with it.
    """

    def __init__(self, ports: Sequence[int], bounds: Limits, over: Over) -> None:
        self.ports = frozenset(ports)
        self._over = over
        self._connections = Connections(self.ports, bounds, (_Ends(over),))

    def packet(self, packet: Packet) -> None:
        """The next segment of TCP."""
        segment = tcp.parse(packet.src_ip, packet.dst_ip, packet.payload, packet.missing)
        if segment is not None:
            self._connections.feed(segment, At(packet.frame, packet.time_ns))

    def finish(self) -> None:
        """The capture is over."""
        self._connections.finish()

    def told(self) -> list[model.Connection]:
        """The connections, as the report has them."""
        return [told(each) for each in self._connections.all()]

    @property
    def left_out(self) -> int:
        """Connections for which there was no room."""
        return self._connections.left_out


class _Ends:
    """Hands out jobs that are over, and hears nothing else."""

    def __init__(self, over: Over) -> None:
        self._over = over

    def over(self, job: Job) -> None:
        """As `model.Listener`, and all that follows."""
        self._over(job, [])

    def opened(self, connection: Connection) -> None:
        """Nothing."""

    def agreed(self, connection: Connection) -> None:
        """Nothing."""

    def refused(self, connection: Connection, why: str, at: At, code: int) -> None:
        """Nothing."""

    def pdu(self, told: Told) -> None:
        """Nothing."""

    def asked(self, job: Job) -> None:
        """Nothing."""

    def evidence(self, connection: Connection, found: Evidence) -> None:
        """Nothing."""

    def closed(self, connection: Connection) -> None:
        """Nothing."""
