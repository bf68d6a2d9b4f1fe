"""Opening: compression, stdin, what is no capture; the scan's predicate; tshark as the oracle."""

from __future__ import annotations

import gzip
import io
import sys
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path

import frames as make
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.capture import CaptureError, open_capture
from ds47.capture.scan import ETHERNET, RAW, SLL, SLL2, relevant
from ds47.export import first_time

PLAIN = make.pcap([make.RT, make.call(), make.DNS, make.call()])


def numbers(data: bytes) -> list[int]:
    with open_capture(io.BytesIO(data)) as capture:
        found = [frame.number for frame in capture]
        assert capture.complete, capture.problem
        assert capture.frames == 4
        return found


def zstd(data: bytes) -> bytes:
    module = pytest.importorskip(
        "compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd"
    )
    packed: bytes = module.compress(data)
    return packed


def test_gzip_and_zstd_are_recognised_by_content() -> None:
    assert numbers(PLAIN) == numbers(gzip.compress(PLAIN)) == numbers(zstd(PLAIN)) == [2, 4]


def test_a_short_capture_knows_what_none_of_its_frames_has() -> None:
    mark, without = make.RT[12:14], make.pcap([make.DNS, make.call()])
    for data, lacks in ((PLAIN, False), (without, True), (gzip.compress(without), True)):
        with open_capture(io.BytesIO(data)) as capture:
            assert capture.lacks(mark) is lacks
            assert len(list(capture)) == (1 if lacks else 2)  # nothing of it is lost
    long = make.pcap([make.DNS] * (1 + (1 << 20) // len(make.DNS)))
    with open_capture(io.BytesIO(long)) as capture:
        assert not capture.lacks(mark)
    with open_capture(io.BytesIO(b"0000  00 01 02 03 04 05 06 07 08 09 0a 0b 88 92 00\n")) as dump:
        assert not dump.lacks(mark)


def test_compressed_data_in_several_members_and_zero_padding() -> None:
    for pack in (gzip.compress, zstd):
        assert numbers(pack(PLAIN[:90]) + pack(PLAIN[90:])) == [2, 4]
    assert numbers(gzip.compress(PLAIN) + bytes(512)) == [2, 4]


@pytest.mark.parametrize("pack", [gzip.compress, zstd])
def test_a_compressed_capture_cut_anywhere_gives_what_comes_before(pack) -> None:  # type: ignore[no-untyped-def]
    packed = pack(PLAIN)
    for cut in range(len(packed)):
        try:
            with open_capture(io.BytesIO(packed[:cut])) as capture:
                found = [frame.number for frame in capture]
        except CaptureError:  # not even the file header
            continue
        assert [n for n in (2, 4) if n <= capture.frames] == found
        # the checksum behind the last frame may be all that lacks
        assert not capture.complete
        assert capture.problem is not None


def test_garbage_behind_gzip_data_is_a_problem_and_no_exception() -> None:
    with open_capture(io.BytesIO(gzip.compress(PLAIN) + b"garbage")) as capture:
        assert [frame.number for frame in capture] == [2, 4]
    assert "not gzip" in (capture.problem or "")


@pytest.mark.parametrize(
    "data",
    [
        PLAIN,
        make.pcap([make.RT, make.call()], order=">", magic=0xA1B23C4D),
        make.pcap([make.RT, make.call()], magic=0xA1B2CD34),
        make.section() + make.interface() + make.enhanced(make.RT, stamp=7) + make.enhanced(make.call(), stamp=9),
        make.section(">") + make.interface(">") + make.enhanced(make.call(), ">", stamp=7),
        make.section() + make.interface(),
        make.pcap([]),
        make.pcap([make.RT])[:-1],
    ],
)  # fmt: skip
def test_the_times_of_first_and_last_frame_are_known_whatever_they_hold(
    data: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "x.pcap"
    path.write_bytes(data)
    with open_capture(path) as capture:
        assert capture.first_ns is None
        list(capture)
        assert capture.first_ns == (first_time(path) if capture.frames else None)
        assert (capture.first_ns is None) == (capture.frames == 0)
        with open_capture(path) as again:
            times = [each.time_ns for each in again.everything()]
        assert capture.last_ns == (times[-1] if times else None)


class Dribble(io.RawIOBase):
    """A pipe that gives one byte at a time."""

    def __init__(self, data: bytes) -> None:
        self._data = io.BytesIO(data)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer) -> int:  # type: ignore[no-untyped-def,override]
        return self._data.readinto(memoryview(buffer)[:1])


@pytest.mark.parametrize("data", [PLAIN, gzip.compress(PLAIN, mtime=0)])
def test_any_slicing_of_the_input_gives_the_same(data: bytes) -> None:
    with open_capture(Dribble(data), name="pipe") as capture:  # type: ignore[arg-type]
        assert [frame.number for frame in capture] == [2, 4]
    assert capture.path == "pipe"


def test_stdin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(PLAIN)))
    with open_capture("-") as capture:
        assert capture.path == "-"
        assert len(list(capture)) == 2
    assert not sys.stdin.buffer.closed


def test_frames_across_chunks(tmp_path: Path) -> None:
    path = tmp_path / "with space.pcap"
    path.write_bytes(make.pcap(([make.RT] * 998 + [make.call(), make.DNS]) * 20))
    with open_capture(path) as capture:
        assert [frame.number for frame in capture] == [1000 * i + 999 for i in range(20)]
    assert (capture.frames, capture.complete) == (20_000, True)


def test_complete_only_at_the_end() -> None:
    with open_capture(io.BytesIO(PLAIN)) as capture:
        assert next(iter(capture)).number == 2
        assert capture.frames >= 2
        assert not capture.complete
        assert [frame.number for frame in capture] == [4]
        assert capture.complete


@pytest.mark.parametrize(
    "data", [b"", b"\xd4", b"PK\3\4 a zip file", gzip.compress(b"text", mtime=0)]
)
def test_not_a_capture(data: bytes) -> None:
    with pytest.raises(CaptureError) as caught:
        open_capture(io.BytesIO(data), name="x.pcap")
    assert caught.value.message.startswith("x.pcap: ")


def test_no_such_file_and_a_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "no.pcap", tmp_path):
        with pytest.raises(CaptureError, match=r"no\.pcap|directory|denied|Permission"):
            open_capture(path)


@given(st.binary(max_size=300))
def test_random_bytes_behind_a_header_never_raise(noise: bytes) -> None:
    heads = [make.pcap([]), make.pcap([], order=">"), make.section() + make.interface()]
    for head in heads:
        with open_capture(io.BytesIO(head + noise)) as capture:
            list(capture)
        assert capture.complete == (capture.problem is None)


# -- the predicate ---------------------------------------------------------------------------------

LITTLE = make.ethernet(0x0800, make.ipv4(make.udp(make.rpc(make.UUID_LITTLE), (40001, 40002))))
IP_CALL = make.ipv4(make.udp(make.rpc()))


@pytest.mark.parametrize(
    ("frame", "link_type", "wanted"),
    [
        (make.call(), ETHERNET, True),
        (LITTLE, ETHERNET, True),
        (make.ethernet(0x0800, IP_CALL, (0x8100,)), ETHERNET, True),
        (make.ethernet(0x0800, IP_CALL, (0x88A8, 0x8100)), ETHERNET, True),
        (make.ethernet(0x0800, make.ipv4(b"x" * 40, more=True)), ETHERNET, True),
        (make.ethernet(0x0800, make.ipv4(b"x" * 40, offset=80)), ETHERNET, True),
        (make.ethernet(0x0800, make.ipv4(b"x" * 40, offset=80, proto=6)), ETHERNET, False),
        (make.ethernet(0x0800, make.ipv4(make.udp(make.rpc()), proto=6)), ETHERNET, False),
        (make.DNS, ETHERNET, False),
        (make.RT, ETHERNET, False),
        (make.RT_TAGGED, ETHERNET, False),
        (make.DCP, ETHERNET, True),
        (make.LLDP, ETHERNET, True),
        (make.ethernet(0x8892, b"\xfe\xfb" + bytes(44)), ETHERNET, False),
        (make.ethernet(0x86DD, bytes(60)), ETHERNET, False),
        (bytes(14) + b"\x08\x00" + IP_CALL, SLL, True),
        (bytes(14) + b"\x81\x00\x00\x01\x08\x00" + IP_CALL, SLL, True),
        (b"\x08\x00" + bytes(18) + IP_CALL, SLL2, True),
        (IP_CALL, RAW, True),
        (make.call(), 148, False),
        (make.call(), 147, True),  # anything may be PROFIBUS there
        (make.call(), 257, True),
    ],
)
def test_predicate(frame: bytes, link_type: int, wanted: bool) -> None:
    assert relevant(frame, 0, len(frame), link_type, len(frame)) == wanted
    with open_capture(io.BytesIO(make.pcap([frame], link_type=link_type))) as capture:
        assert bool(list(capture)) == wanted
    big = make.section(">") + make.interface(">", link_type=link_type) + make.enhanced(frame, ">")
    with open_capture(io.BytesIO(big)) as capture:
        assert bool(list(capture)) == wanted


def test_every_cut_of_every_frame_is_decided_without_an_exception() -> None:
    tagged = make.ethernet(0x0800, IP_CALL, (0x8100,))
    for frame in (make.call(), tagged, make.DNS, make.DCP, make.LLDP, make.RT):
        for cut in range(len(frame)):
            relevant(frame, 0, cut, ETHERNET, len(frame))


def test_a_snap_length_in_front_of_the_uuid_keeps_calls_on_the_port_only() -> None:
    whole = make.call()
    kept = [cut for cut in range(len(whole)) if relevant(whole, 0, cut, ETHERNET, len(whole))]
    assert kept == list(range(14 + 20 + 4, len(whole)))
    other = LITTLE
    kept = [cut for cut in range(len(other)) if relevant(other, 0, cut, ETHERNET, len(other))]
    assert kept == list(range(14 + 20 + 8 + 24 + 1, len(other)))
    # not cut, merely short
    short = make.ethernet(0x0800, make.ipv4(make.udp(b"\4" + bytes(20))))
    assert not relevant(short, 0, len(short), ETHERNET, len(short))


# -- tshark ----------------------------------------------------------------------------------------

FIELDS = ("frame.number", "frame.time_epoch", "frame.cap_len", "frame.len")
FILES = (
    "icsnpp_iocm_all.pcapng",
    "icsnpp_iocm_mixed1.pcap",
    "plc4x_implicit.pcapng",
    "plc4x_working.pcapng",
    "real-stacks/o1_profinetpy062_be.pcapng",
    "real-stacks/o2_pyprofinet_le.pcapng",
    "real-stacks/o3_two_controllers.pcapng",
)


def same_as_tshark(path: Path, tshark: Callable[..., str]) -> None:
    """Compare number, time, captured length and length on the wire of every frame yielded."""
    columns = [word for name in FIELDS for word in ("-e", name)]
    rows = [line.split("\t") for line in tshark("-r", path, "-T", "fields", *columns).splitlines()]
    with open_capture(path) as capture:
        for frame in capture:
            number, time, captured, original = rows[frame.number - 1]
            assert int(number) == frame.number
            assert Decimal(time) * 1_000_000_000 == frame.time_ns
            assert (int(captured), int(original)) == (len(frame.data), frame.original_length)
        assert capture.complete
        assert capture.frames == len(rows)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_numbers_times_and_lengths_are_those_of_tshark(
    name: str, shared: Path, tshark: Callable[..., str]
) -> None:
    same_as_tshark(shared / "captures" / name, tshark)


@pytest.mark.parametrize("order", ["<", ">"])
def test_odd_pcapng_blocks_are_numbered_as_tshark_does(
    tmp_path: Path, tshark: Callable[..., str], order: str
) -> None:
    ticks = make.option(9, b"\x8a", order) + make.option(0, b"", order)  # 2**-10 seconds
    custom = (32473).to_bytes(4, "little" if order == "<" else "big") + b"data"
    call = make.call()
    blocks = [
        make.section(order),
        make.interface(order),
        make.interface(order, options=ticks),
        make.enhanced(call, order, stamp=1_700_000_000_123_456),
        make.block(0x0BAD, custom, order),
        make.enhanced(call, order, number=1, stamp=1_700_000_000 * 1024 + 512),
        make.block(0x40000BAD, custom, order),
        make.block(4, bytes(4), order),
        make.enhanced(call, order),
        make.block(9, make.padded(b"MESSAGE=x\n__REALTIME_TIMESTAMP=1\n\n"), order),
        make.enhanced(call, order),
        make.block(0x7FFF, b"nobody knows", order),
        make.enhanced(call, order),
    ]
    path = tmp_path / "odd.pcapng"
    path.write_bytes(b"".join(blocks))
    same_as_tshark(path, tshark)
