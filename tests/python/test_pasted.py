"""What people paste into `ds47 decode`: dumps of Wireshark, xxd and hexdump, lists of numbers."""

from __future__ import annotations

import io
import random

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
    "01h 02h 02h 01h 10h 01h 0Bh 54h 00h 00h 08h 01h 41h 20h 00h 00h",
    "0102 0201 1001 0b54 0000 0801 4120 0000",
    "0102 0201\n1001 0b54\n0000 0801\n4120 0000",
    "0102  0201  1001  0b54  0000  0801  4120  0000",
    "0102  0201  1001  0b54\n0000  0801  4120  0000",
)


@pytest.mark.parametrize("text", [*WIRESHARK, *OTHERS])
def test_an_offset_is_no_data(text: str) -> None:
    assert read(text).data == CHANGE


def test_lists_of_decimal_numbers() -> None:
    for text in (
        str(list(CHANGE)),
        ", ".join(map(str, CHANGE)),
        f"{{{','.join(map(str, CHANGE))}}}",
    ):
        pasted = read(text)
        assert (pasted.data, pasted.decimal) == (CHANGE, True)
    plain = read("01, 02, 10")
    assert (plain.data, plain.decimal) == (b"\x01\x02\x10", False)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 300]", "'300' in a list of decimal numbers is more than a byte"),
        ("0040   01 02 02 01", "'0040' in front may be an offset or data"),
        ("0102 hex", "'hex' is no hexadecimal number"),
    ],
)
def test_what_is_in_doubt_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read(text)


def test_dumps_of_anything() -> None:
    chance = random.Random(47)
    for _ in range(500):
        data, start = chance.randbytes(chance.randrange(1, 70)), chance.choice((0, 0x2A))
        rows = [data[at : at + 16] for at in range(0, len(data), 16)]
        if start and len(rows) == 1:
            continue
        plain = "\n".join(
            f"{start + 16 * number:04x}   {row.hex(' '):47}   {row.decode('latin-1').translate(DOTS)}"
            for number, row in enumerate(rows)
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
