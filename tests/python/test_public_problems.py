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
    ("SFC14 8090", "a module of 1, 2 or 4 bytes (PPO3)"),
    ("s7 0x06", "bits (01) go one at a time"),
    ("CF81FD06", "the start-up did not go on in time"),
    ("CF81FD1E", "ports are plugged differently from the project"),
    ("16#40000112", "another subnet than that of the controller"),
    ("F07220", "the bus failed (with F01910 or F08501)"),
    ("F0070", "p2040"),
    ("36700160", "PUT and GET are not permitted"),
    ("0x00A00000", "bits (01) go one at a time"),
    ("665420", "wrong rack, slot or TSAP"),
    # Siemens, FAQ 109764509: the diagnostics buffer of a CPU
    ("16#08:9005", "overtemperature of electronic components"),
    ("16#08:9000", "message class 1 of PROFIdrive"),
    ("9013", "auxiliary unit defective"),
    ("36874 --lang zh", "报警类别 11"),
)
PASTED = (
    # node-snap7 76, ioBroker.s7 35
    (
        "2020-12-07 08:26:38.935 | warn | (3537) Poll error count: 29 code: 0x2300000 (errCliFunctionRefused)",
        "PUT and GET are not permitted",
    ),
    ("36700160: CLI : function refused by CPU (Unknown error)", "PUT and GET are not permitted"),
    ("EBRead error (errCliFunctionRefused)", "PUT and GET are not permitted"),
    # python-snap7 353, 322, 191
    ("b'CPU : Item not available'", "object is not available"),
    ("snap7.snap7exceptions.Snap7Exception: b'CPU : Address out of range'", "address out of range"),
    # python-snap7 60, 247
    ("DEBUG:snap7.common:error text for 0xa274c", "wrong rack, slot or TSAP"),
    ("b' ISO : An error occurred during recv TCP : Connection timed out'", "0x000A274C = 665420"),
    (
        "b' ISO : An error occurred during send TCP : Other Socket error (32)'",
        "closed by the other side",
    ),
    # p-net 536, 513, 4
    (
        "Error class: 0xfd Real-Time Acyclic Protocol Error code: 0x24 Not decoded",
        "required speed and duplex",
    ),
    ("ABORT err_cls 253  err_code 18", "a partner did not keep to the protocol"),
    (
        "Class=4, pszInfo=**** Station 'rt-labs-dev': CF81FD0B",
        "an alarm could not be handled",
    ),
    # python-snap7 844
    (
        "S7 protocol error 0x81/0x04 on ALL data access (DB, Merkers, Inputs)",
        "function is not supported",
    ),
    # p-net 169, 14, 74
    (
        "[15:22:09 INFO ] CMRPC(628) ERROR: 219, 129, 61, 0",
        "already has a connection with another controller",
    ),
    ("ABORT err_cls 0   err_code 6", "raise the accepted misses"),
    ('Error should be "0xCF, 0x81, 0xFD, 0x18"', "a Control failed"),
    # p-net 130
    ('The alarm should be "AR consumer DHT expired” (0xCF 0x81 0xFD 0x05).', "watchdog expired"),
    # ioBroker.s7 15
    (
        "s7.1 2018-12-30 18:14:47.924 warn Poll error count: 6 code: 0x90020",
        "closed by the other side",
    ),
    # gos7 51, 86, 26, s7comm 6, python-snap7 418
    (
        "client.AGReadDB: ISO : Invalid Buffer passed to Send/Receive'19'",
        "PUT and GET are not permitted",
    ),
    ("S7 Connect Err to CLI : Error in PDU negotiation", "wrong rack, slot or TSAP"),
    (
        "    plc_test.go:20: CLI : invalid CPU answer",
        "two threads or programs use one connection object",
    ),
    (
        'connecting to "192.168.0.1:102" failed: ISO : Invalid PDU received',
        "wrong rack, slot or TSAP",
    ),
    ("b' ISO : Bad PDU format'", "several threads share the connection"),
    # plc4x 599
    ("Error Class: 0x83 Error Code: 0x04", "PUT and GET are not permitted"),
    # openHAB-Simatic 2, 7, 9, 26; DotNetSiemensPLCToolBoxLibrary 60
    (
        "Read data area error (Area=DB24.DBB0-DB24.DBB4, Return code=0xffffff7e, Error=Buffer size)",
        "= -130: result of libnodave",
    ),
    (
        "Read data area error (Area=M0-M1, Return code=0xffffff7d, Error=No data returned.})",
        "the partner closed the connection",
    ),
    ("Return code=0xffffff7e", "the buffer of the caller is smaller"),
    ("Timeout when waiting for PLC response", "= -1025: result of libnodave"),
    # the outputs of a block in one line
    ("SINA_POS 8600 DiagId 80A0", "SINA_POS DiagId: 0x80A0"),
    ("fault F07220 and F07900 after a restart", "F07220"),
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
    # the example of a manual, and refusals in the words of makers
    ("pkw --pkw-layout rexroth-efc '0001 301A 0000 0000'", "1 read 2 30 1a parameter 16#30.1A"),
    ("pkw-answer --pkw-layout rexroth-efc '0001 301A 0000 0032'", "value 50 (16#0032)"),
    (
        "pkw-answer --pkw-layout rexroth-efc '0007 301A 0000 0005'",
        "error 5: Cannot be written while",
    ),
    (
        "pkw-answer --pkw-layout rexroth-fv '7003 1400 0000 0008'",
        "error 8: not in the table of Bosch Rexroth",
    ),
    ("pkw --pkw-layout inovance '20F0 0800 0000 1388'", "2 write 2 08 00 parameter 16#F0.08"),
    ("pkw-answer --pkw-layout inovance --lang zh '70F0 0800 0000 0002'", "错误 2：地址无效"),
    (
        "pkw --pkw-layout inovance -f json '10F0 0800 0000 0000'",
        '"meaning": "read", "group": 240, "index": 8',
    ),
    (
        "pkw-answer --pkw-layout inovance -f json '70F0 0800 0000 0002'",
        '"error": {"code": 2, "text": "Invalid address"}',
    ),
    ("profibus '68 0B 0B 68 82 8A 08 3E 3C 06 05 00 FF 0F 84 2B 16'", "parameterised by no master"),
    ("response 0181000144010000", "the parameter does not exist"),
    # gos7 56: a list of Go, with the bold type of Markdown
    (
        "s7 '[0x03 ,0x00 ,0x00 ,0x1b ,0x02 ,0xf0 ,0x80 ,0x32 ,0x03 ,0x00 ,0x00 ,0x04 ,0x00 ,0x00 ,0x08 ,0x00 ,0x00"
        " ,0x00 ,0x00 ,0xf0 ,0x00 ,0x00 ,0x01 ,0x00 ,0x01 ,**0x00** ,**0xf0**]'",
        "PDU length 240",
    ),
    # MLEN for a request: known types, those of no list, and no line where nothing is to be computed
    ("request '01 01 01 02 10 04 0B 56 00 02 10 08 03 B1 00 00'", "RDREC: MLEN 40 for all values"),
    (
        "request --vendor abb '01 01 01 01 10 04 0B 56 00 02'",
        "MLEN 22 for all values, with 4 bytes where",
    ),
    ("request --vendor abb --lang zh '01 01 01 01 10 04 0B 56 00 02'", "至少 10"),
)


def said(words: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(shlex.split(words)) in (0, None)
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("code", "text"), EXPLAINED)
def test_what_is_explained(code: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert text in said(f"explain {code}", capsys)


@pytest.mark.parametrize(("line", "text"), PASTED)
@pytest.mark.parametrize("quoted", [True, False])
def test_what_is_pasted(
    line: str, text: str, quoted: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line of a log as it stands, as one argument or as the shell splits it."""
    assert main(["explain", *([line] if quoted else line.split())]) == 0
    assert text in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    "line", ["nothing here", "on 20231101 at 12:00:00", "Snap7Exception: unknown", "port 50000"]
)
def test_a_line_without_a_code_is_refused(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", line]) == 2
    assert "unknown code" in capsys.readouterr().err


def test_a_layout_that_no_maker_has(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", "--as", "pkw", "--pkw-layout", "delta", "0001 301A 0000 0000"]) == 2
    assert "'rexroth-efc'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "asked",
    [
        "01 02 01 01 10 01 0B 54 00 00 08 01 41 20 00 00",
        "01 01 01 01 20 01 0B 54 00 00",
        "01 01 01 02 10 01 0B 54",
    ],
)
def test_of_changes_descriptions_and_halves_no_mlen_is_said(
    asked: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "MLEN" not in said(f"decode --as request '{asked}'", capsys)


@pytest.mark.parametrize(("what", "text"), DECODED)
def test_what_is_decoded(what: str, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert text in said(f"decode --as {what}", capsys)
