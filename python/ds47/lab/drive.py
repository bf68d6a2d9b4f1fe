"""A simulated drive: the state machine of PROFIdrive, a ramp, and a server of PKW (docs/cyclic.md 2 to 4).

It answers control word and setpoint with status word and actual value, cycle by cycle, and knows nothing of
frames: those are `cyclic`. What is played with it is in `cyclic_scenes`. Its bits are typed here, not read from
the tables of the analysis.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

FULL = 0x4000
"""Raw value of 100 %."""
_ALWAYS = 0x8800 | 0x2000 | 0x1000 | 0x0100
"""Bits of ZSW1 that drives print as 1 where nothing is wrong: 8, 11, 12, 13, 15."""


@dataclass(slots=True)
class PkwParameter:
    """A parameter of the PKW server: its value as PWE1 and PWE2, and what it bears."""

    value: bytes
    double: bool = False
    array: bool = False
    writable: bool = True
    locked: bool = False
    """Whether it cannot be changed in operation."""
    most: int | None = None
    refused: int | None = None
    """Error number of every change."""


@dataclass(slots=True)
class LabDrive:
    """One drive object.

    `up_s` and `down_s` are the seconds that its ramp takes for 100 %, `quick_s` those of OFF3, `excite_s` those
    from ON to operation. `enabled`: whether its own enable signals are there. `off2`, `off3`, `local`: asked
    for at the drive itself. `blocked`: its motor does not move.
    """

    up_s: float = 1.0
    down_s: float = 1.0
    quick_s: float = 0.2
    excite_s: float = 0
    enabled: bool = True
    off2: bool = False
    off3: bool = False
    local: bool = False
    alarm: bool = False
    blocked: bool = False
    fault: int = 0
    """Number of a fault, 0 without."""
    cleared: bool = True
    """Whether an acknowledgement helps."""
    state: str = "S1"
    actual: float = 0.0
    """Speed in percent."""
    cells: dict[tuple[int, int], PkwParameter] = field(default_factory=dict)
    pause: int = 3
    """Cycles from a request of PKW to its response."""
    echo_zero: bool = False
    locked_error: int = 17
    _heeded: int = 0
    _waited: int = 0
    _request: bytes = bytes(8)
    _response: bytes = bytes(8)
    _off: str = ""
    _excited_s: float = 0

    # Control and status word

    def step(self, stw1: int, setpoint: int, seconds: float) -> tuple[int, int]:
        """One cycle with this control word and raw setpoint: status word and raw actual value."""
        before = self._heeded
        if stw1 & 0x0400 and not self.local:
            self._heeded = stw1
        if self._heeded & ~before & 0x0080 and self.cleared:  # acknowledged
            self.fault = 0
        self._excited_s = self._excited_s + seconds if self.state == "S3" else 0
        self._move_on(before)
        self._turn(setpoint, seconds)
        return self._zsw1(), round(self.actual / 100 * FULL)

    def _move_on(self, before: int) -> None:
        now = self._heeded
        off2, off3 = not now & 2 or self.off2, not now & 4 or self.off3
        on, moving = now & ~before & 1, self.state in ("S3", "S4", "S5")
        excited = self._excited_s >= self.excite_s
        if (off2 and self.state != "S1") or (self.fault and moving):
            self._off = "OFF2"
        elif off3 and moving:
            self._off = "OFF3"
        if self.state == "S1" and not (now & 1 or off2 or off3 or self.fault):
            self.state = "S2"
        elif self.state == "S2" and (off2 or off3 or self.fault):
            self.state = "S1"
        elif self.state == "S2" and on and self.enabled:
            self.state = "S3"
        elif self.state == "S3" and not now & 1:
            self.state = "S2"
        elif now & 8 and (excited if self.state == "S3" else on and self.state == "S5"):
            self.state = "S4"
        elif self.state == "S4" and not now & 1:
            self.state = "S5"
        self._stop()

    def _stop(self) -> None:
        if self._off == "OFF2" or (self._off == "OFF3" and self.actual == 0):
            self.state, self._off = "S1", ""
        elif self.state == "S5" and self.actual == 0:
            self.state = "S2"

    def _turn(self, setpoint: int, seconds: float) -> None:
        now = self._heeded
        wanted, rate = 0.0, 100 / self.down_s
        if self._off == "OFF3":
            rate = 100 / self.quick_s
        elif self.state == "S4":
            wanted = setpoint / FULL * 100 * (-1 if now & 0x0800 else 1)
            if not now & 0x10 or not now & 0x40:
                wanted = 0.0
            elif not now & 0x20:
                wanted = self.actual
            rate = 100 / (self.up_s if abs(wanted) > abs(self.actual) else self.down_s)
        elif self.state != "S5":
            self.actual = 0.0  # it coasts, and the lab has no patience
            return
        if self.blocked:
            self.actual = 0.0
            return
        gap, most = wanted - self.actual, rate * seconds
        self.actual = wanted if abs(gap) <= most else self.actual + (most if gap > 0 else -most)

    def _zsw1(self) -> int:
        bits = {"S1": 0x40, "S2": 0x01, "S3": 0x03, "S4": 0x07, "S5": 0x07}[self.state]
        word = bits | _ALWAYS | (0x4000 if self.actual >= 0 else 0)
        word |= 0 if self._off == "OFF2" or self.off2 or not self._heeded & 2 else 0x10
        word |= 0 if self._off == "OFF3" or self.off3 or not self._heeded & 4 else 0x20
        word |= 0 if self.local else 0x0200
        word |= 0x08 if self.fault else 0
        word |= 0x80 if self.alarm else 0
        if self.blocked and self.state == "S4":
            word &= ~0x0100
        return word

    # PKW

    def answer(self, request: bytes) -> bytes:
        """One cycle with these four words of a request: the four words of the response."""
        if request != self._request:
            self._request, self._waited = request, 0
        else:
            self._waited += 1
        if self._waited >= self.pause:
            self._response = self._respond(request)
        return self._response

    def _respond(self, request: bytes) -> bytes:
        pke, ind = struct.unpack_from(">HH", request)
        ak = pke >> 12
        if not ak:
            return bytes(8)
        page = ind & 0xFF
        pnu = (pke & 0x7FF) + (2000 if page & 0x80 else 0)
        cell = self.cells.get((pnu, ind >> 8))
        if cell is None:
            return self._refuse(request, 0)
        if ak in (1, 6):
            return self._tell(request, cell)
        double = ak in (3, 8, 11, 13)
        if cell.refused is not None:
            return self._refuse(request, cell.refused)
        if not cell.writable:
            return self._refuse(request, 1)
        if double != cell.double:
            return self._refuse(request, 5)
        if cell.locked and self.state in ("S4", "S5"):
            return self._refuse(request, self.locked_error)
        if cell.most is not None and int.from_bytes(request[4:]) > cell.most:
            return self._refuse(request, 2)
        cell.value = request[4:]
        answer = self._tell(request, cell)
        return answer[:4] + bytes(4) if self.echo_zero else answer

    def _tell(self, request: bytes, cell: PkwParameter) -> bytes:
        ak = (2 if cell.double else 1) + (3 if cell.array else 0)
        return bytes((ak << 4 | request[0] & 0x07,)) + request[1:4] + cell.value.rjust(4, b"\0")

    def _refuse(self, request: bytes, code: int) -> bytes:
        return bytes((0x70 | request[0] & 0x07,)) + request[1:4] + code.to_bytes(4)
