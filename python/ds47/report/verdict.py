"""The verdict on a capture, and what the capture cannot show: the same in every report.

Everything here is counted from the result model; the words are in spec/report.toml.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields
from operator import attrgetter, itemgetter

from ds47.acyclic.index47 import ALWAYS, SHARED_INDEX
from ds47.findings.grouping import OF_THE_RECORDING, headlines
from ds47.model import DS47, PKW, S7, SEVERITIES, STATES, CaptureResult, Diagnosis, Transaction
from ds47.report.bilingual import LANGUAGES, Both, joined, say, state
from ds47.report.clock import Clock
from ds47.report.formatting import escape
from ds47.report.sentences import brief
from ds47.report.todo import is_lowered, uncovered
from ds47.report.zones import UNIVERSAL, Zone
from ds47.spec.layouts import RECORD_WRITE_MULTIPLE

FAILED = ("refused", "error", "partial", "mismatch")
"""States of a transaction that did not do what it was meant to do."""
OPEN = ("unanswered", "superseded", "incomplete")
"""States of a transaction with an unknown outcome."""
CALLS = ("DS101", "DS104", "DS105", "DS108", "DS207")
"""Rules about a record call that brought nothing: with one of these, not everything succeeded."""
KINDS = {
    "ok": "good",
    **dict.fromkeys(FAILED, "bad"),
    **dict.fromkeys(OPEN, "open"),
    "orphan": "orphan",
}
"""How good or bad each state is, in a plot or a figure."""
ENDS = {
    **dict.fromkeys(("DS520", "DS524", "DS532"), "fault-cleared"),
    **dict.fromkeys(("DS521", "DS523"), "running"),
}
"""Rules about the state of a drive -> the event that ends this state."""
LEVELS = ("none", "good", "warn", "bad")
"""From "nothing to say" to serious; also class names in the style sheet of the page."""


@dataclass(slots=True)
class VerdictCounts:
    """The numbers behind a verdict."""

    captures: int = 0
    narrowed: int = 0
    """Captures of which only a part is shown."""
    frames: int = 0
    nothing: int = 0
    """Captures without PROFINET, PROFIBUS and S7."""
    others: Counter[str] = field(default_factory=Counter)
    """The kinds of their first frames."""
    unreadable: int = 0
    drives: set[str] = field(default_factory=set)
    watched: set[str] = field(default_factory=set)
    """Devices with known control and status words."""
    stations: int = 0
    """Of PROFIBUS."""
    connections: int = 0
    """Of S7."""
    jobs: int = 0
    states: Counter[str] = field(default_factory=Counter)
    operations: Counter[str] = field(default_factory=Counter)
    severities: Counter[str] = field(default_factory=Counter)
    worst: tuple[int, Both] | None = None
    """The worst cause: its place in SEVERITIES, and a clause."""
    causes: int = 0
    """The number of causes, without those of the recording."""
    in_part: int = 0
    """Captures that lack something (DS725)."""
    faulty: int = 0
    """Captures with a cause."""
    calls: int = 0
    """Findings about record calls that brought nothing."""
    lowered: int = 0
    """Findings that are notes only because the maker has no tables here."""
    cut: Counter[tuple[str, int | None]] = field(default_factory=Counter)
    """Messages that are cut before their record, by the key of their words and the bytes left of each."""

    @classmethod
    def of(cls, result: CaptureResult, zone: Zone = UNIVERSAL) -> VerdictCounts:
        """The counts of one capture; `zone` is for times in the clause of its worst cause."""
        jobs, findings = result.transactions, result.findings
        causes = wrong(result)
        return cls(
            captures=1,
            narrowed=0 if result.narrowed is None else 1,
            frames=result.frames,
            nothing=1 if result.nothing else 0,
            others=Counter(result.others),
            unreadable=0 if result.complete else 1,
            drives=_devices(result, {each.device for each in jobs if each.channel != S7}),
            watched=_devices(
                result, {result.relations[each.relation - 1].device for each in result.timelines}
            ),
            stations=len(result.bus.stations) if result.bus else 0,
            connections=len(result.connections) + result.connections_left_out,
            jobs=len(jobs),
            states=Counter(map(attrgetter("state"), jobs)),
            operations=Counter(map(attrgetter("operation"), jobs)),
            severities=Counter(map(attrgetter("severity"), findings)),
            worst=_worst(result, causes, zone),
            causes=len(causes),
            in_part=int(any(map(_shows_a_part, result.diagnoses))),
            faulty=1 if causes else 0,
            calls=sum(each.rule in CALLS for each in findings),
            lowered=sum(is_lowered(each.rule, each.severity) for each in findings),
            cut=_cut(result),
        )

    def add(self, other: VerdictCounts) -> None:
        """Adds another capture."""
        for each in fields(self):
            mine, its = getattr(self, each.name), getattr(other, each.name)
            if each.name == "worst":
                total = max(filter(None, (mine, its)), key=itemgetter(0), default=None)
            else:
                total = mine | its if isinstance(mine, set) else mine + its
            setattr(self, each.name, total)

    @property
    def open(self) -> int:
        """Transactions without a captured response."""
        return sum(self.states[word] for word in OPEN)

    @property
    def there(self) -> dict[str, int]:
        """The kinds of stations in the capture, and how many of each; kinds without any are left out."""
        numbers = {
            "drives": len(self.drives),
            "watched": len(self.watched - self.drives),
            "stations": self.stations,
            "s7": self.connections,
        }
        return {what: number for what, number in numbers.items() if number}

    @property
    def failed(self) -> int:
        """Transactions that did not do what they were meant to do."""
        return sum(self.states[word] for word in FAILED)

    @property
    def smooth(self) -> bool:
        """Whether nothing went wrong on the way: no error was found, and every record call brought its record."""
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
    device = result.named()
    return {device(name).ip for name in names}


def wrong(result: CaptureResult) -> list[Diagnosis]:
    """What is wrong: each cause once, the worst first. Notes, and what the capture lacks, are no causes.

    A finding that is a note only because its maker has no tables here is a cause.
    """
    found = [each for each in result.diagnoses if each.rule != OF_THE_RECORDING]
    found += headlines(uncovered(result))
    causes = [
        each for each in found if each.severity != "note" or is_lowered(each.rule, each.severity)
    ]
    return sorted(causes, key=lambda each: -SEVERITIES.index(each.severity))


def concluded(result: CaptureResult) -> list[Diagnosis]:
    """What the capture lacks, what is wrong, and notes: what a reader should know, in this order."""
    causes = wrong(result)
    lacking = [each for each in result.diagnoses if each.rule == OF_THE_RECORDING]
    known = {id(each) for each in causes}
    notes = [
        each for each in result.diagnoses
        if each.rule != OF_THE_RECORDING and id(each) not in known
    ]  # fmt: skip
    return [*lacking, *causes, *notes]


def _shows_a_part(item: Diagnosis) -> bool:
    """Whether the capture lacks something. In disorder, nothing is missing."""
    return item.rule == OF_THE_RECORDING and item.args.get("what") != "disorder"


def _worst(result: CaptureResult, causes: list[Diagnosis], zone: Zone) -> tuple[int, Both] | None:
    """The first cause as a clause; a state of a drive with its end."""
    if not causes:
        return None
    first = causes[0]
    text = Both(*(escape(brief(first, lang)) for lang in LANGUAGES))
    if first.rule in ENDS and (over := _over(result.entire, first)) is not None:
        time = Clock.of(result.entire, zone).moment(over) if over else ""
        key = (
            "verdict_lasts" if not over else "verdict_until" if first.count == 1 else "verdict_last"
        )
        text = text.joined(say(key, time=time), ", ", "，")
    return SEVERITIES.index(first.severity), text


def _over(result: CaptureResult, item: Diagnosis) -> int | None:
    """When the state of a drive was over; 0 if the capture does not show its end, None if that is unknown."""
    where = item.args.get("device"), item.args.get("slot")
    for line in result.timelines:
        relation = result.relations[line.relation - 1]
        known = not (line.events_left_out or item.frames_left_out)
        if known and where == (relation.device, relation.slot):
            ends = (each for each in line.events if each.name == ENDS[item.rule])
            return next((each.time_ns for each in ends if each.frame > item.frames[-1]), 0)
    return None


def verdict(counts: VerdictCounts) -> Both:
    """One line, the worst first: `NOT OK: dp3 refuses its configuration; 2 more causes`."""
    parts = [counts.worst[1]] if counts.worst else []
    if counts.causes > 1:
        parts.append(say("verdict_more", n=counts.causes - 1))
    if counts.captures > 1 and counts.faulty:
        parts.append(say("verdict_captures", n=counts.faulty, of=counts.captures))
    if counts.failed or (counts.open and counts.level != "good"):
        parts += _failures(counts)
    cut = None if counts.jobs else _undecoded(counts.cut)
    if cut or not (parts or counts.in_part):
        there = None if counts.level == "none" else inventory(counts)
        parts.insert(0, cut or there or _nothing(counts))
    if counts.in_part and not cut:
        parts.append(say("verdict_in_part", n=counts.in_part))
    if counts.unreadable:
        parts.append(say("told_unreadable", n=counts.unreadable))
    tail = joined(parts, "; ", "；")
    head = say(f"verdict_{counts.level}")
    if counts.narrowed:
        head = (head if counts.level != "none" else say("verdict_good")).joined(
            say("verdict_shown"), ", ", "，"
        )
    return head.joined(tail, ": ", "：")


def _nothing(counts: VerdictCounts) -> Both:
    """What the capture has instead of transactions."""
    frames = say("frames", n=counts.frames)
    if counts.narrowed:
        return say("verdict_no_jobs")
    if counts.nothing < counts.captures:
        return joined([*(_who(counts) or [frames]), say("verdict_no_jobs")])
    key = "verdict_only_other_profinet" if counts.others["PROFINET"] else "verdict_nothing"
    text = joined([frames, say(key)])
    kinds = joined(
        [Both.same(f"{kind} {number:,}") for kind, number in counts.others.most_common()]
    )
    return text.joined(kinds, " (", "（").joined(Both("", ""), ")", "）") if counts.others else text


def _failures(counts: VerdictCounts) -> list[Both]:
    """How many transactions failed, and how many have an unknown outcome."""
    if counts.jobs == 1 and not counts.narrowed:
        return [say("verdict_failed_one" if counts.failed else "verdict_open_one")]
    of = f"{counts.jobs:,}"
    failed = [say("verdict_failed", n=counts.failed, of=of)] if counts.failed else []
    if not counts.open:
        return failed
    key = "verdict_open_too" if failed else "verdict_open"
    return [joined([*failed, say(key, n=counts.open, of=of)])]


def inventory(counts: VerdictCounts) -> Both | None:
    """What the capture has: `1 drive, 8 transactions, 4 ok, 1 partial`; None for nothing."""
    parts = _who(counts)
    if counts.jobs:
        ok = by_state(counts.states) if counts.failed or counts.open else []
        parts += [
            say("transactions", n=counts.jobs),
            *(ok or outcomes(counts.states, smooth=counts.smooth)),
        ]
    return joined(parts) if parts else None


def _cut(result: CaptureResult) -> Counter[tuple[str, int | None]]:
    """Messages that are cut, if the capture shows no record."""
    rpc = result.rpc.get("requests") or result.rpc.get("responses")
    word = "verdict_cut" if rpc else "verdict_cut_rpc"
    messages = [each.args for each in result.findings if each.args.get("what") == "cut"]
    return Counter(
        {(word, each.get("bytes")): each["count"] for each in messages if not result.records}
    )


def _undecoded(cut: Counter[tuple[str, int | None]]) -> Both | None:
    """Why record messages are no transactions; None if they are not cut, or have several lengths."""
    if len(cut) != 1:
        return None
    ((word, length),) = cut
    return None if length is None else say(word, n=cut.total(), bytes=str(length))


def _who(counts: VerdictCounts) -> list[Both]:
    """How many drives with transactions, drives in cyclic frames, PROFIBUS stations and S7 connections."""
    return [say(f"verdict_{what}", n=number) for what, number in counts.there.items()]


def outcomes(states: Counter[str], *, smooth: bool) -> list[Both]:
    """The states of transactions that are not ok. Without any, it says that all are done.

    If the capture is not `VerdictCounts.smooth`, it only says that all have a response.
    """
    return by_state(states, but=("ok",)) or [
        say("told_all_done" if smooth else "told_all_answered")
    ]


def by_state(states: Counter[str], but: tuple[str, ...] = ()) -> list[Both]:
    """`84 ok`, `3 error`: how many transactions have each state, in the order of the table."""
    words = [word for word in STATES if states[word] and word not in but]
    return [say("told_state", n=states[word], state=state(word)) for word in words]


def blind(result: CaptureResult) -> list[Both]:
    """What this capture cannot show, although others can: its silence proves nothing."""
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
    """Record calls at indices that carry no parameter channel here, and are not meant for one.

    DS209 counts those at index 47 that nothing shows to be ours. An IODWriteMultiple does not count, but the
    records in it do.
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
