"""What went wrong and what to do: the diagnoses, then the findings that none of them covers.

The serious come first; findings are put together by what the drive or the device says.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ds47 import spec
from ds47.findings.grouping import cause
from ds47.model import (
    DIAGNOSIS,
    SEVERITIES,
    CaptureResult,
    Diagnosis,
    Finding,
    ParameterError,
    Transaction,
)
from ds47.profidrive.naming import spelling
from ds47.report.filters import display_filter
from ds47.report.formatting import address
from ds47.report.html import messages
from ds47.report.html.texts import Both, joined, say
from ds47.report.html.views.links import FrameLink, Links
from ds47.report.html.views.times import FrameClock
from ds47.report.targets import Targets
from ds47.report.todo import OfState, answering, by_state, is_lowered, of_state, uncovered

if TYPE_CHECKING:
    from ds47.diagnosis.suggest import Corrected

FIRST_SCREEN = 6
"""Problems on the first screen."""
OF_ONE_RULE = 3
"""Of these, as many of one rule; more where there is room."""
LOCATIONS = 4
"""The most locations that a problem names."""
_DRIVE_ERROR, _READ_REFUSED, _WRITE_REFUSED = "DS410", "DS201", "DS203"


@dataclass(slots=True)
class Problem:
    """One thing that went wrong, however often."""

    rule: str
    severity: str
    what: Both
    args: Mapping[str, Any]
    count: int = 0
    locations: Counter[str] = field(default_factory=Counter)
    alike: bool = True
    """Whether `what` is true of all of them; else it is an example."""
    frames: set[int] = field(default_factory=set)
    """The frames where it shows."""
    left_out: int = 0
    """Further ones, for which there was no room."""
    job: int | None = None
    """That of the first frame, to look at."""
    time: str = ""
    """When that job began, or the frame was; empty where that is not known."""
    others: list[FrameLink] = field(default_factory=list)
    """Further frames that the title is about."""
    state: Both | None = None
    """What the status word of the drive says of it."""
    request: bytes | None = None
    """The request as it should have been, where a diagnosis knows it."""
    family: str | None = None
    """The family of its drive's parameters."""
    request_of: int | None = None
    """The job of that request."""

    @property
    def frame(self) -> int | None:
        """The first one, to look at."""
        return min(self.frames, default=None)

    @property
    def filter(self) -> str:
        """A display filter that shows the frames."""
        return display_filter(self.frames)[0]

    @property
    def filter_left_out(self) -> int:
        """Frames for which the filter has no room."""
        return display_filter(self.frames)[1] + self.left_out

    @property
    def times(self) -> Both:
        """How often, as many as the filter shows frames; where these are two numbers, both."""
        times, frames = say("times", n=self.count), len(self.frames) + self.left_out
        if self.count in (1, frames):
            return times
        return say("times_in", times=times, frames=say("frames", n=frames))

    @property
    def title(self) -> Both:
        """What went wrong, in a line."""
        return self.what if self.alike else say("for_example", text=self.what)

    @property
    def advice(self) -> Both:
        """What to do."""
        if is_lowered(self.rule, self.severity):
            return say("advice_foreign")
        return messages.advice(self.rule, self.args)

    @property
    def corrected(self) -> Corrected | None:
        """The same in the forms in which it can be used."""
        if self.request is None:
            return None
        from ds47.diagnosis.suggest import corrected  # only here: most captures need no correction

        return corrected(self.request, self.family)

    @property
    def where(self) -> Both | None:
        """Where it shows most: parameters, drive objects, devices."""
        if not self.locations:
            return None
        shown = [Both.same(each) for each, _ in self.locations.most_common(LOCATIONS)]
        more = len(self.locations) - LOCATIONS
        text = joined(shown, ", ", "、")
        return text.joined(say("and_more", n=more), ", ", "，") if more > 0 else text


def problems(
    result: CaptureResult,
    targets: Targets | None = None,
    moments: FrameClock | None = None,
    links: Links | None = None,
) -> list[Problem]:
    """The problems of a capture, with their times where `moments` has these; findings that are notes are none."""
    found, links, said = [], links or Links(result), of_state(result)
    for each in result.diagnoses:
        problem = _diagnosed(each, links, said)
        if axes := answering(result, each):
            problem.what = problem.what.joined(say("answering", list=axes), "; ", "；")
        found.append(problem)
    found += _others(result, targets or Targets(result.evidence), said)
    if moments is not None:
        for problem in found:
            problem.time = moments.moment(problem.frame)
    return sorted(found, key=_serious_first)


def _diagnosed(item: Diagnosis, links: Links, said: OfState) -> Problem:
    row = spec.rules().get(item.rule)
    named = row.named_frames(item.args) if row else []
    first = item.frames[:1]
    return Problem(
        item.rule,
        item.severity,
        messages.message(item),
        item.args,
        item.count,
        Counter([item.device] if item.device else []),
        frames=set(item.frames),
        left_out=item.frames_left_out,
        job=item.transactions[0] if item.transactions else None,
        others=links.of(frame for frame in named if frame not in first),
        state=_state(by_state(said, item.transactions)),
        request=item.corrected,
        family=item.args.get("family"),
        request_of=item.corrected_in,
    )


def _others(result: CaptureResult, targets: Targets, said: OfState) -> Iterable[Problem]:
    """The findings that no diagnosis covers, by their cause."""
    by_id = {each.id: each for each in result.transactions}
    found: dict[tuple[str, object], Problem] = {}
    jobs: defaultdict[tuple[str, object], set[int]] = defaultdict(set)
    for finding in uncovered(result):
        owner = by_id.get(finding.transaction) if finding.transaction is not None else None
        key, what = _kind(finding, owner)
        new = Problem(finding.rule, finding.severity, what, finding.args, job=finding.transaction)
        problem = found.setdefault(key, new)
        problem.count += 1
        problem.frames.update(finding.counted)
        problem.alike &= what == problem.what
        if owner is not None:
            jobs[key].add(owner.id)
            problem.locations[_location(owner, finding.args, targets.where(owner))] += 1
    for key, problem in found.items():
        problem.state = _state(by_state(said, jobs[key]))
    return found.values()


def _state(said: Finding | None) -> Both | None:
    if said is None:
        return None
    return say("state_says", job=said.transaction, message=messages.message(said))


def first_screen(items: list[Problem]) -> list[Problem]:
    """The problems to show first: a drive that refuses in many ways must not hide the rest."""
    rules: Counter[str] = Counter()
    chosen: list[Problem] = []
    spare: list[Problem] = []
    for item in items:
        rules[item.rule] += 1
        (chosen if rules[item.rule] <= OF_ONE_RULE else spare).append(item)
    return sorted((chosen + spare)[:FIRST_SCREEN], key=_serious_first)


def _serious_first(item: Problem) -> tuple[bool, bool, int, int, str]:
    """Diagnoses before other findings, but a note behind all that went wrong; equals as in the verdict."""
    note, diagnosed = item.severity == "note", item.rule.startswith(DIAGNOSIS)
    rule = "" if diagnosed else item.rule
    return (note, not diagnosed, -SEVERITIES.index(item.severity), -item.count, rule)


def _kind(finding: Finding, owner: Transaction | None) -> tuple[tuple[str, object], Both]:
    """What the finding is counted with, and its words: the drive says itself what is wrong."""
    if owner is not None and finding.rule in (_READ_REFUSED, _WRITE_REFUSED):
        write = finding.rule == _WRITE_REFUSED
        word = owner.write_status if write else owner.read_status
        if word is not None:
            text = messages.status(word).joined(Both.same(f" ({word:08X})"), "", "")
            return (finding.rule, word), say(
                "write_refused" if write else "read_refused", text=text
            )
    code = finding.args.get("code")
    if owner is not None and finding.rule == _DRIVE_ERROR and code is not None:
        text, change = _error(code, finding.args.get("vendor_id")), owner.operation == "change"
        key = "drive_error_change" if change else "drive_error_read"
        return (finding.rule, (code, text, change)), say(key, text=text)
    about = cause(finding.rule, None, finding.args), finding.severity
    return (finding.rule, about), messages.message(finding)


def _error(code: int, vendor_id: int | None) -> Both:
    """An error number in words, with the number behind where they do not name it."""
    text, number = messages.error(ParameterError(code, None, vendor_id)), spec.error_hex(code)
    return text if number in text.en else text.joined(Both.same(f" ({number})"), "", "")


def _location(item: Transaction, named: Mapping[str, Any], where: str) -> str:
    """The parameter that the finding is about, else the first of the job; then the drive object."""
    axis = f" {where}" if where else ""
    if named.get("pnu") is not None:
        index = f"[{named['subindex']}]" if named.get("subindex") is not None else ""
        return f"{spelling(named['pnu'], named.get('family'))}{index}{axis}"
    if item.parameters:
        return address(item.parameters[0]) + axis
    return item.device + axis
