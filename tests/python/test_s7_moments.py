"""Data of two moments (DS904, DS905, DS907): conversations with a memory whose whole history the test knows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ds47.findings.remark import Remark
from ds47.s7.consistency import ItemAccess
from ds47.s7.memory import MOST_BYTES, Memory
from ds47.s7.model import (
    DONE,
    GET,
    OK,
    PUT,
    UNANSWERED,
    At,
    End,
    S7Address,
    S7Connection,
    S7Item,
    S7Job,
)
from ds47.s7.moments import Moments
from ds47.s7.notes import Notes
from ds47.spec.semantics import limits

PDU = 36
READ, WRITE = PDU - 18, PDU - 28
"""Bytes that one job reads, and writes, at the most."""
SIZE = 24
DB = 0x84


@dataclass
class Plant:
    """A CPU with one data block, stations that read and write it, and all that ever stood there."""

    memory: bytearray = field(default_factory=lambda: bytearray(SIZE))
    now: int = 1_000
    frame: int = 0
    past: list[tuple[int, bytes]] = field(default_factory=list)
    """What stands in the memory from a time on."""
    jobs: dict[int, S7Job] = field(default_factory=dict)
    """By the frame of their answers."""
    connections: dict[int, S7Connection] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.notes = Notes(100)
        self.moments = Moments(limits(), self.notes)
        self.past.append((0, bytes(self.memory)))

    def at(self) -> At:
        self.frame += 1
        return At(self.frame, self.now)

    def station(self, number: int) -> S7Connection:
        if number not in self.connections:
            client, server = End(f"10.0.0.{number}", 50_000 + number), End("10.0.0.100", 102)
            made = S7Connection(number, client, server, self.at(), self.at(), True)
            made.pdu_length = PDU
            self.connections[number] = made
        return self.connections[number]

    def ask(self, station: int, start: int, data: bytes | int) -> S7Job:
        """The request of a read of so many bytes, or of a write."""
        size = data if isinstance(data, int) else len(data)
        item = S7Item(S7Address(DB, 1, 8 * start, 8, size), None if isinstance(data, int) else data)
        operation = GET if isinstance(data, int) else PUT
        job = S7Job(operation, self.station(station), True, self.frame, self.at(), [item])
        self.moments.asked(job)
        self.now += 1
        return job

    def act(self, job: S7Job) -> None:
        """The CPU does what was asked."""
        (item,) = job.items
        assert item.address is not None
        start = item.address.start // 8
        if job.operation == PUT:
            assert item.value is not None
            self.change(start, item.value)
        else:
            item.value = bytes(self.memory[start : start + item.address.count])

    def change(self, start: int, data: bytes) -> None:
        """Bytes change, whoever does it."""
        self.memory[start : start + len(data)] = data
        self.past.append((self.now, bytes(self.memory)))

    def answer(self, job: S7Job, code: int = DONE) -> None:
        job.items[0].code = code
        job.state, job.answered = (OK if code == DONE else "error"), self.at()
        self.jobs[job.answered.frame] = job
        self.moments.over(job)
        job.phase = "closed"
        self.now += 1

    def lose(self, job: S7Job) -> None:
        job.state = UNANSWERED
        self.moments.over(job)
        job.phase = "closed"

    def do(self, station: int, start: int, data: bytes | int) -> S7Job:
        """A whole job, at once."""
        job = self.ask(station, start, data)
        self.act(job)
        self.answer(job)
        return job

    def read(self, station: int, start: int, size: int) -> Iterator[None]:
        """A read in as many jobs as it takes; something may happen behind each."""
        for at in range(start, start + size, READ):
            self.do(station, at, min(READ, start + size - at))
            yield

    def write(self, station: int, start: int, data: bytes) -> Iterator[None]:
        for at in range(0, len(data), WRITE):
            self.do(station, start + at, data[at : at + WRITE])
            yield

    def found(self) -> list[Remark]:
        for connection in self.connections.values():
            self.moments.closed(connection)
        return sorted(
            [*self.moments.finish(), *self.notes.finish()], key=lambda each: (each.rule, each.frame)
        )

    def rules(self) -> list[str]:
        return [each.rule for each in self.found()]

    def together(self, remark: Remark) -> bool:
        """Whether both bytes of a DS905 ever stood there as they were read, while they were read."""
        parts = [self.jobs[frame] for frame in remark.args["frames"] if frame in self.jobs]
        reads = [each for each in parts if each.operation == GET]
        begin = min(each.asked.time_ns for each in reads if each.asked)
        end = max(each.answered.time_ns for each in reads if each.answered)
        first, second = (
            int(remark.args[name].rpartition("DBB")[2]) for name in ("first", "second")
        )
        wanted = remark.args["first_value"], remark.args["second_value"]
        before = [each for each in self.past if each[0] < begin][-1:]
        during = [each for each in self.past if begin <= each[0] <= end]
        return any((there[first], there[second]) == wanted for _, there in [*before, *during])


OLD, NEW = b"\1" * SIZE, b"\2" * SIZE


def known(data: bytes = OLD) -> Plant:
    """A memory that station 1 has written whole, so that its values are known."""
    plant = Plant()
    for _ in plant.write(1, 0, data):
        pass
    plant.now += 10
    return plant


def test_a_write_between_the_parts_into_both() -> None:
    plant = known()
    parts = plant.read(2, 0, SIZE)
    next(parts)
    write = plant.do(3, READ - 2, NEW[:4])
    assert list(parts) == [None]
    remarks = [each for each in plant.found() if each.rule == "DS905"]
    (remark,) = remarks
    assert write.asked is not None
    assert remark.args == {
        "device": "10.0.0.100", "controller": "10.0.0.2", "case": "mixed_split", "jobs": 2,
        "first": "DB1.DBB17", "first_value": 1, "second": "DB1.DBB19", "second_value": 2,
        "write": write.asked.frame, "frames": remark.args["frames"],
    }  # fmt: skip
    assert not plant.together(remark)
    assert len(remark.args["frames"]) == 6


@pytest.mark.parametrize(
    ("start", "data"),
    [
        (0, NEW[:READ]),  # only what was read: all is older
        (READ, NEW[:6]),  # only what is not yet read: all is newer
        (READ - 2, OLD[:4]),  # both, and nothing changes
        (READ - 2, OLD[:2] + NEW[:2]),  # both, and only what is not yet read changes
        (READ - 2, NEW[:2] + OLD[:2]),
    ],
)
def test_a_write_between_the_parts_that_leaves_a_moment(start: int, data: bytes) -> None:
    plant = known()
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, start, data)
    list(parts)
    assert {*plant.rules()} <= {"DS904", "DS907"}


def test_what_was_there_before_is_not_known() -> None:
    """The second part may have had these values before the write."""
    plant = Plant(bytearray(OLD))
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    assert plant.rules() == ["DS904"]


def test_it_is_known_by_a_read() -> None:
    plant = Plant(bytearray(OLD))
    plant.do(4, READ, 6)
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    assert plant.rules() == ["DS904", "DS905"]


@pytest.mark.parametrize("how", ["begun before", "answered later", "not answered", "refused"])
def test_a_write_that_may_have_been_in_force_earlier_or_later(how: str) -> None:
    """It was under way while a part was read, so it may have come before that, or after all."""
    plant = known()
    parts = plant.read(2, 0, SIZE)
    if how == "begun before":
        write = plant.ask(3, READ - 2, NEW[:4])
        next(parts)
        plant.act(write)
        plant.answer(write)
        list(parts)
    else:
        next(parts)
        write = plant.ask(3, READ - 2, NEW[:4])
        if how == "refused":
            plant.answer(write, 5)
        else:
            plant.act(write)
        list(parts)
        if how == "answered later":
            plant.answer(write)
        elif how == "not answered":
            plant.lose(write)
    told = [each for each in plant.found() if each.rule == "DS905"]
    assert bool(told) is (how != "refused")
    assert not any(map(plant.together, told))


def test_a_station_that_was_not_captured_writes_what_is_read() -> None:
    """The first part changes by itself: it may have done so once more."""
    plant = known()
    plant.change(READ - 1, b"\7")
    plant.do(2, READ - 1, 1)
    plant.change(READ - 1, b"\1")
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 1, NEW[:2])
    list(parts)
    assert "DS905" not in plant.rules()


def test_it_is_seen_only_later_that_somebody_else_writes() -> None:
    plant = known()
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 1, NEW[:2])
    list(parts)
    plant.change(READ, b"\7")
    plant.do(2, READ, 1)
    assert "DS905" not in plant.rules()


@pytest.mark.parametrize("doubt", ["lost_bytes", "plus", "other"])
@pytest.mark.parametrize("between", [False, True])
def test_something_was_not_heard(doubt: str, between: bool) -> None:
    """Whoever wrote there may have written what is read; what is known later is known."""
    plant = known()
    unheard = plant.station(4)
    parts = plant.read(2, 0, SIZE)
    plant.do(4, 0, 1)
    if not between:
        setattr(unheard, doubt, 1)
        plant.do(4, 0, 1)
        plant.do(4, 0, SIZE)
    next(parts)
    if between:
        setattr(unheard, doubt, 1)
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    assert ("DS905" in plant.rules()) is not between


def test_time_steps_back() -> None:
    plant = known()
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.now -= 50
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    assert "DS905" not in plant.rules()


def test_two_slots_of_one_address_are_two_memories() -> None:
    plant = known()
    plant.station(2).server_tsap, plant.station(3).server_tsap = b"\3\2", b"\3\3"
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    assert "DS905" not in plant.rules()


def test_a_read_between_the_parts_of_a_write() -> None:
    plant = known()
    parts = plant.write(2, 0, NEW[: WRITE + 4])
    next(parts)
    read = plant.do(3, WRITE - 1, 2)
    list(parts)
    (remark,) = [each for each in plant.found() if each.rule == "DS905"]
    assert read.answered is not None
    assert (remark.args["case"], remark.frame) == ("mixed_put", read.answered.frame)
    assert (remark.args["first_value"], remark.args["second_value"]) == (2, 1)


def test_a_read_in_parts_meets_a_write_in_parts() -> None:
    plant = known()
    reads, writes = plant.read(2, 0, SIZE), plant.write(3, READ - 4, NEW[: WRITE + 2])
    next(reads)
    next(writes)
    list(reads)
    list(writes)
    told = [each for each in plant.found() if each.rule == "DS905"]
    assert [each.args["case"] for each in told] == ["mixed_split"]


@pytest.mark.parametrize("size", [1, 2])
def test_a_read_beside_the_parts_of_a_write(size: int) -> None:
    """It has bytes of one part only, or was before the first or behind the last."""
    plant = known()
    plant.do(3, WRITE - 1, 2)
    parts = plant.write(2, 0, NEW[: WRITE + 4])
    next(parts)
    plant.do(3, WRITE - 1, 1)
    list(parts)
    plant.do(3, WRITE - 1, size)
    assert "DS905" not in plant.rules()


def test_one_job_that_mixes() -> None:
    """The CPU reads the first byte before a write and the second one behind it."""
    plant = known()
    read = plant.ask(2, 0, 2)
    plant.act(read)
    plant.do(3, 0, NEW[:2])
    read.items[0].value = b"\1\2"
    plant.answer(read)
    (remark,) = [each for each in plant.found() if each.rule == "DS905"]
    assert (remark.args["case"], remark.args["jobs"]) == ("mixed_job", 1)


def test_two_writes_at_once_may_mix_by_themselves() -> None:
    """The memory keeps the mixture then, and a read of it is as good as any."""
    plant = known()
    one, two = plant.ask(2, 0, b"\3\3"), plant.ask(3, 0, b"\4\4")
    plant.change(0, b"\3\4")
    plant.answer(one)
    plant.answer(two)
    plant.do(4, 0, 2)
    assert "DS905" not in plant.rules()


def test_an_area_that_is_polled_in_parts_is_one_note() -> None:
    plant = known()
    for _ in range(5):
        list(plant.read(2, 0, SIZE))
        plant.now += 100
    list(plant.read(3, 0, SIZE))
    notes = [each for each in plant.found() if each.args.get("operation") == "GET"]
    assert [(each.rule, each.args["count"], each.args["area"]) for each in notes] == [
        ("DS904", 5, "DB1.DBB0..23"), ("DS904", 1, "DB1.DBB0..23"),
    ]  # fmt: skip
    assert notes[0].args["jobs"] == 2
    assert len(notes[0].args["frames"]) == 5 * 4


@pytest.mark.parametrize(
    ("jobs", "split"),
    [
        ([(0, 18), (18, 6)], True),
        ([(0, 17), (17, 6)], True),  # 94 percent
        ([(0, 16), (16, 6)], False),  # 89 percent
        ([(0, 18), (19, 5)], False),
        ([(1, 17), (0, 1)], False),
        ([(0, 18), (18, 1), (19, 1)], True),
        ([(0, 6), (6, 18)], False),
    ],
)
def test_what_is_an_area_in_parts(jobs: Sequence[tuple[int, int]], split: bool) -> None:
    plant = Plant()
    for start, size in jobs:
        plant.do(1, start, size)
    told = plant.found()
    assert bool(told) is split
    assert [each.args["jobs"] for each in told] == [2] * split


@pytest.mark.parametrize("change", ["late", "no setup", "refused", "another"])
def test_what_looks_like_an_area_in_parts(change: str) -> None:
    plant = Plant()
    if change == "no setup":
        plant.station(1).pdu_length = None
    plant.do(1, 0, READ)
    if change == "late":
        plant.now += limits().s7_split_ns + 1
    if change == "another":
        plant.do(1, 0, 1)
    job = plant.ask(1, READ, 6)
    plant.act(job)
    plant.answer(job, 5 if change == "refused" else DONE)
    assert plant.rules() == []


def test_two_writers() -> None:
    plant = Plant()
    first = plant.do(2, 0, b"\1\1\1")
    second = plant.do(3, 2, b"\2\2")
    plant.do(3, 2, b"\2\2")
    (remark,) = plant.found()
    assert first.asked is not None
    assert second.asked is not None
    assert (remark.rule, remark.frame) == ("DS907", second.asked.frame)
    assert {key: remark.args[key] for key in ("controller", "other", "byte", "count")} == {
        "controller": "10.0.0.2", "other": "10.0.0.3", "byte": "DB1.DBB2", "count": 2,
    }  # fmt: skip
    assert first.asked.frame in remark.args["frames"]


@pytest.mark.parametrize(
    ("station", "start", "data", "later"),
    [
        (2, 0, b"\2", 0),  # the same station
        (3, 0, b"\1", 0),  # the same values
        (3, 3, b"\2", 0),  # other bytes
        (3, 0, b"\2", 1_000_000_000),
    ],
)
def test_not_two_writers(station: int, start: int, data: bytes, later: int) -> None:
    plant = Plant()
    plant.do(2, 0, b"\1\1\1")
    plant.now += later
    plant.do(station, start, data)
    assert plant.rules() == []


# Bounds


def test_what_is_kept_is_bounded() -> None:
    """Large writes that overlap, have no answer, or come to ever other blocks."""
    memory = Memory(64)
    data, order = bytes(60_000), count(1)

    def write(asked: int, answered: int | None) -> ItemAccess:
        number = next(order)
        sure = answered is not None
        return ItemAccess(number, 1, True, DB, 1, 0, data, asked, answered, number, None, sure)

    for n in range(400):
        one, lost = write(10 * n, 10 * n + 15), write(10 * n, None)
        memory.sent(one)
        memory.sent(lost)
        memory.written(one)
        memory.gave_up(lost)
        memory.read(
            ItemAccess(
                next(order), 2, False, DB, 1, 0, bytes([n & 1]) * 60_000, 10 * n, 10 * n, n, n
            )
        )
    assert sum(len(each.data) for each in memory._history) <= 5 * MOST_BYTES
    assert sum(len(each.data) for each in memory._reads) <= MOST_BYTES
    assert sum(len(each.data) for each in memory._lost) <= MOST_BYTES
    assert not memory._open
    assert memory.foreign, "writes that are remembered no more may be in force at any time"


def test_memories_and_partners_are_bounded() -> None:
    plant = known()
    parts = plant.read(2, 0, SIZE)
    next(parts)
    plant.do(3, READ - 2, NEW[:4])
    list(parts)
    item = S7Item(S7Address(DB, 1, 0, 8, 1))
    for n in range(2 * limits().s7_memories):
        for db, server in ((2 + n, "10.0.0.100"), (1, f"10.1.{n >> 8}.{n & 255}")):
            item = S7Item(S7Address(DB, db, 0, 8, 1), b"\0", DONE)
            line = S7Connection(
                1000 + n, End("10.0.0.9", n), End(server, 102), plant.at(), plant.at()
            )
            job = S7Job(GET, line, True, 1, plant.at(), [item])
            plant.moments.asked(job)
            job.answered, job.state = plant.at(), OK
            plant.moments.over(job)
            plant.moments.closed(line)
    assert len(plant.moments._logs) <= limits().s7_memories
    assert len(plant.moments._partners) <= limits().s7_memories
    assert plant.rules().count("DS905") == 1, "what was found is not lost with the memory"


@pytest.mark.parametrize("start", [65_500, 65_536, 2_000_000])
def test_addresses_behind_64_kilobytes_are_left_alone(start: int) -> None:
    plant = Plant()
    item = S7Item(S7Address(DB, 1, 8 * start, 8, 40), bytes(40))
    job = S7Job(PUT, plant.station(1), True, 1, plant.at(), [item])
    plant.moments.asked(job)
    job.answered, job.state, item.code = plant.at(), OK, DONE
    plant.moments.over(job)
    assert plant.rules() == []


@pytest.mark.parametrize(("bits", "rules"), [(1, []), (8, ["DS907"])])
def test_a_single_bit_is_not_compared_with_bytes(bits: int, rules: list[str]) -> None:
    plant = Plant()
    item = S7Item(S7Address(DB, 1, 8 * 3, bits, 1), b"\1")
    job = S7Job(PUT, plant.station(1), True, 1, plant.at(), [item])
    plant.moments.asked(job)
    plant.answer(job)
    plant.do(2, 2, b"\xff\xff")
    assert plant.rules() == rules


# By chance


@st.composite
def scripts(draw: st.DrawFn) -> list[tuple[int, int, Any, int, int, int]]:
    """What each station does: its number, where, how many bytes or which, and three times."""
    found = []
    for station in range(1, draw(st.integers(2, 4)) + 1):
        for _ in range(draw(st.integers(1, 6))):
            kind, start = draw(st.integers(0, 5)), draw(st.integers(0, 20))
            data: Any = draw(st.integers(1, SIZE - start))
            if kind > 2:
                data = bytes(draw(st.lists(st.integers(1, 3), min_size=1, max_size=SIZE - start)))
            elif kind == 0:
                start, data = 0, SIZE
            times = [draw(st.integers(0, 6)) for _ in range(3)]
            found.append((station, start, data, *times))
    return found


def pieces(script: list[tuple[int, int, Any, int, int, int]]) -> dict[int, list[tuple[Any, ...]]]:
    """Areas as jobs, by their stations."""
    found: dict[int, list[tuple[Any, ...]]] = {}
    for station, start, data, *times in script:
        read = isinstance(data, int)
        size, most = (data, READ) if read else (len(data), WRITE)
        for at in range(0, size, most):
            part = min(most, size - at) if read else data[at : at + most]
            found.setdefault(station, []).append((start + at, part, *times))
    return found


@pytest.mark.slow
@settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    scripts(),
    st.booleans(),
    st.lists(st.tuples(st.integers(0, 60), st.integers(0, 23)), max_size=6),
)
def test_what_is_told_never_stood_there(
    script: list[tuple[int, int, Any, int, int, int]],
    first_write: bool,
    others: list[tuple[int, int]],
) -> None:
    """Stations work at the same time, the CPU too; each job takes effect somewhere from request to answer."""
    plant = known() if first_write else Plant()
    events: list[tuple[int, int, int, str]] = []
    plan = pieces(script)
    for station, jobs in plan.items():
        time = plant.now
        for number, (_, _, gap, until, then) in enumerate(jobs):
            for what, wait in (("ask", gap), ("act", until), ("answer", then)):
                time += wait
                events.append((time, station, number, what))
    events += [(plant.now + time, 0, at, "change") for time, at in others]
    order = {"ask": 0, "change": 1, "act": 1, "answer": 2}
    events.sort(key=lambda each: (each[0], each[1], each[2], order[each[3]]))
    open_jobs: dict[int, S7Job] = {}
    for tick, (_, station, number, what) in enumerate(events):
        plant.now = max(plant.now + 1, 2_000 + tick)
        if what == "change":
            plant.change(number, bytes([9 + tick % 3]))
        elif what == "ask":
            start, data, *_ = plan[station][number]
            open_jobs[station] = plant.ask(station, start, data)
        elif what == "act":
            plant.act(open_jobs[station])
        else:
            plant.answer(open_jobs.pop(station))
    for remark in plant.found():
        if remark.rule == "DS905" and remark.args["case"] != "mixed_put":
            assert not plant.together(remark), remark
