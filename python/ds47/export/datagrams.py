"""From frames to IPv4 UDP datagrams, and back: which frame holds which bytes of one.

`ds47.profinet.ip` decides when a datagram is whole, and forgets its pieces; here the frames of them are
kept, with copies, so that all can be exported and written again. What is inside is in `messages`.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from ds47.profinet import ip
from ds47.spec.semantics import limits

if TYPE_CHECKING:
    from .messages import Message

MOST_COPIES: Final = 16
"""Of one fragment, the first among them; a mirror port makes one or two. More are not exported."""
_REMEMBERED: Final = 64
"""Finished datagrams, and finished RPC messages, that are kept for their copies."""

_K = TypeVar("_K")
_V = TypeVar("_V")


@dataclass(slots=True, eq=False)
class Entry:
    """One captured frame on its way. `layer` is where the network layer begins in `data`."""

    number: int
    time_ns: int
    link_type: int
    data: bytearray
    original_length: int
    layer: int = 0
    finished: bool = False
    kept: bool = False


@dataclass(slots=True, eq=False)
class Datagram:
    """An IPv4 UDP datagram and where its bytes lie: (offset in it, entry, offset there, length)."""

    source: str
    destination: str
    ip_id: int
    first_ns: int
    pieces: list[tuple[int, Entry, int, int]] = field(default_factory=list)
    data: bytes = b""
    """UDP header and payload up to the first byte that was not captured, once the datagram is whole."""
    missing: int = 0
    message: Message | None = None
    lost: bool = False
    """Given up: its frames are not exported, nor is what comes later of it."""
    newest_ns: int = 0
    size: int = 0
    """Captured bytes of all pieces."""
    _seen: dict[int, tuple[int, int]] = field(default_factory=dict)
    """By offset: the length of the first piece there, and how many there are."""

    def add(self, offset: int, entry: Entry, at: int, length: int) -> bool:
        """Takes a piece, `length` bytes of `entry` from `at` on; False for one copy too many."""
        first, count = self._seen.get(offset, (length, 0))
        if count == MOST_COPIES:
            return False
        self._seen[offset] = first, count + 1
        self.pieces.append((offset, entry, at, length))
        self.newest_ns = max(self.newest_ns, entry.time_ns)
        self.size += length
        return True

    def holds(self, offset: int, length: int) -> bool:
        """Whether such a piece is there."""
        return self._seen.get(offset, (-1, 0))[0] == length

    def entries(self) -> Iterator[Entry]:
        """The frames of it, in the order of the capture."""
        for _, entry, _, _ in self.pieces:
            yield entry

    def write(self, data: bytes) -> None:
        """Puts other bytes in place, in every frame; zeros where `data` has none.

        No byte stays that was not written: what lies behind a hole was never read.
        """
        self.data = data
        for offset, entry, at, length in self.pieces:
            entry.data[at : at + length] = data[offset : offset + length].ljust(length, b"\0")

    def image(self) -> bytes:
        """All captured bytes where they lie in the datagram, zeros in the holes."""
        out = bytearray(max((offset + length for offset, _, _, length in self.pieces), default=0))
        for offset, entry, at, length in self.pieces:
            out[offset : offset + length] = entry.data[at : at + length]
        return bytes(out)


class Recent(Generic[_K, _V]):
    """What was finished last, by its key; the oldest goes first, by number and by bytes (`limits`)."""

    def __init__(self) -> None:
        self._most_bytes = limits().fragment_bytes
        self._items: OrderedDict[_K, tuple[_V, int]] = OrderedDict()
        self._bytes = 0

    def get(self, key: _K) -> _V | None:
        """What has this key, if it is still known."""
        found = self._items.get(key)
        return None if found is None else found[0]

    def add(self, key: _K, value: _V, size: int) -> None:
        """Keeps a value of so many bytes, instead of one that had its key."""
        _, before = self._items.pop(key, (None, 0))
        self._items[key] = value, size
        self._bytes += size - before
        while len(self._items) > _REMEMBERED or self._bytes > self._most_bytes:
            self._bytes -= self._items.popitem(last=False)[1][1]


_Key = tuple[str, str, int]


class Datagrams:
    """Datagrams whose fragments are not all there yet; as many as the analysis keeps.

    Copies count as fragments and as bytes here: their frames wait, too.

    Args:
        given_up: takes the frames of what will never be whole, or is too much.
    """

    def __init__(self, given_up: list[list[Entry]]) -> None:
        self._limits = limits()
        self._given_up = given_up
        self._open: OrderedDict[_Key, tuple[Datagram, ip.Reassembler]] = OrderedDict()
        self._whole: Recent[_Key, Datagram] = Recent()
        self._fragments = 0
        self._bytes = 0

    def before(self, part: ip.Datagram, time_ns: int) -> Datagram | None:
        """The datagram that just became whole, of which this fragment is a copy."""
        key = (part.source, part.destination, part.identification)
        found = self._whole.get(key)
        if found is None or abs(time_ns - found.newest_ns) > self._limits.copy_ns:
            return None
        return found if found.holds(part.offset, len(part.payload)) else None

    def feed(self, part: ip.Datagram, entry: Entry, at: int) -> Datagram | None:
        """Takes a fragment, whose payload begins at `entry.data[at]`; the whole that it completes."""
        self.expire(entry.time_ns)
        key = (part.source, part.destination, part.identification)
        if key not in self._open:
            fresh = Datagram(*key, entry.time_ns), ip.Reassembler(self._limits.fragment_expiry_ns)
            self._open[key] = fresh
        datagram, reassembler = self._open[key]
        length = len(part.payload)
        if not datagram.add(part.offset, entry, at, length):
            self._given_up.append([entry])
            return None
        self._fragments += 1
        self._bytes += length
        whole = reassembler.feed(part, entry.number, entry.time_ns)
        if whole is None:
            self._make_room()
            return None
        self._close(key)
        datagram.data, datagram.missing = whole.payload, whole.missing
        self._whole.add(key, datagram, datagram.size)
        return datagram

    def expire(self, now_ns: int) -> None:
        """Gives up what is too old at this time of the capture.

        The clock may have stepped back: what began far ahead of it is as old as what began long ago.
        """
        while self._open:
            oldest, _ = next(iter(self._open.values()))
            if abs(now_ns - oldest.first_ns) <= self._limits.fragment_expiry_ns:
                return
            self._drop()

    def finish(self) -> None:
        """The capture is over."""
        while self._open:
            self._drop()

    def lose(self, datagrams: Iterable[Datagram]) -> None:
        """Gives up datagrams that belong together."""
        lost = list(datagrams)
        for each in lost:
            each.lost = True
        self._given_up.append([entry for each in lost for entry in each.entries()])

    def _make_room(self) -> None:
        bounds = self._limits
        while (
            len(self._open) > bounds.ip_datagrams
            or self._fragments > bounds.ip_fragments
            or self._bytes > bounds.fragment_bytes
        ):
            self._drop()

    def _drop(self) -> None:
        self.lose([self._close(next(iter(self._open)))])

    def _close(self, key: _Key) -> Datagram:
        datagram, _ = self._open.pop(key)
        self._fragments -= len(datagram.pieces)
        self._bytes -= datagram.size
        return datagram
