"""What to do over many captures: each diagnosis (DS7xx) once, in how many captures, and where it shows first.

Lives here: `CauseSummary`, what is kept of a diagnosed capture, the sums over captures, and their lines.
`ds47.report.summary` says what to do in one capture; its report has all causes with their frames.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ds47.model import SEVERITIES, CaptureResult
from ds47.report import ReportOptions
from ds47.report.bilingual import Both, say
from ds47.report.digest import first_sentences
from ds47.report.file_frames import FileFrames, name
from ds47.report.formatting import escape
from ds47.report.summary import WIDTH
from ds47.report.wrap import fitted, wrap

_ADVICE = 2
"""Lines of an advice: each capture has the whole of it."""


@dataclass(slots=True)
class CauseSummary:
    """What a capture says of one rule DS7xx.

    `frame` is the first one, numbered as in the report; in a series it is `file_frame` of `file`.
    """

    severity: str
    findings: int
    frame: int | None = None
    file: str | None = None
    file_frame: int | None = None


def of_capture(result: CaptureResult) -> dict[str, CauseSummary]:
    """The diagnoses of a capture by rule: as many as there are rules, however many causes it has."""
    found: dict[str, CauseSummary] = {}
    for each in result.diagnoses:
        item = found.setdefault(each.rule, CauseSummary(each.severity, 0))
        item.findings += each.count
        if each.frames and (item.frame is None or each.frames[0] < item.frame):
            item.frame = each.frames[0]
    file_frames = FileFrames(result.files)
    for item in found.values():
        where = None if item.frame is None else file_frames.file_of(item.frame)
        if where is not None:
            item.file, item.file_frame = name(where[0]), where[1]
    return dict(sorted(found.items()))


def plain(items: Mapping[str, CauseSummary]) -> dict[str, dict[str, Any]]:
    """What `of_capture` gave, as an object of `ds47.overview/1`."""
    return {rule: asdict(item) for rule, item in items.items()}


def loaded(stored: Mapping[str, dict[str, Any]]) -> dict[str, CauseSummary]:
    """The reverse; ten thousand of them share their words."""
    items = {sys.intern(rule): CauseSummary(**item) for rule, item in stored.items()}
    for item in items.values():
        item.severity = sys.intern(item.severity)
    return items


def over_all(captures: Iterable[tuple[str, Mapping[str, CauseSummary]]]) -> list[dict[str, Any]]:
    """The sums as objects of `ds47.overview/1`, worst first, then by the captures that have them.

    Args:
        captures: paths and what `of_capture` gave, in the order of the run: the first one is named.
    """
    sums: dict[str, dict[str, Any]] = {}
    for path, diagnoses in captures:
        for rule, item in diagnoses.items():
            each = sums.get(rule)
            if each is None:
                first = {
                    "path": path,
                    "frame": item.frame,
                    "file": item.file,
                    "file_frame": item.file_frame,
                }
                each = {"rule": rule, "severity": item.severity, "captures": 0, "findings": 0}
                sums[rule] = each | {"first": first}
                each = sums[rule]
            each["captures"] += 1
            each["findings"] += item.findings
    return sorted(
        sums.values(),
        key=lambda e: (-SEVERITIES.index(e["severity"]), -e["captures"], -e["findings"], e["rule"]),
    )


def lines(
    items: Sequence[dict[str, Any]], options: ReportOptions, *, advice: bool = True
) -> Iterator[str]:
    """What `over_all` gave, as text; without `advice` where each capture has said what to do."""
    if not items:
        return
    lang, width = options.lang, min(WIDTH, options.columns)
    yield options.paint("bold", say("to_do_head").text(lang))
    for each in items:
        rule = options.rules.get(each["rule"])
        told = headline(each, rule.name if rule else "").text(lang)
        yield from fitted(f"  {told}", options.width)
        if advice and rule:
            text = rule.advice_zh if lang == "zh" else rule.advice
            text = first_sentences(text, _ADVICE * (width - 8))
            for part in wrap("-> " + text, width - 4, 3):
                yield "    " + part
        yield from fitted(f"    {first_case(each['first']).text(lang)}", options.width)


def headline(item: dict[str, Any], rule_name: str) -> Both:
    """`DS705 error two-users: 15 times in 15 captures`, of one of what `over_all` gave."""
    return say(
        "cause_in_captures",
        rule=item["rule"],
        severity=say(f"severity_{item['severity']}"),
        name=rule_name,
        times=say("times", n=item["findings"]),
        captures=say("captures", n=item["captures"]),
    )


def first_case(first: dict[str, Any]) -> Both:
    """`first in frame 3 of line.pcapng`, of the `first` of one of what `over_all` gave."""
    path = escape(first["path"])
    if first["frame"] is None:
        return say("first_capture", path=path)
    number = Both.same(str(first["frame"]))
    if first["file"] is not None:
        values = {"number": str(first["file_frame"]), "file": escape(first["file"])}
        number = say("frame_in_file", frame=number, **values)
    return say("first_frame", frame=number, path=path)
