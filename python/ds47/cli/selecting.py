"""The options that choose transactions, for `ds47 export` and `ds47 report`: by number, content, device and time.

Here: from words to a `Selection`. What a selection means is `ds47.report.selection`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta, timezone
from typing import Any, NamedTuple, TypeVar

import click

from ds47.cli.options import known_rules
from ds47.model import STATES
from ds47.profidrive import naming
from ds47.report.selection import Selection
from ds47.report.verdict import FAILED, OPEN
from ds47.report.zones import Zone
from ds47.spec.units import SECOND_NS

Function = TypeVar("Function", bound=Callable[..., Any])
_DAY = 86_400
_DAYS = 366
"""Days of a capture in which a time of day is looked for."""


class _Number(click.ParamType):  # type: ignore[type-arg]  # no generic before click 8.2
    """The number of a parameter in any spelling; an index behind it, as reports have it, means nothing."""

    name = "parameter"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        found = naming.spelled(str(value))
        if found is None:
            self.fail(f"{value!r} is not a parameter such as 1120, p1120 or r0945", param, ctx)
        return found.number


_FAILED, _OPEN, _NOT_OK = "failed", "outcome-unknown", "not-ok"


def _states(words: Sequence[str]) -> tuple[str, ...]:
    """The states of these words, each once."""
    several = {
        _FAILED: FAILED, _OPEN: OPEN, _NOT_OK: tuple(each for each in STATES if each != "ok"),
    }  # fmt: skip
    return tuple(dict.fromkeys(state for word in words for state in several.get(word, (word,))))


_OPTIONS = (
    click.option(
        "-t", "--transaction", "transactions", multiple=True, metavar="N",
        help="Numbers as in the report: 12, 3-7, 1,4,9.",
    ),
    click.option(
        "-r", "--rule", "rules", multiple=True, metavar="RULE",
        help="With this finding: DS410, DS4, or its name.",
    ),
    click.option(
        "-d", "--device", "devices", multiple=True, metavar="DEVICE",
        help="IP address, MAC address or station name; on PROFIBUS dp3.",
    ),
    click.option(
        "--do", "drive_objects", multiple=True, type=click.IntRange(0, 0xFFFF), metavar="N",
        help="Drive object, where the capture proves it.",
    ),
    click.option(
        "--pnu", "pnus", multiple=True, type=_Number(), metavar="N",
        help="Parameter: 1120, p1120 or r0945, with or without index.",
    ),
    click.option(
        "--station", "--controller", "stations", multiple=True, metavar="NAME",
        help="Who asks: IP address or station name of a controller.",
    ),
    click.option(
        "-s", "--state", "states", multiple=True, metavar="STATE",
        type=click.Choice((*STATES, _FAILED, _OPEN, _NOT_OK)),
        help="How it ended: ok, not-ok, failed (refused, error, partial or mismatch), outcome-unknown"
        " (unanswered, superseded or incomplete), orphan, or one of those in brackets.",
    ),
    click.option(
        "--from", "start", metavar="TIME",
        help="Start: 08:15, 08:15:00.5, ISO 8601, or seconds into the capture.",
    ),
    click.option("--to", "end", metavar="TIME", help="End, in the same forms."),
)  # fmt: skip


CRITERIA = (
    "transactions", "rules", "devices", "drive_objects", "pnus", "stations", "states", "start", "end",
)  # fmt: skip
"""Names of their values, as `chosen` takes them."""


def selection_options(function: Function) -> Function:
    """Adds --transaction, --rule, --device, --do, --pnu, --station, --state, --from and --to."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


_OF_DAY = "of day"


class _Moment(NamedTuple):
    """A point in time: nanoseconds since 1970, since the first frame, or since midnight."""

    ns: int
    kind: str


class Choice(NamedTuple):
    """What the options choose, in the times of any capture."""

    selection: Selection
    start: _Moment | None
    end: _Moment | None
    zone: Zone
    criteria: str
    """The options themselves."""

    def __bool__(self) -> bool:
        return bool(self.criteria)

    def refuse_backwards(self) -> None:
        """Refuses a span that ends before it begins.

        Times of day do so only where nothing was found: `--from 23:50 --to 00:10` is right for a capture that goes
        past midnight.

        Raises:
            click.UsageError: it is so.
        """
        if self.start and self.end and self.start > self.end and self.start.kind == self.end.kind:
            raise click.UsageError("--from is later than --to")

    @property
    def relative(self) -> bool:
        """Whether the time of the first frame is needed."""
        return any(each is not None and each.kind != "absolute" for each in (self.start, self.end))

    def of(self, first_ns: int | None, last_ns: int | None = None) -> Selection:
        """The selection in a capture with these times of the first and last frame."""
        start, end = (self._time(each, first_ns or 0, last_ns) for each in (self.start, self.end))
        return self.selection._replace(start=start, end=end)

    def _time(self, moment: _Moment | None, first_ns: int, last_ns: int | None) -> int | None:
        if moment is None or moment.kind == "absolute":
            return None if moment is None else moment.ns
        if moment.kind == "relative":
            return first_ns + moment.ns
        return self._of_day(moment.ns, first_ns, first_ns if last_ns is None else last_ns)

    def _of_day(self, ns: int, first_ns: int, last_ns: int) -> int:
        """A time of day: that of the first day on which the capture has it, else of its first day."""
        first = first_ns // SECOND_NS
        midnight = first - (first + self.zone.offset(first)) % _DAY
        for day in range(_DAYS):
            seconds = midnight + day * _DAY + ns // SECOND_NS
            # Not 0 where summer time began or ended.
            shifted = self.zone.offset(first) - self.zone.offset(seconds)
            found = (seconds + shifted) * SECOND_NS + ns % SECOND_NS
            if first_ns <= found <= last_ns:
                return found
            if found > last_ns:
                break
        return midnight * SECOND_NS + ns


def chosen(
    where: Zone, *, transactions: Sequence[str], rules: Sequence[str], devices: Sequence[str],
    drive_objects: Sequence[int], pnus: Sequence[int], stations: Sequence[str], states: Sequence[str],
    start: str | None, end: str | None, all_frames: bool = False,
) -> Choice:  # fmt: skip
    """The choice of the options.

    Raises:
        click.UsageError: words that say nothing.
    """
    selection = Selection(
        tuple(part for text in transactions for part in _numbers(text)), known_rules(rules), tuple(devices),
        _states(states), all_frames=all_frames, stations=tuple(stations), drive_objects=tuple(drive_objects),
        pnus=tuple(pnus),
    )  # fmt: skip
    typed = (
        ("--transaction", transactions), ("--rule", rules), ("--device", devices), ("--do", drive_objects),
        ("--pnu", pnus), ("--station", stations), ("--state", states), ("--from", [start] if start else ()),
        ("--to", [end] if end else ()),
    )  # fmt: skip
    given = [(name, str(each)) for name, values in typed for each in values]
    choice = Choice(
        selection, _moment("--from", start, where), _moment("--to", end, where), where, _as_typed(given)
    )  # fmt: skip
    if choice.start is not None and choice.start.kind != _OF_DAY:
        choice.refuse_backwards()
    return choice


def _as_typed(given: Sequence[tuple[str, str]]) -> str:
    """The options with their values, as they are typed."""
    if not given:
        return ""
    from ds47.spec.shell import shell_word  # few reports choose a part

    return " ".join(f"{name} {shell_word(value)}" for name, value in given)


def _numbers(text: str) -> Iterator[tuple[int, int]]:
    """`12`, `3-7`, `3..7`, `1,4,9`."""
    for part in text.split(","):
        match = re.fullmatch(r"\s*#?(\d+)\s*(?:(?:-|\.\.)\s*#?(\d+)\s*)?", part)
        if match is None:
            raise click.UsageError(f"--transaction {text!r}: numbers as 12, 3-7 or 1,4,9")
        first = int(match[1])
        last = int(match[2] or first)
        if last < first:
            raise click.UsageError(f"--transaction {text!r} runs backwards")
        yield first, last


def _moment(option: str, text: str | None, where: Zone) -> _Moment | None:
    """Seconds from the first frame, a time of day, or ISO 8601; up to nine digits of a second."""
    if text is None:
        return None
    if match := re.fullmatch(r"\s*(\d+)(?:\.(\d{1,9}))?\s*", text):
        return _Moment(int(match[1]) * SECOND_NS + _fraction(match[2]), "relative")
    if match := re.fullmatch(
        r"\s*([01]?\d|2[0-3]):([0-5]\d)(?::([0-5]\d)(?:[.,](\d{1,9}))?)?\s*", text
    ):
        seconds = int(match[1]) * 3600 + int(match[2]) * 60 + int(match[3] or 0)
        return _Moment(seconds * SECOND_NS + _fraction(match[4]), _OF_DAY)
    match = re.fullmatch(r"\s*(\d{4}-.*?)(?:[.,](\d{1,9}))?(Z|[+-]\d\d:?\d\d)?\s*", text)
    try:
        if match is None:
            raise ValueError
        when = datetime.fromisoformat(match[1] + (match[3] or ""))
    except ValueError as problem:
        raise click.UsageError(
            f"{option} {text!r} is not a time: 08:15:00, 2026-01-01T08:00:00.5, or seconds as 12.5"
        ) from problem
    return _Moment(_seconds(when, where) * SECOND_NS + _fraction(match[2]), "absolute")


def _seconds(when: datetime, where: Zone) -> int:
    """Since 1970; a time without its offset is one in the zone."""
    there = when if when.tzinfo else when.replace(tzinfo=timezone(timedelta()))
    seconds = int(there.timestamp())
    if when.tzinfo:
        return seconds
    ahead = where.offset(seconds - where.offset(seconds))
    return seconds - ahead


def _fraction(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0"))
