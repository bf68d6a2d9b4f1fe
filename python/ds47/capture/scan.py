"""The hot path: walk over the frames of a buffer and let through only those that may matter.

Lives here: the predicate, and the two loops (pcap, pcapng) that apply it without making an object
for an irrelevant frame. Not here: file headers, blocks other than the Enhanced Packet Block, broken
lengths (the loops stop in front of them; pcap.py and pcapng.py say why).

This is the only file where speed may cost beauty. It is plain Python, and Cython compiles it with the
types of scan.pxd. The two differ only in how they fetch the fields of a record. Compiled code reads them
from the bytes. Plain Python uses one `unpack` in the byte order of the file: it swaps the constants
instead of the fields, and skips long runs of cyclic frames by a regular expression (`Runs`). A test
checks that both give the same answer. Compiled, a scan can also read the file itself, without the
interpreter (`Scan.ahead`), in a thread (ahead.py).

A frame matters when, after VLAN tags or a cooked header, it is
* IPv4 UDP with RPC version 4 and the PNIO interface UUID (docs/protocol.md E.2), on any port, or with the UUID of
  the endpoint mapper, which shares its call numbers with PROFINET;
* any fragment of an IPv4 UDP datagram: only reassembly can tell;
* IPv4 TCP from or to a wanted port (`Scan.tcp`), no fragment;
* PROFINET DCP (0x8892, frame ids 0xFEFC..0xFEFF) or LLDP (0x88CC), which name the stations;
* a cyclic frame of a watched sender (`Watch`) with a change in a watched byte, the next frame of its partner,
  and a sample of unchanged ones (`sampled`), because other values move all the time.
A frame truncated inside the UUID matters unless a byte contradicts. A frame truncated before the UUID
must have the PROFINET port 34964 on one side.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Literal, NamedTuple

from ds47.profibus import PROFIBUS_DL, USER0

ByteOrder = Literal["little", "big"]
Bytes = bytes | bytearray

ETHERNET, RAW, RAW_IPV4, SLL, SLL2 = 1, 101, 228, 113, 276
IPV4, PROFINET, LLDP = 0x0800, 0x8892, 0x88CC
VLAN_TAGS = frozenset((0x8100, 0x88A8, 0x9100, 0x9200))
DCP_FRAME_IDS = range(0xFEFC, 0xFF00)
PNIO_PORT = 34964
TCP, UDP = 6, 17

MAX_FRAME = 1 << 18  # the limit of libpcap and Wireshark for these link types, in bytes
PADDING = 64  # how far the loops may look beyond the last byte: any bytes must be there
ENHANCED_PACKET = 6  # type of the pcapng block that holds a frame
BATCH = 1024  # the most frames that one call of a loop returns

# The interface UUIDs of PROFINET (device, controller, supervisor, parameter server), in both orders
UUIDS = b"".join(
    bytes.fromhex(head) + bytes.fromhex("827100a02442df7d")
    for x in (1, 2, 3, 4)
    for head in (f"dea0000{x}6c9711d1", f"0{x}00a0de976cd111")
)

# The same constants, as C integers where this file is compiled
_IPV4, _PROFINET, _LLDP, _TCP, _UDP = IPV4, PROFINET, LLDP, TCP, UDP
_ETHERNET, _RAW, _RAW_IPV4, _SLL, _SLL2 = ETHERNET, RAW, RAW_IPV4, SLL, SLL2
_PROFIBUS_DL, _USER0 = PROFIBUS_DL, USER0  # all of their frames matter
_PNIO_PORT, _MAX_FRAME, _BATCH, _ENHANCED = PNIO_PORT, MAX_FRAME, BATCH, ENHANCED_PACKET
_UUIDS = UUIDS
_BIG_1, _BIG_2 = 0xDEA00001, 0x6C9711D1  # words of the first UUID in network order
_LITTLE_1, _LITTLE_2 = 0x0100A0DE, 0x976CD111  # of a little-endian sender
_TAIL_1, _TAIL_2 = 0x827100A0, 0x2442DF7D
_MAPPER_BIG_1, _MAPPER_BIG_2 = 0xE1AF8308, 0x5D1F11C9  # of the endpoint mapper
_MAPPER_LITTLE_1, _MAPPER_LITTLE_2 = 0x0883AFE1, 0x1F5DC911
_MAPPER_TAIL_1, _MAPPER_TAIL_2 = 0x91A40800, 0x2B14A0FA

# One of so many frames of a watched sender is sampled: at first, at most, and how many samples until the interval
# doubles. A short capture shows its values in detail, and a long one costs no more for it.
_SAMPLE, _RAREST, _OFTEN = 4, 1024, 256
_NEXT = 0x7FFF_FFFF
"""A period without frames: it makes the next frame due."""
# Operation and types of the RPC messages that set up cyclic frames
_CONNECT, _REQUEST, _RESPONSE = 0, 0, 2

_LEARN_FROM = 4096  # frames after which it pays to learn the shapes of cyclic traffic
# A run stops this many bytes before the end of a pcap buffer: the loop itself takes the last frame, for its time.
_SINGLE = 128

# What one call of `ahead` returns: few frames at first, because the caller waits for them, then twice as many
# each time, because after each call its thread may wait up to 5 ms for the interpreter.
_FIRST_AHEAD = 256
_AHEAD = 4 * BATCH
_KEPT = 1 << 20  # bytes of frames
_FAR = 1 << 25  # bytes of the file: shows progress on a slow disk


MOST_PORTS = 16  # of TCP
NO_PORTS = b"\0"


def _u16(data: Bytes, at: int) -> int:
    return data[at] << 8 | data[at + 1]


def _u32(data: Bytes, at: int, big: bool) -> int:
    if big:
        return data[at] << 24 | data[at + 1] << 16 | data[at + 2] << 8 | data[at + 3]
    return data[at] | data[at + 1] << 8 | data[at + 2] << 16 | data[at + 3] << 24


def _is_tag(kind: int) -> bool:
    return kind == 0x8100 or kind == 0x88A8 or kind == 0x9100 or kind == 0x9200


def is_pnio(data: Bytes, start: int, end: int, cut: bool = False, on_port: bool = False) -> bool:
    """True when data[start:end], a UDP payload, is an RPC PDU of PROFINET (docs/protocol.md E.2).

    `cut` says that bytes are missing at the end. Then the rest only has to fit, and `on_port` (port 34964 is
    involved) decides if it ends before the UUID.
    """
    return _is_pnio(data, start, end, cut, on_port)


def _is_pnio(data: Bytes, start: int, end: int, cut: bool, on_port: bool) -> bool:
    if end - start >= 40:
        if _u32(data, start + 32, True) != _TAIL_1 or _u32(data, start + 36, True) != _TAIL_2:
            return _is_mapper(data, start)
        first, second = _u32(data, start + 24, True), _u32(data, start + 28, True)
        if second == _BIG_2:
            return data[start] == 4 and _BIG_1 <= first <= _BIG_1 + 3
        one_to_four = first & 0xFFFFFF == _LITTLE_1 & 0xFFFFFF and 1 <= first >> 24 <= 4
        return data[start] == 4 and one_to_four and second == _LITTLE_2
    if not cut or (end > start and data[start] != 4):
        return False
    have = end - start - 24
    if have <= 0:
        return on_port
    for uuid in range(0, 128, 16):
        at = 0
        while at < have and data[start + 24 + at] == _UUIDS[uuid + at]:
            at += 1
        if at == have:
            return True
    return False


def _is_mapper(data: Bytes, start: int) -> bool:
    """Whether an RPC PDU is for the endpoint mapper, in either byte order."""
    first, second = _u32(data, start + 24, True), _u32(data, start + 28, True)
    return (
        data[start] == 4
        and _u32(data, start + 32, True) == _MAPPER_TAIL_1
        and _u32(data, start + 36, True) == _MAPPER_TAIL_2
        and (
            (first == _MAPPER_BIG_1 and second == _MAPPER_BIG_2)
            or (first == _MAPPER_LITTLE_1 and second == _MAPPER_LITTLE_2)
        )
    )


def network_layer(data: Bytes, start: int, end: int, link_type: int) -> tuple[int, int]:
    """Return (EtherType, offset of what follows it), after VLAN tags and cooked headers.

    The EtherType is 0 if the frame is too short or the link type is unknown.
    """
    at = _network(data, start, end, link_type)
    return (0, start) if at < 0 else (_kind(data, start, at, link_type), at)


def _kind(data: Bytes, start: int, at: int, link_type: int) -> int:
    """The EtherType of the network layer at `at`."""
    if at == start:  # raw IP
        return _IPV4
    return _u16(data, start if link_type == _SLL2 and at == start + 20 else at - 2)


def _network(data: Bytes, start: int, end: int, link_type: int) -> int:
    """Offset of the network layer; -1 if there is none (`network_layer`)."""
    if link_type == _ETHERNET:
        at = start + 14
    elif link_type == _SLL:
        at = start + 16
    elif link_type == _SLL2:
        at = start + 20
        if at > end:
            return -1
        if not _is_tag(_u16(data, start)):
            return at
        at += 4
    elif link_type in (_RAW, _RAW_IPV4):
        return start if end > start and data[start] >> 4 == 4 else -1
    else:
        return -1
    while at <= end:
        if not _is_tag(_u16(data, at - 2)):
            return at
        at += 4
    return -1


def relevant(
    data: Bytes, start: int, end: int, link_type: int, original: int, ports: bytes = NO_PORTS
) -> bool:
    """The exact predicate for the frame data[start:end] that was `original` bytes long.

    `ports` are the wanted TCP ports in the form of `tcp_ports`.
    """
    return _relevant(data, start, end, link_type, original, ports)


def _relevant(
    data: Bytes, start: int, end: int, link_type: int, original: int, ports: bytes
) -> bool:
    at = _network(data, start, end, link_type)
    if at < 0:
        return link_type in (_PROFIBUS_DL, _USER0)
    kind = _kind(data, start, at, link_type)
    if kind == _IPV4:
        if end < at + 20 or data[at + 9] != _UDP:
            return ports[0] != 0 and end >= at + 20 and _is_tcp(data, at, end, ports)
        if data[at + 7] or data[at + 6] & 0x3F:
            return True
        udp = at + (data[at] & 15) * 4
        on_port = False
        if udp + 4 <= end:
            on_port = _u16(data, udp) == _PNIO_PORT or _u16(data, udp + 2) == _PNIO_PORT
        return _is_pnio(data, udp + 8, end, end - start < original, on_port)
    if kind == _PROFINET:
        return end >= at + 2 and 0xFEFC <= _u16(data, at) <= 0xFEFF
    return kind == _LLDP


def tcp_ports(ports: Iterable[int]) -> bytes:
    """Ports in the form that the loops use: their number, then two bytes for each, at most MOST_PORTS."""
    wanted = sorted(set(ports))[:MOST_PORTS]
    return struct.pack(f">B{len(wanted)}H", len(wanted), *wanted)


def _is_tcp(data: Bytes, at: int, end: int, ports: bytes) -> bool:
    """Whether the IPv4 packet at data[at:end], which is not UDP, has a wanted TCP port."""
    tcp = at + (data[at] & 15) * 4
    if data[at + 9] != _TCP or data[at + 7] or data[at + 6] & 0x3F or tcp + 4 > end:
        return False
    source, destination = _u16(data, tcp), _u16(data, tcp + 2)
    for number in range(ports[0]):
        port = _u16(ports, 1 + 2 * number)
        if source == port or destination == port:
            return True
    return False


class Watch(NamedTuple):
    """The cyclic frames of a sender (its MAC address), and which of their bytes matter.

    Each part is an offset after the frame id, and a length. `follows`: a change also lets the sender's next frame
    through. `answered`: a change also lets the next frame of this sender and frame id through.
    """

    source: bytes
    frame_id: int
    parts: tuple[tuple[int, int], ...]
    follows: bool = False
    answered: tuple[bytes, int] | None = None

    @property
    def key(self) -> bytes:
        """The sender and the frame id as in a frame."""
        return self.source + self.frame_id.to_bytes(2)


# A row of watched frames: MAC address and frame id, whether one was seen, `follows`, length of the row, end of the
# last part, period of the last frame, number of parts, offset of the row of `answered`; then offset and length of
# each part, then their bytes. A row of length 0 ends the list.
_ROW = 26
_NOWHERE = 0xFFFF


def _row(watch: Watch, answered: int = _NOWHERE) -> bytes:
    """A `Watch` in the form of the loop over bytes; `answered` is the offset of that row."""
    parts = b"".join(struct.pack(">HH", *part) for part in watch.parts)
    length = sum(part[1] for part in watch.parts)
    need = max((sum(part) for part in watch.parts), default=0)
    size = _ROW + len(parts) + length
    head = struct.pack(
        ">6sHB?HH8xHH",
        watch.source, watch.frame_id, 0, watch.follows, size, need, len(watch.parts), answered,
    )  # fmt: skip
    return head + parts + bytes(length)


def _rows(watches: Sequence[Watch]) -> bytearray:
    """The rows of all of them."""
    places, end = {}, 0
    for watch in watches:
        places[watch.key] = min(end, _NOWHERE)
        end += len(_row(watch))
    rows = bytearray()
    for watch in watches:
        source, frame_id = watch.answered or (b"", 0)
        rows += _row(watch, places.get(source + frame_id.to_bytes(2), _NOWHERE))
    return rows + bytes(_ROW)


def sampled(number: int, senders: int) -> int:
    """The sampling interval at this frame number: each watched sender gives one frame in so many."""
    return _sampled(number, senders)


def _sampled(number: int, senders: int) -> int:
    sample = _SAMPLE
    while sample < _RAREST and number >= sample * senders * _OFTEN:
        sample *= 2
    return sample * senders


def _rt(data: Bytes, start: int, end: int, link_type: int) -> int:
    """Offset of the frame id; -1 without one."""
    at = start + 14
    if link_type != _ETHERNET or _u16(data, start + 12) != _PROFINET:
        at = _network(data, start, end, link_type)
        if at < 0 or _kind(data, start, at, link_type) != _PROFINET:
            return -1
    return at if at + 2 <= end else -1


def _is_due(
    rows: bytearray, data: Bytes, start: int, end: int, number: int, senders: int, link_type: int
) -> bool:
    """Whether a frame is a watched one with a change, or the first of its sender in a period."""
    at = _rt(data, start, end, link_type)
    if at < 0:
        return False
    source = start + (12 if link_type == _SLL2 else 6)
    row, size = 0, _u16(rows, 10)
    while size:
        if rows[row + 7] == data[at + 1] and rows[row + 6] == data[at]:
            byte = 0
            while byte < 6 and rows[row + byte] == data[source + byte]:
                byte += 1
            if byte == 6:
                period = number // _sampled(number, senders)
                return _is_news(rows, row, data, at + 2, end, period)
        row += size
        size = _u16(rows, row + 10)
    return False


def _is_news(rows: bytearray, row: int, data: Bytes, at: int, end: int, period: int) -> bool:
    """The same for the frame of a row; remembers its bytes."""
    if at + _u16(rows, row + 12) > end:
        return False  # cut by the capture
    changed = rows[row + 8] == 0
    news = _get(rows, row + 14) != period
    rows[row + 8] = 1
    part, parts = row + _ROW, row + _ROW + 4 * _u16(rows, row + 22)
    kept = parts
    while part < parts:
        first = at + _u16(rows, part)
        for byte in range(_u16(rows, part + 2)):
            if rows[kept] != data[first + byte]:
                rows[kept] = data[first + byte]
                changed = True
            kept += 1
        part += 4
    _put(rows, row + 14, _NEXT if changed and rows[row + 9] else period)
    answered = _u16(rows, row + 24)
    if changed and answered != _NOWHERE:
        _put(rows, answered + 14, _NEXT)
    return news or changed


class _Watched:
    """A `Watch` with the last bytes, for the loop over unpacked fields."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self.need = max((sum(part) for part in watch.parts), default=0)
        self.bytes: list[Bytes] | None = None
        self.period = -1
        self.answered: _Watched | None = None

    def is_news(self, data: Bytes, at: int, end: int, period: int) -> bool:
        """As `_is_news`."""
        if at + self.need > end:
            return False
        there: list[Bytes] = [
            data[at + first : at + first + length] for first, length in self.watch.parts
        ]
        changed = there != self.bytes
        news = changed or period != self.period
        self.bytes, self.period = there, _NEXT if changed and self.watch.follows else period
        if changed and self.answered is not None:
            self.answered.period = _NEXT
        return news

    def shape(self, length: int, group: int) -> bytes:
        """The bytes after the frame id: those that matter equal the ones of the previous frame in the run.

        They are the groups from number `group` on. In the first frame of a run they match anything.
        """
        shape, at = b"", 0
        for number, (first, count) in enumerate(self.watch.parts, group):
            shape += rb".{%d}(?:(?(%d)(?!)|(.{%d}))|\%d)" % (first - at, number, count, number)
            at = first + count
        return shape + b".{%d}" % (length - at)


class Runs:
    """Skips runs of PROFINET RT frames without looking at each. Compiled code does not use it.

    A shape is the regular expression of a record that a loop has rejected: its lengths, the types and
    the first byte of the frame id. For a watched frame it also has sender, frame id, and unchanged bytes
    where they matter. STRIDE consecutive records of known shapes are one match.
    """

    STRIDE = 8
    MOST = 24  # shapes; cyclic traffic has fewer

    def __init__(self, front: bytes) -> None:
        """`front`: the regular expression for the start of every record."""
        self._front = front
        self._shapes: list[bytes] = []
        self._matches: list[tuple[int, Callable[..., re.Match[bytes] | None]]] = []
        self._watched: dict[bytes, _Watched] = {}
        self._around: dict[bytes, tuple[bytes, int, bytes]] = {}

    def watch(self, watched: dict[bytes, _Watched]) -> None:
        """From now on frames of these senders and ids have their own shapes."""
        self._watched, self._around, self._matches = watched, {}, []

    def learn(self, before: bytes, data: Bytes, start: int, end: int, after: bytes) -> None:
        """Take a rejected record: the Ethernet frame data[start:end], and the expressions around it."""
        for at in (start + 12, start + 16):
            if at + 4 <= end and _u16(data, at) == PROFINET and data[at + 2] != 0xFE:
                break
        else:
            return
        tag = re.escape(bytes(data[start + 12 : start + 14])) + b".." if at > start + 12 else b""
        key = bytes(data[start + 6 : start + 12] + data[at + 2 : at + 4])
        watched = self._watched.get(key)
        if watched is None:
            shape = rb".{12}%s\x88\x92[^\xfe].{%d}" % (tag, end - at - 3)
            if self._watched:
                shape = b"(?!%s)" % b"|".join(map(_sender, self._watched)) + shape
            self._add(before + shape + after)
        elif at + 4 + watched.need <= end:
            around = before + _sender(key, tag), end - at - 4, after
            if self._around.get(key) != around:
                self._around[key], self._matches = around, []

    def _add(self, shape: bytes) -> None:
        if shape not in self._shapes and len(self._shapes) < self.MOST:
            self._shapes.append(shape)
            self._matches = []

    def skip(
        self, data: Bytes, position: int, end: int, number: int, period: int
    ) -> tuple[int, int]:
        """End of the run that follows frame `number` at `position`, and its number of records.

        Runs are whole strides. Watched frames in them are of one period, and repeat what was seen in it.
        """
        if not self._matches:
            shapes = [*self._of_watched(), *self._shapes]
            if not shapes:
                return position, 0
            either = b"(?>%s(?:%s))" % (self._front, b"|".join(shapes))
            self._matches = [
                (size, re.compile(either + b"{%d}+" % size, re.DOTALL).match)
                for size in ((8 * self.STRIDE, self.STRIDE) if self._around else (self.STRIDE,))
            ]
        count, most, known = 0, end, None
        if self._around:
            most, known = period - number % period - 1, self._known(number // period)
        for size, match in self._matches:
            while count + size <= most and (run := match(data, position, end)) is not None:
                if known is not None and not _agree(run.groups(), known):
                    break
                position = run.end()
                count += size
        return position, count

    def _known(self, period: int) -> tuple[Bytes | None, ...]:
        """What the groups of a run must be; None, equal to no group, for a sender that is due in this period."""
        known: list[Bytes | None] = []
        for key in self._around:
            watched = self._watched[key]
            there = watched.bytes if watched.period == period else None
            known += there or [None] * len(watched.watch.parts)
        return tuple(known)

    def _of_watched(self) -> Iterator[bytes]:
        group = 1
        for key, (before, length, after) in self._around.items():
            watched = self._watched[key]
            yield before + watched.shape(length, group) + after
            group += len(watched.watch.parts)


def _agree(groups: tuple[Bytes | None, ...], known: tuple[Bytes | None, ...]) -> bool:
    """Whether the groups of a run have only known content; frames that do not occur have none."""
    return groups == known or all(
        one is None or one == other for one, other in zip(groups, known, strict=True)
    )


def _sender(key: bytes, tag: bytes = rb"(?:\x81\x00..)?") -> bytes:
    """The regular expression of the beginning of a watched frame, up to its data."""
    return b".{6}%s%s\x88\x92%s" % (re.escape(key[:6]), tag, re.escape(key[6:]))


class _Swapped:
    """The constants of the cheap test as `unpack` reads them in a file of that byte order."""

    def __init__(self, order: ByteOrder) -> None:
        self._order = order
        (self.profinet,) = self.seen((PROFINET,))
        (self.ipv4,) = self.seen((IPV4,))
        self.dcp = self.seen(DCP_FRAME_IDS)
        self.tags = self.seen(VLAN_TAGS)
        self.kept = self.seen((IPV4, LLDP))

    def seen(self, values: Iterable[int]) -> frozenset[int]:
        """Words in network order as `unpack` reads them."""
        return frozenset(int.from_bytes(value.to_bytes(2), self._order) for value in values)


_SWAPPED: dict[ByteOrder, _Swapped] = {"little": _Swapped("little"), "big": _Swapped("big")}

_OPERATION_END = 112  # where the operation ends in a plain RPC PDU
_ANY_UUID = b"|".join(re.escape(UUIDS[at : at + 16]) for at in range(0, len(UUIDS), 16))
is_plain = re.compile(
    rb".{12}\x08\x00E.{5}[\x00\x40\x80\xc0]\x00.\x11.{18}\x04"
    rb"(?:[^\x00\x02].{22}(?:%s)|[\x00\x02].{22}(?:%s).{28}(?!\x00\x00))" % (_ANY_UUID, _ANY_UUID),
    re.DOTALL,
).match
"""Finds the usual PDU, and no Connect: Ethernet, no tag, no IP option, no fragment."""


def _is_rt(data: Bytes, start: int, captured: int) -> bool:
    """Whether an Ethernet frame is RT, with or without one VLAN tag: by far the most common kind."""
    at = start + 12
    kind = _u16(data, at)
    if kind == 0x8100:
        at += 4
        kind = _u16(data, at)
    return kind == _PROFINET and data[at + 2] != 0xFE and captured >= 20


# After the record header: two MAC addresses, then type, frame id or tag, inner type, inner id.
_TYPES = "12xHHHH"

Found = tuple[int, int, int, int, int, bytes]
"""A frame: number, interface (0 in a pcap file), two parts of its time, original length, captured bytes.

The parts are seconds and fraction in a pcap file, high and low half in a pcapng file."""

# An entry of the loops over bytes: seven numbers of eight bytes. They are those of `Found`, with the captured
# length and the offset of the first byte in place of the bytes.
_ENTRY = 56


def _put(entries: bytearray, at: int, value: int) -> None:
    for byte in range(8):
        entries[at + byte] = value >> 8 * byte & 0xFF


def _get(entries: Bytes, at: int) -> int:
    value = 0
    for byte in range(7, -1, -1):
        value = value << 8 | entries[at + byte]
    return value


def _note(
    entries: bytearray, count: int, number: int, interface: int, high: int, low: int,
    original: int, captured: int, start: int,
) -> int:  # fmt: skip
    """Append an entry after `count` others; returns the new count."""
    at = count * _ENTRY
    _put(entries, at, number)
    _put(entries, at + 8, interface)
    _put(entries, at + 16, high)
    _put(entries, at + 24, low)
    _put(entries, at + 32, original)
    _put(entries, at + 40, captured)
    _put(entries, at + 48, start)
    return count + 1


def _found(entries: Bytes, count: int, data: Bytes) -> list[Found]:
    """The first `count` entries with their bytes from `data`."""
    found: list[Found] = []
    numbers = entries
    view: Any = data
    at, end = 0, count * _ENTRY
    while at < end:
        start = _get(numbers, at + 48)
        after = start + _get(numbers, at + 40)
        frame = view[start:after]  # compiled it is `bytes` already
        if not COMPILED:
            frame = bytes(frame)
        found.append((
            _get(numbers, at), _get(numbers, at + 8), _get(numbers, at + 16),
            _get(numbers, at + 24), _get(numbers, at + 32), frame,
        ))  # fmt: skip
        at += _ENTRY
    return found


# Only in compiled code: scan.pxd has them.
_read: Callable[[int, bytearray, int, int], int]
"""Read from a file descriptor to an offset, at most so many bytes; returns how many, 0 or less at the end."""
_unlocked: Callable[..., int]
"""`Scan._ahead` while other threads of Python run."""


class Scan:
    """What the two walks share.

    `position` is the offset of the next record in the buffer, `frames` counts the passed ones,
    `links` are the LINKTYPE_ numbers of the interfaces. `stopped` ends `ahead` soon. `paused`: the last frame
    may change what to watch, so the caller must look at it before anything else is passed.
    `interface`, `high` and `low` are of the last passed frame, as in `Found`.
    """

    def __init__(self, order: ByteOrder) -> None:
        self.position = 0
        self.frames = 0
        self.links: list[int] = []
        self.interface, self.high, self.low = 0, 0, 0
        self.stopped = False
        self.end = 0
        self.passed = 0
        self.more = False
        self._known = 0
        self._most = _FIRST_AHEAD // 2
        self._entries = bytearray()
        self._kept = bytearray()
        self.paused = False
        self._rows = bytearray(_ROW)
        self._senders = 0
        self._watches: Sequence[Watch] = ()
        self._watched: dict[bytes, _Watched] = {}
        self._ids: frozenset[int] = frozenset()
        self._runs = Runs(b"")
        self._swapped = _SWAPPED[order]
        self._big = order == "big"
        self._ports = NO_PORTS
        self._pieces = -1
        """The number of the fragmented datagram that may be the response to a Connect."""

    def tcp(self, ports: Iterable[int]) -> None:
        """From now on frames of exactly these TCP ports matter."""
        self._ports = tcp_ports(ports)

    @property
    def ports(self) -> bytes:
        """The wanted TCP ports, in the form of `tcp_ports`."""
        return self._ports

    def scan(self, data: bytearray, end: int) -> list[Found]:
        """The next frames that matter in data[:end], at most BATCH; PADDING bytes must follow `end`.

        After fewer than BATCH frames it stops at something it cannot pass: a record that is incomplete, longer
        than MAX_FRAME or, in a pcapng file, not a sound Enhanced Packet Block of a known interface.
        """
        if len(data) < end + PADDING:
            raise ValueError("no room behind the buffer")
        self.paused = False
        return self._compiled(data, end) if COMPILED else self._plain(data, end)

    def watch(self, watches: Sequence[Watch]) -> None:
        """From now on exactly these cyclic frames matter. Parts are in order and do not overlap."""
        self._watches = watches
        self._rows = _rows(watches)
        self._senders = len(watches)
        self._watched = {watch.key: _Watched(watch) for watch in watches}
        for each in self._watched.values():
            source, frame_id = each.watch.answered or (b"", 0)
            each.answered = self._watched.get(source + frame_id.to_bytes(2))
        self._ids = self._swapped.seen(watch.frame_id for watch in watches)
        self._runs.watch(self._watched)

    def is_due(self, data: bytes, link_type: int) -> bool:
        """Whether the frame after the passed ones is a watched one that is due."""
        end, frames, senders = len(data), self.frames, self._senders
        if end < 20:
            return False
        if not COMPILED:
            return self._news(data, 0, end, frames, link_type)
        return senders > 0 and _is_due(self._rows, data, 0, end, frames, senders, link_type)

    def _news(self, data: Bytes, start: int, end: int, number: int, link_type: int) -> bool:
        """`_is_due` for the loop over unpacked fields."""
        at = _rt(data, start, end, link_type)
        source = start + (12 if link_type == SLL2 else 6)
        key = bytes(data[source : source + 6] + data[at : at + 2])
        if at < 0 or (found := self._watched.get(key)) is None:
            return False
        return found.is_news(data, at + 2, end, number // _sampled(number, self._senders))

    def _wants(
        self, data: Bytes, start: int, end: int, link_type: int, original: int, number: int,
        rows: bytearray, ports: bytes,
    ) -> bool:  # fmt: skip
        """Whether the loop over bytes returns the frame data[start:end]; pauses if it may change what to watch."""
        cyclic = link_type == _ETHERNET and _is_rt(data, start, end - start)
        if not cyclic and _relevant(data, start, end, link_type, original, ports):
            self.paused = self._sets_up(data, start, end, link_type)
            return True
        senders = self._senders
        return senders > 0 and _is_due(rows, data, start, end, number, senders, link_type)

    def _sets_up(self, data: Bytes, start: int, end: int, link_type: int) -> bool:
        """Whether a frame that matters may complete a Connect, by its response or request: it says what to watch.

        Out of order, the request comes last. The first fragment shows the call, if it is long enough;
        any fragment with its number may be the last to arrive.
        """
        at = _network(data, start, end, link_type)
        if at < 0 or _kind(data, start, at, link_type) != _IPV4:
            return False
        number, fragment = _u16(data, at + 4), _u16(data, at + 6)
        if fragment & 0x1FFF:
            return number == self._pieces
        rpc = at + (data[at] & 15) * 4 + 8
        if rpc + 70 > end:
            if not fragment & 0x2000:
                return False
        elif (
            data[rpc + 1] not in (_REQUEST, _RESPONSE)
            or data[rpc + 68] != _CONNECT
            or data[rpc + 69] != _CONNECT
        ):
            return False
        if fragment & 0x2000:
            self._pieces = number
        return True

    def ahead(self, descriptor: int, data: bytearray, end: int) -> list[Found]:
        """The next frames that matter in data[:end] and in the rest of the file. Only in compiled code.

        Reads the file itself, into `data`, and lets other threads run meanwhile. Afterwards data[:self.end] is
        the rest, and `passed` bytes before it are gone. `more` says that this was enough for one call;
        otherwise it stopped at the end of the file, or at something it cannot pass, like `scan`.
        """
        self.paused = False
        links, size = self._links(), len(data) - PADDING
        if len(self._kept) < max(_KEPT, size):
            self._entries, self._kept = bytearray(_AHEAD * _ENTRY), bytearray(max(_KEPT, size))
        self._most = min(2 * self._most, _AHEAD)
        entries, kept, room = self._entries, self._kept, len(self._kept)
        rows, ports = self._rows, self._ports
        count = _unlocked(  # noqa: F821
            self, descriptor, data, end, size, links, entries, kept, room, rows, ports
        )
        return _found(entries, count, kept)

    def _links(self) -> bytes:
        """The link types in the form of the loop over bytes."""
        self._known = len(self.links)
        return struct.pack(f">{len(self.links)}I", *self.links)

    def _compiled(self, data: bytearray, end: int) -> list[Found]:
        """The loop over bytes. It also runs uncompiled, slowly."""
        if not self._entries:
            self._entries = bytearray(_BATCH * _ENTRY)
        links, entries, rows, ports = self._links(), self._entries, self._rows, self._ports
        count = self._walk(data, end, links, entries, 0, _BATCH, rows, ports)
        return _found(entries, count, data)

    def _plain(self, data: bytearray, end: int) -> list[Found]:
        """The loop over unpacked fields."""
        raise NotImplementedError

    def _walk(
        self, data: Bytes, end: int, links: Bytes, entries: bytearray, count: int, most: int,
        rows: bytearray, ports: bytes,
    ) -> int:  # fmt: skip
        """Pass records of data[:end] until there are `most` entries; returns their number."""
        raise NotImplementedError

    def _ahead(
        self, descriptor: int, data: bytearray, end: int, size: int, links: Bytes,
        entries: bytearray, kept: bytearray, room: int, rows: bytearray, ports: bytes,
    ) -> int:  # fmt: skip
        """`ahead` without Python objects: returns the number of entries; their bytes are in `kept`."""
        count, used, passed, more = 0, 0, 0, False
        while not self.stopped:
            before = count
            count = self._walk(data, end, links, entries, count, self._most, rows, ports)
            used = _keep(data, kept, used, entries, before, count)
            more = count == self._most or used + size > room or passed >= _FAR or self.paused
            if more:
                break
            passed += self.position
            end = _to_front(data, self.position, end)
            advanced, self.position = self.position, 0
            got = _read(descriptor, data, end, size - end) if advanced else 0  # noqa: F821
            if got <= 0:
                break
            end += got
        self.end, self.passed, self.more = end, passed, more
        return count


def _keep(
    data: Bytes, kept: bytearray, used: int, entries: bytearray, first: int, count: int
) -> int:
    """Append the bytes of the entries from `first` on to `kept`; returns the used length."""
    for entry in range(first, count):
        at = entry * _ENTRY
        start, captured = _get(entries, at + 48), _get(entries, at + 40)
        for byte in range(captured):
            kept[used + byte] = data[start + byte]
        _put(entries, at + 48, used)
        used += captured
    return used


def _to_front(data: bytearray, start: int, end: int) -> int:
    """Move data[start:end] to the front; returns its length."""
    for byte in range(end - start):
        data[byte] = data[start + byte]
    return end - start


class PcapScan(Scan):
    """The walk over the records of a pcap file."""

    def __init__(self, order: ByteOrder, header: int, link_type: int) -> None:
        """`header` is the length of a record header, `link_type` a LINKTYPE_ number."""
        super().__init__(order)
        self.links.append(link_type)
        self._header = header
        sign = "<>"[order == "big"]
        self._layout = struct.Struct(f"{sign}8xI{header - 12}x{_TYPES}").unpack_from
        self._record = struct.Struct(f"{sign}4I").unpack_from
        self._runs = Runs(b".{8}")

    def _walk(
        self, data: Bytes, end: int, links: Bytes, entries: bytearray, count: int, most: int,
        rows: bytearray, ports: bytes,
    ) -> int:  # fmt: skip
        big, header, link_type = self._big, self._header, _u32(links, 0, True)
        position, number, last = self.position, self.frames, end - header
        newest = -1
        while position <= last and count < most and not self.paused:
            captured = _u32(data, position + 8, big)
            start = position + header
            if captured > _MAX_FRAME or start + captured > end:
                break
            newest = position
            number += 1
            original, after = _u32(data, position + 12, big), start + captured
            if self._wants(data, start, after, link_type, original, number, rows, ports):
                seconds, fraction = _u32(data, position, big), _u32(data, position + 4, big)
                count = _note(
                    entries, count, number, 0, seconds, fraction, original, captured, start
                )
            position = start + captured
        if newest >= 0:
            self.high, self.low = _u32(data, newest, big), _u32(data, newest + 4, big)
        self.position, self.frames = position, number
        return count

    def _plain(self, data: bytearray, end: int) -> list[Found]:
        if self.links[0] in (PROFIBUS_DL, USER0):
            return self._everything(data, end)
        found: list[Found] = []
        view = memoryview(data)
        layout, record, runs = self._layout, self._record, self._runs
        swapped, header, (link_type,) = self._swapped, self._header, self.links
        profinet, ipv4, kept = swapped.profinet, swapped.ipv4, swapped.kept
        dcp, tags, ethernet = swapped.dcp, swapped.tags, link_type == ETHERNET
        position, number, last = self.position, self.frames, end - header
        ids, news, senders, ports = self._ids, self._news, self._senders, self._ports
        quiet = 0  # rejected in a row by this loop
        due = False
        newest = -1  # offset of the last record, or of a run that ends with it
        while position <= last and not self.paused:
            captured, kind, first, inner, second = layout(data, position)
            start = position + header
            after = start + captured
            if after > end or captured > MAX_FRAME:
                break
            newest, position = position, after
            number += 1
            if ethernet:
                rejected = kind not in kept
                if kind == profinet:
                    rejected = first not in dcp
                elif kind in tags:
                    rejected = inner == profinet and second not in dcp
                due = (
                    rejected
                    and (first in ids or second in ids)
                    and news(data, start, after, number, ETHERNET)
                )
                if rejected and not due:
                    quiet += 1
                    if quiet >= Runs.STRIDE and number > _LEARN_FROM:
                        before = bytes(data[start - header + 8 : start - header + 12])
                        between = b".{%d}" % (header - 12)
                        runs.learn(re.escape(before) + between, data, start, after, b"")
                        period = _sampled(number + 1, senders)
                        position, skipped = runs.skip(data, position, end - _SINGLE, number, period)
                        number += skipped
                        quiet = 0 if skipped else -Runs.STRIDE
                    continue
            quiet = Runs.STRIDE if due else 0
            seconds, fraction, _captured, original = record(data, start - header)
            plain = (
                kind == ipv4 and ethernet and captured >= _OPERATION_END and is_plain(data, start)
            )
            wanted = due or plain or _relevant(data, start, after, link_type, original, ports)
            if not wanted and senders and (kind in tags or not ethernet):
                wanted = news(data, start, after, number, link_type)
            if wanted:
                frame = view[start:after].tobytes()
                found.append((number, 0, seconds, fraction, original, frame))
                self.paused = not (due or plain) and self._sets_up(data, start, after, link_type)
                if len(found) == BATCH:
                    break
        self._ended(data, newest, position)
        self.position, self.frames = position, number
        return found

    def _ended(self, data: Bytes, at: int, position: int) -> None:
        """Keep the time of the last record before `position`; `at` is an offset at or before it, -1 for none."""
        if at < 0:
            return
        record, header = self._record, self._header
        seconds, fraction, captured, _ = record(data, at)
        while at + header + captured < position:
            at += header + captured
            seconds, fraction, captured, _ = record(data, at)
        self.high, self.low = seconds, fraction

    def _everything(self, data: bytearray, end: int) -> list[Found]:
        """As `_plain`, for a link type whose frames all matter."""
        found: list[Found] = []
        view, record, header = memoryview(data), self._record, self._header
        position, number, last, newest = self.position, self.frames, end - header, -1
        while position <= last and len(found) < BATCH:
            seconds, fraction, captured, original = record(data, position)
            start = position + header
            after = start + captured
            if after > end or captured > MAX_FRAME:
                break
            newest, position = position, after
            number += 1
            frame = view[start:after].tobytes()
            found.append((number, 0, seconds, fraction, original, frame))
        self._ended(data, newest, position)
        self.position, self.frames = position, number
        return found


class PcapngScan(Scan):
    """The walk over the Enhanced Packet Blocks of a pcapng file."""

    def __init__(self) -> None:
        super().__init__("little")
        self.section("little")

    def section(self, order: ByteOrder) -> None:
        """A section of that byte order begins; it has no interfaces yet."""
        self.links = []
        self._big = order == "big"
        self._swapped = _SWAPPED[order]
        sign = "<>"[order == "big"]
        self._block = re.escape(struct.pack(f"{sign}I", ENHANCED_PACKET))
        self._layout = struct.Struct(f"{sign}7I{_TYPES}").unpack_from
        self._word = struct.Struct(f"{sign}I").unpack_from
        self._runs = Runs(self._block)
        self.watch(self._watches)

    def _walk(
        self, data: Bytes, end: int, links: Bytes, entries: bytearray, count: int, most: int,
        rows: bytearray, ports: bytes,
    ) -> int:  # fmt: skip
        big = self._big
        position, number, last = self.position, self.frames, end - 32
        newest = -1
        while position <= last and count < most and not self.paused:
            total = _u32(data, position + 4, big)
            interface = _u32(data, position + 8, big)
            captured = _u32(data, position + 20, big)
            if _u32(data, position, big) != _ENHANCED or total & 3 or position + total > end:
                break
            if captured + 32 > total or captured > _MAX_FRAME or interface >= self._known:
                break
            if _u32(data, position + total - 4, big) != total:
                break
            start = position + 28
            newest = position
            number += 1
            link_type = _u32(links, 4 * interface, True)
            original, after = _u32(data, position + 24, big), start + captured
            if self._wants(data, start, after, link_type, original, number, rows, ports):
                high, low = _u32(data, position + 12, big), _u32(data, position + 16, big)
                count = _note(
                    entries, count, number, interface, high, low, original, captured, start
                )
            position += total
        if newest >= 0:
            self.interface = _u32(data, newest + 8, big)
            self.high, self.low = _u32(data, newest + 12, big), _u32(data, newest + 16, big)
        self.position, self.frames = position, number
        return count

    def _plain(self, data: bytearray, end: int) -> list[Found]:
        found: list[Found] = []
        view = memoryview(data)
        layout, word, runs, links = self._layout, self._word, self._runs, self.links
        swapped, known = self._swapped, len(links)
        profinet, ipv4, kept = swapped.profinet, swapped.ipv4, swapped.kept
        dcp, tags = swapped.dcp, swapped.tags
        position, number, last = self.position, self.frames, end - 32
        ids, news, senders, ports = self._ids, self._news, self._senders, self._ports
        quiet = 0  # rejected in a row by this loop
        due = False
        while position <= last and not self.paused:
            (block, total, interface, high, low, captured, original,
             kind, first, inner, second) = layout(data, position)  # fmt: skip
            after = position + total
            if block != ENHANCED_PACKET or after > end or total & 3 or captured > total - 32 \
                    or captured > MAX_FRAME or word(data, after - 4)[0] != total \
                    or interface >= known:  # fmt: skip
                break
            start = position + 28
            position = after
            number += 1
            ethernet = links[interface] == ETHERNET
            if ethernet:
                rejected = kind not in kept
                if kind == profinet:
                    rejected = first not in dcp
                elif kind in tags:
                    rejected = inner == profinet and second not in dcp
                due = (
                    rejected
                    and (first in ids or second in ids)
                    and news(data, start, start + captured, number, ETHERNET)
                )
                if rejected and not due:
                    quiet += 1
                    if quiet >= Runs.STRIDE and number > _LEARN_FROM:
                        self._learn(data, start, captured, after)
                        period = _sampled(number + 1, senders)
                        position, skipped = runs.skip(data, position, end, number, period)
                        number += skipped
                        quiet = 0 if skipped else -Runs.STRIDE
                    continue
            quiet = Runs.STRIDE if due else 0
            link_type, behind = links[interface], start + captured
            plain = (
                kind == ipv4 and ethernet and captured >= _OPERATION_END and is_plain(data, start)
            )
            wanted = due or plain or _relevant(data, start, behind, link_type, original, ports)
            if not wanted and senders and (kind in tags or not ethernet):
                wanted = news(data, start, behind, number, link_type)
            if wanted:
                frame = view[start:behind].tobytes()
                found.append((number, interface, high, low, original, frame))
                self.paused = not (due or plain) and self._sets_up(data, start, behind, link_type)
                if len(found) == BATCH:
                    break
        if number > self.frames:  # a block repeats its length at its end
            newest = position - word(data, position - 4)[0]
            self.interface, self.high, self.low = (word(data, newest + at)[0] for at in (8, 12, 16))
        self.position, self.frames = position, number
        return found

    def _learn(self, data: Bytes, start: int, captured: int, after: int) -> None:
        total, interface, length = (
            re.escape(bytes(data[at : at + 4])) for at in (start - 24, start - 20, start - 8)
        )
        rest = b".{%d}%s" % (after - 4 - start - captured, total)
        before = b"%s%s.{8}%s.{4}" % (total, interface, length)
        self._runs.learn(before, data, start, start + captured, rest)


COMPILED = type(is_pnio).__name__ != "function"
"""Whether this file runs compiled."""
