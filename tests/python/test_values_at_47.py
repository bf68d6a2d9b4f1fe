"""Devices that are no drives and keep values at index 47: nothing is judged, on PROFINET and PROFIBUS.

What proves that index 47 is the parameter channel is in `test_conversations.py` (P20).
"""

from __future__ import annotations

import io
import json
import random
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab import fdl, message
from ds47.lab.client import Client
from ds47.lab.master import Master, Way
from ds47.lab.stage import Stage
from ds47.live.show import NdjsonShow
from ds47.live.traffic import Live

MANY = 10_000
SEQUENCE = struct.Struct("<I")
Values = Callable[[random.Random], Iterator[tuple[bytes, bytes]]]
"""What is written, and what is read then, again and again."""


def position(chance: random.Random) -> Iterator[tuple[bytes, bytes]]:
    """One that moves to where it was sent: most of what is read begins as a response does."""
    now = 0
    while True:
        goal = chance.randrange(-0x30000, 0x30000)
        now += (goal - now) // 2
        yield goal.to_bytes(4, signed=True), now.to_bytes(4, signed=True)


def float32(chance: random.Random) -> Iterator[tuple[bytes, bytes]]:
    """A float that is read back as it was written, or nearly."""
    while True:
        value = chance.choice((0.51, 2.03, 8.13, 8.15, 32.6)) * chance.choice((1, 1, 1.001))
        yield struct.pack(">f", value), struct.pack(">f", value + chance.choice((0, 0.001)))


def store(chance: random.Random) -> Iterator[tuple[bytes, bytes]]:
    """Whatever was written, of any length, behind what may be the header of a request."""
    while True:
        begin = bytes((chance.randrange(1, 256), chance.choice((1, 2)), 1, chance.randrange(4)))
        data = begin + bytes((0x11,)) + chance.randbytes(chance.randrange(40))
        yield data, data


def questions(chance: random.Random) -> Iterator[tuple[bytes, bytes]]:
    """Whatever was written, and each is a request by itself."""
    while True:
        pnu, subindex = chance.randrange(1, 1 << 16), chance.randrange(1 << 16)
        axis, kind = chance.randrange(256), chance.choice((0x10, 0x20, 0x30))
        data = struct.pack(">6B2H", chance.randrange(1, 256), 1, axis, 1, kind, 1, pnu, subindex)
        yield data, data + bytes(chance.choice((0, 6)))


def on_profinet(values: Iterator[tuple[bytes, bytes]], count: int) -> bytes:
    """The same 250 values again and again, each call with a number of its own."""
    client = Client(Stage())
    for _, (written, there) in zip(range(min(count, 250)), values, strict=False):
        client.exchange(written, there)
    stage = client.stage
    once, shots = client.sequence, list(stage.shots)
    stage.shots.clear()
    for turn in range(0, count, 250):
        for shot in shots:
            stage.now_ns += 1_000_000
            data = bytearray(shot.data)
            (number,) = SEQUENCE.unpack_from(data, 106)
            SEQUENCE.pack_into(data, 106, number + turn // 250 * once)
            data[18:20] = (len(stage.shots) & 0xFFFF).to_bytes(2)
            stage.shots.append(replace(shot, data=bytes(data), time_ns=stage.now_ns))
    return recorded(stage, 1)


def on_profibus(values: Iterator[tuple[bytes, bytes]], count: int) -> bytes:
    master = Master()
    master.start(8)
    for _, (written, there) in zip(range(count), values, strict=False):
        master.write(Way(8), written)
        master.read(Way(8), there)
    return recorded(master.stage, fdl.PROFIBUS_DL)


def recorded(stage: Stage, link: int) -> bytes:
    file = io.BytesIO()
    with PcapngWriter(file, link_type=link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data)
    return file.getvalue()


KINDS = pytest.mark.parametrize(
    "values", [position, float32, store, questions], ids=lambda kind: kind.__name__
)
LINES = pytest.mark.parametrize("line", [on_profinet, on_profibus], ids=lambda on: on.__name__)
Line = Callable[[Iterator[tuple[bytes, bytes]], int], bytes]


@pytest.mark.slow
@KINDS
@LINES
def test_there_is_nothing_to_judge(
    line: Line, values: Values, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "values.pcapng"
    path.write_bytes(line(values(random.Random(47)), MANY))
    assert main(["report", str(path)]) == 0
    told = capsys.readouterr().out
    assert re.search(r"^EMPTY: .*, no parameter transaction$", told, re.MULTILINE)
    assert told.count("DS209 note record-unproven: 1 finding") == 1
    assert main(["report", "-f", "ndjson", str(path)]) == 0
    (line,) = map(json.loads, capsys.readouterr().out.splitlines())
    (finding,) = line["capture"]["findings"]
    assert (finding["rule"], finding["args"]["count"]) == ("DS209", 2 * MANY)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_plugin_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [
        Source(f"{line.__name__} {values.__name__}", line(values(random.Random(7)), 300), False)
        for line in (on_profinet, on_profibus)
        for values in (position, float32, store, questions)
    ]
    compare(version, "en", sources, tmp_path)


def asked(pnu: int) -> bytes:
    return message.read(pnu % 256, 1, message.address(pnu))


def written_thrice(write: Callable[[bytes], object], read: Callable[[bytes], object]) -> None:
    """Twice before the first Read, and once behind it."""
    write(asked(21))
    write(asked(22))
    read(asked(22))
    write(asked(25))


def echo_on_profinet() -> bytes:
    client = Client(Stage())
    written_thrice(client.write, client.read)
    return recorded(client.stage, 1)


def echo_on_profibus() -> bytes:
    master = Master()
    master.start(8)
    written_thrice(lambda data: master.write(Way(8), data), lambda data: master.read(Way(8), data))
    return recorded(master.stage, fdl.PROFIBUS_DL)


def watched(capture: bytes) -> list[dict[str, object]]:
    out = io.StringIO()
    show = NdjsonShow(out, "x", io.StringIO())
    with open_capture(io.BytesIO(capture)) as opened:
        show.end(Live(AnalysisOptions(), show).watch(opened))
    return [json.loads(line) for line in out.getvalue().splitlines()]


@pytest.mark.parametrize("capture", [echo_on_profinet, echo_on_profibus])
def test_who_watches_hears_of_no_store(capture: Callable[[], bytes]) -> None:
    """Nor is a transaction handed out that a later Read shows to be none."""
    handed_out: list[object] = []
    analyze(io.BytesIO(capture()), on_transaction=lambda *told: handed_out.append(told))
    assert not handed_out
    lines = watched(capture())
    assert not [line for line in lines if "transaction" in line]
    found = [line["finding"] for line in lines if "finding" in line]
    assert [each["rule"] for each in found] == ["DS209"]  # type: ignore[index]


def test_who_watches_a_drive_hears_in_time() -> None:
    """Of a refusal at once; of Writes whose responses nobody reads each a while later."""
    client = Client(Stage())
    client.write(asked(21))
    client.write(asked(22))
    client.write(asked(23), status=0xDF80B500)
    for pnu in range(24, 28):
        client.wait(6_000)
        client.write(asked(pnu))
    lines = watched(recorded(client.stage, 1))
    told = [
        line["transaction"]["frames"]["write_request"] for line in lines if "transaction" in line
    ]  # type: ignore[index]
    assert told[0] == 5
    assert sorted(set(told)) == [1, 3, 5, 7, 9, 11, 13]
    result = analyze(io.BytesIO(recorded(client.stage, 1)))
    assert len(result.transactions) == 7


def test_one_pair_that_fits_is_enough_however_much_is_malformed_behind_it() -> None:
    """A program whose LEN is too small for all but one request is told so."""
    client = Client(Stage())
    client.exchange(asked(21), message.answer(21, 1, 1, message.real(1.0)))
    for _ in range(40):
        client.exchange(message.read(22, 1, message.address(22), message.address(23))[:9], b"")
    result = analyze(io.BytesIO(recorded(client.stage, 1)))
    assert (len(result.transactions), result.transactions[0].state) == (41, "ok")
    told = [each.transaction for each in result.findings if each.rule == "DS711"]
    assert told == list(range(2, 41))  # what becomes of the last one nobody knows
    assert "DS209" not in {each.rule for each in result.findings}
