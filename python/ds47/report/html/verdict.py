"""The quality of a capture in words: how far it can be trusted.

Counted from the result model; the words are in texts.toml. The verdict itself is that of every report
(`ds47.report.verdict`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from ds47.model import Bus, CaptureResult
from ds47.report.formatting import escape
from ds47.report.html.texts import Both, say


@dataclass(frozen=True, slots=True)
class VerdictLine:
    """A line about the capture: `level` is one of `ds47.report.verdict.LEVELS`."""

    level: str
    text: Both


def quality(result: CaptureResult) -> list[VerdictLine]:
    """How far the capture can be trusted."""
    rules = Counter(each.rule for each in result.findings)
    return [
        _complete(result),
        *_series(result),
        _dropped(result),
        *(_line(result.bus, result) if result.bus else [_directions(result)]),
        *_flaws(rules),
    ]


def _complete(result: CaptureResult) -> VerdictLine:
    frames = say("frames", n=result.frames)
    if result.complete:
        return VerdictLine("good", say("complete", frames=frames))
    problem = Both.same(escape(result.problem)) if result.problem else say("ends_early")
    return VerdictLine("bad", say("incomplete", problem=problem, frames=frames))


def _series(result: CaptureResult) -> Iterator[VerdictLine]:
    if result.files:
        yield VerdictLine("good", say("series", n=len(result.files)))
    missing = sum(each.missing_before for each in result.files[1:])
    if missing:
        yield VerdictLine("bad", say("series_missing", n=missing))


def _dropped(result: CaptureResult) -> VerdictLine:
    if result.dropped is None:
        return VerdictLine("none", say("dropped_unknown"))
    if result.dropped:
        return VerdictLine("bad", say("dropped", n=result.dropped))
    return VerdictLine("good", say("dropped_none"))


_ONE_WAY = ("only_requests", "only_responses")


def _directions(result: CaptureResult) -> VerdictLine:
    """What the calls of all stations say, but for stations of which only one direction is there (DS725)."""
    one_way = [each.args for each in result.diagnoses if each.args.get("what") in _ONE_WAY]
    if one_way:
        what = one_way[0]["what"]
        number = sum(each["count"] or 0 for each in one_way if each["what"] == what)
        return VerdictLine("bad", say(what, n=number))
    asked = result.rpc.get("requests", 0)
    answered = sum(result.rpc.get(key, 0) for key in ("responses", "faults", "rejects"))
    if not asked and not answered:
        return VerdictLine("none", say("no_calls"))
    if not answered:
        return VerdictLine("bad", say("only_requests", n=asked))
    if not asked:
        return VerdictLine("bad", say("only_responses", n=answered))
    missing = result.rpc.get("unanswered", 0)
    if missing:
        return VerdictLine("warn", say("some_unanswered", n=missing, asked=asked))
    return VerdictLine(
        "good", say("both_directions", n=asked, answered=say("responses_some", n=answered))
    )


def _line(bus: Bus, result: CaptureResult) -> Iterator[VerdictLine]:
    """Of a line of PROFIBUS: whether answers, start-up and whole frames are there."""
    asked = [each for each in bus.stations if each.requests]
    requests = sum(each.requests for each in asked)
    lost = (each.args for each in result.diagnoses if each.args.get("what") == "bus_answers")
    silent = sum(each.unanswered for each in asked) + sum(each["count"] for each in lost)
    if requests and not any(
        each.exchanges or each.answer or each.parameters or each.diagnosis for each in asked
    ):
        yield VerdictLine("bad", say("bus_only_requests", n=requests))
    elif silent:
        yield VerdictLine("warn", say("bus_some_unanswered", n=silent, of=requests))
    elif requests:
        yield VerdictLine("good", say("bus_answered", n=requests))
    missing = sum(None in (each.parameters, each.configuration) for each in asked)
    if missing:
        yield VerdictLine("none", say("bus_no_start_up", n=len(asked), missing=missing))
    elif asked:
        yield VerdictLine("good", say("bus_start_up", n=len(asked)))
    if bus.damaged:
        yield VerdictLine("warn", say("bus_damaged", n=bus.damaged))


def _flaws(rules: Counter[str]) -> Iterator[VerdictLine]:
    for rule, key in (
        ("DS106", "frames_cut"),
        ("DS105", "fragments_missing"),
        ("DS103", "sent_again"),
        ("DS107", "clock_back"),
        ("DS403", "starts_late"),
    ):
        if rules[rule]:
            yield VerdictLine("warn", say(key, n=rules[rule]))
