"""What findings and diagnoses claim, where they once claimed more than the capture shows.

Each conversation is played by the lab's client; what may be said of it is typed by hand.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from uuid import UUID

import pytest

pytest.importorskip("scapy")

from tests.audit import cuts, wire

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Diagnosis, Finding, Report
from ds47.report import ReportOptions, text, write_all
from ds47.report.html.views.problems import problems
from ds47.report.sentences import advice_parts, sentence
from ds47.report.todo import answering
from ds47.report.verdict import blind
from ds47.spec import rules

Talk = Callable[[Client], object]
SPEED, FIXED = message.address(21), message.address(2900)
TEN = message.real(10.0)


def result_of(talk: Talk, tmp_path: Path, snap: int | None = None) -> CaptureResult:
    """The analysis of what a client does; `snap` bytes of each frame are captured."""
    stage = Stage()
    stage.snap = snap or stage.snap
    talk(Client(stage))
    path = tmp_path / "x.pcapng"
    with PcapngWriter(path, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    return analyze(path)


def told(talk: Talk, rule: str, tmp_path: Path) -> list[str]:
    """The sentences of a rule."""
    return [sentence(each) for each in of(result_of(talk, tmp_path), rule)]


def of(result: CaptureResult, rule: str) -> list[Finding]:
    return [each for each in result.findings if each.rule == rule]


def diagnosed(talk: Talk, rule: str, tmp_path: Path) -> Diagnosis:
    """The only diagnosis of a rule."""
    (found,) = (each for each in result_of(talk, tmp_path).diagnoses if each.rule == rule)
    return found


def refused(reference: int, *blocks: bytes, change: bool = False) -> bytes:
    """A response in which at least one parameter failed."""
    return message.answer(reference, 0x82 if change else 0x81, 1, *blocks)


# STATUS (DS701), what the capture cut (DS106), what it does not have (DS401)


def polled(client: Client) -> None:
    client.exchange(message.read(1, 1, SPEED), refused(1, message.error(0x01)), polls=3)


def test_a_status_that_was_not_zero_is_not_called_zero(tmp_path: Path) -> None:
    (text,) = told(polled, "DS701", tmp_path)
    assert text.endswith(
        "but the STATUS of the RDREC that fetched it is 0 (after 3 x DE80B500: not ready yet)"
    )


def of_two(*codes: int) -> Talk:
    """Two parameters that are refused."""
    asked = message.read(1, 1, SPEED, FIXED)
    return lambda client: client.exchange(asked, refused(1, *map(message.error, codes)))


def test_a_response_with_several_error_numbers_is_not_told_by_the_first_alone(
    tmp_path: Path,
) -> None:
    (one,), (several,) = (told(of_two(0x00, c), "DS701", tmp_path) for c in (0x00, 0x09))
    assert "parameter does not exist), but" in one
    assert "parameter does not exist and other error numbers), but" in several
    (chinese,) = of(result_of(of_two(0x00, 0x09), tmp_path), "DS701")
    assert "以及其他错误号）" in sentence(chinese, "zh")


def test_a_parameter_whose_request_is_not_there_has_no_question_mark_for_a_number(
    tmp_path: Path,
) -> None:
    def answered(client: Client) -> None:
        there = client.at(index=0xB02F)
        client.accept_read(client.ask_read(there), refused(1, message.error(0x6B)), there)

    (finding,) = of(result_of(answered, tmp_path), "DS410")
    assert sentence(finding).startswith(
        "A parameter of unknown number got a negative response: 0x6B"
    )
    assert sentence(finding, "zh").startswith("参数号未知的参数得到否定应答：0x6B")


def long_read(client: Client) -> None:
    answer = message.answer(1, 1, 1, message.real(*range(50)))
    client.exchange(message.read(1, 1, message.address(2902, 0, 50)), answer)


def test_what_the_capture_cut_is_no_fault_of_the_message(tmp_path: Path) -> None:
    rules = {each.rule for each in result_of(long_read, tmp_path, 260).findings}
    assert rules == {"DS106", "DS725"}


def cut_report(captures: Path, tmp_path: Path, snap: int) -> list[str]:
    """The first lines of a report of a capture of real stacks of which so many bytes of each frame are kept."""
    path = tmp_path / "cut.pcapng"
    with open_capture(captures / "real-stacks/o3_two_controllers.pcapng") as capture:
        frames = list(capture.everything(lambda _: True))
    with PcapngWriter(path, link_type=1) as writer:
        for frame in frames:
            data = frame.data[:snap]
            writer.write(frame.time_ns, data, original_length=frame.original_length)
    stream = io.StringIO()
    write_all(text.Writer(stream), Report([analyze(path)]))
    return stream.getvalue().splitlines()[1:4]


@pytest.mark.parametrize(
    ("snap", "said"),
    [
        (140, "none of 816 record messages can be decoded: cut at 140 bytes"),
        (60, "none of 834 RPC messages can be decoded: cut at 60 bytes"),
    ],
)
def test_records_that_are_cut_before_they_begin_are_not_none(
    captures: Path, tmp_path: Path, snap: int, said: str
) -> None:
    verdict, _, there = cut_report(captures, tmp_path, snap)
    assert verdict == f"WARNING: {said}"
    assert "no PROFINET RPC" not in there


def requests_only(client: Client) -> None:
    client.ask_write(message.read(1, 1, SPEED))
    client.ask_write(message.read(2, 1, SPEED))


def requests_and_an_answer(client: Client) -> None:
    requests_only(client)
    client.write(message.read(3, 1, SPEED))


def test_of_one_direction_nothing_is_said(tmp_path: Path) -> None:
    both = told(requests_only, "DS110", tmp_path)
    assert all(
        each.endswith("so far the capture has nothing that the device sent") for each in both
    )
    assert len(both) == 2


def test_a_capture_that_goes_on_has_not_ended(tmp_path: Path) -> None:
    first, second, last = told(requests_and_an_answer, "DS110", tmp_path)
    assert first.endswith("the response to its Write is not in the capture")
    assert second == first
    assert last.endswith("the capture ends before a response")


def read_without_ar(client: Client) -> None:
    from ds47.lab import wire

    nowhere = client.at(ar=wire.NIL, index=0xB02F)
    call = client.call(wire.READ_IMPLICIT)
    client.ask(call, wire.read_request(call.sequence, nowhere))
    client.accept_read(call, message.answer(7, 1, 1, TEN), at=nowhere)


def test_a_response_without_an_ar_did_not_begin_before_the_capture(tmp_path: Path) -> None:
    result = result_of(read_without_ar, tmp_path)
    (finding,) = of(result, "DS403")
    assert (
        "read without an AR (ReadImplicit), so neither its request nor the parameter numbers are known"
        in sentence(finding)
    )
    lines = [line.en for line in blind(result)]
    assert not [line for line in lines if "before the capture" in line]
    assert [line for line in lines if "without an AR" in line]


# What does not fit into a response (DS713)


def no_room_in_the_middle(client: Client) -> None:
    """Of three parameters the first fills most of 566 bytes, the second does not fit, the third does."""
    asked = [message.address(6000, 0, 140), message.address(6001, 0, 128), message.address(2)]
    found = [message.real(*range(140)), message.error(0x15), message.word(43)]
    client.exchange(message.read(1, 1, *asked), refused(1, *found))


def test_room_is_what_the_device_has_shown(tmp_path: Path) -> None:
    found = diagnosed(no_room_in_the_middle, "DS713", tmp_path)
    assert sentence(found) == (
        "Parameters answered: 2 of 3, p6001[0] got a negative response 0x15 (response too long); "
        "the capture shows a response of the device with 576 bytes"
    )
    assert found.corrected == message.read(1, 1, message.address(6000, 0, 140), message.address(2))


def limit_read_before(client: Client) -> None:
    limits = message.answer(1, 1, 1, message.word(600))
    client.exchange(message.read(1, 1, message.address(974)), limits)
    no_room_in_the_middle(client)


def test_room_is_what_the_device_said(tmp_path: Path) -> None:
    found = diagnosed(limit_read_before, "DS713", tmp_path)
    assert sentence(found).endswith("; PNU 974[0] of the device is 600 bytes")


def cut_by_the_capture(client: Client) -> None:
    long_read(client)
    asked = [message.address(pnu, 0, 20) for pnu in (2902, 2903, 2904)]
    found = [message.real(*range(20))] * 3
    client.exchange(message.read(2, 1, *asked), message.answer(2, 1, 1, *found))


def test_what_the_capture_cut_was_not_left_out(tmp_path: Path) -> None:
    result = result_of(cut_by_the_capture, tmp_path, 260)
    assert {each.rule for each in result.findings} == {"DS106", "DS725"}


# Another drive object (DS709)

LOCAL = 0xB02E


def no_object(client: Client, request: bytes, axis: int) -> None:
    """The device has no drive object of that number."""
    response_id = 0x80 | request[1]
    client.exchange(request, message.answer(request[0], response_id, axis, message.error(0x19)))


def found_object(client: Client, axis: int, index: int = 47) -> None:
    request = message.read(9, axis, message.address(27))
    client.exchange(request, message.answer(9, 1, axis, TEN), at=client.at(index=index))


def change_of_a_missing_object(client: Client) -> None:
    found_object(client, 2)
    no_object(client, message.change(1, 9, (FIXED, TEN)), 9)


def read_of_a_missing_object(client: Client) -> None:
    """What answers under 0xB02E is the slot, whatever the axis byte says."""
    found_object(client, 9, LOCAL)
    no_object(client, message.read(1, 9, SPEED), 9)
    client.exchange(message.read(9, 2, SPEED), message.answer(9, 1, 2, TEN))


def more_behind_it(client: Client) -> None:
    no_object(client, message.read(1, 9, SPEED) + b"\x12\x34", 9)
    client.exchange(message.read(9, 2, SPEED), message.answer(9, 1, 2, TEN))


def nothing_like_it_there(client: Client) -> None:
    """Whether the other drive object has this parameter nobody knows."""
    no_object(client, message.read(1, 9, SPEED), 9)
    found_object(client, 2)


def read_there_in_another_slot(client: Client) -> None:
    """Whether both slots reach the same drive object by its number nobody knows."""
    no_object(client, message.read(1, 9, SPEED), 9)
    answer = message.answer(9, 1, 2, TEN)
    client.exchange(message.read(9, 2, SPEED), answer, at=client.at(slot=2))


def no_text_there(client: Client) -> None:
    text = message.address(21, attribute=0x30)
    no_object(client, message.read(1, 9, text), 9)
    client.exchange(message.read(9, 2, SPEED), message.answer(9, 1, 2, TEN))


def two_objects(client: Client) -> None:
    found_object(client, 2)
    no_object(client, message.read(1, 9, SPEED), 9)
    found_object(client, 3)


def refused_there(client: Client) -> None:
    read_of_a_missing_object(client)
    request = message.read(2, 2, SPEED)
    client.exchange(request, message.answer(2, 0x81, 2, message.error(0x01)))


def read_under_local_access(client: Client) -> None:
    found_object(client, 2)
    request = message.read(1, 9, SPEED)
    answer = message.answer(1, 0x81, 9, message.error(0x19))
    client.exchange(request, answer, at=client.at(index=LOCAL))


@pytest.mark.parametrize(
    ("talk", "corrected", "others"),
    [
        (change_of_a_missing_object, None, "2"),
        (read_of_a_missing_object, message.read(1, 2, SPEED), "2"),
        (more_behind_it, message.read(1, 2, SPEED), "2"),
        (nothing_like_it_there, None, "2"),
        (read_there_in_another_slot, None, "2"),
        (no_text_there, None, "2"),
        (two_objects, None, "2, 3"),
        (refused_there, None, "2"),
        (read_under_local_access, None, "2"),
    ],
)
def test_another_drive_object(
    talk: Talk, corrected: bytes | None, others: str, tmp_path: Path
) -> None:
    result = result_of(talk, tmp_path)
    (found,) = (each for each in result.diagnoses if each.rule == "DS709")
    assert found.corrected == corrected
    assert answering(result, found) == others


# Another format, and what to send instead (DS714, DS717)


def seen_as_real(client: Client) -> None:
    client.exchange(message.read(7, 1, FIXED), message.answer(7, 1, 1, TEN))


def changed_as(client: Client, value: bytes, *more: tuple[bytes, bytes, int]) -> None:
    """P2900 under a wrong format is refused with 0x05; further changes with their error number, 0 for none."""
    request = message.change(1, 1, (FIXED, value), *(each[:2] for each in more))
    done = [message.error(each[2]) if each[2] else message.zero() for each in more]
    client.exchange(request, refused(1, message.error(0x05), *done, change=True))


def bits(client: Client) -> None:
    seen_as_real(client)
    changed_as(client, message.block(0x07, "I", 0x41200000))


def number(client: Client) -> None:
    seen_as_real(client)
    changed_as(client, message.block(0x06, "H", 10))


def never_read(client: Client) -> None:
    changed_as(client, message.block(0x07, "I", 0x41200000))


def read_of_another_object(client: Client) -> None:
    client.exchange(message.read(7, 2, FIXED), message.answer(7, 1, 2, TEN))
    changed_as(client, message.block(0x07, "I", 0x41200000))


def refused_besides(client: Client) -> None:
    seen_as_real(client)
    other = (message.address(304), message.real(5.0), 0x11)
    changed_as(client, message.block(0x07, "I", 0x41200000), other)


def refused_as_well(client: Client) -> None:
    """What would be sent instead was tried, and refused."""
    bits(client)
    changed_as(client, TEN)


WHOLE = message.change(1, 1, (FIXED, TEN))
ZERO = message.raw_block(0x40, 0, b"")
"""The block of a parameter that was changed, in a response in which another one failed."""


@pytest.mark.parametrize(
    ("talk", "says", "corrected"),
    [
        (
            bits,
            "is read as Float32 (0x08) in frame 4, in that format the same bits are 10.0",
            WHOLE,
        ),
        (
            number,
            "is read as Float32 (0x08) in frame 4, in that format the same number is 10.0",
            WHOLE,
        ),
        (
            never_read,
            "according to the parameter list it is Float32 (0x08), in that format the same bits are",
            None,
        ),
        (
            read_of_another_object,
            "according to the parameter list it is Float32 (0x08), in that format the same bits",
            None,
        ),
        (refused_besides, "is read as Float32 (0x08) in frame 4", WHOLE),
        (refused_as_well, "is read as Float32 (0x08) in frame 4", None),
    ],
)
def test_a_format_is_a_fact_where_it_was_read(
    talk: Talk, says: str, corrected: bytes | None, tmp_path: Path
) -> None:
    found = diagnosed(talk, "DS714", tmp_path)
    assert says in sentence(found)
    assert found.corrected == corrected


def test_what_was_refused_besides_has_its_own_cause(tmp_path: Path) -> None:
    result = result_of(refused_besides, tmp_path)
    assert [each.args["pnu"] for each in of(result, "DS719")] == [304]


def two_refused(client: Client) -> None:
    asked = [message.address(304, 2), message.address(305, 3), message.address(21)]
    found = [message.error(0x04), message.error(0x03), TEN]
    client.exchange(message.read(1, 1, *asked), refused(1, *found))


def test_each_refused_parameter_has_its_cause_and_is_asked_alone(tmp_path: Path) -> None:
    result = result_of(two_refused, tmp_path)
    assert [(each.args["pnu"], each.args["code"]) for each in of(result, "DS717")] == [
        (304, 0x04), (305, 0x03),
    ]  # fmt: skip
    corrected = [each.corrected for each in result.diagnoses if each.corrected]
    assert corrected == [message.read(1, 1, message.address(304))]


def other_counts(client: Client) -> None:
    request = message.change(1, 1, (message.address(46, 0, 2), message.real(5.0)))
    client.exchange(request, refused(1, message.error(0x18), change=True))


def test_which_count_is_meant_is_not_guessed(tmp_path: Path) -> None:
    assert diagnosed(other_counts, "DS717", tmp_path).corrected is None


def value_missing(client: Client) -> None:
    """The request ends before the value of its second parameter, which is no array."""
    request = message.change(1, 1, (FIXED, TEN), (message.address(304, 2), b""))
    client.exchange(request, refused(1, ZERO, message.error(0x04), change=True))


def test_a_value_that_is_not_there_is_not_sent_again(tmp_path: Path) -> None:
    assert diagnosed(value_missing, "DS717", tmp_path).corrected is None


def test_what_stands_behind_a_request_is_not_sent_again(tmp_path: Path) -> None:
    def talk(client: Client) -> None:
        asked = message.read(1, 1, message.address(304, 2)) + b"\x12\x34"
        client.exchange(asked, refused(1, message.error(0x04)))

    wanted = message.read(1, 1, message.address(304))
    assert diagnosed(talk, "DS717", tmp_path).corrected == wanted


def tried(client: Client, request: bytes, answer: bytes, slot: int = 1) -> None:
    """Another request of the same device."""
    client.exchange(request, answer, at=client.at(slot=slot))


def no_array(client: Client) -> None:
    request = message.read(1, 1, message.address(304, 2))
    client.exchange(request, refused(1, message.error(0x04)))


def unknown_elsewhere(client: Client) -> None:
    """p304 does not exist, says a change of another slot later."""
    no_array(client)
    request = message.change(2, 1, (message.address(304), TEN))
    tried(client, request, message.answer(2, 0x82, 1, message.error(0x00)), 2)


def another_text(client: Client) -> None:
    """p304 has no text: that says nothing of its value."""
    no_array(client)
    request = message.read(2, 1, message.address(304, attribute=0x30))
    tried(client, request, message.answer(2, 0x81, 1, message.error(0x0F)))


def axis_missing_later(client: Client) -> None:
    """The drive object itself is gone in the end."""
    no_array(client)
    no_object(client, message.read(2, 1, SPEED), 1)


def locked_value(client: Client) -> None:
    """The format is known, and the parameter cannot be changed at all, with whatever value."""
    number(client)
    request = message.change(2, 1, (FIXED, message.real(3.0)))
    tried(client, request, message.answer(2, 0x82, 1, message.error(0x11)))


@pytest.mark.parametrize(
    ("talk", "rule", "corrected"),
    [
        (no_array, "DS717", message.read(1, 1, message.address(304))),
        (another_text, "DS717", message.read(1, 1, message.address(304))),
        (unknown_elsewhere, "DS717", None),
        (axis_missing_later, "DS717", None),
        (locked_value, "DS714", None),
    ],
)
def test_what_the_capture_shows_to_be_refused_is_not_offered(
    talk: Talk, rule: str, corrected: bytes | None, tmp_path: Path
) -> None:
    assert diagnosed(talk, rule, tmp_path).corrected == corrected


def test_that_a_drive_object_does_not_exist_is_what_the_device_says(tmp_path: Path) -> None:
    """Through another slot it may answer."""

    def talk(client: Client) -> None:
        no_object(client, message.read(1, 2, SPEED), 2)
        tried(client, message.read(2, 2, SPEED), message.answer(2, 1, 2, TEN), 2)

    (text,) = told(talk, "DS709", tmp_path)
    assert text.endswith("192.168.133.33 says that drive object (axis) 2 does not exist")


def test_several_values_in_a_wrong_format_name_both_formats(tmp_path: Path) -> None:
    """Where the better one is known from is another thing in each of them."""

    def talk(client: Client) -> None:
        seen_as_real(client)
        for value in (10, 20):
            changed_as(client, message.block(0x06, "H", value))

    found = diagnosed(talk, "DS714", tmp_path)
    assert sentence(found) == "p2900 is written as Unsigned16, not as Float32 (0x08)"


def safety(client: Client) -> None:
    """p9601 was read as a simple parameter, and is written as an array."""
    place = message.address(9601)
    client.exchange(message.read(7, 1, place), message.answer(7, 1, 1, message.word(1)))
    request = message.change(1, 1, (message.address(9601, 1), message.word(1)))
    client.exchange(request, refused(1, message.error(0x04), change=True))


def test_safety_is_never_written_on_advice(tmp_path: Path) -> None:
    assert diagnosed(safety, "DS717", tmp_path).corrected is None


# Sources of connectors (DS720), lengths of requests (DS711), ignored axes (DS710)


def written_connector(client: Client, value: bytes, code: int) -> None:
    request = message.change(1, 1, (message.address(1070), value))
    client.exchange(request, refused(1, message.error(code), change=True))


@pytest.mark.parametrize(
    ("value", "code", "says"),
    [
        (message.block(0x07, "I", 52 << 16), 0x83, "its source p0052 was not accepted: 0x83"),
        (message.block(0x07, "I", 1), 0x83, "Unsigned32 1 is not the number of a source: 0x83"),
        (message.word(1), 0x05, "Unsigned16 1 is not the number of a source: 0x05"),
    ],
)
def test_a_source_is_no_number(value: bytes, code: int, says: str, tmp_path: Path) -> None:
    (text,) = told(lambda client: written_connector(client, value, code), "DS720", tmp_path)
    assert says in text


def too_short(client: Client, asked: bytes) -> None:
    client.write(asked, status=0xDF80B700)


THREE = message.read(1, 2, *[SPEED] * 3)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (THREE[:10], "after 10 bytes: number of parameters 3 needs 22, but it is just as long as a request for 1"),
        (THREE[:16], "after 16 bytes: number of parameters 3 needs 22, but it is just as long as a request for 2"),
        (THREE[:12], "after 12 bytes: number of parameters 3 needs 22"),
    ],
)  # fmt: skip
def test_a_length_that_fits_another_number(asked: bytes, says: str, tmp_path: Path) -> None:
    def talk(client: Client) -> None:
        client.exchange(message.read(9, 1, SPEED), message.answer(9, 1, 1, TEN))
        too_short(client, asked)

    (text,) = told(talk, "DS711", tmp_path)
    assert text.endswith(says)


def two_ways(client: Client) -> None:
    for axis in (0, 2):
        found_object(client, axis, LOCAL)


def test_axis_zero_is_no_other_axis(tmp_path: Path) -> None:
    assert not told(two_ways, "DS710", tmp_path)


# Changes that nobody saved: DS721


def changed(client: Client, reference: int, axis: int, pnu: int = 2900, index: int = 47) -> None:
    value = message.word(1) if pnu in (971, 977) else TEN
    request = message.change(reference, axis, (message.address(pnu), value))
    client.exchange(request, message.changed(reference, axis), at=client.at(index=index))


def unknown_outcome(client: Client) -> None:
    changed(client, 1, 2)
    client.write(message.change(2, 2, (FIXED, TEN)))
    changed(client, 3, 2)


def one_object_saved(client: Client) -> None:
    changed(client, 1, 2)
    changed(client, 2, 3)
    changed(client, 3, 2, 971)


def all_saved(client: Client) -> None:
    one_object_saved(client)
    changed(client, 4, 2, 977)


def perhaps_saved(client: Client) -> None:
    """The drive object of a slot may be any of the axes."""
    changed(client, 1, 2)
    changed(client, 2, 3)
    changed(client, 3, 9, 971, LOCAL)
    changed(client, 4, 3)


def two_objects_changed(client: Client) -> None:
    changed(client, 1, 2)
    changed(client, 2, 3)


SAVE = (message.address(977), message.word(1))


def save_unread(client: Client) -> None:
    """p0977 whose response nobody fetched: whether the change before it is saved is not known."""
    changed(client, 1, 2)
    client.write(message.change(2, 2, SAVE))
    changed(client, 3, 2)


def object_save_unread(client: Client) -> None:
    changed(client, 1, 2)
    changed(client, 2, 3)
    client.write(message.change(3, 2, (message.address(971), message.word(1))))
    changed(client, 4, 3)


def read_refused(client: Client) -> None:
    """The change was accepted, and the Read of its response failed for another reason."""
    client.write(message.change(1, 2, (FIXED, TEN)))
    client.poll(0xDE80B600)
    changed(client, 2, 2)


def response_without_its_blocks(client: Client) -> None:
    """Something failed, but what that is stands in blocks that are not there."""
    client.exchange(message.change(1, 2, (FIXED, TEN), (SPEED, TEN)), bytes((1, 0x82, 2, 2)))
    changed(client, 2, 2)


def saved_in_the_middle(client: Client) -> None:
    client.exchange(message.change(1, 2, (FIXED, TEN), SAVE), message.changed(1, 2, 2))
    client.exchange(message.change(2, 2, SAVE, (FIXED, TEN)), message.changed(2, 2, 2))


def saved_in_the_same_frame(client: Client) -> None:
    """The change stands before the save, in one IODWriteMultiple."""
    change, save = message.change(1, 2, (FIXED, TEN)), message.change(2, 2, SAVE)
    two = client.at(slot=2)
    client.write_multiple([(client.channel, change, 0), (two, save, 0)])
    client.read(message.changed(2, 2), two)
    client.read(message.changed(1, 2))
    changed(client, 3, 2)


def unseen_change_answered(client: Client) -> None:
    """The response to a change that is not in the capture: that may have been p0977."""
    changed(client, 1, 2)
    client.read(message.changed(9, 2), client.at(slot=3))
    changed(client, 2, 2)


def silent_once(client: Client) -> None:
    """Of a call without its response is known what it asked for."""
    changed(client, 1, 2)
    client.ask_write(message.read(2, 2, SPEED))
    client.wait(1000)
    client.exchange(message.read(3, 2, SPEED), message.answer(3, 1, 2, TEN))


def read_without_its_request(client: Client) -> None:
    """The last thing that is there of a client; what is missing before it may be a save."""
    changed(client, 1, 2)
    client.accept_read(client.call(wire.READ), message.answer(2, 1, 2, TEN))
    changed(replace(client, activity=UUID(int=2)), 3, 2)


def often_on_one_object(client: Client) -> None:
    """The ways in which a device was addressed are counted, however many changes there are."""
    for number in range(40):
        changed(client, number + 1, 3 if number == 1 else 2)


@pytest.mark.parametrize(
    ("talk", "count", "unknown", "targets", "last"),
    [
        (save_unread, 1, 1, 1, 7),
        (object_save_unread, 2, 1, 1, 11),
        (read_refused, 1, 1, 1, 5),
        (response_without_its_blocks, 1, 1, 1, 5),
        (saved_in_the_middle, 1, 0, 1, 5),
        (saved_in_the_same_frame, 1, 0, 1, 7),
        (unseen_change_answered, 1, 1, 1, 7),
        (silent_once, 1, 0, 1, 1),
        (read_without_its_request, 1, 1, 1, 6),
        (often_on_one_object, 40, 0, 2, 157),
        (unknown_outcome, 2, 1, 1, 7),
        (one_object_saved, 1, 0, 1, 5),
        (perhaps_saved, 1, 2, 1, 13),
        (two_objects_changed, 2, 0, 2, 5),
    ],
)
def test_what_is_not_saved(
    talk: Talk, count: int, unknown: int, targets: int, last: int, tmp_path: Path
) -> None:
    args = diagnosed(talk, "DS721", tmp_path).args
    assert (args["count"], args["unknown"], args["targets"], args["last"]) == (
        count, unknown, targets, last,
    )  # fmt: skip


def test_a_file_that_cannot_be_read_to_its_end_may_have_a_save_there(tmp_path: Path) -> None:
    result = result_of(one_object_saved, tmp_path)
    (found,) = of(result, "DS721")
    start = "p2900 changed on DO 3 of 192.168.133.33, not saved in this capture"
    assert sentence(found).startswith(start)
    whole = tmp_path / "x.pcapng"
    (tmp_path / "y.pcapng").write_bytes(whole.read_bytes() + b"\x06\x00\x00\x00")
    cut = analyze(tmp_path / "y.pcapng")
    assert (cut.complete, cut.frames, of(cut, "DS721")) == (False, result.frames, [])


def test_what_is_saved(tmp_path: Path) -> None:
    assert not told(all_saved, "DS721", tmp_path)


# What the capture cut: DS725


def seen_twice(client: Client) -> None:
    """A mirror port shows each frame twice."""
    client.exchange(
        message.read(1, 1, SPEED), message.answer(1, 1, 1, TEN), at=client.at(index=LOCAL)
    )
    client.stage.shots[:] = [shot for shot in client.stage.shots for _ in range(2)]


def test_cut_frames_are_counted_with_their_copies(tmp_path: Path) -> None:
    result = result_of(seen_twice, tmp_path, snap=200)
    with open_capture(tmp_path / "x.pcapng") as frames:
        cut = sum(len(each.data) < each.original_length for each in frames)
    (found,) = of(result, "DS725")
    assert (found.args["what"], found.args["count"]) == ("cut", cut)


ENDS = "it ends before responses of 192.168.47.2 to 192.168.47.1 have come: 1"


def report_of(path: Path) -> tuple[CaptureResult, str]:
    result = analyze(path)
    stream = io.StringIO()
    write_all(text.Writer(stream, ReportOptions(rules=rules())), Report([result]))
    return result, stream.getvalue()


@pytest.mark.parametrize(
    ("first", "last", "said", "advice"),
    [
        (1, 62, ENDS, "Let the capture run on"),
        (249, 497, ENDS, "Let the capture run on"),
        (187, 746, "192.168.47.1 reads responses from 192.168.47.2 that it may have requested before the capture"
         " begins: 1",
         "Start the capture before"),
    ],
)  # fmt: skip
def test_a_part_of_a_capture_is_told_first_and_how_to_record_it(
    first: int, last: int, said: str, advice: str, captures: Path, tmp_path: Path
) -> None:
    frames = wire.frames(captures / "real-stacks" / "o1_profinetpy062_be.pcapng")[first - 1 : last]
    cuts.write(tmp_path / "x.pcap", frames)
    result, report = report_of(tmp_path / "x.pcap")
    assert result.diagnoses[0].rule == "DS725"
    assert sentence(result.diagnoses[0]) == f"The capture shows only a part: {said}"
    lines = " ".join(report.split())
    assert (
        f"What to do DS725 warning half-captured: The capture shows only a part: {said} -> {advice}"
        in lines
    )


def test_frames_out_of_order_have_a_sentence_and_an_advice_of_their_own(
    captures: Path, tmp_path: Path
) -> None:
    frames = wire.frames(captures / "real-stacks" / "o1_profinetpy062_be.pcapng")
    cuts.write(tmp_path / "x.pcap", cuts.ALL["7th swapped"](frames))
    result, report = report_of(tmp_path / "x.pcap")
    told = [each for each in result.diagnoses if each.rule == "DS725"]
    assert [each.args["what"] for each in told] == ["disorder"]
    lines = " ".join(report.split())
    assert "half-captured: Frames are not in order of time: " in lines
    assert (
        "-> Put the frames in order (reordercap IN OUT) and analyse OUT: nothing is missing"
        in lines
    )
    assert "Mirror both directions" not in lines
    assert "only a part" not in lines
    zh = advice_parts(rules()["DS725"], told[0].args, "zh")
    assert zh[0].startswith("用 reordercap IN OUT")


# Reads for nothing: DS703


def never_ends(client: Client) -> None:
    client.exchange(message.read(1, 1, SPEED), message.answer(1, 1, 1, TEN))
    for _ in range(4200):
        client.poll()


@pytest.mark.slow
def test_all_reads_for_nothing_are_counted(tmp_path: Path) -> None:
    args = diagnosed(never_ends, "DS703", tmp_path).args
    assert args["count"] == 4200


# The number of parameters (DS304), the reference of a channel (DS415)

MANY = [message.address(2000 + number) for number in range(45)]


def all_answered(client: Client) -> None:
    client.exchange(message.read(1, 1, *MANY), message.answer(1, 1, 1, *[message.word(1)] * 45))


def refused_for_its_number(client: Client) -> None:
    client.exchange(message.read(9, 1, SPEED), message.answer(9, 1, 1, TEN))
    client.write(message.read(1, 1, *MANY), status=0xDF80B700)


def allowed(client: Client, most: int) -> None:
    limits = message.answer(9, 1, 1, message.word(600, most, 0))
    client.exchange(message.read(9, 1, message.address(974, 0, 3)), limits)
    refused_for_its_number(client)


@pytest.mark.parametrize(
    ("talk", "limits"),
    [
        (all_answered, []),
        (refused_for_its_number, [39]),
        (lambda client: allowed(client, 45), []),
        (lambda client: allowed(client, 40), [40]),
    ],
)
def test_a_number_that_the_drive_takes_is_not_too_high(
    talk: Talk, limits: list[int], tmp_path: Path
) -> None:
    assert [each.args["limit"] for each in of(result_of(talk, tmp_path), "DS304")] == limits


def another_channel_between(client: Client) -> None:
    client.exchange(message.read(5, 1, SPEED), message.answer(5, 1, 1, TEN))
    there = client.at(slot=2)
    client.exchange(message.read(6, 1, SPEED), message.answer(6, 1, 1, TEN), at=there)
    client.exchange(message.read(5, 1, SPEED), message.answer(5, 1, 1, TEN))


def test_the_request_before_is_that_of_the_channel(tmp_path: Path) -> None:
    (finding,) = of(result_of(another_channel_between, tmp_path), "DS415")
    assert (finding.frame, finding.args["first"], finding.frames) == (9, 1, [1, 9])


def test_a_refusal_without_a_number_says_so(captures: Path) -> None:
    result = analyze(captures / "message-error-no-words.pcapng")
    told = [
        sentence(each, lang)
        for each in result.findings
        if each.rule == "DS410"
        for lang in ("en", "zh")
    ]
    assert told == [
        "Parameter r0021[0] got a negative response: no error number (info -)",
        "参数 r0021[0] 得到否定应答：没有错误号（附加信息 -）",
    ]


class Counted(list[Finding]):
    """Findings that know how often somebody went through all of them."""

    walks = 0

    def __iter__(self) -> Iterator[Finding]:
        self.walks += 1
        return super().__iter__()


def test_a_page_goes_through_the_findings_as_often_however_many_causes_there_are(
    captures: Path,
) -> None:
    result = analyze(captures / "diagnosis-index-and-count.pcapng")
    walks = []
    for many in (1, 50):
        result.findings = Counted(result.findings)
        result.diagnoses = result.diagnoses[:1] * many
        assert len(problems(result)) >= many
        walks.append(result.findings.walks)
    assert walks[0] == walks[1] > 0
