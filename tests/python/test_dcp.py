"""DCP: who is named by which service, padding, cuts."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profinet.dcp import StationInfo, parse
from ds47.profinet.link import Packet

DEVICE, OTHER = "02:00:00:00:00:01", "02:00:00:00:00:02"


def block(option: int, suboption: int, content: bytes) -> bytes:
    body = b"\0\0" + content
    return struct.pack(">BBH", option, suboption, len(body)) + body + bytes(len(body) % 2)


NAME = block(2, 2, b"drive-1")  # odd: padded
IP = block(1, 2, bytes([192, 168, 0, 5, 255, 255, 255, 0, 0, 0, 0, 0]))
NO_IP = block(1, 2, bytes(12))
IDENTITY = block(2, 3, bytes.fromhex("002a0501"))


def packet(frame_id: int, service: int, kind: int, blocks: bytes) -> Packet:
    head = struct.pack(">HBBIHH", frame_id, service, kind, 1, 0, len(blocks))
    return Packet("dcp", 1, 0, head + blocks + bytes(20), DEVICE, OTHER)


@pytest.mark.parametrize(
    ("frame_id", "service", "kind", "mac"),
    [(0xFEFF, 5, 1, DEVICE), (0xFEFD, 3, 1, DEVICE), (0xFEFC, 6, 0, DEVICE), (0xFEFD, 4, 0, OTHER)],
)
def test_who_is_named(frame_id: int, service: int, kind: int, mac: str) -> None:
    found = parse(packet(frame_id, service, kind, NAME + IP + IDENTITY))
    assert found == StationInfo(mac, "192.168.0.5", "drive-1", 0x2A, 0x0501)


def test_requests_and_refusals_name_nobody() -> None:
    for service, kind in ((5, 0), (3, 0), (5, 5), (4, 1)):
        assert parse(packet(0xFEFE, service, kind, NAME + IP)) is None


def test_nothing_said_is_none() -> None:
    assert parse(packet(0xFEFF, 5, 1, NO_IP)) is None
    assert parse(packet(0xFEFF, 5, 1, block(2, 2, b""))) is None
    assert parse(packet(0xFEFF, 5, 1, NAME + NO_IP)) == StationInfo(DEVICE, None, "drive-1")


def test_cut_at_every_byte() -> None:
    whole = packet(0xFEFF, 5, 1, NAME + IP + IDENTITY)
    names = []
    for cut in range(len(whole.payload)):
        found = parse(Packet("dcp", 1, 0, whole.payload[:cut], DEVICE, OTHER))
        names.append(found is not None and found.name)
    assert names == sorted(names, key=bool)
    assert names[-1] == "drive-1"


@given(st.binary(max_size=80))
def test_random_bytes_never_raise(data: bytes) -> None:
    parse(Packet("dcp", 1, 0, data))
    parse(Packet("dcp", 1, 0, b"\xfe\xff\x05\x01" + data))
