"""S7 communication of a capture, made when its first segment of TCP comes: few captures have one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ds47.s7.choices import PORT, Choices

if TYPE_CHECKING:
    from ds47.capture import Frame
    from ds47.findings.remark import Remark
    from ds47.model import Connection
    from ds47.profinet.link import Packet
    from ds47.s7.communication import Communication
    from ds47.s7.model import Job
    from ds47.spec.semantics import Limits

_PROTOCOL = 23
"""Where an IPv4 packet without VLAN tag says what it carries,"""
_TCP = 6
"""and TCP."""


class LateCommunication:
    """As `Communication`; arguments are the same.

    It remembers which devices have a parameter channel, until somebody asks.
    """

    def __init__(
        self,
        choices: Choices | None,
        bounds: Limits,
        over: Callable[[Job, list[Remark]], None],
        remark: Callable[[Remark], None],
        shown: Callable[[str], str | None],
    ) -> None:
        self.ports: Sequence[int] = () if choices is None else (PORT, *choices.ports)
        self._arguments = choices, bounds, over, remark, shown
        self._made: Communication | None = None
        self._drives: dict[str, None] = {}
        self._most = bounds.s7_memories

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
        if self._made is not None:
            self._made.records(ip)
        elif ip not in self._drives and self.ports:
            self._drives[ip] = None
            if len(self._drives) > self._most:
                del self._drives[next(iter(self._drives))]

    def finish(self) -> None:
        """The capture is over."""
        if self._made is not None:
            self._made.finish()

    def told(self) -> list[Connection]:
        """The connections, as the report has them."""
        return [] if self._made is None else self._made.told()

    @property
    def left_out(self) -> int:
        """Connections for which there was no room."""
        return 0 if self._made is None else self._made.left_out

    def _communication(self) -> Communication:
        if self._made is None:
            from ds47.s7.communication import Communication

            self._made = Communication(*self._arguments)
            for ip in self._drives:
                self._made.records(ip)
        return self._made
