"""Changes that are not copied to ROM (DS721): what a save of one drive object, or of all, leaves open.

A change counts where its success was seen, and its parameters are named. What was not seen, and what a save
may have reached or not, is counted apart: a save whose own outcome was not seen proves nothing.
"""

from __future__ import annotations

from typing import Any, Final

from ds47.diagnosis.targets import Target
from ds47.spec.semantics import known

_KEPT = 16
"""Changes to one target of which each is kept: more are not open at a time."""
NAMED: Final = 16
"""Parameters that are named, those with the lowest numbers: the same ones in whatever order they are heard of."""

Moment = tuple[int, int]
"""The frame of a Write request, and its position inside that."""
Pnus = tuple[int, ...]
_NEVER: Final = (0, -1)
_ANYWHERE: Final = Target(local=False, first=0)
"""For changes that were addressed in so many ways that the drive object is not remembered."""


class _Changes:
    """The changes to one target: the newest ones, of older ones their number and their span."""

    __slots__ = ("folded", "high", "items", "low", "pnus")

    def __init__(self) -> None:
        self.items: list[tuple[Moment, Pnus]] = []
        self.folded = 0
        self.low = self.high = _NEVER
        self.pnus: Pnus = ()

    def add(self, moment: Moment, pnus: Pnus) -> None:
        """One more."""
        self.items.append((moment, pnus))
        if len(self.items) > _KEPT:
            oldest, changed = self.items.pop(0)
            self._fold(1, oldest, oldest, changed)

    def _fold(self, count: int, low: Moment, high: Moment, pnus: Pnus) -> None:
        self.low = min(self.low, low) if self.folded else low
        self.high = max(self.high, high)
        self.folded += count
        self.pnus = _lowest((*self.pnus, *pnus))

    def append(self, others: _Changes) -> None:
        """All of others, too."""
        for change in others.items:
            self.add(*change)
        if others.folded:
            self._fold(others.folded, others.low, others.high, others.pnus)

    def take(self, before: Moment) -> _Changes:
        """Takes out those that came before a moment; with them the older ones if any of those did."""
        taken = _Changes()
        taken.items = [change for change in self.items if change[0] < before]
        self.items = [change for change in self.items if change[0] >= before]
        if self.folded and self.low < before:
            taken._fold(self.folded, self.low, self.high, self.pnus)
            self.folded, self.low, self.high, self.pnus = 0, _NEVER, _NEVER, ()
        return taken

    def saved(self, before: Moment) -> _Changes:
        """Drops those that came before a moment, and takes out those of which that is not known any more."""
        old = self.take(before)
        rest = _Changes()
        if old.folded and old.high > before:
            rest._fold(old.folded, old.low, old.high, old.pnus)
        return rest

    def count(self) -> int:
        """How many there are."""
        return len(self.items) + self.folded

    def first(self) -> int:
        """The first frame of them."""
        moments = [moment for moment, _ in self.items]
        return min([*moments, *([self.low] if self.folded else [])])[0]

    def last(self) -> int:
        """The last frame of them."""
        return max([*(moment for moment, _ in self.items), self.high])[0]

    def named(self) -> Pnus:
        """The parameters that they went to."""
        return _lowest((*self.pnus, *(pnu for _, pnus in self.items for pnu in pnus)))


class Unsaved:
    """The changes of a device after its newest save.

    Jobs are heard of when they are over, which is not the order in which they were asked.
    """

    __slots__ = ("_done", "_doubts", "_open", "_saves", "family")

    def __init__(self) -> None:
        self.family: str | None = None
        """Whose parameters they are."""
        self._done: dict[Target, _Changes] = {}
        self._open: dict[Target, _Changes] = {}
        self._saves: dict[Target | None, Moment] = {}
        """The newest save of a drive object, and (None) of all of them."""
        self._doubts: dict[Target | None, Moment] = {}
        """The newest one that may have reached other drive objects, too, or may have failed."""

    def change(self, moment: Moment, target: Target, pnus: Pnus, *, seen: bool) -> None:
        """A change of parameters that can be saved; `seen`: with success, else its outcome is not known."""
        own = self._saves.get(target, _NEVER) if target.is_known() else _NEVER
        if moment < max(own, self._saves.get(None, _NEVER)):
            return
        perhaps = any(
            saved > moment and _reaches(who, target) for who, saved in self._doubts.items()
        )
        changes = self._done if seen and not perhaps else self._open
        if target not in changes and len(changes) >= known().history:
            changes, target = self._open, _ANYWHERE
        changes.setdefault(target, _Changes()).add(moment, pnus)

    def save(self, moment: Moment, target: Target | None, *, seen: bool) -> None:
        """p0971: what was changed on a drive object is saved, on others perhaps; p0977 (None): on all of them."""
        if seen and (target is None or target.is_known()):
            self._settle(moment, target)
        if target is not None or not seen:
            self._doubt(moment, target)

    def _settle(self, moment: Moment, saved: Target | None) -> None:
        """What was changed on a drive object, or on all, is saved."""
        _newest(self._saves, saved, moment)
        for target, changes in self._open.items():
            if saved in (None, target):
                changes.append(changes.saved(moment))
        for target, changes in self._done.items():
            if saved in (None, target):
                self._open.setdefault(target, _Changes()).append(changes.saved(moment))

    def _doubt(self, moment: Moment, saved: Target | None) -> None:
        """Of what came before nobody knows any more whether it is saved."""
        _newest(self._doubts, saved, moment)
        for target, changes in self._done.items():
            if _reaches(saved, target):
                self._open.setdefault(target, _Changes()).append(changes.take(moment))

    def told(self) -> dict[str, Any] | None:
        """Count, parameters, targets, first and last frame of what is not saved; None where nothing is.

        `axis` is that of all of them; None where a slot decides, or axis 0, or where there are several.
        """
        targets = [target for target, each in self._done.items() if each.count()]
        done = [self._done[target] for target in targets]
        if not done:
            return None
        alone = targets[0] if len(targets) == 1 and not targets[0].local else _ANYWHERE
        return {
            "pnus": list(_lowest(tuple(pnu for each in done for pnu in each.named()))),
            "axis": alone.first or None,
            "count": sum(each.count() for each in done),
            "unknown": sum(each.count() for each in self._open.values()),
            "targets": len(done),
            "first": min(each.first() for each in done),
            "last": max(each.last() for each in done),
        }  # fmt: skip


def _lowest(pnus: Pnus) -> Pnus:
    return tuple(sorted(set(pnus))[:NAMED])


def _reaches(saved: Target | None, target: Target) -> bool:
    """Whether a save may have been one of the drive object that a change went to; None saves all."""
    return saved is None or saved.may_be(target)


def _newest(memory: dict[Target | None, Moment], target: Target | None, moment: Moment) -> None:
    memory[target] = max(memory.get(target, _NEVER), moment)
    if len(memory) > known().history:
        memory.pop(next(iter(memory)))
