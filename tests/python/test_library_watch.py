"""`ds47.watch`: what happens on a line, one after the other, and nothing that stays when it is over."""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

import ds47
from ds47.library import watching

OPEN = Path("/proc/self/fd")


@pytest.fixture(autouse=True)
def _nothing_stays() -> Iterator[None]:
    """No thread, no descriptor."""
    before = threading.active_count(), list(OPEN.glob("*"))
    yield
    assert threading.active_count() == before[0]
    assert len(list(OPEN.glob("*"))) == len(before[1])


@pytest.fixture
def tour(captures: Path) -> Path:
    return captures / "tour-machine.pcapng"


def test_all_of_a_file_that_is_over(tour: Path) -> None:
    """The same as of the analysis: transactions, and all findings once."""
    seen = list(ds47.watch(tour, follow=False))
    whole = ds47.analyze(tour)
    last = {each.transaction.id: each.transaction for each in seen if each.transaction is not None}
    assert [last[number] for number in sorted(last)] == whole.transactions
    again = [each for each in seen if each.before is not None]
    assert [each.transaction.id for each in again if each.transaction] == [5, 6, 7]
    assert all(each.before != each.transaction for each in again)
    found = [one for each in seen if each.before is None for one in each.findings]
    assert sorted(map(repr, found)) == sorted(map(repr, whole.findings))


def test_a_file_that_grows(tour: Path, tmp_path: Path) -> None:
    """What is there comes at once, what is written behind it then; who has enough closes."""
    data, path = tour.read_bytes(), tmp_path / "grows.pcapng"
    with path.open("wb") as out:
        out.write(data[:1400])
        out.flush()
        line = ds47.watch(str(path), select="DS4")
        first = next(line).transaction
        assert first is not None
        assert first.id == 1
        out.write(data[1400:])
        out.flush()
        numbers = [each.transaction.id for each in islice(line, 6) if each.transaction]
        assert numbers == [2, 3, 5, 4, 6, 7]
        line.close()
    assert list(line) == []


def test_a_loop_that_is_left(tour: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is left behind, however far the analysis is ahead."""
    monkeypatch.setattr(watching, "_AHEAD", 1)
    for each in ds47.watch(tour):
        assert each.transaction is not None
        break


def test_a_line_that_ends_too_early(tour: Path, tmp_path: Path) -> None:
    """All that could be read, then why it was not more."""
    path = tmp_path / "cut.pcapng"
    path.write_bytes(tour.read_bytes()[:-30])
    seen: deque[ds47.Seen] = deque()
    with pytest.raises(ds47.CaptureError, match=r"cut\.pcapng: damaged at byte 8728"):
        seen.extend(ds47.watch(path, follow=False))
    assert len(seen) > 8


@pytest.mark.skipif(sys.platform == "win32", reason="needs named pipes of POSIX")
def test_a_named_pipe(tour: Path, tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_bytes, args=(tour.read_bytes(),))
    writer.start()
    seen = list(ds47.watch(path))
    writer.join()
    assert len({each.transaction.id for each in seen if each.transaction}) == 8


def test_what_cannot_be_watched(tour: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="either a source or interfaces"):
        ds47.watch()
    with pytest.raises(ValueError, match="either a source or interfaces"):
        ds47.watch(tour, interfaces="eth0")
    with pytest.raises(ValueError, match="go with interfaces"):
        ds47.watch(tour, duration=3)
    with pytest.raises(ValueError, match="no rule has the number or name 'DS99x'"):
        ds47.watch(tour, select="DS99x")
    with pytest.raises(ds47.CaptureError, match="cannot be opened: No such file"):
        next(ds47.watch(tmp_path / "none"))
    (tmp_path / "text").write_bytes(b"no capture")
    with pytest.raises(ds47.CaptureError, match="text: not a capture"):
        next(ds47.watch(tmp_path / "text", follow=False))
    with pytest.raises(ds47.Error, match="is not a program that can be run"):
        next(ds47.watch(interfaces="eth0", dumpcap=str(tmp_path / "none")))


@pytest.mark.skipif(sys.platform == "win32", reason="a script is no program there")
def test_what_dumpcap_captures(tour: Path, tmp_path: Path) -> None:
    """A program in its place, which writes a capture and says what it was told."""
    program = tmp_path / "dumpcap"
    program.write_text(
        f"#!{sys.executable}\nimport sys\n"
        f"open({str(tmp_path / 'told')!r}, 'w').write(' '.join(sys.argv[1:]))\n"
        f"sys.stdout.buffer.write(open({str(tour)!r}, 'rb').read())\n"
    )
    program.chmod(0o755)
    seen = list(
        ds47.watch(
            interfaces=["eth0", "eth1"], dumpcap=str(program), capture_filter="udp", duration=2
        )
    )
    assert len({each.transaction.id for each in seen if each.transaction}) == 8
    assert (tmp_path / "told").read_text() == "-q -w - -f udp -i eth0 -i eth1 -a duration:2"
    program.write_text(f"#!{sys.executable}\nimport sys\nsys.exit('dumpcap: no permission')\n")
    with pytest.raises(ds47.Error, match="dumpcap: no permission"):
        next(ds47.watch(interfaces="eth0", dumpcap=str(program)))


def test_a_fault_is_raised_where_somebody_waits(
    tour: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a fault of ds47")

    monkeypatch.setattr(watching.Live, "watch", broken)
    with pytest.raises(RuntimeError, match="a fault of ds47"):
        next(ds47.watch(tour, follow=False))
