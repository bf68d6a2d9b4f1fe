"""The verdict on a capture, and what the capture cannot show: the same in every report.

Everything here is counted from the result model; the words are in spec/report.toml.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields
from operator import attrgetter

from ds47.acyclic.index47 import ALWAYS, SHARED_INDEX
from ds47.model import DS47, PKW, S7, STATES, CaptureResult, Transaction
from ds47.report.bilingual import Both, joined, say, state
from ds47.report.todo import is_lowered
from ds47.spec.layouts import RECORD_WRITE_MULTIPLE

FAILED = ("refused", "error", "partial", "mismatch")
"""States of a transaction that did not do what it was meant to do."""
OPEN = ("unanswered", "superseded", "incomplete")
"""States of a transaction with an unknown outcome."""
CALLS = ("DS101", "DS104", "DS105", "DS108", "DS207")
"""Rules about a record call that brought nothing: where one did, not all is done."""
KINDS = {
    "ok": "good",
    **dict.fromkeys(FAILED, "bad"),
    **dict.fromkeys(OPEN, "open"),
    "orphan": "orphan",
}
"""How good or bad each state is, in a plot or a figure."""
LEVELS = ("none", "good", "warn", "bad")
"""From nothing to say to serious; names of classes in the style sheet of the page."""


@dataclass(slots=True)
class VerdictCounts:
    """What a verdict rests on."""

    captures: int = 0
    frames: int = 0
    unreadable: int = 0
    drives: set[str] = field(default_factory=set)
    watched: set[str] = field(default_factory=set)
    """Devices with known control and status words."""
    connections: int = 0
    """Of S7."""
    jobs: int = 0
    states: Counter[str] = field(default_factory=Counter)
    operations: Counter[str] = field(default_factory=Counter)
    severities: Counter[str] = field(default_factory=Counter)
    calls: int = 0
    """Findings about record calls that brought nothing."""
    lowered: int = 0
    """Findings that are notes only because the maker has no tables here."""
    cut: Counter[tuple[str, int | None]] = field(default_factory=Counter)
    """Messages that are cut before their record, by what is said of them and the bytes that are left of each."""

    @classmethod
    def of(cls, result: CaptureResult) -> VerdictCounts:
        """The counts of one capture."""
        jobs, findings = result.transactions, result.findings
        return cls(
            captures=1,
            frames=result.frames,
            unreadable=0 if result.complete else 1,
            drives=_devices(result, {each.device for each in jobs if each.channel != S7}),
            watched=_devices(
                result, {result.relations[each.relation - 1].device for each in result.timelines}
            ),
            connections=len(result.connections) + result.connections_left_out,
            jobs=len(jobs),
            states=Counter(map(attrgetter("state"), jobs)),
            operations=Counter(map(attrgetter("operation"), jobs)),
            severities=Counter(map(attrgetter("severity"), findings)),
            calls=sum(each.rule in CALLS for each in findings),
            lowered=sum(is_lowered(each.rule, each.severity) for each in findings),
            cut=_cut(result),
        )

    def add(self, other: VerdictCounts) -> None:
        """Adds another capture."""
        for each in fields(self):
            mine, its = getattr(self, each.name), getattr(other, each.name)
            setattr(self, each.name, mine | its if isinstance(mine, set) else mine + its)

    @property
    def open(self) -> int:
        """Transactions without a captured response."""
        return sum(self.states[word] for word in OPEN)

    @property
    def smooth(self) -> bool:
        """Whether nothing went wrong on the way: no error was found, every record call brought its record."""
        return not (self.severities["error"] or self.lowered or self.calls)

    @property
    def level(self) -> str:
        """One of LEVELS."""
        if self.severities["error"] or any(self.states[word] for word in FAILED):
            return "bad"
        if self.severities["warning"] or self.lowered or self.unreadable or self.open:
            return "warn"
        return "good" if self.jobs or self.watched else "none"


def _devices(result: CaptureResult, names: set[str]) -> set[str]:
    """The devices of these names, each once."""
    return {result.device(name).ip for name in names}


def verdict(counts: VerdictCounts) -> Both:
    """One line: `NOT OK: 1 drive, 452 transactions, 412 refused`."""
    head = say(f"verdict_{counts.level}")
    if not counts.jobs:
        tail = _undecoded(counts.cut) or say("verdict_no_jobs")
        if counts.watched:
            tail = joined([say("verdict_watched", n=len(counts.watched)), tail])
    else:
        parts = [say("transactions", n=counts.jobs)]
        tail = joined([*_who(counts), *parts, *outcomes(counts.states, smooth=counts.smooth)])
    if counts.unreadable:
        tail = joined([tail, say("told_unreadable", n=counts.unreadable)])
    return head.joined(tail, ": ", "：")


def _cut(result: CaptureResult) -> Counter[tuple[str, int | None]]:
    """Messages that are cut, where no record is known."""
    rpc = result.rpc.get("requests") or result.rpc.get("responses")
    word = "verdict_cut" if rpc else "verdict_cut_rpc"
    messages = [each.args for each in result.findings if each.args.get("what") == "cut"]
    return Counter(
        {(word, each.get("bytes")): each["count"] for each in messages if not result.records}
    )


def _undecoded(cut: Counter[tuple[str, int | None]]) -> Both | None:
    """Why record messages are no transactions; None where they are not cut, or at several lengths."""
    if len(cut) != 1:
        return None
    ((word, length),) = cut
    return None if length is None else say(word, n=cut.total(), bytes=str(length))


def _who(counts: VerdictCounts) -> list[Both]:
    """Whom transactions are of: drives, connections of S7, or both."""
    drives = (
        [say("drives", n=len(counts.drives))] if counts.drives or not counts.connections else []
    )
    return drives + ([say("verdict_s7", n=counts.connections)] if counts.connections else [])


def outcomes(states: Counter[str], *, smooth: bool) -> list[Both]:
    """The states of transactions that are not ok; without any, that all are done.

    If the capture is not `VerdictCounts.smooth`, it says only that all have a response.
    """
    return by_state(states, but=("ok",)) or [
        say("told_all_done" if smooth else "told_all_answered")
    ]


def by_state(states: Counter[str], but: tuple[str, ...] = ()) -> list[Both]:
    """`84 ok`, `3 error`: how many transactions have each state, in the order of the table."""
    words = [word for word in STATES if states[word] and word not in but]
    return [say("told_state", n=states[word], state=state(word)) for word in words]


def blind(result: CaptureResult) -> list[Both]:
    """What this capture cannot show, though others can: its silence proves nothing."""
    result, lines = result.entire, []
    if any(_accepted(each) for each in result.transactions):
        lines.append(say("blind_effect"))
    if result.dropped is None:
        lines.append(say("blind_drops"))
    nameless = sum(1 for each in result.devices if not each.station)
    if nameless:
        lines.append(say("blind_names", n=nameless))
    unseen = sum(1 for each in result.transactions if each.state in OPEN and each.channel == DS47)
    if unseen:
        lines.append(say("blind_open", n=unseen))
    known = {each.transaction for each in result.findings}
    silent = sum(
        1
        for each in result.transactions
        if each.state in OPEN and each.channel == PKW and each.id not in known
    )
    if silent:
        lines.append(say("blind_open_pkw", n=silent))
    if any(each.channel == S7 for each in result.transactions):
        lines.append(say("blind_s7"))
    orphans = [each for each in result.transactions if each.state == "orphan"]
    without_ar = sum(
        each.ar is None and each.station is None and each.channel != S7 for each in orphans
    )
    if len(orphans) > without_ar:
        lines.append(say("blind_before", n=len(orphans) - without_ar))
    if without_ar:
        lines.append(say("blind_without_ar", n=without_ar))
    other = _other_records(result)
    if other:
        lines.append(say("blind_records", n=other))
    return lines


def _accepted(item: Transaction) -> bool:
    """Whether the drive accepted at least one value that was written."""
    return item.operation == "change" and item.state in ("ok", "partial")


def _other_records(result: CaptureResult) -> int:
    """Record calls on indices that carried no parameter channel, and are not there for one.

    DS209 counts those at index 47 that nothing shows to be ours. An IODWriteMultiple is none: it is opened, and
    what is in it counts by its own index.
    """
    ours = {str(each.index) for each in result.transactions}
    ours |= {str(index) for index in (RECORD_WRITE_MULTIPLE, *ALWAYS)}
    if any(each.rule == "DS209" for each in result.findings):
        ours.add(str(SHARED_INDEX))
    return sum(
        number
        for index, kinds in result.records.items()
        if index not in ours
        for number in kinds.values()
    )
