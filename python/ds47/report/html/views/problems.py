"""What went wrong and what to do: the diagnoses, then the findings that none of them covers.

The serious come first; findings are put together by what the drive or the device says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ds47 import spec
from ds47.model import DIAGNOSIS, SEVERITIES, CaptureResult, Diagnosis, Finding, Transaction
from ds47.report.filters import display_filter
from ds47.report.html import messages
from ds47.report.html.texts import Both, joined, say
from ds47.report.todo import answering, uncovered
from ds47.report.words import address

if TYPE_CHECKING:
    from ds47.diagnosis.suggest import Corrected

FIRST_SCREEN = 6
"""Problems on the first screen."""
OF_ONE_RULE = 3
"""Of these, as many of one rule; more where there is room."""
PLACES = 4
"""Places named of one problem."""
_DRIVE_ERROR, _READ_REFUSED, _WRITE_REFUSED = "DS410", "DS201", "DS203"


@dataclass(slots=True)
class Problem:
    """One thing that went wrong, however often."""

    rule: str
    severity: str
    what: Both
    count: int = 0
    places: Counter[str] = field(default_factory=Counter)
    alike: bool = True
    """Whether `what` is true of all of them; else it is an example."""
    frame: int | None = None
    """The first one, to look at."""
    job: int | None = None
    filter: str = ""
    request: bytes | None = None
    """The request as it should have been, where a diagnosis knows it."""

    @property
    def title(self) -> Both:
        """What went wrong, in a line."""
        return self.what if self.alike else say("for_example", text=self.what)

    @property
    def advice(self) -> Both:
        """What to do."""
        return messages.advice(self.rule)

    @property
    def corrected(self) -> Corrected | None:
        """The same in the forms in which it can be used."""
        if self.request is None:
            return None
        from ds47.diagnosis.suggest import corrected  # only here: most captures need no correction

        return corrected(self.request)

    @property
    def where(self) -> Both | None:
        """The places where it shows most: parameters, drive objects, devices."""
        if not self.places:
            return None
        shown = [Both.same(place) for place, _ in self.places.most_common(PLACES)]
        more = len(self.places) - PLACES
        text = joined(shown, ", ", "、")
        return text.joined(say("and_more", n=more), ", ", "，") if more > 0 else text


def problems(result: CaptureResult, vendors: Mapping[str, int | None]) -> list[Problem]:
    """The problems of a capture; findings that are notes are none."""
    told = []
    for each in result.diagnoses:
        problem = _diagnosed(each)
        if axes := answering(result, each):
            problem.what = problem.what.joined(say("answering", list=axes), "; ", "；")
        told.append(problem)
    return sorted([*told, *_others(result, vendors)], key=_serious_first)


def _diagnosed(item: Diagnosis) -> Problem:
    return Problem(
        item.rule,
        item.severity,
        messages.message(item),
        item.count,
        Counter([item.device] if item.device else []),
        frame=item.frames[0] if item.frames else None,
        job=item.transactions[0] if item.transactions else None,
        filter=display_filter(item.frames)[0],
        request=item.corrected,
    )


def _others(result: CaptureResult, vendors: Mapping[str, int | None]) -> Iterable[Problem]:
    """The findings that no diagnosis covers, by their cause."""
    by_id = {each.id: each for each in result.transactions}
    found: dict[tuple[str, object], Problem] = {}
    errors_of: set[int] = set()
    for finding in uncovered(result):
        owner = by_id.get(finding.transaction) if finding.transaction is not None else None
        if finding.rule == _DRIVE_ERROR and owner is not None:
            if owner.id not in errors_of:
                errors_of.add(owner.id)
                _drive_errors(found, owner, finding, vendors.get(owner.device))
            continue
        key, what = _kind(finding, owner)
        problem = found.setdefault(key, _problem(finding, what))
        problem.count += 1
        problem.alike &= what == problem.what
        if owner is not None:
            problem.places[_place(owner, finding.args)] += 1
    return found.values()


def _problem(finding: Finding, what: Both) -> Problem:
    return Problem(
        finding.rule,
        finding.severity,
        what,
        frame=finding.frame,
        job=finding.transaction,
        filter=finding.filter,
    )


def first_screen(items: list[Problem]) -> list[Problem]:
    """The problems that are told first: a drive that refuses in many ways does not hide the rest."""
    rules: Counter[str] = Counter()
    chosen: list[Problem] = []
    spare: list[Problem] = []
    for item in items:
        rules[item.rule] += 1
        (chosen if rules[item.rule] <= OF_ONE_RULE else spare).append(item)
    return sorted((chosen + spare)[:FIRST_SCREEN], key=_serious_first)


def _serious_first(item: Problem) -> tuple[bool, bool, int, int]:
    """Diagnoses before other findings, but a note behind all that went wrong."""
    note, diagnosed = item.severity == "note", item.rule.startswith(DIAGNOSIS)
    return (note, not diagnosed, -SEVERITIES.index(item.severity), -item.count)


def _drive_errors(
    found: dict[tuple[str, object], Problem],
    owner: Transaction,
    finding: Finding,
    vendor: int | None,
) -> None:
    """One problem for each error number: the drive says itself what is wrong."""
    change = owner.operation == "change"
    for item in owner.parameters:
        if item.error is None:
            continue
        code = item.error.code
        text = messages.error(code, item.error.text, vendor)
        number = "" if code is None else f" ({spec.error_hex(code)})"
        if code is not None and spec.error_hex(code) in text.en:
            number = ""  # the text names it already
        key = "drive_error_change" if change else "drive_error_read"
        what = say(key, text=text.joined(Both.same(number), "", ""))
        problem = found.setdefault((finding.rule, (code, text, change)), _problem(finding, what))
        problem.count += 1
        axis = "" if owner.axis is None else f" DO {owner.axis}"
        problem.places[address(item) + axis] += 1


def _kind(finding: Finding, owner: Transaction | None) -> tuple[tuple[str, object], Both]:
    """What the finding is counted with, and its words."""
    if owner is not None and finding.rule in (_READ_REFUSED, _WRITE_REFUSED):
        write = finding.rule == _WRITE_REFUSED
        word = owner.write_status if write else owner.read_status
        if word is not None:
            text = messages.status(word).joined(Both.same(f" ({word:08X})"), "", "")
            return (finding.rule, word), say(
                "write_refused" if write else "read_refused", text=text
            )
    return (finding.rule, ""), messages.message(finding)


def _place(item: Transaction, named: Mapping[str, Any]) -> str:
    """The parameter that the finding is about, else the first of the job; then the drive object."""
    axis = "" if item.axis is None else f" DO {item.axis}"
    if named.get("pnu") is not None:
        index = f"[{named['subindex']}]" if named.get("subindex") is not None else ""
        return f"p{named['pnu']}{index}{axis}"
    if item.parameters:
        return address(item.parameters[0]) + axis
    return item.device + axis
