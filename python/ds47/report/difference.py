"""How a difference between two captures looks: text, JSON and HTML.

What differs is found in `ds47.regression.difference`; the page is `templates/difference.html.j2`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, TextIO

from ds47 import __version__, spec
from ds47.regression.difference import Difference, History, Latency, Place, differs
from ds47.report.words import escape

SCHEMA = "ds47.diff/1"
FORMATS = ("text", "json", "html")


def write(found: Difference, format_name: str, stream: TextIO) -> None:
    """Writes a difference in one of FORMATS."""
    if format_name == "json":
        stream.write(
            json.dumps(document(found), ensure_ascii=False, indent=1, allow_nan=False) + "\n"
        )
    elif format_name == "html":
        stream.write(_page(found))
    else:
        stream.writelines(f"{line}\n" for line in lines(found))


def lines(found: Difference) -> Iterator[str]:
    """The difference as lines of text, what changed first."""
    a, b = found.names
    yield f"A {escape(a)}"
    yield f"B {escape(b)}"
    yield ""
    yield from _section("parameters that differ", [_parameter(row) for row in found.changed])
    yield from _section("refusals that differ", [_error(row) for row in found.errors])
    findings = [row for row in found.findings if row[1] != row[2]]
    yield from _section("findings", [_finding(*row) for row in findings])
    states = [f"{name}: {was} -> {now}" for name, was, now in found.states if was != now]
    yield from _section("states", states)
    yield from _section(
        "duration, write request to answer", [_latency(each) for each in found.latencies]
    )
    same = len(found.parameters) - len(found.changed)
    yield f"{same} of {len(found.parameters)} parameter elements are the same in both"


def _section(title: str, rows: list[str]) -> Iterator[str]:
    yield f"{title}: {'none' if not rows else ''}".rstrip()
    yield from (f"  {row}" for row in rows)
    yield ""


def place_text(place: Place) -> str:
    """A parameter element as people write it: `192.168.0.1 slot 1 DO 2 p2900[0]`."""
    axis = "" if place.axis is None else f" DO {place.axis}"
    return f"{escape(place.device)} slot {place.slot}{axis} p{place.pnu}[{place.subindex}]"


def history_text(history: History | None) -> str:
    """The last word about an element in one capture."""
    if history is None:
        return "not asked"
    if history.error is not None:
        return f"refused ({escape(history.error)})"
    value = "no value" if history.last is None else escape(str(history.last))
    return value + (f" {history.unit}" if history.unit and history.last is not None else "")


def _parameter(row: tuple[Place, History | None, History | None]) -> str:
    place, a, b = row
    return f"{place_text(place)}  {history_text(a)} -> {history_text(b)}"


def refusal_text(history: History | None) -> str:
    """How a drive took the last request for an element."""
    if history is None:
        return "not asked"
    return escape(history.error or "accepted")


def _error(row: tuple[Place, History | None, History | None]) -> str:
    place, a, b = row
    what = (
        "gone"
        if b is None or b.error is None
        else "new"
        if a is None or a.error is None
        else "other"
    )
    return f"{what}: {place_text(place)}  {refusal_text(a)} -> {refusal_text(b)}"


def _finding(rule: str, was: int, now: int) -> str:
    what = "new" if not was else "gone" if not now else "more" if now > was else "fewer"
    known = spec.rules().get(rule)
    return f"{what}: {rule} {known.name if known else ''}: {was} -> {now}"


def shift_text(each: Latency) -> str:
    """What became of the latency, in words that do not claim more than the numbers hold."""
    if each.probability is None:
        return "too few to judge"
    if not each.significant:
        return f"no clear shift (p = {each.probability:.2g})"
    word = "slower" if each.medians[1] > each.medians[0] else "quicker"
    return f"{word} (p = {each.probability:.2g})"


def _latency(each: Latency) -> str:
    one, two = each.medians
    return (
        f"{escape(each.device)} {each.operation}: median {one:.1f} -> {two:.1f} ms, "
        f"p95 {each.p95[0]:.1f} -> {each.p95[1]:.1f} ms "
        f"({each.counts[0]} and {each.counts[1]}), {shift_text(each)}"
    )


def document(found: Difference) -> dict[str, Any]:
    """The difference as plain dictionaries."""
    return {
        "schema": SCHEMA,
        "tool": {"name": "ds47", "version": __version__},
        "a": found.names[0],
        "b": found.names[1],
        "parameters": [
            {**place._asdict(), "changed": differs(a, b), "a": _history(a), "b": _history(b)}
            for place, a, b in found.parameters
        ],
        "findings": [{"rule": rule, "a": was, "b": now} for rule, was, now in found.findings],
        "states": [{"state": name, "a": was, "b": now} for name, was, now in found.states],
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


def _history(history: History | None) -> dict[str, Any] | None:
    if history is None:
        return None
    return {
        "reads": history.reads,
        "writes": history.writes,
        "refused": history.refused,
        "last": history.last,
        "error": history.error,
        "name": history.name,
        "unit": history.unit,
    }


def _page(found: Difference) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # only for this format

    environment = Environment(
        loader=PackageLoader("ds47.report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("difference.html.j2").render(
        found=found,
        rules=spec.rules(),
        version=__version__,
        place_text=place_text,
        history_text=history_text,
        refusal_text=refusal_text,
        shift_text=shift_text,
    )
