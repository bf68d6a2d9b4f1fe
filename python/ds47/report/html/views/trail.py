"""The trail of each parameter for the page: who changed it, when, by which way, from which value to which.

What happened is decided in `ds47.report.trail`, as for `ds47 trail`. Who and when stand in the rows of the
transactions, so here are only their numbers; templates/report/trail.js reads rows by the names of ROW.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable
from functools import lru_cache
from typing import Any

from ds47.model import CaptureResult
from ds47.profidrive.drive_objects import Identity
from ds47.profidrive.naming import spelling
from ds47.report.changes import way
from ds47.report.formatting import both_sides
from ds47.report.html import messages
from ds47.report.html.texts import Both
from ds47.report.targets import Targets
from ds47.report.trail import ACCEPTED, NEGATIVE, REFUSED, SENT, KnownValue, WrittenChange, changes
from ds47.report.values import about, of_kind
from ds47.spec import error_hex

MOST = 20_000
"""Changes that a page lists."""
ROW = (
    "id",
    "object",
    "way",
    "pnu",
    "subindex",
    "name",
    "old",
    "old_from",
    "new",
    "outcome",
    "reason",
)
"""`old_from` is 0, or the frame in which the old value was read; negative where it was written in that frame."""
OUTCOMES = (ACCEPTED, NEGATIVE, REFUSED, SENT)


class TrailView:
    """The changes of a capture; those of transactions that the page does not list are counted only.

    Attributes:
        data: what the script takes.
        left_out: changes for which there was no room.
        unproved: changes of drive objects whose numbers the capture does not prove.
        written: numbers of the drive objects that were written, with their devices.
    """

    def __init__(self, result: CaptureResult, targets: Targets, listed: Collection[int]) -> None:
        self._targets = targets
        self._labels = targets.labels(result.evidence)
        self._tables: dict[str, dict[Hashable, int]] = {
            name: {} for name in ("objects", "ways", "names", "reasons")
        }
        self.unproved = 0
        self.written: set[tuple[str, int]] = set()
        here = {each.id for each in result.transactions}
        found = [each for each in changes(result) if each.transaction.id in here]
        shown = [each for each in found if each.transaction.id in listed][:MOST]
        rows = [self._row(each) for each in shown]
        self.left_out = len(found) - len(shown)
        self.data: dict[str, Any] = {
            "row": ROW, "outcomes": OUTCOMES, "rows": rows,
            **{name: list(positions) for name, positions in self._tables.items()},
        }  # fmt: skip

    def _position(self, table: str, item: Hashable) -> int:
        positions = self._tables[table]
        return positions.setdefault(item, len(positions))

    def _row(self, change: WrittenChange) -> list[Any]:
        item, parameter = change.transaction, change.parameter
        name, reason = _name(about(parameter), parameter.scaled is None), _reason(change)
        known = change.old
        old, new = both_sides(
            known and known.value, known and known.format, change.new, parameter.format
        )
        return [
            item.id, self._position("objects", self._object(change)), self._position("ways", way(change)),
            change.pnu, change.subindex, self._position("names", name),
            None if change.old is None else old,
            _from(change.old),
            None if change.new is None else new,
            OUTCOMES.index(change.outcome),
            None if reason is None else self._position("reasons", reason),
        ]  # fmt: skip

    def _object(self, change: WrittenChange) -> tuple[str, str, int | None]:
        """Device, name and number of the drive object; without name and number of what the device has once."""
        item = change.transaction
        identity = self._targets.identity(item, change.pnu)
        if identity == Identity(item.device):
            return item.device, "", None
        number = self._targets.drive_object(item)
        if number is None:
            self.unproved += 1
        else:
            self.written.add((item.device, number))
        return item.device, self._labels.get(identity, ""), number


@lru_cache(maxsize=4096)
def _name(known: tuple[Any, ...], plain: bool) -> tuple[str, str, str | None, str]:
    """The name of a parameter in both languages, its unit and its number; no unit where values are scaled."""
    item = of_kind(known)
    number = spelling(item.pnu or 0, item.family)
    return (*messages.name(item), item.unit if plain else None, number)


def _from(old: KnownValue | None) -> int:
    if old is None:
        return 0
    return -old.frame if old.how == "written" else old.frame


def _reason(change: WrittenChange) -> tuple[str, str] | None:
    """Why it was not accepted, in both languages; None where nothing says that."""
    error, status = change.parameter.error, change.transaction.write_status
    if change.outcome == NEGATIVE and error is not None:
        text = messages.error(error)
        number = "" if error.code is None else error_hex(error.code)
        shown = text if number in text.en else text.joined(Both.same(f"({number})"), " ")
        return shown.en, shown.zh
    if change.outcome == REFUSED and status is not None:
        text = messages.status(status)
        return f"{text.en} ({status:08X})", f"{text.zh} ({status:08X})"
    return None
