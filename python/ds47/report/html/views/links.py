"""Which job a frame belongs to, so that every frame that is named links to where the page shows it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ds47.model import CaptureResult


class FrameLink(NamedTuple):
    """A frame, and the job that the page shows it in; None where no job has it."""

    frame: int
    job: int | None


class Links:
    """The jobs of a capture by their frames; of two jobs in one frame the first."""

    def __init__(self, result: CaptureResult) -> None:
        self._jobs: dict[int, int] = {}
        for each in result.transactions:
            for frame in each.frames.all():
                self._jobs.setdefault(frame, each.id)

    def of(self, frames: Iterable[int]) -> list[FrameLink]:
        """Links to frames, in their order."""
        return [FrameLink(frame, self._jobs.get(frame)) for frame in frames]
