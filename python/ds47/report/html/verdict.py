"""The first screen in words: the verdict, the quality of the capture, what it cannot show.

Everything here is counted from the result model; the words are in texts.toml.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from ds47.model import CaptureResult
from ds47.report.html.texts import Both, joined, say
from ds47.report.words import escape

FAILED = ("refused", "error", "partial", "mismatch")
"""States of a job that did not do what it was meant to do."""
_TOLD = ("refused", "error", "partial", "mismatch", "unanswered", "superseded", "orphan")
LEVELS = ("none", "good", "warn", "bad")
"""From nothing to say to serious; names of classes in the style sheet."""


@dataclass(slots=True)
class Counts:
    """What a verdict rests on."""

    captures: int = 0
    frames: int = 0
    unreadable: int = 0
    drives: set[str] = field(default_factory=set)
    jobs: int = 0
    states: Counter[str] = field(default_factory=Counter)
    operations: Counter[str] = field(default_factory=Counter)
    severities: Counter[str] = field(default_factory=Counter)

    @classmethod
    def of(cls, result: CaptureResult) -> Counts:
        """The counts of one capture."""
        return cls(
            captures=1,
            frames=result.frames,
            unreadable=0 if result.complete else 1,
            drives={each.device for each in result.transactions},
            jobs=len(result.transactions),
            states=Counter(each.state for each in result.transactions),
            operations=Counter(each.operation for each in result.transactions),
            severities=Counter(each.severity for each in result.findings),
        )

    def add(self, other: Counts) -> None:
        """Adds another capture."""
        self.captures += other.captures
        self.frames += other.frames
        self.unreadable += other.unreadable
        self.drives |= other.drives
        self.jobs += other.jobs
        self.states += other.states
        self.operations += other.operations
        self.severities += other.severities

    @property
    def level(self) -> str:
        """One of LEVELS."""
        if self.severities["error"] or any(self.states[state] for state in FAILED):
            return "bad"
        if self.severities["warning"] or self.unreadable:
            return "warn"
        return "good" if self.jobs else "none"


def verdict(counts: Counts) -> Both:
    """One line: `NOT OK: 1 drive, 452 jobs, 412 refused`."""
    head = say(f"verdict_{counts.level}")
    if not counts.jobs:
        tail = say("verdict_no_jobs")
    else:
        parts = [say("drives", n=len(counts.drives)), say("jobs", n=counts.jobs)]
        parts += [
            say(f"told_{state}", n=counts.states[state]) for state in _TOLD if counts.states[state]
        ]
        if len(parts) == 2:
            parts.append(say("told_all_answered"))
        tail = joined(parts)
    if counts.unreadable:
        tail = joined([tail, say("told_unreadable", n=counts.unreadable)])
    return head.joined(tail, ": ", "：")


@dataclass(frozen=True, slots=True)
class Remark:
    """A line about the capture: `level` is one of LEVELS."""

    level: str
    text: Both


def quality(result: CaptureResult) -> list[Remark]:
    """How far the capture can be trusted."""
    rules = Counter(each.rule for each in result.findings)
    return [
        _complete(result),
        _dropped(result),
        _directions(result),
        *_flaws(rules),
    ]


def _complete(result: CaptureResult) -> Remark:
    if result.complete:
        return Remark("good", say("complete", frames=result.frames))
    problem = Both.same(escape(result.problem)) if result.problem else say("ends_early")
    return Remark("bad", say("incomplete", problem=problem, frames=result.frames))


def _dropped(result: CaptureResult) -> Remark:
    if result.dropped is None:
        return Remark("none", say("dropped_unknown"))
    if result.dropped:
        return Remark("bad", say("dropped", n=result.dropped))
    return Remark("good", say("dropped_none"))


def _directions(result: CaptureResult) -> Remark:
    asked = result.rpc.get("requests", 0)
    answered = sum(result.rpc.get(key, 0) for key in ("responses", "faults", "rejects"))
    if not asked and not answered:
        return Remark("none", say("no_calls"))
    if not answered:
        return Remark("bad", say("only_requests", n=asked))
    if not asked:
        return Remark("bad", say("only_responses", n=answered))
    missing = result.rpc.get("unanswered", 0)
    if missing:
        return Remark("warn", say("some_unanswered", n=missing, asked=asked))
    return Remark("good", say("both_directions", n=asked, answered=answered))


def _flaws(rules: Counter[str]) -> Iterator[Remark]:
    for rule, key in (
        ("DS106", "frames_cut"),
        ("DS105", "fragments_missing"),
        ("DS103", "sent_again"),
        ("DS107", "clock_back"),
        ("DS403", "starts_late"),
    ):
        if rules[rule]:
            yield Remark("warn", say(key, n=rules[rule]))


def blind(result: CaptureResult) -> list[Both]:
    """What this capture cannot show: nobody should conclude from its silence."""
    counts = Counter(each.operation for each in result.transactions)
    lines = []
    if counts["change"]:
        lines.append(say("blind_effect"))
    if result.dropped is None:
        lines.append(say("blind_drops"))
    nameless = sum(1 for each in result.devices if not each.station)
    if nameless:
        lines.append(say("blind_names", n=nameless))
    orphans = sum(1 for each in result.transactions if each.state == "orphan")
    if orphans:
        lines.append(say("blind_before", n=orphans))
    other = _other_records(result)
    if other:
        lines.append(say("blind_records", n=other))
    lines += [say("blind_place"), say("blind_cyclic"), say("blind_meaning")]
    return lines


def _other_records(result: CaptureResult) -> int:
    """Record calls on indices that carried no parameter channel."""
    ours = {str(each.index) for each in result.transactions}
    return sum(
        number
        for index, kinds in result.records.items()
        if index not in ours
        for number in kinds.values()
    )
