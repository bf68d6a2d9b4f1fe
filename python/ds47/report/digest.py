"""A capture in short: its verdict, the worst causes with what to do, who is there, and when.

What stands first in every short form is decided here: the text on a terminal, `--summary`, Markdown, and the page
on one sheet. Words and lines are theirs. Nothing here is cut: who has no room cuts.
"""

from __future__ import annotations

from collections import Counter
from operator import attrgetter
from typing import NamedTuple

from ds47.model import S7, CaptureResult, Device, Diagnosis
from ds47.report import ReportOptions
from ds47.report.bilingual import LANGUAGES, Both, joined, say
from ds47.report.clock import Clock, seen_at
from ds47.report.file_frames import FileFrames
from ds47.report.formatting import escape
from ds47.report.sentences import advice, brief, sentence
from ds47.report.targets import Telegrams
from ds47.report.todo import is_lowered
from ds47.report.verdict import VerdictCounts, concluded, inventory, outcomes, verdict
from ds47.report.wrap import columns
from ds47.spec import rules


class ShortCause(NamedTuple):
    """A cause, and the first frame that shows it."""

    rule: str
    severity: str
    message: Both
    brief: Both
    """The same as a clause."""
    advice: Both
    times: Both | None
    """How often, if more than once, and how many more causes are `alike`."""
    findings: int
    alike: int
    """Causes of the same rule that are not among those of the digest."""
    frame: int | None
    transaction: int | None
    number: Both | None
    """`22`, in a series `22 (3 of night_0002.pcapng)`; None where no frame shows it."""
    where: Both | None
    """`22 (#5, 08:00:00.791)`."""


class Who(NamedTuple):
    """A drive, and what became of its transactions."""

    device: Device
    total: Both
    """How many transactions there are,"""
    transactions: Both
    """the same with their outcomes."""
    telegram: Both | None = None

    def words(self, lang: str, between: str = "  ") -> str:
        """`8 transactions, 1 partial  DO 3: telegram 102 without PKW`."""
        told = (self.transactions, self.telegram)
        return between.join(each.text(lang) for each in told if each is not None)


class Digest(NamedTuple):
    """What there is to say; `left_out` are causes that are not among `causes`, and not `alike` to one of them."""

    path: str
    level: str
    verdict: Both
    there: Both | None
    when: Both | None
    narrowed: Both | None
    """Which part of the capture is shown; None for all of it."""
    expected: Both | None
    """What it shows of the parameters in a golden list; None without one."""
    start: str | None
    """Times of the first and the last frame, as in the JSON of a report."""
    end: str | None
    causes: list[ShortCause]
    left_out: int
    drives: list[Who]
    counts: VerdictCounts

    @classmethod
    def of(
        cls,
        result: CaptureResult,
        options: ReportOptions,
        most: int,
        counts: VerdictCounts | None = None,
    ) -> Digest:
        """That of a capture, with at most so many causes; `counts` are its own."""
        counts = counts or VerdictCounts.of(result, options.zone)
        clock = Clock.of(result, options.zone)
        shown, left_out = _of_every_kind(concluded(result), most)
        alike = Counter(each.rule for each in left_out)
        several = len({each.device for each in result.transactions}) > 1
        files, times = FileFrames(result.files), seen_at(result)
        return cls(
            result.path,
            counts.level,
            verdict(counts),
            inventory(counts) if counts.level != "good" else None,
            clock.span(result),
            _narrowed(result),
            _expected(result),
            result.start,
            result.end,
            [_short(each, alike.pop(each.rule, 0), several, files, clock, times) for each in shown],
            alike.total(),
            who(result, counts),
            counts,
        )


def _of_every_kind(found: list[Diagnosis], most: int) -> tuple[list[Diagnosis], list[Diagnosis]]:
    """Of causes, the worst first, those to show, and the others: of each rule one comes before a second of any."""
    first = {each.rule: at for at, each in reversed([*enumerate(found)])}
    ranks = sorted(range(len(found)), key=lambda at: first[found[at].rule] != at)
    shown = sorted(ranks[:most])
    return [found[at] for at in shown], [found[at] for at in sorted(ranks[most:])]


def _narrowed(result: CaptureResult) -> Both | None:
    if result.narrowed is None:
        return None
    from ds47.report.narrowing import narrowed_words  # few reports are

    return narrowed_words(result)


def _expected(result: CaptureResult) -> Both | None:
    if result.expected is None:
        return None
    from ds47.report.expected import expected_words  # few reports are compared

    return expected_words(result.expected)


def _short(
    item: Diagnosis,
    alike: int,
    several: bool,
    files: FileFrames,
    clock: Clock,
    times: dict[int, int],
) -> ShortCause:
    frame = item.frames[0] if item.frames else None
    job = item.transactions[0] if item.transactions else None
    texts = (sentence(item, lang) for lang in LANGUAGES)
    message = Both(*map(escape, texts))
    clause = Both(*(escape(brief(item, lang)) for lang in LANGUAGES))
    if several and item.device and item.device not in message.en:
        message = say("cause_device", device=escape(item.device), message=message)
    number = where = None
    if frame is not None:
        about = [f"#{job}"] if job is not None else []
        about += [clock.moment(times[frame])] if frame in times else []
        number = Both(*(escape(files.number(frame, lang)) for lang in LANGUAGES))
        where = say("frame_about", frame=number, about=", ".join(about)) if about else number
    often = [
        each for each in (times_of(item), say("short_alike", n=alike) if alike else None) if each
    ]
    return ShortCause(
        item.rule, item.severity, message, clause, _advice(item), joined(often, " ", "") if often else None,
        item.count, alike, frame, job, number, where,
    )  # fmt: skip


def times_of(item: Diagnosis) -> Both | None:
    """How often, as many as there are frames; if these are two numbers, both."""
    frames = len(item.frames) + item.frames_left_out
    if item.count not in (1, frames):
        return say(
            "cause_times_in", times=say("times", n=item.count), frames=say("frames", n=frames)
        )
    return say("cause_times", n=item.count) if item.count > 1 else None


def _advice(item: Diagnosis) -> Both:
    if is_lowered(item.rule, item.severity):
        return say("advice_foreign")
    return Both.of(advice, rules()[item.rule], item.args)


def who(result: CaptureResult, counts: VerdictCounts) -> list[Who]:
    """The drives, in the order in which they are met, with the states of their transactions."""
    jobs = [each for each in result.transactions if each.channel != S7]
    devices: dict[str, Device] = {}
    states: dict[str, Counter[str]] = {}
    telegrams = Telegrams(result)
    named = result.named()
    for (name, state), number in Counter(map(attrgetter("device", "state"), jobs)).items():
        device = named(name)
        devices.setdefault(device.ip, device)
        states.setdefault(device.ip, Counter())[state] += number
    found = []
    for ip, device in devices.items():
        total = say("transactions", n=states[ip].total())
        told = joined([total, *outcomes(states[ip], smooth=counts.smooth)])
        found.append(Who(device, total, told, telegrams.words(ip)))
    return found


def first_sentences(text: str, room: int) -> str:
    """As many whole sentences as have room, at least the first one."""
    end = 0
    for at, character in enumerate(text, 1):
        ends = character in "。" or (character == "." and text[at : at + 1] in ("", " "))
        if ends and (not end or columns(text[:at]) <= room):
            end = at
    return text[:end] if end else text
