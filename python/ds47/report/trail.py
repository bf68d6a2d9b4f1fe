"""The trail of each parameter: who changed it when, by which way, from which value to which, and what came of it.

A parameter is that of a drive object (`profidrive.drive_objects`). Here are also the last values that a capture
shows. What is not proved is not said: an old value is one that was read or accepted before, with nothing since
that may have changed it. No layout and no files: `ds47.report.parameters` and `ds47.cli.trail` have these.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from itertools import zip_longest
from operator import itemgetter
from typing import Final, NamedTuple

from ds47.model import S7, CaptureResult, Parameter, Transaction, Value
from ds47.profidrive import decode_request
from ds47.profidrive.dictionary import changes_itself
from ds47.profidrive.drive_objects import DriveAccess, DriveObjects, Identity, access_of
from ds47.profidrive.elements import is_whole, split
from ds47.report import s7
from ds47.spec.semantics import known

ACCEPTED: Final = "accepted"
NEGATIVE: Final = "negative"
REFUSED: Final = "refused"
SENT: Final = "sent"
"""Outcomes: the response accepts it; it is negative; the Write call was refused; no response tells."""
_NO_INDEX: Final = 0
"""Of an access that has no record index: the drive object is named by itself."""
_DOUBTFUL: Final = frozenset({"DS106", "DS309", "DS313", "DS315"})
"""Findings of a message that is not all there: what it does not say is not known."""


class KnownValue(NamedTuple):
    """A value that the capture shows, and how: "read" or "written", in the frame of the response."""

    value: Value
    scaled: Value | None
    format: str | None
    how: str
    frame: int
    start_ns: int
    transaction: int
    """Its id."""


@dataclass(slots=True)
class WrittenChange:
    """One element that a request wrote. `old` is None where the value before is not known."""

    transaction: Transaction
    pnu: int
    subindex: int
    parameter: Parameter
    new: Value | None
    old: KnownValue | None = None
    outcome: str = SENT
    unknown: str = ""
    """Why the value before is not known: "unseen", "open", "itself", "unsure" or "anew"; empty where it is."""

    @property
    def frame(self) -> int:
        """The frame of the request."""
        return _first(self.transaction)


@dataclass(slots=True)
class TrailCell:
    """One element of one drive object.

    Attributes:
        sample: a transaction that asked for it; names the drive object.
        last: the last value that was read or accepted.
        certain: whether nothing since may have changed it.
        negative: negative responses and refused calls.
    """

    sample: Transaction
    access: DriveAccess
    last: KnownValue | None = None
    certain: bool = False
    name: str | None = None
    unit: str | None = None
    reads: int = 0
    changes: int = 0
    negative: int = 0
    open: int = 0
    touched: int = 0
    """Frame by which the last change was in force, or may have been."""


Key = tuple[str, int, int]
"""Device, PNU, subindex: cells with the same key are of different drive objects, or perhaps not."""


@dataclass(slots=True)
class _Device:
    open: int = 0
    """Changes without a response yet that make the drive compute others anew."""
    forgotten: int = 0
    """Frame up to which nothing is known."""


@dataclass(slots=True)
class Trail:
    """What a capture shows: all changes by their frames, and all cells."""

    changes: list[WrittenChange] = field(default_factory=list)
    cells: dict[Key, dict[Identity, TrailCell]] = field(default_factory=dict)


def trail(result: CaptureResult) -> Trail:
    """The trail of a complete result."""
    return _Walk(result).run()


def changes(result: CaptureResult) -> list[WrittenChange]:
    """Only its changes: reads of parameters without a write do not matter for them."""
    walk = _Walk(result)
    walk.written_alone()
    return walk.run().changes


class _Walk:
    """Goes through requests and responses in the order of their frames."""

    def __init__(self, result: CaptureResult) -> None:
        self._items: list[Transaction] = []
        for each in result.evidence:
            self._items += _requests(each) if each.channel == S7 else (each,)
        self._connects = [(each.device, each.frame) for each in result.relations if each.frame]
        self._objects = DriveObjects.of(self._items)
        self._devices: defaultdict[str, _Device] = defaultdict(_Device)
        self._vendors = {each.ip: each.vendor_id for each in result.devices}
        self._ars: set[tuple[str, str]] = set()
        self._pending: dict[int, list[tuple[WrittenChange, TrailCell]]] = {}
        self._found = Trail()
        self._wanted: set[int | None] | None = None
        """The PNUs of parameters with relevant reads; None for all."""

    def written_alone(self) -> None:
        """Follows only what a request writes."""
        self._wanted = {
            parameter.pnu
            for item in self._items if item.operation == "change"
            for parameter, _ in _written(item)
        }  # fmt: skip

    def _matters(self, item: Transaction) -> bool:
        wanted = self._wanted
        return wanted is None or not wanted.isdisjoint([each.pnu for each in item.parameters])

    def run(self) -> Trail:
        """All of it. At one frame a request counts before a response, which leaves more unknown."""
        steps: list[tuple[int, int, int, Transaction | str]] = []
        for number, (device, frame) in enumerate(self._connects):
            steps.append((frame, 0, number, device))
        for number, item in enumerate(self._items):
            steps.append((_first(item), 1, number, item))
            if item.operation != "read" or self._matters(item):
                steps.append((_last(item), 2, number, item))
        for frame, kind, _, what in sorted(steps, key=itemgetter(0, 1, 2)):
            if isinstance(what, str):
                self._forget(what, frame)
            elif kind == 1:
                self._asked(what, frame)
            else:
                self._settled(what, frame)
        for (device, pnu, _), there in self._found.cells.items():
            for cell in there.values():
                cell.certain = not self._unknown(device, pnu, cell)
        return self._found

    def _forget(self, device: str, frame: int) -> None:
        state = self._devices[device]
        state.forgotten = max(state.forgotten, frame)

    def _asked(self, item: Transaction, frame: int) -> None:
        if item.ar is not None and (item.device, item.ar) not in self._ars:
            # The drive may have been switched off and on before its Connect.
            self._ars.add((item.device, item.ar))
            self._forget(item.device, frame - 1)  # what it asks itself comes after it
        if item.operation != "change" or item.state == "orphan":
            return
        if _recomputes(item):
            self._devices[item.device].open += 1
        pending = self._pending[id(item)] = []
        for parameter, outcome in _written(item):
            assert parameter.pnu is not None
            for subindex, value in _elements(parameter):
                cell = self._cell(item, parameter, subindex)
                change = WrittenChange(
                    item, parameter.pnu, subindex, parameter, value, None, outcome
                )
                change.unknown = self._unknown(item.device, parameter.pnu, cell)
                change.old = None if change.unknown else cell.last
                pending.append((change, cell))
        for change, cell in pending:
            self._found.changes.append(change)
            cell.changes += 1
            for each in self._near(change, cell):
                each.open += 1

    def _unknown(self, device: str, pnu: int, cell: TrailCell) -> str:
        """Why nobody knows what a cell holds; empty where the capture shows it."""
        state = self._devices[device]
        if changes_itself(pnu, self._vendors.get(device)):
            return "itself"
        if cell.open or state.open:
            return "open"
        if cell.last is None:
            return "unsure" if cell.touched else "unseen"
        if cell.last.frame <= state.forgotten:
            return "anew"
        return "" if cell.certain else "unsure"

    def _settled(self, item: Transaction, frame: int) -> None:
        if item.operation == "read" and item.state in ("ok", "partial", "error"):
            self._read(item, frame)
        elif item.operation == "change" and item.state == "orphan":
            self._forget(item.device, frame)  # something was written by then
        elif item.operation == "change":
            self._changed(item, frame)

    def _changed(self, item: Transaction, frame: int) -> None:
        asked = _first(item)
        if _recomputes(item):
            self._devices[item.device].open -= 1
            self._forget(item.device, frame)
        for change, cell in self._pending.pop(id(item)):
            near = self._near(change, cell)
            for each in near:
                each.open -= 1
            if change.outcome in (NEGATIVE, REFUSED):
                cell.negative += 1
                continue
            sure = not cell.open and cell.touched < asked
            for each in near:
                each.touched, each.certain = frame, False
            if change.outcome == ACCEPTED and change.new is not None:
                scaled = _scaled(change.parameter, change.subindex)
                form = change.parameter.format
                cell.last = KnownValue(
                    change.new, scaled, form, "written", frame, item.start_ns, item.id
                )
                cell.certain = sure

    def _read(self, item: Transaction, frame: int) -> None:
        state, wanted = self._devices[item.device], self._wanted
        for parameter in item.parameters:
            if parameter.pnu is None or parameter.attribute != "value":
                continue
            if wanted is not None and parameter.pnu not in wanted:
                continue
            for subindex, value in _elements(parameter):
                cell = self._cell(item, parameter, subindex)
                cell.reads += 1
                if parameter.error is not None:
                    cell.negative += 1
                elif value is not None:
                    scaled = _scaled(parameter, subindex)
                    cell.last = KnownValue(
                        value, scaled, parameter.format, "read", frame, item.start_ns, item.id
                    )
                    asked = max(cell.touched, state.forgotten) < _first(item)
                    cell.certain = asked and not cell.open and not state.open

    def _cell(self, item: Transaction, parameter: Parameter, subindex: int) -> TrailCell:
        assert parameter.pnu is not None
        there = self._found.cells.setdefault((item.device, parameter.pnu, subindex), {})
        access = access_of(item)
        identity = self._objects.identity(access, parameter.pnu)
        cell = there.get(identity)
        if cell is None:
            cell = there[identity] = TrailCell(item, access)
        cell.name = parameter.name or cell.name
        cell.unit = parameter.unit or cell.unit
        return cell

    def _near(self, change: WrittenChange, cell: TrailCell) -> list[TrailCell]:
        """The cells that a change reaches, or may reach."""
        there = self._found.cells[change.transaction.device, change.pnu, change.subindex].values()
        return [
            each
            for each in there
            if each is cell or not self._objects.other(cell.access, each.access, change.pnu)
        ]


def _requests(item: Transaction) -> Iterator[Transaction]:
    """The requests in a job of S7: one for each drive object that it addresses."""
    for accepted in (True, False):
        found = [
            each for each in item.items
            if each.parameter is not None and (each.code in (s7.OK, None)) is accepted
        ]  # fmt: skip
        for number in dict.fromkeys(each.drive_object for each in found):
            part = copy(item)
            part.operation = "read" if item.operation == "get" else "change"
            part.axis, part.index, part.items = number, _NO_INDEX, []
            if item.state == "partial":
                part.state = "ok" if accepted else "refused"
            mine = [each for each in found if each.drive_object == number]
            part.write_status = None if accepted else mine[0].code
            part.parameters = [each.parameter for each in mine if each.parameter is not None]
            yield part


def _first(item: Transaction) -> int:
    """The frame of the request, else the first one that there is."""
    if item.frames.write_request is not None:
        return item.frames.write_request
    return min(item.frames.all(), default=0)


def _last(item: Transaction) -> int:
    """The frame of the response; where there is none, the last frame of the transaction."""
    if item.frames.read_response is not None and item.state != "mismatch":
        return item.frames.read_response
    return max(item.frames.all(), default=0)


def _recomputes(item: Transaction) -> bool:
    """Whether a change may change parameters that it does not name."""
    if not _DOUBTFUL.isdisjoint(item.findings):
        return True
    return not known().recomputing.isdisjoint([each.pnu for each in item.parameters])


def _written(item: Transaction) -> Iterator[tuple[Parameter, str]]:
    """The parameters of a change as its request has them, each with what came of it."""
    if item.state == "mismatch" and item.request is not None:
        yield from ((each, SENT) for each in _of_request(item))
        return
    for position, each in enumerate(item.parameters):
        if each.pnu is not None and each.attribute == "value":
            yield each, _outcome(item, position, each)


def _of_request(item: Transaction) -> Iterator[Parameter]:
    message = decode_request(item.request or b"")
    family = next((each.family for each in item.parameters), None)
    for address, block in zip(message.addresses, message.blocks, strict=False):
        if address.attribute_name == "value":
            yield Parameter(
                address.pnu, address.subindex, "value", address.element_count,
                format=block.format_name, values=list(block.values), family=family,
            )  # fmt: skip


def _outcome(item: Transaction, position: int, parameter: Parameter) -> str:
    if parameter.error is not None:
        return NEGATIVE
    if item.write_status:
        return REFUSED
    if item.state == "ok":
        return ACCEPTED
    if item.state != "partial" or any(rule in item.findings for rule in _DOUBTFUL):
        return SENT
    response = item.response or b""
    return ACCEPTED if len(response) > 3 and position < response[3] else SENT


def _elements(parameter: Parameter) -> list[tuple[int, Value | None]]:
    """Subindex and value of each element that was asked for."""
    values, first = parameter.values, parameter.subindex or 0
    count = max(1, parameter.element_count or 0)
    if is_whole(parameter.format):
        values = split(values, parameter.format)
        count = max(count, len(values))
    return list(zip_longest(range(first, first + count), values[:count]))


def _scaled(parameter: Parameter, subindex: int) -> Value | None:
    at, scaled = subindex - (parameter.subindex or 0), parameter.scaled
    if not scaled or at >= len(scaled) or is_whole(parameter.format):
        return None
    return scaled[at]
