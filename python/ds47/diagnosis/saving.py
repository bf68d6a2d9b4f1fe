"""Changes that are not copied to ROM (DS721): what a save of one drive object, or of all, leaves open.

A change counts where its success was seen. What was not seen, and what a save may have reached or not, is
counted apart.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ds47.diagnosis.targets import Target
from ds47.spec.semantics import known

_Change = tuple[int, Target]
"""The frame of a Write request, and whom it addresses."""


class _Changes:
    """Frames and targets; of too many the first and the newest are enough to name."""

    __slots__ = ("items", "more")

    def __init__(self) -> None:
        self.items: list[_Change] = []
        self.more = 0

    def add(self, change: _Change) -> None:
        """One more."""
        self.items.append(change)
        if len(self.items) > known().history:
            del self.items[1]
            self.more += 1

    def keep(self, wanted: Callable[[_Change], bool]) -> None:
        """Those that are wanted."""
        self.items = list(filter(wanted, self.items))

    def count(self) -> int:
        """How many there were."""
        return len(self.items) + self.more


class Unsaved:
    """The changes of a device after its newest save.

    Jobs are heard of when they are over, which is not the order in which they were asked.
    """

    __slots__ = ("_done", "_open", "_saves", "_whole")

    def __init__(self) -> None:
        self._done, self._open = _Changes(), _Changes()
        self._saves: dict[Target, int] = {}
        """The frame of the newest save of a drive object,"""
        self._whole = 0
        """and that of all of them."""

    def change(self, frame: int, target: Target, *, seen: bool = True) -> None:
        """A change of parameters that can be saved; `seen`: with success, else its outcome is not known."""
        own = self._saves.get(target, 0) if target.is_known() else 0
        if frame < max(self._whole, own):
            return
        perhaps = any(saved > frame and who.may_be(target) for who, saved in self._saves.items())
        (self._done if seen and not perhaps else self._open).add((frame, target))

    def save_all(self, frame: int) -> None:
        """p0977: whatever was changed before is saved."""
        self._whole = max(self._whole, frame)
        for changes in (self._done, self._open):
            changes.keep(lambda change: change[0] > self._whole)
            changes.more = 0

    def save(self, frame: int, target: Target) -> None:
        """p0971: what was changed on that drive object is saved; of others that may not be known."""
        self._saves[target] = max(self._saves.get(target, 0), frame)
        if len(self._saves) > known().history:
            self._saves.pop(next(iter(self._saves)))
        if target.is_known():
            for changes in (self._done, self._open):
                changes.keep(lambda change: change[0] > frame or change[1] != target)
        done = self._done
        perhaps = [each for each in done.items if each[0] < frame and target.may_be(each[1])]
        done.keep(lambda change: change not in perhaps)
        for each in perhaps:
            self._open.add(each)
        self._open.more, done.more = (
            self._open.more + done.more,
            0,
        )  # of whom those were is forgotten

    def told(self) -> dict[str, Any] | None:
        """Count, targets, and the first and the last frame of what is not saved; None where nothing is."""
        items = sorted(self._done.items)
        if not items:
            return None
        targets = {target for _, target in items}
        return {
            "count": self._done.count(), "unknown": self._open.count(), "targets": len(targets),
            "first": items[0][0], "last": items[-1][0],
        }  # fmt: skip
