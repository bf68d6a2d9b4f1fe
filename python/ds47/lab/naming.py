"""Scenario: how a capture names its devices: Connect, DCP and LLDP around a parameter read."""

from __future__ import annotations

import struct

from ds47.lab import ether, message
from ds47.lab.client import Client
from ds47.lab.ether import Host
from ds47.lab.scenario import Book
from ds47.lab.wire import mac_bytes

BOOK = Book("naming")

DCP, LLDP = 0x8892, 0x88CC
LLDP_MULTICAST = "01:80:c2:00:00:0e"
IDENTIFY_RESPONSE = 0xFEFF


def _address(host: Host) -> bytes:
    return bytes(int(part) for part in host.ip.split("."))


def dcp_identify(host: Host, station: str) -> bytes:
    """DCP Identify response: name, device and vendor id, IP suite; blocks padded to two bytes."""
    blocks = b""
    for option, suboption, data in (
        (2, 2, station.encode("ascii")),
        (2, 3, struct.pack(">HH", host.vendor_id, host.device_id)),
        (1, 2, _address(host) + bytes((255, 255, 255, 0)) + _address(host)),
    ):
        body = b"\0\0" + data
        head = struct.pack(">BBH", option, suboption, len(body))
        blocks += head + body + bytes(len(body) % 2)
    service = struct.pack(">HBBIHH", IDENTIFY_RESPONSE, 5, 1, 0x4700, 0, len(blocks))
    return (service + blocks).ljust(46, b"\0")


def lldp(host: Host, station: str) -> bytes:
    """LLDP of a PROFINET port: chassis and port as local names, management address, chassis MAC."""
    management = bytes((5, 1)) + _address(host) + bytes((2, 0, 0, 0, 1, 0))
    parts = (
        (1, b"\x07" + station.encode("ascii")),
        (2, b"\x07port-001"),
        (3, struct.pack(">H", 20)),
        (127, bytes.fromhex("000ecf05") + mac_bytes(host)),
        (8, management),
        (0, b""),
    )
    return b"".join(struct.pack(">H", kind << 9 | len(data)) + data for kind, data in parts)


@BOOK.scene("station names, vendor and device id for the report", "read ok")
def all_(client: Client) -> None:
    """Connect, DCP and LLDP name the controller and the drive."""
    plc, motor = client.host, client.device
    client.stage.frame(ether.bare(motor.mac, plc.mac, DCP, dcp_identify(motor, "press-1-drive")))
    client.stage.frame(ether.bare(motor.mac, LLDP_MULTICAST, LLDP, lldp(motor, "press-1-drive")))
    client.connect("plc-1")
    client.exchange(
        message.read(1, 1, message.address(21)), message.answer(1, 1, 1, message.real(1500.0))
    )
