"""What people had in hand in public threads and manuals, and what the commands have to say of it."""

from __future__ import annotations

import shlex

import pytest

from ds47.cli import main

EXPLAINED = (
    (
        "stw1 007F",
        "Missing to run: control by PLC (bit 10)",
    ),  # PZD of a DC drive that are not taken over
    ("stw1 047E", "Missing to run: ON (bit 0, as an edge)"),
    ("zsw1 EB31", "To the next state: ON"),
    ("BSEND 1", "the connection is interrupted (cable, CPU switched off, CP in STOP)"),
    ("DE80B100", "MLEN does not fit the response"),
    ("DF80B600", "access denied"),
    ("SFC59 80B1", "length"),
    ("s7 0x06", "bits (01) go one at a time"),
    ("CF81FD06", "the start-up did not go on in time"),
    ("F07220", "the bus failed (F01910 or F08501 stands beside it)"),
    ("F0070", "p2040"),
    ("36700160", "PUT and GET are not permitted"),
    ("0x00A00000", "bits (01) go one at a time"),
    ("665420", "wrong rack, slot or TSAP"),
)
DECODED = (
    ("s7 32-03-00-00-00-00-00-02-00-04-00-00-04-01-0A-00-00-00", "0x0A object does not exist"),
    ("s7 32-03-00-00-00-00-00-02-00-04-00-00-04-01-05-00-00-00", "0x05 address out of range"),
    # 15 bytes where 19 were expected of a read: the answer to a write of another thread
    ("s7 32-03-00-00-00-07-00-02-00-01-00-00-05-01-FF", "write variables, 1 item"),
    (
        "s7 '<Buffer 03 00 00 13 02 f0 80 32 02 00 00 00 02 00 00 00 00 81 04>'",
        "function is not supported",
    ),
    ("pkw-answer '139A 0000 0000 0065'", "p0922[0]"),
    ("pkw-answer --vendor mitsubishi '7005 0000 0000 0041'", "Not in this operation mode"),
    ("pkw-answer --vendor bonfiglioli '7069 0000 0000 006A'", "No change in operation"),
    (
        "pkw-answer --vendor allen-bradley '7069 0000 0000 006B'",
        "Not possible in this operating state",
    ),
    (
        "pkw '0001 301A 0000 0000'",
        "page 16#1A does not exist",
    ),  # a frame of another layout is told as odd
    ("profibus '68 0B 0B 68 82 8A 08 3E 3C 06 05 00 FF 0F 84 2B 16'", "parameterised by no master"),
    ("response 0181000144010000", "the parameter does not exist"),
)


def said(words: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(shlex.split(words)) in (0, None)
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("code", "text"), EXPLAINED)
def test_what_is_explained(code: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert text in said(f"explain {code}", capsys)


@pytest.mark.parametrize(("what", "text"), DECODED)
def test_what_is_decoded(what: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert text in said(f"decode --as {what}", capsys)
