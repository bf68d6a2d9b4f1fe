"""A corpus at a glance: what is new, gone, slower and by which label, and what the captures cover.

Pure: capture objects and their changes in, numbers and lines out.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from ds47 import spec
from ds47.regression.compare import Json
from ds47.regression.run import CheckOutcome
from ds47.report.bilingual import Both, joined, say
from ds47.report.table import table

_LISTED = 12
"""How many of a kind a line names before it only counts."""


@dataclass(slots=True)
class Label:
    """What was seen under one label (a firmware, a folder)."""

    captures: int = 0
    changed: int = 0
    failed: int = 0
    changes: Counter[str] = field(default_factory=Counter)
    findings_new: Counter[str] = field(default_factory=Counter)
    findings_gone: Counter[str] = field(default_factory=Counter)
    shifts: list[float] = field(default_factory=list)
    """Duration now divided by that stored, for each transaction that has both."""


class Summary:
    """Collects capture by capture; `lines` says it, `document` gives it as data."""

    def __init__(self) -> None:
        self.labels: defaultdict[str, Label] = defaultdict(Label)
        self.coverage: dict[str, Counter[str]] = {
            key: Counter()
            for key in ("pnu", "attribute", "format", "error", "rule", "operation", "state")
        }

    def add(self, outcome: CheckOutcome) -> None:
        """Takes one capture, where it could be read."""
        now, stored = outcome.now, outcome.stored
        if now is None:
            return
        row = self.labels[outcome.label]
        row.captures += 1
        row.changed += bool(outcome.changes)
        row.failed += outcome.failed
        for change in outcome.changes:
            row.changes[change.kind] += 1
            if change.kind == "finding_new" and change.rule:
                row.findings_new[change.rule] += 1
            elif change.kind == "finding_gone" and change.rule:
                row.findings_gone[change.rule] += 1
        for old, new in outcome.pairs:
            if stored is not None and old is not None and new is not None:
                before = stored["transactions"][old]["duration_ms"]
                after = now["transactions"][new]["duration_ms"]
                if before and after is not None:
                    row.shifts.append(after / before)
        self._cover(now)

    def _cover(self, now: Json) -> None:
        cover = self.coverage
        for item in now["transactions"]:
            cover["operation"][item["operation"]] += 1
            cover["state"][item["state"]] += 1
            for each in item["parameters"]:
                for key in ("pnu", "attribute", "format"):
                    if each[key] is not None:
                        cover[key][str(each[key])] += 1
                if each["error"] is not None:
                    code = each["error"]["code"]
                    cover["error"]["-" if code is None else spec.error_hex(code)] += 1
        for finding in now["findings"]:
            cover["rule"][finding["rule"]] += 1

    def lines(self, lang: str = "en", width: int | None = None) -> list[str]:
        """The summary as text; `width`: columns of a line of its table."""
        rows = []
        for name, row in sorted(self.labels.items()):
            rows.append((name, _about(row).text(lang)))
            for key, counter in (("new", row.findings_new), ("gone", row.findings_gone)):
                if counter:
                    rows.append(("", say(f"summary_{key}", rules=_counted(counter)).text(lang)))
        lines = [say("summary_labels").text(lang), *table(rows, width)]
        lines.append(say("summary_coverage").text(lang))
        lines += [
            f"  {key:<9} {len(seen):>4}: {_counted(seen).text(lang)}"
            for key, seen in self.coverage.items()
            if seen
        ]
        return lines

    def document(self) -> dict[str, Any]:
        """The summary as plain dictionaries."""
        return {
            "labels": {
                name: {
                    "captures": row.captures,
                    "failed": row.failed,
                    "changed": row.changed,
                    "changes": dict(sorted(row.changes.items())),
                    "findings_new": dict(sorted(row.findings_new.items())),
                    "findings_gone": dict(sorted(row.findings_gone.items())),
                    "duration_ratio": median(row.shifts) if row.shifts else None,
                }
                for name, row in sorted(self.labels.items())
            },
            "coverage": {
                key: dict(sorted(seen.items(), key=_natural)) for key, seen in self.coverage.items()
            },
        }


def _natural(item: tuple[str, int]) -> tuple[bool, int, str]:
    """Numbers by their size, in front of words."""
    name = item[0]
    return (not name.isdecimal(), int(name) if name.isdecimal() else 0, name)


def _about(row: Label) -> Both:
    """The numbers of a label; kinds of changes are called as in `--where kind=`."""
    what = [
        say("summary_captures", number=str(row.captures)),
        say("summary_failed", number=str(row.failed)),
        say("summary_changed", number=str(row.changed)),
    ]
    what += [Both.same(f"{count} {kind}") for kind, count in sorted(row.changes.items())]
    if row.shifts:
        what.append(say("summary_duration", ratio=f"{median(row.shifts):.2f}"))
    return joined(what)


def _counted(counter: Counter[str]) -> Both:
    names = sorted(counter.items(), key=_natural)
    text = " ".join(f"{name}({count})" for name, count in names[:_LISTED])
    if len(names) <= _LISTED:
        return Both.same(text)
    return say("summary_more", names=text, number=str(len(names) - _LISTED))
