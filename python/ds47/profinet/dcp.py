"""PROFINET DCP: which station has which name, IP address, vendor and device id.

Lives here: Identify, Get and Hello answers, and Set requests (what a controller assigns is taken to
be so: a refused Set is rare, and the next Identify corrects it). Not here: DCP as a conversation.

Frame: frame id (2), service id (1), service type (1), transaction (4), delay (2), length (2), then
blocks: option (1), suboption (1), length (2), content, padded to even. In answers and Hello two
bytes of block information come before the content, in a Set request two bytes of qualifier.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from .ip import address
from .link import Packet

_GET, _SET, _IDENTIFY, _HELLO = 3, 4, 5, 6
_REQUEST, _SUCCESS = 0, 1
_HEADER = 12
_LONGEST_NAME = 240  # of a station, by the specification

_IP, _IP_SUITE = (1, 2), (1, 3)
_KIND, _NAME, _DEVICE_ID = (2, 1), (2, 2), (2, 3)


@dataclass(slots=True)
class StationInfo:
    """What one frame says about a station; None where it says nothing."""

    mac: str | None
    ip: str | None = None
    name: str | None = None
    vendor_id: int | None = None
    device_id: int | None = None
    kind: str | None = None
    """Its type, in words of its maker."""


def parse(packet: Packet) -> StationInfo | None:
    """Read a packet of kind "dcp"; None when it names no station. Never raises on any bytes."""
    data = packet.payload
    if len(data) < _HEADER:
        return None
    service, kind = data[2], data[3]
    if service == _SET and kind == _REQUEST:
        station = StationInfo(packet.dst_mac)
    elif (service in (_GET, _IDENTIFY) and kind == _SUCCESS) or service == _HELLO:
        station = StationInfo(packet.src_mac)
    else:
        return None
    for option, content in _blocks(data):
        _learn(station, option, content)
    named = (station.ip, station.name, station.vendor_id)
    return station if any(value is not None for value in named) else None


def _blocks(data: bytes) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Yield (option, suboption) and the content without its first two bytes."""
    (length,) = struct.unpack_from(">H", data, 10)
    at, end = _HEADER, min(_HEADER + length, len(data))
    while at + 4 <= end:
        option, suboption, size = struct.unpack_from(">BBH", data, at)
        if at + 4 + size > end:
            return
        if size >= 2:
            yield (option, suboption), data[at + 6 : at + 4 + size]
        at += 4 + size + size % 2


def _learn(station: StationInfo, option: tuple[int, int], content: bytes) -> None:
    if option in (_IP, _IP_SUITE) and len(content) >= 4:
        if any(content[:4]):  # 0.0.0.0: none assigned yet
            station.ip = address(content[:4])
    elif option == _NAME and content:
        station.name = content[:_LONGEST_NAME].rstrip(b"\0").decode("latin-1") or None
    elif option == _KIND and content:
        station.kind = content[:_LONGEST_NAME].rstrip(b"\0 ").decode("latin-1") or None
    elif option == _DEVICE_ID and len(content) >= 4:
        station.vendor_id, station.device_id = struct.unpack_from(">HH", content)
