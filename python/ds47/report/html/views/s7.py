"""S7 communication on the page: connections, what servers say of themselves, and which bytes jobs read and write.

The bytes of each memory are bars, one for each area. Areas that are read in parts, and those whose data is of two
moments, are marked as the findings say.
"""

from __future__ import annotations

from collections import Counter
from itertools import islice
from typing import NamedTuple

from ds47.model import S7, CaptureResult, Item, Transaction
from ds47.report import s7
from ds47.report.formatting import escape
from ds47.report.html.texts import Both, say

CONNECTIONS = 200
MEMORIES = 24
BARS = 40
"""Of a memory; the areas that most jobs are about."""
_MARKS = {"DS904": "split", "DS905": "mixed"}
WORDS = {"": "s7_mark_none", "split": "s7_mark_split", "mixed": "s7_mark_mixed"}
_ELEMENTS = ("T", "C")


class Bar(NamedTuple):
    """Bytes that jobs read or write: where they are in percent of the memory, and how they are marked."""

    address: str
    operation: str
    jobs: int
    left: float
    width: float
    mark: str
    words: Both


class MemoryTable(NamedTuple):
    """The bytes of a data block, or of another area, of a server that jobs are about."""

    name: str
    first: int
    last: int
    bars: list[Bar]
    left_out: int


class S7View(NamedTuple):
    """S7 communication of a capture."""

    head: list[Both]
    rows: list[list[Both]]
    left_out: int
    evidence: list[Both]
    memories: list[MemoryTable]

    @classmethod
    def of(cls, result: CaptureResult) -> S7View | None:
        """None where there is none."""
        if not result.connections:
            return None
        rows = list(islice(s7.rows(result), CONNECTIONS))
        left_out = len(result.connections) - len(rows) + result.connections_left_out
        about = list(s7.about(result, CONNECTIONS))
        return cls(s7.head(), rows, left_out, about, _memories(result))


_Area = tuple[str, int, int, str]
"""Address, first byte, bytes, operation."""


def marked(result: CaptureResult) -> dict[int, str]:
    """The jobs, by id, that a finding calls parts of an area, or a mixed read."""
    frames = {
        mark: {frame for each in result.findings if each.rule == rule for frame in each.frames}
        for rule, mark in _MARKS.items()
    }
    found: dict[int, str] = {}
    for each in result.transactions:
        if each.channel == S7 and any(frames.values()):
            marks = ("mixed", "split") if each.operation == "get" else ("split",)
            for mark in marks:
                if not frames[mark].isdisjoint(each.frames.all()):
                    found.setdefault(each.id, mark)
    return found


def _memories(result: CaptureResult) -> list[MemoryTable]:
    jobs = marked(result)
    found: dict[tuple[str, str], Counter[_Area]] = {}
    marks: dict[tuple[str, str, _Area], str] = {}
    for each in result.transactions:
        if each.channel != S7:
            continue
        mark = jobs.get(each.id, "")
        for item in each.items:
            area = _area(item, each)
            if area is None or item.start is None:
                continue
            where = each.device, item.area if item.db is None else f"{item.area}{item.db}"
            found.setdefault((where[0], str(where[1])), Counter())[area] += 1
            if mark:
                marks[where[0], str(where[1]), area] = mark
    return [
        _memory(device, name, areas, marks)
        for (device, name), areas in islice(found.items(), MEMORIES)
    ]


def _area(item: Item, job: Transaction) -> _Area | None:
    """The bytes of an item; timers and counters have none, elements of a drive share none."""
    if item.start is None or not item.length or item.area is None or item.area in _ELEMENTS:
        return None
    if item.parameter is not None:
        return None
    return item.address or "", item.start, item.length, job.operation


def _memory(
    device: str, name: str, areas: Counter[_Area], marks: dict[tuple[str, str, _Area], str]
) -> MemoryTable:
    chosen = sorted(areas.most_common(BARS), key=lambda each: (each[0][1], each[0][2], each[0][3]))
    first = min(start for (_, start, _, _), _ in chosen)
    end = max(start + length for (_, start, length, _), _ in chosen)
    bars = [
        Bar(
            escape(area[0]), area[3], jobs, 100 * (area[1] - first) / (end - first),
            100 * area[2] / (end - first), marks.get((device, name, area), ""),
            say(WORDS[marks.get((device, name, area), "")]),
        )
        for area, jobs in chosen
    ]  # fmt: skip
    return MemoryTable(
        f"{escape(device)} {escape(name)}", first, end - 1, bars, len(areas) - len(chosen)
    )
