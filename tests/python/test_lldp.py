"""LLDP: station names of older and newer devices, the MAC address of the station, cuts."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profinet.dcp import StationInfo
from ds47.profinet.link import Packet
from ds47.profinet.lldp import parse

PORT_MAC, STATION_MAC = "02:00:00:00:00:99", "02:00:00:00:00:01"


def tlv(kind: int, value: bytes) -> bytes:
    return struct.pack(">H", kind << 9 | len(value)) + value


OURS = tlv(127, bytes.fromhex("000ecf05 020000000001".replace(" ", "")))
IP = tlv(8, bytes([5, 1, 192, 168, 0, 5, 2, 0, 0, 0, 1, 0]))
END = tlv(0, b"")


def packet(*tlvs: bytes) -> Packet:
    return Packet("lldp", 1, 0, b"".join(tlvs) + END + bytes(8), PORT_MAC, None)


@pytest.mark.parametrize(
    ("chassis", "port", "name"),
    [
        (b"\7drive-1", b"\7port-001", "drive-1"),
        (b"\7SINAMICS G120   6SL3 2", b"\7port-001.drive-1", "drive-1"),
        (b"\7SINAMICS G120   6SL3 2", b"\7port-001-00002.drive.cell-4", "drive.cell-4"),
        (b"\7old-name", b"\7port-002.new-name", "new-name"),
        (b"\7SINAMICS G120", b"\7port-001", None),
    ],
)
def test_station_name(chassis: bytes, port: bytes, name: str | None) -> None:
    found = parse(packet(tlv(1, chassis), tlv(2, port), tlv(3, b"\0\x14"), OURS, IP))
    assert found == StationInfo(STATION_MAC, "192.168.0.5", name)


def test_chassis_id_that_is_a_mac_address() -> None:
    mac = tlv(1, b"\4" + bytes.fromhex("02000000000a"))
    status = tlv(127, bytes.fromhex("000ecf02") + bytes(4))
    found = parse(packet(mac, tlv(2, b"\7port-001.drive-1"), status))
    assert found == StationInfo("02:00:00:00:00:0a", None, "drive-1")


def test_an_office_switch_is_none() -> None:
    assert parse(packet(tlv(1, b"\7drive-1"), tlv(2, b"\7port-001.x"), IP)) is None
    assert parse(packet(tlv(1, b"\7NOT A NAME"), OURS)) is None


def test_cut_at_every_byte() -> None:
    whole = packet(tlv(1, b"\7drive-1"), tlv(2, b"\7port-001"), OURS, IP).payload
    found = [parse(Packet("lldp", 1, 0, whole[:cut])) for cut in range(len(whole))]
    assert found[0] is None
    assert found[-1] == StationInfo(STATION_MAC, "192.168.0.5", "drive-1")


@given(st.binary(max_size=80))
def test_random_bytes_never_raise(data: bytes) -> None:
    parse(Packet("lldp", 1, 0, data))
    parse(Packet("lldp", 1, 0, OURS + data))
