"""Completeness: what of a conversation is not in the capture, from small conversations of the lab's client.

Frames are taken out by their numbers; what is left goes through a `CallTracker`, or is analysed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from io import BytesIO
from uuid import UUID

import pytest
from talk import pdus

from ds47.analysis import analyze
from ds47.lab import captured, message, wire
from ds47.lab.client import Client, drive
from ds47.lab.stage import Stage
from ds47.profinet.calls import CallTracker
from ds47.profinet.completeness import Completeness, Missing, Numbers
from ds47.profinet.records import Peer
from ds47.profinet.rpc import Pdu
from ds47.spec.semantics import limits

CLIENT, SERVER = "192.168.133.2", "192.168.133.33"
PEER = Peer(CLIENT, SERVER)
ASK = message.read(1, 1, message.address(21))
TELL = message.answer(1, 1, 1, message.real(1.0))


def heard(calls: Iterable[Pdu], kept: int = 64) -> Completeness:
    """What is known of them to be missing."""
    found = Completeness(kept)
    tracker = CallTracker(limits(), found)
    for each in calls:
        tracker.take(each)
    return found


def three(client: Client) -> None:
    """Three jobs: frames 1 to 12, each Write, response, Read, response; numbers 0 to 5."""
    for _ in range(3):
        client.exchange(ASK, TELL)


def without(play: Callable[[Client], object], *frames: int) -> Completeness:
    """What is known of a conversation without some of its frames."""
    return heard(each for each in pdus(play) if each.frame not in frames)


# Numbers of an activity


def said(number: int, frame: int = 1) -> Pdu:
    """A request with a number."""
    (made,) = pdus(lambda client: client.ask_write(ASK))
    made.seq, made.frame = number, frame
    return made


def holes(*numbers: int) -> list[str]:
    made = Numbers(said(numbers[0]))
    for frame, number in enumerate(numbers[1:], 2):
        if number == made.highest + 1:
            made.highest, made.newest = number, said(number, frame)
        else:
            made.add(said(number, frame), renewed=True)
    return [f"{hole.after}-{hole.before}: {hole.numbers()}" for hole in made.holes]


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ((5, 6, 7), []),
        ((5, 7), ["1-2: 6"]),
        ((5, 8, 9, 12), ["1-2: 6..7", "3-4: 10..11"]),
        ((5, 8, 7), ["1-2: 6"]),
        ((5, 8, 7, 6), []),
        ((5, 8, 6, 7, 9), []),
        ((5, 7, 6, 9), ["2-4: 8"]),
        ((5, 6, 3, 7), []),
        ((5, 6, 3, 8), ["2-4: 7"]),
        ((5, 6, 3, 4, 7), []),
        ((3, 4, 5, 3, 4, 6), ["5-6: 5"]),
        ((5, 7, 5, 6, 8), ["1-2: 6", "4-5: 7"]),
        ((0, 1, 2, 0, 1, 2), []),
        ((0, 1, 2, 3, 1, 2, 4), ["6-7: 3"]),
        ((0, 1, 2, 3, 1, 4), []),
    ],
)
def test_holes_are_numbers_that_are_missing_of_the_set(
    numbers: tuple[int, ...], expected: list[str]
) -> None:
    assert holes(*numbers) == expected


def test_a_hole_is_filled_wherever_and_however_wide_it_is() -> None:
    assert holes(0, 258, 5) == ["1-2: 1..4", "1-2: 6..257"]
    assert holes(0, 1000, 999, 998) == ["1-2: 1..997"]
    made = Numbers(said(500))
    for frame, number in enumerate((100, 300, 400), 2):
        made.add(said(number, frame), renewed=True)
    assert (made.anew, made.holes) == (0, [])  # none of them was there before


def test_who_has_one_number_for_all_calls_does_not_count() -> None:
    made = Numbers(said(0))
    for frame in (2, 3, 4):
        made.add(said(0, frame), renewed=True)
    assert made.anew == 2  # then it is known


@pytest.mark.parametrize(
    ("numbers", "there"),
    [
        ((5, 7, 8, 12), (5, 7, 8, 12)),
        ((5, 8, 7), (5, 7, 8)),
        ((5, 7, 3), (3, 4, 5, 7)),
        ((3, 4, 5, 3, 4), (3, 4)),
        ((0, 300), (0, 300)),
    ],
)
def test_a_number_is_there_from_the_lowest_to_the_highest_but_in_holes(
    numbers: tuple[int, ...], there: tuple[int, ...]
) -> None:
    """Of what is lower than the first number nobody knows which came."""
    made = Numbers(said(numbers[0]))
    for frame, number in enumerate(numbers[1:], 2):
        made.add(said(number, frame), renewed=True)
    assert tuple(number for number in range(310) if made.has(number)) == there


def test_of_many_holes_the_oldest_are_as_one() -> None:
    made = Numbers(said(0))
    for step in range(1, 67):
        made.add(said(2 * step, step + 1))
    assert len(made.holes) == 64
    first, second = made.holes[:2]
    assert (first.after, first.before, first.numbers()) == (1, 4, "1..5")
    assert (second.after, second.before, second.numbers()) == (4, 5, "7")


# Of two stations


def test_nothing_is_missing_of_a_whole_conversation() -> None:
    found = heard(pdus(three))
    pair = found.lacks(CLIENT, SERVER)
    assert [found.missing_after(PEER, frame) for frame in (0, 1, 11, 12)] == [None] * 4
    assert (pair.holes, pair.halves, found.late, found.newest(SERVER)) == ([], 0, 0, 0)
    assert found.newest_gap(SERVER) == 0
    assert pair.hears
    assert pair.asks


def test_a_missing_call_is_a_hole_behind_what_came_before_it() -> None:
    found = without(three, 5, 6)
    hole = Missing("calls", 3, 7, "2")
    assert found.missing_after(PEER, 3) == found.missing_after(PEER, 6) == hole
    assert found.missing_after(PEER, 7) is None
    assert found.newest(SERVER) == 7
    assert found.newest(CLIENT) == 0
    (other,) = pdus(lambda client: client.ask_write(ASK))
    other.client, other.frame = "192.168.133.9", 20
    found.cut(other)
    assert found.newest(SERVER) == 20
    assert found.newest_gap(SERVER) == 20


def test_a_write_response_without_its_request_shows_that_a_request_is_missing() -> None:
    found = without(three, 5)
    pair = found.lacks(CLIENT, SERVER)
    missing = Missing("requests")
    assert [found.missing_after(PEER, frame) for frame in (3, 5, 6, 7)] == [
        missing,
        missing,
        None,
        None,
    ]
    assert (pair.halves, pair.half, pair.holes, found.newest(SERVER)) == (1, 6, [], 6)


def test_a_response_behind_the_next_request_shows_that_its_number_was_there() -> None:
    def play(client: Client) -> None:
        client.read(TELL)
        written = client.ask_write(ASK)
        client.read(TELL)
        client.accept_write(written, ASK)

    pair = without(play, 3).lacks(CLIENT, SERVER)
    assert (pair.holes, pair.halves, pair.half) == ([], 1, 6)


def test_a_read_response_without_its_request_is_a_half() -> None:
    found = without(three, 7)
    pair = found.lacks(CLIENT, SERVER)
    assert found.missing_after(PEER, 1) is None
    assert (pair.halves, pair.half, pair.unread, found.newest(SERVER)) == (1, 8, [8], 8)
    assert found.newest_gap(SERVER) == 8


def test_a_call_without_response_is_a_half_once_its_client_went_on() -> None:
    asked = [each for each in pdus(three) if each.frame != 6]
    found = Completeness(64)
    tracker = CallTracker(limits(), found)
    for each in asked:
        tracker.take(each)
    assert found.lacks(CLIENT, SERVER).halves == 0
    tracker.finish()
    assert (found.lacks(CLIENT, SERVER).halves, found.lacks(CLIENT, SERVER).half) == (1, 5)
    assert (found.newest(SERVER), found.newest_gap(SERVER)) == (5, 0), "what was asked is known"


def test_the_last_call_may_still_get_its_response() -> None:
    """It is no half; behind it something may be missing all the same."""
    found = Completeness(64)
    tracker = CallTracker(limits(), found)
    for each in pdus(three):
        if each.frame != 12:
            tracker.take(each)
    tracker.finish()
    assert (found.lacks(CLIENT, SERVER).halves, found.newest(SERVER)) == (0, 11)


def test_a_call_that_the_end_leaves_open_is_no_half_of_an_earlier_activity() -> None:
    found, calls = Completeness(64), [said(0, 1), said(0, 2)]
    for each in calls:
        found.began(each, Numbers(each))
    found.lacks(CLIENT, SERVER).heard = True
    found.lost(calls[0], went_on=False, ended=True)
    assert (found.missing_after(PEER, 1), found.newest(SERVER)) == (None, 1)
    found.lost(calls[0], went_on=True, ended=True)
    assert found.missing_after(PEER, 1) == Missing("halves")


@pytest.mark.parametrize(("frames", "first"), [((5, 9), 6), ((2, 7), 1)])
def test_the_first_half_of_a_call_is_named(frames: tuple[int, ...], first: int) -> None:
    """Also where it is told last, because a response may still come."""
    found = Completeness(64)
    tracker = CallTracker(limits(), found)
    for each in pdus(three):
        if each.frame not in frames:
            tracker.take(each)
    tracker.finish()
    assert (found.lacks(CLIENT, SERVER).half, found.lacks(CLIENT, SERVER).halves) == (first, 2)


def test_who_was_never_heard() -> None:
    asked = heard(each for each in pdus(three) if each.ptype == 0)
    assert asked.missing_after(PEER, 5) == Missing("one_direction")
    assert not asked.lacks(CLIENT, SERVER).hears
    told = heard(each for each in pdus(three) if each.ptype != 0)
    assert told.missing_after(PEER, 5) == Missing("requests")
    assert not told.lacks(CLIENT, SERVER).asks
    assert told.lacks(CLIENT, SERVER).hears
    assert told.missing_after(Peer("192.168.133.9", SERVER), 5) == Missing("requests")


def test_a_server_that_calls_itself_was_heard() -> None:
    """The device asks its controller for ApplicationReady: it is not the other half that is missing."""
    asked = [each for each in pdus(three) if each.ptype == 0]
    found = heard(asked)
    assert found.missing_after(PEER, 5) == Missing("one_direction")
    back = Completeness(64)
    back.began(turned(asked[0]), Numbers(said(0)))
    back.began(asked[0], Numbers(said(0)))
    assert back.lacks(CLIENT, SERVER).hears
    forth = Completeness(64)
    forth.began(asked[0], Numbers(said(0)))
    assert not forth.lacks(CLIENT, SERVER).hears
    forth.began(turned(asked[0]), Numbers(said(0)))
    assert forth.lacks(CLIENT, SERVER).hears


def test_of_stations_that_said_nothing_nothing_is_known() -> None:
    pair = Completeness(64).lacks(CLIENT, SERVER)
    assert (pair.hears, pair.asks, pair.holes, pair.newest, pair.newest_call) == (
        False,
        False,
        [],
        0,
        0,
    )
    assert (pair.half, pair.halves, pair.disorder, pair.unasked, pair.lost) == (0, 0, 0, [], [])


@pytest.mark.parametrize("turns", [1, -1])
def test_one_of_two_activities_is_heard(turns: int) -> None:
    """A response in either shows that the server is heard; the newest call is that of the one that spoke last."""
    second = [each for each in pdus(three) if each.ptype == 0]
    for each in second:
        each.activity, each.mark = bytes(16), each.mark + 1
    calls = [pdus(three), second][::turns]
    for each in calls[1]:
        each.frame += 12
    found = heard([*calls[0], *calls[1]])
    pair = found.lacks(CLIENT, SERVER)
    assert (pair.hears, pair.newest_call) == (True, 23)
    found.began(said(0), Numbers(said(0)))
    assert pair.newest_call == 23


def turned(pdu: Pdu) -> Pdu:
    """The same request the other way."""
    (other,) = pdus(lambda client: client.ask_write(ASK))
    other.client, other.server = pdu.server, pdu.client
    return other


def test_a_station_of_profibus_is_asked_of_its_line() -> None:
    found = Completeness(64, {3: 7}.__getitem__)
    assert (found.newest("dp3"), found.newest_gap("dp3")) == (7, 7)


def test_a_response_before_its_request_is_out_of_order() -> None:
    frames = pdus(three)
    frames[4], frames[5] = frames[5], frames[4]
    frames[6], frames[7] = frames[7], frames[6]
    found = heard(frames)
    pair = found.lacks(CLIENT, SERVER)
    assert (pair.halves, found.late, found.first_late) == (0, 2, 6)
    assert (pair.unasked, pair.unread, found.newest(SERVER)) == ([], [], 0)
    assert found.missing_after(PEER, 1) is None


def test_the_oldest_pair_goes_first() -> None:
    found = Completeness(1)
    asked = next(each for each in pdus(three) if each.ptype == 0)
    found.began(asked, Numbers(said(0)))
    found.began(turned(asked), Numbers(said(0)))
    assert not found.lacks(CLIENT, SERVER).asks
    assert found.lacks(SERVER, CLIENT).asks


def test_activities_of_a_pair_are_bounded_and_it_stays_heard() -> None:
    found = Completeness(64)
    for number in range(66):
        made = Numbers(said(number))
        made.waited = int(number == 0)
        found.began(said(number, number + 1), made)
    pair = found.lacks(CLIENT, SERVER)
    assert (len(pair.activities), pair.activities[0].lowest, pair.since) == (64, 2, 66)
    assert pair.hears


def test_frames_of_a_pair_are_bounded() -> None:
    found = Completeness(64)
    (write,) = pdus(lambda client: client.ask_write(ASK))
    for frame in range(1, 70):
        write.frame = frame
        found.cut(write)
    kept = found.lacks(CLIENT, SERVER).unasked
    assert (len(kept), kept[0], kept[1], kept[-1]) == (64, 1, 7, 69)


def test_numbers_of_two_activities_say_nothing_of_each_other() -> None:
    """Where calls go on in another activity, anything that is missing of the two stations counts."""
    first = [each for each in pdus(three) if each.frame not in (5, 6)]
    second = pdus(three)
    for each in second:
        each.frame += 12
        each.activity, each.mark = bytes(16), each.mark + 1
    found = heard([*first, *second])
    assert found.missing_after(PEER, 8) == Missing("calls", 3, 7, "2")
    assert found.missing_after(PEER, 13) is None
    whole = heard([*pdus(three), *second])
    assert whole.missing_after(PEER, 8) is None
    half = heard([*(each for each in pdus(three) if each.frame != 7), *second])
    assert half.missing_after(PEER, 9) == Missing("halves")
    assert half.missing_after(PEER, 13) is None
    asked = heard([*(each for each in pdus(three) if each.frame != 5), *second])
    assert asked.missing_after(PEER, 9) == Missing("requests")


# What of it is said of jobs (docs/pairing.md, P73 to P80)


def ask(reference: int) -> bytes:
    return message.read(reference, 1, message.address(21))


def tell(reference: int) -> bytes:
    return message.answer(reference, 1, 1, message.real(1.0))


def counted(client: Client) -> None:
    for reference in (1, 2, 3):
        client.exchange(ask(reference), tell(reference))


def written(client: Client) -> None:
    for reference in (1, 2, 3):
        client.write(ask(reference))


def polled(client: Client) -> None:
    client.exchange(ask(1), tell(1))
    client.poll()
    client.exchange(ask(2), tell(2))


def too_short(client: Client) -> None:
    client.write(ask(1))
    client.poll(TOO_SHORT)
    client.read(tell(1))
    client.exchange(ask(2), tell(2))


def overtaken(client: Client) -> None:
    """The Read behind a new Write comes before the response to that."""
    client.write(ask(1))
    client.poll(TOO_SHORT)
    written = client.ask_write(ask(2))
    read = client.ask_read()
    client.accept_write(written, ask(2))
    client.accept_read(read, tell(2))


def refused(client: Client) -> None:
    client.write(ask(1))
    client.write(ask(2))
    client.poll(NOT_THERE)


def unread(client: Client) -> None:
    client.write(ask(1))
    client.ask_read()
    client.write(ask(2))
    client.read(tell(2))


def turned_away(client: Client) -> None:
    client.exchange(ask(1), tell(1))
    client.write(ask(2), IN_USE)
    client.poll()
    client.read(tell(2))


def busy(client: Client) -> None:
    client.write(ask(1))
    client.write(ask(2), IN_USE)


def released(client: Client) -> None:
    client.write(ask(1))
    client.write(ask(2))
    client.poll()
    client.release()


def slow(*references: int) -> Callable[[Client], None]:
    """Jobs of six frames each: the Read is sent twice."""

    def play(client: Client) -> None:
        for reference in references:
            client.write(ask(reference))
            client.poll()
            client.read(tell(reference))

    return play


def restarted(client: Client) -> None:
    """The client counts anew, below its first number."""
    client.sequence = 5
    client.exchange(ask(1), tell(1))
    client.sequence = 0
    for reference in (2, 3, 4):
        client.exchange(ask(reference), tell(reference))


def once_more(number: int) -> Callable[[Client], None]:
    """A client uses a number for another call."""

    def play(client: Client) -> None:
        client.exchange(ask(1), tell(1))
        client.write(ask(2))
        client.sequence = number
        client.exchange(ask(3), tell(3))

    return play


def by_turns(client: Client) -> None:
    """Two drives are called in one activity."""
    other = Client(client.stage, device=drive(2))
    client.exchange(ask(1), tell(1))
    client.write(ask(2))
    other.sequence = client.sequence
    other.exchange(ask(1), tell(1))
    client.sequence = other.sequence
    client.exchange(ask(3), tell(3))


def early(client: Client) -> None:
    """The response to a Read stands before its request."""
    client.write(ask(1))
    client.poll()
    shots = client.stage.shots
    shots[-2:] = reversed(shots[-2:])
    client.exchange(ask(2), tell(2))


def behind_its_read(client: Client) -> None:
    """The request of a Write stands behind the Read that fetched its response."""
    client.exchange(ask(1), tell(1))
    client.exchange(ask(2), tell(2))
    client.stage.shots.insert(7, client.stage.shots.pop(4))
    client.exchange(ask(3), tell(3))


def then_in_order(client: Client) -> None:
    """The same, and then calls in order: of these is said what is so."""
    behind_its_read(client)
    client.write(ask(4))
    client.exchange(ask(5), tell(5))


def behind_a_poll(client: Client) -> None:
    """The request of a Write stands behind a Read of it, and the record that comes then mirrors it."""
    client.exchange(ask(1), tell(1))
    client.write(ask(2))
    client.poll()
    client.stage.shots.insert(6, client.stage.shots.pop(4))
    client.read(tell(2))


def of_no_record(client: Client) -> None:
    """A call that reads and writes nothing stands behind the Write that came after it."""
    client.write(ask(1))
    client.poll()
    control = client.call(4)
    client.ask(control, bytes(4))
    client.reply(control, bytes(20))
    client.exchange(ask(2), tell(2))
    client.stage.shots.insert(6, client.stage.shots.pop(4))


def counted_elsewhere(client: Client) -> None:
    """The first request of a channel has the reference that another channel of its AR had last."""
    client.exchange(ask(1), tell(1), client.at(slot=2))
    client.write(ask(1))
    client.poll()
    client.read(tell(1))


def refused_alike(client: Client) -> None:
    """A Write with the same reference is refused while a Read is under way: the record mirrors both."""
    client.write(ask(1))
    client.ask_read()
    client.write(ask(1), NOT_THERE)
    client.read(tell(1))


def read_before(client: Client) -> None:
    """The record that a Read brings from before a Write came behind it; the Read for that one is refused."""
    read = client.ask_read()
    client.write(ask(2))
    client.accept_read(read, tell(3))
    client.poll(TOO_SHORT)


def failed(client: Client) -> None:
    """A Read gets a fault, which does not tell of which record."""
    client.write(ask(1))
    client.reply(client.ask_read(), bytes(4), wire.FAULT)
    client.exchange(ask(2), tell(2))


def elsewhere(client: Client) -> None:
    """A client goes on in another activity, long after a request."""
    client.write(ask(1))
    client.wait(11_000)
    other = Client(client.stage, activity=UUID(int=9))
    other.exchange(ask(2), tell(2), other.at(slot=2))


def unsaved(client: Client) -> None:
    """A change in RAM, and before it and behind it jobs of another drive."""
    other = Client(client.stage, device=drive(2), activity=UUID(int=9))
    other.exchange(ask(1), tell(1))
    other.exchange(ask(2), tell(2))
    ramp = message.change(1, 1, (message.address(1120), message.real(1.0)))
    client.exchange(ramp, message.answer(1, 2, 1))
    other.exchange(ask(3), tell(3))
    other.exchange(ask(4), tell(4))


NOT_THERE, IN_USE, TOO_SHORT = 0xDE80B700, 0xDF80B500, 0xDE80B100
Told = tuple[str, list[tuple[object, ...]]]


def played(play: Callable[[Client], object], *frames: int) -> bytes:
    """The capture of a conversation without some of its frames."""
    stage = Stage()
    play(Client(stage))
    stage.shots = [shot for number, shot in enumerate(stage.shots, 1) if number not in frames]
    return captured(stage)


def analysed(play: Callable[[Client], object], *frames: int) -> Told:
    """The states of transactions, and the findings that say what nobody knows or what did not come."""
    result = analyze(BytesIO(played(play, *frames)))
    found: list[tuple[object, ...]] = []
    for each in result.findings:
        if each.rule == "DS110":
            found.append(
                (each.frame, *(value for value in each.args.values() if value is not None))
            )
        elif each.rule == "DS705":
            found.append((each.rule, each.frame, each.args["first"]))
        elif each.rule in ABSENT:
            found.append((each.rule, each.frame))
    return " ".join(each.state for each in result.transactions), found


ABSENT = (
    "DS206", "DS401", "DS402", "DS404", "DS413", "DS415", "DS704", "DS705", "DS721", "DS722",
)  # fmt: skip
Scene = tuple[Callable[[Client], None], tuple[int, ...], str, list[tuple[object, ...]]]
SCENES: list[Scene] = [
    (three, (), "ok ok ok", [("DS415", 5), ("DS415", 9)]),
    (three, (2,), "ok ok ok", [("DS415", 4), ("DS415", 8)]),
    (three, (4,), "incomplete ok ok", [(1, "read_answer", 3), ("DS415", 4), ("DS415", 8)]),
    (three, (5,), "ok orphan ok", []),
    (three, (3, 4), "incomplete ok ok", [(1, "calls", 1, 3, "1"), ("DS415", 7)]),
    (three, (4, 5), "incomplete orphan ok", [(1, "requests")]),
    (three, (5, 6), "ok orphan ok", []),
    (three, (3, 4, 5, 6), "ok ok", []),
    (three, (4, 5, 6), "incomplete orphan ok", [(1, "calls", 3, 4, "2")]),
    (counted, (4, 5), "incomplete orphan ok", [(1, "read_answer", 3)]),
    (counted, (7, 8), "ok incomplete ok", [(5, "calls", 5, 7, "3")]),
    (written, (), "superseded superseded incomplete", [("DS413", 3), (5, "ends"), ("DS413", 5)]),
    (written, (2,), "incomplete superseded incomplete", [(1, "write_answer", 1), (4, "ends"), ("DS413", 4)]),
    (written, (3,), "incomplete incomplete", [(1, "requests"), (4, "ends")]),
    (written, (3, 4), "incomplete incomplete", [(1, "calls", 1, 3, "1"), (3, "ends")]),
    (written, (4, 5, 6), "incomplete incomplete", [(1, "later"), (3, "write_answer", 3)]),
    (written, (6,), "superseded incomplete incomplete", [(3, "later"), ("DS413", 3), (5, "write_answer", 5)]),
    (polled, (), "ok ok", [("DS206", 6)]),
    (polled, (4, 5), "incomplete ok", [(1, "read_answer", 3)]),
    (polled, (7, 8), "ok orphan", [("DS206", 6)]),
    (polled, (1, 2), "orphan ok", [(4, "begins")]),
    (too_short, (), "ok ok", []),
    (too_short, (5, 6), "incomplete ok", [(1, "calls", 3, 5, "2")]),
    (too_short, (5,), "ok ok", []),
    (overtaken, (), "refused ok", []),
    (refused, (), "superseded refused", [("DS413", 3)]),
    (refused, (3,), "incomplete", [(1, "requests"), (5, "requests")]),
    (refused, (4,), "incomplete incomplete", [(1, "later"), (3, "write_answer", 3), (5, "later")]),
    (refused, (3, 4), "incomplete", [(1, "calls", 1, 3, "1"), (4, "calls", 1, 3, "1")]),
    (refused, (6,), "superseded incomplete", [(3, "read_answer", 5), ("DS413", 3)]),
    (unread, (), "incomplete ok", [(1, "read_answer", 3)]),
    (unread, (2,), "incomplete ok", [(1, "read_answer", 2)]),
    (unread, (3, 4), "incomplete orphan", [(1, "requests")]),
    (turned_away, (), "ok refused", [("DS705", 5, None)]),
    (turned_away, (4,), "incomplete refused", [(1, "read_answer", 3)]),
    (busy, (), "incomplete refused", [(1, "ends"), ("DS705", 3, 1)]),
    (busy, (2,), "incomplete refused", [(1, "write_answer", 1)]),
    (released, (4,), "incomplete incomplete", [(1, "later"), (3, "write_answer", 3)]),
    (slow(1, 2, 3), (), "ok ok ok", []),
    (slow(1, 2, 3), (9, 10), "ok ok ok", []),
    (slow(254, 255, 1), (15, 16), "ok ok ok", []),
    (slow(1, 4, 5), (9, 10), "ok incomplete orphan ok", [(7, "calls", 7, 9, "4")]),
    (slow(1, 1, 2), (9, 10), "ok incomplete orphan ok", [(7, "calls", 7, 9, "4"), ("DS415", 7)]),
    (slow(1, 2), (3, 4), "ok ok", []),
    (slow(1, 2), (3,), "ok ok", []),
    (slow(1, 2), (8,), "ok ok", []),
    (restarted, (), "ok ok ok ok", []),
    (restarted, (11, 12), "ok ok incomplete ok", [(9, "calls", 9, 11, "3")]),
    (early, (), "superseded ok", [("DS413", 5)]),
    (behind_its_read, (), "ok incomplete orphan ok", [(8, "halves")]),
    (then_in_order, (), "ok incomplete orphan ok superseded ok", [(8, "halves"), ("DS413", 15)]),
    (behind_a_poll, (), "ok ok", []),
    (of_no_record, (), "superseded ok", [("DS413", 6)]),
    (counted_elsewhere, (), "ok ok", []),
    (counted_elsewhere, (7, 8), "ok incomplete orphan", [(5, "calls", 5, 7, "3")]),
    (read_before, (), "orphan refused", []),
    (refused_alike, (), "incomplete refused", [(1, "read_answer", 3), ("DS415", 4)]),
    (failed, (), "superseded ok", [("DS413", 5)]),
    (failed, (3,), "incomplete ok", [(1, "requests")]),
    (elsewhere, (), "unanswered ok", [("DS401", 1)]),
    (unsaved, (), "ok ok ok ok ok", [("DS721", 9)]),
    (unsaved, (3, 4), "incomplete ok ok ok ok", [(1, "calls", 1, 3, "1"), ("DS721", 7)]),
    (unsaved, (3, 4, 15, 16), "incomplete ok ok incomplete ok", [
        (1, "calls", 1, 3, "1"), (11, "calls", 11, 13, "5"),
    ]),
    (by_turns, (), "ok superseded ok ok", [("DS413", 11)]),
    (by_turns, (3,), "ok superseded ok ok", [("DS413", 10)]),
    (once_more(2), (), "ok incomplete ok", [(5, "renewed")]),
    (once_more(1), (), "ok incomplete ok", [(5, "renewed")]),
]  # fmt: skip


@pytest.mark.parametrize(("play", "frames", "states", "told"), SCENES)
def test_what_is_said_of_a_conversation_with_holes(
    play: Callable[[Client], object],
    frames: tuple[int, ...],
    states: str,
    told: list[tuple[object, ...]],
) -> None:
    assert analysed(play, *frames) == (states, told)


def one_job(*then: Callable[[Client], object]) -> Callable[[Client], None]:
    """A Write, and what follows."""

    def play(client: Client) -> None:
        client.write(ask(1))
        for each in then:
            each(client)

    return play


def sent_twice(client: Client) -> None:
    call = client.ask_read()
    client.wait(500)
    client.ask(call, wire.read_request(call.sequence, client.channel))


def pause(milliseconds: float) -> Callable[[Client], None]:
    return lambda client: client.wait(milliseconds)


def elsewhere_then_released(client: Client) -> None:
    """The client goes on in another slot, and ends the connection long after that."""
    client.exchange(ask(2), tell(2), client.at(slot=2))
    client.wait(5_000)
    client.release()


def asked_again(client: Client) -> None:
    call = client.ask_write(ask(2))
    client.wait(500)
    client.ask_write(ask(2), again=call)
    client.wait(500)
    client.write(ask(3))


WHOLE: list[tuple[Callable[[Client], None], str, list[tuple[object, ...]]]] = [
    (one_job(sent_twice, pause(50_000), Client.release), "incomplete", [(1, "read_answer", 3)]),
    (one_job(sent_twice, pause(250), elsewhere_then_released), "incomplete ok", [(1, "read_answer", 3)]),
    (one_job(Client.ask_read, Client.release), "incomplete", [(1, "read_answer", 3)]),
    (one_job(Client.ask_read, pause(5_000), Client.release), "incomplete", [(1, "read_answer", 3)]),
    (one_job(Client.release), "unanswered", [("DS401", 1), ("DS722", 1)]),
    (one_job(), "incomplete", [(1, "ends")]),
    (one_job(asked_again), "superseded incomplete incomplete", [
        (3, "write_answer", 3), (5, "ends"), ("DS413", 5),
    ]),
]  # fmt: skip


@pytest.mark.parametrize(("play", "states", "told"), WHOLE)
def test_what_shows_that_nothing_came(
    play: Callable[[Client], object], states: str, told: list[tuple[object, ...]]
) -> None:
    assert analysed(play) == (states, told)


@pytest.mark.parametrize(("milliseconds", "state"), [(9_990, "incomplete"), (10_010, "unanswered")])
def test_a_capture_that_goes_on_without_a_response(milliseconds: int, state: str) -> None:
    def play(client: Client) -> None:
        client.write(ask(1))
        other = client.at(slot=2)
        client.wait(milliseconds - 4)
        client.exchange(ask(2), tell(2), other)

    assert analysed(play)[0].split()[0] == state


def test_a_response_that_came_too_late_is_no_half_as_long_as_its_call_is_remembered() -> None:
    """Of the calls that were given up only the newest are: as many as may be open."""
    first, answer, second, other = (each for each in pdus(three) if each.frame <= 4)
    late = limits().call_expiry_ns + 1_000_000_000
    for most, halves in ((1, 1), (2, 0)):
        found = Completeness(64)
        tracker = CallTracker(limits().but(calls=most), found)
        for each in (
            first,
            second,
            *(replace(each, time_ns=each.time_ns + late) for each in (answer, other)),
        ):
            tracker.take(each)
        assert found.lacks(CLIENT, SERVER).halves == halves + 1
