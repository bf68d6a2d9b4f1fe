"""Report as CSV of what happened to drives: a row per event of a control or status word.

Columns are COLUMNS: those of an event as JSON has them, the drive in front, and what a person reads behind.
Transactions and findings are not in this format. UTF-8, comma, LF.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ds47.model import CaptureResult, Event
from ds47.report import contract, timelines
from ds47.report.csv import Cell, Table, guarded
from ds47.spec.cyclic import event_text

EVENT_COLUMNS = tuple(contract.columns(contract.EVENT))
COLUMNS = (
    "path", "device", "slot", "subslot", *(each.name for each in EVENT_COLUMNS), "overlays", "words", "after_ms",
)  # fmt: skip
"""The header: `words` is the event in the language of the report, `after_ms` the time since its command."""


class Writer(Table):
    """Writes the events of a capture when it is complete."""

    header: ClassVar[Sequence[str]] = COLUMNS

    def capture(self, result: CaptureResult) -> None:
        for timeline in result.timelines:
            relation = result.relations[timeline.relation - 1]
            left: list[Cell] = [
                guarded(result.path), guarded(relation.device), relation.slot, relation.subslot,
            ]  # fmt: skip
            for row in timelines.rows(timeline):
                for event in row.events:
                    self._csv.writerow(left + self._cells(event, row))

    def _cells(self, event: Event, row: timelines.EventRow) -> list[Cell]:
        plain = contract.EVENT.plain(event, self.options.lang)
        own: list[Cell] = [plain[each.name] for each in EVENT_COLUMNS]
        caused = row.after_ns is not None and timelines.is_caused(event)
        after = row.after_ns / 1e6 if caused and row.after_ns is not None else None
        words = event_text(event.name, self.options.lang)
        return [*own, " ".join(event.overlays), words, after]
