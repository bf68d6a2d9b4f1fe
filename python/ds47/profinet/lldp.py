"""LLDP as PROFINET stations send it: MAC address, station name, management address.

Lives here: the few TLVs that name a station. Not here: topology.

The station name is the chassis id (locally assigned), or, in newer devices whose chassis id is a
description, what stands behind the first dot of the port id ("port-001.drive-1"). A port sends from
a MAC address of its own; the PROFINET TLV (00-0E-CF, 5) says that of the station.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from .dcp import StationInfo
from .ip import address
from .link import Packet, mac

_END, _CHASSIS, _PORT, _MANAGEMENT, _ORGANISATION = 0, 1, 2, 8, 127
_MAC_SUBTYPE, _LOCAL_SUBTYPE = 4, 7
_CHASSIS_MAC = b"\x00\x0e\xcf\x05"

_NAME = re.compile(rb"[a-z0-9]([a-z0-9.-]{0,238}[a-z0-9])?")
_PORT_ID = re.compile(rb"port-\d{3}(-\d{5})?\.(.+)", re.DOTALL)


def parse(packet: Packet) -> StationInfo | None:
    """Read a packet of kind "lldp"; None when no PROFINET station speaks. Never raises."""
    station = StationInfo(packet.src_mac)
    ours = False
    port_name: bytes | None = None
    for kind, value in _tlvs(packet.payload):
        if kind == _CHASSIS and value[:1] == bytes([_LOCAL_SUBTYPE]):
            station.name = _station_name(value[1:])
        elif kind == _CHASSIS and value[:1] == bytes([_MAC_SUBTYPE]) and len(value) == 7:
            station.mac = mac(value[1:])
        elif kind == _PORT and value[:1] == bytes([_LOCAL_SUBTYPE]):
            match = _PORT_ID.fullmatch(value[1:])
            port_name = match[2] if match else None
        elif kind == _MANAGEMENT and value[:2] == b"\x05\x01" and len(value) >= 6:
            station.ip = address(value[2:6]) if any(value[2:6]) else None
        elif kind == _ORGANISATION and value[:3] == _CHASSIS_MAC[:3]:
            ours = True
            if value[:4] == _CHASSIS_MAC and len(value) >= 10:
                station.mac = mac(value[4:10])
    if port_name is not None:
        station.name = _station_name(port_name) or station.name
    return station if ours and (station.name or station.ip) else None


def _station_name(value: bytes) -> str | None:
    """The text when it obeys the rules for station names (lower case, digits, dots, dashes)."""
    value = value.rstrip(b"\0")
    return value.decode("ascii") if _NAME.fullmatch(value) else None


def _tlvs(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield (type, value) up to the end; a TLV that is cut off ends it, too."""
    at = 0
    while at + 2 <= len(data):
        head = data[at] << 8 | data[at + 1]
        kind, length = head >> 9, head & 0x1FF
        if kind == _END or at + 2 + length > len(data):
            return
        yield kind, data[at + 2 : at + 2 + length]
        at += 2 + length
