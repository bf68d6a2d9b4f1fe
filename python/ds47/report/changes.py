"""The changes of parameters as text, CSV or JSON, as `ds47 trail` prints them. `ds47.report.trail` finds them."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, TextIO

from ds47.model import DS47, CaptureResult
from ds47.profidrive.drive_objects import Identity
from ds47.profidrive.naming import element
from ds47.report import ReportOptions
from ds47.report.bilingual import joined, say
from ds47.report.clock import Clock
from ds47.report.csv import Lines, guarded
from ds47.report.formatting import both_sides, escape
from ds47.report.formatting import value as value_text
from ds47.report.parameters import plain
from ds47.report.selection import Selection, Wanted
from ds47.report.table import table
from ds47.report.targets import Targets, slot
from ds47.report.trail import WrittenChange, changes
from ds47.report.wrap import fitted
from ds47.spec.semantics import known
from ds47.spec.units import nanoseconds, timestamp

SCHEMA = "ds47.trail/1"
COLUMNS = (
    "path", "time", "frame", "transaction", "controller", "controller_station", "device", "station", "target",
    "drive_object", "way", "pnu", "subindex", "name", "unit", "old", "old_known", "old_frame", "old_format", "new",
    "format", "outcome", "error", "status",
)  # fmt: skip
"""The header of CSV, and the keys of JSON: `old` with how it is known and in which frame, `error` the number of a
negative response, `status` that of a refused Write call."""


def _chosen(result: CaptureResult, selection: Selection) -> tuple[list[dict[str, Any]], int]:
    """The changes that are wanted, with the keys COLUMNS and `parameter` as it is printed; how many more may be.

    Of those the drive object is not proved.
    """
    wanted, targets = Wanted(result, selection), Targets(result.evidence)
    stations = {each.ip: each.station for each in result.devices}
    whole = known().global_pnus  # of the device, whatever drive object is asked
    found, unproved = [], 0
    for change in changes(result):
        item = change.transaction
        if selection.pnus and change.pnu not in selection.pnus:
            continue
        row = _row(change, targets, stations) | {"path": result.path}
        if selection.drive_objects and row["drive_object"] is None:
            unproved += change.pnu not in whole and wanted.unproved(item)
        elif wanted.transaction(item):
            found.append(row)
    return found, unproved


def _row(
    change: WrittenChange, targets: Targets, stations: dict[str, str | None]
) -> dict[str, Any]:
    item, old, error = change.transaction, change.old, change.parameter.error
    of_device = targets.identity(item, change.pnu) == Identity(item.device)
    return {
        "time": timestamp(item.start_ns), "frame": change.frame, "transaction": item.id,
        "controller": item.controller, "controller_station": stations.get(item.controller),
        "device": item.device, "station": stations.get(item.device),
        "target": "" if of_device else targets.words(item),
        "drive_object": None if of_device else targets.drive_object(item),
        "parameter": element(change.pnu, change.subindex, change.parameter.family),
        "way": way(change), "pnu": change.pnu, "subindex": change.subindex,
        "name": change.parameter.name, "unit": change.parameter.unit,
        "unknown": change.unknown,
        "old": None if old is None else old.value, "old_known": None if old is None else old.how,
        "old_frame": None if old is None else old.frame, "old_format": None if old is None else old.format,
        "new": change.new, "format": change.parameter.format, "outcome": change.outcome,
        "error": None if error is None else error.code,
        "status": f"{item.write_status:08X}" if change.outcome == "refused" else None,
    }  # fmt: skip


def way(change: WrittenChange) -> str:
    """`47 slot 2.1`, `0xB02E slot 2.1`, `PKW slot 1.1`: by what a request came."""
    item = change.transaction
    if item.channel != DS47 or item.index is None:
        return " ".join(filter(None, (item.channel.upper(), slot(item))))
    index = str(item.index) if item.index < 0x100 else f"0x{item.index:04X}"
    return " ".join(filter(None, (index, slot(item))))


class Writer:
    """Writes the changes of captures as "text", "csv" or "json"."""

    def __init__(self, stream: TextIO, format_name: str, options: ReportOptions) -> None:
        self._stream, self._format, self._options = stream, format_name, options
        self._captures: list[dict[str, Any]] = []
        self._csv = csv.writer(Lines(stream), lineterminator="\r\n")
        if format_name == "csv":
            self._csv.writerow(COLUMNS)

    def capture(self, result: CaptureResult, selection: Selection) -> tuple[int, int]:
        """Takes one complete result.

        Returns:
            How many changes were written, and how many more may be wanted: their drive object is not proved.
        """
        found, unproved = _chosen(result, selection)
        if self._format == "csv":
            self._csv.writerows([_cell(each, name) for name in COLUMNS] for each in found)
        elif self._format == "json":
            keys = [key for key in COLUMNS if key != "path"]
            changes = [{key: each[key] for key in keys} for each in found]
            self._captures.append({"path": result.path, "changes": changes})
        else:
            clock = Clock.of(result, self._options.zone)
            texts = lines(result.path, found, clock, self._options)
            self._stream.writelines(f"{line}\n" for line in texts)
        return len(found), unproved

    def close(self) -> None:
        """Ends the output. The stream stays open: it belongs to the caller."""
        if self._format == "json":
            json.dump({"schema": SCHEMA, "captures": self._captures}, self._stream, indent=1)
            self._stream.write("\n")


def _cell(row: dict[str, Any], name: str) -> object:
    value = row[name]
    if name in ("old", "new"):
        return plain(value, row["old_format" if name == "old" else "format"])
    return guarded(value) if isinstance(value, str) else value


def lines(
    path: str, found: Sequence[dict[str, Any]], clock: Clock, options: ReportOptions
) -> Iterator[str]:
    """A head: how many writes, what came of them, the zone; a table; why values before are not known."""
    lang, width = options.lang, options.width
    words = say("trail_head", path=escape(path), n=len(found))
    came = Counter(_SUMS[each["outcome"]] for each in found)
    if came:
        sums = joined([say(key, n=came[key]) for key in dict.fromkeys(_SUMS.values()) if came[key]])
        words = words.joined(sums, ": ", "：")
    if clock.known:
        words = words.joined(say("trail_first", start=clock.start()), "; ", "；")
    yield from fitted(options.paint("bold", words.text(lang)), width)
    if not found:
        return
    head = [say(name).text(lang) for name in _HEADS[0 if clock.known else 1 :]]
    cells = [[*_times(each, clock), *_texts(each, options)] for each in found]
    yield from table(cells, width, head, lead=(0, -3, -2, -1), paint=options.paint)
    for why in dict.fromkeys(each["unknown"] for each in found if each["unknown"]):
        frames = list(dict.fromkeys(str(each["frame"]) for each in found if each["unknown"] == why))
        more = ", ..." if len(frames) > _FRAMES else ""
        about = say(f"trail_why_{why}", n=len(frames), frames=", ".join(frames[:_FRAMES]) + more)
        yield from fitted("  " + about.text(lang), width)
    if any(_differ(each) for each in found):
        yield from fitted("  " + say("trail_formats").text(lang), width)


def _differ(row: dict[str, Any]) -> bool:
    """Whether the format of a side of a change is shown."""
    plain_sides = value_text(row["old"], row["old_format"]), value_text(row["new"], row["format"])
    known = row["old"] is not None and row["new"] is not None
    return (
        known
        and both_sides(row["old"], row["old_format"], row["new"], row["format"]) != plain_sides
    )


_FRAMES = 8
"""Frames that are named of one reason."""
_HEADS = (
    "trail_time", "trail_since", "trail_frame", "trail_controller", "trail_device",
    "trail_way", "trail_parameter", "trail_change", "trail_outcome",
)  # fmt: skip
_COLORS = {"negative": "error", "refused": "error", "sent": "warning"}

_SUMS = {
    "accepted": "trail_n_accepted",
    "negative": "trail_n_refused",
    "refused": "trail_n_refused",
    "sent": "trail_n_sent",
}
"""What an outcome counts as: whether the drive or its channel refuses is in the rows."""


def _times(row: dict[str, Any], clock: Clock) -> list[str]:
    """Time of day, where one is known, and seconds since the first frame."""
    time_ns = nanoseconds(row["time"])
    return [*filter(None, [clock.at(time_ns)]), clock.since(time_ns)]


def _texts(row: dict[str, Any], options: ReportOptions) -> list[str]:
    lang = options.lang
    who, device = row["controller_station"] or row["controller"], row["station"] or row["device"]
    old, new = both_sides(row["old"], row["old_format"], row["new"], row["format"])
    outcome = say(f"trail_{row['outcome']}").text(lang)
    if row["error"] is not None:
        outcome += f" 0x{row['error']:02X}"
    if row["status"] is not None:
        outcome += f" {row['status']}"
    if row["outcome"] in _COLORS:
        outcome = options.paint(_COLORS[row["outcome"]], outcome)
    return [
        str(row["frame"]), escape(who), escape(" ".join(filter(None, (device, row["target"])))),
        row["way"], row["parameter"], f"{old} -> {new}", outcome,
    ]  # fmt: skip
