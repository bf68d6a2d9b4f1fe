"""pcap: magic numbers, byte orders, link types; cut off anywhere; lengths that lie."""

from __future__ import annotations

import io

import frames as make
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47.capture import CaptureError, Frame, open_capture


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("magic", "unit"), [(0xA1B2C3D4, 1000), (0xA1B23C4D, 1), (0xA1B2CD34, 1000)]
)
def test_magic_and_byte_order(order: str, magic: int, unit: int) -> None:
    frames = [make.RT, make.call(), make.RT_TAGGED, make.DCP]
    found, count, problem = make.read(make.pcap(frames, order=order, magic=magic, fraction=999))
    assert (count, problem) == (4, None)
    assert found == [
        Frame(2, 1001 * 10**9 + 999 * unit, 1, make.call(), len(make.call())),
        Frame(4, 1003 * 10**9 + 999 * unit, 1, make.DCP, len(make.DCP)),
    ]


def test_snap_length_is_kept_apart_from_the_length_on_the_wire() -> None:
    whole = make.call()
    (frame,), _, _ = make.read(make.pcap([whole], snap=90))
    assert (frame.data, frame.original_length) == (whole[:90], len(whole))


def test_bits_above_the_link_type_are_ignored() -> None:
    data = make.pcap([make.call()], link_type=1 | 0x54000000)
    (frame,), _, _ = make.read(data)
    assert frame.link_type == 1


def test_cut_off_at_every_byte() -> None:
    frames = [make.RT, make.call(), make.call()]
    data = make.pcap(frames)
    ends = [24]
    for frame in frames:
        ends.append(ends[-1] + 16 + len(frame))
    for cut in range(len(data)):
        if cut < 24:
            with pytest.raises(CaptureError):
                open_capture(io.BytesIO(data[:cut]))
            continue
        found, count, problem = make.read(data[:cut])
        assert count == sum(end <= cut for end in ends[1:])
        assert [frame.number for frame in found] == [n for n in (2, 3) if n <= count]
        assert (problem is None) == (cut in ends)
        if problem is not None:
            assert f"byte {ends[count]}" in problem
            assert "\n" not in problem


@pytest.mark.parametrize("length", [1 << 18 | 1, 0x7FFFFFFF, 0xFFFFFFFF])
def test_a_length_that_lies_is_a_problem_with_its_offset(length: int) -> None:
    data = bytearray(make.pcap([make.call(), make.call()]))
    second = 24 + 16 + len(make.call())
    data[second + 8 : second + 12] = length.to_bytes(4, "little")
    found, count, problem = make.read(bytes(data) + bytes(1 << 19))
    assert (len(found), count) == (1, 1)
    assert problem is not None
    assert f"byte {second}" in problem
    assert str(length) in problem


@settings(deadline=None)  # each capture is read three times, on a machine that may be busy
@given(st.binary(min_size=1, max_size=4), st.integers(min_value=4))
def test_bytes_overwritten_anywhere_never_raise(noise: bytes, at: int) -> None:
    data = bytearray(make.pcap([make.call(), make.RT, make.DCP, make.call()]))
    at = 4 + at % (len(data) - 4)
    data[at : at + len(noise)] = noise
    found, count, _ = make.read(bytes(data))
    assert len(found) <= count
