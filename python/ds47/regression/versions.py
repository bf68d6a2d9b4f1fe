"""Which changes come of ds47 alone: the version that stored a result, and the rules that find more or less since.

Pure. A change comes of the version alone where the file is the same and spec/rules.toml says that it changed
between the two: the rule (`changed`), the state (`states`), of which frames a transaction is made, whether it is
seen at all, or that a parameter has a name (`otherwise`). What a transaction says follows from its frames: where
those that carry it are others it may be otherwise, too; out of the same frames it must be read as before. Of
another recording nothing is explained: the capture or the device may be the reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

from ds47 import spec
from ds47.model import DS47
from ds47.regression.compare import Change, Json
from ds47.report.bilingual import Both, joined, say, state
from ds47.version import __version__

FINDINGS = ("finding_new", "finding_gone")
_VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)(.*)")

_ALONE = ("transaction_new", "transaction_gone")
_OF_ALL_FRAMES = ("frames", "state", "start", "duration_ms")
"""What a transaction says that follows from all of its frames; anything else from those that carry bytes:"""
_CARRIERS = {"status": ("write_response", "read_response")}
_OF_BYTES = ("write_request", "read_response")

_Order = tuple[int, int, int, bool]


class Why(NamedTuple):
    """A version, and what changed in it: a rule, a state, or a key of `otherwise` in rules.toml."""

    version: str
    what: str

    @property
    def text(self) -> Both:
        """What changed, in words."""
        if self.what in spec.rules():
            return Both.same(self.what)
        if self.what in spec.new_states():
            return say("version_state", state=state(self.what))
        return say(f"version_{self.what}")


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

    def since(self, version: str | None, what: str) -> Why | None:
        """A change of ds47, where this version made it after the result was stored."""
        return Why(version, what) if version and self._is_between(version) else None

    def _by_itself(self, change: Change) -> Why | None:
        """What may explain a change, whatever its transaction is made of."""
        if change.kind in FINDINGS:
            rule = change.rule or ""
            return Why(self.rules[rule], rule) if rule in self.rules else None
        if change.kind == "state":
            return self.since(spec.new_states().get(change.is_now), change.is_now)
        if change.path[-1:] == ("name",) and change.was is None:
            return self.since(spec.otherwise("names"), "names")
        return None

    def explained(self, changes: Sequence[Change], stored: Json, now: Json) -> list[Change]:
        """The changes, with the version in those that come of it alone."""
        if not changes or not self.same_file:
            return list(changes)
        remade = _Remade(self, changes, stored, now)
        whys = [self._by_itself(each) or remade.why(each) for each in changes]
        touched = [
            each for each, why in zip(changes, whys, strict=True)
            if each.kind not in FINDINGS and why is None
        ]  # fmt: skip
        olds = _Touched(stored, {each.stored for each in touched})
        news = _Touched(now, {each.now for each in touched})
        return [
            each if why is None or olds.concerns(each.stored, each.was) or news.concerns(each.now, each.is_now)
            else replace(each, version=why.version, because=why.what)
            for each, why in zip(changes, whys, strict=True)
        ]  # fmt: skip

    def lines(self, changes: Sequence[Change]) -> Iterator[Both]:
        """What there is to say of the versions, where something changed."""
        if self.newer and changes:
            yield say("version_newer", version=self.version, now=self._now)
        alone = [Why(each.version, each.because or "") for each in changes if each.version]
        if alone:
            yield self._line("version_alone", alone)
        if not self.same_file:
            other = [why for each in changes if (why := self._by_itself(each))]
            if other:
                yield self._line("version_or_recording", other)

    def version_with(self, left: Sequence[Change]) -> str | None:
        """The version to store it under while these changes stay: its own, where one may come of versions."""
        settled = self.same_file and not self.newer and not any(each.version for each in left)
        return self._now if settled else self.version

    def _line(self, key: str, whys: Sequence[Why]) -> Both:
        names: dict[str, dict[str, Both]] = {}
        for why in sorted(whys, key=lambda why: (why.what in spec.rules(), why.what)):
            names.setdefault(why.version, {})[why.what] = why.text
        rules = [
            joined(list(whats.values())).joined(Both.same(f"({version})"), zh=" ")
            for version, whats in names.items()
        ]
        number = len(whys)
        return say(key, n=number, number=str(number), version=self.version, rules=joined(rules))


class _Remade:
    """The transactions that the newer version makes of other frames, and those that only one of the two sees."""

    def __init__(self, origin: Origin, changes: Sequence[Change], stored: Json, now: Json) -> None:
        self._origin, self._olds, self._news = origin, stored["transactions"], now["transactions"]
        self._stored: dict[int, Why] = {}
        self._now: dict[int, Why] = {}
        for each in changes:
            why = self._reason(each)
            if why is not None and each.stored is not None:
                self._stored[each.stored] = why
            if why is not None and each.now is not None:
                self._now[each.now] = why

    def why(self, change: Change) -> Why | None:
        """What explains a change by the transaction that it is in, or that the finding is about."""
        if change.kind in FINDINGS:
            new = change.kind == "finding_new"
            number = (change.is_now if new else change.was)["transaction"]
            return (self._now if new else self._stored).get(number - 1) if number else None
        if change.now is None:
            return None if change.stored is None else self._stored.get(change.stored)
        why = self._now.get(change.now)
        if why is None or change.stored is None:
            return why
        return why if self._follows(change) else None

    def _follows(self, change: Change) -> bool:
        """Whether what changed in a transaction is carried by other frames than before."""
        assert change.stored is not None
        assert change.now is not None
        key = str(change.path[0])
        if key in _OF_ALL_FRAMES:
            return True
        old, new = self._olds[change.stored]["frames"], self._news[change.now]["frames"]
        return any(old[name] != new[name] for name in _CARRIERS.get(key, _OF_BYTES))

    def _reason(self, change: Change) -> Why | None:
        """Why a transaction is made of other frames, or is there at all."""
        if change.kind in _ALONE:
            new = change.kind == "transaction_new"
            item = change.is_now if new else change.was
            others = self._frames_stored if new else self._frames_now
            if item["state"] != "orphan" and others.isdisjoint(_numbers(item.get("frames"))):
                return self._of("requests", item)
            return self._of("frames", item)
        if change.path == ("frames",) and change.now is not None:
            return self._of("frames", self._news[change.now])
        return None

    def _of(self, what: str, item: Json) -> Why | None:
        return self._origin.since(spec.otherwise(what, item.get("channel", DS47)), what)

    @cached_property
    def _frames_stored(self) -> set[int]:
        return {frame for item in self._olds for frame in _numbers(item.get("frames"))}

    @cached_property
    def _frames_now(self) -> set[int]:
        return {frame for item in self._news for frame in _numbers(item.get("frames"))}


class _Touched:
    """The transactions of one result of which more changed than findings, and their frames."""

    def __init__(self, result: Json, positions: set[int | None]) -> None:
        self._numbers = {position + 1 for position in positions if position is not None}
        items = (result["transactions"][number - 1] for number in self._numbers)
        self._frames = {frame for item in items for frame in _numbers(item.get("frames"))}

    def concerns(self, position: int | None, value: Any) -> bool:
        """Whether a change is in one of them, or is about a finding that rests on one."""
        if position is not None:
            return position + 1 in self._numbers
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
