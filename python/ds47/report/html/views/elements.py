"""Parameter by parameter: what was read and written, with what outcome, and what it held last.

An element is one subindex of a parameter on one drive object; an array is as many elements as
were asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ds47.model import CaptureResult, Parameter, Transaction
from ds47.profidrive.drive_objects import Identity
from ds47.report.formatting import value
from ds47.report.html import messages
from ds47.report.targets import Targets

MOST = 20_000
"""Elements that a page lists."""
WIDEST = 256
"""The most elements of one access that are shown one by one."""


@dataclass(slots=True)
class ElementLife:
    """The life of one element in a capture."""

    named: Parameter
    """The access that names it: the first, or the newest that a description of the drive names."""
    reads: int = 0
    """How often it was read."""
    accepted: int = 0
    """Changes that the drive accepted."""
    negative: list[int] = field(default_factory=lambda: [0, 0])
    """Negative responses, with an error number: of reads and of changes;"""
    sent: list[int] = field(default_factory=lambda: [0, 0])
    """requests whose response was not fetched, or does not say what became of it;"""
    refused: list[int] = field(default_factory=lambda: [0, 0])
    """and those of which the record call was refused."""
    last: tuple[Transaction, Parameter, int] | None = None
    """The last value: where it stands."""
    failed: tuple[Transaction, Parameter] | None = None
    """The last error number or negative STATUS."""


Key = tuple[Identity, int, int]
"""The drive object, PNU and subindex."""


def elements(result: CaptureResult, targets: Targets | None = None) -> tuple[dict[str, Any], int]:
    """The table for the script, and how many elements it leaves out."""
    targets = targets or Targets(result.evidence)
    found: dict[Key, ElementLife] = {}
    left_out: set[Key] = set()
    for item in result.transactions:
        if item.state in ("mismatch", "orphan"):
            continue  # its values belong to an unknown request
        if item.operation not in ("read", "change"):
            continue  # what a service of a vendor does with a parameter is not known either
        for each in item.parameters:
            if each.pnu is not None and each.attribute == "value":
                about = targets.identity(item, each.pnu)
                _note(found, left_out, item, each, (about, each.pnu, each.subindex or 0))
    labels = targets.labels(result.evidence)
    names = {key: labels.get(key[0], "") for key in found}
    order = sorted(found, key=lambda key: (key[0].device, names[key], key[1], key[2]))
    rows = [_row(key, names[key], found[key]) for key in order]
    return {"rows": rows}, len(left_out)


def _note(
    found: dict[Key, ElementLife],
    left_out: set[Key],
    item: Transaction,
    each: Parameter,
    first: Key,
) -> None:
    about, pnu, subindex = first
    for number in range(_width(each)):
        key = (about, pnu, subindex + number)
        element = found.get(key)
        if element is None:
            if len(found) >= MOST:
                left_out.add(key)
                continue
            element = found[key] = ElementLife(each)
        elif each.described is not None:
            element.named = each
        _count(element, item, each, number)


def _count(element: ElementLife, item: Transaction, each: Parameter, number: int) -> None:
    change = item.operation == "change"
    if item.state == "refused":
        element.refused[change] += 1
        element.failed = (item, each)
    elif each.error is not None:
        element.negative[change] += 1
        element.failed = (item, each)
    elif item.state not in ("ok", "partial"):
        element.sent[change] += 1
    else:
        element.accepted += change
        element.reads += not change
        if number < len(each.values):
            element.last = (item, each, number)


def _width(each: Parameter) -> int:
    """How many elements an access is about; a text counts its characters, and is one."""
    asked = each.element_count or 1
    if len(each.values) == 1 and each.error is None:
        return 1
    return min(max(asked, len(each.values)), WIDEST)


def _row(key: Key, name: str, element: ElementLife) -> list[Any]:
    about, pnu, subindex = key
    last, failed = element.last, element.failed
    return [
        about.device, name, pnu, subindex,
        *messages.name(element.named), last[1].unit if last else element.named.unit,
        element.reads, element.accepted, element.negative, element.sent, element.refused,
        last and _text(last[1], last[2]), int(bool(last and last[0].operation == "change")), last and last[0].id,
        failed and _error(*failed), failed and failed[0].id,
    ]  # fmt: skip


def _text(each: Parameter, number: int) -> str:
    shown = value(each.values[number], each.format)
    scaled = each.scaled[number] if each.scaled and number < len(each.scaled) else None
    return shown if scaled is None else f"{shown} ({scaled})"


def _error(item: Transaction, each: Parameter) -> list[str]:
    if each.error is not None:
        code = "" if each.error.number is None else f" ({each.error.number})"
        return [text + code for text in messages.error(each.error)]
    word = item.write_status or item.read_status or 0
    return [f"{text} ({word:08X})" for text in messages.status(word)]
