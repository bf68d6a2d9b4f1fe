"""Whether the tables of fault buffers say what was read, and only what belongs to one entry.

Decided anew from the transactions of the report: a cell is the value that the response in its frame has at that
subindex, and nobody has read other numbers since.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.audit.meant import rows_of
from tests.audit.reading import Complaint, Reading

NUMBERS = ("number", "code")
PLACES = 8


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about the buffers of a capture."""
    for number, each in enumerate(reading.plain.get("buffers", ()), 1):
        for text in problems(each, reading.plain["transactions"]):
            yield Complaint("buffer", f"{number}", text)


def problems(buffer: dict[str, Any], transactions: list[dict[str, Any]]) -> Iterator[str]:
    """What is wrong with one buffer."""
    reads = [
        each
        for each in transactions
        if each["operation"] == "read" and each["device"] == buffer["device"]
    ]
    for entry in buffer["entries"]:
        cells = {name: cell for name, cell in entry.items() if isinstance(cell, dict)}
        place = entry["subindex"]
        for name, cell in cells.items():
            seen = list(
                _values(reads, f"{buffer['kind']}.{name}", place, cell["frame"], cell["frame"])
            )
            if cell["value"] not in seen:
                yield f"[{place}] {name} {cell['value']!r} is not in frame {cell['frame']}: {seen}"
        if all(cells[name]["value"] == 0 for name in NUMBERS if name in cells):
            yield f"[{place}] has no number"
        last = max(cell["frame"] for cell in cells.values())
        first = min(cell["frame"] for cell in cells.values())
        for name in set(NUMBERS) & set(cells):
            later = set(_values(reads, f"{buffer['kind']}.{name}", place, first, last))
            if later - {cells[name]["value"]} and len({each["axis"] for each in reads}) == 1:
                yield f"[{place}] {name} was {later} between frames {first} and {last}"
        if entry["situation"] not in (None, place // PLACES):
            yield f"[{place}] is of situation {entry['situation']}"


def _values(
    reads: list[dict[str, Any]], column: str, place: int, first: int, last: int
) -> Iterator[Any]:
    """What responses of these frames have of a column at a subindex."""
    for item in reads:
        frame = item["frames"]["read_response"]
        for each in item["parameters"] if frame is not None and first <= frame <= last else ():
            at = place - (each["subindex"] or 0)
            named = any(row.get("entry") == column for row in rows_of(each["pnu"]))
            if named and each["attribute"] == "value" and 0 <= at < len(each["values"]):
                yield each["values"][at]
