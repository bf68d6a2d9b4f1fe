"""Which changes come of ds47 alone: the version that stored a result, and the rules that find more or less since.

Pure. A change comes of the version alone where the file is the same, the rule changed between the two versions
(`changed` in spec/rules.toml) or the state came with one (`states` there), and the transactions concerned have the
same bytes and values. Of another recording nothing is explained: the capture or the device may be the reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

from ds47 import spec
from ds47.regression.compare import Change, Json
from ds47.report.bilingual import Both, joined, say, state
from ds47.version import __version__

FINDINGS = ("finding_new", "finding_gone")
_VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)(.*)")

_Order = tuple[int, int, int, bool]


class Origin:
    """Where a stored result comes from.

    Attributes:
        version: the version that wrote it, None where it does not say.
        same_file: whether it is of the file that is checked, not of another recording.
    """

    def __init__(self, version: str | None, *, same_file: bool, now: str = __version__) -> None:
        self.version, self.same_file, self._now = version, same_file, now

    @property
    def newer(self) -> bool:
        """Whether a newer version wrote it: what changed until then this one does not know."""
        then = _order(self.version)
        return then is not None and then > _known(self._now)

    @cached_property
    def rules(self) -> Mapping[str, str]:
        """The rules that find more or less since, with the last version that changed each.

        A version under development is taken for the one that it becomes.
        """
        return {
            rule.id: version
            for rule in spec.rules().values()
            for version in rule.changed
            if self._is_between(version)
        }

    def _is_between(self, version: str) -> bool:
        then, now = _order(self.version), _known(self._now)
        return then is not None and then < now and then < _known(version) <= (*now[:3], True)

    def _version_of(self, change: Change) -> str | None:
        """The version that may explain a change, by its rule or its state."""
        if change.kind in FINDINGS:
            return self.rules.get(change.rule or "")
        version = spec.new_states().get(change.is_now) if change.kind == "state" else None
        return version if version and self._is_between(version) else None

    def explained(self, changes: Sequence[Change], stored: Json, now: Json) -> list[Change]:
        """The changes, with the version in those that come of it alone."""
        if not changes or not self.same_file or not self.rules:
            return list(changes)
        may_be = {id(each): self._version_of(each) for each in changes}
        touched = [each for each in changes if each.kind not in FINDINGS and not may_be[id(each)]]
        olds = _Touched(stored, {each.stored for each in touched})
        news = _Touched(now, {each.now for each in touched})
        return [
            each if olds.concerns(each.stored, each.was) or news.concerns(each.now, each.is_now)
            else replace(each, version=may_be[id(each)])
            for each in changes
        ]  # fmt: skip

    def lines(self, changes: Sequence[Change]) -> Iterator[Both]:
        """What there is to say of the versions, where something changed."""
        if self.newer and changes:
            yield say("version_newer", version=self.version, now=self._now)
        alone = [each for each in changes if each.version]
        if alone:
            yield self._line("version_alone", alone)
        if not self.same_file:
            other = [each for each in changes if self._version_of(each)]
            if other:
                yield self._line("version_or_recording", other)

    def version_with(self, left: Sequence[Change]) -> str | None:
        """The version to store it under while these changes stay: its own, where one may come of versions."""
        settled = self.same_file and not self.newer and not any(each.version for each in left)
        return self._now if settled else self.version

    def _line(self, key: str, changes: Sequence[Change]) -> Both:
        names: dict[str, dict[str, Both]] = {}
        for each in sorted(changes, key=lambda each: each.rule or ""):
            name = each.rule or str(each.is_now)
            told = Both.same(name) if each.rule else say("version_state", state=state(name))
            names.setdefault(self._version_of(each) or "", {})[name] = told
        rules = [
            joined(list(told.values())).joined(Both.same(f"({version})"), zh=" ")
            for version, told in names.items()
        ]
        number = len(changes)
        return say(key, n=number, number=str(number), version=self.version, rules=joined(rules))


class _Touched:
    """The transactions of one result of which more changed than findings, and their frames."""

    def __init__(self, result: Json, places: set[int | None]) -> None:
        self._numbers = {place + 1 for place in places if place is not None}
        items = (result["transactions"][number - 1] for number in self._numbers)
        self._frames = {frame for item in items for frame in _numbers(item.get("frames"))}

    def concerns(self, place: int | None, value: Any) -> bool:
        """Whether a change is in one of them, or is about a finding that rests on one."""
        if place is not None:
            return place + 1 in self._numbers
        if not isinstance(value, dict) or "rule" not in value:
            return False
        frames = (value["frame"], *value.get("frames", ()))
        return value["transaction"] in self._numbers or not self._frames.isdisjoint(frames)


def _numbers(item: Any) -> Iterator[int]:
    """All frames in what a transaction says of its frames."""
    if isinstance(item, int):
        yield item
    elif isinstance(item, dict | list):
        for each in item.values() if isinstance(item, dict) else item:
            yield from _numbers(each)


def _order(version: str | None) -> _Order | None:
    """What versions are compared by, a release behind what led to it; None where it is none."""
    found = _VERSION.fullmatch(version or "")
    return found and (int(found[1]), int(found[2]), int(found[3]), not found[4])


def _known(version: str) -> _Order:
    """The same of a version of our own."""
    order = _order(version)
    assert order is not None
    return order
