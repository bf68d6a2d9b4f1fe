"""A machine: a controller with a simulated drive in its cyclic frames, and a program that uses both.

Written for scenes: `control`, `setpoint`, `run`, `read`, `change`. What a drive does is in `drive`, how frames
look in `cyclic` (PROFINET) and `ppo` (PROFIBUS).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from ds47.lab.cyclic import INPUT, OUTPUT, LabModule
from ds47.lab.drive import FULL, LabDrive

OFF, ON, ACKNOWLEDGE = 0x047E, 0x047F, 0x04FE
IDLE = bytes(8)


class Carrier(Protocol):
    """Cyclic frames of any kind: modules that have data in both directions."""

    modules: Sequence[LabModule]
    reduction: float
    """Milliseconds of a cycle."""

    def connect(self) -> None:
        """What comes before the first cycle."""

    def say(self, module: LabModule, kind: int, data: bytes) -> None:
        """From the next cycle on a module has this data in a direction."""

    def cycle(self) -> None:
        """A cycle goes by."""


Line = TypeVar("Line", bound=Carrier)


@dataclass(slots=True)
class Machine(Generic[Line]):
    """A controller and a drive, by modules of PKW and PZD, or of PZD alone.

    `between`: called before each cycle, for what happens at the drive.
    """

    line: Line
    drive: LabDrive = field(default_factory=LabDrive)
    stw1: int = 0
    raw: int = 0
    words: bytes = IDLE
    between: Callable[[], None] = lambda: None

    @property
    def pkw(self) -> LabModule | None:
        """The module of PKW, which comes first where it is."""
        return self.line.modules[0] if len(self.line.modules) > 1 else None

    @property
    def pzd(self) -> LabModule:
        """The module of PZD."""
        return self.line.modules[-1]

    def connect(self) -> Machine[Line]:
        """The AR is set up; from now on there are cyclic frames."""
        self.line.connect()
        zsw1, actual = self.drive.step(0, 0, 0)
        self.line.say(self.pzd, INPUT, struct.pack(">Hh", zsw1, actual))
        return self

    def control(self, stw1: int) -> Machine[Line]:
        """The program sends this control word from the next cycle on."""
        self.stw1 = stw1
        return self

    def setpoint(self, percent: float) -> Machine[Line]:
        """It sends this setpoint, in percent."""
        self.raw = round(percent / 100 * FULL)
        return self

    def let(self, **drive: object) -> Machine[Line]:
        """Something happens at the drive: attributes of it change."""
        for name, value in drive.items():
            setattr(self.drive, name, value)
        return self

    def run(self, seconds: float) -> Machine[Line]:
        """Time goes by, in whole cycles."""
        for _ in range(max(1, round(seconds * 1000 / self.line.reduction))):
            self.cycle()
        return self

    def until(self, done: Callable[[LabDrive], bool], most: float = 200) -> Machine[Line]:
        """Time goes by until the drive is as wanted, so many seconds at the most."""
        for _ in range(round(most * 1000 / self.line.reduction)):
            self.cycle()
            if done(self.drive):
                return self
        raise AssertionError("the drive never was as the scene wants it")

    def start(self, percent: float = 50) -> Machine[Line]:
        """OFF1, ON, and the drive runs at this speed."""
        self.control(OFF).run(0.1).setpoint(percent).control(ON)
        return self.until(lambda drive: abs(drive.actual - percent) < 0.1).run(0.2)

    def cycle(self) -> None:
        """One cycle: the controller's frame, and the drive's of what it made of the one before."""
        self.between()
        out = struct.pack(">Hh", self.stw1, self.raw)
        self.line.say(self.pzd, OUTPUT, out)
        if self.pkw is not None:
            self.line.say(self.pkw, OUTPUT, self.words)
        self.line.cycle()
        zsw1, actual = self.drive.step(self.stw1, self.raw, self.line.reduction / 1000)
        back = struct.pack(">Hh", zsw1, actual)
        if self.pzd.length > len(back):  # the last word of telegrams 352 and 354 is FAULT_CODE
            back = back.ljust(self.pzd.length - 2, b"\0") + self.drive.fault.to_bytes(2)
        self.line.say(self.pzd, INPUT, back)
        if self.pkw is not None:
            self.line.say(self.pkw, INPUT, self.drive.answer(self.words))

    # PKW

    def ask(self, words: bytes, cycles: int = 6) -> Machine[Line]:
        """The program writes the four words, and holds them so many cycles."""
        self.words = words
        for _ in range(cycles):
            self.cycle()
        return self

    def read(self, pnu: int, subindex: int = 0, ak: int = 1, cycles: int = 6) -> Machine[Line]:
        """A parameter is read, and the request taken back."""
        self.ask(_head(ak, pnu, subindex) + bytes(4), cycles)
        return self.ask(IDLE, 5)

    def change(
        self, pnu: int, value: bytes, subindex: int = 0, ak: int = 3, cycles: int = 6
    ) -> Machine[Line]:
        """A parameter is changed, and the request taken back."""
        self.ask(_head(ak, pnu, subindex) + value.rjust(4, b"\0"), cycles)
        return self.ask(IDLE, 5)


def _head(ak: int, pnu: int, subindex: int) -> bytes:
    """PKE and IND, with the page of the numbers from 2000 on."""
    page = 0x80 if pnu >= 2000 else 0
    return struct.pack(">HBB", ak << 12 | pnu % 2000, subindex, page)
