"""Frames that are written anew, in the order of the capture: each waits until its message is whole.

Lives here: their bytes, by frame number, and which of them may go. Not here: the new bytes (`anonymise`).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ds47.capture import WholeFrame
from ds47.capture.scan import network_layer
from ds47.profinet.traces import Trace


@dataclass(slots=True, eq=False)
class Draft:
    """One frame on its way. `layer` is where the network layer begins in `data`."""

    frame: WholeFrame
    data: bytearray
    layer: int
    kept: bool | None = None
    """Whether it is exported; None while that is unknown."""


class Drafts:
    """The drafts that wait."""

    def __init__(self) -> None:
        self._waiting: OrderedDict[int, Draft] = OrderedDict()

    def __getitem__(self, number: int) -> Draft:
        return self._waiting[number]

    def add(self, frame: WholeFrame) -> None:
        """The next frame of the capture."""
        data = bytearray(frame.data)
        _, layer = network_layer(data, 0, len(data), frame.link_type)
        self._waiting[frame.number] = Draft(frame, data, layer)

    def write(self, trace: Trace, data: bytes) -> None:
        """Puts another datagram in place, in every frame of it; zeros where `data` has nothing.

        No byte stays that was not written: what lies behind a hole was never read.
        """
        trace.data = data
        for frame, _, at, offset, length in trace.pieces:
            piece = data[offset : offset + length].ljust(length, b"\0")
            self[frame].data[at : at + length] = piece

    def image(self, trace: Trace) -> bytes:
        """All captured bytes where they lie in the datagram, zeros in the holes."""
        out = bytearray(max((each.offset + each.length for each in trace.pieces), default=0))
        for piece in trace.pieces:
            data = self[piece.frame].data[piece.at : piece.at + piece.length]
            out[piece.offset : piece.offset + piece.length] = data
        return bytes(out)

    def finish(self, numbers: Iterable[int], kept: bool) -> None:
        """Says whether these frames are exported."""
        for number in numbers:
            self[number].kept = kept

    def ready(self) -> Iterator[Draft]:
        """The frames that wait for none in front of them; they are forgotten here."""
        while self._waiting:
            number, first = next(iter(self._waiting.items()))
            if first.kept is None:
                return
            del self._waiting[number]
            yield first
