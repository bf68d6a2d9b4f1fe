"""A difference between two captures as JSON, `ds47.diff/2` (docs/regression.md says what the keys mean)."""

from __future__ import annotations

from typing import Any

from ds47.regression.conclusions import Conclusion, conclusions
from ds47.regression.difference import Difference, ElementDifference
from ds47.regression.elements import Outcomes
from ds47.version import __version__

SCHEMA = "ds47.diff/2"


def document(found: Difference) -> dict[str, Any]:
    """The difference as plain dictionaries (docs/regression.md says what the keys mean)."""
    return {
        "schema": SCHEMA,
        "tool": {"name": "ds47", "version": __version__},
        "a": found.names[0],
        "b": found.names[1],
        "compared": found.compared,
        "different": found.different,
        "conclusions": [_conclusion(each) for each in conclusions(found)],
        "parameters": [_parameter(row, found) for row in found.rows],
        "unknown_requests": list(found.unknown),
        "states": [{"state": name, "a": was, "b": now} for name, was, now in found.states],
        "findings": [{"rule": rule, "a": was, "b": now} for rule, was, now in found.findings],
        "latency": [
            {
                "device": each.device,
                "operation": each.operation,
                "count": list(each.counts),
                "median_ms": list(each.medians),
                "p95_ms": list(each.p95),
                "probability": each.probability,
                "significant": each.significant,
            }
            for each in found.latencies
        ],
    }


def _conclusion(each: Conclusion) -> dict[str, Any]:
    place, faults = each.place, each.faults
    return {
        "kind": each.kind,
        "device": place.device,
        "drive_object": place.drive_object,
        "slot": place.slot if faults is None else faults.slot,
        "subslot": place.subslot if faults is None else faults.subslot,
        "axis": place.axis,
        "local": place.local,
        "operation": _operation(each),
        "elements": [[row.element.pnu, row.element.subindex] for row in each.rows],
        "faults": None if faults is None else [faults.a, faults.b],
    }


def _operation(each: Conclusion) -> str | None:
    if each.latency is not None:
        return each.latency.operation
    return each.rows[0].operation if each.rows else None


def _parameter(row: ElementDifference, found: Difference) -> dict[str, Any]:
    place, pnu, subindex = row.element
    return {
        "device": place.device,
        "drive_object": place.drive_object,
        "slot": place.slot,
        "subslot": place.subslot,
        "axis": place.axis,
        "local": place.local,
        "pnu": pnu,
        "subindex": subindex,
        "name": row.name,
        "unit": row.unit,
        "operation": row.operation,
        "result": row.result,
        "a": _outcomes(row.a, place.device, found),
        "b": _outcomes(row.b, place.device, found),
    }


def _outcomes(side: Outcomes | None, device: str, found: Difference) -> dict[str, Any] | None:
    if side is None:
        return None
    return {
        "asked": side.asked,
        "values": side.values,
        "distinct": side.distinct,
        "last": side.last,
        "format": side.format,
        "negative": [
            {"code": code, "text": found.texts.get((device, code), ""), "count": count}
            for code, count in side.negative.items()
        ],
        "refused": [{"status": status, "count": count} for status, count in side.refused.items()],
        "open": side.open,
    }
