"""pcapng: sections, interfaces, block types, times, statistics; broken blocks; the writer."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import frames as make
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47.capture import CaptureError, Frame, PcapngWriter, open_capture

CALL = make.call()


def simple(frame: bytes, order: str = "<", kept: int | None = None) -> bytes:
    head = struct.pack(order + "I", len(frame))
    return make.block(3, head + make.padded(frame[:kept]), order)


def obsolete(frame: bytes, order: str = "<", *, number: int = 0, stamp: int = 0) -> bytes:
    head = struct.pack(
        order + "HH4I", number, 3, stamp >> 32, stamp & 0xFFFFFFFF, len(frame), len(frame)
    )
    return make.block(2, head + make.padded(frame), order)


@pytest.mark.parametrize("order", ["<", ">"])
def test_all_packet_blocks_are_counted(order: str) -> None:
    data = (
        make.section(order)
        + make.interface(order)
        + make.enhanced(CALL, order, stamp=(5 << 32) + 7)
        + make.enhanced(make.RT, order)
        + obsolete(CALL, order, stamp=9)
        + simple(make.RT, order)
        + simple(CALL, order)
        + make.enhanced(make.RT_TAGGED, order)
    )
    found, count, problem = make.read(data)
    assert (count, problem) == (6, None)
    assert [(f.number, f.time_ns) for f in found] == [
        (1, ((5 << 32) + 7) * 1000),
        (3, 9000),
        (5, 9000),  # no time of its own
    ]
    assert all(frame.data == CALL for frame in found)


def test_simple_packet_is_cut_by_the_snap_length_of_interface_0() -> None:
    data = make.section() + make.interface(snap=90) + simple(CALL, kept=90)
    (frame,), _, problem = make.read(data)
    assert problem is None
    assert (frame.data, frame.original_length) == (CALL[:90], len(CALL))


@pytest.mark.parametrize(
    ("code", "stamp", "wanted"),
    [
        (b"\x00", 3, 3_000_000_000),
        (b"\x03", 1234, 1_234_000_000),
        (b"\x06", 1234, 1_234_000),
        (b"\x09", 1_700_000_000_123_456_789, 1_700_000_000_123_456_789),
        (b"\x0c", 1_999, 1),
        (b"\x80", 3, 3_000_000_000),
        (b"\x8a", 1536, 1_500_000_000),
        (b"\xc0", 1 << 63, 500_000_000),
    ],
)
def test_time_resolution(code: bytes, stamp: int, wanted: int) -> None:
    data = make.section() + make.interface(options=make.option(9, code))
    (frame,), _, _ = make.read(data + make.enhanced(CALL, stamp=stamp))
    assert frame.time_ns == wanted


@pytest.mark.parametrize("order", ["<", ">"])
def test_time_offset_is_signed_seconds(order: str) -> None:
    offset = make.option(14, struct.pack(order + "q", -3), order)
    data = make.section(order) + make.interface(order, options=offset)
    (frame,), _, _ = make.read(data + make.enhanced(CALL, order, stamp=5_000_001))
    assert frame.time_ns == 2_000_001_000


def test_interfaces_of_several_sections_and_byte_orders() -> None:
    raw = make.ipv4(make.udp(make.rpc()))
    data = (
        make.section()
        + make.interface()
        + make.interface(link_type=101, options=make.option(9, b"\x09"))
        + make.enhanced(CALL, stamp=1)
        + make.enhanced(raw, number=1, stamp=1)
        + make.section(">")
        + make.interface(">", link_type=101)
        + make.enhanced(raw, ">", stamp=2)
        + make.interface(">")
        + make.enhanced(CALL, ">", number=1, stamp=3)
    )
    found, count, problem = make.read(data)
    assert (count, problem) == (4, None)
    assert [(f.link_type, f.time_ns) for f in found] == [
        (1, 1000),
        (101, 1),
        (101, 2000),
        (1, 3000),
    ]


def test_unknown_blocks_are_skipped() -> None:
    data = make.section() + make.block(0x12345678, bytes(100)) + make.interface()
    found, count, problem = make.read(data + make.block(10, b"keys") + make.enhanced(CALL))
    assert (len(found), count, problem) == (1, 1, None)


def test_drop_counters_are_the_last_of_each_interface() -> None:
    def statistics(number: int, lost: int, system: int) -> bytes:
        options = make.option(5, struct.pack("<Q", lost)) + make.option(
            7, struct.pack("<Q", system)
        )
        return make.block(5, struct.pack("<3I", number, 0, 0) + options + make.option(0, b""))

    data = make.section() + make.interface() + make.interface()
    with open_capture(io.BytesIO(data)) as capture:
        list(capture)
        assert capture.dropped is None
    data += statistics(0, 2, 1) + statistics(1, 10, 0) + make.enhanced(CALL) + statistics(0, 5, 1)
    with open_capture(io.BytesIO(data)) as capture:
        list(capture)
        assert capture.dropped == 16


# -- broken blocks ---------------------------------------------------------------------------------

GOOD = make.section() + make.interface() + make.enhanced(CALL)


@pytest.mark.slow
def test_cut_off_at_every_byte() -> None:
    blocks = [make.section(), make.interface(), make.enhanced(make.RT), make.enhanced(CALL)]
    blocks += [simple(CALL), obsolete(CALL)]
    data = b"".join(blocks)
    ends = [sum(map(len, blocks[:n])) for n in range(1, len(blocks) + 1)]
    for cut in range(len(data)):
        if cut < ends[0]:
            with pytest.raises(CaptureError):
                open_capture(io.BytesIO(data[:cut]))
            continue
        found, count, problem = make.read(data[:cut])
        assert count == sum(end <= cut for end in ends[2:])
        assert [frame.number for frame in found] == [n for n in (2, 3, 4) if n <= count]
        assert (problem is None) == (cut in ends)
        assert problem is None or f"byte {max(e for e in ends if e <= cut)}" in problem


def with_length(total: int, kind: int = 6) -> bytes:
    return struct.pack("<2I", kind, total) + bytes(200)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (with_length(0), "claims 0 bytes"),
        (with_length(0, kind=99), "claims 0 bytes"),
        (with_length(8), "claims 8 bytes"),
        (with_length(28), "needs at least 32"),
        (with_length(61), "multiple of 4"),
        (with_length(0xFFFFFFFC), "more than"),
        (with_length(64), "differently"),
        (with_length(40_000), "are left"),
        (make.enhanced(CALL, number=1), "of interface 1"),
        (make.block(6, struct.pack("<5I", 0, 0, 0, 61, 61) + bytes(60)), "claims 61"),
        (make.block(2, struct.pack("<HH4I", 0, 0, 0, 0, 61, 61) + bytes(60)), "claims 61"),
        (make.block(3, struct.pack("<I", 61) + bytes(60)), "claims 61"),
        (make.block(0x0A0D0D0A, bytes(16)), "byte-order magic"),
        (make.block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 9, 0, -1)), "version 9"),
    ],
)
def test_a_broken_block_is_one_line_with_its_offset(bad: bytes, says: str) -> None:
    found, count, problem = make.read(GOOD + bad + make.enhanced(CALL) * 9)
    assert (len(found), count) == (1, 1)
    assert problem is not None
    assert says in problem
    assert f"byte {len(GOOD)}" in problem
    assert "\n" not in problem


def test_a_packet_without_any_interface() -> None:
    for packet in (make.enhanced(CALL), obsolete(CALL), simple(CALL)):
        _, count, problem = make.read(make.section() + packet)
        assert count == 0
        assert "interface 0" in (problem or "")


def test_options_that_leave_their_block_are_ignored() -> None:
    broken = struct.pack("<HH", 9, 4000) + b"\x09\0\0\0"
    found, _, problem = make.read(
        make.section() + make.interface(options=broken) + make.enhanced(CALL, stamp=1)
    )
    assert (found[0].time_ns, problem) == (1000, None)


@settings(deadline=None)  # each capture is read three times, on a machine that may be busy
@given(st.binary(min_size=1, max_size=8), st.integers(min_value=0))
def test_bytes_overwritten_anywhere_never_raise(noise: bytes, at: int) -> None:
    data = bytearray(GOOD + simple(CALL) + obsolete(CALL) + make.section(">") + make.interface(">"))
    at = 28 + at % (len(data) - 28)  # behind the first section header
    data[at : at + len(noise)] = noise
    found, count, _ = make.read(bytes(data))
    assert len(found) <= count


# -- the writer ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("nanosecond", "unit"), [(True, 1), (False, 1000)])
def test_what_is_written_is_read_back(tmp_path: Path, nanosecond: bool, unit: int) -> None:
    path = tmp_path / "written.pcapng"
    time_ns = 1_700_000_000_123_456_789
    with PcapngWriter(path, nanosecond=nanosecond) as writer:
        writer.write(time_ns, CALL, comment="a comment of five bytes: äö")
        writer.write(time_ns + 1, make.RT)
        writer.write(time_ns + 5000, CALL[:91], original_length=len(CALL))
    found, count, problem = make.read(path.read_bytes())
    assert (count, problem) == (3, None)
    assert found == [
        Frame(1, time_ns // unit * unit, 1, CALL, len(CALL)),
        Frame(3, (time_ns + 5000) // unit * unit, 1, CALL[:91], len(CALL)),
    ]


def test_writer_leaves_a_given_file_open_and_refuses_impossible_times() -> None:
    file = io.BytesIO()
    with PcapngWriter(file, link_type=101) as writer, pytest.raises(ValueError, match="-1"):
        writer.write(-1, CALL)
    assert not file.closed
    assert make.read(file.getvalue()) == ([], 0, None)
