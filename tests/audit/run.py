"""The whole audit of one capture: transactions, findings, sentences, diagnoses, the text report."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.audit import (
    buffers,
    causes,
    claims,
    corrected,
    cyclic,
    deals,
    described,
    expected,
    html,
    letters,
    meant,
    page,
    pkw,
    pzd,
    reading,
    s7,
    stations,
    words,
)
from tests.audit.drive import Drive
from tests.audit.memory import Memory
from tests.audit.reading import Complaint, Finding, Reading

AUDITORS = {
    **claims.AUDITORS, **causes.AUDITORS,
    **dict.fromkeys(pkw.AUDITORS, lambda case: pkw.of(case.finding, case.reading)),
    **dict.fromkeys(pzd.AUDITORS, lambda case: pzd.of(case.finding, case.reading)),
    **dict.fromkeys(pzd.OF_CHANGES, lambda case: pzd.of_change(case.finding, case.reading)),
    **dict.fromkeys(pzd.HABITS, lambda case: pzd.of_habit(case.finding, case.reading)),
    **dict.fromkeys(s7.AUDITORS, lambda case: s7.of(case.finding, case.reading)),
    **dict.fromkeys(stations.AUDITORS, stations.of),
    "DS110": lambda case: (
        pkw.of_incomplete(case.finding, case.reading)
        if case.deal is not None and case.deal.plain["channel"] == "pkw"
        else claims.AUDITORS["DS110"](case)
    ),
    "DS515": lambda case: cyclic.of_mixed(case.finding, case.reading),
    "DS514": lambda case: pkw.of_ignored(case.finding, case.reading),
    "DS507": lambda case: pzd.of_word(case.finding, case.reading),
    "DS602": expected.of,
}  # fmt: skip
NO_CLAIM = claims.NO_CLAIM

TABLE = Path(__file__).parents[2] / "python/ds47/spec/rules.toml"


@cache
def declared() -> dict[str, dict[str, str]]:
    """The arguments that the catalogue says each rule carries, and their types."""
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["rule"]
    return {row["id"]: row.get("args", {}) for row in rows}


def audit(path: Path, drives: dict[str, Drive] | None = None) -> list[Complaint]:
    """What is not so in the report of a capture; of a simulated one with the drives that spoke in it."""
    return list(complaints(reading.read(path, page=drives is None), drives))


def complaints(item: Reading, drives: dict[str, Drive] | None = None) -> Iterator[Complaint]:
    """The same, of what was read already."""
    memory = Memory(item)
    yield from deals.check(item)
    for deal in item.deals if drives else ():
        if deal.device not in (drives or {}):
            yield Complaint("index 47", f"#{deal.id}", f"{deal.device} is no drive")
    yield from described.check(item, memory)
    yield from meant.check(item)
    yield from buffers.check(item)
    yield from pkw.check(item)
    yield from pzd.check(item)
    yield from pzd.stories(item)
    yield from pzd.offers(item)
    for finding in item.findings:
        yield from of_finding(finding, item, memory)
        yield from words.check(finding, item)
    yield from causes.diagnoses(item)
    yield from corrected.check(item, memory, drives or {})
    yield from page.check(item)
    yield from html.check(item)
    yield from stations.check(item)


def _severity(finding: Finding, item: Reading) -> Iterator[Complaint]:
    """That of the catalogue; of cyclic channels of other makers than Siemens a note, but for what is said of frames."""
    true = words.RULES[finding.rule]["severity"]
    if finding.rule.startswith("DS5") and finding.rule != "DS515":
        deal = item.deal(finding)
        device = deal.device if deal else finding.args.get("device")
        vendor = item.vendors.get(device or "", 0x2A if finding.severity == true else 0)
        true = true if vendor == 0x2A else "note"
    if finding.severity != true:
        yield Complaint(finding.rule, f"frame {finding.frame}", f"is no {finding.severity}")


def of_finding(finding: Finding, item: Reading, memory: Memory) -> Iterator[Complaint]:
    """What the auditor of its rule says of a finding, and what is true of every finding."""
    where = f"frame {finding.frame}"
    function = AUDITORS.get(finding.rule)
    if function is None and finding.rule not in NO_CLAIM:
        yield Complaint(finding.rule, where, "has no auditor")
    for text in function(claims.Case(finding, item, memory)) if function else ():
        yield Complaint(finding.rule, where, f"{text} [{finding.message}]")
    if set(finding.args) != set(declared()[finding.rule]):
        yield Complaint(finding.rule, where, f"carries {sorted(finding.args)}")
    if finding.args.get("dropped", item.dropped) != item.dropped:
        yield Complaint(finding.rule, where, f"the capture says otherwise of drops: {item.dropped}")
    yield from letters.check(finding, item)
    yield from _severity(finding, item)
    if finding.frame not in finding.frames:
        yield Complaint(finding.rule, where, "its own frame is not among its frames")
    if not all(1 <= frame <= len(item.capture.frames) for frame in finding.frames):
        yield Complaint(finding.rule, where, f"the capture has no frames {finding.frames}")
    frame, told = item.capture.frame(finding.frame), finding.time
    if frame is not None and told is not None and page.nanoseconds(told) != frame.time_ns:
        yield Complaint(finding.rule, where, f"is of {frame.time_ns} ns, not of {told}")
    if reading.shown(finding.filter) != set(finding.frames):
        yield Complaint(finding.rule, where, f"{finding.filter} does not show {finding.frames}")
    deal = item.deal(finding)
    if deal is not None and finding.rule not in deal.plain["findings"]:
        yield Complaint(finding.rule, where, f"#{deal.id} does not name it")
