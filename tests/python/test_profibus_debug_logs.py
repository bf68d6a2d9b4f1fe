"""Debug logs of PROFIBUS masters: frames among words, as pyprofibus and profirust print them."""

from __future__ import annotations

import io
import random
import time

import pytest
from test_profibus_calls import GIVEN, READ, WRITE, Talk

from ds47.analysis import analyze
from ds47.capture import CaptureError, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.profibus import PROFIBUS_DL, telegram
from ds47.profibus.listing import TO_MASTER, TO_SLAVE, LogEntry, Unread, read

TALK = Talk().ask(WRITE).answer().ask("").answer("5f002f0a").ask(READ).answer("5e002f0a" + GIVEN)
FRAMES = [*TALK.frames, b"\xdc\x02\x02", telegram.encode(3, 2, 0x49), telegram.encode(2, 3, 0)]
STATUS = "10 05 02 49 50 16"
PHY = "[2024-05-01T12:00:00Z TRACE profirust::phy] PHY"
HEADER = "DataTelegramHeader {{ da: {}, sa: {}, dsap: {}, ssap: {}, fc: {} }}"


def printed(da: int, sa: int, saps: tuple[str, str], code: str, pdu: str) -> str:
    """A frame as profirust prints it."""
    return f"DataTelegram {{ h: {HEADER.format(da, sa, *saps, code)}, pdu: {pdu} }}"


def entry(line: str) -> LogEntry:
    (found,) = read(["words", line])
    assert isinstance(found, LogEntry), found
    return found


@pytest.mark.parametrize(
    ("line", "data", "direction"),
    [
        (f"PHY-serial: TX   {STATUS}", STATUS, TO_SLAVE),
        ("PHY-serial: RX   E5", "E5", TO_MASTER),
        ("PHY-fpga: RX   DC 02 02", "DC0202", TO_MASTER),
        ("PHY-serial: sending 100502495016", STATUS, TO_SLAVE),
        ("PHY-serial: received e5", "e5", TO_MASTER),
        ("CpPhyDummySlave: Sending SRD 100502495016", STATUS, TO_SLAVE),
        (f"DEBUG:root:PHY-serial: TX   {STATUS}", STATUS, TO_SLAVE),
        (f"bus.py:17 {STATUS} (6 bytes)", STATUS, None),
        (f"TX {STATUS}  ..IP.", STATUS, TO_SLAVE),
        ("            1000         phy1: 0x10 0x05 0x02 0x49 0x50 0x16", STATUS, None),
        ("            1500         phy2: 0xe5", "E5", None),
        ("frame=100502495016", STATUS, None),
        (f"{PHY} TX " + printed(5, 2, ("None", "None"), "Request { fcb: Inactive, req: FdlStatus }", "[]"),
         STATUS, TO_SLAVE),
        (f"{PHY} RX " + printed(2, 5, ("None", "None"), "Response { state: Slave, status: Ok }", "[]"),
         "10 02 05 00 07 16", TO_MASTER),
        (f"{PHY} TX " + printed(7, 2, ("Some(60)", "Some(62)"), "Request { fcb: First, req: SrdLow }", "[]"),
         "68 05 05 68 87 82 6C 3C 3E EF 16", TO_SLAVE),
        (f"{PHY} TX " + printed(5, 2, ("None", "None"), "Request { fcb: High, req: SrdHigh }", "[1, 255]"),
         "68 05 05 68 05 02 7D 01 FF 84 16", TO_SLAVE),
        (f"{PHY} RX " + printed(2, 5, ("None", "None"), "Response { state: Slave, status: DataHigh }", "[2]"),
         "68 04 04 68 02 05 0A 02 13 16", TO_MASTER),
        (f"{PHY} TX TokenTelegram {{ da: 2, sa: 7 }}", "DC0207", TO_SLAVE),
        (f"{PHY} RX ShortConfirmation", "E5", TO_MASTER),
    ],
)  # fmt: skip
def test_a_frame_among_words(line: str, data: str, direction: str | None) -> None:
    found = entry(line)
    assert (found.telegram.data, found.telegram.flaws) == (bytes.fromhex(data), ())
    assert found.direction == direction


@pytest.mark.parametrize(
    ("line", "time_ns"),
    [
        (f"PHY-serial: TX   {STATUS}", None),
        (f"2024-05-01 12:00:00,250 DEBUG pyprofibus: PHY-serial: TX   {STATUS}", 1_714_564_800_250_000_000),
        (f"DEBUG 2024-05-01 12:00:00,250 PHY-serial: TX   {STATUS}", 1_714_564_800_250_000_000),
        (f"Wed May  1 12:00:00 host app[1]: PHY-serial: TX   {STATUS}", 43_200_000_000_000),
        (f"[   12.500000] PHY-serial: TX   {STATUS}", 12_500_000_000),
        (f"{PHY} RX ShortConfirmation", 1_714_564_800_000_000_000),
    ],
)  # fmt: skip
def test_the_time_of_a_logger(line: str, time_ns: int | None) -> None:
    assert entry(line).time_ns == time_ns


@pytest.mark.parametrize(
    "line",
    [
        "DPM1: Trying to initialize slave 5...", "DPM1: slave[05].state --> 'Wait for Cfg'",
        "DPM1: RX error: PHY-serial: Failed to get received telegram size:", "Invalid telegram format.",
        "GSD parser warning in 'LSCI0F84.gsd' at line 18:", "31.25_supp                 = 0",
        " --> Ignored unknown line", "retry 10", "Baudrate = 19200", "10 slaves found", "be careful", "feedback",
        "master waits for slave 10 20", "12:00:00", "ident 80 6A", f"{PHY} RX {HEADER}", "Receive buffer content:",
        f"{PHY} TX " + printed(5, 2, ("None", "None"), "Request { fcb: Other, req: FdlStatus }", "[]"),
        f"{PHY} TX TokenTelegram {{ da: 300, sa: 2 }}",
    ],
)  # fmt: skip
def test_words_cost_nothing(line: str) -> None:
    assert list(read(["E5", line]))[1:] == []


@pytest.mark.parametrize(
    "line", ["PHY-serial: TX   10 05 zz 49 50 16", "10 05 0z 49 50 16", "E5 0G", "1005024g5016", "TX 1005024g5016"]
)  # fmt: skip
def test_damaged_digits_are_told(line: str) -> None:
    (found,) = read(["words", line])
    assert found == Unread(2, "hex", line)


@pytest.mark.parametrize(
    ("line", "flaw"),
    [
        ("PHY-serial: RX   68 0B 0B 68 82", "cut"),
        ("PHY-serial: RX (fragment) E7 A7 DA", "start"),
        ("PHY-serial: TX   10 05 02 49 51 16", "check"),
    ],
)
def test_damaged_frames_are_frames_with_a_flaw(line: str, flaw: str) -> None:
    assert [each.kind for each in entry(line).telegram.flaws] == [flaw]


def pyprofibus(at: int, data: bytes) -> str:
    return f"PHY-serial: {'TX' if at % 2 == 0 else 'RX'}   {data.hex(' ').upper()}"


def logged(at: int, data: bytes) -> str:
    return f"1970-01-01 00:00:00,{at:03} DEBUG bus.phy: {pyprofibus(at, data)}"


@pytest.mark.parametrize("shape", [pyprofibus, logged])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_debug_log_says_what_its_capture_says(shape: object, encoding: str) -> None:
    assert callable(shape)
    stream = io.BytesIO()
    with PcapngWriter(stream, link_type=PROFIBUS_DL) as writer:
        for at, data in enumerate(FRAMES):
            writer.write(at * 1_000_000, data)
    stream.seek(0)
    between = "DPM1: slave[03].state --> 'wait for diag'\n\n"
    text = between * 300 + between.join(f"{shape(at, data)}\r\n" for at, data in enumerate(FRAMES))
    expected, found = analyze(stream), analyze(io.BytesIO(text.encode(encoding)))
    assert found.problem is None
    assert found.transactions == (expected.transactions if shape is logged else found.transactions)
    assert len(found.transactions) == len(expected.transactions) == 1
    assert [each.rule for each in found.findings] == [each.rule for each in expected.findings]


def test_a_log_without_a_frame_is_refused() -> None:
    with pytest.raises(CaptureError):
        open_capture(io.BytesIO(b"DPM1: slave 3 is ready\nPHY-serial: RX   E5\n" * 9))


def test_long_lines_are_told_at_once() -> None:
    chance = random.Random(47)
    parts = ["TX ", "     ", "DataTelegram { ", "12:00 ", "zz ", "0x"]
    begin = time.process_time()
    for part in parts:
        mixed = "".join(chance.choices([*parts, "10 ", "a:"], k=20_000))
        assert [each.line for each in read([mixed, f"{part * 100_000}."])] == [1, 2]
    assert time.process_time() - begin < 10
