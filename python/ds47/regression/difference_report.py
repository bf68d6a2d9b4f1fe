"""How a difference between two captures is written: as text, as JSON, as a page.

What differs is found in `ds47.regression.difference`, its words are in `difference_words`. All three forms say the
same, what a drive did otherwise first, and durations last.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TextIO

from ds47.regression import difference_words as words
from ds47.regression.conclusions import Conclusion, conclusions
from ds47.regression.difference import Difference, ElementDifference
from ds47.regression.elements import Outcomes
from ds47.report.bilingual import Both, say, state
from ds47.report.formatting import escape
from ds47.report.wrap import fitted
from ds47.version import __version__


def write(
    found: Difference,
    format_name: str,
    stream: TextIO,
    lang: str = "en",
    *,
    everything: bool = False,
    width: int | None = None,
) -> None:
    """Writes a difference.

    Args:
        found: what differs.
        format_name: one of FORMATS.
        stream: where to.
        lang: "en" or "zh", the language of text and page.
        everything: list also what was not compared, which is else one line of text (JSON has it always).
        width: columns of a line of text; None: a line is as long as it is.
    """
    if format_name == "json":
        from ds47.report.json import laid_out

        stream.write(laid_out(document(found)))
    elif format_name == "html":
        from ds47.regression.difference_page import page

        stream.write(page(found, lang, everything=everything))
    else:
        texts = lines(found, lang, everything=everything)
        stream.writelines(f"{part}\n" for line in texts for part in fitted(line, width))


def lines(found: Difference, lang: str = "en", *, everything: bool = False) -> Iterator[str]:
    """The difference as lines of text: the verdict, what differs, what was not compared, durations."""
    a, b = found.names
    yield f"A {escape(a)}"
    yield f"B {escape(b)}"
    yield ""
    yield words.verdict(found).text(lang)
    if found.strangers:
        yield from _rest_lines(found, lang, everything)
        return
    yield from _conclusion_lines(found, lang)
    for section in words.sections(found):
        yield from _section(section.title, [words.line(run, found) for run in section.runs], lang)
    if found.of_last_values:
        yield from _rest_lines(found, lang, everything)
        return
    yield from _section(
        say("diff_states"),
        [words.count_text(state(name), was, now) for name, was, now in words.changed(found.states)],
        lang,
    )
    yield from _section(
        say("diff_findings"),
        [words.finding_text(*row) for row in words.changed(found.findings)],
        lang,
    )
    yield from _rest_lines(found, lang, everything)
    yield from _section(
        say("diff_durations"), [words.latency_text(each) for each in found.latencies], lang
    )


def _conclusion_lines(found: Difference, lang: str) -> Iterator[str]:
    all_ = conclusions(found)
    if not all_:
        return
    yield from _section(
        say("diff_concluded"),
        [words.conclusion_text(each, found) for each in all_[: words.CONCLUSIONS]],
        lang,
    )
    if len(all_) > words.CONCLUSIONS:
        yield f"  {say('diff_more', n=len(all_) - words.CONCLUSIONS).text(lang)}"


def _rest_lines(found: Difference, lang: str, everything: bool) -> Iterator[str]:
    left = words.rest(found)
    if not left:
        return
    yield ""
    for section in left:
        yield say("diff_row", what=section.title, text=words.rest_text(section)).text(lang)
        if everything:
            yield from (f"  {words.line(run, found).text(lang)}" for run in section.runs)
    yield from (each.text(lang) for each in words.notes(found))
    if not everything:
        yield say("diff_list").text(lang)


def _section(title: Both, rows: list[Both], lang: str) -> Iterator[str]:
    yield ""
    yield say("diff_section" if rows else "diff_none", title=title).text(lang)
    yield from (f"  {row.text(lang)}" for row in rows)


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
    if faults is not None:
        place = place._replace(slot=faults.slot, subslot=faults.subslot)
    return {
        "kind": each.kind,
        **place._asdict(),
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
        **place._asdict(),
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
