"""How a difference between two captures looks: text, JSON and HTML.

What differs is found in `ds47.regression.difference`; the page is `templates/difference.html.j2`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, TextIO

from ds47 import __version__, spec
from ds47.regression.difference import Difference, History, Latency, Place, differs
from ds47.report.bilingual import Both, operation, say, state
from ds47.report.words import escape

SCHEMA = "ds47.diff/1"
FORMATS = ("text", "json", "html")


def write(found: Difference, format_name: str, stream: TextIO, lang: str = "en") -> None:
    """Writes a difference in one of FORMATS; `lang` ("en", "zh") is that of text and HTML."""
    if format_name == "json":
        stream.write(
            json.dumps(document(found), ensure_ascii=False, indent=1, allow_nan=False) + "\n"
        )
    elif format_name == "html":
        stream.write(_page(found, lang))
    else:
        stream.writelines(f"{line}\n" for line in lines(found, lang))


def lines(found: Difference, lang: str = "en") -> Iterator[str]:
    """The difference as lines of text, what changed first."""
    a, b = found.names
    yield f"A {escape(a)}"
    yield f"B {escape(b)}"
    yield ""
    findings = [row for row in found.findings if row[1] != row[2]]
    sections = (
        ("diff_parameters", [_parameter(row) for row in found.changed]),
        ("diff_refusals", [_error(row) for row in found.errors]),
        ("diff_findings", [_finding(*row) for row in findings]),
        ("diff_states", [_state(*row) for row in found.states if row[1] != row[2]]),
        ("diff_durations", [_latency(each) for each in found.latencies]),
    )
    for title, rows in sections:
        yield say("diff_section" if rows else "diff_none", title=say(title)).text(lang)
        yield from (f"  {row.text(lang)}" for row in rows)
        yield ""
    total = len(found.parameters)
    yield say("diff_same", same=str(total - len(found.changed)), total=str(total)).text(lang)


def place_text(place: Place) -> str:
    """A parameter element as people write it: `192.168.0.1 slot 1 DO 2 p2900[0]`."""
    axis = "" if place.axis is None else f" DO {place.axis}"
    return f"{escape(place.device)} slot {place.slot}{axis} p{place.pnu}[{place.subindex}]"


def history_text(history: History | None) -> Both:
    """The last word about an element in one capture."""
    if history is None:
        return say("diff_not_asked")
    if history.error is not None:
        return say("diff_refused", error=escape(history.error))
    if history.last is None:
        return say("diff_no_value")
    return Both.same(escape(str(history.last)) + (f" {history.unit}" if history.unit else ""))


def _parameter(row: tuple[Place, History | None, History | None]) -> Both:
    place, a, b = row
    return _became(f"{place_text(place)}  ", history_text(a), history_text(b))


def refusal_text(history: History | None) -> Both:
    """How a drive took the last request for an element."""
    if history is None:
        return say("diff_not_asked")
    return Both.same(escape(history.error)) if history.error else say("diff_accepted")


def _error(row: tuple[Place, History | None, History | None]) -> Both:
    place, a, b = row
    what = (
        "diff_gone"
        if b is None or b.error is None
        else "diff_new"
        if a is None or a.error is None
        else "diff_other"
    )
    text = _became(f"{place_text(place)}  ", refusal_text(a), refusal_text(b))
    return say("diff_row", what=say(what), text=text)


def _finding(rule: str, was: int, now: int) -> Both:
    what = "new" if not was else "gone" if not now else "more" if now > was else "fewer"
    known = spec.rules().get(rule)
    counts = say("diff_row", what=f"{rule} {known.name if known else ''}", text=f"{was} -> {now}")
    return say("diff_row", what=say(f"diff_{what}"), text=counts)


def _state(name: str, was: int, now: int) -> Both:
    return say("diff_row", what=state(name), text=f"{was} -> {now}")


def _became(text: str, was: Both, now: Both) -> Both:
    return Both.same(text).joined(was, "", "").joined(now, " -> ", " -> ")


def shift_text(each: Latency) -> Both:
    """What became of the latency, in words that do not claim more than the numbers hold."""
    if each.probability is None:
        return say("diff_few")
    key = "diff_no_shift"
    if each.significant:
        key = "diff_slower" if each.medians[1] > each.medians[0] else "diff_quicker"
    return say(key, p=f"{each.probability:.2g}")


def _latency(each: Latency) -> Both:
    return say(
        "diff_latency",
        device=escape(each.device),
        operation=operation(each.operation),
        medians=f"{each.medians[0]:.1f} -> {each.medians[1]:.1f}",
        p95=f"{each.p95[0]:.1f} -> {each.p95[1]:.1f}",
        a=str(each.counts[0]),
        b=str(each.counts[1]),
        shift=shift_text(each),
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


def _page(found: Difference, lang: str) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # only for this format

    def word(key: str, **values: Any) -> str:
        return say(key, **values).text(lang)

    environment = Environment(
        loader=PackageLoader("ds47.report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("difference.html.j2").render(
        found=found,
        lang=lang,
        word=word,
        state=state,
        operation=lambda each: operation(each).text(lang),
        rules=spec.rules(),
        version=__version__,
        place_text=place_text,
        history_text=lambda history: history_text(history).text(lang),
        refusal_text=lambda history: refusal_text(history).text(lang),
        shift_text=lambda each: shift_text(each).text(lang),
    )
