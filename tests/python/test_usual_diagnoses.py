"""The short way of usual transactions leaves the diagnoses as the long way does, in what they remember and say.

The reports of all captures are compared in `test_usual`. Here the memories themselves are compared too, over
traffic that the diagnoses have something to say about, and with memories that hold little.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import UUID

import pytest

pytest.importorskip("scapy")

from test_usual import assert_same, frames_of, reports, stored, written

from ds47 import diagnosis
from ds47.analysis import Analysis, AnalysisOptions
from ds47.capture import open_capture
from ds47.diagnosis import capture, repetition
from ds47.lab import message
from ds47.lab.client import Client, controller, drive
from ds47.lab.stage import Stage
from ds47.lab.wire import Channel
from ds47.pairing import Job, UsualJob
from ds47.report.lines import JsonLines
from ds47.rules import Judge
from ds47.spec.semantics import known
from ds47.usual import UsualWay

__all__ = ["stored"]  # a fixture

IN_USE = 0xDF80B500
NO_SLOT = 0xDE80B200
Exchange = tuple[bytes, bytes]


class Workshop:
    """Drives that are read, changed and saved, rightly and wrongly; what comes next is drawn by lot.

    Usual transactions come in runs, so that most of them are taken by the short way.
    """

    def __init__(self, seed: int, drives: int) -> None:
        self._chance = random.Random(seed)
        self.stage = Stage()
        self._clients = [
            Client(
                self.stage, device=drive(number // 3 + 1), host=controller(number % 2 + 1),
                activity=UUID(int=4711 << 64 | number),
                channel=Channel(
                    UUID(int=47 << 64 | number), index=(47, 0xB02E)[number % 3 == 2],
                    slot=number % 3 + 1,
                ),
            )
            for number in range(3 * drives)
        ]  # fmt: skip
        self._reference = Counter[int]()
        self._unusual: list[Callable[[Client], None]] = [
            self._held, self._storm, self._short_storm, self._in_use, self._too_early, self._release,
            self._read_again, self._nothing_to_read, self._old_answer, self._refused, self._superseded,
            self._swapped, self._denormal, self._no_axis, self._wrong_slot,
        ]  # fmt: skip

    def run(self, rounds: int) -> None:
        """Some usual transactions on all channels, then something else on one of them."""
        for _ in range(rounds):
            for _ in range(self._chance.randrange(16)):
                client = self._chance.choice(self._clients)
                for _ in range(self._chance.randrange(1, 4)):
                    client.exchange(*self._usual(client))
            self._chance.choice(self._unusual)(self._chance.choice(self._clients))

    def _next(self, client: Client) -> int:
        number = id(client)
        self._reference[number] = self._reference[number] % 255 + 1
        return self._reference[number]

    def _usual(self, client: Client) -> Exchange:
        """A read of one of some parameters, whose format changes seldom; or a change."""
        chance, reference = self._chance, self._next(client)
        axis = 1 if chance.random() < 0.9 else chance.choice((2, 3))
        kind = chance.choice(("read",) * 40 + ("two", "change", "change", "actual", "save"))
        if kind in ("change", "actual", "save"):
            pnu = {"change": 1120, "actual": 21, "save": chance.choice((971, 977))}[kind]
            value = message.word(1) if kind == "save" else message.real(chance.choice((1.5, 0, 2)))
            request = message.change(reference, axis, (message.address(pnu), value))
            return request, message.changed(reference, axis)
        pnu = chance.choice((2, 2, 21, 21, 25, 25, 964, 964, 1120, 974))
        subindex = 0 if pnu == 974 else chance.randrange(2)
        value = message.word(chance.choice((200, 240)))
        if pnu != 974 and chance.random() < 0.995:
            value = message.real(chance.randrange(9) / 2)
        places, values = [message.address(pnu, subindex)], [value]
        if kind == "two":  # the same parameter, in another format
            places.append(message.address(pnu, subindex + 1))
            values.append(message.word(chance.randrange(9)))
        return (
            message.read(reference, axis, *places),
            message.answer(reference, 1, axis, *values),
        )

    def _change(self, client: Client, value: bytes, pnu: int = 1120) -> Exchange:
        reference = self._next(client)
        return (
            message.change(reference, 1, (message.address(pnu), value)),
            message.changed(reference, 1),
        )

    def _held(self, client: Client) -> None:
        value = message.real(self._chance.choice((3.5, 4.5)))
        for _ in range(self._chance.choice((4, 5, 9))):
            client.exchange(*self._change(client, value))
            self.stage.wait(200)

    def _storm(self, client: Client) -> None:
        for _ in range(3):
            client.exchange(*self._usual(client), polls=12)

    def _short_storm(self, client: Client) -> None:
        client.exchange(*self._usual(client), polls=10)
        client.exchange(*self._usual(client))

    def _in_use(self, client: Client) -> None:
        """Another controller asks the same place."""
        other = replace(
            client, host=controller(3), activity=UUID(int=815), sequence=self._next(client),
            channel=client.at(ar=UUID(int=816)),
        )  # fmt: skip
        request, answer = self._usual(client)
        client.write(request)
        other.write(self._usual(other)[0], status=IN_USE)
        if self._chance.random() < 0.5:
            client.read(answer)
            other.write(self._usual(other)[0], status=IN_USE)

    def _too_early(self, client: Client) -> None:
        request, answer = self._usual(client)
        write = client.ask_write(request)
        read = client.ask_read()
        client.accept_write(write, request)
        client.accept_read(read, answer)

    def _release(self, client: Client) -> None:
        if self._chance.random() < 0.5:
            client.write(self._usual(client)[0])
        if self._chance.random() < 0.5:
            client.release()
        client.connect("plc")

    def _read_again(self, client: Client) -> None:
        request, answer = self._usual(client)
        client.exchange(request, answer)
        client.read(answer)

    def _nothing_to_read(self, client: Client) -> None:
        client.poll(at=client.at(subslot=9))

    def _old_answer(self, client: Client) -> None:
        request, answer = self._usual(client)
        client.exchange(request, answer)
        write = client.ask_write(self._usual(client)[0])
        client.read(answer)
        client.accept_write(write, b"")

    def _refused(self, client: Client) -> None:
        reference = self._next(client)
        request = message.read(reference, 1, message.address(9_999))
        code = self._chance.choice((0x00, 0x11, 0x19, 0x6B))
        client.exchange(request, message.answer(reference, 0x81, 1, message.error(code)))

    def _superseded(self, client: Client) -> None:
        for _ in range(2):
            client.write(self._usual(client)[0])

    def _swapped(self, client: Client) -> None:
        client.exchange(*self._change(client, message.raw_block(0x08, 1, b"\0\0\xc0\x3f")))

    def _denormal(self, client: Client) -> None:
        client.exchange(*self._change(client, message.raw_block(0x08, 1, b"\0\0\0\x01")))

    def _no_axis(self, client: Client) -> None:
        reference = self._next(client)
        request = message.read(reference, 7, message.address(21))
        client.exchange(request, message.answer(reference, 0x81, 7, message.error(0x19)))

    def _wrong_slot(self, client: Client) -> None:
        client.write(self._usual(client)[0], status=NO_SLOT, at=client.at(slot=7))


def workshop(tmp_path: Path, seed: int, rounds: int = 40, drives: int = 3) -> Path:
    shop = Workshop(seed, drives)
    shop.run(rounds)
    return written([(shot.time_ns, shot.data) for shot in shop.stage.shots], tmp_path)


def state(thing: Any) -> Any:
    """All that an object remembers, what stands in the order of insertion in this order."""
    if isinstance(thing, UsualJob):
        return "job", thing.order, thing.job.phase if thing.job else thing.phase()
    if isinstance(thing, Job):
        return "job", thing.order, thing.phase
    if isinstance(thing, Mapping):
        return [(key, state(value)) for key, value in thing.items()]
    if isinstance(thing, (list, tuple)):
        return [state(each) for each in thing]
    names = [*getattr(thing, "__dict__", ()), *getattr(type(thing), "__slots__", ())]
    if not names or not type(thing).__module__.startswith("ds47"):
        return None if callable(thing) else thing
    return {name: state(getattr(thing, name)) for name in names if name != "_known"}


def memories(path: Path, lines: bool, every: int) -> list[Any]:
    """What is remembered behind some frames, and at the end."""
    options = AnalysisOptions()
    analysis = Analysis(options, None, lines=JsonLines(options.codec) if lines else None)
    found: list[Any] = []

    def look() -> None:
        assert analysis._usual is not None
        analysis._usual.settle()
        found.append((state(analysis._diagnoses), order(analysis)))

    take = UsualWay.take
    with open_capture(path) as frames:
        seen = 0

        def taken(way: UsualWay, frame: Any) -> bool:
            nonlocal seen
            seen += 1
            if seen % every == 0:
                look()
            return take(way, frame) if lines else False

        with patch.object(UsualWay, "take", taken):
            analysis.run(frames)
    look()
    return found


def order(analysis: Analysis) -> Any:
    """What is forgotten in the order in which it was used last, and what else both ways keep up to date."""
    calls, pairing, records = analysis._calls, analysis._pairing, analysis._records
    activities = [
        (key, each.newest, each.newest_ns, each.ordered, list(each.calls))
        for key, each in calls.activities.items()
    ]
    channels = [(key, each.touched, each.reference) for key, each in pairing.channels.items()]
    return (
        activities, channels, list(records._gate.open), pairing._ordered,
        pairing._newest_ns, records.newest_ns, dict(calls.counts), list(calls._order),
        state(records.counts), written_values(analysis._judge),
    )  # fmt: skip


def written_values(judge: Judge) -> Any:
    written = judge._written
    values = [
        (key, [(each.access, each.raw, each.asked, each.until, each.certain) for each in there])
        for key, there in written._written.items()
    ]
    return values, written.pnus


def small(entries: int) -> Any:
    """The memories of the diagnoses hold so many entries."""
    few = known().but(history=entries)
    return [
        patch.object(module, "known", lambda: few) for module in (diagnosis, capture, repetition)
    ]


def assert_same_memories(path: Path, every: int = 97) -> None:
    usual, careful = memories(path, True, every), memories(path, False, every)
    assert len(usual) == len(careful)
    for now, then in zip(usual, careful, strict=True):
        assert now == then


@pytest.mark.parametrize("seed", range(4))
def test_a_workshop(seed: int, tmp_path: Path) -> None:
    path = workshop(tmp_path, seed)
    assert_same(lambda: str(path))
    assert_same_memories(path)


@pytest.mark.parametrize("entries", [1, 2, 5, 11])
def test_with_a_bad_memory(entries: int, tmp_path: Path) -> None:
    """The oldest entries are forgotten, the same ones in both ways."""
    path = workshop(tmp_path, 100 + entries, drives=4)
    first, second, third = small(entries)
    with first, second, third:
        assert_same(lambda: str(path))
        assert_same_memories(path)


def changes(stage: Stage, number: int) -> tuple[Client, Callable[[], None]]:
    """A client, and a usual change by it."""
    client = Client(
        stage, device=drive(number), activity=UUID(int=4711 << 64 | number),
        channel=Channel(UUID(int=47 << 64 | number), index=0xB02E),
    )  # fmt: skip
    references = iter(range(1, 256))

    def exchange() -> None:
        reference = next(references)
        request = message.change(reference, 1, (message.address(1120), message.real(reference)))
        client.exchange(request, message.changed(reference, 1))

    return client, exchange


def test_a_place_that_is_forgotten_while_it_is_known(tmp_path: Path) -> None:
    """Two are remembered. The third was asked before, but it answers only now, and displaces the oldest."""
    stage = Stage()
    _, first = changes(stage, 1)
    _, second = changes(stage, 2)
    client, third = changes(stage, 3)
    for each in (first, first, second, second):
        each()
    for reference in (201, 202):
        client.write(message.read(reference, 1, message.address(21)))
    for each in (first, first, first, third, third, third, first, first, first):
        each()
    path = written([(shot.time_ns, shot.data) for shot in stage.shots], tmp_path)
    one, two, three = small(2)
    with one, two, three:
        assert_same_memories(path, every=1)


def test_a_storm_ends_with_a_usual_job(tmp_path: Path) -> None:
    stage = Stage()
    client = Client(stage)
    for reference in range(1, 40):
        request = message.read(reference, 1, message.address(21))
        polls = 12 if reference % 8 in (4, 5, 6) else 0
        client.exchange(request, message.answer(reference, 1, 1, message.real(1.5)), polls=polls)
    path = written([(shot.time_ns, shot.data) for shot in stage.shots], tmp_path)
    assert_same(lambda: str(path))
    assert_same_memories(path, every=1)
    assert reports(lambda: str(path))[0].count('"DS724"') > 3


def test_few_usual_jobs_are_known(tmp_path: Path) -> None:
    path = workshop(tmp_path, 7)
    with patch.object(diagnosis, "_MOST_KNOWN", 3):
        assert_same_memories(path)


def test_all_captures(stored: list[Path], tmp_path: Path) -> None:
    for path in stored:
        if frames_of(path):
            assert_same_memories(path)


def test_the_workshop_is_worth_it(tmp_path: Path) -> None:
    """Most usual jobs need no `Job`, and the diagnoses have much to say."""
    path = workshop(tmp_path, 3, rounds=100)
    whole, _ = reports(lambda: str(path))
    told = {f"DS7{number:02}" for number in range(26) if f'"DS7{number:02}"' in whole}
    assert told >= {"DS702", "DS703", "DS704", "DS705", "DS708", "DS709", "DS710", "DS721"}
    assert told >= {"DS715", "DS723", "DS724"}
    short = []
    usual = capture.WholeCapture.usual
    with patch.object(
        capture.WholeCapture, "usual", lambda *args: short.append(args) or usual(*args)
    ):
        reports(lambda: str(path))
    assert len(short) > 100
