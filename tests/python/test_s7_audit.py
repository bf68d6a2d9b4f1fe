"""Findings DS9xx of captures made by hand: what the auditor says of them, of false ones, of their sentences."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from s7_talk import ACK, DONE, JOB, SERVER, Talk, Tape
from tests.audit import reading, s7, wire, words
from tests.audit.reading import Finding, Reading

from ds47.spec import rules

OLD, NEW = b"\1" * 600, b"\2" * 600
ROOM, ROOM_PUT = 480 - 18, 480 - 28
Scene = Callable[[Tape], None]
SCENES: dict[str, Scene] = {}
BLOCK = 32


def scene(function: Scene) -> Scene:
    SCENES[function.__name__] = function
    return function


def known(tape: Tape) -> Talk:
    """Station 1 has written 600 bytes."""
    talk = Talk(tape).open()
    return talk.put(1, 0, OLD[:ROOM_PUT]).put(1, ROOM_PUT, OLD[ROOM_PUT:])


@scene
def jobs(tape: Tape) -> None:
    talk = Talk(tape, 1).open(parallel=2)
    talk.ask((1, 0, 4))  # never answered
    talk.ask((1, 0, 4), (99, 0, 4), (1, 9000, 4), (98, 0, 2))
    talk.bring(b"\1\2\3\4", 0x0A, 5, 0x0A)
    talk.ask((50, 0, 2), data=b"\1\2")
    talk.take(3)
    reference = talk.ask((1, 0, 4))
    talk.say(False, ACK, b"", reference=reference, error=0x8104)
    for _ in range(3):
        talk.ask((1, 0, 4), (1, 10, 3), (1, 20, 2))
        talk.bring(b"\1\2\3\4", b"\1\2\3", b"\1\2")
    talk.close()


@scene
def orphans(tape: Tape) -> None:
    """Answers whose jobs are not in the capture, and one that has fewer results than items."""
    talk = Talk(tape).open()
    talk.take(DONE, 3, 3, reference=70)
    talk.bring(b"1", 10, reference=71)
    talk.ask((1, 0, 4), (2, 0, 4), (3, 0, 2))
    talk.bring(b"1234", 5)
    talk.close()


@scene
def crowd(tape: Tape) -> None:
    talk = Talk(tape, 1).open()
    open_jobs = [talk.ask((1, 10 * n, 4)) for n in range(3)]
    for reference in reversed(open_jobs):
        talk.bring(b"\1\2\3\4", reference=reference)
    talk.put(1, 0, bytes(500))  # longer than agreed
    talk.put(1, 0, bytes(510))
    talk.put(1, 0, bytes(505))
    talk.close()


@scene
def split(tape: Tape) -> None:
    """A poll in parts that meets a write once, and a read and write in parts that meet."""
    known(tape).close()
    poll, writer = Talk(tape, 2).open(), Talk(tape, 3).open()
    there = bytearray(OLD)
    for turn in range(3):
        poll.get(1, 0, bytes(there[:ROOM]))
        if turn == 1:
            writer.put(1, ROOM - 8, NEW[:16])
            there[ROOM - 8 : ROOM + 8] = NEW[:16]
        poll.get(1, ROOM, bytes(there[ROOM:]))
    writer.put(1, 0, NEW[:ROOM_PUT])
    poll.get(1, ROOM_PUT - 2, NEW[:2] + OLD[:2])
    writer.put(1, ROOM_PUT, NEW[ROOM_PUT:])
    poll.close()
    writer.close()


@scene
def one_job(tape: Tape) -> None:
    known(tape)
    reader, writer = Talk(tape, 2).open(), Talk(tape, 3).open()
    reader.ask((1, 10, 64))
    writer.put(1, 0, NEW[:100])
    reader.bring(OLD[:32] + NEW[:32])
    writer.close()


@scene
def writers(tape: Tape) -> None:
    one, two = Talk(tape, 1).open(), Talk(tape, 2).open()
    one.put(1, 0, b"\x11" * 8)
    two.put(1, 4, b"\x22" * 8)
    one.put(1, 0, b"\x33" * 8)


@scene
def drive(tape: Tape) -> None:
    """A drive that first only seems to be one, then keeps a value although one lies on it."""
    talk = Talk(tape, 1).open(slot=0)
    talk.get(2114, 1024, b"\0\1\2\3")
    for refused in (5, 0x0A):
        talk.ask((2114, 1024, 5))
        talk.bring(refused)
    talk.put(1120, 2048, b"\x41\x20\0\0").put(1120, 2049, b"\x42\x20\0\0")
    talk.get(1120, 2048, b"\x41\x20\0\0")
    talk.ask((9999, 3072, 2), data=b"\1\2")
    talk.take(3)
    talk.close()


@scene
def blocks(tape: Tape) -> None:
    talk = Talk(tape, 1).open()
    talk.get(1, 0, bytes(33)).get(1, 0, bytes(32)).get(1, 0, bytes(33))
    talk.put(2, 0, bytes(64))


@scene
def evidence(tape: Tape) -> None:
    """A CPU says what it is, then how many bytes it reads consistently: the larger number counts."""
    talk = Talk(tape, 1).open()
    talk.szl(0x0111, 1, b"\0\1" + b"6ES7 416-3XL00-0AB0 " + bytes(6))
    talk.get(1, 0, bytes(200)).get(1, 0, bytes(200))
    talk.szl(0x0131, 3, b"\0\3" + bytes(4) + (100).to_bytes(2) + bytes(32))
    talk.get(1, 0, bytes(200)).get(1, 0, bytes(90))


@scene
def bsend(tape: Tape) -> None:
    talk = Talk(tape, 1).open()
    for sizes, total, mark in (((400, 200), 600, "ok"), ((400, 100), 600, "sum"), ((400,), 600, "open"),
                               ((400, 200), 600, "sequence"), ((400, 100, 100), 600, "silent")):  # fmt: skip
        r_id = hash(mark) & 0xFFFF
        for n, size in enumerate(sizes):
            last = n == len(sizes) - 1 and mark != "open"
            sequence = 0 if not n else 6 if mark == "sequence" else 5
            reference = talk.segment_of(r_id, bytes(size), sequence, last, None if n else total)
            if mark != "silent" or n != 1:
                talk.acknowledge(reference)
    talk.acknowledge(talk.segment_of(77, bytes(9), 0, True, 9), error=0xD202)
    talk.acknowledge(talk.segment_of(78, bytes(9), 0, False, 18))
    talk.acknowledge(talk.segment_of(78, bytes(9), 0, True, 9))
    talk.close()


@scene
def usend(tape: Tape) -> None:
    talk = Talk(tape, 1).open()
    talk.usend(7, bytes(10))
    talk.usend(8, bytes(3), bytes(5))
    talk.usend(7, bytes(12), bytes(3))
    talk.usend(7, bytes(12), bytes(3))


@scene
def connections(tape: Tape) -> None:
    late = Talk(tape, 9)
    late.get(1, 0, bytes(4)).get(1, 4, bytes(4))
    for station in (1, 2, 2):
        Talk(tape, station, 40_000 + len(tape.shots)).dial(slot=35).close()
    reset = Talk(tape, 3).dial()
    reset.segment(False, flags=0x14)
    down = Talk(tape, 4).dial()
    down.tpkt(False, b"\x06\x80\0\1\0\0\x03")
    down.close()
    setup = Talk(tape, 5).dial().confirm()
    setup.say(True, JOB, b"\xf0\0\0\1\0\1\1\xe0")
    setup.say(False, ACK, b"", reference=setup.reference, error=0x8500)
    late.close()


@scene
def readback(tape: Tape) -> None:
    Talk(tape, 1).open().put(1, 0, b"\1\2\3\4").get(1, 2, b"\3\5\0\0").get(1, 2, b"\3\5\0\0")


@cache
def read(name: str) -> Reading:
    tape = Tape()
    SCENES[name](tape)
    with TemporaryDirectory() as folder:
        path = tape.write(Path(folder) / f"{name}.pcapng")
        options = ["-f", "json", "--channels", "s7"]
        options += ["--s7-block", str(BLOCK)] if name == "blocks" else []
        options += ["--s7-readback"] if name == "readback" else []
        plain = json.loads(reading.report([path], *options))["captures"][0]
        return Reading(name, plain, wire.read(path))


def of(finding: Finding, item: Reading) -> list[str]:
    """What the auditor says of a finding."""
    told = list(s7.of(finding, item, BLOCK if item.name == "blocks" else None))
    if set(finding.args) != set(rules()[finding.rule].args):
        told.append("has other arguments")
    if finding.frame not in finding.frames:
        told.append("its own frame is not among its frames")
    return told


@pytest.mark.parametrize("name", SCENES)
def test_what_is_told_is_true(name: str) -> None:
    item = read(name)
    assert item.findings
    for finding in item.findings:
        assert (of(finding, item), finding) == ([], finding)
        assert list(words.problems(finding.rule, finding.message, finding.args)) == []


def test_each_rule_is_in_a_scene_and_has_an_auditor() -> None:
    found = {finding.rule for name in SCENES for finding in read(name).findings}
    mine = {rule for rule in rules() if rule.startswith("DS9")}
    assert found == mine == set(s7.AUDITORS)


def test_each_word_is_in_a_scene() -> None:
    found = {
        str(f.args["case"]) for name in SCENES for f in read(name).findings if "case" in f.args
    }
    assert found >= {
        "mixed_split", "mixed_job", "mixed_put", "bsend_open", "bsend_sum", "bsend_sequence", "r_id_open",
        "r_id_refused", "refused_no_confirm", "refused_disconnect", "refused_reset", "refused_setup",
        "block_chosen", "block_said", "block_order",
    }  # fmt: skip


def forged() -> Iterator[tuple[Finding, str, Reading]]:
    """All findings, each argument made false."""
    for name in SCENES:
        for finding in read(name).findings:
            for key, value in finding.args.items():
                for other in _others(value):
                    lie = copy.copy(finding)
                    lie.args = {**finding.args, key: other}
                    yield lie, key, read(name)


def _others(value: Any) -> Iterator[Any]:
    if value is None:
        yield 1
    elif isinstance(value, int):
        yield value + 1
        yield None
    elif isinstance(value, str):
        yield ("1" if value[:1] != "1" else "2") + value[1:]
    else:
        yield [*value, 7777]
        yield value[1:]


def test_a_false_argument_is_noticed() -> None:
    lies = list(forged())
    missed = [
        f"{lie.rule} {key}={lie.args[key]!r} in {item.name}"
        for lie, key, item in lies if not of(lie, item)
    ]  # fmt: skip
    assert missed == []
    assert len(lies) > 300


def test_a_false_frame_is_noticed() -> None:
    missed = []
    for name in SCENES:
        item = read(name)
        for finding in item.findings:
            lie = copy.copy(finding)
            lie.frame = finding.frame % len(item.capture.frames) + 1
            lie.frames = [*finding.frames, lie.frame]
            if not of(lie, item):
                missed.append(f"{lie.rule} in {name}")
    assert missed == []


def test_a_sentence_of_other_arguments_is_noticed() -> None:
    missed = []
    for lie, key, item in forged():
        if key not in words.named(lie.rule, lie.args):
            continue
        if not list(words.problems(lie.rule, lie.message, lie.args)):
            missed.append(f"{lie.rule} {key}={lie.args[key]!r}: {lie.message} ({item.name})")
    assert missed == []


def test_the_server_is_one() -> None:
    assert {each.server[0] for each in s7.s7_wire.read(read("split").capture.frames)} == {SERVER}
    assert DONE == 0xFF
