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

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

from ds47.capture import Frame
from ds47.capture.scan import ETHERNET
from ds47.gate import Gate
from ds47.model import Line, Transaction
from ds47.naming import Naming
from ds47.pairing import Channel, Job, Pairing, Peer, Place, UsualJob
from ds47.profinet import rpc
from ds47.profinet.calls import (
    Activity,
    Call,
    CallTracker,
)
from ds47.profinet.headers import (
    AR_START,
    DATA_START,
    IDENTITY_END,
    RPC_START,
    STATED,
    DatagramKey,
    Fields,
    Headers,
    conversation_key,
)
from ds47.profinet.records import (
    READ_REQUEST,
    READ_RESPONSE,
    WRITE_MULTIPLE,
    WRITE_REQUEST,
    Half,
)
from ds47.recordcalls import RecordCalls, peer
from ds47.rules import Judge

_OWN_STATUS: Final = 186
"""Of a Write response block."""
_OK: Final = bytes(4)
_READ_PARAMETERS: Final = 0x01
"""Request id: the drive is asked for values. What changes a drive goes the long way."""
_LEAST: Final = 2
_MULTIPLE: Final = WRITE_MULTIPLE.to_bytes(2, "big")
_MOST_KNOWN: Final = 65_536
"""Sides and places together."""
_SPOKE: Final = attrgetter("spoke")
_TOUCHED: Final = attrgetter("touched")
_DELIVERED: Final = attrgetter("answered")


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
        """The line of a usual job that is closed; `texts` and `alike` are what `answered` gave."""
        raise NotImplementedError

    def line(self, transaction: Transaction) -> Line:
        """The line of any transaction."""
        raise NotImplementedError


@dataclass(slots=True, eq=False, init=False)
class _Side:
    """One direction of a conversation: what its frames have in common, and what that means."""

    front: bytes
    request: bool
    headers: Headers
    activity_key: tuple[str, bytes]
    peer: Peer
    places: dict[bytes, Place]
    activity: Activity | None
    """The one of `activity_key`, in a stretch in which this side spoke."""
    spoke: int
    """When it asked last, in frames of the short way; 0: not in this stretch."""

    def __init__(self, data: bytes, pdu: rpc.Pdu) -> None:
        self.front = _front(data)
        self.request = pdu.ptype == 0
        conversation = conversation_key(pdu.source, pdu.destination, pdu.activity, pdu.ptype)
        self.headers = Headers(data, conversation, self.request, pdu.little)
        self.activity_key = (pdu.client, pdu.activity)
        self.peer = peer(pdu)
        self.places = {}
        self.activity = None
        self.spoke = 0


def _front(data: bytes) -> bytes:
    """What `Headers` compares: from the source MAC to the type of service, and the addresses."""
    return data[6:16] + data[26:34]


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
        self._datagrams = calls.datagrams
        self._running = False
        """Whether this is a stretch; of it are:"""
        self._spoken: list[_Side] = []
        self._places: list[Place] = []
        self._newest_ns = 0
        """The time of its last frame,"""
        self._newest_frame = 0
        """and its number."""
        self._requests = self._responses = 0
        self._taken = 0
        """Frames by which something was changed: a clock for who spoke last."""

    def learn(self, frame: Frame, pdu: rpc.Pdu) -> None:
        """Takes a PDU that went the long way (`rpc.from_frame`): the next one of its kind may be usual."""
        if pdu.fragmented or pdu.ptype not in (0, 2) or pdu.opnum not in (rpc.READ, rpc.WRITE):
            return
        data = frame.data
        if len(data) < DATA_START or (pdu.ptype == 2 and not self._naming.knows(pdu.source)):
            return
        identity, block = data[RPC_START:IDENTITY_END], data[AR_START:STATED]
        side = self._sides.get(identity)
        if side is None or side.front != _front(data):
            self._make_room()
            side = self._sides[identity] = _Side(data, pdu)
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
        side = self._sides.get(data[RPC_START:IDENTITY_END])
        if side is None or frame.link_type != ETHERNET or self._pairing.replaced:
            return False
        fields: Fields | None = side.headers.read(data)
        if fields is None:
            return False
        kind, seq, stated, key = fields
        now = frame.time_ns
        activity = self._activity(side) if side.activity is None else side.activity
        if activity is None or now < self._newest_ns:
            return False
        old = now > activity.quiet_until or len(activity.calls) > self._most_calls
        if old and self._calls.is_overdue(activity, now):
            return False
        if key in self._datagrams:
            return self._calls.is_known_copy(key, now)
        if kind == READ_REQUEST:
            return self._read(side, activity, old, frame, seq, key)
        if kind == READ_RESPONSE:
            return self._read_response(side, activity, old, frame, seq, key, stated)
        if kind == WRITE_REQUEST:
            return self._write(side, activity, old, frame, seq, key, stated)
        return self._write_response(side, activity, old, frame, seq, key)

    # The stretch: who takes part in it, and its end

    def _activity(self, side: _Side) -> Activity | None:
        """That of a conversation, which takes part from now on; None where there is none."""
        if not self._running:
            newest = self._records.newest_ns
            if newest is None:
                return None
            self._newest_ns, self._newest_frame = newest, self._records.newest_frame
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
        self._records.newest_frame = self._newest_frame
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
        for place in sorted(places, key=_DELIVERED):
            if place.delivered is not None:
                self._pairing.deliver(place.spot, place.delivered)
                place.delivered = None

    def _is_fresh(self, channel: Channel, now: int) -> bool:
        """`Pairing.fresh`, which looks at the channels in their order."""
        self._put_in_order()
        return self._pairing.fresh(channel, now)

    # The four frames of a transaction: first what may make them unusual, then what they do

    def _write(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey,
        stated: int,
    ) -> bool:  # fmt: skip
        place = side.places.get(frame.data[AR_START:STATED])
        if place is None or seq in activity.calls:
            return False
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None or not channel.is_free():
            return False
        now, pairing = frame.time_ns, self._pairing
        if now > pairing.quiet_until and not self._is_fresh(channel, now):
            return False
        data = frame.data[DATA_START : DATA_START + stated]
        if len(data) < _LEAST or not data[0] or data[1] != _READ_PARAMETERS:
            return False
        job = pairing.usual_write(channel, place, frame, data)
        self._asked(side, activity, old, seq, frame, key, Call(None, frame, job, now), place)
        place.writes += 1
        pairing.touch(channel, now)
        place.touched = self._taken
        return True

    def _write_response(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey
    ) -> bool:
        call = activity.calls.get(seq)
        if call is None or call.answered:
            return False
        job = call.usual
        if not isinstance(job, UsualJob) or job.job is not None or job.accepted is not None:
            return False
        data = frame.data
        if data[_OWN_STATUS : _OWN_STATUS + 4] != _OK or data[STATED - 2 : STATED] == _MULTIPLE:
            return False
        place = job.place
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None or channel.usual is not job or place.peer != side.peer:
            return False
        self._answer(activity, old, frame, key, call, place)
        job.accepted = frame
        return True

    def _read(
        self, side: _Side, activity: Activity, old: bool, frame: Frame, seq: int, key: DatagramKey
    ) -> bool:
        place = side.places.get(frame.data[AR_START:STATED])
        if place is None or seq in activity.calls:
            return False
        channel = self._channel(place) if place.channel is None else place.channel
        if channel is None:
            return False
        call = Call(None, frame, place, frame.time_ns)
        call.expected = channel.expected()
        self._asked(side, activity, old, seq, frame, key, call, place)
        place.reads += 1
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
        answer = frame.data[DATA_START : DATA_START + stated]
        if job.data[0] != answer[0]:
            return False
        self._answer(activity, old, frame, key, call, place)
        pairing.touch(channel, now)
        place.touched = place.answered = self._taken
        place.delivered = job
        wanted = int.from_bytes(asked.data[STATED : STATED + 4], "big")
        lines = self._lines
        if lines is not None and lines.answered(job, asked, frame, answer, self._judge):
            job.read, job.wanted, job.answered, job.answer = asked, wanted, frame, answer
            pairing.usual_read(channel, job, self._closed)
            return True
        request = Half(asked.number, asked.time_ns, stated=wanted)
        response = Half(frame.number, now, answer, stated, 0, 0)
        record = place.record(request, response, write=False)
        self._answered(job, pairing.careful_read(channel, job, record, self._closed))
        return True

    # What all of them do

    def _asked(
        self, side: _Side, activity: Activity, old: bool, seq: int, frame: Frame, key: DatagramKey,
        call: Call, place: Place,
    ) -> None:  # fmt: skip
        self._calls.remember(key, call.time_ns)
        self._requests += 1
        self._taken += 1
        side.spoke = place.spoke = self._taken
        if old and activity.calls:
            self._calls.expire(activity, call.time_ns)
        activity.begin(seq, call)
        self._newest_ns, self._newest_frame = call.time_ns, frame.number

    def _answer(
        self,
        activity: Activity,
        old: bool,
        frame: Frame,
        key: DatagramKey,
        call: Call,
        place: Place,
    ) -> None:
        self._calls.remember(key, frame.time_ns)
        self._responses += 1
        self._taken += 1
        place.spoke = self._taken
        if old:
            self._calls.expire(activity, frame.time_ns)
        call.answer, call.answered = frame, True
        self._newest_ns, self._newest_frame = frame.time_ns, frame.number
