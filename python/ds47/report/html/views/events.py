"""The events of drives for the plots: what cyclic frames say, beside what was asked of a drive.

The words are those of `ds47.report.timelines`; the pictures of a drive are in `timelines`.
"""

from __future__ import annotations

from ds47.model import CaptureResult
from ds47.report import timelines as told

SHOWN = 200
"""Events of one drive."""
_FAULTS = ("fault", "alarm")


def events(result: CaptureResult) -> list[list[int | str]]:
    """Microseconds from the first frame, `fault` or `state`, both words, device and frame of each event."""
    found: list[list[int | str]] = []
    for timeline in result.timelines:
        device = result.relations[timeline.relation - 1].device
        for row in told.rows(timeline)[:SHOWN]:
            if all(each.name == "first" for each in row.events):
                continue
            fault = any(each.name.startswith(_FAULTS) for each in row.events)
            time_us = (row.last.time_ns - (result.start_ns or 0)) // 1000
            found.append(
                [time_us, "fault" if fault else "state", *told.words(row), device, row.last.frame]
            )
    return found
