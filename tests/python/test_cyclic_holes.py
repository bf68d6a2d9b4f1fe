"""PKW in captures that lack cyclic frames: what the drive may have said there nobody is charged with (P73)."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.lab import captured
from ds47.lab.client import Client
from ds47.lab.cyclic_scenes import machine, slow_response
from ds47.lab.machine import IDLE
from ds47.lab.master import Master
from ds47.lab.stage import Stage
from ds47.model import CaptureResult
from ds47.report.sentences import sentence
from ds47.report.verdict import VerdictCounts, verdict

READ = bytes.fromhex("143a000000000000")
CHARGES = {"DS503", "DS504", "DS505", "DS514"}
Frames = list[tuple[int, bytes]]


@cache
def reads(count: int = 20, pause: int = 3, cycles: int = 6, dropped: int | None = None) -> bytes:
    """So many reads of one parameter, each for so many cycles, of a drive that responds after a pause."""
    stage = Stage(dropped=dropped)
    it = machine(Client(stage)).start()
    it.drive.pause = 3
    it.read(700).read(1082)
    it.drive.pause = pause
    for _ in range(count):
        it.ask(READ, cycles).ask(IDLE, 5)
    return captured(stage)


def frames(content: bytes) -> Frames:
    with open_capture(io.BytesIO(content)) as source:
        return [(each.time_ns, each.data) for each in source.everything()]


def written(kept: Iterable[tuple[int, bytes]]) -> bytes:
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for time_ns, data in kept:
            writer.write(time_ns, data)
    return target.getvalue()


def is_request(data: bytes, words: bytes = READ) -> bool:
    return data[12:16] == b"\x88\x92\x80\x02" and data[16:24] == words


def of_drive(data: bytes) -> bool:
    return data[12:16] == b"\x88\x92\x80\x01"


def without(content: bytes, lost: Callable[[int, Frames], Iterable[int]]) -> bytes:
    """A capture without some frames, which are told by the place of the first frame of a request."""
    there = frames(content)
    first = next(
        at for at in range(200, len(there))
        if is_request(there[at][1]) and not is_request(there[at - 2][1])
    )  # fmt: skip
    gone = set(lost(first, there))
    return written(each for at, each in enumerate(there) if at not in gone)


def told(content: bytes) -> tuple[set[str], set[str]]:
    """States of the transactions, and rules that charge somebody."""
    result = analyze(io.BytesIO(content))
    states = {each.state for each in result.transactions}
    return states, {each.rule for each in result.findings} & CHARGES


def words(result: CaptureResult) -> list[str]:
    return [sentence(each) for each in result.findings if each.rule in ("DS110", "DS725")]


# The response of a request that the drive answers after three cycles is in its frames 7 to 15 or so behind it.
LOST: dict[str, tuple[Callable[[int, Frames], Iterable[int]], set[str]]] = {
    "all but the first one behind it": (lambda at, _: range(at + 7, at + 12, 2), {"incomplete"}),
    "that one, too": (lambda at, _: range(at + 7, at + 14, 2), {"incomplete"}),
    "all with the response": (lambda at, _: range(at + 5, at + 24, 2), {"incomplete"}),
    "both directions": (lambda at, _: range(at + 4, at + 18), {"incomplete"}),
    "only one": (lambda at, _: [at + 7], set()),
    "before it": (lambda at, _: range(at - 8, at - 1), set()),
    "those of the controller": (lambda at, _: range(at + 2, at + 10, 2), set()),
}


@pytest.mark.parametrize("name", LOST)
def test_nobody_is_charged_with_frames_that_are_missing(name: str, tmp_path: Path) -> None:
    lost, states = LOST[name]
    content = without(reads(), lost)
    assert told(content) == ({"ok"} | states, set())
    path = tmp_path / "lossy.pcapng"
    path.write_bytes(content)
    assert [str(each) for each in run.audit(path)] == []


def test_what_is_said_instead() -> None:
    result = analyze(io.BytesIO(without(reads(), LOST["all but the first one behind it"][0])))
    assert verdict(VerdictCounts.of(result)).en == (
        "WARNING: outcome unknown for 1 of 22 transactions; the capture shows only a part"
    )
    (item,) = [each for each in result.transactions if each.state == "incomplete"]
    note, first = words(result)
    assert item.findings == ["DS110"]
    assert "already has a response (frame" in note
    assert first.endswith("and with them the responses to PKW requests: 1")


EARLY, NEVER = {"pause": 8, "cycles": 5}, {"pause": 10_000, "cycles": 20}


@pytest.mark.parametrize("how", [EARLY, NEVER])
def test_what_is_so_is_said_of_a_whole_capture(how: dict[str, int]) -> None:
    result = analyze(io.BytesIO(reads(40, **how)))
    assert [each.state for each in result.transactions] == ["ok"] * 2 + ["unanswered"] * 40
    assert [each.rule for each in result.findings] == ["DS503"] * 40


@pytest.mark.parametrize("how", [EARLY, NEVER])
@pytest.mark.parametrize("share", [0.06, 0.15])
def test_and_of_most_requests_of_a_lossy_one(how: dict[str, int], share: float) -> None:
    chance = random.Random(7)
    lossy = written(each for each in frames(reads(40, **how)) if chance.random() > share)
    result = analyze(io.BytesIO(lossy))
    assert sum(each.rule == "DS503" for each in result.findings) >= 30


def slower(content: bytes) -> Frames:
    """Stations that need a fifth more for a cycle than the Connect says."""
    there = frames(content)
    begin = there[0][0]
    return [(begin + (time_ns - begin) * 6 // 5, data) for time_ns, data in there]


def with_others(content: bytes) -> Frames:
    """Other drives are beside it, and stop in the middle: their frames, and Connects of two of them."""
    there, beside = frames(content), frames(reads(2))
    kept = [[(time_ns, data)] for time_ns, data in there]
    for number in (1, 2):
        station = bytes.fromhex(f"02000000470{number}")
        for at, (_, data) in enumerate(beside[: len(there) // 2]):
            here, away = (station, data[6:12]) if of_drive(data) else (data[:6], station)
            kept[at].append((there[at][0], away + here + data[12:]))
    return [each for some in kept for each in some]


@pytest.mark.parametrize("how", [EARLY, NEVER])
@pytest.mark.parametrize("made", [slower, with_others])
def test_what_is_sent_less_often_is_not_missing(
    how: dict[str, int], made: Callable[[bytes], Frames]
) -> None:
    result = analyze(io.BytesIO(written(made(reads(40, **how)))))
    assert sum(each.state == "unanswered" for each in result.transactions) == 40
    assert "DS110" not in {each.rule for each in result.findings}


def test_a_request_that_outlasts_the_hole_has_no_response() -> None:
    """The same frames are missing, and the request stands for long behind that."""
    content = reads(60, pause=10_000, cycles=60)
    lossy = without(content, lambda at, _: range(at + 5, at + 40))
    assert told(lossy) == ({"ok", "unanswered"}, {"DS503"})
    assert "DS110" not in {each.rule for each in analyze(io.BytesIO(lossy)).findings}


def by_chance(seed: int) -> bytes:
    """A capture that lost frames by chance, alone or many at once."""
    chance = random.Random(seed)
    there = frames(reads(40, cycles=chance.choice((6, 9, 20))))
    if seed % 2:
        share = chance.choice((0.03, 0.06, 0.15))
        return written(each for each in there if chance.random() > share)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(150, len(there) - 100)
        del there[at : at + chance.choice((5, 8, 12, 30, 90))]
    return written(there)


@pytest.mark.parametrize("seed", range(12))
def test_nobody_is_charged_where_all_was_answered(seed: int) -> None:
    states, charges = told(by_chance(seed))
    assert states <= {"ok", "incomplete"}
    assert charges == set()


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [Source(name, without(reads(), lost), False) for name, (lost, _) in LOST.items()]
    sources += [Source(f"seed {seed}", by_chance(seed), False) for seed in range(4)]
    sources += [Source("early", reads(40, **EARLY), False)]
    compare(version, "en", sources, tmp_path)


# What stands when the capture ends


ENDED = ["DS110", "DS725"]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("cycles", "said", "state"),
    [(700, ["DS514"], "unanswered"), (600, ENDED, "incomplete"), (1, ENDED, "incomplete")],
)
def test_a_request_that_stands_to_the_end(
    cycles: int, said: list[str], state: str, version: str, tmp_path: Path
) -> None:
    """Of a proven channel, and the same request had a response before: it is for long, or record longer."""
    stage = Stage()
    line = machine(Client(stage)).start().read(1082)
    line.drive.pause = 10_000
    line.ask(READ, cycles)
    source = Source("open", captured(stage), False)
    result = analyze(source.open())
    assert [each.rule for each in result.findings] == said
    assert [each.state for each in result.transactions] == ["ok", state]
    assert [each.transaction for each in result.findings if each.rule != "DS725"] == [2]
    assert not verdict(VerdictCounts.of(result)).en.startswith("OK")
    path = tmp_path / "open.pcapng"
    path.write_bytes(captured(stage))
    assert run.audit(path) == []
    compare(version, "en", [source], tmp_path)


@pytest.mark.parametrize(("share", "said"), [(0.4, []), (0.6, ["DS725"]), (0.9, ["DS725"])])
def test_a_response_may_come_behind_the_end_of_a_channel_that_nothing_proves(
    share: float, said: list[str]
) -> None:
    """The drive takes 1.6 s: before that nothing is wrong with telegram and addresses."""
    stage = Stage()
    slow_response(Client(stage), 1082, 100, 110)
    there = frames(captured(stage))
    result = analyze(io.BytesIO(written(there[: int(share * len(there))])))
    assert [each.rule for each in result.findings] == said
    assert verdict(VerdictCounts.of(result)).en.startswith("OK") is not bool(said)


def test_what_was_answered_more_slowly_may_come_later() -> None:
    """The slowest response took longer than what is long for others."""
    stage = Stage()
    line = machine(Client(stage), pause=800).start().read(1082, cycles=810)
    line.ask(READ, 700)
    assert "DS514" not in {each.rule for each in analyze(io.BytesIO(captured(stage))).findings}


# A master that stops


def stopped(*, starts: bool) -> Source:
    """60 data exchanges, a request of PKW in the last one, nothing for two seconds, and 20 more."""
    master, idle, pzd = Master(), "00" * 8, "047F1000"
    master.start(3)
    for each in [idle] * 59 + ["139A" + "00" * 6]:
        master.exchange(3, each + pzd, idle + "EB370800")
        master.wait(10)
    master.wait(2000)
    if starts:
        master.restart(3)
        master.start(3)
    for _ in range(20):
        master.exchange(3, "13AD" + "00" * 6 + pzd, "13AD" + "00" * 6 + "EB370800")
        master.wait(10)
    return Source("restarted" if starts else "paused", captured(master.stage), False)


@pytest.mark.parametrize(
    ("starts", "states", "said"),
    [(True, ["unanswered", "ok"], set()), (False, ["incomplete", "ok"], {"DS110", "DS725"})],
)
def test_no_frame_is_missing_before_a_start_up(
    starts: bool, states: list[str], said: set[str]
) -> None:
    """The station is set up anew: the master was off, and what it asked before has no answer."""
    result = analyze(stopped(starts=starts).open())
    assert [each.state for each in result.transactions] == states
    assert {each.rule for each in result.findings} - {"DS810"} == said


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_misses_no_frame_there_either(version: str, tmp_path: Path) -> None:
    compare(version, "en", [stopped(starts=True), stopped(starts=False)], tmp_path)


# What the file says


@pytest.mark.parametrize(("dropped", "words"), [(None, False), (0, False), (2, True)])
def test_a_request_without_a_response_says_that_frames_were_dropped(
    dropped: int | None, words: bool
) -> None:
    found = analyze(io.BytesIO(reads(3, **NEVER, dropped=dropped))).findings
    mine = [each for each in found if each.rule == "DS503"]
    assert [each.args["dropped"] for each in mine] == [words] * 3
    assert all(
        sentence(each).endswith("(the capture dropped frames)") is words
        and sentence(each, "zh").endswith("（抓包丢失了帧）") is words
        for each in mine
    )


def test_so_does_what_reads_as_a_request() -> None:
    stage = Stage(dropped=2)
    machine(Client(stage), pause=10_000).start().read(700, cycles=40)
    (found,) = [
        each for each in analyze(io.BytesIO(captured(stage))).findings if each.rule == "DS514"
    ]
    assert json.loads(json.dumps(found.args))["dropped"] is True
