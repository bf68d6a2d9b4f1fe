"""Frames and capture files made byte by byte, for the tests of ds47.capture and ds47.profinet."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path

from ds47.capture import Frame, WholeFrame, open_capture

MACS = bytes.fromhex("020000000001 020000000002".replace(" ", ""))
UUID_BIG = bytes.fromhex("dea000016c9711d1827100a02442df7d")
UUID_LITTLE = bytes.fromhex("0100a0de976cd111827100a02442df7d")


def whole_frames(path: str | Path) -> Iterator[WholeFrame]:
    """Every frame of a capture, with all that the file says of it."""
    with open_capture(path) as capture:
        yield from capture.everything()


def read(data: bytes) -> tuple[list[Frame], int, str | None]:
    """The frames of a capture that may matter, how many there are, and what is wrong with it.

    `everything` must give the same frames, and those between them.
    """
    with open_capture(io.BytesIO(data)) as capture:
        found = list(capture)
    with open_capture(io.BytesIO(data)) as again:
        every = {frame.number: frame for frame in again.everything()}
    assert (again.frames, again.problem) == (capture.frames, capture.problem)
    assert (again.complete, again.first_ns) == (capture.complete, capture.first_ns)
    assert again.last_ns == capture.last_ns
    even = [number for number in every if number % 2 == 0]
    with open_capture(io.BytesIO(data)) as chosen:
        some = {each.number: each for each in chosen.everything(even.__contains__)}
    assert list(some) == even
    assert all(each.time_ns == every[number].time_ns for number, each in some.items())
    for frame in found:
        whole = every[frame.number]
        assert (whole.data, whole.original_length) == (frame.data, frame.original_length)
        assert whole.link_type == whole.interface.link_type == frame.link_type
    return found, capture.frames, capture.problem


def rpc(uuid: bytes = UUID_BIG, body: bytes = b"body") -> bytes:
    """The 80 bytes of an RPC header, of which only version and interface UUID are right, and that it is a Read."""
    return b"\4" + bytes(23) + uuid + bytes(28) + b"\0\2" + bytes(10) + body


def udp(payload: bytes, ports: tuple[int, int] = (34964, 50000)) -> bytes:
    return struct.pack(">4H", *ports, 8 + len(payload), 0) + payload


def ipv4(
    payload: bytes, *, ident: int = 7, offset: int = 0, more: bool = False, proto: int = 17
) -> bytes:
    flags = offset // 8 | (0x2000 if more else 0)
    addresses = bytes([192, 168, 0, 1, 192, 168, 0, 2])
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), ident, flags, 64, proto, 0)
    return head + addresses + payload


def ethernet(kind: int, payload: bytes, tags: tuple[int, ...] = ()) -> bytes:
    stack = b"".join(struct.pack(">HH", tag, 1) for tag in tags)
    return (MACS + stack + struct.pack(">H", kind) + payload).ljust(60, b"\0")


def call(**more: object) -> bytes:
    """An Ethernet frame with a PROFINET RPC PDU."""
    return ethernet(0x0800, ipv4(udp(rpc())))


RT = ethernet(0x8892, b"\x80\x00" + bytes(44))
RT_TAGGED = ethernet(0x8892, b"\x80\x00" + bytes(44), (0x8100,))
DNS = ethernet(0x0800, ipv4(udp(b"\4" + bytes(60), (53, 5353))))
DCP = ethernet(0x8892, b"\xfe\xff\x05\x01" + bytes(44))
LLDP = ethernet(0x88CC, b"\x02\x07\x04" + bytes(6))


def pcap(
    frames: list[bytes],
    *,
    order: str = "<",
    magic: int = 0xA1B2C3D4,
    link_type: int = 1,
    snap: int = 0,
    fraction: int = 5,
    apart_s: int = 1,
) -> bytes:
    """A pcap file; frame i is of second 1000 + i, cut to `snap` bytes where that is not 0.

    Without seconds `apart_s` all are of second 1000, a microsecond (or nanosecond) after each other.
    """
    out = [struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, snap or 65535, link_type)]
    extra = bytes(8) if magic == 0xA1B2CD34 else b""
    for i, frame in enumerate(frames):
        kept = frame[:snap] if snap else frame
        later = fraction if apart_s else fraction + i
        head = struct.pack(order + "4I", 1000 + i * apart_s, later, len(kept), len(frame))
        out.append(head + extra + kept)
    return b"".join(out)


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    total = 12 + len(body)
    return struct.pack(order + "II", kind, total) + body + struct.pack(order + "I", total)


def padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def option(code: int, value: bytes, order: str = "<") -> bytes:
    return struct.pack(order + "HH", code, len(value)) + padded(value)


def section(order: str = "<") -> bytes:
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def interface(
    order: str = "<", *, link_type: int = 1, snap: int = 0, options: bytes = b""
) -> bytes:
    return block(1, struct.pack(order + "HHI", link_type, 0, snap) + options, order)


def enhanced(
    frame: bytes, order: str = "<", *, number: int = 0, stamp: int = 0, original: int | None = None
) -> bytes:
    length = len(frame) if original is None else original
    head = struct.pack(order + "5I", number, stamp >> 32, stamp & 0xFFFFFFFF, len(frame), length)
    return block(6, head + padded(frame), order)
