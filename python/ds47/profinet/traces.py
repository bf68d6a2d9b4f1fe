"""The frames that brought a datagram, and the place of its bytes in them: kept only on request.

The reassemblers (ip.py, rpc.py) forget the pieces of a message once it is whole. Given the same `Traces`, both
keep them, so that the message can be written back into its frames. The frames of copies (mirror ports) are
kept too, and count towards the limits. Not here: when a datagram is whole, its content.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

MOST_COPIES: Final = 16
"""The most copies of one fragment, including the first; a mirror port makes one or two. More are lost."""


class DatagramPiece(NamedTuple):
    """`length` bytes of a datagram from `offset` on, which begin at `at` in the data of a frame."""

    frame: int
    time_ns: int
    at: int
    offset: int
    length: int


@dataclass(slots=True, eq=False, repr=False)
class Trace:
    """The pieces of one IPv4 UDP datagram, in the order of the capture.

    Attributes:
        pieces: copies too.
        data: UDP header and payload up to the first byte that was not captured, once it is `whole`.
        whole: whether all fragments were there.
        copy_of: the trace of a datagram that was whole before this, a piece of it, came again.
        lost: its message will never be whole, or this is one copy too many.
        context: for the layer above.
    """

    pieces: list[DatagramPiece] = field(default_factory=list)
    data: bytes = b""
    whole: bool = False
    copy_of: Trace | None = None
    lost: bool = False
    context: Any = None
    _copies: dict[int, int] = field(default_factory=dict)
    """By offset: how many pieces there are."""

    def add(self, piece: DatagramPiece) -> bool:
        """Takes a piece; False for one copy too many."""
        count = self._copies.get(piece.offset, 0)
        if count == MOST_COPIES:
            return False
        self._copies[piece.offset] = count + 1
        self.pieces.append(piece)
        return True

    def close(self, data: bytes) -> None:
        """The datagram is whole: only copies of its fragments may follow."""
        self.data, self.whole = data, True

    @property
    def frames(self) -> list[int]:
        """The numbers of the frames."""
        return [piece.frame for piece in self.pieces]


class Traces:
    """The traces of a capture while it is read.

    Attributes:
        newest: the trace of the newest frame of IPv4 UDP.
        lost: messages that will never be whole, each as its traces; the reader empties this list.
    """

    def __init__(self) -> None:
        self.newest: Trace | None = None
        self.lost: list[list[Trace]] = []

    def add(self, trace: Trace, piece: DatagramPiece) -> bool:
        """Adds a piece to a trace. False for one copy too many, which is lost."""
        if not trace.add(piece):
            self.lose([self.begin(piece)])
            return False
        self.newest = trace
        return True

    def begin(self, piece: DatagramPiece, copy_of: Trace | None = None) -> Trace:
        """A trace of its own for a piece."""
        trace = self.newest = Trace(copy_of=copy_of)
        trace.add(piece)
        return trace

    def take(self) -> Trace | None:
        """The trace of the newest frame, once; None if that is no IPv4 UDP."""
        newest, self.newest = self.newest, None
        return newest

    def lose(self, traces: list[Trace]) -> None:
        """The message of these traces will never be whole."""
        for trace in traces:
            trace.lost = True
        self.lost.append(traces)
