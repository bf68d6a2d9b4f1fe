"""Frames to packets: link types, VLAN tags, UDP lengths, fragments, cuts."""

from __future__ import annotations

import io

import frames as make
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.capture import Frame, open_capture
from ds47.profinet.link import Packet, Packets, dissect

RPC = make.rpc()
IP_CALL = make.ipv4(make.udp(RPC))
MAC_A, MAC_B = "02:00:00:00:00:02", "02:00:00:00:00:01"


def frame(data: bytes, link_type: int = 1, original: int | None = None, number: int = 1) -> Frame:
    return Frame(number, number * 1000, link_type, data, original or len(data))


SLL = b"\0\0\0\1\0\6" + bytes.fromhex("020000000002") + bytes(2)
SLL2 = bytes(6) + bytes(4) + b"\0\6" + bytes.fromhex("020000000002") + bytes(2)


@pytest.mark.parametrize(
    ("data", "link_type", "macs"),
    [
        (make.call(), 1, (MAC_A, MAC_B)),
        (make.ethernet(0x0800, IP_CALL, (0x8100,)), 1, (MAC_A, MAC_B)),
        (make.ethernet(0x0800, IP_CALL, (0x88A8, 0x8100)), 1, (MAC_A, MAC_B)),
        (make.ethernet(0x0800, IP_CALL, (0x8100, 0x8100, 0x8100)), 1, (MAC_A, MAC_B)),
        (SLL + b"\x08\0" + IP_CALL, 113, (MAC_A, None)),
        (b"\x08\0" + SLL2[2:] + IP_CALL, 276, (MAC_A, None)),
        (IP_CALL, 101, (None, None)),
        (IP_CALL, 228, (None, None)),
    ],
)
def test_udp(data: bytes, link_type: int, macs: tuple[str | None, str | None]) -> None:
    assert dissect(frame(data, link_type)) == Packet(
        "udp", 1, 1000, RPC, *macs, "192.168.0.1", "192.168.0.2", 34964, 50000, 7, 0
    )


def test_other_traffic_is_none() -> None:
    for data in (make.DNS, make.ethernet(0x86DD, bytes(80)), make.RT[:15]):
        assert dissect(frame(data)) is None


def test_cyclic_frames() -> None:
    for data in (make.RT, make.RT_TAGGED):
        packet = dissect(frame(data))
        assert packet is not None
        assert (packet.kind, packet.payload[:2], packet.src_mac) == ("rt", b"\x80\x00", MAC_A)


def test_dcp_and_lldp() -> None:
    dcp = dissect(frame(make.ethernet(0x8892, make.DCP[14:], (0x8100,))))
    assert dcp is not None
    assert (dcp.kind, dcp.payload[:4], dcp.src_mac) == ("dcp", b"\xfe\xff\x05\x01", MAC_A)
    lldp = dissect(frame(make.LLDP))
    assert lldp is not None
    assert (lldp.kind, lldp.dst_mac) == ("lldp", MAC_B)


def test_missing_bytes_at_every_snap_length() -> None:
    whole = make.call()
    for cut in range(len(whole)):
        packet = dissect(frame(whole[:cut], original=len(whole)))
        if packet is None:
            assert cut < 14 + 20 + 8
        else:
            assert len(packet.payload) + packet.missing == len(RPC)
            assert packet.payload == RPC[: cut - 42]


def test_udp_lengths_that_lie() -> None:
    short = make.ipv4(b"\x88\x94\x88\x94\0\x64\0\0" + RPC)  # 100 of 92
    packet = dissect(frame(make.ethernet(0x0800, short)))
    assert packet is not None
    assert (packet.payload, packet.missing) == (RPC, 100 - 8 - len(RPC))
    none = make.ipv4(b"\x88\x94\x88\x94\0\0\0\0" + RPC)
    packet = dissect(frame(make.ethernet(0x0800, none)))
    assert packet is not None
    assert (packet.payload, packet.missing) == (RPC, 0)


def parts(payload: bytes, size: int = 40, ident: int = 7) -> list[bytes]:
    return [
        make.ethernet(
            0x0800,
            make.ipv4(
                payload[at : at + size], ident=ident, offset=at, more=at + size < len(payload)
            ),
        )
        for at in range(0, len(payload), size)
    ]


def test_fragments_give_one_packet_with_the_frame_that_completes_it() -> None:
    one, two, three = parts(make.udp(RPC))
    data = make.pcap([make.RT, three, one, make.call(), two, *parts(make.udp(bytes(90)), ident=8)])
    with open_capture(io.BytesIO(data)) as capture:
        source = Packets()
        found = list(source.of(capture))
    assert [(p.frame, p.payload, p.missing) for p in found] == [(4, RPC, 0), (5, RPC, 0)]
    assert found[1].src_mac == MAC_A
    assert source.unfinished() == []


def test_unfinished_lists_ours_only() -> None:
    frames = [*parts(make.udp(RPC), 80)[:1], *parts(make.udp(bytes(90)), 80, ident=8)[:1]]
    with open_capture(io.BytesIO(make.pcap(frames))) as capture:
        source = Packets()
        assert list(source.of(capture)) == []
    ((packet, have),) = source.unfinished()
    assert (packet.frame, packet.src_port, have) == (1, 34964, 1)
    assert packet.payload == RPC[:72]
    assert packet.missing == len(RPC) - 72


@given(st.binary(max_size=120), st.sampled_from([1, 113, 276, 101, 228, 999]))
def test_random_bytes_never_raise(data: bytes, link_type: int) -> None:
    dissect(frame(data, link_type))
    dissect(frame(make.MACS + b"\x08\0\x45" + data))
