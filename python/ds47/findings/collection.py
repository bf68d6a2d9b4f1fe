"""Remarks to findings: which are wanted, which transaction they belong to, which frames they are about.

Nothing is judged here; a `Remark` comes from the judges of the channels and from `ds47.diagnosis`. Nothing is
worded here either: that is `ds47.report.sentences`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from ds47.findings.grouping import OF_THE_RECORDING, Grouping, cause
from ds47.findings.remark import Remark
from ds47.findings.times import FrameTimes
from ds47.model import DIAGNOSIS, DS47, PKW, PZD, S7, Diagnosis, Finding, Transaction
from ds47.spec import rules

NOTE: Final = "note"


_RULES = {PKW: ("DS50", "DS51"), PZD: ("DS52", "DS53"), S7: ("DS9",)}
"""The prefixes of the rules about a channel; most other rules are about record calls."""


def rules_of_others(channels: Sequence[str]) -> tuple[str, ...]:
    """The prefixes of the rules that are about none of these channels."""
    left = [each for channel, ids in _RULES.items() if channel not in channels for each in ids]
    if DS47 not in channels:
        left += [each for each in rules() if each[2] in "12347" and each != OF_THE_RECORDING]
    return tuple(left)


class Findings:
    """Collects remarks and makes findings of them.

    Remarks are kept until `result`, unless `found` takes them: some 0.6 kB for a finding that belongs to no
    transaction, because the end of a capture reports all findings in the order of their frames.

    Args:
        select: rule ids or prefixes that are wanted; empty for all.
        ignore: rule ids or prefixes that are not wanted.
        others: those of rules about channels that are not wanted.
        found: gets each finding at once; then none is kept for `result`.
        times: when frames were.
        most: of each rule so many findings are kept that belong to no transaction; the others are counted.
    """

    def __init__(
        self,
        select: tuple[str, ...],
        ignore: tuple[str, ...],
        found: Callable[[Finding], None] | None = None,
        times: FrameTimes | None = None,
        most: int | None = None,
        others: tuple[str, ...] = (),
    ) -> None:
        self._found = found
        self._select = select
        self._ignore = ignore
        self._others = others
        self._times = times or FrameTimes(0)
        self._most = most
        self._alone: Counter[str] = Counter()
        """Rule -> how many of its findings belong to no transaction."""
        self.left_out = [0, 0]
        """The frame of the first of them for which there was no room, and how many there are."""
        self._remarks: list[Remark] = []
        self._grouping = Grouping()
        self.frames_dropped = False
        """Whether the capture says that frames are missing; unanswered and orphan say so then."""

    def add(self, remark: Remark, *, of_all: bool = False) -> None:
        """Keeps a remark for `result`, or reports it at once, if its rule is wanted; `of_all`: of any channel."""
        if not (self._asked_for(remark.rule) if of_all else self.wanted(remark.rule)):
            return
        remark.time_ns = self._times.of(remark.frame)
        if self._found is not None:
            self._found(self.reported(remark))
        elif remark.job is not None or self._has_room(remark):
            self._remarks.append(remark)

    def _has_room(self, remark: Remark) -> bool:
        self._alone[remark.rule] += 1
        if self._most is None or self._alone[remark.rule] <= self._most:
            return True
        self.left_out = [self.left_out[0] or remark.frame, self.left_out[1] + 1]
        return False

    def wanted(self, rule: str) -> bool:
        """Whether the user wants to hear of a rule, and of its channel."""
        return self._asked_for(rule) and not rule.startswith(self._others)

    def _asked_for(self, rule: str) -> bool:
        if self._select and not rule.startswith(self._select):
            return False
        return not (self._ignore and rule.startswith(self._ignore))

    def reported(self, remark: Remark, transaction: int | None = None) -> Finding:
        """The finding of a remark, counted among the diagnoses if it is one."""
        finding = self.finding(remark, transaction)
        if remark.rule.startswith(DIAGNOSIS):
            device = remark.job.device if remark.job else remark.args.get("device")
            group = cause(remark.rule, device, remark.args)
            self._grouping.add(group, finding, remark.corrected)
        return finding

    def diagnoses(self) -> list[Diagnosis]:
        """The causes of all findings reported so far."""
        return self._grouping.result()

    def finding(self, remark: Remark, transaction: int | None = None) -> Finding:
        """The finding of a remark."""
        row = rules()[remark.rule]
        args = row.carried(remark.args)
        if "dropped" in args and args["dropped"] is None:  # those of unanswered requests know it
            args["dropped"] = self.frames_dropped
        known = remark.time_ns
        foreign = remark.of is not None and remark.of.is_foreign
        severity = NOTE if foreign else row.severity
        return Finding(
            remark.rule, severity, remark.frame, sorted({remark.frame, *row.named_frames(args)}), transaction,
            remark.offset, args, time_ns=self._times.of(remark.frame) if known is None else known,
        )  # fmt: skip

    def result(self, transactions: Mapping[int, Transaction]) -> list[Finding]:
        """All findings in the order of their frames; their transactions get to know their rules.

        `transactions`: by the order of their jobs.
        """
        findings: list[Finding] = []
        owners: dict[int, Transaction] = {}
        remarks = (remark for remark in self._remarks if not remark.withdrawn)
        for remark in sorted(remarks, key=lambda remark: remark.frame):
            owner = transactions.get(remark.job.order) if remark.job else None
            findings.append(self.reported(remark, owner.id if owner else None))
            if owner and remark.rule not in owner.findings:
                owner.findings.append(remark.rule)
                owners[owner.id] = owner
        for owner in owners.values():
            owner.findings.sort()
        findings.sort(key=lambda f: (f.frame, f.rule, f.transaction or 0, f.offset or 0))
        return findings
