"""Logs of PROFIBUS as text: five shapes of the same frames, and what cannot be read."""

from __future__ import annotations

import csv
import io
import random
from collections.abc import Callable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profibus import telegram
from ds47.profibus.listing import TO_MASTER, TO_SLAVE, LogEntry, Unread, read

SECOND = 1_000_000_000
WRITE = "6813136883827d33335f002f0a030102011001c47f0000db16"
TALK = (
    (0, TO_SLAVE, "100302494e16"), (1_500, TO_MASTER, "100203000516"), (2_000, None, "dc0202"),
    (2_250, TO_SLAVE, WRITE), (3_000, TO_MASTER, "e5"), (4_125, TO_SLAVE, "6805056883825d3333c816"),
    (5_000, TO_MASTER, "6809096882830833335f002f0a0b16"),
)  # fmt: skip
"""Microseconds, direction, frame."""
ARROWS = {TO_SLAVE: "->", TO_MASTER: "<-", None: ""}
Talk = Sequence[tuple[int, str | None, str]]


def spaced(text: str) -> str:
    return bytes.fromhex(text).hex(" ").upper()


def bare(talk: Talk) -> str:
    """A frame a line, nothing else."""
    return "".join(f"{text}\n" for _, _, text in talk)


def timed(talk: Talk) -> str:
    """The time of day, bytes with blanks."""
    return "".join(f"12:00:00.{us:06}  {spaced(text)}\r\n" for us, _, text in talk)


def directed(talk: Talk) -> str:
    """Seconds in brackets, an arrow, bytes with blanks."""
    lines = (f"[{us / 1e6:.6f}] {ARROWS[side]} {spaced(text)}\n" for us, side, text in talk)
    return "# a log\n\n" + "".join(lines)


def joined(talk: Talk) -> str:
    """All frames in one line."""
    return " ".join(spaced(text) for _, _, text in talk)


def table(talk: Talk) -> str:
    """CSV with a head that names more than is wanted."""
    target = io.StringIO()
    writer = csv.writer(target, delimiter=";")
    writer.writerow(["Index", "Time us", "Dirn", "Status", "Src", "Data"])
    for number, (us, side, text) in enumerate(talk):
        name = {TO_SLAVE: "Tx", TO_MASTER: "Rx", None: ""}[side]
        writer.writerow([number, us, name, "ok", 2, spaced(text)])
    return target.getvalue()


SHAPES: tuple[Callable[[Talk], str], ...] = (bare, timed, directed, joined, table)


def entries(text: str) -> list[LogEntry]:
    found = list(read(text.splitlines(keepends=True)))
    assert all(isinstance(each, LogEntry) for each in found), found
    return [each for each in found if isinstance(each, LogEntry)]


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_has_the_same_frames(shape: Callable[[Talk], str]) -> None:
    found = entries(shape(TALK))
    assert [each.telegram for each in found] == [
        telegram.decode(bytes.fromhex(text)) for _, _, text in TALK
    ]


@pytest.mark.parametrize("shape", [timed, directed, table])
def test_times_are_those_of_the_log(shape: Callable[[Talk], str]) -> None:
    start = 12 * 3600 * SECOND if shape is timed else 0
    assert [each.time_ns for each in entries(shape(TALK))] == [
        us * 1000 + start for us, _, _ in TALK
    ]


@pytest.mark.parametrize("shape", [directed, table])
def test_directions_are_those_of_the_log(shape: Callable[[Talk], str]) -> None:
    assert [each.direction for each in entries(shape(TALK))] == [side for _, side, _ in TALK]


def test_lines_are_counted_from_one() -> None:
    assert [each.line for each in entries(directed(TALK))] == list(range(3, 10))
    assert {each.line for each in entries(joined(TALK))} == {1}


@pytest.mark.parametrize(
    ("line", "time_ns", "direction"),
    [
        ("E5", None, None),
        ("0xE5", None, None),
        ("12:00:00 E5", 43_200 * SECOND, None),
        ("12:00:00,5 rx E5", 43_200 * SECOND + SECOND // 2, TO_MASTER),
        ("1970-01-02T00:00:01.000000001Z E5", 86_401 * SECOND + 1, None),
        ("1970-01-02 00:00:01; E5", 86_401 * SECOND, None),
        ("1.25 s: TX: E5", 1_250_000_000, TO_SLAVE),
        ("1250us E5", 1_250_000, None),
        ("0,125 ms E5", 125_000, None),
        ("[0.5], E5", SECOND // 2, None),
        ("(17) E5", 17 * SECOND, None),
        ("<- E5", None, TO_MASTER),
        ("99:99:99 E5", (99 * 3600 + 99 * 60 + 99) * SECOND, None),
    ],
)
def test_a_time_and_a_direction(line: str, time_ns: int | None, direction: str | None) -> None:
    (found,) = entries(line)
    assert (found.time_ns, found.direction, found.telegram.kind) == (time_ns, direction, "SC")


@pytest.mark.parametrize(
    "line",
    ["10 03 02 49 4e 16", "10,03,02,49,4E,16", "10-03-02-49-4e-16", "10:03:02:49:4e:16",
     "0x10,0x03,0x02,0x49,0x4e,0x16"],
)  # fmt: skip
def test_bytes_are_not_taken_for_a_time(line: str) -> None:
    (found,) = entries(line)
    assert (found.time_ns, found.telegram.kind, found.telegram.flaws) == (None, "SD1", ())


@pytest.mark.parametrize(
    ("head", "row", "time_ns"),
    [
        ("time,data", '1.5,"E5"', 1_500_000_000),
        ("Time (ms),Data", "1.5,E5", 1_500_000),
        ("Time [us]\tData", "1.5\tE5", 1_500),
        ("time_ns|hex", "15|E5", 15),
        ("time_ns;data", "1767254400000000069;E5", 1_767_254_400_000_000_069),
        ("Zeit;Richtung;Daten", "12:00:01,250;rx;E5", 43_201_250_000_000),
        ("Data;Time", "E5;0,5", 500_000_000),
        ("Nr;Data", "1;E5", None),
    ],
)
def test_a_head_names_the_columns(head: str, row: str, time_ns: int | None) -> None:
    (found,) = entries(f"\ufeff{head}\n{row}\n")
    assert (found.time_ns, found.telegram.kind, found.line) == (time_ns, "SC", 2)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("bus monitor 3\nE5\n", []),
        ("E5\n12:00:00\nE5 0G\nE5\n", [(3, "hex")]),
        ("time;data\n1;E5\n2\nlater;E5\n3;\n", [(3, "column"), (4, "time"), (5, "hex")]),
    ],
)
def test_damaged_bytes_are_told_with_their_line(text: str, told: list[tuple[int, str]]) -> None:
    found = list(read(text.splitlines()))
    assert [(each.line, each.reason) for each in found if isinstance(each, Unread)] == told
    assert any(isinstance(each, LogEntry) for each in found)


def test_a_damaged_frame_is_an_entry_with_its_flaw() -> None:
    damaged = WRITE[:-4] + "dc16"
    found = entries(f"{damaged} e5\n")
    assert [[flaw.kind for flaw in each.telegram.flaws] for each in found] == [["check"], []]


@given(st.lists(st.text(max_size=40), max_size=8))
def test_any_text_is_read(lines: list[str]) -> None:
    for each in read(lines):
        assert 1 <= each.line <= len(lines)


@pytest.mark.parametrize(
    "line",
    ["1" * 10_000 + ".5 E5", f"({'1' * 10_001}) E5", "_" * 100_000, "1." + "1" * 100_000 + " x" * 3000,
     ";" * 100_000],
)  # fmt: skip
def test_long_lines_are_told_at_once(line: str) -> None:
    (found,) = read([line])
    assert isinstance(found, Unread)
    assert len(found.text) <= 80


@pytest.mark.parametrize("seed", range(20))
def test_shapes_of_talk_by_chance_are_the_same(seed: int) -> None:
    chance = random.Random(seed)
    talk = [
        (number * 100, chance.choice((TO_SLAVE, TO_MASTER)), each)
        for number, each in enumerate(chance.choices([text for _, _, text in TALK], k=20))
    ]
    frames = [[each.telegram for each in entries(shape(talk))] for shape in SHAPES]
    assert all(each == frames[0] for each in frames)
