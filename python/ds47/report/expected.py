"""Whether the parameters in a capture are as a golden list has them: findings DS602, and how many were seen.

The list is `ds47.parameters.expected`, the last value of each element `ds47.report.trail`. A value that no frame
shows is no finding.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Final

from ds47.findings.collection import Findings
from ds47.findings.remark import Remark
from ds47.model import CaptureResult, Expected, Finding, Transaction, Value
from ds47.parameters.expected import Expectation
from ds47.report import handed_out
from ds47.report.bilingual import Both, joined, say
from ds47.report.formatting import escape
from ds47.report.parameters import ElementRow, rows
from ds47.report.selection import listed

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions, OnTransaction

DIFFERS: Final = "DS602"
ExpectedList = tuple[Expectation, ...]


def judged(
    result: CaptureResult,
    expected: ExpectedList,
    options: AnalysisOptions,
    on_transaction: OnTransaction | None = None,
) -> CaptureResult:
    """A complete result with what is not as expected; transactions are handed out, where somebody takes them."""
    found = _Comparison(result, expected)
    collected = Findings(options.select, options.ignore)
    if collected.wanted(DIFFERS):
        owners = {each.id: each for each in result.transactions}
        for row, one in found.wrong:
            result.findings.append(_finding(collected, owners, found.where(row), row, one))
        result.findings.sort(key=lambda f: (f.frame, f.rule, f.transaction or 0, f.offset or 0))
    result.expected = found.counts()
    return result if on_transaction is None else handed_out(result, on_transaction)


class _Comparison:
    """Each element that a capture shows, compared with the row that says most exactly what it should be."""

    def __init__(self, result: CaptureResult, expected: ExpectedList) -> None:
        self.wrong: list[tuple[ElementRow, Expectation]] = []
        self._list = expected
        self._devices = {each.ip: each for each in result.devices}
        named = result.named()
        for item in result.transactions:
            self._devices.setdefault(item.device, named(item.device))
        by_pnu: defaultdict[int, list[Expectation]] = defaultdict(list)
        for each in expected:
            by_pnu[each.pnu].append(each)
        self._seen = 0
        self._met: set[Expectation] = set()
        self._ways: defaultdict[tuple[str, int | None], set[str]] = defaultdict(set)
        for row in rows(result):
            self._ways[row.device, row.drive_object].add(row.target)
            if row.element.last is None:
                continue
            meant = [each for each in by_pnu.get(row.pnu, ()) if self._is_about(each, row)]
            if meant:
                self._met.update(meant)
                self._compare(row, max(reversed(meant), key=lambda each: each.rank))

    def _is_about(self, each: Expectation, row: ElementRow) -> bool:
        if each.subindex not in (None, row.subindex) or not each.is_of(self._devices[row.device]):
            return False
        if not row.target:  # of the device, whichever drive object is asked
            return True
        return each.drive_object in (None, row.drive_object) and each.target in ("", row.target)

    def _compare(self, row: ElementRow, one: Expectation) -> None:
        self._seen += 1
        last = row.element.last
        assert last is not None
        if not one.wanted.fits(_value(row, one), last.format):
            self.wrong.append((row, one))

    def where(self, row: ElementRow) -> str:
        """The device with the drive object; its submodule, too, where another one may have the same number."""
        alone = row.drive_object is not None and len(self._ways[row.device, row.drive_object]) == 1
        target = f"DO {row.drive_object}" if alone else row.target
        return f"{row.device} {target}".rstrip()

    def counts(self) -> Expected:
        """How many were seen, of those that are expected of a drive in this capture."""
        unseen, absent = 0, set[str]()
        for each in self._list:
            if each in self._met:
                continue
            named = each.station or each.drive
            if not named or any(map(each.is_of, self._devices.values())):
                unseen += 1
            else:
                absent.add(named)
        return Expected(self._seen + unseen, self._seen, len(self.wrong), sorted(absent))


def _value(row: ElementRow, one: Expectation) -> Value:
    """The last value, as the row means it."""
    last = row.element.last
    assert last is not None
    return last.value if one.raw or last.scaled is None else last.scaled


def _finding(
    collected: Findings,
    owners: dict[int, Transaction],
    where: str,
    row: ElementRow,
    one: Expectation,
) -> Finding:
    last = row.element.last
    assert last is not None
    owner = owners[last.transaction]
    asked = [*owner.parameters, *(each.parameter for each in owner.items if each.parameter)]
    args = {
        "device": row.device,
        "where": where,
        "pnu": row.pnu,
        "subindex": row.subindex,
        "value": _value(row, one),
        "expected": one.wanted.text,
        "how": f"expected_{last.how}",
        "by": last.frame,
        "family": next((each.family for each in asked if each.pnu == row.pnu), None),
    }
    time = None if owner.duration_ns is None else owner.start_ns + owner.duration_ns
    found = collected.finding(Remark(DIFFERS, last.frame, args, time_ns=time), owner.id)
    if DIFFERS not in owner.findings:
        owner.findings.append(DIFFERS)
        owner.findings.sort()
    return found


def expected_words(about: Expected) -> Both:
    """`12 of 40 expected parameters appear in the capture; 2 are not as expected`, and which drives do not."""
    told = []
    if about.parameters:
        told.append(say("expected_seen", seen=about.seen, n=about.parameters))
    if about.seen:
        told.append(say("expected_wrong" if about.wrong else "expected_right", n=about.wrong))
    if about.absent:
        told.append(say("expected_absent", drives=escape(listed(about.absent))))
    return joined(told, "; ", "；")
