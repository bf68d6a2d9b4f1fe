"""What a `ds47.lab` client says, as the packets, PDUs and jobs that the modules under test take.

No frame is made, so nothing of the link layer and no scapy takes part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count

from ds47.acyclic.judge import is_mismatch
from ds47.acyclic.pairing import Job
from ds47.lab.client import Client
from ds47.lab.ether import Host
from ds47.lab.stage import Stage
from ds47.profidrive import decode_request, decode_response
from ds47.profinet import rpc
from ds47.profinet.link import Packet
from ds47.profinet.records import Half, Peer, Record


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
    """A decoded request."""
    return decode_request(data)


def job(
    asked: bytes | None, answer: bytes | None = None, *, frame: int = 1, device: str = "d",
    vendor: int | None = 0x002A, at: tuple[int, int, int] = (1, 1, 47), **changes: object,
) -> Job:  # fmt: skip
    """A closed job: Write in frames n and n+1, Read in n+2 and n+3, 1 ms apart; `at` slot, subslot, index."""

    def half(number: int, data: bytes = b"", status: int | None = None) -> Half:
        return Half(frame + number, (frame + number) * 1_000_000, data, len(data), status=status)

    record = Record(True, False, bytes(range(16)), 0, *at, 0)
    message = None if asked is None else decode_request(asked)
    record.request = None if asked is None else half(0, asked)
    made = Job(record.of(Peer("c", device, vendor, 0x0501)), message, phase="closed")
    if asked is not None:
        made.write_response = half(1, status=0)
    if answer is not None:
        made.read_request, made.read_response = half(2), half(3, answer, 0)
        made.response = decode_response(answer, message) if answer else None
    for name, value in changes.items():
        setattr(made, name, value)
    written = made.write_response
    made.write_refused = made.write_refused or bool(written and written.status)
    made.stray = is_mismatch(made)
    return made
