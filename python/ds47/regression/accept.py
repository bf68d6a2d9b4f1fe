"""Taking changes over into a stored result: all of them, or those that were chosen.

Pure. Which changes there are is found in `ds47.regression.compare`; files are `baseline`'s.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from ds47 import spec
from ds47.regression.compare import KINDS, Change, Json

FACETS = ("pnu", "subindex", "rule", "kind", "device", "capture")
"""What `--where KEY=VALUE` can ask for."""


class WhereError(Exception):
    """A `--where` that cannot be understood."""


def parse_where(conditions: Iterable[str]) -> dict[str, str]:
    """`["pnu=964", "kind=value"]` as a mapping.

    Raises:
        WhereError: unknown key, no value, or no number where one is needed.
    """
    wanted: dict[str, str] = {}
    for condition in conditions:
        key, equals, value = condition.partition("=")
        key, value = key.strip(), value.strip()
        if not equals or not value or key not in FACETS:
            raise WhereError(f"--where {condition!r}: KEY=VALUE with one of {', '.join(FACETS)}")
        if key in ("pnu", "subindex") and not value.isdecimal():
            raise WhereError(f"--where {condition!r}: {key} is a number")
        if key == "kind" and value not in KINDS:
            raise WhereError(f"--where {condition!r}: a kind is one of {', '.join(KINDS)}")
        wanted[key] = (spec.rule_prefix(value) or value) if key == "rule" else value
    return wanted


def chosen(change: Change, where: Mapping[str, str], capture: Path) -> bool:
    """Whether a change is among those that were asked for; all are where nothing was asked."""
    for key, value in where.items():
        if key == "capture":
            if not (fnmatch(capture.name, value) or fnmatch(capture.as_posix(), value)):
                return False
        elif key in ("pnu", "subindex"):
            if getattr(change, key) != int(value):
                return False
        elif key in ("rule", "device"):
            if not fnmatch(getattr(change, key) or "", f"{value}*" if key == "rule" else value):
                return False
        elif change.kind != value:
            return False
    return True


def merge(
    stored: Json,
    now: Json,
    pairs: Sequence[tuple[int | None, int | None]],
    accepted: Sequence[Change],
) -> Json:
    """The stored result with the accepted changes and nothing else taken over.

    Args:
        stored: the stored capture object; it is not changed.
        now: the present one.
        pairs: which transaction is which (`ds47.regression.compare.Comparison`).
        accepted: the changes to take over.
    """
    result = deepcopy(stored)
    fields = [change for change in accepted if change.stored is not None and change.now is not None]
    for change in fields:
        assert change.stored is not None
        _put(result["transactions"][change.stored], change.path, deepcopy(change.is_now))
    for change in accepted:
        if change.kind == "count":
            _put(result, change.path, deepcopy(change.is_now))
        elif change.kind == "device":
            _device(result, now, str(change.path[1]), change.path[2:])
        elif change.kind == "event":
            _timelines(result, now)
    numbers = _transactions(result, now, pairs, accepted)
    _findings(result, numbers, accepted)
    result["diagnoses"] = _diagnoses(result, now)
    result["summary"] = _summary(result["transactions"])
    return result


def _put(item: Any, path: Sequence[str | int], value: Any) -> None:
    for key in path[:-1]:
        item = item[key]
    item[path[-1]] = value


def _timelines(result: Json, now: Json) -> None:
    """The events of all drives, with the relations that they count in."""
    for key in ("relations", "timelines"):
        result.pop(key, None)
        if key in now:
            result[key] = deepcopy(now[key])


def _device(result: Json, now: Json, ip: str, path: Sequence[str | int]) -> None:
    old = next((each for each in result["devices"] if each["ip"] == ip), None)
    new = next((each for each in now["devices"] if each["ip"] == ip), None)
    if old is None:
        result["devices"].append(deepcopy(new))
    elif new is None:
        result["devices"].remove(old)
    elif path:
        old[path[0]] = new[path[0]]


def _transactions(
    result: Json,
    now: Json,
    pairs: Sequence[tuple[int | None, int | None]],
    accepted: Sequence[Change],
) -> dict[tuple[str, int], int]:
    """Puts in what is new, leaves out what is gone; says which number each one has afterwards."""
    come = {change.now for change in accepted if change.kind == "transaction_new"}
    gone = {change.stored for change in accepted if change.kind == "transaction_gone"}
    items: list[Json] = []
    numbers: dict[tuple[str, int], int] = {}
    for old, new in pairs:
        if old is not None and old not in gone:
            items.append(result["transactions"][old])
        elif old is None and new in come:
            items.append(deepcopy(now["transactions"][new]))
        else:
            continue
        if old is not None:
            numbers["stored", old + 1] = len(items)
        if new is not None:
            numbers["now", new + 1] = len(items)
    for number, item in enumerate(items, 1):
        item["id"] = number
    result["transactions"] = items
    return numbers


def _findings(
    result: Json, numbers: dict[tuple[str, int], int], accepted: Sequence[Change]
) -> None:
    gone = [change.was for change in accepted if change.kind == "finding_gone"]
    findings = []
    for finding in result["findings"]:
        if finding in gone:
            gone.remove(finding)
            continue
        if finding["transaction"] is not None:
            finding["transaction"] = numbers.get(("stored", finding["transaction"]))
            if finding["transaction"] is None:
                continue  # its transaction went
        findings.append(finding)
    for change in accepted:
        if change.kind == "finding_new":
            finding = dict(change.is_now)
            if finding["transaction"] is not None:
                finding["transaction"] = numbers.get(("now", finding["transaction"]))
            findings.append(finding)
    findings.sort(key=lambda each: (each["frame"], each["rule"], each["transaction"] or 0))
    result["findings"] = findings
    for item in result["transactions"]:
        item["findings"] = sorted(
            {each["rule"] for each in findings if each["transaction"] == item["id"]}
        )


def _diagnoses(result: Json, now: Json) -> list[Json]:
    """Diagnoses sum up findings: those of the rules that are among them, the present ones first."""
    rules = {each["rule"] for each in result["findings"]}
    present = now.get("diagnoses", [])
    shown = {each["rule"] for each in present}
    kept = [each for each in result.get("diagnoses", []) if each["rule"] not in shown]
    return [deepcopy(each) for each in present + kept if each["rule"] in rules]


def _summary(transactions: Sequence[Json]) -> dict[str, int]:
    summary = {"transactions": len(transactions)}
    for item in transactions:
        for key in ("state", "operation"):
            summary[item[key]] = summary.get(item[key], 0) + 1
    return summary
