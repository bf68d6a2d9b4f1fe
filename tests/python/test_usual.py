"""The short way of usual transactions and their lines: the report is that of the long way, whatever comes.

Each capture is analysed twice, and the second time `UsualWay` takes nothing and no line is written early.
"""

from __future__ import annotations

import io
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import UUID

import pytest
import troubles
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47 import usual
from ds47.analysis import Analysis, AnalysisOptions, analyze
from ds47.capture import Frame, open_capture
from ds47.capture.errors import CaptureError
from ds47.capture.writer import PcapngWriter
from ds47.lab import message, wire
from ds47.lab.client import Client, drive
from ds47.lab.stage import Stage
from ds47.lab.wire import Channel
from ds47.model import Report
from ds47.profinet import rpc
from ds47.profinet.headers import Headers, conversation_key, datagram_key
from ds47.report import json, lines, ndjson
from ds47.report.lines import JsonLines
from ds47.usual import UsualWay

Shots = Sequence[tuple[int, bytes]]


def reports(source: Any, options: AnalysisOptions | None = None) -> tuple[str, str]:
    """JSON with lines and ndjson, the usual way."""
    options = options or AnalysisOptions()
    whole, streamed = io.StringIO(), io.StringIO()
    try:
        result = analyze(source(), options, lines=JsonLines(options.codec))
        assert not result.transactions
        json.write(Report([replace(result, path="x")]), whole)
        writer = ndjson.Writer(streamed)
        result = analyze(
            source(), options, lambda t, findings: writer.transaction("x", t, findings)
        )
        writer.capture(replace(result, path="x"))
    except CaptureError as problem:
        return str(problem), ""
    return whole.getvalue(), streamed.getvalue()


def careful(source: Any, options: AnalysisOptions | None = None) -> tuple[str, str]:
    """The same two, the long way."""
    options = options or AnalysisOptions()
    whole, streamed = io.StringIO(), io.StringIO()
    with patch.object(UsualWay, "take", lambda *_: False):
        try:
            json.write(Report([replace(analyze(source(), options), path="x")]), whole)
            writer = ndjson.Writer(streamed)
            result = analyze(
                source(), options, lambda t, findings: writer.transaction("x", t, findings)
            )
            writer.capture(replace(result, path="x"))
        except CaptureError as problem:
            return str(problem), ""
    return whole.getvalue(), streamed.getvalue()


def assert_same(source: Any, options: AnalysisOptions | None = None) -> None:
    assert reports(source, options) == careful(source, options)


def written(shots: Shots, folder: Path) -> Path:
    path = folder / "shots.pcapng"
    with PcapngWriter(path) as file:
        for time_ns, data in shots:
            file.write(time_ns, data)
    return path


def plant(rounds: int, devices: int = 3, seed: int = 47) -> list[tuple[int, bytes]]:
    """Usual transactions of some devices at once: reads of several kinds, changes, errors, reads back."""
    chance, stage = random.Random(seed), Stage()
    clients = [
        Client(
            stage, device=drive(number + 1), activity=UUID(int=4711 << 64 | number),
            channel=Channel(UUID(int=47 << 64 | number), index=(47, 0xB02E)[number % 2]),
        )
        for number in range(devices)
    ]  # fmt: skip
    for number in range(rounds):
        reference = number % 255 + 1
        asked = []
        for client in clients:
            kind = chance.choice(("one", "one", "two", "change", "error", "text"))
            first = message.address(chance.choice((21, 1120, 2)))
            real, word = message.real(float(chance.randrange(4))), message.word(chance.randrange(9))
            if kind == "change":
                request = message.change(reference, 1, (message.address(1120), real))
                answer = message.changed(reference, 1, 1)
            else:
                values = {"one": [real], "two": [word, real], "error": [message.error(0x11)],
                          "text": [message.block(0x09, "3s", b"abc")]}[kind]  # fmt: skip
                places = [first] if len(values) == 1 else [first, message.address(964, 0, 1)]
                request = message.read(reference, 1, *places)
                answer = message.answer(reference, 0x81 if kind == "error" else 1, 1, *values)
            asked.append((client, request, answer))
        calls = [client.ask_write(request) for client, request, _ in asked]
        for (client, request, _), call in zip(asked, calls, strict=True):
            client.accept_write(call, request)
        calls = [client.ask_read() for client, _, _ in asked]
        for (client, _, answer), call in zip(asked, calls, strict=True):
            client.accept_read(call, answer)
    return [(shot.time_ns, shot.data) for shot in stage.shots]


PLANT = plant(12)


@pytest.fixture(scope="session")
def stored(captures: Path, repository: Path) -> list[Path]:
    shared = repository.parent / "shared" / "captures"
    folders = [captures, *([shared] if shared.is_dir() else [])]
    return sorted(path for folder in folders for path in folder.rglob("*.pcap*"))


def frames_of(path: Path) -> list[Frame]:
    try:
        with open_capture(path) as capture:
            return [frame for frame in capture if frame.link_type == 1]
    except CaptureError:
        return []


def test_stored_captures(stored: list[Path]) -> None:
    assert len(stored) > 50
    for path in stored:
        assert_same(lambda path=path: str(path))


def test_damaged_captures(stored: list[Path], tmp_path: Path) -> None:
    chance = random.Random(4711)
    for path in stored:
        data = bytearray(path.read_bytes())
        for _ in range(8):
            data[chance.randrange(min(200, len(data) - 1), len(data))] = chance.randrange(256)
        target = tmp_path / path.name
        target.write_bytes(data)
        assert_same(lambda target=target: str(target))


def test_all_captures_in_one(stored: list[Path], tmp_path: Path) -> None:
    """One after the other, and all at once; every conversation in the memory of the others."""
    shots = [(frame.time_ns, frame.data) for path in stored for frame in frames_of(path)]
    assert len(shots) > 1000
    path = written(shots, tmp_path)
    assert_same(lambda: str(path))
    path = written(sorted(shots), tmp_path)
    assert_same(lambda: str(path))


@pytest.mark.parametrize(
    "options",
    [
        AnalysisOptions(),
        AnalysisOptions(lang="zh", slow_ms=0.5),
        AnalysisOptions(ignore=("DS4",), indices=frozenset({0xB02D})),
    ],
)
def test_a_plant(options: AnalysisOptions, tmp_path: Path) -> None:
    path = written(plant(60), tmp_path)
    assert_same(lambda: str(path), options)


def implicit(client: Client, record: bytes) -> None:
    """A ReadImplicit brings a record."""
    nowhere = client.at(ar=wire.NIL)
    call = client.call(wire.READ_IMPLICIT)
    client.ask(call, wire.read_request(call.sequence, nowhere))
    client.accept_read(call, record, at=nowhere)


def test_a_read_without_an_ar_between_usual_jobs(tmp_path: Path) -> None:
    """Its bytes are those of the last response of the place, of whichever AR that was."""
    stage = Stage()
    clients = [
        Client(stage),
        Client(stage, activity=UUID(int=0x48), channel=Channel(UUID(int=0x48 << 64))),
    ]
    answers = []
    for number in range(60):
        client, reference = clients[number // 3 % 2], number % 255 + 1
        answers.append(message.answer(reference, 1, 1, message.real(float(number % 7))))
        client.exchange(message.read(reference, 1, message.address(21)), answers[-1])
        if number % 4 == 3:
            implicit(clients[number % 2], answers[-1 - number % 3])
    path = written([(shot.time_ns, shot.data) for shot in stage.shots], tmp_path)
    assert_same(lambda: path)
    rereads = [each for each in analyze(path).transactions if each.frames.rereads]
    assert len(rereads) == 5


def test_the_usual_way_is_taken(tmp_path: Path) -> None:
    """Or nothing here is tested."""
    path, taken, written_early = written(PLANT, tmp_path), [], []
    take, line = UsualWay.take, JsonLines.usual
    with (
        patch.object(
            UsualWay, "take", lambda way, frame: taken.append(take(way, frame)) or taken[-1]
        ),
        patch.object(
            JsonLines, "usual", lambda each, job: written_early.append(job) or line(each, job)
        ),
    ):
        analyze(str(path), lines=JsonLines(AnalysisOptions().codec))
    assert sum(taken) > 0.7 * len(PLANT)
    assert written_early


TELLING = (
    *range(12, 24),
    43,
    44,
    46,
    *range(106, 130),
    142,
    143,
    *range(166, 190),
    *range(206, 220),
)
"""Bytes that say something: of the IP and RPC headers, the status, the record block and the message."""
GAPS = (0, 59, 61, 599, 601, 1300, -61, -3600)
"""Seconds: calls are given up after 60, channels after 600. Where they are negative the clock is set back."""
AT = st.integers(0, len(PLANT) - 1)
CHANGES = st.lists(
    st.one_of(
        st.tuples(st.just("drop"), AT, st.integers(1, 3)),
        st.tuples(st.just("again"), AT, st.integers(0, 40)),
        st.tuples(st.just("swap"), AT, st.integers(1, 8)),
        st.tuples(st.just("back"), AT, st.integers(-3_000_000, 70_000_000_000)),
        st.tuples(st.just("later"), AT, st.sampled_from(GAPS).map(lambda each: each * 10**9)),
        st.tuples(st.just("id"), AT, st.integers(0, 65_535)),
        st.tuples(
            st.just("byte"), AT,
            st.tuples(st.sampled_from(TELLING), st.one_of(st.integers(0, 5), st.integers(0, 255))),
        ),
        st.tuples(st.just("cut"), AT, st.integers(60, 240)),
    ),
    max_size=6,
)  # fmt: skip


def changed(shots: Shots, changes: Sequence[tuple[str, int, Any]]) -> list[tuple[int, bytes]]:
    result = list(shots)
    for what, at, more in changes:
        at %= len(result)
        time_ns, data = result[at]
        if what == "drop":
            del result[at : at + more]
        elif what == "again":
            result.insert(
                min(len(result), at + more), (result[min(len(result) - 1, at + more)][0], data)
            )
        elif what == "swap":
            result.insert(min(len(result), at + more), result.pop(at))
        elif what == "back":
            result[at] = (max(0, time_ns - more), data)
        elif what == "later":
            result[at:] = [(each + more, data) for each, data in result[at:]]
        elif what == "id":
            result[at] = (time_ns, data[:18] + more.to_bytes(2, "big") + data[20:])
        elif what == "byte" and more[0] < len(data):
            result[at] = (time_ns, data[: more[0]] + bytes((more[1],)) + data[more[0] + 1 :])
        elif what == "cut":
            result[at] = (time_ns, data[:more])
    return result


@settings(max_examples=300, deadline=None)
@given(CHANGES)
def test_anything_else_in_between(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[str, int, Any]]
) -> None:
    path = written(changed(PLANT, changes), tmp_path_factory.mktemp("shots"))
    assert_same(lambda: str(path))


@pytest.mark.parametrize("trouble", troubles.ALL)
def test_rare_troubles(trouble: Callable[[], bytes]) -> None:
    assert_same(lambda: io.BytesIO(trouble()))


def test_what_is_known_is_bounded(tmp_path: Path) -> None:
    path = written(plant(20, devices=6), tmp_path)
    with patch.object(usual, "_MOST_KNOWN", 8), patch.object(lines, "_MOST_SHAPES", 2):
        assert_same(lambda: str(path))
    way = Analysis(AnalysisOptions(), None)._usual
    assert way is not None
    with patch.object(usual, "_MOST_KNOWN", 8), open_capture(path) as capture:
        for frame in capture:
            pdu = rpc.from_frame(frame)
            assert pdu is not None
            way._naming.message(pdu)
            way.learn(frame, pdu)
            assert len(way._sides) <= 8


@pytest.mark.parametrize("at", TELLING)
def test_a_byte_that_says_something(at: int, tmp_path: Path) -> None:
    """Changed in each frame of some transactions, one frame at a time."""
    for number in range(48, 72, 5):
        for value in (3, 0x80):
            path = written(changed(PLANT[:84], [("byte", number, (at, value))]), tmp_path)
            assert_same(lambda path=path: str(path))


@pytest.mark.parametrize("place", [1, 2, 3])
def test_an_answer_to_a_change_that_is_not_the_usual_one(place: int, tmp_path: Path) -> None:
    """Its id, its axis or its count is another one."""
    stage = Stage()
    client = Client(stage)
    for reference in range(1, 9):
        request = message.change(reference, 1, (message.address(1120), message.real(1.5)))
        answer = bytearray(message.changed(reference, 1, 1))
        if reference > 6:
            answer[place] += 1
        client.exchange(request, bytes(answer))
    path = written([(shot.time_ns, shot.data) for shot in stage.shots], tmp_path)
    assert_same(lambda: str(path))


@pytest.mark.parametrize("little", [False, True])
@given(data=st.data())
def test_both_ways_to_fetch_the_fields(little: bool, data: st.DataObject) -> None:
    """`Headers` by `unpack` and byte by byte, which is what is compiled."""
    number = data.draw(AT)
    frame = Frame(1, 0, 1, PLANT[number][1], 0)
    pdu = rpc.from_frame(frame)
    assert pdu is not None
    conversation = conversation_key(pdu.source, pdu.destination, pdu.activity, pdu.ptype)
    headers = Headers(frame.data, conversation, pdu.ptype == 0, little)
    draws = st.tuples(st.sampled_from(TELLING), st.one_of(st.integers(0, 5), st.integers(0, 255)))
    changed = bytearray(frame.data)
    for at, value in data.draw(st.lists(draws, max_size=3)):
        changed[at % len(changed)] = value
    seen = bytes(changed)[: data.draw(st.sampled_from((len(changed), 205, 206, 230)))]
    assert headers.read(seen) == headers._compiled(seen)
    if seen == frame.data and little == pdu.little:
        fields = headers.read(seen)
        assert fields is not None
        key = datagram_key(conversation, pdu.ip_id, pdu.fragment, pdu.seq, pdu.body)
        assert (fields[1], fields[3]) == (pdu.seq, key)
