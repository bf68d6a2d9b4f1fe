"""Control and status word of one drive along the time: words to events, values to points (docs/cyclic.md 3).

One relation at a time, fed with what changed in it; frames and times are arguments. Which bytes of which frame
these words are is the business of `relations` and `channels`; what is wrong is said in `operation`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ds47.cyclic import pzd
from ds47.cyclic.operation import Now, Operation
from ds47.cyclic.trips import Trips
from ds47.model import Event, Point
from ds47.spec import cyclic
from ds47.spec.cyclic import Edge

HEEDED = 10
"""Bit of STW1: where it is 0, the drive ignores the whole word and keeps the one before."""
REQUESTED = 9
"""Bit of ZSW1: the drive wants to be controlled by the PLC."""
RUNNING = 2
"""Bit of ZSW1: operation enabled."""
_HEALTHY = 0x0030
"""Bits of ZSW1: neither OFF2 nor OFF3."""
_LEGAL = frozenset((1, 3, 7))
"""Bits 2 to 0 of ZSW1 in the states S2 to S4."""
_ILLEGAL = frozenset((2, 4, 6))
"""No drive without a fault has these."""
_INHIBITED, _FAULT = 0x0040, 0x0008
FREE = 0xF000
"""Bits of STW1 that most controllers leave at 0; telegram 20, motor potentiometers and some makers use them."""
_COMPLETE, _SWITCHED = 0x007E, 0x0081
"""Bits of a control word that wants the drive to run, and those that change in it: one that lacks bit 10 alone."""
_ACKNOWLEDGE = 0x0080
_OF_DRIVES = 0xFF00
"""Bits of ZSW1 that a fault leaves as they are."""
_NUMBER = 0x07FF
"""Bits of PKE that are a parameter number; the response has that of its request."""
_REACTION_NS = 2_000_000_000
"""So soon after ON a drive has the next state."""
_LAST_TASK = 63
"""Of traversing tasks, which telegram 7 has where telegram 1 has the setpoint; bit 15 is no part of the number."""


@dataclass(slots=True)
class Values:
    """The points of one value: all of them, and from `MOST` on the least and the greatest of neighbours."""

    MOST = 4096
    points: list[Point] = field(default_factory=list)

    def take(self, time_ns: int, raw: int) -> None:
        """The value at a time."""
        last = self.points[-1] if self.points else None
        if last is not None and last.time_ns == time_ns:
            self.points[-1] = Point(time_ns, min(last.least, raw), max(last.most, raw))
            return
        self.points.append(Point(time_ns, raw, raw))
        if len(self.points) > self.MOST:
            self._thin()

    def _thin(self) -> None:
        """Half of the points, each for two neighbours: not those of the densest time, where something happens."""
        gaps = [b.time_ns - a.time_ns for a, b in zip(self.points, self.points[1:], strict=False)]
        median = sorted(gaps)[len(gaps) // 2]
        kept, at = [], 0
        while at < len(self.points):
            one = self.points[at]
            if at + 1 < len(self.points) and gaps[at] <= 2 * median:
                other = self.points[at + 1]
                one = Point(one.time_ns, min(one.least, other.least), max(one.most, other.most))
                at += 1
            kept.append(one)
            at += 1
        self.points = kept


@dataclass(slots=True)
class Recorder:
    """What happened to a drive, from its cyclic frames.

    Args:
        operation: gets every frame while the data of both sides is valid.
        trusted: whether the words alone prove a drive; else only what it does after ON.
        speed: whether the word behind STW1 is a setpoint of speed; None where the lengths do not tell.
        codes: where in the drive's data WARN_CODE and FAULT_CODE are, None where the telegram has none.
        most: events that are kept.
        own: whether bit 11 of STW1 is one of another maker than Siemens: no direction, as far as anybody knows.
    """

    operation: Operation
    trusted: bool
    speed: bool | None
    codes: tuple[int, int] | None = None
    most: int = 65_536
    own: bool = False
    events: list[Event] = field(default_factory=list)
    left_out: int = 0
    """Events for which there was no room."""
    setpoint: Values = field(default_factory=Values)
    actual: Values = field(default_factory=Values)
    faults: list[tuple[int, int]] = field(default_factory=list)
    """Frames and fault numbers, where the telegram has them, at each change."""
    proven: bool = False
    """Whether both words were seen as a drive has them that a PLC controls."""
    refuted: bool = False
    """Whether a word was seen that no drive has."""
    reacted: bool = False
    """Whether ON led to the next state."""
    odd: bool = False
    """Whether a control word has bits that few controllers use, and not the one that makes a drive heed it; or
    both words are those of a request of PKW and its response."""
    legal: bool = False
    """Whether a status word was seen that shows a state of a drive."""
    fault_since: int | None = None
    """The first frame with the fault that stands in its newest valid data; None where none does."""
    end_ns: int = 0
    """Time of the last frame that was looked at."""
    trips: Trips = field(init=False)
    _stw1: int | None = None
    _zsw1: int | None = None
    _heeded: int | None = None
    """The last control word that the drive heeds."""
    _on_ns: int | None = None
    """When ON was given to a drive that was ready for it."""
    _failed: list[bool] = field(default_factory=list)
    """Of each fault that came whether the drive was ready before."""
    _lost: set[bool] = field(default_factory=set)
    _skipped: bool = False
    """Whether frames are missing before the next one of the drive."""
    _setpoint: int | None = None
    _actual: int | None = None
    _said: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0), (0, 0)])
    """Time and frame since which the drive, and the controller, says what it says."""

    def __post_init__(self) -> None:
        self.trips = Trips(self.operation.bounds.trip_ns)

    @property
    def has_sense(self) -> bool:
        """Whether the words as a whole may be a control and a status word; False before both were seen."""
        return self.legal and self._stw1 is not None and (self.reacted or not self.odd)

    def sent(self, data: bytes, frame: int, time_ns: int) -> None:
        """The words of the controller from a frame on."""
        stw1, self.end_ns = int.from_bytes(data[:2]), time_ns
        if stw1 != self._stw1 or True in self._lost:
            self._said[True] = time_ns, frame
        if stw1 != self._stw1 or self._lost:
            self._control(stw1, frame, time_ns)
        raw = int.from_bytes(data[2:4], signed=True)
        if self._learnt(raw):
            self._setpoint = -raw if pzd.turns(stw1, self.own) else raw
            self.setpoint.take(time_ns, self._setpoint)
        self._tell(frame, True)

    def answered(self, data: bytes, frame: int, time_ns: int) -> None:
        """The words of the drive from a frame on."""
        zsw1, self.end_ns = int.from_bytes(data[:2]), time_ns
        if self.codes is not None:
            at = self.codes[1]
            self._fault(int.from_bytes(data[at : at + 2]), frame)
        if zsw1 != self._zsw1 or False in self._lost:
            self._said[False] = time_ns, frame
        if zsw1 != self._zsw1 or self._lost:
            self._status(zsw1, frame, time_ns)
        self._skipped = False
        raw = int.from_bytes(data[2:4], signed=True)
        if self._learnt(raw):
            self._actual = raw
            self.actual.take(time_ns, raw)
        self._tell(frame, False)

    def _tell(self, frame: int, by_controller: bool) -> None:
        stw1, zsw1 = self._stw1, self._zsw1
        if stw1 is None or zsw1 is None or self._lost:
            return
        since, other = (self.end_ns, frame), self._said[not by_controller]
        if 0 < other[0] - since[0] < self.operation.bounds.disorder_ns:
            since = other
        heeded = stw1 if self._heeded is None else self._heeded
        values = self._setpoint, self._actual
        self.operation.look(Now(frame, self.end_ns, stw1, heeded, zsw1, *values, since))

    def skipped(self) -> None:
        """Frames are missing from here on: the words in them are unknown."""
        self._skipped, self._on_ns = True, None
        self.trips.skipped()
        self.operation.skipped()

    def lost(self, by_controller: bool, frame: int, time_ns: int) -> None:
        """Data of one side is not valid from a frame on."""
        if by_controller in self._lost or (self._stw1 if by_controller else self._zsw1) is None:
            return
        if not by_controller and self._zsw1 is not None:
            self.trips.lost(self._zsw1, time_ns)
        self._lost.add(by_controller)
        self.end_ns = time_ns
        self.trips.explained = self.operation.lost(frame, by_controller) or self.trips.explained
        self._happened("output-lost" if by_controller else "input-lost", frame, time_ns)

    def _back(self, by_controller: bool, frame: int, time_ns: int) -> None:
        if by_controller in self._lost:
            self._lost.remove(by_controller)
            self.trips.explained = self.trips.explained and not by_controller
            self._happened("output-back" if by_controller else "input-back", frame, time_ns)

    def _control(self, stw1: int, frame: int, time_ns: int) -> None:
        before, self._stw1 = self._stw1, stw1
        heeded, now = self._heeded, stw1 >> HEEDED & 1
        self.odd = self.odd or bool(stw1 & FREE and not now)
        if now:
            self._heeded = stw1
        self.trips.asked(stw1 if self._heeded is None else self._heeded)
        if now and stw1 & ~(heeded or 0) & 1 and (self._zsw1 or 0) & 7 == 1:
            self._on_ns = time_ns
        self._look()
        self._back(True, frame, time_ns)
        if before is None:
            self._happened("first", frame, time_ns, "STW1", None, stw1)
            return
        for edge in cyclic.edges("stw1"):
            if edge.bit == HEEDED:
                changed = self._is_edge(edge, before, stw1)
            else:
                changed = bool(now) and heeded is not None and self._is_edge(edge, heeded, stw1)
            if changed:
                self._happened(edge.id, frame, time_ns, "STW1", before, stw1)

    def _status(self, zsw1: int, frame: int, time_ns: int) -> None:
        before, self._zsw1 = self._zsw1, zsw1
        # Between two periods of valid data all is unknown. A fault on both sides of a gap was there before it.
        lost = False in self._lost
        seen, since = not (lost or self._skipped), None if lost else self.fault_since
        self.fault_since = (since or frame) if zsw1 & _FAULT else None
        if not zsw1 & _FAULT and (zsw1 & 7 in _ILLEGAL or (zsw1 & _INHIBITED and zsw1 & 7)):
            self.refuted = True
        if self._on_ns is not None and (before or 0) & 7 == 1 and zsw1 & 7 in (3, 7):
            self.reacted = self.reacted or time_ns - self._on_ns <= _REACTION_NS
            self.trusted = self.trusted or self.reacted
        standing = _is_healthy(zsw1) and (zsw1 & 7 == 0 or zsw1 & _FAULT)
        self.legal = self.legal or _is_legal(zsw1) or bool(standing)
        if before is not None:
            self.trips.said(before, zsw1, frame, time_ns, seen=seen)
            if _is_failure(before, zsw1):
                self._failed.append(bool(before & 1))
        self._look()
        self._back(False, frame, time_ns)
        if before is None:
            self._happened("first", frame, time_ns, "ZSW1", None, zsw1)
            return
        for edge in cyclic.edges("zsw1"):
            if self._is_edge(edge, before, zsw1):
                self._happened(edge.id, frame, time_ns, "ZSW1", before, zsw1)

    def _is_edge(self, edge: Edge, before: int, after: int) -> bool:
        return bool((before ^ after) >> edge.bit & 1) and after >> edge.bit & 1 == edge.value

    def _happened(
        self, name: str, frame: int, time_ns: int,
        word: str | None = None, before: int | None = None, after: int | None = None,
    ) -> None:  # fmt: skip
        if len(self.events) >= self.most:
            self.left_out += 1
            return
        state: str | None = None
        overlays: tuple[str, ...] = ()
        if self._zsw1 is not None and False not in self._lost:
            status = pzd.state(self._zsw1, self._heeded)
            state, overlays = status.state, status.overlays
        self.events.append(Event(frame, time_ns, name, word, before, after, state, overlays))

    def _look(self) -> None:
        """Whether these words look like those of a drive under control."""
        stw1, zsw1 = self._stw1, self._zsw1
        if stw1 is None or zsw1 is None:
            return
        both = bool(stw1 & FREE and zsw1 & FREE)
        self.odd = self.odd or (both and stw1 & _NUMBER == zsw1 & _NUMBER != 0)
        if self.proven or not self.trusted:
            return
        heeded = bool(stw1 >> HEEDED & 1) and (self.reacted or not stw1 & FREE)
        heeded = heeded or stw1 & ~_SWITCHED == _COMPLETE
        self.proven = heeded and bool(zsw1 >> REQUESTED & 1) and _is_legal(zsw1)

    def _learnt(self, raw: int) -> bool:
        """Whether the second word is a speed: a number that no traversing task has shows it."""
        if self.speed is None and (raw & 0x7FFF) > _LAST_TASK:
            self.speed = True
        return bool(self.speed)

    def finish(self, configured: bool) -> None:
        """Nothing more comes: a fault that came and stays shows a drive, though nobody controls it.

        One that was not ready only where that is all that changed, and its telegram is `configured`.
        """
        comes = any(self._failed) or (configured and len(self._failed) == 1)
        if self.trusted and comes and self.fault_since is not None:
            self.proven = self.proven or self._stw1 in (0, _ACKNOWLEDGE)

    def result(self) -> list[Event]:
        """The events; those of bits that are about a speed only where it is known to be one."""
        if self.speed and not self.own:
            return self.events
        others = {
            edge.id for edge in cyclic.edges("stw1")
            if (edge.speed and not self.speed) or (self.own and edge.bit == pzd.REVERSE)
        }  # fmt: skip
        return [each for each in self.events if each.name not in others]

    def fault_code(self, frame: int) -> int | None:
        """The number of the fault that came with a frame: it stands there already, or comes soon."""
        there = [code for at, code in self.faults if at <= frame]
        if there and there[-1]:
            return there[-1]
        return next((code for at, code in self.faults if at > frame and code), None)

    def running(self, first: int, last: int) -> bool | None:
        """Whether the drive ran in all frames from one to another; None if it changed, or if that is unknown."""
        found = now = newest = None
        for event in self.events:
            if event.word == "ZSW1" and event.after is not None:
                now = newest = bool(event.after >> RUNNING & 1)
            elif event.name in ("input-lost", "input-back"):
                now = newest if event.name == "input-back" else None
            else:
                continue
            if event.frame <= first:
                found = now
            elif event.frame <= last and now != found:
                return None
        return found

    def running_since(self, frame: int) -> int | None:
        """The frame in which it began to run, before or in this one; None where it ran from the beginning on."""
        begun = [
            each.frame for each in self.events if each.name == "running" and each.frame <= frame
        ]
        return begun[-1] if begun else None

    def state_at(self, frame: int) -> str | None:
        """The state of the drive in a frame; None if unknown."""
        before = [each.state for each in self.events if each.frame <= frame]
        return before[-1] if before else None

    def cut(self, frame: int, time_ns: int) -> None:
        """Forgets what was seen from a frame on, at that time."""
        operation = self.operation
        self.events = [each for each in self.events if each.frame < frame]
        self.faults = [each for each in self.faults if each[0] < frame]
        self.trips.frames = [each for each in self.trips.frames if each < frame]
        operation.remarks = [each for each in operation.remarks if each.frame < frame]
        for values in (self.setpoint, self.actual):
            values.points = [each for each in values.points if each.time_ns < time_ns]
        self.end_ns = time_ns
        self.fault_since = None

    def _fault(self, code: int, frame: int) -> None:
        if code != (self.faults[-1][1] if self.faults else 0) and len(self.faults) < self.most:
            self.faults.append((frame, code))


def _is_healthy(zsw1: int) -> bool:
    return zsw1 & _HEALTHY == _HEALTHY


def _is_legal(zsw1: int) -> bool:
    """Whether a status word shows one of the states S1 to S4, or a fault; without OFF2 and OFF3 but in S1."""
    if zsw1 & _INHIBITED:
        return zsw1 & 6 == 0
    fails = zsw1 & 7 == 0 and bool(zsw1 & _FAULT)
    return (fails or zsw1 & 7 in _LEGAL) and _is_healthy(zsw1)


def _is_failure(before: int, zsw1: int) -> bool:
    """Whether a drive that wants to be controlled gets a fault, and is not ready: no more changes."""
    comes = zsw1 & ~before & _FAULT and not zsw1 & 7
    same = before >> REQUESTED & 1 and not (before ^ zsw1) & _OF_DRIVES
    return bool(comes and same) and _is_legal(before) and _is_legal(zsw1)
