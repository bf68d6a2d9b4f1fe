"""The auditor over the stored captures and random conversations, and the auditor itself against false findings."""

from __future__ import annotations

import atexit
import copy
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from test_profibus_bus import everything_wrong
from tests.audit import (
    conversations,
    drive,
    lines,
    machines,
    message,
    partners,
    reading,
    run,
    wire,
    words,
)
from tests.audit import seeds as many
from tests.audit.memory import MAYBE, NEVER, SURE, Memory, Target
from tests.audit.reading import Finding, Reading
from tests.audit.seeds import Plan

from ds47.lab import captured
from ds47.spec import rules

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared" / "captures"
STORED = sorted(
    path
    for folder in (".", "real-stacks", "s7-stacks", "profibus")
    for path in (ROOT / "captures" / folder).glob("*.pcap*")
)
OTHERS = sorted(SHARED.rglob("*.pcap*")) if SHARED.is_dir() else []
TWO_CONTROLLERS = ROOT / "captures/real-stacks/o3_two_controllers.pcapng"
HEAVY = ("reverse-3000.pcap.gz", "ipfrag-silent.pcap", "s7-refused-20k.pcap.gz")
"""Captures made to hurt: what is forgotten because memory is bounded is not what they are about here."""
FALSE_STILL: dict[str, set[str]] = {}
"""Captures of which reports still say something false, and where. A repair is noticed."""
ANYWHERE = ("DS105", "DS725")
"""Rules about several frames, that may stand on any of them."""
CONVERSATIONS = int(os.environ.get("DS47_AUDIT", "40"))
SLICES = 4


@cache
def two_controllers() -> Reading:
    return reading.read(TWO_CONTROLLERS)


@cache
def before() -> Counter[str]:
    """What is complained of in a capture that tests let the report lie about."""
    return Counter(map(str, run.complaints(two_controllers())))


@cache
def lines_of_profibus() -> list[Path]:
    """A line with every trouble that has a rule, and some by chance."""
    folder = Path(tempfile.mkdtemp(prefix="ds47-lines-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "wrong.pcapng").write_bytes(captured(everything_wrong().stage))
    planned = [each for each in many.planned(60, 3) if isinstance(each, lines.Plan)]
    for number, plan in enumerate(planned):
        lines.play(plan).tape.write(folder / f"line-{number}.pcap")
    return sorted(folder.iterdir(), reverse=True)


# What reports say


@pytest.mark.slow
@pytest.mark.parametrize("path", STORED, ids=lambda path: path.name)
def test_a_stored_capture(path: Path) -> None:
    assert list(map(str, run.complaints(reading.read(path)))) == []


@pytest.mark.slow
@pytest.mark.parametrize("path", OTHERS, ids=lambda path: path.name)
def test_another_capture(path: Path) -> None:
    if path.name in HEAVY:
        pytest.skip("a capture made to hurt")
    told = run.audit(path)
    wanted = FALSE_STILL.get(path.name, set())
    assert {each.rule for each in told} == wanted, list(map(str, told))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(SLICES))
def test_random_conversations(number: int, tmp_path: Path) -> None:
    for plan in many.planned(CONVERSATIONS // SLICES, number):
        assert list(map(str, many.of_plan(plan, tmp_path))) == [], plan.text()


@pytest.mark.parametrize("plan", many.kept(), ids=lambda plan: str(plan.seed))
def test_what_once_had_a_complaint(plan: Plan, tmp_path: Path) -> None:
    assert list(map(str, many.of_plan(plan, tmp_path))) == []


def test_each_rule_has_an_auditor_or_a_reason_to_have_none() -> None:
    assert set(run.AUDITORS) | set(run.NO_CLAIM) == set(rules())
    assert not set(run.AUDITORS) & set(run.NO_CLAIM)


# The auditor itself


def mutated(value: Any) -> Iterator[Any]:
    """Values that are not this one."""
    if value is None:
        yield 1
    elif isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield value + 1
        yield None
    elif isinstance(value, float):
        yield value + 1.0
    elif isinstance(value, str):
        yield ("1" if value[:1] != "1" else "2") + value[1:]
    elif isinstance(value, list):
        yield [*value, 77]
    elif isinstance(value, dict):
        yield {**value, "slot": value["slot"] + 7}


def forged(item: Reading, memory: Memory, seen: Counter[Any]) -> Iterator[tuple[Finding, str]]:
    """True findings of a capture, each argument made false: three of each in all captures together."""
    for finding in item.findings:
        if list(run.of_finding(finding, item, memory)):
            continue
        for name, value in finding.args.items():
            seen[finding.rule, name] += 1
            if seen[finding.rule, name] > 3:
                continue
            for other in mutated(value):
                lie = copy.copy(finding)
                lie.args = {**finding.args, name: other}
                yield lie, name


def displaced(item: Reading, seen: Counter[Any]) -> Iterator[Finding]:
    """Findings of a capture with another frame: two of each rule in all captures together."""
    for finding in item.findings:
        seen[finding.rule] += 1
        if seen[finding.rule] > 2 or finding.rule in ANYWHERE:
            continue
        lie = copy.copy(finding)
        last = len(item.capture.frames)
        lie.frame = finding.frame % last + 1 if last > 1 else 99
        lie.frames, lie.filter = [lie.frame], f"frame.number == {lie.frame}"
        yield lie


@pytest.mark.slow
def test_what_is_not_so_is_noticed() -> None:
    """False arguments, false frames, and sentences of other arguments; each capture is read once for all."""
    missed, tried, seen = [], Counter[str](), Counter[Any]()
    for path in [*lines_of_profibus(), *STORED]:
        item = reading.read(path)
        memory = Memory(item)
        for lie, name in forged(item, memory, seen):
            tried[lie.rule] += 1
            told = f"{lie.rule} {name}={lie.args[name]!r} in {item.name} frame {lie.frame}"
            if not list(run.of_finding(lie, item, memory)):
                missed.append(told)
            is_named = name in words.named(lie.rule, lie.args)
            if is_named and not list(words.problems(lie.rule, lie.message, lie.args)):
                missed.append(f"{told}: {lie.message}")
        for lie in displaced(item, seen):
            if not list(run.of_finding(lie, item, memory)):
                missed.append(f"{lie.rule} in {item.name}: frame {lie.frame} is not its frame")
    assert missed == []
    assert len(tried) > 50, sorted(tried)
    assert {f"DS{number}" for number in range(801, 816)} <= set(tried)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (r"NOT OK: ", "OK: "),
        (r"1 drive,", "2 drives,"),
        (r"latency p50 ", "latency p50 1"),
        (r"p95 ", "p95 1"),
        (r"p99 ", "p99 1"),
        (r"max ", "max 1"),
        (r" transactions: 79 ok", " transactions: 78 ok"),
        (r" findings: 134 error", " findings: 130 error"),
        (r"STATUS DE80B500", "STATUS DF80B500"),
        (r"frame.number == 152", "frame.number == 153"),
        (r"polled 2 times", "polled 3 times"),
        (r"read again 1 time", "read again 2 times"),
        (r"LEN 10 ", "LEN 12 "),
        (r"WRREC DONE, STATUS 00000000; RDREC VALID", "WRREC, its response is not in the capture; RDREC VALID"),
        (r"; RDREC VALID, STATUS 00000000, LEN 10 ",
         "; RDREC VALID, STATUS 00000000, LEN 0; RDREC VALID, STATUS 00000000, LEN 10 "),
        (r"; RDREC VALID, STATUS 00000000, LEN 10 ",
         "; RDREC, no response before the capture ends; RDREC VALID, STATUS 00000000, LEN 10 "),
        (r": negative response, in part", ": negative response"),
        (r"VALID once more", "VALID, once more"),
        (r"  4 frames 2.1 ms", "  5 frames 2.1 ms"),
        (r"  4 frames 2.1 ms", "  4 frames 3.1 ms"),
        (r"DS414 note change-superseded: 4 findings", "DS414 note change-superseded: 5 findings"),
        (r"p1937[0] :=", "p1938[0] :="),
        (r"  [error]  ", "  [partial]  "),
    ],
)  # fmt: skip
def test_a_false_word_of_the_text_is_noticed(was: str, becomes: str) -> None:
    item = two_controllers()
    assert was in item.text
    lie = copy.copy(item)
    lie.text = item.text.replace(was, becomes, 1)
    assert Counter(map(str, run.complaints(lie))) - before()


@pytest.mark.parametrize("kind", ["text", "page"])
def test_a_false_word_of_the_status_word_is_noticed(kind: str) -> None:
    item = reading.read(ROOT / "captures/cyclic-changed-after-off1.pcapng")
    lie, told = copy.copy(item), getattr(item, kind)
    start = told.index("the status word of the drive (#1)")
    setattr(lie, kind, told[:start] + told[start:].replace("since frame 40", "since frame 41", 1))
    assert not list(run.complaints(item))
    assert list(run.complaints(lie))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("<dd>79</dd>", "<dd>80</dd>"),
        ("<dd>100</dd>", "<dd>101</dd>"),
        ("<dd>8.4 ms</dd>", "<dd>9.4 ms</dd>"),
        (">79 ok, 53 partial", ">80 ok, 53 partial"),
        (">53.9 ms</td>", ">53.8 ms</td>"),
        ("frame.number == 251 or", "frame.number == 252 or"),
        ("[5,1,1,", "[5,1,0,"),
    ],
)
def test_a_false_word_of_the_page_is_noticed(was: str, becomes: str) -> None:
    item = two_controllers()
    assert was in item.page
    lie = copy.copy(item)
    lie.page = item.page.replace(was, becomes, 1)
    assert Counter(map(str, run.complaints(lie))) - before()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("state", "ok"),
        ("operation", "vendor"),
        ("duration_ms", 1.0),
        ("start", "2026-11-21T12:14:23.166191825Z"),
        (
            "bytes",
            {"request": "0502020310010423", "response": "058202034000440200030001440200010000"},
        ),
        ("status", {"write": "DF80B500", "read": "00000000"}),
    ],
)
def test_a_false_transaction_is_noticed(key: str, value: Any) -> None:
    item = two_controllers()
    plain = copy.deepcopy(item.plain)
    assert plain["transactions"][4][key] != value
    plain["transactions"][4][key] = value
    lie = Reading(item.name, plain, item.capture, item.text)
    assert Counter(map(str, run.complaints(lie))) - before()


@pytest.mark.parametrize(
    "request_hex", ["c00201001001000a000006010064", "0102010110010423000006010003"]
)
def test_a_corrected_request_is_asked(request_hex: str) -> None:
    made = drive.Drive(
        "192.168.133.33", 0x002A, {1: {1059: drive.Parameter(0x06, [bytes(2)])}}, {1: 1}
    )
    answer = made.answer(1, 47, bytes.fromhex(request_hex))
    assert (answer is not None and answer[1] == 2) is (request_hex.startswith("01"))


# Identity


def test_which_drive_object_is_meant() -> None:
    item = two_controllers()
    memory = Memory(item)
    memory.heeding = {"a"}

    def target(device: str, axis: int | None, slot: int | None = None) -> Target:
        return Target(device, axis, None if slot is None else (slot, 1))

    same = memory.same
    assert same(target("a", 2), target("a", 2)) == SURE
    assert same(target("a", 2), target("a", 3)) == NEVER
    assert same(target("b", 2), target("b", 3)) == MAYBE, "it never said 0x19"
    assert same(target("a", 2), target("b", 2)) == NEVER
    assert same(target("a", 0), target("a", 2)) == MAYBE
    assert same(target("a", None, 1), target("a", None, 1)) == SURE
    assert same(target("a", None, 1), target("a", None, 2)) == MAYBE
    assert same(target("a", None, 1), target("a", 2)) == MAYBE
    assert same(target("a", 2, 1), target("a", 2)) == SURE, "PNU 975[7] says so"
    assert same(target("a", 2, 1), target("a", 3, 2)) == NEVER


# Its parts


def test_messages_are_walked() -> None:
    asked = message.request(
        bytes.fromhex("0502020210010423000010022b8100000601000307020000000100000002")
    )
    assert [each.pnu for each in asked.addresses] == [1059, 11137]
    assert [each.values() for each in asked.blocks] == [[3], [1, 2]]
    assert asked.sound
    assert not asked.rest
    answer = message.response(bytes.fromhex("058202034000440200030001440200010000"))
    assert [(each.code, each.info) for each in answer.blocks] == [(None, None), (3, 1), (1, 0)]
    assert message.response(bytes.fromhex("0581020144010811")).blocks[0].code == 0x0811
    assert message.request(bytes.fromhex("0501020210010423")).missing == 8


@pytest.mark.parametrize("kind", [conversations.Plan, lines.Plan, partners.Plan, machines.Plan])
def test_a_conversation_is_always_the_same(kind: type[Plan], tmp_path: Path) -> None:
    plan, again = (
        next(each for each in many.planned(20, 7) if isinstance(each, kind)) for _ in range(2)
    )
    many.play(plan).tape.write(tmp_path / "one")
    many.play(many.plan(again.text())).tape.write(tmp_path / "two")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert len(wire.read(tmp_path / "one").frames) == len(many.play(plan).tape.shots)


def test_filters_are_evaluated() -> None:
    assert reading.shown("frame.number == 3 or frame.number in {5..7}") == {3, 5, 6, 7}
    with pytest.raises(ValueError, match="not a filter"):
        reading.shown("frame.number == 3, 4")
