"""PROFIBUS read anew: frames, exchanges, services of MS1 and MS2 as records, data exchange. Nothing is judged here.

All frames are in memory, and each question looks through them again: which answer follows a request, and whether it
is a repetition. Numbers are those of EN 50170 and of docs/profibus.md, written down here once more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from math import inf
from uuid import UUID

from tests.audit import wire

LINKS = (257, 147)
OWN = 147
"""The link type that is everybody's own: nothing counts before a frame with the right check byte."""
SHORT, TOKEN = 0xE5, 0xDC
ALL = 127
SILENT, STATUS_REQUEST = (0, 4, 6), 9
"""Functions of requests that nobody answers, and FDL_Status."""
DATA, HIGH = (0x8, 0xA, 0xC, 0xD), (0xA, 0xD)
"""Functions of answers with data, and those that ask for Slave_Diag."""
OUTPUTS = (0xC, 0xD)
"""Functions of requests of data exchange."""
REFUSALS = (1, 2, 3)
READ, WRITE, IDLE = 0x5E, 0x5F, 0x48
OTHERS = (0x51, 0x56, 0x57, 0x58, 0x5C)
"""Functions of MS1 and MS2 that are no records: transport, resources, initiate, abort, alarm."""
NEGATIVE = 0x80
SERVICES = {
    (49, 50): "resource", (50, 51): "alarm", (51, 51): "record", (53, 62): "extended", (55, 62): "address",
    (56, 62): "inputs", (57, 62): "outputs", (58, 62): "control", (59, 62): "get_configuration", (60, 62): "diagnosis",
    (61, 62): "parameters", (62, 62): "configuration",
}  # fmt: skip


@dataclass
class Heard:
    """One frame of the line. What is damaged has no more than its bytes."""

    number: int
    time_ns: int
    data: bytes
    damage: str = ""
    """Empty, "check", "other", or "cut" where only the recording has not all of it."""
    da: int = -1
    sa: int = -1
    fc: int = -1
    saps: tuple[int | None, int | None] = (None, None)
    """At the destination, at the source."""
    du: bytes = b""
    torn: int = -1
    """Of one that the recording has not all of: the station that it was said to, or that said it."""

    @property
    def good(self) -> bool:
        return not self.damage

    @property
    def token(self) -> bool:
        return self.good and self.data[0] == TOKEN

    @property
    def short(self) -> bool:
        return self.good and self.data[0] == SHORT

    @property
    def asks(self) -> bool:
        return self.good and self.fc >= 0 and bool(self.fc & 0x40)

    @property
    def counts(self) -> bool:
        """Whether its FCB says which request it is (FCV)."""
        return bool(self.fc & 0x10)

    @property
    def service(self) -> str:
        """Of a request."""
        if self.saps == (None, None):
            return "exchange" if self.fc & 15 in OUTPUTS else ""
        slave, master = self.saps
        if slave is None or master is None:
            return ""
        return SERVICES.get((slave, master), "ms2" if master == 50 and slave <= 48 else "")


def _is_silent(asked: Heard) -> bool:
    return asked.da == ALL or asked.fc & 15 in SILENT


@dataclass
class Turn:
    """A request, and what followed it."""

    asked: Heard
    answer: Heard | None = None
    repeats: list[Heard] = field(default_factory=list)
    """The same request again, before an answer."""
    again: bool = False
    """It repeats a turn that has its answer."""
    hole: bool = False
    """A turn of these two is missing before it: its FCB is that of the one that is there."""
    broken: list[int] = field(default_factory=list)
    """The damaged frames behind it, in the place of its answer."""
    cut: bool = False
    """Behind it stands a frame that the recording has not all of, which may be its answer."""
    last: bool = False
    """The recording ends before an answer, and before a token, behind which nobody waits for one."""

    @property
    def silent(self) -> bool:
        return _is_silent(self.asked)


@dataclass
class Line:
    """All that was read."""

    heard: list[Heard]
    flow: list[Heard] = field(default_factory=list)
    """Those without the second ones, where the recording has each frame twice."""
    doubled: bool = False
    first: dict[int, int] = field(default_factory=dict)
    """Each frame -> that of them which is the first one of the two."""
    turns: list[Turn] = field(default_factory=list)
    """Those that nobody answers are among them."""
    doubts: list[int] = field(default_factory=list)
    """Damaged frames that may be requests: none before them waits for an answer."""
    stray: list[Heard] = field(default_factory=list)
    records: list[wire.Record] = field(default_factory=list)
    polls: dict[int, int] = field(default_factory=dict)
    """Of each record with an answer: how many exchanges brought none, by the frame of the answer."""
    stations: dict[int, int] = field(default_factory=dict)
    """And the station that it is of."""

    @property
    def disordered(self) -> bool:
        """Whether a frame stands behind one that was sent later."""
        return any(two.time_ns < one.time_ns for one, two in pairwise(self.heard))

    def of(self, station: int) -> list[Turn]:
        """The turns with a station, in their order."""
        return [each for each in self.turns if each.asked.da == station and not each.silent]

    def behind_a_lull(self) -> int:
        """The request behind a pause that is half as long again as any other; 0 where none stands out."""
        pauses = [two.time_ns - one.time_ns for one, two in pairwise(self.heard)]
        second, longest = [0, 0, *sorted(pauses)][-2:]
        if 2 * longest <= 3 * second:
            return 0
        behind = self.heard[pauses.index(longest) + 1 :]
        return next((each.number for each in behind if each.good and each.asks), 0)


# Frames


def hear(frame: wire.Frame) -> Heard:
    """One frame."""
    data = frame.data
    found = Heard(frame.number, frame.time_ns, data)
    found.damage = _take_apart(found)
    if found.damage == "short":
        found.damage = "cut" if frame.cut else "other"
    elif found.damage and frame.cut and _is_short(data):
        found.damage = "cut"
    if found.damage == "cut":
        found.torn = _torn_of(data)
    if found.damage:
        found.da = found.sa = found.fc = -1
    return found


def _torn_of(data: bytes) -> int:
    """The station that a frame without its end was said to, or that said it; -1 where that is not there."""
    head = 4 if data[:1] == b"\x68" else 1
    if data[:1] not in (b"\x68", b"\x10", b"\xa2") or len(data) < head + 3:
        return -1
    to, source, fc = data[head : head + 3]
    return (to if fc & 0x40 else source) & 127


def _length(data: bytes) -> int:
    """Bytes that the frame should have, 0 where that cannot be known."""
    if data[0] == 0x68:
        even = len(data) > 2 and data[1] == data[2] and 3 <= data[1] <= 249
        return data[1] + 6 if even else 0
    return {0x10: 6, 0xA2: 14, TOKEN: 3, SHORT: 1}.get(data[0], 0)


def _is_short(data: bytes) -> bool:
    return not data or len(data) < (_length(data) or (3 if data[0] == 0x68 else 0))


def _take_apart(found: Heard) -> str:
    """Fills in what a frame says; gives what is wrong with it."""
    data = found.data
    if not data or (data[0] == 0x68 and len(data) < 3):
        return "short"
    length = _length(data)
    if not length:
        return "other"
    if data[0] in (TOKEN, SHORT):
        if data[0] == TOKEN and len(data) == 3:
            found.da, found.sa = data[1], data[2]
        if len(data) < length:
            return "short"
        return "other" if len(data) > length or max(data[1:3], default=0) > 126 else ""
    head = 4 if data[0] == 0x68 else 1
    if len(data) < length - 1:
        return "short"
    body, check = data[head : length - 2], data[length - 2]
    if sum(body) % 256 != check:
        return "check"
    if len(data) < length:
        return "short"
    wrong = len(data) > length or data[length - 1] != 0x16 or (head == 4 and data[3] != 0x68)
    found.da, found.sa, found.fc = body[0] & 127, body[1] & 127, body[2]
    rest, saps = body[3:], []
    for address in body[:2]:
        sap, more = None, address > 127
        while more:
            if not rest:
                return "other"
            sap = rest[0] & 63 if sap is None and not rest[0] & 64 else sap
            more, rest = rest[0] > 127, rest[1:]
        saps.append(sap)
    found.saps, found.du = (saps[0], saps[1]), rest
    return "other" if wrong or found.sa == ALL or found.fc > 127 else ""


# Turns


def line(frames: list[wire.Frame]) -> Line | None:
    """The line of a capture, None where it has none."""
    heard = [hear(each) for each in frames if each.link in LINKS]
    links = {each.number: each.link for each in frames}
    proof = [
        each.number for each in heard
        if links[each.number] != OWN or (each.good and not each.token and not each.short)
    ]  # fmt: skip
    heard = [each for each in heard if proof and each.number >= proof[0]]
    if not heard:
        return None
    found = Line(heard)
    found.doubled = _is_doubled(heard)
    found.flow = list(_single(heard)) if found.doubled else heard
    kept = {each.number for each in found.flow}
    for each in heard:
        found.first[each.number] = each.number if each.number in kept else each.number - 1
    _turns(found)
    _services(found)
    return found


def _is_doubled(heard: list[Heard]) -> bool:
    """Whether the line was recorded at two places: every answer stands there twice, or nearly so."""
    answers = [each for each in heard if each.good and not each.token and not each.asks]
    before = {two.number: one.data for one, two in pairwise(heard)}
    twice = [each for each in answers if before.get(each.number) == each.data]
    return bool(answers) and 3 * len(twice) >= len(answers)


def _single(heard: list[Heard]) -> Iterator[Heard]:
    """Of equal frames in a row every second one."""
    for _, group in groupby(heard, key=lambda each: each.data):
        yield from list(group)[::2]


def _turns(found: Line) -> None:
    """Goes from request to request, and looks ahead for what belongs to each."""
    taken: set[int] = set()
    answers: set[int] = set()
    waited: set[int] = set()
    for at, asked in enumerate(found.flow):
        if asked.number in taken or not asked.asks:
            continue
        turn = Turn(asked)
        if not turn.silent:
            _look_ahead(turn, found.flow[at + 1 :], taken, waited)
            if turn.answer is not None:
                answers.add(turn.answer.number)
        found.turns.append(turn)
    for each in found.flow:
        if each.good and not each.token and not each.asks and each.number not in answers:
            found.stray.append(each)
    found.doubts = [each.number for each in found.flow if each.damage and each.number not in waited]
    for at, turn in enumerate(found.turns):
        turn.again = not turn.silent and _is_again(turn, found.turns[:at], found)
    before: dict[tuple[int, int], Heard] = {}
    for turn in found.turns:
        if not turn.silent:
            way, asked = (turn.asked.sa, turn.asked.da), turn.asked
            last, before[way] = before.get(way, asked), asked
            turn.hole = last.counts and asked.counts and not turn.again and last is not asked
            turn.hole = turn.hole and last.fc & 0x20 == asked.fc & 0x20


def _look_ahead(turn: Turn, later: list[Heard], taken: set[int], waited: set[int]) -> None:
    passed, whole, gone = False, True, inf
    for before, each in pairwise([turn.asked, *later]):
        if each.damage == "cut" and (passed or not whole):
            return  # a second frame, or one behind a token: a request of which nothing is known
        waited.add(each.number)
        if each.damage == "cut":
            turn.cut, whole = True, False
        elif each.damage:
            turn.broken += [each.number] * (not passed)
        elif each.token or (each.asks and _is_silent(each)):
            passed, gone = True, each.time_ns if each.token else gone
        elif each.asks:
            at_once = before.data == each.data  # directly behind itself FCV does not matter
            if each.data != turn.asked.data or not (turn.asked.counts or at_once):
                return
            passed, whole, gone = False, True, inf
            turn.repeats.append(each)
            taken.add(each.number)
        elif turn.asked.time_ns <= each.time_ns < gone and (
            each.short or _is_answer(turn.asked, each)
        ):
            turn.answer = each
            return
    turn.last = not passed


def _is_answer(asked: Heard, told: Heard) -> bool:
    turned = (asked.saps[1], asked.saps[0])
    return (told.da, told.sa) == (asked.sa, asked.da) and told.saps in (turned, (None, None))


def _is_again(turn: Turn, before: list[Turn], found: Line) -> bool:
    """Whether it is the turn before once more: a master repeats at once, before it says anything else."""
    if not before or not turn.asked.counts or before[-1].asked.data != turn.asked.data:
        return False
    between = [each.number for each in found.stray] + found.doubts
    between += [each.number for each in found.flow if each.token]
    return not any(before[-1].asked.number < each < turn.asked.number for each in between)


# Records


@dataclass
class _Open:
    record: wire.Record
    polled: int = 0
    doubtful: bool = False
    """Something that was said with its station is missing: a refusal may be for another one."""


def _services(found: Line) -> None:
    opened: dict[tuple[int, int, int | None], _Open] = {}
    for turn in found.turns:
        if turn.hole:
            for each in opened:
                opened[each].doubtful |= each[1] == turn.asked.da
        if turn.asked.service not in ("record", "ms2"):
            continue
        key = turn.asked.sa, turn.asked.da, turn.asked.saps[0]
        du = turn.asked.du
        if du and du[0] != IDLE and not turn.again:
            opened.pop(key, None)
            if du[0] in (READ, WRITE) and len(du) > 2:
                record = _asked(turn.asked)
                opened[key] = _Open(record)
                found.records.append(record)
        _answer(found, turn, key, opened)


def _answer(
    found: Line, turn: Turn, key: tuple[int, int, int | None],
    opened: dict[tuple[int, int, int | None], _Open],
) -> None:  # fmt: skip
    held, told = opened.get(key), turn.answer
    if held is not None and held.doubtful and told is not None and _refuses(told):
        del opened[key]
        return
    if held is not None and told is not None and told.fc & 15 in REFUSALS and not told.short:
        _ends(held.record, told, wire.FAULT)
        del opened[key]
        return
    du = told.du if told is not None else b""
    if told is None or not du or du[0] == IDLE:
        if held is not None:
            held.polled += 1
        return
    function = du[0] & ~NEGATIVE
    if function not in (READ, WRITE):
        opened.pop(key, None)
    elif held is not None and held.record.write == (function == WRITE) and (
        du[0] & NEGATIVE or len(du) < 3 or (du[1], du[2]) == (held.record.slot, held.record.index)
    ):  # fmt: skip
        del opened[key]
        _ends(held.record, told, wire.RESPONSE)
        found.polls[told.number] = held.polled
        found.stations[told.number] = key[1]
    elif not turn.again and not du[0] & NEGATIVE and len(du) > 2:
        opened.pop(key, None)
        record = _record(turn.asked, told, du, du[0] == WRITE)
        _ends(record, told, wire.RESPONSE)
        found.records.append(record)


def _refuses(told: Heard) -> bool:
    """Whether an answer is a refusal: by the link, or by the slave."""
    by_link = told.fc & 15 in REFUSALS and not told.short
    return by_link or told.du[:1] in (bytes([READ | NEGATIVE]), bytes([WRITE | NEGATIVE]))


def _pdu(heard: Heard, kind: int, write: bool) -> wire.Pdu:
    return wire.Pdu(
        heard.number, heard.time_ns, f"dp{heard.sa}", f"dp{heard.da}", kind, ">", UUID(int=0), 0,
        wire.WRITE if write else wire.READ, heard.du, [heard.number], 0, False, UUID(int=0),
    )  # fmt: skip


def _record(asked: Heard, told: Heard | None, du: bytes, write: bool) -> wire.Record:
    """A record that starts with its answer, or with its request."""
    first = told or asked
    call = wire.Call(_pdu(first, wire.REQUEST, write))
    return wire.Record(
        write, False, f"dp{asked.sa}", f"dp{asked.da}", UUID(int=0), None, du[1], None, du[2],  # type: ignore[arg-type]
        call, 0 if told else asked.number, None, b"", 0, 0, None,
    )  # fmt: skip


def _asked(asked: Heard) -> wire.Record:
    du = asked.du
    record = _record(asked, None, du, du[0] == WRITE)
    length = du[3] if len(du) > 3 else 0
    if record.write:
        record.data, record.stated = du[4 : 4 + length], length
    else:
        record.wanted = length
    return record


def _ends(record: wire.Record, told: Heard, kind: int) -> None:
    """The answer of a record; a refusal that is too short has zeros for what is missing."""
    du = told.du
    record.answered = told.number
    record.call.response = _pdu(told, kind, record.write)
    if kind == wire.FAULT:
        return
    if du[0] & NEGATIVE:
        record.status = int.from_bytes(du[:4].ljust(4, b"\0"))
        return
    record.status = 0
    if not record.write:
        record.stated = du[3] if len(du) > 3 else 0
        record.data = du[4 : 4 + record.stated]


def enter(capture: wire.Capture) -> None:
    """Puts the line into the capture, its records, and a Connect for each Set_Prm."""
    found = capture.line = line(capture.frames)
    if found is None:
        return
    capture.records += found.records
    for record in found.records:
        capture.calls.append(record.call)
        capture.pdus.append(record.call.request)
        if record.call.response is not None:
            capture.pdus.append(record.call.response)
    for turn in start_ups(found):
        connect = _pdu(turn.asked, wire.REQUEST, True)
        connect.operation = wire.CONNECT
        capture.calls.append(wire.Call(connect))


def is_taken(turn: Turn) -> bool:
    """Whether the station took a request: it was answered, and not by an error of the link (UE, RR, RS)."""
    told = turn.answer
    return told is not None and (told.short or told.fc & 15 not in REFUSALS)


def start_ups(found: Line, station: int | None = None) -> Iterator[Turn]:
    """The Set_Prm that were taken, of all stations or of one."""
    for turn in found.turns:
        mine = station is None or turn.asked.da == station
        if mine and turn.asked.service == "parameters" and is_taken(turn):
            yield turn


def exchanges(found: Line, master: str, station: str) -> Iterator[Turn]:
    """The data exchanges of two stations that were taken."""
    for turn in found.turns:
        names = f"dp{turn.asked.sa}", f"dp{turn.asked.da}"
        if turn.asked.service == "exchange" and is_taken(turn) and names == (master, station):
            yield turn
