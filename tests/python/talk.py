"""What a `ds47.lab` client says, as the packets, PDUs and jobs that the modules under test take.

No frame is made, so nothing of the link layer and no scapy takes part.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count

from ds47.lab.client import Client
from ds47.lab.ether import Host
from ds47.lab.stage import Stage
from ds47.profidrive import decode_request, decode_response
from ds47.profinet import rpc
from ds47.profinet.link import Packet


@dataclass(slots=True)
class Tap(Stage):
    """A stage that keeps the UDP payloads instead of frames."""

    packets: list[Packet] = field(default_factory=list)
    numbers: count[int] = field(default_factory=lambda: count(1))

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        sport, dport = ports or (source.port, target.port)
        number = next(self.numbers)
        self.packets.append(
            Packet("udp", number, self.now_ns, payload, source.mac, target.mac, source.ip,
                   target.ip, sport, dport, number)
        )  # fmt: skip
        self.now_ns += self.gap_ns


def packets(play: Callable[[Client], object], **settings: object) -> list[Packet]:
    """The packets of what a client does; `settings` are those of the client."""
    tap = Tap()
    play(Client(tap, **settings))  # type: ignore[arg-type]
    return tap.packets


def pdus(play: Callable[[Client], object], **settings: object) -> list[rpc.Pdu]:
    """The same, parsed."""
    return [pdu for packet in packets(play, **settings) if (pdu := rpc.parse(packet))]


def request(data: bytes):  # type: ignore[no-untyped-def]
    """A decoded request; the name is short because every second line needs one."""
    return decode_request(data)


def response(data: bytes, asked: bytes | None = None):  # type: ignore[no-untyped-def]
    """A decoded response."""
    return decode_response(data, None if asked is None else decode_request(asked))


def names(items: Sequence[object], name: str) -> list[object]:
    """One attribute of each item."""
    return [getattr(item, name) for item in items]
