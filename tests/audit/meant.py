"""Whether what a report says of values is what the tables say of that number and that value.

The tables are read as they stand. Whose parameters a drive has is not judged here: a sentence has to be that of one
family, of the one whose name the parameter has where it has one. The words of the profile (p964 and the like) are
judged nowhere.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from tests.audit.reading import Complaint, Reading

SPEC = Path(__file__).parents[2] / "python/ds47/spec"
TABLES = ("parameters.toml", "drives.toml")
OF_THE_PROFILE = {922, 964, 965, 974, 975, *range(61000, 61005)}
MOST = 8
OWN = 63
OF_SINAMICS = ("sinamics", "sinamics-dcm", "siemens", "encoder", "profile")
PLACES = 8


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about what values mean."""
    for deal in reading.deals:
        for number, told in enumerate(deal.parameters):
            for text in _parameter(told):
                yield Complaint("meaning", f"#{deal.id}", f"parameter {number} {text}")


def _parameter(told: dict[str, Any]) -> Iterator[str]:
    meaning, values = told.get("meaning"), told["values"]
    if told["pnu"] in OF_THE_PROFILE:
        return
    if told["attribute"] != "value" or told["error"] or not values or told["subindex"] is None:
        if meaning is not None:
            yield f"means {meaning!r} without a value"
        return
    rows = _rows().get(told["pnu"], [])
    named = [row for row in rows if row["en"] == told["name"]]
    possible = [_words(row, values, told["subindex"]) for row in named or rows]
    if meaning is not None and meaning not in possible:
        yield f"= {values} means {meaning!r}, by the tables {possible}"
    if meaning is None and named and None not in possible:
        yield f"= {values} has no meaning, by the tables {possible}"


def rows_of(number: int | None) -> list[dict[str, Any]]:
    """What the tables say of a number, of each family."""
    return [] if number is None else _rows().get(number, [])


@cache
def _rows() -> dict[int, list[dict[str, Any]]]:
    found: dict[int, list[dict[str, Any]]] = {}
    for name in TABLES:
        for row in tomllib.loads((SPEC / name).read_text(encoding="utf-8"))["parameter"]:
            for number in range(row["number"], row.get("last", row["number"]) + 1):
                found.setdefault(number, []).append(row)
    return found


def _words(row: dict[str, Any], values: list[Any], first: int) -> str | None:
    if any(type(each) is not int for each in values):
        return None
    if "buffer" in row:
        return _buffer(row, values, first)
    if "connects" in row:
        return _source(row["connects"], values)
    texts = {value: text for value, text, _ in row.get("values", ())}
    if len(values) > MOST or not any(each in texts for each in values):
        return None
    return ", ".join(texts.get(each, str(each)) for each in values)


def _source(kind: str, values: list[int]) -> str | None:
    bits = f"{values[0]:032b}"
    if len(values) > 1 or len(bits) > 32 or values[0] < 0:
        return None
    number, drive_object, place = int(bits[:16], 2), int(bits[16:22], 2), int(bits[22:], 2)
    if not number or drive_object != OWN:
        return None
    rows = {row.get("family", "profile"): row for row in _rows().get(number, [])}
    usual = [rows[family] for family in OF_SINAMICS if family in rows]
    letter = usual[0].get("access", "") if usual else ""
    text = f"from {letter}{number:04d}" if letter else f"from {number}"
    text += f".{place}" if kind == "bit" else f"[{place}]"
    return f"{text}, {usual[0]['en']}" if usual else text


def _buffer(row: dict[str, Any], values: list[int], first: int) -> str | None:
    kind, leads = row["buffer"], row["entry"].endswith((".number", ".code"))
    there = [(place, value) for place, value in enumerate(values, first) if value]
    parts = []
    if leads and not first and all(place >= PLACES for place, _ in there):
        parts.append(f"no active {kind.removesuffix('s')}")
    for situation in sorted({place // PLACES for place, _ in there}):
        entries = ", ".join(str(value) for place, value in there if place // PLACES == situation)
        if not situation:
            parts.append(f"active: {entries}")
        elif kind == "faults":
            parts.append(f"acknowledged situation {situation}: {entries}")
        elif not any(part.startswith("gone") for part in parts):
            gone = ", ".join(str(value) for place, value in there if place >= PLACES)
            parts.append(f"gone: {gone}")
    return "; ".join(parts) or None
