"""Captures that go on beside each other in one, each between stations of its own: a start of tshark costs more
than all that it says of a capture.

Addresses of Ethernet and of IP are other ones for each; names of stations, ARs and all else stay. What each has to
show there is what it shows alone.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import BinaryIO

from whole_capture import of_transactions

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.scan import ETHERNET
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult

START_NS = 1_767_254_400_000_000_000
IP = b"\x08\x00"
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
        """States, rules and events of each, and how often."""
        found = {name: Shown() for name, _ in self.owners}
        for each in result.transactions:
            found[self.owners[each.frames.first() - 1][0]][each.operation, each.state] += 1
        for told in of_transactions(
            {"rule": each.rule, "frame": each.frame} for each in result.findings
        ):
            found[self.owners[told["frame"] - 1][0]]["rule", told["rule"]] += 1
        for event in (each for line in result.timelines for each in line.events):
            found[self.owners[event.frame - 1][0]]["event", event.name] += 1
        return found


def stations(frames: list[bytes]) -> tuple[list[bytes], list[bytes]]:
    """The addresses of Ethernet, but for groups, and of IP, as they come."""
    macs: dict[bytes, None] = {}
    hosts: dict[bytes, None] = {}
    for data in frames:
        macs |= dict.fromkeys(each for each in (data[:6], data[6:12]) if not each[0] & 1)
        at = 12
        while data[at : at + 2] in TAGS:
            at += 4
        if data[at : at + 2] == IP and len(data) >= at + 22:
            hosts |= dict.fromkeys((data[at + 14 : at + 18], data[at + 18 : at + 22]))
    return list(macs), list(hosts)


def fits(capture: bytes) -> bool:
    """Whether it is Ethernet alone, of a clock that only goes on."""
    with open_capture(io.BytesIO(capture)) as source:
        frames = [(each.link_type, each.time_ns) for each in source.everything()]
    times = [time for _, time in frames]
    return {link for link, _ in frames} == {ETHERNET} and times == sorted(times)


def beside(captures: Mapping[str, bytes]) -> Beside:
    """All of them begin at once. An address is another one wherever it stands in a frame."""
    shots: list[tuple[int, str, int, bytes, int]] = []
    addresses = {}
    for number, (name, capture) in enumerate(captures.items()):
        with open_capture(io.BytesIO(capture)) as source:
            frames = [
                (each.time_ns, each.data, each.original_length) for each in source.everything()
            ]
        whose = divmod(number, 256)
        macs, hosts = stations([data for _, data, _ in frames])
        other = {old: bytes((2, 0x47, *whose, 0, at)) for at, old in enumerate(macs, 1)}
        other |= {old: bytes((10, *whose, at)) for at, old in enumerate(hosts, 1)}
        addresses |= {str(IPv4Address(other[old])): str(IPv4Address(old)) for old in hosts}
        for at, (time, data, length) in enumerate(frames, 1):
            for old, new in other.items():
                data = data.replace(old, new)
            shots.append((time - frames[0][0], name, at, data, length))
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
