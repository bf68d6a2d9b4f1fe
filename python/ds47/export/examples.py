"""Of each root cause one example: the transaction that shows it, and the frames that its finding names.

A root cause is a diagnosis of the report; of what no diagnosis covers, a rule. Which frames are copied is decided
here, how in `ds47.export`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ds47 import spec
from ds47.model import CaptureResult, Diagnosis, Finding
from ds47.report.todo import uncovered

from .selection import Chosen, chosen_of

MOST = 50
"""Examples of one capture."""
_NAMED = 10
"""The most frames of a finding to take transactions from for an example."""


@dataclass(frozen=True, slots=True)
class Example:
    """One root cause with its frames.

    Attributes:
        rule: the id of its rule.
        name: rule and number among those of the rule, as a part of a file name: `DS717-index-and-count-2`.
        item: what says it.
        chosen: its frames, with what to say about each.
    """

    rule: str
    name: str
    item: Diagnosis | Finding
    chosen: Chosen


def examples(result: CaptureResult, rules: tuple[str, ...] = ()) -> list[Example]:
    """The examples of a capture, the diagnoses first; those that have a frame.

    Args:
        result: a complete one, with its transactions.
        rules: how the ids of the wanted rules begin; none for all.
    """
    owners = {frame: each.id for each in result.transactions for frame in each.frames.all()}
    by_id = {each.id: each for each in result.transactions}
    found: list[Example] = []
    seen: dict[str, int] = {}
    for item in _causes(result):
        frames = _frames(item)
        if not frames or (rules and not item.rule.startswith(rules)):
            continue
        ids = dict.fromkeys([*_own(item), *(owners[each] for each in frames if each in owners)])
        seen[item.rule] = seen.get(item.rule, 0) + 1
        number = f"-{seen[item.rule]}" if seen[item.rule] > 1 else ""
        name = f"{item.rule}-{spec.rules()[item.rule].name}{number}"
        chosen = chosen_of(result, [by_id[each] for each in ids], frames)
        found.append(Example(item.rule, name, item, chosen))
    return found


def _causes(result: CaptureResult) -> Iterator[Diagnosis | Finding]:
    """The diagnoses, then of each rule the first finding that none of them covers."""
    yield from result.diagnoses
    first: dict[str, Finding] = {}
    for each in uncovered(result):
        first.setdefault(each.rule, each)
    yield from first.values()


def _own(item: Diagnosis | Finding) -> Sequence[int]:
    if isinstance(item, Diagnosis):
        return item.transactions[:1]
    return () if item.transaction is None else (item.transaction,)


def _frames(item: Diagnosis | Finding) -> list[int]:
    """The first frame where it shows, and those that its sentence names."""
    first = item.frames[:1] if isinstance(item, Diagnosis) else [item.frame]
    named = spec.rules()[item.rule].named_frames(item.args)
    return list(dict.fromkeys([*first, *named]))[:_NAMED]
