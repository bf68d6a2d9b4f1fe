"""IPv4: the header, and datagrams put together from fragments.

Lives here: what is between the link layer and UDP. Not here: UDP and whether it is ours (link.py).
No header checksum is looked at: with offloading, captures are full of wrong ones.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import TYPE_CHECKING

from ds47.spec.plain import Plain

if TYPE_CHECKING:
    from ds47.profinet.traces import Trace, Traces

TCP, UDP = 6, 17

Cut = tuple[int, int, int]
"""A frame that the capture cut: number, captured bytes, bytes on the wire."""

_HEADER = struct.Struct(">BxHHHxBxx4s4s")


@dataclass(slots=True, repr=False, eq=False)
class Datagram(Plain):
    """An IPv4 datagram or a fragment of one.

    `offset` is where `payload` lies in the whole datagram, in bytes; `more` is the flag that more
    fragments follow. `missing` counts the bytes at the end of `payload` that were not captured; `cut` is
    the frame that lacks them, None where none does. `at` is where `payload` begins in the data of the frame.
    """

    source: str
    destination: str
    protocol: int
    identification: int
    offset: int
    more: bool
    payload: bytes
    missing: int
    cut: Cut | None = None
    at: int = 0

    @property
    def whole(self) -> bool:
        """True when this is no fragment."""
        return self.offset == 0 and not self.more

    @property
    def length(self) -> int:
        """Bytes of the payload on the wire."""
        return len(self.payload) + self.missing


def parse(data: bytes, at: int = 0) -> Datagram | None:
    """Read the IPv4 packet at data[at:]; None when its header is not whole or contradicts itself.

    What is behind the total length (Ethernet padding, check sequence) is left out. A total length
    of 0, as segmentation offload leaves it, means up to the end.
    """
    if len(data) < at + 20:
        return None
    version, total, identification, flags, protocol, source, destination = _HEADER.unpack_from(
        data, at
    )
    header = (version & 15) * 4
    end = at + total if total else len(data)
    if version >> 4 != 4 or header < 20 or at + header > min(end, len(data)):
        return None
    return Datagram(
        source=address(source),
        destination=address(destination),
        protocol=protocol,
        identification=identification,
        offset=(flags & 0x1FFF) * 8,
        more=bool(flags & 0x2000),
        payload=data[at + header : end],
        missing=max(0, end - len(data)),
        at=at + header,
    )


def address(data: bytes) -> str:
    """Four bytes as text: 192.168.0.1."""
    return "{}.{}.{}.{}".format(*data)


@dataclass(slots=True, repr=False, eq=False)
class Unfinished(Plain):
    """Fragments of one datagram, so far; `total` is None until the last fragment was seen.

    `pieces` maps an offset to the captured bytes and the length on the wire. There is no hole up to
    `reach`; `beyond` is a heap of the offsets behind it.
    """

    source: str
    destination: str
    identification: int
    first_ns: int
    frame: int = 0
    time_ns: int = 0
    total: int | None = None
    pieces: dict[int, tuple[bytes, int]] = field(default_factory=dict)
    reach: int = 0
    beyond: list[int] = field(default_factory=list)
    again: set[int] = field(default_factory=set)
    """The offsets of pieces of which copies came when it was whole."""
    cut: Cut | None = None
    limit: str = ""
    """Name of the limit that pushed it out (spec/limits.toml); "" for none."""
    held: int = 0
    """How many fragments count towards the limit."""
    size: int = 0
    """How many captured bytes count towards the limit."""
    trace: Trace | None = None

    @property
    def have(self) -> int:
        """Bytes on the wire of the fragments seen, without the IP headers."""
        return sum(length for _, length in self.pieces.values())

    @property
    def covered(self) -> bool:
        """True when no hole is left up to the last fragment."""
        while self.beyond and self.beyond[0] <= self.reach:
            offset = heappop(self.beyond)
            self.reach = max(self.reach, offset + self.pieces[offset][1])
        return self.total is not None and self.reach >= self.total

    def copies(self) -> Iterator[Datagram]:
        """Its fragments of which copies came when it was whole."""
        key = self.source, self.destination, UDP, self.identification
        for offset in self.again:
            data, length = self.pieces[offset]
            more, missing = offset + length != self.total, length - len(data)
            yield Datagram(*key, offset, more, data, missing, self.cut if missing else None)

    def head(self) -> bytes:
        """The captured bytes from offset 0 up to the first hole."""
        parts: list[bytes] = []
        at = 0
        for offset in sorted(self.pieces):
            data, length = self.pieces[offset]
            if offset > at:
                break
            parts.append(data[at - offset :])
            at += len(parts[-1])
            if len(data) < length:
                break
        return b"".join(parts)[: self.total]


_Key = tuple[str, str, int]


class Reassembler:
    """Puts fragments together, whatever their order; copies of a fragment are tolerated.

    Memory is bounded by `datagrams`, `fragments` and `most_bytes` of them: the oldest unfinished
    datagram goes first.
    One that is not whole `expiry_ns` of capture time after its first fragment is given up. The caller
    must empty `given_up`. If `traces` keeps the frames of datagrams, it gets those that were given up instead.
    """

    def __init__(
        self,
        expiry_ns: int = 30_000_000_000,
        datagrams: int = 256,
        fragments: int = 16_384,
        most_bytes: int = 1 << 24,
        traces: Traces | None = None,
    ) -> None:
        self._expiry_ns = expiry_ns
        self._most_datagrams = datagrams
        self._most_fragments = fragments
        self._most_bytes = most_bytes
        self._open: OrderedDict[_Key, Unfinished] = OrderedDict()
        self._done: OrderedDict[_Key, Unfinished] = OrderedDict()
        self.given_up: list[Unfinished] = []
        self._fragments = 0
        self._bytes = 0
        self._now_ns = 0
        self.traces = traces

    def feed(self, part: Datagram, frame: int, time_ns: int) -> Datagram | None:
        """Take a fragment; return the whole datagram when this one completes it.

        Where the snap length cut fragments, the payload ends at the first cut and `missing` counts
        everything behind it.
        """
        self._now_ns = time_ns
        key = (part.source, part.destination, part.identification)
        possible = part.length > 0 and part.offset + part.length <= 65_535
        known = self._known(key, part) if possible else None
        before = self._whole(known)
        if before is not None:
            before.again.add(part.offset)
        entry = self._entry(key, known) if possible and before is None else None
        if self.traces is not None and not self._trace(part, frame, entry, before):
            return None
        if entry is None:
            return None
        self._add(entry, part)
        entry.frame, entry.time_ns = frame, time_ns
        if entry.total is None or not entry.covered:
            self._make_room(key)
            return None
        self._close(key)
        self._done[key] = entry
        while len(self._done) > 64:
            self._done.popitem(last=False)
        head = entry.head()
        if entry.trace is not None:
            entry.trace.close(head)
        missing = entry.total - len(head)
        return Datagram(*key[:2], UDP, key[2], 0, False, head, missing, entry.cut)

    def unfinished(self) -> list[Unfinished]:
        """The incomplete datagrams, oldest first."""
        return list(self._open.values())

    def finish(self) -> None:
        """Give up every open datagram."""
        while self._open:
            self._give_up(next(iter(self._open)), "")

    def _known(self, key: _Key, part: Datagram) -> Unfinished | None:
        """The datagram that was whole last, if this fragment is a piece of it once more."""
        done = self._done.get(key)
        same = done is not None and done.pieces.get(part.offset) == (part.payload, part.length)
        return done if same else None

    def _whole(self, done: Unfinished | None) -> Unfinished | None:
        """The datagram that just became whole and of which this fragment is a mirror port's copy.

        Later than a millisecond it is a new datagram with a reused identification, or the same once more.
        """
        late = done is None or abs(self._now_ns - done.time_ns) > 1_000_000
        return None if late else done

    def _entry(self, key: _Key, known: Unfinished | None) -> Unfinished:
        """The open datagram that a fragment belongs to; a new one if there is none.

        It has what came of `known` once more: that was no mirror port's where more of it follows so late.
        """
        self._expire()
        entry = self._open.get(key)
        if entry is None:
            entry = self._open[key] = Unfinished(*key, first_ns=self._now_ns)
            for part in () if known is None else known.copies():
                self._add(entry, part)
        return entry

    def _trace(
        self, part: Datagram, frame: int, entry: Unfinished | None, before: Unfinished | None
    ) -> bool:
        """Keeps the frame of a fragment with its datagram. False where it goes no further."""
        assert self.traces is not None
        from ds47.profinet.traces import DatagramPiece, Trace  # only an export wants them

        piece = DatagramPiece(frame, self._now_ns, part.at, part.offset, len(part.payload))
        if entry is None:
            trace = self.traces.begin(piece, None if before is None else before.trace)
            if before is None:
                self.traces.lose([trace])
            return False
        if entry.trace is None:
            entry.trace = Trace()
        return self.traces.add(entry.trace, piece)

    def _add(self, entry: Unfinished, part: Datagram) -> None:
        known = entry.pieces.get(part.offset)
        longer = known is None or known[1] < part.length
        if entry.trace is not None:  # the frames of copies are kept as well
            self._hold(entry, 1, len(part.payload))
        elif longer:
            self._hold(entry, known is None, len(part.payload) - (len(known[0]) if known else 0))
        if longer:
            entry.pieces[part.offset] = (part.payload, part.length)
            heappush(entry.beyond, part.offset)
            if entry.cut is None:
                entry.cut = part.cut
        if not part.more and entry.total is None:
            entry.total = part.offset + part.length

    def _hold(self, entry: Unfinished, fragments: int, size: int) -> None:
        entry.held += fragments
        entry.size += size
        self._fragments += fragments
        self._bytes += size

    def _close(self, key: _Key) -> Unfinished:
        entry = self._open.pop(key)
        self._fragments -= entry.held
        self._bytes -= entry.size
        return entry

    def _expire(self) -> None:
        """Insertion order is nearly the order of time, so the oldest one decides.

        The clock may have stepped back: what began far ahead of it is as old as what began long ago.
        """
        while self._open:
            key, entry = next(iter(self._open.items()))
            if abs(self._now_ns - entry.first_ns) <= self._expiry_ns:
                return
            self._give_up(key, "")

    def _make_room(self, newest: _Key) -> None:
        while (limit := self._over()) and next(iter(self._open)) != newest:
            self._give_up(next(iter(self._open)), limit)

    def _over(self) -> str:
        """The limit that is exceeded, "" for none."""
        if len(self._open) > self._most_datagrams:
            return "ip_datagrams"
        if self._fragments > self._most_fragments:
            return "ip_fragments"
        return "fragment_bytes" if self._bytes > self._most_bytes else ""

    def _give_up(self, key: _Key, limit: str) -> None:
        entry = self._close(key)
        if self.traces is not None and entry.trace is not None:
            self.traces.lose([entry.trace])
        elif 0 in entry.pieces:  # without the beginning its protocol is unknown
            entry.limit = limit
            self.given_up.append(entry)
