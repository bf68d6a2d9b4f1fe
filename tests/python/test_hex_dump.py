"""Hex dumps as captures: what each form prints of frames gives the frames again, and the same report."""

from __future__ import annotations

import gzip
import io
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.analysis import analyze
from ds47.capture import CaptureError, open_capture
from ds47.capture.hex_rows import Packets
from ds47.capture.scan import ETHERNET, RAW, SLL
from ds47.model import CaptureResult
from ds47.profibus import PROFIBUS_DL

Frames = Sequence[tuple[int, bytes]]
"""Times and bytes."""
SECOND = 1_000_000_000
DOTS = {code: "." for code in range(256) if not 0x20 <= code < 0x7F}
NO_BLANKS = {**DOTS, 0x20: "."}
LLDP = (
    bytes.fromhex("0180c200000e001c06000001 88cc") + b"\x02\x07\x04\x00\x1c\x06\x00\x00\x01\x00\x00"
)


def rows(
    data: bytes, form: str, beside: str = "", width: int = 47, signs: dict[int, str] = DOTS
) -> str:
    """The rows of a packet: `form` has the offset and the bytes, `beside` their text."""
    group = 2 if "{words" in form else 1
    found = []
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        digits = row.hex(" ", -group)
        line = form.format(
            at=at, bytes=digits, words=digits, half=f"{row[:8].hex(' ')}  {row[8:].hex(' ')}"
        )
        text = row.decode("latin-1").translate(signs)
        found.append(f"{line:{width}}{beside.format(text)}" if beside else line)
    return "\n".join(found) + "\n"


def stamp(time_ns: int) -> str:
    return f"{time_ns // SECOND}.{time_ns % SECOND:09}"


def tshark(frames: Frames) -> str:
    return "\n".join(
        f"{number:5} {stamp(time)} 192.0.2.1 → 192.0.2.2 TCP 60 0000 1 2\n\n"
        + rows(data, "{at:04x}  {bytes}", "   {}", 53)
        for number, (time, data) in enumerate(frames, 1)
    )


def details(frames: Frames) -> str:
    return "\n".join(
        f"Frame {number}: {len(data)} bytes on wire ({8 * len(data)} bits), {len(data)} bytes captured\n"
        f"    0.5 s\n    Epoch Time: {stamp(time)} seconds\n    0000 0000 = Field: 0\n\n"
        f"Frame ({len(data)} bytes):\n" + rows(data, "{at:04x}  {bytes}", "   |{}|", 53)
        + "Reassembled TCP (20 bytes):\n" + rows(LLDP[:20], "{at:04x}  {bytes}", "   |{}|", 53)
        + "Other (20 bytes):\n" + rows(LLDP[:20], "{at:04x}  {bytes}", "   |{}|", 53)
        for number, (time, data) in enumerate(frames, 1)
    )  # fmt: skip


def tcpdump(frames: Frames) -> str:
    return "".join(
        f"{stamp(time)} IP 192.0.2.1.1 > 192.0.2.2.2: UDP, length 164\n"
        + rows(data, "\t0x{at:04x}:  {words}", "  {}", 50, NO_BLANKS)
        for time, data in frames
    )


def tcpdump_x(frames: Frames) -> str:
    return "".join(
        f"{stamp(time)} 00:01 > 00:02, ethertype\n" + rows(data, "\t0x{at:04x}:  {words}")
        for time, data in frames
    )


def text2pcap(frames: Frames) -> str:
    return "# a dump\n" + "".join(
        f"I {stamp(time)}\n"
        + rows(data, "{at:06x} {bytes}", " {}", 0)
        + f"{len(data):06x}\n" * (number % 2)
        for number, (time, data) in enumerate(frames)
    )


def canonical(frames: Frames) -> str:
    return "".join(
        f"[{stamp(time)}]\n" + rows(data, "{at:08x}  {half}", "  |{}|", 59) + f"{len(data):08x}\n"
        for time, data in frames
    )


def copied(frames: Frames) -> str:
    return "\r\n".join(
        f"> {stamp(time)}\r\n" + rows(data, "> {at:04X}   {bytes}").upper().replace("\n", "\r\n")
        for time, data in frames
    )


FORMS: tuple[Callable[[Frames], str], ...] = (
    tshark, details, tcpdump, tcpdump_x, text2pcap, canonical, copied,
)  # fmt: skip


def frame(payload: bytes) -> bytes:
    return LLDP[:14] + payload


def read(text: str | bytes) -> tuple[Frames, str | None]:
    content = text.encode() if isinstance(text, str) else text
    with open_capture(io.BytesIO(content), name="dump") as capture:
        found = [(each.time_ns, each.data) for each in capture.everything()]
        return found, capture.problem


LOOKS_LIKE_BYTES = st.lists(st.sampled_from(b" 0123456789ABCDEFabcdef.|\x00\xff"), max_size=40).map(
    bytes
)
PAYLOADS = st.one_of(st.binary(max_size=40), LOOKS_LIKE_BYTES)
TIMES = st.integers(0, 4 * 10**18)


@pytest.mark.parametrize("form", FORMS)
@given(frames=st.lists(st.tuples(TIMES, PAYLOADS.map(frame)), min_size=1, max_size=5))
def test_what_a_form_prints_is_read_again(
    form: Callable[[Frames], str], frames: list[tuple[int, bytes]]
) -> None:
    assert read(form(frames)) == (frames, None)


REAL = (
    "conversation-error.pcapng", "field/connect-response-in-fragments.pcapng", "field/mlen-then-right.pcap",
    "field/s7-drive.pcap", "profibus/pyprofibus_ppo1.pcapng",
)  # fmt: skip


def frames_of(path: Path) -> list[tuple[int, bytes]]:
    with open_capture(path) as capture:
        return [(each.time_ns, each.data) for each in capture.everything()]


OF_THE_FILE = {"path", "sha256", "dropped", "files"}


def report(source: Path | io.BytesIO) -> dict[str, object]:
    """All that an analysis says, but for what it says of the file itself."""
    result = analyze(source)
    names = {each.name for each in fields(CaptureResult)} - OF_THE_FILE
    return {name: getattr(result, name) for name in names}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", REAL)
def test_a_dump_says_what_its_capture_says(
    name: str, form: Callable[[Frames], str], captures: Path
) -> None:
    text = form(frames_of(captures / name))
    assert report(io.BytesIO(text.encode())) == report(captures / name)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings_and_compression(encoding: str, captures: Path) -> None:
    frames = frames_of(captures / REAL[0])
    text = tshark(frames).replace("→", "->")
    assert read(gzip.compress(text.encode(encoding))) == (frames, None)


def test_a_dump_without_times_has_none() -> None:
    with open_capture(io.BytesIO(rows(LLDP, "{at:04x}  {bytes}").encode())) as capture:
        assert [each.time_ns for each in capture.everything()] == [0]
        assert (capture.timed, capture.first_ns, capture.last_ns) == (False, None, None)


IP = bytes.fromhex("4500001c00000000 4011 f6cd c0000201 c0000202 0001000200080000".replace(" ", ""))


@pytest.mark.parametrize(
    ("data", "link_type"),
    [
        (LLDP, ETHERNET),
        (LLDP[:12] + b"\x08\x00" + IP, ETHERNET),
        (LLDP[:12] + bytes.fromhex("81000001 0800") + IP, ETHERNET),
        (IP, RAW),
        (bytes.fromhex("0000 0001 0006 001c06000001 0000 0800") + IP, SLL),
        (bytes.fromhex("100502495016"), PROFIBUS_DL),
        (bytes.fromhex("6805056885826D3C3EEE16"), PROFIBUS_DL),
    ],
)
def test_the_bytes_tell_the_link_type(data: bytes, link_type: int) -> None:
    with open_capture(io.BytesIO(rows(data, "{at:04x}  {bytes}").encode())) as capture:
        (found,) = capture.everything()
        assert (found.link_type, found.data) == (link_type, data)


def test_a_dump_of_a_serial_port_has_the_frames_in_it() -> None:
    parts = [
        bytes.fromhex(each)
        for each in ("100502495016", "100205000716", "E5", "6805056885826D3C3EEE16")
    ]
    assert read(rows(b"".join(parts), "{at:08x}: {words}")) == ([(0, each) for each in parts], None)


LONG = frame(bytes(range(50)))
ROWS = rows(LONG, "{at:04x}  {bytes}").splitlines()


@pytest.mark.parametrize(
    ("lines", "data", "length", "problem"),
    [
        ([*ROWS[:2], *ROWS[3:]], LONG[:32], 64, "line 3 cannot be read: '0030"),
        (
            [ROWS[0], ROWS[1][:20] + " zz" + ROWS[1][23:], *ROWS[2:]],
            LONG[:21],
            64,
            "line 2 cannot be read: '0010",
        ),
        (["words", *ROWS[1:], *ROWS], LONG, 64, "line 2 cannot be read: '0010"),
        (
            ["Frame 1: 90 bytes on wire (720 bits), 64 bytes captured", *ROWS[:3]],
            LONG[:48],
            90,
            "line 4 cannot",
        ),
        (["Frame 1: 90 bytes on wire (720 bits), 64 bytes captured", *ROWS], LONG, 90, None),
        ([*ROWS[:2], "words", "", *ROWS[2:]], LONG, 64, None),
        (["12ab words", "0000", *ROWS, "1234", "0000 0001 .... = bits"], LONG, 64, None),
    ],
)
def test_a_damaged_dump_keeps_what_could_be_read(
    lines: list[str], data: bytes, length: int, problem: str | None
) -> None:
    text = "\n".join([*lines, *rows(LLDP, "{at:04x}  {bytes}").splitlines()])
    with open_capture(io.BytesIO(text.encode())) as capture:
        found = [(each.data, each.original_length) for each in capture.everything()]
        assert found == [(data, length), (LLDP, len(LLDP))]
        assert (capture.problem or "").startswith(problem or "no problem" * bool(capture.problem))
        assert capture.complete == (problem is None)


@pytest.mark.parametrize(
    "text",
    [
        "0000",
        "0000 ",
        "0000 01 02 03",
        "0000  words",
        "0000: 10 03\n0001: 10 03\n0002: 10 03\n",
        "hello\n" * 99,
    ],
)
def test_what_is_no_dump_of_frames_is_refused(text: str) -> None:
    with pytest.raises(CaptureError, match="it is text, but not a hex dump of frames"):
        open_capture(io.BytesIO(text.encode()))


def test_a_packet_has_an_end() -> None:
    """What is longer than a frame can be takes no more memory, and is told."""
    packets = Packets()
    lines = (f"{at:06x}  {'00 ' * 16}" for at in range(0, 1 << 20, 16))
    assert [len(each.data) for each in [*packets.take(lines), *packets.finish()]] == [1 << 18]
    assert packets.unread.count == (1 << 20) - (1 << 18) >> 4


@given(st.lists(st.text("0123af:x |.\t>=#", max_size=60), max_size=9))
def test_any_text_is_read(lines: list[str]) -> None:
    packets = Packets()
    found = [*packets.take(lines), *packets.finish()]
    assert len(found) + packets.unread.count <= len(lines)


TOOLS = (
    "tshark -t e -P -x -r", "tshark -t ad -P -x -r", "tshark -V -x -r", "tshark -t e -P --hexdump delimit -r",
    "tshark -t e -P --hexdump noascii -r", "tshark -t e -P -V --hexdump frames -r",
    "tcpdump --nano -tt -nn -xx -r", "tcpdump --nano -tttt -nn -e -XX -r", "tcpdump --nano -tt -nn -v -xx -r",
)  # fmt: skip


def dumped(command: str, path: Path) -> bytes:
    program, *options = command.split()
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"no {program}")
    return subprocess.run([found, *options, path], capture_output=True, check=True).stdout


@pytest.mark.parametrize("command", TOOLS)
@pytest.mark.parametrize("name", REAL[:4])
def test_what_the_tools_print_says_what_the_capture_says(
    name: str, command: str, captures: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TZ", "UTC")
    path = captures / name
    assert report(io.BytesIO(dumped(command, path))) == report(path)


@pytest.mark.parametrize("option", ["-x", "-X"])
@pytest.mark.parametrize("name", [REAL[0], REAL[2]])
def test_tcpdump_without_the_link_layer(name: str, option: str, captures: Path) -> None:
    dump = dumped(f"tcpdump --nano -tt -nn {option} -r", captures / name)
    found, expected = analyze(io.BytesIO(dump)), analyze(captures / name)
    with open_capture(io.BytesIO(dump)) as capture:
        assert {each.link_type for each in capture.everything()} == {RAW}
    assert found.problem is None
    assert [each.parameters for each in found.transactions] == [
        each.parameters for each in expected.transactions
    ]
    assert [each.rule for each in found.findings] == [each.rule for each in expected.findings]
