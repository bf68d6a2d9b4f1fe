"""Faults that stop a drive that runs, by its status words and what the controller asks for (docs/cyclic.md 6).

A drive that trips need not say so in one frame: some leave operation first and show the fault a cycle later, of
others the data is not valid meanwhile. That it stopped of itself is known where nobody switched it off.
"""

from __future__ import annotations

from dataclasses import dataclass, field

_NO_OFF, _ON_OR_JOG = 0x000E, 0x0301
"""Bits of STW1: no OFF2, no OFF3 and operation enabled, all of them; ON and both jogs, one of them."""
_RUNNING, _FAULT = 0x0004, 0x0008
_UNDER_CONTROL = 0x0230
"""Bits of ZSW1: neither OFF2 nor OFF3 of the drive itself, and controlled by the PLC."""


@dataclass(slots=True)
class Trips:
    """The faults that stopped one drive.

    `limit_ns`: from the first frame in which it does not run any more to its fault.
    """

    limit_ns: int
    frames: list[int] = field(default_factory=list)
    """The frames in which the faults came; their numbers may come later."""
    explained: bool = False
    """Whether another finding explains why it stopped, while that lasts."""
    _asked: bool = False
    """Whether it is asked to run."""
    _anew: bool = False
    """Whether that began only after the last word of the drive: an earlier request may still stop it."""
    _since_ns: int | None = None
    """Since when it does not run, or its data is not valid, without having been switched off."""

    def asked(self, heeded: int) -> None:
        """The control word that the drive heeds, whether or not its own data is valid."""
        asked = heeded & _NO_OFF == _NO_OFF and bool(heeded & _ON_OR_JOG)
        self._asked, self._anew = asked, self._anew or not self._asked
        if not asked:
            self._since_ns = None

    def lost(self, zsw1: int, time_ns: int) -> None:
        """The data of the drive is not valid from a frame on; this was its last word."""
        if zsw1 & _RUNNING:
            self._stops(zsw1, time_ns)

    def skipped(self) -> None:
        """Frames are missing from here on."""
        self._since_ns = None

    def said(self, before: int, zsw1: int, frame: int, time_ns: int, *, seen: bool) -> None:
        """A status word, and the one before it.

        `seen`: its data was valid all the time between.
        """
        ran = bool(before & _RUNNING)
        if ran and seen:
            self._stops(before, time_ns)
        stopped = (ran and seen) or self._is_near(ran, time_ns)
        if zsw1 & ~before & _FAULT and stopped and not self.explained:
            self.frames.append(frame)
        if zsw1 & _RUNNING:
            self._anew = False
        if zsw1 & (_RUNNING | _FAULT) or zsw1 & _UNDER_CONTROL != _UNDER_CONTROL:
            self._since_ns = None

    def _stops(self, zsw1: int, time_ns: int) -> None:
        free = (
            self._asked
            and not (self._anew or self.explained)
            and zsw1 & _UNDER_CONTROL == _UNDER_CONTROL
        )
        self._since_ns = time_ns if free else None

    def _is_near(self, ran: bool, time_ns: int) -> bool:
        """Whether it stopped of itself so short a time before; `ran`: its last valid data says that it ran."""
        since = self._since_ns
        return since is not None and (ran or time_ns - since <= self.limit_ns)
