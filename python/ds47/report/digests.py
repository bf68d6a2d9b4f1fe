"""The digests of all captures of a run, with one verdict over them: for formats that write at the end."""

from __future__ import annotations

from typing import TextIO

from ds47.model import CaptureResult
from ds47.report import ReportOptions, Writer
from ds47.report.bilingual import Both
from ds47.report.digest import Digest
from ds47.report.short import CAUSES, SUMMED
from ds47.report.verdict import LEVELS, VerdictCounts, verdict


class Digests(Writer):
    """A writer that keeps a digest of each capture, and writes at the end: `close` is that of a format."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._most = SUMMED if self.options.detail == "summary" else CAUSES
        self._counts = VerdictCounts()
        self.captures: list[Digest] = []
        self.problems: list[tuple[str, str]] = []
        """Paths of captures that could not be read at all, and why."""

    def capture(self, result: CaptureResult) -> None:
        digest = Digest.of(result, self.options, self._most)
        self._counts.add(digest.counts)
        self.captures.append(digest)

    def unreadable(self, path: str, problem: str) -> None:
        self._counts.add(VerdictCounts(captures=1, unreadable=1))
        self.problems.append((path, problem))

    @property
    def paths(self) -> list[str]:
        """Those of all captures."""
        return [*(path for path, _ in self.problems), *(each.path for each in self.captures)]

    @property
    def level(self) -> str:
        """That of all of them."""
        return "bad" if self.problems else self._counts.level

    @property
    def verdict(self) -> Both:
        """The verdict over all."""
        return verdict(self._counts)

    @property
    def worst(self) -> list[Digest]:
        """The captures that are not OK, the worst first."""
        found = [each for each in self.captures if each.level not in ("good", "none")]
        return sorted(found, key=lambda each: (-LEVELS.index(each.level), -each.counts.failed))
