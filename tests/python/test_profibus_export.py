"""Frames of PROFIBUS as a capture of their own: whole services, with their polls, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_profibus_calls import GIVEN, READ, WRITE, Talk
from test_profibus_reading import stamped

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.profibus import PROFIBUS_DL, USER0


def transaction(station: int) -> list[bytes]:
    """A read with two polls: of the write, and of the record that is not ready."""
    talk = Talk(station).ask(WRITE).answer().ask("").answer("5f002f0a")
    talk.ask(READ).answer("de80b500").ask(READ).answer().ask("").answer("5e002f0a" + GIVEN)
    return talk.frames


FRAMES = [*transaction(3), b"\xdc\x02\x02", *transaction(4), *transaction(3)]
LENGTH = len(transaction(3))


@pytest.fixture
def bus(tmp_path: Path) -> Path:
    path = tmp_path / "bus.pcapng"
    with PcapngWriter(path, link_type=PROFIBUS_DL) as writer:
        for number, data in enumerate(FRAMES):
            writer.write(number * 1_000_000, data)
    return path


def exported(source: Path, *options: str) -> tuple[list[bytes], set[int]]:
    """The frames that `ds47 export` writes, and their link types."""
    target = source.with_name("exported.pcapng")
    assert main(["export", str(source), "-o", str(target), "--force", *options]) == 0
    with open_capture(target) as capture:
        frames = list(capture.everything())
    return [each.data for each in frames], {each.link_type for each in frames}


def test_without_criteria_all_frames_are_there(bus: Path) -> None:
    assert exported(bus) == (FRAMES, {PROFIBUS_DL})


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_transaction_is_whole(bus: Path, number: int) -> None:
    first = (number - 1) * LENGTH + (number > 1)
    frames, _ = exported(bus, "-t", str(number))
    assert frames == FRAMES[first : first + LENGTH]


@pytest.mark.parametrize(("device", "count"), [("dp3", 2), ("dp4", 1)])
def test_a_station(bus: Path, device: str, count: int) -> None:
    frames, _ = exported(bus, "-d", device)
    assert frames == transaction(int(device[2:])) * count
    found = analyze(bus.with_name("exported.pcapng")).transactions
    assert [(each.device, each.state) for each in found] == [(device, "ok")] * count


def test_a_station_that_is_not_there(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(bus), "-d", "dp5", "-o", str(bus.with_name("x.pcapng"))]) == 2
    assert "no device 'dp5'; there are dp3, dp4" in capsys.readouterr().err


def test_a_time_span(bus: Path) -> None:
    frames, _ = exported(bus, "--from", "0.003", "--to", "0.006")
    assert frames == FRAMES[3:7]


@pytest.mark.parametrize(("link", "number"), [("profibus", PROFIBUS_DL), ("user0", USER0)])
def test_a_log_becomes_a_capture(tmp_path: Path, link: str, number: int) -> None:
    log = tmp_path / "log.txt"
    log.write_text(stamped(FRAMES), encoding="utf-8")
    assert exported(log, "--link", link) == (FRAMES, {number})
    there, here = analyze(log), analyze(tmp_path / "exported.pcapng")
    assert there.transactions == here.transactions


def test_nothing_is_anonymised(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = bus.with_name("x.pcapng")
    assert main(["export", str(bus), "--anonymise", "-o", str(target)]) == 2
    assert "frames of PROFIBUS cannot be anonymised" in capsys.readouterr().err
    assert not target.exists()
