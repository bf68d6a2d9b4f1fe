"""Which frames of PROFIBUS are wanted: those of a service from its request to its answer, polls among them.

Decides by numbers, times and stations; what a frame carries was decided by the analysis. Frames of PROFINET are
`tracking`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ds47.capture import Frame
from ds47.export.selection import Chosen, Selection
from ds47.model import Transaction
from ds47.profibus import LINK_TYPES
from ds47.profibus.telegram import SC, decode


@dataclass(frozen=True, slots=True)
class _Span:
    """From the request of a service to its answer."""

    first: int
    last: int
    station: int


class BusFrames:
    """Tells which frames of a capture with PROFIBUS are wanted.

    Args:
        selection: what is wanted,
        chosen: and what that is in this capture.
    """

    def __init__(self, selection: Selection, chosen: Chosen) -> None:
        self._selection = selection
        self._chosen = chosen
        self._stations = {each.station for each in chosen.transactions if each.device in chosen.ips}
        self._spans = [span for each in chosen.transactions for span in _spans(each)]
        self._acknowledged = False
        """Whether a short acknowledgement, which names nobody, is one of a wanted frame."""

    def wants(self, frame: Frame) -> bool:
        """Whether a frame is wanted; never one that is not PROFIBUS."""
        if frame.link_type not in LINK_TYPES:
            return False
        item, number = decode(frame.data), frame.number
        if self._selection.by_frame:
            if item.kind != SC:
                self._acknowledged = not self._chosen.ips or not self._stations.isdisjoint(
                    (item.da, item.sa)
                )
            return self._acknowledged and self._selection.in_time(frame.time_ns)
        return number in self._chosen.frames or any(
            each.first <= number <= each.last
            and (item.kind == SC or each.station in (item.da, item.sa))
            for each in self._spans
        )


def _spans(item: Transaction) -> Iterator[_Span]:
    if item.station is None:
        return
    frames = item.frames
    pairs = [
        (frames.write_request, frames.write_response), (frames.read_request, frames.read_response),
        *frames.polls, *frames.rereads,
    ]  # fmt: skip
    for first, last in pairs:
        if first is not None and last is not None:
            yield _Span(first, last, item.station)
