"""The events of drives for the plots: what cyclic frames say, and faults that were read from fault buffers.

The words of cyclic events are those of `ds47.report.timelines`; the pictures of a drive are in `timelines`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from ds47.model import CaptureResult, Parameter
from ds47.profidrive.drive_objects import Identity
from ds47.profidrive.naming import spelling
from ds47.report import timelines
from ds47.report.html.texts import Both, say
from ds47.report.targets import Targets

SHOWN = 200
"""Events of one drive, and of all fault buffers."""
_FAULTS = ("fault", "alarm")
_BUFFERS = (945, 947)
"""Fault codes and fault numbers."""
_PRESENT = range(8)
"""Subindices of what is not acknowledged yet; the others are history."""

EventCells = list[int | str]
"""Microseconds from the first frame, `fault` or `state`, both words, where, and the frame."""


def events(result: CaptureResult, targets: Targets | None = None) -> list[EventCells]:
    """All of a capture: first those of cyclic frames, then those of fault buffers."""
    buffers = _buffers(result, targets or Targets(result.evidence))
    return [*_of_timelines(result), *islice(buffers, SHOWN)]


def _of_timelines(result: CaptureResult) -> Iterator[EventCells]:
    for timeline in result.timelines:
        device = result.relations[timeline.relation - 1].device
        for row in timelines.rows(timeline)[:SHOWN]:
            if all(each.name == "first" for each in row.events):
                continue
            fault = any(each.name.startswith(_FAULTS) for each in row.events)
            kind = "fault" if fault else "state"
            words, last = timelines.words(row), row.last
            yield _event(result, last.time_ns, kind, words, device, last.frame)


def _event(
    result: CaptureResult, time_ns: int, kind: str, words: Both, where: str, frame: int
) -> EventCells:
    return [(time_ns - (result.start_ns or 0)) // 1000, kind, *words, where, frame]


def _buffers(result: CaptureResult, targets: Targets) -> Iterator[EventCells]:
    """Reads that show a fault which the read before did not show, and the first that shows none any more."""
    known: dict[tuple[Identity, int], dict[int, int]] = {}
    for item in result.transactions:
        if item.operation != "read" or item.state not in ("ok", "partial", "error"):
            continue
        for each in item.parameters:
            if each.pnu not in _BUFFERS or not (now := _present(each)):
                continue
            before = known.setdefault((targets.identity(item, each.pnu), each.pnu), {})
            words = _news(spelling(each.pnu, each.family), before, now)
            before.update(now)
            if words is not None:
                where = " ".join(filter(None, (item.device, targets.words(item))))
                kind = "fault" if any(now.values()) else "state"
                answered = item.start_ns + max(0, item.duration_ns or 0)
                frame = item.frames.read_response or item.frames.first()
                yield _event(result, answered, kind, words, where, frame)


def _present(item: Parameter) -> dict[int, int]:
    """Faults that are not acknowledged, by subindex: 0 where there is none."""
    if item.attribute != "value" or item.error is not None:
        return {}
    placed = enumerate(item.values, item.subindex or 0)
    return {at: each for at, each in placed if at in _PRESENT and isinstance(each, int)}


def _news(parameter: str, before: dict[int, int], now: dict[int, int]) -> Both | None:
    appeared = [each for each in now.values() if each and each not in before.values()]
    if appeared:
        numbers = ", ".join(map(str, dict.fromkeys(appeared)))
        return say("event_buffer_fault", parameter=parameter, numbers=numbers)
    if any(before.values()) and not any((before | now).values()):
        return say("event_buffer_empty", parameter=parameter)
    return None
