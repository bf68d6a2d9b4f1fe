"""Recordings of PROFIBUS as captures: whatever the file is, the same frames (docs/profibus.md 1 and 5)."""

from __future__ import annotations

import gzip
import io
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from test_profibus_calls import GIVEN, READ, WRITE, Talk

from ds47.analysis import analyze
from ds47.batch.captures import captures
from ds47.capture import CaptureError, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.profibus import PROFIBUS_DL, USER0, telegram

MS = 1_000_000
TALK = Talk().ask(WRITE).answer().ask("").answer("5f002f0a").ask(READ).answer("5e002f0a" + GIVEN)
FRAMES = [*TALK.frames, b"\xdc\x02\x02", telegram.encode(3, 2, 0x49), telegram.encode(2, 3, 0)]
NOON = 12 * 3600 * 1000 * MS


def clock(number: int) -> str:
    return f"12:00:{number // 1000:02}.{number % 1000:03}"


def plain(frames: list[bytes]) -> str:
    return "".join(f"{each.hex(' ').upper()}\n" for each in frames)


def stamped(frames: list[bytes]) -> str:
    return "".join(f"{clock(at)} {each.hex()}\r\n" for at, each in enumerate(frames))


def directed(frames: list[bytes]) -> str:
    return "# a comment\n\n" + "".join(
        f"[{at / 1000:.3f}] {'->' if at % 2 == 0 else '<-'} {each.hex(' ')}\n"
        for at, each in enumerate(frames)
    )


def table(frames: list[bytes]) -> str:
    rows = (f"{at};{at * 1000};{each.hex(' ')}\n" for at, each in enumerate(frames))
    return "Index;Time us;Data\n" + "".join(rows)


def joined(frames: list[bytes]) -> str:
    return "".join(f"{b''.join(frames[at : at + 3]).hex()}\n" for at in range(0, len(frames), 3))


TEXTS: dict[str, Callable[[list[bytes]], str]] = {
    "plain": plain, "stamped": stamped, "directed": directed, "table": table, "joined": joined,
}  # fmt: skip
BEGINS = {"stamped": NOON, "directed": 0, "table": 0}
"""The first time of those that have times."""


def pcap(frames: list[bytes], link_type: int, base: int = 0) -> bytes:
    stream = io.BytesIO()
    with PcapngWriter(stream, link_type=link_type) as writer:
        for number, data in enumerate(frames):
            writer.write(base + number * MS, data)
    return stream.getvalue()


def read(content: bytes) -> list[bytes]:
    with open_capture(io.BytesIO(content), name="log") as capture:
        return [frame.data for frame in capture]


@pytest.mark.parametrize("link_type", [PROFIBUS_DL, USER0])
def test_captures(link_type: int) -> None:
    assert read(pcap(FRAMES, link_type)) == FRAMES


@pytest.mark.parametrize("shape", TEXTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_logs(shape: str, encoding: str) -> None:
    content = TEXTS[shape](FRAMES).encode(encoding)
    assert read(content) == FRAMES
    assert read(gzip.compress(content)) == FRAMES


@pytest.mark.parametrize("shape", TEXTS)
def test_a_log_says_what_its_capture_says(shape: str) -> None:
    base = BEGINS.get(shape)
    log = analyze(io.BytesIO(TEXTS[shape](FRAMES).encode()))
    capture = analyze(io.BytesIO(pcap(FRAMES, PROFIBUS_DL, base or 0)))
    (here,), (there,) = log.transactions, capture.transactions
    if base is None:
        assert (log.start_ns, here.duration_ns) == (None, None)
        there.start_ns, there.duration_ns = 0, None
    assert here == there
    assert log.complete


def test_bytes_of_a_serial_port() -> None:
    dump = b"\x16\x00" + b"".join(FRAMES)
    with open_capture(io.BytesIO(dump)) as capture:
        assert [frame.data for frame in capture if frame.data in FRAMES] == FRAMES
        assert not capture.timed
    (found,) = analyze(io.BytesIO(dump)).transactions
    assert (found.state, found.duration_ns) == ("ok", None)


def test_everything_is_what_is_read() -> None:
    for content in (stamped(FRAMES).encode(), b"".join(FRAMES)):
        with open_capture(io.BytesIO(content)) as one, open_capture(io.BytesIO(content)) as other:
            frames = [(each.number, each.time_ns, each.data) for each in one]
            whole = list(other.everything(lambda number: number % 2 == 0))
        assert [(each.number, each.time_ns, each.data) for each in whole] == frames[1::2]
        assert {each.interface.link_type for each in whole} == {PROFIBUS_DL}


def test_what_cannot_be_read_is_told_with_its_line() -> None:
    """Words are not told: nothing is lost with them."""
    lines = stamped(FRAMES).splitlines()
    lines[2:2] = ["hello", "68 0g", "68 xx"]
    result = analyze(io.BytesIO("\n".join(lines).encode()))
    assert len(result.transactions) == 1
    assert result.problem == "line 4 cannot be read: '68 0g'; nor can line 5"
    assert not result.complete


def test_many_lines_that_cannot_be_read() -> None:
    text = plain(FRAMES) + "E5 ?? 10\n" * 1000
    problem = analyze(io.BytesIO(text.encode())).problem
    first = len(FRAMES) + 1
    others = ", ".join(str(first + at) for at in range(1, 5))
    assert (
        problem == f"line {first} cannot be read: 'E5 ?? 10'; nor can lines {others} and 995 more"
    )


@pytest.mark.parametrize(
    "content",
    [b"", b"hello", b"# ds47\n\nsome text 12\n" * 50, b"e5\nE5\n", b"dc0202\n" * 9, bytes(9999),
     "日本語".encode() * 99, b"\xff\xfe\x00", b"10 03 02\n", telegram.encode(3, 2, 0x49)],
)  # fmt: skip
def test_what_is_no_recording_is_refused(content: bytes) -> None:
    with pytest.raises(CaptureError):
        open_capture(io.BytesIO(content))


def test_other_bytes_by_chance_are_refused() -> None:
    chance = random.Random(47)
    for _ in range(50):
        with pytest.raises(CaptureError):
            open_capture(io.BytesIO(chance.randbytes(5000)))


def test_a_long_line_is_read_in_parts() -> None:
    text = plain(FRAMES) + "x" * 3_000_000 + "\n" + plain(FRAMES)
    with open_capture(io.BytesIO(text.encode())) as capture:
        assert [frame.data for frame in capture] == FRAMES * 2


def test_a_log_that_is_cut_off_keeps_what_was_read() -> None:
    content = gzip.compress(plain(FRAMES * 50).encode(), 1)
    result = analyze(io.BytesIO(content[: len(content) - 40]))
    assert not result.complete
    assert result.transactions


def test_one_wrong_byte_costs_the_frames_it_touches() -> None:
    chance, dump = random.Random(47), b"".join(FRAMES * 3)
    starts = [sum(map(len, (FRAMES * 3)[:at])) for at in range(len(FRAMES) * 3 + 1)]
    for _ in range(300):
        at = chance.randrange(len(dump))
        wrong = dump[:at] + bytes((dump[at] ^ chance.randrange(1, 256),)) + dump[at + 1 :]
        touched = next(number for number, start in enumerate(starts[1:]) if at < start)
        others = (FRAMES * 3)[:touched] + (FRAMES * 3)[touched + 1 :]
        found = read(wrong)
        missing = len(others) - _common(found, others)
        assert missing == 0, (at, wrong[at])


def _common(found: list[bytes], expected: list[bytes]) -> int:
    """How many of the expected ones are among what was found, in their order."""
    rest = iter(found)
    return sum(any(each == one for one in rest) for each in expected)


def test_a_folder_has_captures_alone(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text(plain(FRAMES))
    (tmp_path / "bus.pcapng").write_bytes(pcap(FRAMES, PROFIBUS_DL))
    found = list(captures([str(tmp_path)], pytest.fail))
    assert [Path(each).name for each in found] == ["bus.pcapng"]
