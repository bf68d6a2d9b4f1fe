"""Diagnoses DS7xx: each has a scenario and a near miss, says the right thing, and keeps quiet otherwise."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from uuid import UUID

import pytest

pytest.importorskip("scapy")

from ds47 import lab
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Diagnosis
from ds47.profidrive import decode_request
from ds47.report.sentences import sentence
from ds47.spec import rules

ROOT = Path(__file__).resolve().parents[2]
TOPIC = "diagnosis-"
MISS = "-not"
DIAGNOSES = {rule.id: rule for rule in rules().values() if rule.id.startswith("DS7")}
SCENARIOS = tuple(name for name in lab.scenarios() if name.startswith(TOPIC))
FIXED = message.address(2900)


def result_of(stage: Stage, path: Path) -> CaptureResult:
    """The analysis of what happened on a stage."""
    with PcapngWriter(path, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    return analyze(path, AnalysisOptions())


def diagnoses_of(name: str, tmp_path: Path) -> list[Diagnosis]:
    lab.write(name, tmp_path / "x.pcapng")
    return analyze(tmp_path / "x.pcapng", AnalysisOptions()).diagnoses


def rule_of(name: str) -> str:
    """The rule that a scenario is about: the longest name that it begins with."""
    bare = name.removeprefix(TOPIC)
    fits = [rule for rule in DIAGNOSES.values() if f"{bare}-".startswith(f"{rule.name}-")]
    return max(fits, key=lambda rule: len(rule.name)).id


# Scenarios and near misses


@pytest.mark.parametrize("rule", DIAGNOSES)
def test_each_diagnosis_has_a_scenario_and_a_near_miss(rule: str) -> None:
    name = TOPIC + DIAGNOSES[rule].name
    assert lab.scenarios()[name].expect.diagnoses == {rule}
    assert not lab.scenarios()[name + MISS].expect.diagnoses


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario_shows_its_own_diagnosis_or_none(name: str) -> None:
    expected = set() if name.endswith(MISS) else {rule_of(name)}
    assert lab.scenarios()[name].expect.diagnoses == expected


# What they say. Typed by hand from the frames of each scenario: first frame, and what must be read.

SAYS: dict[str, tuple[int, str]] = {
    "refusal-not-seen": (4, "response ID 0x82, 0x01"),
    "refusal-not-seen-state": (4, "response ID 0x81, 0x11"),
    "read-too-early": (2, "sent in frame 2, before the Write was answered in frame 3"),
    "nothing-was-asked": (6, "3 x Read"),
    "nothing-was-asked-elsewhere": (8, "1 x Read"),
    "old-answer": (8, "after the Write in frame 5 had been refused"),
    "old-answer-unsent": (6, "read again in frame 6, without a new request"),
    "two-users": (3, "192.168.133.2 wrote in frame 3 while its own request of frame 1 was open"),
    "two-users-connections": (
        7,
        "wrote in frame 7 (AR 74747474-0003-4000-8000-000000000003) while its request of frame 5 "
        "(AR 47474747-0001-4000-8000-000000000001) was open",
    ),
    "two-users-across": (
        7,
        "192.168.133.3 wrote in frame 7 while the request of 192.168.133.2 (frame 5) was open",
    ),
    "two-users-unknown": (
        5,
        "in frame 5 was refused with a state conflict; the capture shows no open request",
    ),
    "request-here-read-there": (6, "frame 3 went to slot 1.1, index 47"),
    "request-here-read-there-answered": (4, "slot 1.2, index 47 (frame 4)"),
    "wrong-record-index": (1, "record index 71 of 192.168.133.33 (DF80B000)"),
    "wrong-slot": (2, "slot 5.1, index 47 (DF80B200); slot 1.1, index 47 answers"),
    "wrong-slot-denied": (2, "slot 0.1, index 47 (DF80B600)"),
    "wrong-drive-object": (8, "(axis) 2"),
    "axis-byte-ignored": (8, "(1, 2)"),
    "request-length": (5, "after 12 bytes: number of parameters 1 needs 16"),
    "read-length": (4, "at most 10 bytes, but the response needs at least 22"),
    "read-length-refused": (4, "at most 10 bytes, but the response needs at least 22"),
    "response-too-long": (4, "6 of "),
    "response-too-long-refused": (4, "6 of "),
    "response-too-long-limit": (8, "; PNU 974[0] of the device is 139 bytes"),
    "value-in-wrong-type": (
        1,
        "Unsigned32 1092616192; according to the parameter list it is Float32 (0x08), in that format the same"
        " bits are 10.0",
    ),
    "value-in-wrong-type-integer": (
        1,
        "it is Unsigned16 (0x06), the same bits, read as a whole number",
    ),
    "value-in-wrong-type-taken": (1, "10.0"),
    "bytes-swapped": (5, "every word are swapped: read ref 4 axis 1 r2902[2]*4"),
    "bytes-swapped-fields": (1, "p2900[0]"),
    "bytes-swapped-values": (1, "p2900=Float32:10.0"),
    "data-block-layout": (5, "without the zeros between the bytes: read ref 4 axis 1 r2902[2]*4"),
    "data-block-layout-even": (
        5,
        "the fill bytes after single bytes: read ref 4 axis 1 r2902[2]*4",
    ),
    "index-and-count": (4, "p2900[1]"),
    "index-and-count-subindex": (4, "0x03"),
    "index-and-count-address": (4, "0x16"),
    "index-and-count-values": (4, "p1021[0] (number of elements 2)"),
    "commissioning-state": (4, "p0304[0] can be changed only with p0010 = 1"),
    "drive-running": (4, "p1082[0] cannot be changed now: 0x6B"),
    "drive-running-state": (4, "0x11"),
    "connector-as-number": (4, "p1070[0]"),
    "connector-as-number-word": (4, "Unsigned16 1 is not the number of a source"),
    "connector-as-number-link": (4, "its source p0052 was not accepted: 0x83"),
    "lost-at-power-off": (
        1,
        "p2900 changed on DO 1 of 192.168.133.33, not saved in this capture; last change in frame 5",
    ),
    "connection-lost": (3, "ended (frame 9)"),
    "connection-lost-restart": (3, "ended (frame 5)"),
    "request-held": (1, "8 times to 192.168.133.33, every 100.0 ms"),
    "polling-storm": (
        3,
        "36 Reads on 192.168.133.33 came before the response was ready, one every 2.0 ms; the drive takes 27.0 ms",
    ),
    "polling-storm-one": (3, "one every 2.0 ms; the drive takes 243.0 ms"),
    "half-captured": (1, "but no response (one direction was captured): 3"),
    "half-captured-responses": (2, "but no request (one direction was captured): 3"),
    "half-captured-reads": (2, "no Write with a request was captured"),
    "half-captured-cut": (4, "cut"),
    "half-captured-cut-short": (1, "cut short: 4"),
    "half-captured-dropped": (1, "dropped while capturing: 14"),
    "wrong-record-index-other": (1, "record index 0xB02D of 192.168.133.33 (DF80B000)"),
}


@pytest.mark.parametrize("name", [name for name in SCENARIOS if not name.endswith(MISS)])
def test_what_a_diagnosis_says(name: str, tmp_path: Path) -> None:
    frame, text = SAYS[name.removeprefix(TOPIC)]
    diagnosis, *others = diagnoses_of(name, tmp_path)
    assert {each.rule for each in others} <= {diagnosis.rule}
    assert diagnosis.frames[0] == frame
    assert text in sentence(diagnosis)


# The request as it should have been, typed by hand.

FIRST_SIX = "01010106" + "10080b560000" * 6
CORRECTED = {
    "wrong-drive-object": "02010101 1001 0015 0000",
    "response-too-long": FIRST_SIX,
    "response-too-long-refused": FIRST_SIX,
    "response-too-long-limit": "02010103" + "10080b560000" * 3,
    "bytes-swapped": "04010101 1004 0b56 0002",
    "bytes-swapped-fields": "01010101 1001 0b54 0000",
    "data-block-layout": "04010101 1004 0b56 0002",
    "data-block-layout-even": "04010101 1004 0b56 0002",
    "index-and-count": "01010101 1001 0b54 0000",
}


@pytest.mark.parametrize("name", CORRECTED)
def test_corrected_requests(name: str, tmp_path: Path) -> None:
    (diagnosis,) = diagnoses_of(TOPIC + name, tmp_path)
    assert diagnosis.corrected == bytes.fromhex(CORRECTED[name])
    request = decode_request(diagnosis.corrected)
    assert request.shaped
    assert not request.flaws


@pytest.mark.slow
def test_no_other_scenario_has_a_corrected_request(tmp_path: Path) -> None:
    given = {
        name.removeprefix(TOPIC)
        for name in SCENARIOS
        if any(each.corrected for each in diagnoses_of(name, tmp_path))
    }
    assert given == set(CORRECTED)


# Captures without fault


@pytest.mark.parametrize("name", [name for name in lab.scenarios() if name.startswith("seed-")])
def test_the_worked_examples_have_notes_at_most(name: str, tmp_path: Path) -> None:
    assert {each.severity for each in diagnoses_of(name, tmp_path)} <= {"note"}


@pytest.fixture(scope="module")
def quick() -> Callable[[], Stage]:
    """A stage that packs its frames itself: scapy would take minutes for so many."""
    path = ROOT / "bench" / "make_dense.py"
    spec = importlib.util.spec_from_file_location("make_dense", path)
    assert spec is not None
    assert spec.loader is not None
    module = ModuleType("make_dense")
    sys.modules["make_dense"] = module
    spec.loader.exec_module(module)
    made: Callable[[], Stage] = module.QuickStage
    return made


@pytest.mark.slow
def test_ten_thousand_faultless_transactions_have_no_diagnosis(
    quick: Callable[[], Stage], tmp_path: Path
) -> None:
    """Reads and changes in turn, now and then a poll, saved at the end."""
    stage = quick()
    client = Client(stage)
    for number in range(9_999):
        reference, value = number % 255 + 1, float(number % 1000)
        if number % 3 == 0:
            request = message.change(reference, 1, (FIXED, message.real(value)))
            client.exchange(request, message.changed(reference, 1), polls=number % 4)
        elif number % 3 == 1:
            answer = message.answer(reference, 1, 1, message.real(value - 1))
            client.exchange(message.read(reference, 1, FIXED), answer)
        else:
            asked = [message.address(21), message.address(945, 0, 4)]
            found = [message.real(value), message.word(7900, number % 50, 0, 0)]
            request = message.read(reference, 1, *asked)
            client.exchange(request, message.answer(reference, 1, 1, *found))
    save = message.change(1, 1, (message.address(977), message.word(1)))
    client.exchange(save, message.changed(1, 1))
    result = result_of(stage, tmp_path / "x.pcapng")
    assert result.summary["ok"] == 10_000
    assert result.diagnoses == []


# One line for each cause


@pytest.mark.slow
def test_five_thousand_equal_symptoms_are_one_line(
    quick: Callable[[], Stage], tmp_path: Path
) -> None:
    stage = quick()
    client = Client(stage)
    for number in range(5_000):
        reference = number % 255 + 1
        request = message.change(reference, 1, (FIXED, message.real(float(number))))
        client.exchange(request, message.answer(reference, 0x82, 1, message.error(0x6B)))
    (diagnosis,) = result_of(stage, tmp_path / "x.pcapng").diagnoses
    assert (diagnosis.rule, diagnosis.severity, diagnosis.count) == ("DS719", "error", 5_000)
    assert diagnosis.frames == list(range(4, 4004, 4))
    assert (diagnosis.transactions, diagnosis.frames_left_out) == (list(range(1, 1001)), 4_000)
    assert diagnosis.device == "192.168.133.33"


def test_two_causes_are_two_lines_the_worse_and_the_more_frequent_first(tmp_path: Path) -> None:
    stage = Stage()
    client = Client(stage)
    for reference, code in enumerate((0x11, 0x6B, 0x6B, 0x01), start=1):
        request = message.change(reference, 1, (FIXED, message.real(1.0 * reference)))
        client.exchange(request, message.answer(reference, 0x82, 1, message.error(code)))
    done = message.change(5, 1, (FIXED, message.real(5.0)))
    client.exchange(done, message.changed(5, 1))
    found = result_of(stage, tmp_path / "x.pcapng").diagnoses
    assert [(each.rule, each.count, each.frames) for each in found] == [
        ("DS719", 2, [8, 12]),  # 0x6B
        ("DS719", 1, [4]),  # 0x11
        ("DS701", 1, [16]),
        ("DS721", 1, [17]),
    ]


# The numbers of spec/diagnoses.toml, one below and one at each of them


def _held(client: Client, count: int, pause: float = 96) -> None:
    for reference in range(1, count + 1):
        request = message.change(reference, 1, (FIXED, message.real(25.0)))
        client.exchange(request, message.changed(reference, 1))
        client.stage.wait(pause)


def _uneven(client: Client, pause: float) -> None:
    """Six equal changes 100 ms apart, but one of them later."""
    _held(client, 3)
    client.stage.wait(pause)
    _held(client, 3)


def _polled(client: Client, *polls: int) -> None:
    for reference, count in enumerate(polls, start=1):
        client.write(message.read(reference, 1, message.address(21)))
        for _ in range(count):
            client.poll()
        client.read(message.answer(reference, 1, 1, message.real(float(reference))))


@pytest.mark.parametrize(
    ("talk", "arguments", "expected"),
    [
        (_held, (4,), set()),
        (_held, (5,), {"DS723"}),
        (_held, (5, 9_996), {"DS723"}),
        (_held, (5, 9_997), set()),
        (_uneven, (20,), {"DS723"}),
        (_uneven, (21,), set()),
        (_polled, (10, 10, 10), {"DS724"}),
        (_polled, (10, 9, 10), set()),
        (_polled, (10, 10, 9, 10), set()),
        (_polled, (99,), set()),
        (_polled, (100,), {"DS724"}),
    ],
)
def test_the_limits(
    talk: Callable[..., None], arguments: tuple[float, ...], expected: set[str], tmp_path: Path
) -> None:
    stage = Stage()
    talk(Client(stage), *arguments)
    found = {each.rule for each in result_of(stage, tmp_path / "x.pcapng").diagnoses}
    assert found - {"DS721"} == expected


# Details that decide

SPEED = message.address(21)
SHORT = message.read(1, 1, SPEED)
TEN = message.real(10.0)


def _refused(client: Client, code: int, where: bytes, value: bytes | None = None) -> None:
    """A request for one parameter that fails: a change where there is a value."""
    identifier = 2 if value else 1
    request = message.header(1, identifier, 1, 1) + where + (value or b"")
    client.exchange(request, message.answer(1, identifier | 0x80, 1, message.error(code)))


def no_index(client: Client) -> None:
    _refused(client, 0x03, message.address(2902, 0, 1))


def no_parameter_number(client: Client) -> None:
    _refused(client, 0x16, message.address(0, 0, 2))


def one_array_too_long(client: Client) -> None:
    _refused(client, 0x15, message.address(2902, 0, 60))


def no_array_to_change(client: Client) -> None:
    _refused(client, 0x04, message.address(2900, 3, 1), TEN)


def response_after_a_refused_write(client: Client) -> None:
    client.write(SHORT, status=0xDF80C200)
    client.read(message.answer(1, 0x81, 1, message.error(0x01)))


def long_after_another_integer(client: Client) -> None:
    """p0922 is 9, which is no length of a message."""
    request = message.read(1, 1, message.address(922))
    client.exchange(request, message.answer(1, 1, 1, message.word(9)))
    many = [message.address(2902, 0, 8)] * 8
    found = message.answer(2, 1, 1, *[message.real(*range(8))] * 5)
    client.exchange(message.read(2, 1, *many), found)


def description_is_no_format(client: Client) -> None:
    """The identifier of P2900 is a word, its value is not."""
    request = message.read(1, 1, message.address(2900, 1, 1, message.DESCRIPTION))
    client.exchange(request, message.answer(1, 1, 1, message.block(0x42, "H", 0x0008)))
    _refused(client, 0x05, FIXED, message.block(0x07, "I", 0x41200000))


def cut_change(client: Client, length: int) -> None:
    """A change whose LEN is too small."""
    client.exchange(SHORT, message.answer(1, 1, 1, TEN))
    client.write(message.change(2, 1, (FIXED, TEN))[:length], status=0xDF80B700)


def reads_elsewhere_before(client: Client) -> None:
    """Reads for nothing at slot 1.2, and only then a request at 1.1 that stays open."""
    client.connect("plc")
    client.exchange(SHORT, message.answer(1, 1, 1, TEN))
    client.poll(at=client.at(subslot=2))
    client.write(message.read(2, 1, SPEED))


def asked_there_unseen(client: Client) -> None:
    """Slot 1.2 was asked as well: of that only the Write response is in the capture."""
    client.exchange(SHORT, message.answer(1, 1, 1, TEN))
    client.write(message.read(2, 1, SPEED))
    there = client.at(subslot=2)
    client.stage.deaf = True
    lost = client.ask_write(message.read(3, 1, SPEED), at=there)
    client.stage.deaf = False
    client.accept_write(lost, message.read(3, 1, SPEED), at=there)
    client.poll(at=there)


def reads_elsewhere_and_before(client: Client) -> None:
    """Two Reads for nothing, of which only that at 1.2 has to do with the request at 1.1."""
    client.connect("plc")
    client.exchange(SHORT, message.answer(1, 1, 1, TEN))
    client.poll()
    client.write(message.read(2, 1, SPEED))
    client.poll(at=client.at(subslot=2))


def reads_in_another_api(client: Client) -> None:
    """Slot and index are the same, and the API is not told: nothing was looked for at another place."""
    client.connect("plc")
    client.exchange(SHORT, message.answer(1, 1, 1, TEN), at=client.at(slot=3))
    client.write(message.read(2, 1, SPEED))
    client.poll(at=client.at(api=0x3A00))


def reads_elsewhere_after_a_refusal(client: Client) -> None:
    """A request that was turned away is not open anywhere."""
    client.connect("plc")
    client.exchange(SHORT, message.answer(1, 1, 1, TEN), at=client.at(slot=3))
    client.write(message.read(2, 1, SPEED), status=0xDF80C200)
    client.poll(at=client.at(subslot=2))


def release_while_a_change_is_polled(client: Client) -> None:
    client.write(message.change(1, 1, (message.address(977), message.word(1))))
    client.poll()
    client.release()


def save_that_is_refused(client: Client) -> None:
    client.exchange(message.change(1, 1, (FIXED, TEN)), message.changed(1, 1))
    _refused(client, 0x11, message.address(977), message.word(1))


def change_after_the_save(client: Client) -> None:
    """Displaced before its response was read, so it is over before the save is."""
    save = message.change(1, 1, (message.address(977), message.word(1)))
    client.exchange(save, message.changed(1, 1))
    client.write(message.change(2, 1, (FIXED, TEN)))
    client.exchange(message.read(3, 1, SPEED), message.answer(3, 1, 1, TEN))


def held_and_not_read(client: Client) -> None:
    """Five equal changes; the second is displaced, and so over before the first one."""
    for reference in range(1, 6):
        request = message.change(reference, 1, (FIXED, TEN))
        client.write(request)
        if reference != 2:
            client.read(message.changed(reference, 1))
        else:
            client.stage.wait(2)  # as long as the Read takes
        client.stage.wait(96)


def slot_refused_once(client: Client) -> None:
    """Slot 3 refuses once and takes the next request: it is the right one."""
    there = client.at(slot=3)
    client.write(message.read(1, 1, SPEED), status=0xDF80B200, at=there)
    client.exchange(message.read(2, 1, SPEED), message.answer(2, 1, 1, TEN), at=there)
    client.exchange(message.read(3, 1, SPEED), message.answer(3, 1, 1, TEN))


def api_refused(client: Client) -> None:
    """Slot 3 refuses API 0 and takes a request of the drives' API: the slot is the right one."""
    client.write(message.read(1, 1, SPEED), status=0xDF80B200, at=client.at(slot=3, api=0))
    there = client.at(slot=3, api=0x3A00)
    client.exchange(message.read(2, 1, SPEED), message.answer(2, 1, 1, TEN), at=there)
    client.exchange(message.read(3, 1, SPEED), message.answer(3, 1, 1, TEN))


def slot_refuses_twice(client: Client) -> None:
    """The job of the Write is closed last, and its status is the first."""
    there = client.at(slot=3, index=0xB02F)
    client.write(message.read(1, 1, SPEED), status=0xDF80B200, at=there)
    other = client.at(ar=UUID(int=2), slot=3, index=0xB02F)
    client.poll(0xDE80B200, at=other)
    client.exchange(message.read(3, 1, SPEED), message.answer(3, 1, 1, TEN))


@pytest.mark.parametrize(
    ("talk", "arguments", "expected"),
    [
        (held_and_not_read, (), {"DS723": "5 times", "DS721": ""}),
        (slot_refused_once, (), {}),
        (api_refused, (), {}),
        (slot_refuses_twice, (), {"DS708": "(DF80B200)"}),
        (no_index, (), {"DS701": ""}),
        (no_parameter_number, (), {"DS701": ""}),
        (one_array_too_long, (), {"DS713": "Parameters answered: 0 of 1, "}),
        (no_array_to_change, (), {"DS717": "p2900[3]"}),
        (response_after_a_refused_write, (), {}),
        (long_after_another_integer, (), {}),
        (description_is_no_format, (), {"DS714": "describes p2900 as Float32 (0x08) in frame 4"}),
        (cut_change, (8,), {"DS711": "after 8 bytes: number of parameters 1 needs 14"}),
        (cut_change, (10,), {"DS711": "after 10 bytes: number of parameters 1 needs 14"}),
        (cut_change, (15,), {"DS711": "after 15 bytes: number of parameters 1 needs 16"}),
        (asked_there_unseen, (), {"DS725": "or not captured: 1"}),
        (
            reads_elsewhere_and_before,
            (),
            {"DS725": "it ends before", "DS706": "slot 1.2", "DS703": "2 x Read"},
        ),
        (reads_elsewhere_before, (), {"DS725": "it ends before", "DS703": "1 x Read"}),
        (reads_in_another_api, (), {"DS725": "it ends before", "DS703": "1 x Read"}),
        (reads_elsewhere_after_a_refusal, (), {"DS703": "1 x Read"}),
        (release_while_a_change_is_polled, (), {"DS722": "frame 5"}),
        (save_that_is_refused, (), {"DS719": "p0977", "DS721": "in frame 1;"}),
        (change_after_the_save, (), {}),
    ],
)
def test_details(
    talk: Callable[..., None], arguments: tuple[int, ...], expected: dict[str, str], tmp_path: Path
) -> None:
    stage = Stage()
    talk(Client(stage), *arguments)
    found = result_of(stage, tmp_path / "x.pcapng").diagnoses
    assert [each.rule for each in found] == list(expected)
    for each in found:
        assert expected[each.rule] in sentence(each)


def test_corrected_requests_of_details(tmp_path: Path) -> None:
    corrected = []
    for talk in (no_array_to_change, one_array_too_long):
        stage = Stage()
        talk(Client(stage))
        (diagnosis,) = result_of(stage, tmp_path / "x.pcapng").diagnoses
        corrected.append(diagnosis.corrected)
    assert corrected == [None, None]  # no read shows the format; one parameter cannot be split


def test_an_axis_that_does_not_exist_is_never_suggested(tmp_path: Path) -> None:
    """DO 3 answers, 2 and 5 are refused: 3 is the one to ask, after the first refusal, too."""
    stage = Stage()
    client = Client(stage)
    for reference, axis in enumerate((3, 2, 5), start=1):
        found = message.error(0x19) if axis != 3 else TEN
        identifier = 0x81 if axis != 3 else 1
        answer = message.answer(reference, identifier, axis, found)
        client.exchange(message.read(reference, axis, SPEED), answer)
    corrected = [each.corrected for each in result_of(stage, tmp_path / "x.pcapng").diagnoses]
    assert corrected == [message.read(2, 3, SPEED), message.read(3, 3, SPEED)]


@pytest.mark.parametrize("code", [0x0011, 0x0811, 0x0819, 0x016B])
def test_a_number_of_a_maker_is_not_that_of_its_low_byte(code: int, tmp_path: Path) -> None:
    stage = Stage()
    _refused(Client(stage), code, FIXED, TEN)
    result = result_of(stage, tmp_path / "x.pcapng")
    assert [each.rule for each in result.diagnoses] == ["DS719" if code == 0x11 else "DS701"]
    (item,) = result.transactions
    assert item.parameters[0].error is not None
    assert item.parameters[0].error.code == code
    (told,) = [sentence(each) for each in result.findings if each.rule == "DS410"]
    assert f"0x{code:04X} Manufacturer" in told.replace(":", "") or code == 0x11


# Both languages, JSON, and the page


@pytest.mark.parametrize("name", [name for name in SCENARIOS if not name.endswith(MISS)])
def test_every_diagnosis_in_chinese(name: str, tmp_path: Path) -> None:
    lab.write(name, tmp_path / "x.pcapng")
    for diagnosis in analyze(tmp_path / "x.pcapng", AnalysisOptions()).diagnoses:
        assert any("\u4e00" <= letter <= "\u9fff" for letter in sentence(diagnosis, "zh"))
        assert "{" not in sentence(diagnosis, "zh")


@pytest.mark.slow
def test_the_page_is_what_the_captures_say() -> None:
    tool = ROOT / "tools" / "make_diagnoses.py"
    done = subprocess.run([sys.executable, str(tool), "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def listed(page: str) -> Counter[tuple[str, str, int, int]]:
    """What the table of the chapter on diagnoses says: capture, rule, count, first frame."""
    rows: Counter[tuple[str, str, int, int]] = Counter()
    captures: list[str] = []
    for line in page[page.index("## Diagnoses") :].splitlines():
        rule, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        if rule == "diagnosis":
            captures = cells[:-1]
        elif re.fullmatch(r"DS7\d\d", rule):
            for capture, cell in zip(captures, cells[:-1], strict=True):
                for frame, count in re.findall(r"(\d+)(?: x (\d+))?", cell):
                    rows[capture, rule, int(count or 1), int(frame)] += 1
    return rows


def test_the_diagnoses_of_the_real_captures_are_those_looked_at(captures: Path) -> None:
    found: Counter[tuple[str, str, int, int]] = Counter()
    for path in sorted((captures / "real-stacks").glob("*.pcapng")):
        for each in analyze(path, AnalysisOptions()).diagnoses:
            found[path.name.split("_")[0], each.rule, each.count, each.frames[0]] += 1
    assert listed((captures / "real-stacks" / "README.md").read_text("utf-8")) == found


def test_captures_without_the_channel_have_no_diagnosis(shared: Path) -> None:
    for path in sorted((shared / "captures").glob("*.pcap*")):
        assert analyze(path, AnalysisOptions()).diagnoses == [], path.name


def test_the_manifest_says_the_diagnoses(captures: Path) -> None:
    entries = tomllib.loads((captures / "MANIFEST.toml").read_text(encoding="utf-8"))["capture"]
    for entry in entries:
        expect = lab.scenarios()[entry["file"].removesuffix(".pcapng")].expect
        assert set(entry["diagnoses"]) == expect.diagnoses
        assert set(entry["rules"]) == expect.rules


def test_json_of_a_corrected_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from ds47.cli import main

    lab.write("diagnosis-index-and-count", tmp_path / "x.pcapng")
    main(["report", "-f", "json", str(tmp_path / "x.pcapng")])
    (capture,) = json.loads(capsys.readouterr().out)["captures"]
    (diagnosis,) = capture["diagnoses"]
    assert diagnosis["filter"] == "frame.number == 4"
    corrected = diagnosis["corrected"]
    assert corrected["request"] == "0101010110010b540000"
    assert corrected["words"] == ["16#0101", "16#0101", "16#1001", "16#0B54", "16#0000"]
    assert "#request[6] := 16#0B" in corrected["scl"]
    line = corrected["encode"].removeprefix("ds47 encode '").removesuffix("'")
    assert main(["encode", line]) == 0
    assert "".join(capsys.readouterr().out.split()).lower() == corrected["request"]
