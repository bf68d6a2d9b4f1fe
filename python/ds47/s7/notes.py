"""What happens again and again, as one remark with a count and its first frames (docs/s7.md 7).

Kept until nothing more comes; which rule speaks of what is known by those who add to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ds47.findings.remark import Remark

MOST_FRAMES = 60
"""Frames that are kept of one thing."""


@dataclass(slots=True, eq=False)
class Note:
    """A remark, how often it is true, and in which frames first."""

    remark: Remark
    count: int = 0
    frames: list[int] = field(default_factory=list)

    def more(self, name: str, value: int, frame: int) -> None:
        """An argument that is the largest one of all, which the remark then stands at."""
        if self.remark.args[name] < value:
            self.remark.args[name] = value
            self.remark.frame = frame


class Notes:
    """Args: most: different things that are kept."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._notes: dict[tuple[Any, ...], Note] = {}

    def add(
        self,
        rule: str,
        key: tuple[Any, ...],
        frame: int,
        args: dict[str, Any],
        also: tuple[int, ...] = (),
    ) -> Note | None:
        """It happened, perhaps again; None where there is no room for one more thing.

        Args:
            rule: what it is,
            key: and what tells it from others of the rule.
            frame: where it shows.
            args: of the remark, the first time.
            also: further frames that it is about.
        """
        note = self._notes.get((rule, *key))
        if note is None:
            if len(self._notes) >= self._most:
                return None
            note = self._notes[rule, *key] = Note(Remark(rule, frame, dict(args)))
        note.count += 1
        for each in (frame, *also):
            if each not in note.frames and len(note.frames) < MOST_FRAMES:
                note.frames.append(each)
        return note

    def finish(self) -> Iterator[Remark]:
        """All remarks."""
        for note in self._notes.values():
            note.remark.args |= {"count": note.count, "frames": sorted(note.frames)}
            yield note.remark
