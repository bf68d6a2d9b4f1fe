"""Captures that go on beside each other in one, each between stations of its own: a start of tshark costs more
than all that it says of a capture.

Addresses of Ethernet and of IP are other ones for each; names of stations, and addresses in what is said, stay.
Which captures can stand it, and what they have to show then, is asked where they are compared.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from typing import BinaryIO

from whole_capture import of_transactions

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.scan import ETHERNET
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult

START_NS = 1_767_254_400_000_000_000
TAGS = (b"\x81\x00", b"\x88\xa8")
Shown = Counter[tuple[str, str]]


@dataclass
class Beside:
    """One capture of several."""

    content: bytes
    owners: list[tuple[str, int]]
    """By frame: whose it is, and its number there."""
    addresses: dict[str, str]
    """By IP address: what it was."""

    def open(self) -> BinaryIO:
        return io.BytesIO(self.content)

    def shown(self, result: CaptureResult) -> dict[str, Shown]:
        """States and rules of each, and how often."""
        found = {name: Shown() for name, _ in self.owners}
        for each in result.transactions:
            found[self.owners[each.frames.first() - 1][0]][each.operation, each.state] += 1
        for told in of_transactions(
            {"rule": each.rule, "frame": each.frame} for each in result.findings
        ):
            found[self.owners[told["frame"] - 1][0]]["rule", told["rule"]] += 1
        return found


@dataclass
class _Stations:
    """The other addresses of one capture."""

    number: int
    known: dict[bytes, bytes] = field(default_factory=dict)

    def other(self, address: bytes) -> bytes:
        """Of the same length; a group stays what it is."""
        if len(address) == 6 and address[0] & 1:
            return address
        if address not in self.known:
            whose, which = divmod(self.number, 256), len(self.known) + 1
            head = (2, 0x47, *whose, 0) if len(address) == 6 else (10, *whose)
            self.known[address] = bytes((*head, which))
        return self.known[address]

    def frame(self, data: bytes) -> bytes:
        at, new = 12, bytearray(data)
        while data[at : at + 2] in TAGS:
            at += 4
        places = [(0, 6), (6, 12)]
        if data[at : at + 2] == b"\x08\x00" and len(data) >= at + 22:
            places += [(at + 14, at + 18), (at + 18, at + 22)]
        for start, end in places:
            new[start:end] = self.other(data[start:end])
        return bytes(new)


def fits(capture: bytes) -> bool:
    """Whether it is Ethernet alone, of a clock that only goes on."""
    with open_capture(io.BytesIO(capture)) as source:
        frames = [(each.link_type, each.time_ns) for each in source.everything()]
    times = [time for _, time in frames]
    return {link for link, _ in frames} == {ETHERNET} and times == sorted(times)


def beside(captures: Mapping[str, bytes]) -> Beside:
    """All of them begin at once."""
    shots: list[tuple[int, str, int, bytes, int]] = []
    addresses = {}
    for number, (name, capture) in enumerate(captures.items()):
        stations = _Stations(number)
        with open_capture(io.BytesIO(capture)) as source:
            frames = [
                (each.time_ns, each.data, each.original_length) for each in source.everything()
            ]
        for at, (time, data, length) in enumerate(frames, 1):
            shots.append((time - frames[0][0], name, at, stations.frame(data), length))
        addresses |= {
            str(IPv4Address(new)): str(IPv4Address(old))
            for old, new in stations.known.items()
            if len(old) == 4
        }
    shots.sort(key=lambda each: each[0])
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for time, _, _, data, length in shots:
            writer.write(START_NS + time, data, length)
    return Beside(target.getvalue(), [(name, at) for _, name, at, _, _ in shots], addresses)


def shown_alone(capture: bytes) -> Shown:
    """What `Beside.shown` has of it where nothing is beside it."""
    result = analyze(io.BytesIO(capture))
    alone = Beside(b"", [("", 0)] * max(1, result.frames), {})
    return alone.shown(result)[""]
