"""The digests of all captures of a run, with one verdict over them: for formats that write at the end."""

from __future__ import annotations

from ds47.model import CaptureResult
from ds47.report import ReportOptions
from ds47.report.bilingual import Both
from ds47.report.digest import Digest
from ds47.report.short import CAUSES, SUMMED
from ds47.report.verdict import LEVELS, VerdictCounts, verdict


class Digests:
    """Takes captures as a writer does."""

    def __init__(self, options: ReportOptions) -> None:
        self._options = options
        self._most = SUMMED if options.detail == "summary" else CAUSES
        self._counts = VerdictCounts()
        self.captures: list[Digest] = []
        self.problems: list[tuple[str, str]] = []
        """Paths of captures that could not be read at all, and why."""

    def capture(self, result: CaptureResult) -> None:
        """Takes a capture."""
        digest = Digest.of(result, self._options, self._most)
        self._counts.add(digest.counts)
        self.captures.append(digest)

    def unreadable(self, path: str, problem: str) -> None:
        """Takes one that could not be read."""
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
