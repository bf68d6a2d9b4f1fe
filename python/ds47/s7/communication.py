"""S7 of a capture: packets in, jobs that are over with what is wrong with them out.

Joins the steps of this room; the analysis needs no other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ds47 import model
from ds47.capture import Frame
from ds47.findings.remark import Remark
from ds47.profinet.link import Packet
from ds47.s7 import tcp
from ds47.s7.blocks import Blocks
from ds47.s7.choices import Choices
from ds47.s7.connections import Connections
from ds47.s7.drives import Drives
from ds47.s7.judge import S7Judge
from ds47.s7.model import At, S7Job
from ds47.s7.transactions import connection
from ds47.spec.semantics import Limits


class Communication:
    """All connections of S7 of a capture.

    Args:
        choices: of the user; None if S7 is not wanted.
        bounds: how much is kept.
        over: gets each finished job, with its remarks.
        remark: gets all other remarks. A remark that comes after the end of its job belongs to no transaction.
        shown: what else in the capture shows that an IP address is a drive (`drives`); None for nothing.
    """

    def __init__(
        self,
        choices: Choices | None,
        bounds: Limits,
        over: Callable[[S7Job, list[Remark]], None],
        remark: Callable[[Remark], None],
        shown: Callable[[str], str | None] = lambda _: None,
    ) -> None:
        self.ports: Sequence[int] = () if choices is None else choices.every_port
        choices = choices or Choices()
        self._over = over
        self._remark = remark
        self._said: dict[S7Job, list[Remark]] = {}
        """What is wrong with jobs that are not over."""
        self._blocks = Blocks(dict(choices.blocks), dict(choices.cpus), bounds.s7_memories)
        self._drives = Drives(dict(choices.cpus), shown, bounds.s7_memories)
        self._judge = S7Judge(bounds, self._heard, self._blocks, choices.readback, self._drives)
        self._connections = Connections(frozenset(self.ports), bounds, self._settled, self._judge)

    def frame(self, frame: Frame) -> bool:
        """The next frame of the capture, if it has a segment of TCP as nearly all of them are."""
        segment = tcp.from_frame(frame)
        if segment is None:
            return False
        self._connections.feed(segment, At(frame.number, frame.time_ns))
        return True

    def packet(self, packet: Packet) -> None:
        """The segment of TCP in any other frame."""
        captured = packet.cut[1] if packet.cut else 0
        segment = tcp.parse(packet.src_ip, packet.dst_ip, packet.payload, packet.missing, captured)
        if segment is not None:
            self._connections.feed(segment, At(packet.frame, packet.time_ns))

    def finish(self) -> None:
        """The capture is over."""
        self._connections.finish()
        for remark in self._judge.finish():
            self._heard(remark)

    def records(self, ip: str) -> None:
        """A device of the capture has a parameter channel."""
        if self.ports:
            self._drives.records(ip)

    def is_drive(self, ip: str) -> bool:
        """Whether the capture has shown that a server is a drive."""
        return self._drives.proof(ip) is not None

    def result(self) -> list[model.Connection]:
        """The connections in the form of the report."""
        return [
            connection(each, self._blocks.of(each.server.ip), self._drives.drive_of(each.server.ip))
            for each in self._connections.all()
        ]

    @property
    def left_out(self) -> int:
        """Connections for which there was no room."""
        return self._connections.left_out

    def _settled(self, job: S7Job) -> None:
        """A job is over; the judge has heard of it before."""
        self._over(job, self._said.pop(job, []))

    def _heard(self, remark: Remark) -> None:
        job = remark.job
        if isinstance(job, S7Job) and job.phase != "closed":
            self._said.setdefault(job, []).append(remark)
        else:
            remark.job = (
                None  # handed out already, where transactions are: everywhere else, too, then
            )
            self._remark(remark)
