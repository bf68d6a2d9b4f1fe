"""Reading ahead in a thread: the same frames, numbers and problems, and no thread left when it is over."""

from __future__ import annotations

import _thread
import gc
import gzip
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import frames as make
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ds47.capture import Capture, Frame, ahead, open_capture, pcap, pcapng, stream
from ds47.capture.series import Series, SeriesPart

CALL = make.call()
LONG = make.ethernet(0x0800, make.ipv4(make.udp(make.rpc(body=bytes(1400)))))
Read = tuple[list[Frame], int, str | None, bool, int | None]

frame = st.sampled_from((make.RT, make.RT, make.RT_TAGGED, make.DNS, make.DCP, CALL, LONG))
traffic = st.lists(frame, max_size=40)
chunks = st.sampled_from((64, 100, 700, 5000))


@pytest.fixture(params=["plain", "compiled"])
def threads(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, plain_scan: ModuleType
) -> Iterator[list[int]]:
    """Every file is read ahead, by the compiled scan or by the same lines in plain Python.

    Gives a list that gets the file descriptor of each thread.
    """
    scan = plain_scan if request.param == "plain" else request.getfixturevalue("compiled_scan")
    if request.param == "plain":
        monkeypatch.setattr(scan, "_read", _read, raising=False)
        monkeypatch.setattr(scan, "_unlocked", lambda it, *rest: it._ahead(*rest), raising=False)
        monkeypatch.setattr(scan, "_FIRST_AHEAD", 2)
        monkeypatch.setattr(scan, "_AHEAD", 5)
        monkeypatch.setattr(scan, "_FAR", 2000)
    monkeypatch.setattr(pcap, "PcapScan", scan.PcapScan)
    monkeypatch.setattr(pcapng, "PcapngScan", scan.PcapngScan)
    monkeypatch.setattr(ahead, "COMPILED", True)
    monkeypatch.setattr(ahead, "FROM", 0)
    begun: list[int] = []
    init = ahead._Thread.__init__

    def counted(self: Any, scan: Any, window: Any, descriptor: int) -> None:
        begun.append(descriptor)
        init(self, scan, window, descriptor)

    monkeypatch.setattr(ahead._Thread, "__init__", counted)
    yield begun
    assert reading() == 0


def reading() -> int:
    """How many threads read ahead; those of other tests (a cluster's) do not count."""
    return sum(thread.name == ahead.NAME for thread in threading.enumerate())


def _read(descriptor: int, data: bytearray, at: int, most: int) -> int:
    """What is C in scan.pxd."""
    try:
        piece = os.read(descriptor, most)
    except OSError:
        return -1
    data[at : at + len(piece)] = piece
    return len(piece)


def read(source: Path | io.BytesIO) -> Read:
    with open_capture(source) as capture:
        found = list(capture)
    return found, capture.frames, capture.problem, capture.complete, capture.dropped


def alike(data: bytes, path: Path, chunk: int) -> int:
    """The same with a thread as without one, as no file object of memory has one; how many frames there are."""
    path.write_bytes(data)
    before = stream.CHUNK
    stream.CHUNK = chunk
    try:
        with_one = read(path)
        assert with_one == read(io.BytesIO(data))
        return with_one[1]
    finally:
        stream.CHUNK = before


many = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def damaged(data: bytes, draw: Callable[[st.SearchStrategy[int]], int]) -> bytes:
    """Sometimes with a byte overwritten behind the file header, or cut off."""
    result = bytearray(data)
    if len(data) > 60 and draw(st.integers(0, 2)) == 0:
        result[draw(st.integers(60, len(data) - 1))] = draw(st.integers(0, 255))
    if draw(st.integers(0, 2)) == 0:
        del result[draw(st.integers(min(60, len(data)), len(data))) :]
    return bytes(result)


@pytest.mark.slow
@many
@given(traffic, st.sampled_from("<>"), st.sampled_from((0xA1B2C3D4, 0xA1B2CD34)), chunks, st.data())
def test_pcap(
    threads: list[int], tmp_path: Path, frames: list[bytes], order: str, magic: int, chunk: int,
    more: st.DataObject,
) -> None:  # fmt: skip
    data = make.pcap(frames, order=order, magic=magic)
    before = len(threads)
    alike(damaged(data, more.draw), tmp_path / "x.pcap", chunk)
    assert len(threads) > before


@many
@given(st.lists(st.one_of(frame, st.integers(0, 4)), max_size=40), chunks, st.data())
def test_pcapng(
    threads: list[int], tmp_path: Path, parts: list[bytes | int], chunk: int, more: st.DataObject
) -> None:
    """Frames with other blocks in between: lines that are no frames, counters, new interfaces and sections."""
    others = (
        make.block(0x0BAD, bytes(8)),
        make.block(5, bytes(12) + make.option(5, (7).to_bytes(8, "little"))),
        make.interface(link_type=101),
        make.section(">") + make.interface(">") + make.enhanced(CALL, ">"),
        make.section() + make.interface(),
    )
    blocks = (
        make.enhanced(part, stamp=n) if isinstance(part, bytes) else others[part]
        for n, part in enumerate(parts)
    )
    data = make.section() + make.interface() + b"".join(blocks)
    before = len(threads)
    count = alike(damaged(data, more.draw), tmp_path / "x.pcapng", chunk)
    assert (len(threads) > before) == (count > 0)  # behind the first frame, which is read by itself


def test_a_frame_longer_than_the_buffer(threads: list[int], tmp_path: Path) -> None:
    frames = [CALL, make.ethernet(0x0800, make.ipv4(make.udp(make.rpc(body=bytes(60_000))))), CALL]
    alike(make.pcap(frames), tmp_path / "x.pcap", 5000)
    assert threads


def test_more_than_fits_into_the_batches(threads: list[int], tmp_path: Path) -> None:
    frames = [CALL, make.RT] * 9000
    alike(make.pcap(frames), tmp_path / "x.pcap", stream.CHUNK)
    assert len(threads) == 1


def large(path: Path, calls: int = 100_000) -> Path:
    """A capture of which the batches hold only a part."""
    path.write_bytes(make.pcap([CALL] * 100) + make.pcap([CALL] * 1000)[24:] * (calls // 1000))
    return path


@pytest.fixture
def capture(threads: list[int], tmp_path: Path) -> Capture:
    """A capture of which the first frame was taken, so that its thread runs."""
    opened = open_capture(large(tmp_path / "x.pcap"))
    assert next(iter(opened)).number == 1
    assert len(threads) == 1
    return opened


def test_it_is_only_a_little_ahead(capture: Capture, threads: list[int]) -> None:
    places = [-1, 0]
    while places[-1] != places[-2]:  # until it stands still
        time.sleep(0.05)
        places.append(os.lseek(threads[0], 0, os.SEEK_CUR))
    assert places[-1] < 9 << 20 < os.fstat(threads[0]).st_size
    capture.close()


def test_who_closes_early_ends_the_thread(capture: Capture) -> None:
    capture.close()
    assert reading() == 0
    rest = list(capture)  # what was found is there, then the file is not
    assert [each.number for each in rest] == list(range(2, len(rest) + 2))
    assert capture.problem is not None
    assert capture.problem.startswith("reading failed: I/O operation on closed file")
    assert not capture.complete


@pytest.mark.slow
def test_who_forgets_it_ends_the_thread(threads: list[int], tmp_path: Path) -> None:
    opened = open_capture(large(tmp_path / "x.pcap"))
    next(iter(opened))
    assert reading() == 1
    del opened
    deadline = time.monotonic() + 5
    while reading() > 0 and time.monotonic() < deadline:
        gc.collect()  # which does nothing while the thread itself is at it
        time.sleep(0.01)
    assert reading() == 0
    assert threads


@pytest.mark.parametrize("problem", [ZeroDivisionError, KeyboardInterrupt])
def test_an_error_of_who_takes_the_frames(capture: Capture, problem: type[BaseException]) -> None:
    def take() -> None:
        with capture:
            for each in capture:
                if each.number == 700:
                    raise problem

    with pytest.raises(problem):
        take()
    assert reading() == 0


def test_an_error_in_the_thread(
    threads: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Scan(pcap.PcapScan):
        def ahead(self, *_: Any) -> Any:
            raise MemoryError("no room")

    monkeypatch.setattr(pcap, "PcapScan", Scan)
    with pytest.raises(MemoryError, match="no room"):
        read(large(tmp_path / "x.pcap", 1000))
    assert len(threads) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="a lock cannot be interrupted there")
def test_ctrl_c_while_waiting_for_the_disk(
    threads: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = threading.Event()

    class Scan(pcap.PcapScan):
        def ahead(self, *rest: Any) -> Any:
            disk.wait()
            return super().ahead(*rest)

    monkeypatch.setattr(pcap, "PcapScan", Scan)
    timers = [threading.Timer(0.1, _thread.interrupt_main), threading.Timer(0.3, disk.set)]
    for timer in timers:
        timer.start()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(KeyboardInterrupt):
        read(large(tmp_path / "x.pcap", 1000))
    for timer in timers:
        timer.join()
    assert threads


@pytest.mark.skipif(sys.platform == "win32", reason="a folder is no file there")
def test_a_file_that_cannot_be_read_on(
    capture: Capture, threads: list[int], tmp_path: Path
) -> None:
    folder = os.open(tmp_path, os.O_RDONLY)
    os.dup2(folder, threads[0])
    os.close(folder)
    with capture:
        numbers = [each.number for each in capture]
    assert numbers == list(range(2, len(numbers) + 2))
    assert capture.problem is not None
    assert capture.problem.startswith("reading failed: [Errno")


@pytest.mark.slow
def test_a_file_that_is_cut_meanwhile(capture: Capture, tmp_path: Path) -> None:
    os.truncate(tmp_path / "x.pcap", 12 << 20)
    with capture:
        assert [each.number for each in capture] == list(range(2, capture.frames + 1))
    assert capture.problem is not None
    assert capture.problem.startswith("cut off at byte ")


def test_a_series_has_one_thread_at_a_time(threads: list[int], tmp_path: Path) -> None:
    names = [str(large(tmp_path / f"{number}.pcap", 2000)) for number in range(3)]
    with Series([SeriesPart(name, name) for name in names]) as series:
        for number, _ in enumerate(series):
            assert reading() <= 1, number
    assert series.frames == 3 * 2100
    assert len(threads) == 3


def test_what_has_no_thread(
    threads: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = large(tmp_path / "x.pcap", 1000)
    packed = tmp_path / "x.pcap.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    with path.open("rb") as buffered:
        for source in (packed, buffered, io.BytesIO(path.read_bytes())):
            assert len(read(source)[0]) == 1100  # type: ignore[arg-type]
    monkeypatch.setattr(ahead, "FROM", path.stat().st_size)
    assert len(read(path)[0]) == 1100
    assert not threads


def test_a_file_with_much_in_between_soon_has_none(
    threads: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = make.enhanced(CALL) + make.block(0x0BAD, bytes(8))
    path = tmp_path / "x.pcapng"
    path.write_bytes(make.section() + make.interface() + part * 1000)
    monkeypatch.setattr(ahead, "FROM", 20_000)
    monkeypatch.setattr(stream, "CHUNK", 1000)
    assert read(path)[1] == 2000
    assert 1 <= len(threads) <= path.stat().st_size // 20_000
