"""Hexadecimal text and readable lines."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profidrive import Address, build_request, decode_request, encode_request, make_block
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
    ("read axis 2 p945[0..3]", "0101020110" + "0403b10000"),
    ("read p2902[2..2]", "0101010110" + "010b560002"),
    ("change p922[1..2]=Unsigned16:1,2", "010201011002039a0001060200010002"),
    ("change p922[1]*2=UINT:16#1,0x2", "010201011002039a0001060200010002"),
    ("change p1=WORD:2#1010_1010", "01020101100100010000" + "420100aa"),
    ("change p1=DWORD:DW#16#FFFF_FFFF", "01020101100100010000" + "4301ffffffff"),
    ("change p1=dint:-1", "01020101100100010000" + "0401ffffffff"),
    ("change p1=Float32:-Infinity", "01020101100100010000" + "0801ff800000"),
    ("change p1=LREAL:nan", "01020101100100010000" + "0f017ff8000000000000"),
    ("change p1=Unsigned16:", "01020101100000010000" + "0600"),
]
SPELLINGS = ["p0945", "P945", "r0945", "R945", "PNU 945", "pnu945", "p 945", "p00945"]
REPORTED = [  # as reports and the overview write addresses, names and lists
    ("read DO 2 p945[0..3] (Fault code)", "read axis 2 p945[0]*4"),
    ("read p944[0].text, p945[1..2], r2", "read p944[0].text p945[1]*2 r2"),
    ("change p50304[0] (Ramp time) := Float32:100.0", "change p50304[0]=Float32:100.0"),
    ("change p2902[2..4] := Float32:1.0, 2.0, 3.0", "change p2902[2]=Float32:1.0,2.0,3.0"),
    ("change p1 := Unsigned8:1, p2 = Unsigned8:2", "change p1=Unsigned8:1 p2=Unsigned8:2"),
    ('change p1 := VisibleString:"a, p2 := (b)"', 'change p1=VisibleString:"a, p2 := (b)"'),
    ('change p1=VisibleString4:"a", "b"', 'change p1=VisibleString4:"a","b"'),
]


@pytest.mark.parametrize(("line", "data"), LINES)
def test_line_both_ways(line: str, data: str) -> None:
    request = parse_request_line(line)
    assert encode_request(request).hex() == data
    again = format_request_line(decode_request(bytes.fromhex(data)))
    assert encode_request(parse_request_line(again)).hex() == data


@pytest.mark.parametrize("spelled", SPELLINGS)
def test_a_parameter_in_every_spelling(spelled: str) -> None:
    assert parse_request_line(f"read {spelled}[0] p1") == parse_request_line("read 945[0] p1")
    written = parse_request_line(f"change {spelled}[2]=Unsigned16:1, {spelled} := Unsigned16:2")
    assert written == parse_request_line("change p945[2]=Unsigned16:1 p945=Unsigned16:2")


@pytest.mark.parametrize(("line", "plain"), REPORTED)
def test_what_a_report_prints_is_understood(line: str, plain: str) -> None:
    assert encode_request(parse_request_line(line)) == encode_request(parse_request_line(plain))


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
    ("line", "plain"),
    [
        ("change DO3 p1120=Float32:5", "change axis 3 p1120=Float32:5"),
        ("DO3 p1120=Float32:5", "change axis 3 p1120=Float32:5"),
        ("do 3 ref7 p1120", "read axis 3 ref 7 p1120"),
        ("axis2 p945[0..3]", "read axis 2 p945[0..3]"),
    ],
)
def test_a_drive_object_may_stand_close_and_first(line: str, plain: str) -> None:
    assert encode_request(parse_request_line(line)) == encode_request(parse_request_line(plain))


BAD = [
    ("DO3", "no parameter given, for example: read axis 1 p922"),
    ("DOx p1", "'DOx': a request begins with read, change or a request id such as 0x51"),
    ("", "'': a request begins with read, change or a request id such as 0x51"),
    ("fly p1", "'fly': a request begins with read, change or a request id such as 0x51"),
    ("read", "no parameter given, for example: read axis 1 p922"),
    ("read p1=Float32:1", "a read takes no values; use change"),
    ("change p1", "every parameter of a change needs a value, as in p922=Unsigned16:1"),
    ("read ref x p1", "ref needs a number, not 'x'"),
    ("read p70000", "PNU 70000[0] does not fit 16 bits"),
    ("read ref 300 p1", "reference 300 does not fit a byte"),
    ("read p1.colour", "unknown attribute 'colour'. Accepted: value, description, text, 0x80"),
    ("read p945[3..0]", "p945[3..0]: the last index is before the first"),
    ("read p945[0..3]*4", "p945[0..3]*4 gives its number of elements twice"),
    ("read p945[0..255]", "elements 256 does not fit a byte"),
    ("change p1[0..2]=UINT:1,2", "p1[0..2] has 3 elements, but 2 values"),
    (
        "change p50304[0] := 100.0 s",
        "p50304[0]: the format of the value is missing, for example p50304[0]=Float32:100.0",
    ),
    (
        "change p1 := Float32:100.0 s",
        "'s' is not a parameter such as p922, p945[0..3], r2902[2]*4 or p922=Unsigned16:1;"
        " write values without a unit",
    ),
    ("change p1120=10", "p1120: the format of the value is missing, for example p1120=Float32:10"),
    ("change p922=1", "p922: the format of the value is missing, for example p922=Unsigned16:1"),
    (
        'change p1="a"',
        'p1: the format of the value is missing, for example p1=VisibleString:"a"',
    ),
    ("change p1=", "p1 has no value, for example p1=Float32:10.0"),
    (
        "change p1=UINT",
        "p1: the value after the format is missing, for example p1=Unsigned16:1",
    ),
    ("change p1=Float31:1", "p1: unknown format 'Float31'; near it: Float32, Float64"),
    ("change p1=DWRD:1", "p1: unknown format 'DWRD'; near it: DWORD, WORD"),
    ("change p1=Unsigned8:999", "p1: 999 does not fit Unsigned8 (0 to 255)"),
    ("change p1=Integer16:40000", "p1: 40000 does not fit Integer16 (-32768 to 32767)"),
    ("change p1=Integer16:16#8000", "p1: 32768 does not fit Integer16 (-32768 to 32767)"),
    (
        "change p1=TimeOfDayWithoutDate:-1",
        "p1: -1 does not fit TimeOfDayWithoutDate (0 to 4294967295)",
    ),
    ("change p1=Float32:abc", "p1: abc is not a number"),
    ("change p1=Float32:0x10", "p1: 0x10 is not a number"),
    (
        "change p1=Unsigned16:1.5",
        "p1: 1.5 is not a whole number, such as 10, 16#0A, 2#1010 or 0x0A",
    ),
    (
        "change p1=Unsigned16:16#G",
        "p1: 16#G is not a whole number, such as 10, 16#0A, 2#1010 or 0x0A",
    ),
    (  # a thousand, not 1 and 0
        "change p1=Unsigned16:1,000",
        "p1: 000 is not a whole number, such as 10, 16#0A, 2#1010 or 0x0A",
    ),
    ("change p1=Unsigned16:1,,2", 'p1: 1,,2 is not a list of values such as 1,2 or "a","b"'),
    ('change p1=VisibleString:"a"b', 'p1: "a"b is not a list of values such as 1,2 or "a","b"'),
    ("change p1=VisibleString:a,b", "p1: VisibleString is one text: write it in quotes"),
    (r'change p1=VisibleString:"\x"', r'p1: "\x" has an escape sequence that is not valid in JSON'),
    ('change p1=VisibleString:"a', "a quotation mark is not closed"),
    ('change p1=VisibleString:"中"', "p1: VisibleString cannot hold '中', only Latin-1 characters"),
    (
        "change p1=OctetString:0g",
        "p1: 0g is not a hexadecimal number of whole bytes, such as 0a1b",
    ),
    ("change p1=Zero:1", "p1: Zero takes no values"),
]


@pytest.mark.parametrize(("line", "problem"), BAD)
def test_bad_lines(line: str, problem: str) -> None:
    with pytest.raises(ValueError, match=re.escape(problem) + "$"):
        parse_request_line(line)


def test_a_format_like_no_other_gets_the_usual_ones() -> None:
    with pytest.raises(
        ValueError, match=r"usual ones: .*Float32 \(REAL\).*VisibleString"
    ) as caught:
        parse_request_line("change p1=xyzzy:1")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("number", ["1e39", "-1e39", "1e400", "-1e400", "3.4028236e38"])
def test_a_number_too_large_for_float32_never_becomes_infinite(number: str) -> None:
    problem = f"p1: {number} does not fit Float32 (-3.4028235e+38 to 3.4028235e+38)"
    with pytest.raises(ValueError, match=re.escape(problem)):
        parse_request_line(f"change p1=Float32:{number}")


def test_a_number_too_large_for_float64_never_becomes_infinite() -> None:
    with pytest.raises(ValueError, match="1e309 does not fit Float64"):
        parse_request_line("change p1=Float64:1e309")


@pytest.mark.parametrize(
    ("parameter", "one", "several"),
    [
        ("p1120=Float32:10,5", "p1120=Float32:10.5", "p1120[0..1]=Float32:10,5"),
        ("p1120[3]=REAL:-10,05", "p1120[3]=REAL:-10.05", "p1120[3..4]=REAL:-10,05"),
        ("p1120*1=LREAL:1,5", "p1120=LREAL:1.5", "p1120[0..1]=LREAL:1,5"),
        ("p1120[0..2]=REAL:1,5", "p1120[0]=REAL:1.5", "p1120[0..1]=REAL:1,5"),
        ("p1=8:1,000.5", "p1=8:1000.5", "p1[0..1]=8:1,000.5"),
        ("p1=REAL:1,000", "p1=REAL:1.000 or p1=REAL:1000", "p1[0..1]=REAL:1,000"),
        ("p1=REAL:100,200,300", "p1=REAL:100200300", "p1[0..2]=REAL:100,200,300"),
    ],
)
def test_what_may_be_a_decimal_comma_is_refused(parameter: str, one: str, several: str) -> None:
    with pytest.raises(ValueError, match=r"can mean one value or [23]: write") as caught:
        parse_request_line(f"change {parameter}")
    count = parameter.count(",") + 1
    assert str(caught.value).endswith(f"write {one} for one, {several} for {count}")
    for way in (*one.split(" or "), several):  # both ways that it names are taken
        (block,) = parse_request_line(f"change {way}").blocks
        assert block.value_count == (count if way == several else 1)


@pytest.mark.parametrize(
    "values", ["10.0,5.0", "10.0,5", "1,2,3", "1e3,5", "Infinity,5", "10.0,500,500"]
)
def test_a_list_that_is_no_number_is_a_list(values: str) -> None:
    (block,) = parse_request_line(f"change p1=Float32:{values}").blocks
    assert block.value_count == values.count(",") + 1


@given(st.lists(st.floats(width=32, allow_nan=False), min_size=1, max_size=4))
def test_a_written_list_of_floats_never_looks_like_one_number(numbers: list[float]) -> None:
    address = Address(0x10, len(numbers), 1, 0)
    request = build_request(0x02, [address], [make_block(0x08, numbers)])
    assert parse_request_line(format_request_line(request)).blocks == request.blocks


def test_cut_request_has_no_line() -> None:
    with pytest.raises(ValueError, match="incomplete"):
        format_request_line(decode_request(b"\x01\x01\x01"))
