"""The usual transaction by a short way: frames to `UsualJob`, without an object for every layer.

Nearly all transactions are four frames that are built alike: a Write request and its response, a Read request
and its response; each in one Ethernet frame without tag, each status 0, nothing lost, repeated or late.
`UsualWay.take` knows such frames by their bytes, and does with them what `profinet.rpc`, `profinet.calls`,
`recordcalls` and `pairing` would do. It first asks whether everything is usual, and changes nothing before
that is certain; so whatever is not goes the long way, as if this file were not there. What it leaves in the
calls and the channels becomes the objects of the long way as soon as that asks for them
(`Call.request`, `RecordCalls._context`, `Pairing.job`).

As long as one usual frame follows the other (a stretch) it is known who takes part: calls, channels and places are
looked up once, and who spoke last is noted as a number. `settle` ends the stretch, before any frame goes the long
way: it puts everything into the order in which the long way would have left it.

Not here: what a usual job says (`Lines`; `ds47.report.lines`), and when that is nothing special (`ds47.rules`).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

from ds47.capture import Frame
from ds47.capture.scan import ETHERNET, UDP
from ds47.gate import Gate
from ds47.model import Line, Transaction
from ds47.naming import Naming
from ds47.pairing import Channel, Job, Pairing, Peer, Place, UsualJob
from ds47.profinet import rpc
from ds47.profinet.calls import (
    Activity,
    Call,
    CallTracker,
    DatagramKey,
    conversation_key,
    datagram_key,
)
from ds47.profinet.records import (
    READ_REQUEST,
    READ_RESPONSE,
    WRITE_MULTIPLE,
    WRITE_REQUEST,
    WRITE_RESPONSE,
    Half,
)
from ds47.recordcalls import RecordCalls, peer
from ds47.rules import Judge

_OUTER: Final = struct.Struct(">6x10sHHHxB2x8s4xH2x64s36xH6x28sI")
"""Source MAC to type of service; total length, id, fragment; protocol, addresses; UDP length; RPC header up to
the interface version; of the record block its type, AR to index, and data length."""
_INNER: Final = (struct.Struct(">IH4xHH2xI"), struct.Struct("<IH4xHH2xI"))
"""Sequence number, opnum, length of the body, fragment; the first word of the NDR header: a status."""
_INNER_START: Final = 106
_UDP_START: Final = 34
_BODY_START: Final = 122
_STATED: Final = 178
"""Where the data length of a record block stands."""
_OWN_STATUS: Final = 186
"""Of a Write response block."""
_DATA_START: Final = 206
_BLOCK_END: Final = 84
"""Bytes of a body that ends with its record block,"""
_SECOND_BLOCK: Final = 124
"""and from which on there can be a second one."""
_OK: Final = bytes(4)
_MULTIPLE: Final = WRITE_MULTIPLE.to_bytes(2, "big")
_MOST_KNOWN: Final = 65_536
"""Sides and places together."""
_SPOKE: Final = attrgetter("spoke")
_TOUCHED: Final = attrgetter("touched")
_ACCEPTED: Final = attrgetter("accepted")


class Lines:
    """Who writes usual jobs, and all others, as lines of a report. `ds47.report.lines` has one."""

    def answered(
        self, job: UsualJob, read: Frame, frame: Frame, answer: bytes, judge: Judge
    ) -> bool:
        """Whether there is nothing to say about this answer; the job knows its text and its like then.

        `read` and `frame` are the frames of the Read.
        """
        raise NotImplementedError

    def learn(self, usual: UsualJob, job: Job, lang: str) -> None:
        """Takes a job that was judged with care, and about which there was nothing to say."""
        raise NotImplementedError

    def usual(self, job: UsualJob) -> Line:
        """The line of a usual job that is closed; `text` and `alike` are what `answered` gave."""
        raise NotImplementedError

    def line(self, transaction: Transaction) -> Line:
        """The line of any transaction."""
        raise NotImplementedError


@dataclass(slots=True, eq=False, init=False)
class _Side:
    """One direction of a conversation: what its frames have in common, and what that means."""

    front: bytes
    hosts: bytes
    request: bool
    inner: struct.Struct
    conversation_key: int
    activity_key: tuple[str, bytes]
    peer: Peer
    places: dict[bytes, Place]
    activity: Activity | None
    """The one of `activity_key`, in a stretch in which this side spoke."""
    spoke: int
    """When it asked last, in frames of the short way; 0: not in this stretch."""

    def __init__(self, front: bytes, hosts: bytes, pdu: rpc.Pdu) -> None:
        self.front = front
        self.hosts = hosts
        self.request = pdu.ptype == 0
        self.inner = _INNER[pdu.little]
        self.conversation_key = conversation_key(
            pdu.source, pdu.destination, pdu.activity, pdu.ptype
        )
        self.activity_key = (pdu.client, pdu.activity)
        self.peer = peer(pdu)
        self.places = {}
        self.activity = None
        self.spoke = 0


class UsualWay:
    """Takes what is usual; the other arguments are those who do the rest.

    Args:
        closed: called with a usual job that is over.
        answered: called with a usual job and with the same as a `Job` that was judged now.
        lines: who writes lines; without, every answer is judged with care.
    """

    def __init__(
        self,
        calls: CallTracker,
        gate: Gate,
        records: RecordCalls,
        pairing: Pairing,
        naming: Naming,
        judge: Judge,
        closed: Callable[[UsualJob], None],
        answered: Callable[[UsualJob, Job], None],
        lines: Lines | None,
    ) -> None:
        self._calls = calls
        self._open = gate.open
        self._records = records
        self._pairing = pairing
        self._naming = naming
        self._judge = judge
        self._closed = closed
        self._answered = answered
        self._lines = lines
        self._sides: dict[bytes, _Side] = {}
        self._known = 0
        self._most_calls = calls.usual_calls
        self._running = False
        """Whether this is a stretch; of it are:"""
        self._spoken: list[_Side] = []
        self._places: list[Place] = []
        self._newest_ns = 0
        """The time of its last frame."""
        self._requests = self._responses = 0
        self._taken = 0
        """Frames by which something was changed: a clock for who spoke last."""

    def learn(self, frame: Frame, pdu: rpc.Pdu) -> None:
        """Takes a PDU that went the long way (`rpc.from_frame`): the next one of its kind may be usual."""
        if pdu.fragmented or pdu.ptype not in (0, 2) or pdu.opnum not in (rpc.READ, rpc.WRITE):
            return
        data = frame.data
        if len(data) < _OUTER.size or (pdu.ptype == 2 and not self._naming.knows(pdu.source)):
            return
        fields = _OUTER.unpack_from(data)
        front, hosts, identity = fields[0], fields[5], fields[7]
        side = self._sides.get(identity)
        if side is None or side.front != front or side.hosts != hosts:
            self._make_room()
            side = self._sides[identity] = _Side(front, hosts, pdu)
        block = fields[9]
        if side.request and block not in side.places:
            place = self._records.place(pdu, block)
            if place is not None:
                self._make_room()
                side.places[block] = place

    def _make_room(self) -> None:
        """For one more side or place: what is forgotten is learnt again."""
        self._known += 1
        if self._known > _MOST_KNOWN:
            for side in self._sides.values():
                side.places = {}
            self._sides.clear()
            self._known = 1

    def take(self, frame: Frame) -> bool:
        """Whether the frame was a usual one, or a copy of one; then nothing is left to do with it."""
        data = frame.data
        if len(data) < _DATA_START or frame.link_type != ETHERNET:
            return False
        (front, total, ip_id, fragment, protocol, hosts, stated_udp, identity, kind, block, stated
         ) = _OUTER.unpack_from(data)  # fmt: skip
        side = self._sides.get(identity)
        if side is None or side.hosts != hosts or side.front != front:
            return False
        seq, opnum, length, part, status = side.inner.unpack_from(data, _INNER_START)
        size = _UDP_START + stated_udp
        end = _BODY_START + length
        if (
            fragment & 0x3FFF or part or protocol != UDP or total != stated_udp + 20
            or end > size or size > len(data) or length < _BLOCK_END
        ):  # fmt: skip
            return False
        now = frame.time_ns
        activity = self._activity(side) if side.activity is None else side.activity
        if activity is None or now < self._newest_ns:
            return False
        old = now > activity.quiet_until or len(activity.calls) > self._most_calls
        if old and self._calls.is_overdue(activity, now):
            return False
        key = datagram_key(side.conversation_key, ip_id, part, seq, data[_BODY_START:end])
        whole = _DATA_START + stated <= end
        if side.request:
            if opnum == rpc.READ and kind == READ_REQUEST:
                return self._read(side, activity, old, frame, seq, key, block)
            if opnum == rpc.WRITE and kind == WRITE_REQUEST and whole:
                return self._write(side, activity, old, frame, seq, key, block, stated)
        elif status == 0:
            if opnum == rpc.READ and kind == READ_RESPONSE and whole:
                return self._read_response(side, activity, old, frame, seq, key, stated)
            if opnum == rpc.WRITE and kind == WRITE_RESPONSE and length < _SECOND_BLOCK:
                return self._write_response(side, activity, old, frame, seq, key, block)
        return False

    # The stretch: who takes part in it, and its end

    def _activity(self, side: _Side) -> Activity | None:
        """That of a conversation, which takes part from now on; None where there is none."""
        if not self._running:
            newest = self._records.newest_ns
            if newest is None:
                return None
            self._newest_ns = newest
            self._running = True
        activity = side.activity = self._calls.activities.get(side.activity_key)
        if activity is not None:
            self._spoken.append(side)
        return activity

    def _channel(self, place: Place) -> Channel | None:
        """That of a place, which takes part from now on; None where there is none, or it is not ours."""
        proven = place.ar_key in self._open
        if not proven and not place.always:
            return None
        channel = place.channel = self._pairing.channels.get(place.key)
        if channel is not None:
            place.proven = proven
            self._places.append(place)
        return channel

    def settle(self) -> None:
        """Ends the stretch; what was only noted in it stands where the long way looks for it."""
        if not self._running:
            return
        self._running = False
        self._put_in_order()
        self._records.newest_ns = self._newest_ns
        counts = self._calls.counts
        counts["requests"] += self._requests
        counts["responses"] += self._responses
        self._requests = self._responses = 0
        for side in self._spoken:
            side.activity = None
        for place in self._places:
            place.leave()
        self._spoken.clear()
        self._places.clear()

    def _put_in_order(self) -> None:
        """Who spoke last comes last, everywhere where the oldest is forgotten first."""
        activities, channels = self._calls.activities, self._pairing.channels
        for side in sorted(self._spoken, key=_SPOKE):
            if side.spoke:
                activities.move_to_end(side.activity_key)
                side.spoke = 0
        places = self._places
        for place in sorted(places, key=_TOUCHED):
            if place.touched:
                channels.move_to_end(place.key)
                place.touched = 0
        for place in sorted(places, key=_SPOKE):
            if place.spoke and place.proven:  # as `Gate.passes`
                self._open.move_to_end(place.ar_key)
            place.spoke = 0
        for place in sorted(places, key=_ACCEPTED):
            if place.newest is not None:
                self._pairing.remember(place.spot, place.newest)
                place.newest = None

    def _is_fresh(self, channel: Channel, now: int) -> bool:
        """`Pairing.fresh`, which looks at the channels in their order."""
        self._put_in_order()
        return self._pairing.fresh(channel, now)

    # The four frames of a transaction: first what may make them unusual, then what they do

    def _write(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey,
        block: bytes, stated: int,
    ) -> bool:  # fmt: skip
        place = side.places.get(block)
        if place is None or seq in activity.calls:
            return False
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None or not channel.is_free():
            return False
        now, pairing = frame.time_ns, self._pairing
        if now > pairing.quiet_until and not self._is_fresh(channel, now):
            return False
        data = frame.data[_DATA_START : _DATA_START + stated]
        if not data or not data[0]:
            return False
        if self._calls.seen(key, now):
            return True
        job = pairing.usual_write(channel, place, frame, data)
        self._asked(side, activity, old, seq, Call(None, frame, job, now), place)
        place.counts["write"] += 1
        pairing.touch(channel, now)
        place.touched = self._taken
        return True

    def _write_response(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey,
        block: bytes,
    ) -> bool:  # fmt: skip
        call = activity.calls.get(seq)
        if call is None or call.answered or block.endswith(_MULTIPLE):
            return False
        job = call.usual
        if not isinstance(job, UsualJob) or job.job is not None or job.accepted is not None:
            return False
        if frame.data[_OWN_STATUS : _OWN_STATUS + 4] != _OK:
            return False
        place = job.place
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None or channel.usual is not job or place.peer != side.peer:
            return False
        if not self._calls.seen(key, frame.time_ns):
            self._answer(activity, old, frame, call, place)
            job.accepted = frame
            place.newest, place.accepted = job, self._taken
        return True

    def _read(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey,
        block: bytes,
    ) -> bool:  # fmt: skip
        place = side.places.get(block)
        if place is None or seq in activity.calls:
            return False
        if place.channel is None and self._channel(place) is None:
            return False
        now = frame.time_ns
        if not self._calls.seen(key, now):
            self._asked(side, activity, old, seq, Call(None, frame, place, now), place)
            place.counts["read"] += 1
        return True

    def _read_response(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey,
        stated: int,
    ) -> bool:  # fmt: skip
        call = activity.calls.get(seq)
        if call is None or call.answered or not stated:
            return False
        place, asked, now = call.usual, call.asked, frame.time_ns
        if not isinstance(place, Place) or asked is None or place.peer != side.peer:
            return False
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None:
            return False
        job, pairing = channel.usual, self._pairing
        if job is None or job.job is not None or job.accepted is None:
            return False
        if now > pairing.quiet_until and not self._is_fresh(channel, now):
            return False
        answer = frame.data[_DATA_START : _DATA_START + stated]
        if job.data[0] != answer[0]:
            return False
        if self._calls.seen(key, now):
            return True
        self._answer(activity, old, frame, call, place)
        pairing.touch(channel, now)
        place.touched = self._taken
        wanted = int.from_bytes(asked.data[_STATED : _STATED + 4], "big")
        lines = self._lines
        if lines is not None and lines.answered(job, asked, frame, answer, self._judge):
            job.read, job.wanted, job.answered, job.answer = asked, wanted, frame, answer
            pairing.usual_read(channel, job, self._closed)
            return True
        request = Half(asked.number, asked.time_ns, stated=wanted)
        response = Half(frame.number, now, answer, stated, 0, 0)
        record = place.record(request, response, write=False)
        self._answered(job, pairing.careful_read(channel, record))
        return True

    # What all of them do

    def _asked(
        self, side: _Side, activity: Activity, old: bool, seq: int, call: Call, place: Place
    ) -> None:
        self._requests += 1
        self._taken += 1
        side.spoke = place.spoke = self._taken
        if old and activity.calls:
            self._calls.expire(activity, call.time_ns)
        activity.begin(seq, call)
        self._newest_ns = call.time_ns

    def _answer(
        self, activity: Activity, old: bool, frame: Frame, call: Call, place: Place
    ) -> None:
        self._responses += 1
        self._taken += 1
        place.spoke = self._taken
        if old:
            self._calls.expire(activity, frame.time_ns)
        call.answer, call.answered = frame, True
        self._newest_ns = frame.time_ns
