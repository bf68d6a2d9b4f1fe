"""Buffers of faults and alarms of drive objects: number, code, time and value of each entry side by side.

They are parameters of their own (945, 947 to 949; of SINAMICS 2109, 2122 to 2125), which programs read one by one.
An entry has the same subindex in all of them, and eight make a situation (docs/protocol.md D.2). What was read of
time and value counts as long as no later read shows other numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from ds47.model import CaptureResult, Parameter, Transaction, Value
from ds47.profidrive.drive_objects import Identity
from ds47.report.bilingual import Both, joined, say
from ds47.report.escaping import escape
from ds47.report.targets import ANSWERED, Targets
from ds47.report.values import LEADING, PLACES

FAULTS: Final = "faults"
COLUMNS: Final = ("number", "code", "time", "gone", "value")
ENTRIES_LISTED: Final = 64


class EntryValue(NamedTuple):
    """What was read of an entry, and the frame of the response; `text` is what a list of the user says of it."""

    value: Value
    frame: int
    text: str | None


class BufferEntry(NamedTuple):
    """One entry: its subindex, and the situation that it belongs to, 0 the present one; None where not known."""

    subindex: int
    situation: int | None
    cells: Mapping[str, EntryValue]


class Buffer(NamedTuple):
    """What was read last of the buffer of one drive object; `kind` is "faults" or "alarms"."""

    kind: str
    sample: Transaction
    target: str
    frames: list[int]
    entries: list[BufferEntry]


@dataclass(slots=True)
class _Seen:
    """What was read of one buffer up to now."""

    sample: Transaction
    situations: bool = False
    columns: dict[str, dict[int, EntryValue]] = field(default_factory=dict)


def buffers(result: CaptureResult, targets: Targets | None = None) -> list[Buffer]:
    """The buffers that a capture shows with more than numbers, in the order of their first reads."""
    targets = targets or Targets(result.evidence)
    seen: dict[tuple[Identity, str], _Seen] = {}
    reads = [
        each
        for each in result.transactions
        if each.operation == "read"
        and each.state in ANSWERED
        and any(map(_is_part, each.parameters))
    ]
    for item in sorted(reads, key=lambda each: each.frames.read_response or 0):
        _take(item, seen, targets)
    found = (_buffer(kind, each, targets) for (_, kind), each in seen.items())
    return [each for each in found if each is not None]


def _take(item: Transaction, seen: dict[tuple[Identity, str], _Seen], targets: Targets) -> None:
    """What one response shows: first what entries there are, then the rest of them."""
    parts = [each for each in item.parameters if _is_part(each)]
    parts.sort(key=lambda each: _column(each) not in LEADING)  # stable
    for each in parts:
        assert each.listed is not None
        assert each.listed.entry is not None
        kind, column = each.listed.entry
        there = seen.setdefault((targets.identity(item, each.pnu), kind), _Seen(item))
        now = _cells(each, item.frames.read_response or 0)
        if column in LEADING:
            there.situations = each.listed.buffer is not None
            known = there.columns.get(column, {})
            if any(at in known and known[at].value != now[at].value for at in now):
                there.columns.clear()  # the entries are others now
        elif not any(name in there.columns for name in LEADING):
            continue  # its entries are unknown
        there.columns.setdefault(column, {}).update(now)


def _is_part(item: Parameter) -> bool:
    row = item.listed
    if row is None or row.entry is None or not item.values:
        return False
    return item.attribute == "value" and item.subindex is not None and item.error is None


def _column(item: Parameter) -> str:
    return item.listed.entry[1] if item.listed and item.listed.entry else ""


def _cells(item: Parameter, frame: int) -> dict[int, EntryValue]:
    texts = item.value_texts or {}
    return {
        position: EntryValue(value, frame, texts.get(value) if isinstance(value, int) else None)
        for position, value in enumerate(item.values, item.subindex or 0)
    }


def _buffer(kind: str, seen: _Seen, targets: Targets) -> Buffer | None:
    """The entries that there are; None where nothing but their numbers is known."""
    leading = [seen.columns[name] for name in LEADING if name in seen.columns]
    positions = sorted({at for cells in leading for at, cell in cells.items() if cell.value})
    entries = [
        BufferEntry(
            at,
            at // PLACES if seen.situations else None,
            {name: seen.columns[name][at] for name in COLUMNS if at in seen.columns.get(name, {})},
        )
        for at in positions[:ENTRIES_LISTED]
    ]
    if all(set(each.cells) <= set(LEADING) for each in entries):
        return None
    frames = sorted({cell.frame for each in entries for cell in each.cells.values()})
    return Buffer(kind, seen.sample, targets.where(seen.sample), frames, entries)


# Words


def head(item: Buffer) -> Both:
    """`Fault buffer of 192.168.0.33 DO 2, read in frames 12, 16`."""
    where = " ".join(filter(None, (escape(item.sample.device), item.target)))
    frames = ", ".join(map(str, item.frames))
    return say(f"buffer_{item.kind}", where=where, frames=frames)


def rows(item: Buffer) -> list[list[Both]]:
    """The cells of a table: which entry, what it is, when it was, and its value; no column without a word."""
    table = list(_rows(item))
    kept = [at for at in range(len(table[0])) if any(row[at].en for row in table)]
    return [[row[at] for at in kept] for row in table]


def _rows(item: Buffer) -> Iterator[list[Both]]:
    first: dict[int | None, int] = {}
    for each in item.entries:
        time = each.cells.get("time")
        since = None
        if time is not None and isinstance(time.value, int):
            begin = first.setdefault(each.situation, time.value)
            since = (
                time.value - begin if each.situation is not None and time.value != begin else None
            )
        yield [
            _situation(item.kind, each), Both.same(f"[{each.subindex}]"), _name(each), _time(time, since),
            _gone(each.cells.get("gone")), _value(each.cells.get("value")),
        ]  # fmt: skip


_NOTHING: Final = Both.same("")


def _situation(kind: str, item: BufferEntry) -> Both:
    if item.situation is None:
        return _NOTHING
    if item.situation == 0:
        return say("value_active")
    if kind == FAULTS:
        return say("value_acknowledged", n=str(item.situation))
    return say("value_gone")


def _name(item: BufferEntry) -> Both:
    """The number with its text, and the code where it is another one."""
    number, code = item.cells.get("number"), item.cells.get("code")
    if number is None or code is None or number.value == code.value:
        return _message(number or code)
    return joined([_message(number), say("buffer_code", code=_message(code))])


def _message(cell: EntryValue | None) -> Both:
    if cell is None:
        return _NOTHING
    return Both.same(escape(cell.text or str(cell.value)))


def _time(cell: EntryValue | None, since: int | None) -> Both:
    """Milliseconds of the clock of the drive, and those since the first fault of the same situation."""
    if cell is None or not isinstance(cell.value, int):
        return _NOTHING
    shown = say("buffer_time", time=f"{cell.value} ms")
    return shown if since is None else shown.joined(Both.same(f"({since:+d} ms)"), " ", " ")


def _gone(cell: EntryValue | None) -> Both:
    if cell is None or not isinstance(cell.value, int) or cell.value == 0:
        return _NOTHING
    return say("buffer_gone", time=f"{cell.value} ms")


def _value(cell: EntryValue | None) -> Both:
    return _NOTHING if cell is None else say("buffer_value", value=escape(str(cell.value)))
