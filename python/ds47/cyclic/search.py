"""Where control and status word stand in cyclic frames of which nobody tells: offsets tried on what was recorded.

A pair of offsets is offered where it alone may be the words of a drive in all of the frames, and a drive reacts to
ON there, or both words are those of one that a PLC controls and have the state of their data (IOPS) behind them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from ds47.cyclic.operation import Operation
from ds47.cyclic.relations import sizes
from ds47.cyclic.timeline import FREE, Recorder
from ds47.spec.semantics import limits

_GOOD = 0x80
_CONTROLLED = 0x0406
"""Bits of STW1 without which no drive runs."""
_PAIRS = 64
"""More pairs of offsets than these say nothing."""


class Sample(NamedTuple):
    """The data of a cyclic frame, and when it was."""

    time_ns: int
    data: bytes


def offsets(output: Sequence[Sample], input_: Sequence[Sample]) -> tuple[int, int] | None:
    """Where STW1 and ZSW1 stand in the frames of two stations; None where the frames do not show it."""
    found = list(product(_offsets(output, sent=True), _offsets(input_, sent=False)))
    if not found or len(found) > _PAIRS:
        return None
    played = [(pair, _play(output, input_, *pair)) for pair in found]
    proven = [pair for pair, it in played if it.proven and not it.refuted]
    reacting = [pair for pair, it in played if it.reacted and pair in proven]
    for pairs in (reacting, proven):
        if pairs:
            return pairs[0] if len(pairs) == 1 else None
    return None


def _offsets(images: Sequence[Sample], *, sent: bool) -> Iterator[int]:
    """Where a word may stand in all frames of a side, with IOPS behind the data that begins with it."""
    lengths = sorted({each[not sent] for each in sizes()})
    shortest = min((len(each.data) for each in images), default=0)
    for at in range(max(0, shortest - lengths[0])):
        words = {int.from_bytes(each.data[at : at + 2]) for each in images}
        behind = (at + length for length in lengths if at + length < shortest)
        if _may_be(words, sent) and any(_is_good(images, iops) for iops in behind):
            yield at


def _may_be(words: set[int], sent: bool) -> bool:
    if not sent:
        return all(each & 7 in (0, 1, 3, 7) or each & 8 for each in words)
    controlled = any(each & _CONTROLLED == _CONTROLLED for each in words)
    return controlled and not any(each & FREE for each in words)


def _is_good(images: Sequence[Sample], at: int) -> bool:
    """Whether the byte there is a state that is good more often than not, and else bad."""
    states = [each.data[at] for each in images]
    return set(states) <= {0, _GOOD} and 2 * states.count(_GOOD) > len(states)


def _play(output: Sequence[Sample], input_: Sequence[Sample], out: int, in_: int) -> Recorder:
    """What the words at these offsets tell of a drive."""
    recorder = Recorder(Operation({}, limits()), trusted=True, speed=None)
    both = [(each.time_ns, True, each.data[out : out + 4]) for each in output]
    both += [(each.time_ns, False, each.data[in_ : in_ + 4]) for each in input_]
    both.sort(key=lambda each: each[0])
    for number, (time_ns, sent, words) in enumerate(both, 1):
        (recorder.sent if sent else recorder.answered)(words, number, time_ns)
    return recorder
