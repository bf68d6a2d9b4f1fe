"""Judgement: what STW1 and ZSW1 say of the operation of a drive, to findings DS521 to DS529, DS532 (cyclic.md 6).

Why a drive does not start, who switched it off. Fed by `timeline` with every frame that is looked at; a rule is
about an edge, or about something that stands for so long. Whether anybody wants to know (another maker's drive,
no proof) is decided elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ds47.cyclic import pzd
from ds47.findings.remark import Remark
from ds47.spec import cyclic
from ds47.spec.semantics import Limits

_ON, _CONTROL = 0x0001, 0x0400
_COMPLETE = 0x040F
"""Bits of STW1: 0 to 3 and 10."""
_NO_OFF = 0x0006
_SETPOINT = 0x0070
_ACKNOWLEDGE = 0x0080
_JOG = 0x0300
_RUNNING, _FAULT, _INHIBITED, _NO_DEVIATION, _REQUESTED = 0x0004, 0x0008, 0x0040, 0x0100, 0x0200
"""Bits of ZSW1."""
_OFF = ((0x0010, 0x0002, "OFF2"), (0x0020, 0x0004, "OFF3"))
"""Bit of ZSW1, 0 while it is active; bit of STW1, 0 where the controller asks for it."""
_MOVED = 0.01
"""Share of 100 % by which a setpoint has moved."""


class Now(NamedTuple):
    """What both sides say, and when."""

    frame: int
    time_ns: int
    stw1: int
    """As it was sent."""
    heeded: int
    """The last one that the drive heeds."""
    zsw1: int
    setpoint: int | None
    """As it is effective, raw; None where the telegram has none."""
    actual: int | None
    since: tuple[int, int]
    """Time and frame from which on both say so: those of the other side where these are later by the clock."""


@dataclass(slots=True)
class _Standing:
    """A condition that is reported once, at its end, if it lasted long enough."""

    rule: str
    limit_ns: int
    of_values: bool = False
    """Whether values decide. These are not looked at in each frame: it stood until it was seen last."""
    begun: Now | None = None
    newest: Now | None = None
    reported: bool = False
    """Whether it was reported before a gap in the frames, and may still hold after it."""

    def look(self, holds: bool, now: Now) -> tuple[Now, float] | None:
        """Where it began and how many seconds it stood, if it ended and stood for long enough."""
        if holds:
            if not self.reported:
                self.begun, self.newest = self.begun or now, now
            return None
        self.reported = False
        if self.begun is not None and not self.of_values:
            self.newest = now  # it stood until this frame
        return self.ended()

    def ended(self) -> tuple[Now, float] | None:
        """The same; it ends now, whatever holds."""
        begun, newest = self.begun, self.newest
        self.begun = self.newest = None
        if begun is None or newest is None:
            return None
        stood = newest.time_ns - begun.since[0]
        return (begun, stood / 1e9) if stood >= self.limit_ns else None


@dataclass(slots=True)
class Operation:
    """What is wrong with the operation of one drive.

    Args:
        where: arguments of every finding: the device and its slot.
        bounds: how long is too long.
    """

    where: dict[str, Any]
    bounds: Limits
    remarks: list[Remark] = field(default_factory=list)
    _last: Now | None = None
    _idle: _Standing = field(init=False)
    _inhibited: _Standing = field(init=False)
    _acknowledged: _Standing = field(init=False)
    _locked: _Standing = field(init=False)
    _away: _Standing = field(init=False)
    _span: tuple[int, int] | None = None
    """Least and greatest setpoint while it was locked."""
    _was_equal: bool = False
    _unheeded: list[Now] = field(default_factory=list)
    """Acknowledgements without control by PLC, until it is known that the fault did not go then."""
    _off: list[tuple[Now, int, str]] = field(default_factory=list)
    """OFF2 and OFF3 of the drive, the bit of STW1 that would ask for it, until it is known that none did."""

    def __post_init__(self) -> None:
        bounds = self.bounds
        self._idle = _Standing("DS521", bounds.not_running_ns)
        self._inhibited = _Standing("DS523", bounds.inhibited_ns)
        self._acknowledged = _Standing("DS524", bounds.acknowledge_ns)
        self._locked = _Standing("DS525", bounds.locked_ns)
        self._away = _Standing("DS526", bounds.deviation_ns, of_values=True)

    def look(self, now: Now) -> None:
        """Both sides after a frame, while the data of both is valid."""
        last, self._last = self._last, now
        self._by_itself(now)
        if last is not None:
            self._edges(last, now)
        self._not_running(now)
        self._fault_stays(last, now)
        self._not_taken(last, now)
        self._setpoint(now)
        self._deviation(now)

    def lost(self, frame: int, by_controller: bool) -> bool:
        """The data of one side is not valid any more; whether that is said to stop a drive that runs."""
        last = self._last
        stops = by_controller and last is not None and bool(last.zsw1 & _RUNNING)
        stops = stops and last is not None and bool(last.stw1 & _CONTROL)
        if stops:
            self._say("DS528", frame, what="pzd_invalid")
        self.finish()
        self._last = self._span = None
        self._unheeded.clear()
        return stops

    def skipped(self) -> None:
        """Frames are missing from here on: what stands, stood until here at least, and no edge is one."""
        for standing in self._all():
            stood = standing.ended()
            standing.reported = standing.reported or stood is not None
            self._over(standing, stood)
        self._last = self._span = None
        self._was_equal = False
        self._unheeded.clear()
        self._off.clear()

    def finish(self) -> None:
        """Nothing more comes: what stands, stood until here."""
        for standing in self._all():
            self._over(standing, standing.ended())

    def _all(self) -> tuple[_Standing, ...]:
        return self._idle, self._inhibited, self._acknowledged, self._locked, self._away

    # Edges

    def _edges(self, last: Now, now: Now) -> None:
        rising, falling = now.stw1 & ~last.stw1, last.zsw1 & ~now.zsw1
        if rising & _ON and not now.stw1 & _CONTROL:
            self._say("DS522", now.frame, word=now.stw1)
        if last.stw1 & _CONTROL and now.stw1 == 0 and now.zsw1 & _RUNNING:
            self._say("DS528", now.frame, what="pzd_zero")
        if not now.stw1 & _CONTROL or not last.stw1 & _CONTROL:
            return
        if falling & _REQUESTED:
            self._say("DS527", now.frame)
        if (last.zsw1 | now.zsw1) & _FAULT:
            return
        for active, asked, name in _OFF:
            if falling & active and now.heeded & asked:
                self._off.append((now, asked, name))

    def _by_itself(self, now: Now) -> None:
        """OFF2 and OFF3 without a request, not even in a frame that the capture may have lost."""
        for each in list(self._off):
            begun, asked, name = each
            late = now.time_ns - begun.time_ns > self.bounds.off_asked_ns
            if late or not now.heeded & asked:
                self._off.remove(each)
            if late:
                self._say("DS529", begun.frame, off=name)

    # What stands

    def _not_running(self, now: Now) -> None:
        on = now.stw1 & _ON and now.stw1 & _CONTROL and now.stw1 & _NO_OFF == _NO_OFF
        inhibited = bool(on and now.zsw1 & _INHIBITED)
        self._watch(self._inhibited, inhibited, now)
        complete = now.stw1 & _COMPLETE == _COMPLETE
        idle = complete and not now.zsw1 & (_RUNNING | _INHIBITED | _FAULT)
        self._watch(self._idle, idle, now)

    def _fault_stays(self, last: Now | None, now: Now) -> None:
        """From the edge of the acknowledgement on, as long as the fault is there."""
        edge = last is not None and now.stw1 & ~last.stw1 & _ACKNOWLEDGE and now.stw1 & _CONTROL
        standing = self._acknowledged
        if edge and now.zsw1 & _FAULT and now.since[1] == now.frame:
            self._over(standing, standing.ended())
            standing.begun = now
        holds = standing.begun is not None and bool(now.zsw1 & _FAULT)
        self._watch(standing, holds, now)

    def _not_taken(self, last: Now | None, now: Now) -> None:
        """Acknowledgements that are none: bit 10 is 0. Where the fault goes, something else acknowledged it."""
        if not now.zsw1 & _FAULT:
            self._unheeded.clear()
            return
        rises = last is not None and bool(now.stw1 & ~last.stw1 & _ACKNOWLEDGE)
        for each in list(self._unheeded):  # before the next one that counts it would have gone
            late = now.time_ns - each.time_ns >= self.bounds.acknowledge_ns
            if late or (rises and now.stw1 & _CONTROL):
                self._unheeded.remove(each)
                self._say("DS532", each.frame, word=each.stw1)
        if rises and not now.stw1 & _CONTROL:
            self._unheeded.append(now)

    def _setpoint(self, now: Now) -> None:
        if now.setpoint is None:
            return
        enabled = now.heeded & _SETPOINT == _SETPOINT
        locked = bool(now.zsw1 & _RUNNING and not enabled and not now.heeded & _JOG)
        if locked:
            least, most = self._span or (now.setpoint, now.setpoint)
            self._span = min(least, now.setpoint), max(most, now.setpoint)
        self._watch(self._locked, locked, now)
        if not locked:
            self._span = None

    def _deviation(self, now: Now) -> None:
        if now.setpoint is None or now.actual is None:
            return
        free = now.heeded & _SETPOINT == _SETPOINT and not now.heeded & _JOG
        driven = bool(
            free and now.zsw1 & _RUNNING and now.heeded & _ON and now.heeded & _NO_OFF == _NO_OFF
        )
        gap = abs(now.setpoint - now.actual)
        apart = gap > self.bounds.deviation_percent / 100 * cyclic.full_scale()
        self._was_equal = driven and (self._was_equal or not apart)
        away = driven and apart and self._was_equal and not now.zsw1 & _NO_DEVIATION
        self._watch(self._away, away, now)

    def _watch(self, standing: _Standing, holds: bool, now: Now) -> None:
        self._over(standing, standing.look(holds, now))

    def _over(self, standing: _Standing, stood: tuple[Now, float] | None) -> None:
        if stood is None:
            return
        begun, seconds = stood
        args: dict[str, Any] = {"seconds": seconds, "limit": standing.limit_ns / 1e9}
        if standing is self._idle:
            args["what"] = state_key(pzd.state(begun.zsw1, begun.heeded).state)
        elif standing is self._locked:
            if self._span is None or self._span[1] - self._span[0] < _MOVED * cyclic.full_scale():
                return
            args["bits"] = [bit for bit in (4, 5, 6) if not begun.heeded >> bit & 1]
        elif standing is self._away:
            args["percent"] = self.bounds.deviation_percent
        self._say(standing.rule, begun.since[1], **args)

    def _say(self, rule: str, frame: int, **args: Any) -> None:
        self.remarks.append(Remark(rule, frame, self.where | args))


def state_key(state: str) -> str:
    """The word of diagnoses.toml for a state of the drive."""
    return "pzd_" + state.replace(" ", "_")
