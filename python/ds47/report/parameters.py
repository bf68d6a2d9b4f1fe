"""Report as CSV of the last value of each parameter: a row per element of each drive object.

Columns are COLUMNS. A row tells the last value that was read or accepted, and whether the capture shows nothing
since that may have changed it. What an element went through is `ds47 trail`; the rules are in
`ds47.report.trail`. Transactions of S7 and findings are not in this format. UTF-8, comma, LF.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple

from ds47.model import CaptureResult, Value
from ds47.profidrive.drive_objects import Identity
from ds47.report import is_text
from ds47.report.csv import Cell, Table, guarded
from ds47.report.targets import Targets
from ds47.report.trail import TrailCell, trail
from ds47.spec.units import timestamp

COLUMNS = (
    "path", "device", "station", "target", "drive_object", "pnu", "subindex", "name", "unit", "value", "format",
    "scaled", "known", "certain", "frame", "time", "reads", "changes", "negative",
)  # fmt: skip
"""The header: `known` is how the value is known, "read" or "written", `certain` whether nothing may have changed
it since; `frame` and `time` are of the response and of the transaction's start."""


class ElementRow(NamedTuple):
    """One element, and where it is: `target` in words, `drive_object` where its number is proved."""

    device: str
    target: str
    drive_object: int | None
    pnu: int
    subindex: int
    element: TrailCell


def rows(result: CaptureResult) -> list[ElementRow]:
    """All elements of a capture, by device, drive object, PNU and subindex."""
    return sorted(_rows(result), key=_order)


def _rows(result: CaptureResult) -> Iterator[ElementRow]:
    targets, shown = Targets(result.evidence), None
    if result.whole is not None:
        shown = {
            (targets.identity(item, each.pnu), each.pnu)
            for item in result.transactions
            for each in item.parameters
        }
    for (device, pnu, subindex), there in trail(result).cells.items():
        for identity, cell in there.items():
            if shown is not None and (identity, pnu) not in shown:
                continue
            if identity == Identity(device):  # of the device, whichever drive object is asked
                yield ElementRow(device, "", None, pnu, subindex, cell)
                continue
            words = targets.where(cell.sample, with_slot=identity.by_submodule)
            yield ElementRow(device, words, targets.drive_object(cell.sample), pnu, subindex, cell)


def _order(row: ElementRow) -> tuple[str, int, str, int, int]:
    number = -1 if row.drive_object is None else row.drive_object
    return row.device, number, row.target, row.pnu, row.subindex


class Writer(Table):
    """Writes the elements of a capture when it is complete."""

    header: ClassVar[Sequence[str]] = COLUMNS

    def capture(self, result: CaptureResult) -> None:
        stations = {each.ip: each.station for each in result.devices}
        for row in rows(result):
            self._csv.writerow(
                [
                    guarded(result.path),
                    guarded(row.device),
                    guarded(stations.get(row.device)),
                    *_cells(row),
                ]
            )


def _cells(row: ElementRow) -> list[Cell]:
    element, last = row.element, row.element.last
    known: list[Cell] = [None] * 7
    if last is not None:
        certain = "true" if element.certain else "false"
        value, scaled = plain(last.value, last.format), plain(last.scaled, last.format)
        known = [
            value,
            last.format,
            scaled,
            last.how,
            certain,
            last.frame,
            timestamp(last.start_ns),
        ]
    return [
        guarded(row.target), row.drive_object, row.pnu, row.subindex, guarded(element.name), guarded(element.unit),
        *known, element.reads, element.changes, element.negative,
    ]  # fmt: skip


def plain(value: Value | None, format_name: str | None) -> Cell:
    """A value as a cell; a text from the drive without what a spreadsheet would run."""
    return guarded(value) if isinstance(value, str) and is_text(format_name) else value
