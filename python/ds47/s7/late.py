"""S7 communication of a capture, made when its first segment of TCP comes: few captures have one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ds47.capture import Frame
    from ds47.model import Connection
    from ds47.profinet.link import Packet
    from ds47.s7.communication import Communication

_PROTOCOL = 23
"""Where an IPv4 packet without VLAN tag says what it carries,"""
_TCP = 6
"""and TCP."""


class LateCommunication:
    """As `Communication`. Remembers which devices have a parameter channel.

    Args:
        ports: wanted TCP ports; empty if S7 is not wanted.
        make: gives the communication.
        most: devices that are remembered.
    """

    def __init__(self, ports: Sequence[int], make: Callable[[], Communication], most: int) -> None:
        self.ports, self._make, self._most = ports, make, most
        self._made: Communication | None = None
        self.drives: dict[str, None] = {}
        """The devices that are known to have a parameter channel."""

    def frame(self, frame: Frame) -> bool:
        """The next frame of the capture, if it has a segment of TCP as nearly all of them are."""
        if self._made is None and frame.data[_PROTOCOL : _PROTOCOL + 1] != bytes((_TCP,)):
            return False
        return self._communication().frame(frame)

    def packet(self, packet: Packet) -> None:
        """The segment of TCP in any other frame."""
        self._communication().packet(packet)

    def records(self, ip: str) -> None:
        """A device of the capture has a parameter channel."""
        self.drives[ip] = None
        if len(self.drives) > self._most:
            del self.drives[next(iter(self.drives))]
        if self._made is not None:
            self._made.records(ip)

    def is_drive(self, ip: str) -> bool:
        """Whether the capture so far shows that a server of S7 is a drive."""
        return self._made is not None and self._made.is_drive(ip)

    def finish(self) -> None:
        """The capture is over."""
        if self._made is not None:
            self._made.finish()

    def result(self) -> list[Connection]:
        """The connections in the form of the report."""
        return [] if self._made is None else self._made.result()

    @property
    def left_out(self) -> int:
        """Connections for which there was no room."""
        return 0 if self._made is None else self._made.left_out

    def _communication(self) -> Communication:
        if self._made is None:
            self._made = self._make()
            for ip in self.drives:
                self._made.records(ip)
        return self._made
