"""The capture that a scenario fills: a clock, the frames, and how they are carried.

A `Stage` knows no RPC and no records; `client` talks through it. What it says is kept beside the frames, unread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ds47.lab import ether
from ds47.lab.ether import Host
from ds47.lab.wire import PduContent

START_NS = 1_767_254_400_000_000_000
"""2026-01-01 08:00:00 UTC. Every scenario starts here, so its bytes never change."""

MILLISECOND = 1_000_000


@dataclass(frozen=True, slots=True)
class Shot:
    """One captured frame; `original_length` exceeds the data where the snap length cut it."""

    time_ns: int
    data: bytes
    original_length: int
    said: PduContent | None = None
    """What the PDU in the frame says; None for a frame that belongs to no call."""


@dataclass(slots=True)
class Stage:
    """What the capture point saw, in the order in which it saw it."""

    link: int = ether.ETHERNET
    tags: Sequence[tuple[int, int]] = ()
    mtu: int | None = None
    """Largest IP payload of a fragment in bytes; None does not fragment."""
    snap: int | None = None
    """Bytes kept of each frame; None keeps all."""
    copies: int = 1
    """How often the capture point sees each frame (mirror port): 20 us apart, same IP id."""
    deaf: bool = False
    """While true nothing is captured, though the clock runs: lost frames."""
    dropped: int | None = None
    """Frames that the capturing machine says it lost; None where it does not say."""
    gap_ns: int = MILLISECOND
    now_ns: int = START_NS
    said: PduContent | None = None
    """What the PDU says that goes past just now."""
    shots: list[Shot] = field(default_factory=list)

    def wait(self, milliseconds: float) -> None:
        """Let time pass; a negative number steps the clock of the capture point back."""
        self.now_ns += round(milliseconds * MILLISECOND)

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        """A UDP datagram goes past; ports are (source, target)."""
        packet = ether.udp(source, target, ports or (source.port, target.port), payload)
        macs = (source.mac, target.mac)
        for piece in ether.fragments(packet, self.mtu):
            self.frame(ether.framed(piece, macs, self.link, self.tags))

    def frame(self, data: bytes) -> None:
        """A whole frame goes past."""
        if not self.deaf:
            kept = data if self.snap is None else data[: self.snap]
            for number in range(self.copies):
                self.shots.append(Shot(self.now_ns + number * 20_000, kept, len(data), self.said))
        self.now_ns += self.gap_ns

    def lose(self, number: int = -1) -> None:
        """A frame that went past was not captured, the newest one where no other is named."""
        del self.shots[number]
