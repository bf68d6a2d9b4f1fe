"""Hexadecimal text and readable lines."""

from __future__ import annotations

import pytest

from ds47.profidrive import decode_request, encode_request
from ds47.profidrive.notation import format_request_line, parse_hex, parse_request_line

LINES = [
    ("read ref 3 axis 2 p50303[0]", "030102011001c47f0000"),
    ("change ref 2 axis 2 p50304=Float32:100.0", "020202011001c4800000080142c80000"),
    ("read axis 1 p2900 r2902[2]*4", "0101010210000b54000010040b560002"),
    (
        "change p2900=Float32:11 p2901=Float32:22",
        "0102010210010b54000010010b550000080141300000080141b00000",
    ),
    ("change p922=Unsigned16:1,2", "010201011002039a0000060200010002"),
    ("read p1082.description[6]", "010101012001043a0006"),
    ('change p1=VisibleString:"a b"', "0102010110030001000009036120620" + "0"),
    ("0x51 axis 0 p10", "0151000110" + "00000a0000"),
]


@pytest.mark.parametrize(("line", "data"), LINES)
def test_line_both_ways(line: str, data: str) -> None:
    request = parse_request_line(line)
    assert encode_request(request).hex() == data
    again = format_request_line(decode_request(bytes.fromhex(data)))
    assert encode_request(parse_request_line(again)).hex() == data


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("03 01 02", "030102"),
        ("0301\n02\r\n", "030102"),
        ("16#0101 16#0102", "01010102"),
        ("0x03,0x01", "0301"),
        ("W#16#0101", "0101"),
        ("B#16#3, DW#16#1", "0300000001"),
        (r"\x03\x01", "0301"),
        ("3 1 2", "030102"),
        ("", ""),
    ],
)
def test_hex(text: str, data: str) -> None:
    assert parse_hex(text).hex() == data


@pytest.mark.parametrize("text", ["031", "zz", "B#16#123", "03 0x"])
def test_bad_hex(text: str) -> None:
    with pytest.raises(ValueError, match=r"number|digits"):
        parse_hex(text)


@pytest.mark.parametrize(
    "line",
    [
        "",
        "fly p1",
        "read",
        "read p1=Float32:1",
        "change p1",
        "change p1=Float31:1",
        "read p1.colour",
        "read ref x p1",
        "read p70000",
        "read ref 300 p1",
        "change p1=Unsigned8:999",
    ],
)
def test_bad_lines(line: str) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        parse_request_line(line)


def test_cut_request_has_no_line() -> None:
    with pytest.raises(ValueError, match="not whole"):
        format_request_line(decode_request(b"\x01\x01\x01"))
