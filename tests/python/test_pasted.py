"""What people paste into `ds47 decode`: dumps of Wireshark, xxd and hexdump, lists of numbers."""

from __future__ import annotations

import io
import random
import shutil
import subprocess
from pathlib import Path

import pytest

from ds47.cli import main
from ds47.cli.pasted import read

CHANGE = bytes.fromhex("01020201 10010b540000 0801 41200000")
WIRESHARK = (
    "0000   01 02 02 01 10 01 0b 54 00 00 08 01 41 20 00 00   .......T....A ..",
    "0000   01 02 02 01 10 01 0b 54 00 00 08 01 41 20 00 00",
    "0000  01 02 02 01 10 01 0b 54\n0008  00 00 08 01 41 20 00 00\n",
    "0040   01 02 02 01 10 01 0b 54 00 00 08 01\n004c   41 20 00 00   A ..\n",
)
OTHERS = (
    "00000000: 0102 0201 1001 0b54 0000 0801 4120 0000  .......T....A ..\n",
    "00000000  01 02 02 01 10 01 0b 54  00 00 08 01 41 20 00 00  |.......T....A ..|\n00000010\n",
    "00000000: 01 02 02 01 10 01 0b 54  00 00 08 01 41 20 00 00  .......T....A ..\n",
    "\t0x0000:  0102 0201 1001 0b54 0000 0801 4120 0000  .......T....A...",
    "0000000 01 02 02 01 10 01 0b 54\n0000010 00 00 08 01 41 20 00 00\n0000020\n",
    "0100  01 02 02 01 10 01 0b 54-00 00 08 01\n010C  41 20 00 00  A ..",
    "0000: 0x01, 0x02, 0x02, 0x01, 0x10, 0x01, 0x0b, 0x54,\n0008: 0x00, 0x00, 0x08, 0x01, 0x41, 0x20, 0x00, 0x00",
    "01h 02h 02h 01h 10h 01h 0Bh 54h 00h 00h 08h 01h 41h 20h 00h 00h",
    "0102 0201 1001 0b54 0000 0801 4120 0000",
    "0102 0201 1001 0b54 0000 0801 4120 0000 hex",
    "hex: 01 02 02 01 10 01 0b 54 00 00 08 01 41 20 00 00",
    "<Buffer 01 02 02 01 10 01 0b 54 00 00 08 01 41 20 00 00>",
    "<Buffer 01 02 02 01 10 01 0b 54 00 00 08 01 41\n 20 00 00>\n",
    "0102hex 0201hex 1001hex 0B54hex 0000hex 0801hex 4120hex 0000hex",
    "0102 0201\n1001 0b54\n0000 0801\n4120 0000",
    "0102  0201  1001  0b54  0000  0801  4120  0000",
    "0102  0201  1001  0b54\n0000  0801  4120  0000",
    "01:02:02:01:10:01:0b:54:00:00:08:01:41:20:00:00",
    "01 02 02 01  10 01 0B 54 00 00  08 01 41 20 00 00",
    "01 02 02 01\n10 01 0B 54 00 00\n08 01 41 20 00 00",
)
PAIRS, WORDS = CHANGE.hex(" "), CHANGE.hex(" ", 2)
ONE_BLANK = (
    f"0000 {PAIRS}",
    f"0000\t{PAIRS}",
    f"00000000 {PAIRS}",
    f"000 {PAIRS}",
    f"{0:016} {PAIRS}",
    f"0000  {WORDS}",
    f"00000000 {WORDS}",
    f"0000 {PAIRS} .......T....A ..",
    f"0000h: {PAIRS.replace(' ', 'h ')}h",
    f"0000h {PAIRS.replace(' ', 'h ')}h",
    f"00: {PAIRS}",
    f"[0000] {PAIRS}",
    f"0000 | {PAIRS} | .......T....A ..",
    f"0000 {PAIRS[:23]}\n0008 {PAIRS[24:]}",
    f"0000\t{PAIRS[:23]}\n0008\t{PAIRS[24:]}",
    f"0040 {PAIRS[:23]}\n0048 {PAIRS[24:]}",
    f"00: {PAIRS[:23]}\n08: {PAIRS[24:]}",
    f"00 {PAIRS[:23]}\n08 {PAIRS[24:]}",
    f"0000 {PAIRS[:29]}\n0010 {PAIRS[30:]}",
    f"0000 {WORDS[:19]}\n0008 {WORDS[20:]}",
)


@pytest.mark.parametrize("text", [*WIRESHARK, *OTHERS, *ONE_BLANK])
def test_an_offset_is_no_data(text: str) -> None:
    assert read(text).data == CHANGE


def test_bytes_that_look_like_text_stay_bytes() -> None:
    """`30` may be the text of 33 30, or a byte: behind one blank it is a byte."""
    assert read("0000 33 30 30").data == b"300"
    assert read("0000   41 42 43 44   ABCD").data == read("0000: 4142 4344  ABCD").data == b"ABCD"
    assert read("0000 41 42 43 44\n0004 33 30 30").data == b"ABCD300"


def test_a_line_may_be_longer_than_those_of_dumps() -> None:
    long = bytes(range(1, 241))
    assert read(f"0000 {long.hex(' ')}").data == read(long.hex(" ")).data == long


def test_a_frame_in_front_of_another_is_no_offset() -> None:
    assert read("10827D5F5E16 E5").data == bytes.fromhex("10827D5F5E16E5")


def test_lists_of_decimal_numbers() -> None:
    numbers = list(map(str, CHANGE))
    for text in (
        str(list(CHANGE)),
        ", ".join(numbers),
        f"{{{','.join(numbers)}}}",
        ";".join(numbers),
        f"[{' '.join(numbers)}]",
        "\n".join(numbers),
        "\n".join(f"[{at}] {each}" for at, each in enumerate(numbers)),
        "\n".join(f"{at}: {each}" for at, each in enumerate(numbers)),
    ):
        pasted = read(text)
        assert (pasted.data, pasted.decimal) == (CHANGE, True), text
    for text, data in (("1 2 200", b"\x01\x02\xc8"), ("[1, 2, -60]", b"\x01\x02\xc4")):
        assert (read(text).data, read(text).decimal) == (data, True)


@pytest.mark.parametrize(
    "text", ["01, 02, 10", "01;02;10", "[01 02 10]", "01\n02\n10", "1, 2, A0", "7"]
)
def test_what_is_hexadecimal_is_no_list(text: str) -> None:
    assert not read(text).decimal


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 300]", "'300' in a list of decimal numbers is not a byte: .* 16#012C"),
        ("[1, -200]", "'-200' in a list of decimal numbers is not a byte: .* 16#FF38"),
        ("1 1 1 1 16 1 11 84 0 0", "'1' is a number of one digit, .*: write commas"),
        ("0000 1 1 1 1\n0004 16 1 11 84", "'1' is a number of one digit"),
        ("0040   01 02 02 01", "'0040' in front may be an offset or data: leave an offset out"),
        ("0040 01 02 02 01", "'0040' in front may be an offset or data"),
        ("0040: 0102 0201", "'0040' in front may be an offset or data"),
        ("0040  0102 0201 1001", "'0040' in front may be an offset or data"),
        (
            "03010201 1001 C47F 0000",
            "'03010201' in front .*; write data as two digits for each byte",
        ),
        ("0000 01 02 zz 03", "'0000' in front"),
        (
            "0000 01 02 02 01\n0020 10 01",
            "'0000' in front of line 1 may be an offset, .* paste all lines",
        ),
        ("00000000  00 00\n*\n00000020", "lines left out"),
        ("      00 01 02 03\n0000  01 02 02 01", "'0000' in front of line 2"),
        ("0000 01 02 02 01\n10 01 0b 54", "'0000' in front of line 1"),
        (
            "05 01 01 01\n08 01 41 20 00 00",
            "'05', '08' in front of the lines .*: leave offsets out, or",
        ),
        ("0102 hexa", "'hexa' is not a hexadecimal number"),
    ],
)
def test_what_is_in_doubt_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words) as told:
        read(text)
    assert "\n" not in str(told.value)


def test_dumps_of_anything() -> None:
    chance = random.Random(47)
    for _ in range(500):
        data, start = chance.randbytes(chance.randrange(1, 70)), chance.choice((0, 0x2A))
        rows = [data[at : at + 16] for at in range(0, len(data), 16)]
        if start and len(rows) == 1:
            continue
        for width, between, signs in (
            (4, "   ", DOTS),
            (8, " ", DOTS),
            (6, ": ", DOTS | {0x20: " "}),
        ):
            texts = [row.decode("latin-1").translate(signs) for row in rows]
            plain = "\n".join(
                f"{start + 16 * number:0{width}x}{between}{row.hex(' '):47}   {text}"
                for number, (row, text) in enumerate(zip(rows, texts, strict=True))
            )
            assert read(plain).data == data, plain


DOTS = {code: "." for code in range(256) if not 0x20 < code < 0x7F}


def test_decode_takes_a_dump_from_stdin(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(WIRESHARK[0] + "\n"))
    assert main(["decode", "--as", "request"]) == 0
    out, err = capsys.readouterr()
    assert "p2900[0] := 10.0" in out
    assert err == ""
    assert main(["decode", "--as", "request", str(list(CHANGE))]) == 0
    out, err = capsys.readouterr()
    assert "p2900[0] := 10.0" in out
    assert "read as decimal numbers" in err


def test_a_number_of_another_width_is_no_offset() -> None:
    """`01` and `0010` are 15 bytes apart, as these lines are; a dump has its offsets in a column."""
    text = "01 01 02 01 10 01 0b 54 00 00 08 01 41 20 00 00\n0010  01 02\n"
    assert read(text).data == bytes.fromhex("010102011001 0b54 00000801 41200000 0102")


@pytest.mark.parametrize("behind", ["   .......T....A ..", ""])
def test_a_dump_may_be_copied_from_its_first_byte_on(behind: str) -> None:
    first, second = PAIRS, PAIRS[:23]
    text = f"{first}{behind}\n0010   {second}{behind and '   .......T'}\n"
    assert read(text).data == CHANGE + CHANGE[:8]
    with pytest.raises(ValueError, match="do not count"):
        read(f"{first}{behind}\n0011   {second}")


BYTES = (
    CHANGE,
    CHANGE + b"\1\2\3\4",
    CHANGE + bytes(range(1, 90)),
    b"ABCDEFGHIJKLMNOPQRSTUVWXYZ",
    bytes(range(1, 20)),
)
ORDERED = (
    "hexdump -C", "hexdump -Cv", "xxd", "xxd -g1", "xxd -u", "xxd -c8", "xxd -p", "od -tx1", "od -Ax -tx1z",
    "od -Ad -tx1",
)  # fmt: skip
OF_A_MACHINE = (
    "hexdump", "hexdump -x", "hexdump -b", "hexdump -o", "hexdump -d", "hexdump -c", "od", "od -x", "od -tx2",
    "od -tx4", "od -tx8", "od -b", "od -c", "od -tu1", "od -td1", "od -Ax -x", "od -Ad -x", "xxd -e", "xxd -e -g8",
)  # fmt: skip
"""Words in the byte order of the machine, octal and decimal numbers."""


def dumped(tool: str, data: bytes, folder: Path) -> str:
    """What a tool prints of bytes."""
    name, *options = tool.split()
    program = shutil.which(name)
    if program is None:
        pytest.skip(f"no {name}")
    path = folder / "bytes"
    path.write_bytes(data)
    return subprocess.run(
        [program, *options, path], capture_output=True, check=True, text=True
    ).stdout  # fmt: skip


@pytest.mark.parametrize("data", BYTES)
@pytest.mark.parametrize("tool", ORDERED)
def test_dumps_of_bytes_are_read(tool: str, data: bytes, tmp_path: Path) -> None:
    assert read(dumped(tool, data, tmp_path)).data == data


@pytest.mark.parametrize("data", BYTES)
@pytest.mark.parametrize("tool", OF_A_MACHINE)
def test_dumps_of_words_are_refused(tool: str, data: bytes, tmp_path: Path) -> None:
    """One line says which options give bytes."""
    with pytest.raises(ValueError, match="dump bytes with hexdump -C, xxd or od -tx1"):
        read(dumped(tool, data, tmp_path))
