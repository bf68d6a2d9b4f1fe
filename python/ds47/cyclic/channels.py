"""From cyclic frames to the content of their channels: which bytes are a channel, and what changed in them.

Relations come from Connects, or are named by hand; a later Connect of the same stations replaces what an earlier
one said. Transactions of PKW are handed out when their relation is proven: a request and the response that
followed it were seen. PZD is proven by its words, or by PKW beside it. `handshake` and `timeline` decide what a
change of the bytes means; `ds47.capture` finds the frames that this module watches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from ds47.capture.scan import Watch
from ds47.cyclic import named
from ds47.cyclic.handshake import ERROR, INCOMPLETE, OK, CycleMoment, PkwChannel, PkwJob
from ds47.cyclic.named import Name
from ds47.cyclic.operation import Operation
from ds47.cyclic.relations import CyclicRelation, CyclicSide, channels, offset_of, side
from ds47.cyclic.sequences import Head, Sequences
from ds47.cyclic.timeline import Recorder
from ds47.findings.remark import Remark
from ds47.model import CONFIGURED, LENGTHS, NAMED, ODD, PKW, PZD, REFUTED, SEEN, Timeline
from ds47.profinet.connect import parse_request, parse_response
from ds47.profinet.link import GROUP, Packet
from ds47.profinet.rpc import Pdu, device_identity
from ds47.spec.cyclic import drive_telegrams
from ds47.spec.semantics import Limits

_NONE: Mapping[int, int] = {}
_ANY = 0x10000
"""More bytes than any frame has."""
_FRAME_ID = 2
_COUNTER = 2
_COUNTERS = 1 << 16
_MAC = len("00:11:22:33:44:55")
_VALID, _GOOD = 0x04, 0x80
"""The bit of the status of a frame that says that its data is valid, and that of IOPS."""
_KEPT = 256
"""Transactions that wait for the proof."""
_PATIENCE = 8192
"""Frames of what might be PZD that are looked at without a proof: something else changes all the time."""
_SLOWER, _ALLOWED = 1.25, 3
"""What a sender may be slower than its cycle, and how many frames it may be short of, before some are missing."""
_LATE = 2
_HABIT, _PAUSE = 32, 4
"""After so many exchanges with a station one that comes so many times as late as any before it shows a hole."""
"""Cycles from a change of a request to the next frame of the drive: of those between some are missing."""
_DENSE, _RAREST = 1024, 1024
"""Of data exchange that says what was said before all is looked at for so long, and then one of ever more."""
_SPEED = "NSOLL"
"""How the name of a word begins that is a setpoint of speed."""


class MixedFrames(NamedTuple):
    """Frames of two drives under one id: a frame that proves it, device, MAC address of the sender, frame id."""

    frame: int
    device: str
    sender: str
    frame_id: int


class _Line(Protocol):
    """One relation at work; `start_ns` is the time of its first frame, from which its cycles are counted.

    `looks`: frames of the drive and of the controller that were looked at, which count where no cycle is known.
    `rate`: frames of both in a nanosecond, 0 where no Connect tells it.
    """

    relation: CyclicRelation
    start_ns: int | None
    looks: list[int]
    rate: float

    def take(self, sent: bool, words: bytes, at: CycleMoment) -> None:
        """What the controller (`sent`) or the device says from a frame on."""
        ...

    def lost(self, sent: bool, at: CycleMoment) -> None:
        """What it says is not valid from a frame on."""
        ...

    def skipped(self, first: int, since_ns: int, last: int, /) -> None:
        """Frames are missing between two; `since_ns`: the time of the first."""
        ...

    def stopped(self, at: CycleMoment, /) -> None:
        """The data exchange stopped behind a frame, and started again: no frame is missing."""
        ...

    def finish(self, within_ns: int | None = None, /) -> None:
        """Nothing more comes; `within_ns` as `PkwChannel.finish` has it."""
        ...


@dataclass(slots=True)
class _Requests:
    """A relation of PKW; what is over waits until one transaction proves the relation."""

    relation: CyclicRelation
    closed: Callable[[CyclicRelation, PkwJob], None]
    proven: Callable[[CyclicRelation], None]
    channel: PkwChannel = field(init=False)
    waiting: list[PkwJob] = field(default_factory=list)
    start_ns: int | None = None
    looks: list[int] = field(default_factory=lambda: [0, 0])
    valid: set[bool] = field(default_factory=set)
    rate: float = 0.0
    """Frames of both directions in a nanosecond; 0 where no Connect tells it."""
    changed: CycleMoment | None = None
    """When the words of the controller changed first, until a frame of the drive comes."""
    shared: bool = False
    """Whether other drives use the same frame id: the scan gives all frames, as it cannot tell them apart."""
    asked: bool = False
    """Whether anything was."""
    doubt: set[bool] = field(default_factory=set)
    """Directions (`sent`) with frames of perhaps two sequences: finished jobs wait until that is known."""

    def __post_init__(self) -> None:
        relation = self.relation
        self.channel = PkwChannel(self._over, fresh=relation.is_bus and relation.certainty != NAMED)
        self.rate = _rate(relation)

    def take(self, sent: bool, words: bytes, at: CycleMoment) -> None:
        self.valid.add(sent)
        if not sent:
            self.channel.answered(words, at)
        elif self.channel.sent(words, at):
            self.changed = self.changed or at

    def passes(self, at: CycleMoment) -> None:
        """A frame of the drive comes; before its words."""
        since, self.changed = self.changed, None
        if since is not None and self.rate:
            waited = at.time_ns - since.time_ns
            if waited >= _LATE * self.relation.input.cycle_ns:
                self.skipped(since.frame, since.time_ns, at.frame)

    def skipped(self, first: int, since_ns: int, last: int) -> None:
        """Frames are missing between two; `since_ns`: the time of the first."""
        seen_ns = since_ns - _LATE * self.relation.input.cycle_ns
        self.channel.skipped(first, last, seen_ns)

    def stopped(self, at: CycleMoment, /) -> None:
        """The data exchange stopped: nobody is to blame for what is open."""
        self.channel.lost(at)

    def lost(self, sent: bool, at: CycleMoment) -> None:
        if sent in self.valid:
            self.valid.remove(sent)
            self.channel.lost(at, out=sent, answers=not sent)

    def finish(self, within_ns: int | None = None, /) -> None:
        self.channel.finish(within_ns)
        self.doubt.clear()
        self._hand_out()

    @property
    def unused(self) -> bool:
        """Whether no request was seen where one might have been; only when nothing more comes."""
        return self.relation.certainty in (LENGTHS, CONFIGURED) and not self.asked

    def unanswered(self, cycles: int) -> PkwJob | None:
        """What stood for so long, where all reads as requests, nothing has a response, and nothing proves PKW.

        Where all is incomplete, what stands when the capture ends.
        """
        waiting = self.waiting if self.relation.certainty == LENGTHS else []
        if not all(each.is_ignored or each.state == INCOMPLETE for each in waiting):
            return None
        long = [each for each in waiting if each.stood >= cycles and (each.is_ignored or each.ends)]
        return min(long, key=lambda each: each.ends, default=None)

    def _over(self, job: PkwJob) -> None:
        relation, self.asked = self.relation, True
        if relation.certainty in (LENGTHS, CONFIGURED) and _proves(job):
            relation.certainty = SEEN
            self.proven(relation)
        if len(self.waiting) < _KEPT:
            self.waiting.append(job)
        self._hand_out()

    def _hand_out(self) -> None:
        if self.relation.certainty != LENGTHS and not self.doubt:
            for each in self.waiting:
                self.closed(self.relation, each)
            self.waiting.clear()


@dataclass(slots=True)
class DriveWords:
    """A relation of PZD with what its words say; `behind` PKW in one submodule only PKW can prove it."""

    relation: CyclicRelation
    recorder: Recorder
    behind: bool = False
    refuted: bool = False
    """Whether its bytes turned out to be PKW."""
    looked_at: int = 0
    is_speed: bool = False
    """Whether the telegrams without a setpoint of speed are left out."""
    start_ns: int | None = None
    looks: list[int] = field(default_factory=lambda: [0, 0])
    replaced: int | None = None
    """The frame in which its channel was set up anew, or from which on its frames are of two drives."""
    rate: float = 0.0
    """Half of that of requests: frames that are a little out of order are no hole."""
    holes: int = 0
    first_hole: int = 0
    """How often frames of both sides are missing, and the frame after the first gap."""

    def __post_init__(self) -> None:
        self.rate = _rate(self.relation) / 2

    @property
    def proven(self) -> bool:
        """Whether it seems to be a drive."""
        return self.relation.certainty in (SEEN, NAMED) and not (
            self.refuted or self.recorder.refuted
        )

    @property
    def hopeless(self) -> bool:
        """Whether it was looked at for long, and nothing speaks for a drive."""
        return self.looked_at > _PATIENCE and not self.proven

    def take(self, sent: bool, words: bytes, at: CycleMoment) -> None:
        """What the controller (`sent`) or the device says from a frame on."""
        self.looked_at += 1
        recorder = self.recorder
        (recorder.sent if sent else recorder.answered)(words, at.frame, at.time_ns)
        self._prove()
        if recorder.refuted and self.relation.certainty == NAMED:
            self.relation.certainty = REFUTED
        if recorder.speed and not self.is_speed:
            self.is_speed = True
            numbers = self.relation.telegrams
            self.relation.telegrams = tuple(each for each in numbers if _is_speed((each,)))

    def skipped(self, _first: int, since_ns: int, last: int) -> None:
        """Frames are missing between two, if its own began before; `since_ns`: the time of the first."""
        if self.start_ns is None or self.start_ns > since_ns:
            return
        self.holes, self.first_hole = self.holes + 1, self.first_hole or last
        self.recorder.skipped()

    def stopped(self, _: CycleMoment, /) -> None:
        """The data exchange stopped: what the drive did until it started again is unknown."""
        self.recorder.skipped()

    def lost(self, sent: bool, at: CycleMoment) -> None:
        """What it says is not valid from a frame on."""
        self.recorder.lost(sent, at.frame, at.time_ns)

    def finish(self, _: int | None = None, /) -> None:
        """Nothing more comes."""
        numbers = self.relation.telegrams
        beside_pkw = bool(numbers) and all(drive_telegrams()[each].pkw for each in numbers)
        self.recorder.finish(beside_pkw or self.relation.is_bus)
        self._prove()
        self.recorder.operation.finish()
        if self.relation.certainty == NAMED and not self.recorder.has_sense and all(self.looks):
            self.relation.certainty = ODD

    def _prove(self) -> None:
        if self.recorder.proven and not self.behind and self.relation.certainty == LENGTHS:
            self.relation.certainty = SEEN

    def cut(self, since: Head | None) -> None:
        """From this frame on its frames are of two drives: what was seen in them does not count."""
        if since is not None:
            self.recorder.cut(since.frame, since.time_ns)
        self.refuted = self.refuted or since is None or not self.recorder.events

    def remarks(self) -> Iterator[Remark]:
        """What was wrong with its operation; when nothing more comes."""
        recorder = self.recorder
        if not recorder.has_sense:
            return
        for frame in recorder.trips.frames:
            yield self._of_fault("DS520", frame)
        since = recorder.fault_since
        if since is not None and since not in recorder.trips.frames:
            yield self._of_fault("DS533", since)
        yield from recorder.operation.remarks

    def _of_fault(self, rule: str, frame: int) -> Remark:
        code = self.recorder.fault_code(frame)
        what = "pzd_fault" if code is None else "pzd_fault_number"
        return Remark(rule, frame, self.recorder.operation.where | {"what": what, "code": code})


@dataclass(slots=True)
class _Row:
    """The channels in the data of one station of PROFIBUS, and what it said last where a change matters."""

    ends: list[tuple[_Line, CyclicSide, bool]]
    parts: tuple[tuple[int, int], ...] = ()
    first: int = 0
    need: int = 0
    """Where that begins, and how many bytes data with all of it has."""
    said: bytes = b""
    count: int = 0
    due: int = 0
    """The count from which on the next one is looked at, whatever it says: values move in all of them."""
    answered: _Row | None = None
    """Of a master: that of the station whose next data is looked at, too, where this is news."""
    newest: int = 0
    newest_ns: int = 0
    """The frame of the newest data, its time,"""
    longest_ns: int = 0
    """and the longest time between two of them."""
    restarted: bool = False
    """Whether the station was set up anew since the newest data."""

    def __post_init__(self) -> None:
        self.parts = _apart(each.parts for _, each, _ in self.ends)
        self.first, self.need = self.parts[0][0], sum(self.parts[-1])

    def pause(self, frame: int, time_ns: int) -> None:
        """Where the next data comes much later than any before it, exchanges are missing, or there were none."""
        passed = time_ns - self.newest_ns
        if self.count > _HABIT and passed > _PAUSE * self.longest_ns > 0:
            for line, _, sent in self.ends:
                if self.restarted:
                    line.stopped(CycleMoment(self.newest, self.newest_ns, line.looks[sent]))
                else:
                    line.skipped(self.newest, self.newest_ns, frame)
        elif self.count:
            self.longest_ns = max(self.longest_ns, passed)
        self.restarted = False
        self.newest, self.newest_ns = frame, time_ns

    def is_news(self, data: bytes) -> bool:
        """Whether data says something else than the one before it, or is due."""
        self.count += 1
        if len(self.parts) == 1:
            said = data[self.first : self.need]
        else:
            said = b"".join([data[at : at + length] for at, length in self.parts])
        if said == self.said and self.count < self.due and len(data) >= self.need:
            return False
        step = 1 if said != self.said else min(max(self.count // _DENSE, 1), _RAREST)
        if said != self.said and self.answered is not None:
            self.answered.due = 0
        self.said, self.due = said, self.count + step
        return True


class CyclicChannels:
    """All channels of drives in the cyclic frames of a capture.

    Args:
        closed: gets each finished transaction of a proven relation.
        watch: gets the cyclic frames to watch from now on.
        bounds: how many relations and events are kept.
        wanted: which channels to look for. PKW is always one of them: it proves the PZD beside it.
        vendor: the vendor of a device by its IP address, if the capture does not show it.
        maker: the vendor of a station by its MAC address, for channels named by hand.
    """

    def __init__(
        self,
        closed: Callable[[CyclicRelation, PkwJob], None],
        watch: Callable[[Sequence[Watch]], None],
        bounds: Limits,
        wanted: Sequence[str] = (PKW, PZD),
        vendor: Callable[[str], int | None] | None = None,
        maker: Callable[[str], int | None] = lambda _: None,
    ) -> None:
        self._vendor = vendor
        self._maker = maker
        self._closed = closed
        self._watch = watch
        self._wanted = {PKW, *wanted}
        self._bounds = bounds
        self._lines: list[_Line] = []
        self._sides: dict[tuple[str, int], list[tuple[_Line, CyclicSide, bool]]] = {}
        """By sender and frame id,"""
        self._looked = 0, 0
        """Frame and time of the last one that was looked at."""
        self._busiest: float = 0.0
        """The highest rate of a channel."""
        self._sides_to: dict[tuple[str, int, str], list[tuple[_Line, CyclicSide, bool]]] = {}
        """and by receiver, too."""
        self._shared: set[tuple[str, int]] = set()
        """Senders and frame ids with frames that also go to receivers outside any relation."""
        self._sequences: dict[tuple[str, int, str], Sequences] = {}
        """By sender, frame id and receiver."""
        self._newest: dict[tuple[str, int, str], tuple[int, int | None]] = {}
        """Time and cycle counter of the newest frame, by the same."""
        self.late = 0, 0
        """How many frames stand behind a later one of their sender, and the first."""
        self.mixed: list[MixedFrames] = []
        """Frames in which it is proven that those of several sequences take turns."""
        self._rows: dict[bytes, _Row] = {}
        """Those of stations of PROFIBUS, by their source."""
        self._relations: list[CyclicRelation] = []
        self._named: list[CyclicRelation] = []
        self._drives: list[DriveWords] = []
        self._without_request: list[CyclicRelation] = []
        self._ignored: list[tuple[CyclicRelation, PkwJob]] = []
        self._asked: set[tuple[object, ...]] = set()
        """Drives that got a request, perhaps in a relation that another one has replaced."""
        self.is_set_up = False
        """Whether a Connect was seen with its response, whatever it sets up."""

    def drives(self) -> list[DriveWords]:
        """The proven relations of PZD."""
        return [each for each in self._drives if each.proven]

    def unused(self) -> list[CyclicRelation]:
        """Where PKW is as sure as the process data beside it, and no request was seen; when nothing more comes."""
        return [
            each for each in self._without_request
            if each.drive_key not in self._asked and self._is_beside(each)
        ]  # fmt: skip

    def unanswered(self) -> list[tuple[CyclicRelation, PkwJob]]:
        """What reads as a request beside the words of a drive, and has no response; when nothing more comes."""
        return [each for each in self._ignored if self._is_beside(each[0])]

    def _is_beside(self, pkw: CyclicRelation) -> bool:
        """Whether what may be PKW stands beside the words of a drive, and is not these."""
        keys = [each.relation.drive_key for each in self.drives()]
        return pkw.drive_key in keys and not self._is_pzd(pkw)

    def timelines(self) -> list[Timeline]:
        """What happened to each of them."""
        relations = self.relations()
        return [
            Timeline(
                1 + next(n for n, each in enumerate(relations) if each is drive.relation),
                it.result(), it.left_out, it.end_ns, it.setpoint.points, it.actual.points,
            )
            for drive in self.drives() for it in (drive.recorder,)
        ]  # fmt: skip

    def relations(self) -> list[CyclicRelation]:
        """All that there were, those that a later Connect replaced too; of PZD those that are proven."""
        drives = [each.relation for each in self.drives()]
        return [
            each for each in self._relations
            if any(each is drive for drive in drives) or each.is_named
            or (each.channel == PKW and not self._is_pzd(each))
        ]  # fmt: skip

    def _is_pzd(self, pkw: CyclicRelation) -> bool:
        """Whether the bytes of what might be PKW turned out to be the words of a drive."""
        return pkw.certainty == LENGTHS and any(
            each.proven and not each.behind
            and (each.relation.drive_key, each.relation.spot) == (pkw.drive_key, pkw.spot)
            for each in self._drives
        )  # fmt: skip

    def connected(self, request: Pdu, response: Pdu) -> None:
        """A Connect and its response; nothing happens where it was refused, or sets up no such channel."""
        asked, answer = parse_request(request), parse_response(response)
        if asked is None or answer is None or answer[0] != asked.ar:
            return
        self.is_set_up = True
        device_mac, frame_ids = answer[1:]
        identity = device_identity(response.object_uuid)
        vendor_id = identity[0] if identity else self._vendor and self._vendor(request.server)
        connect = asked.answered(frame_ids)
        output, input_ = (
            bytes.fromhex(mac.replace(":", "")) for mac in (asked.controller_mac, device_mac)
        )
        self._drop(output, input_, response.frame, connect.frame_lengths())
        for found in channels(connect, vendor_id):
            if found.channel not in self._wanted:
                continue
            if len(self._relations) >= self._bounds.relations:
                break
            submodule, about = found.submodule, (found.channel, found.offset)
            assert submodule.output is not None
            assert submodule.input is not None
            made = CyclicRelation(
                found.channel, request.client, request.server, vendor_id, asked.ar,
                submodule.api, submodule.slot, submodule.subslot, found.telegrams,
                side(submodule.output, asked.controller_mac, *about),
                side(submodule.input, device_mac, *about), response.frame,
            )  # fmt: skip
            if self._agrees(made):
                self._add(made, behind=found.offset > 0)
        self._tell()

    def _agrees(self, found: CyclicRelation) -> bool:
        """Whether a channel of a Connect may be one: what was named in its bytes wins, and is set up there."""
        for name in self._named:
            meets, is_same = name.meets(found)
            if is_same:
                found.certainty = NAMED
                self._set_up(name, found.frame)
            elif meets and (name.channel == PKW or found.channel == PZD):
                return False  # PKW where PZD was named proves itself
        return True

    def _set_up(self, name: CyclicRelation, frame: int | None) -> None:
        """What was named has its Connect; where no frame came before, there was nothing else."""
        for line in [each for each in self._lines if each.relation is name]:
            self._leave(line, frame)
        if name.frame is None:
            self._relations = [each for each in self._relations if each is not name]
            self._drives = [each for each in self._drives if each.relation is not name]

    def name(self, names: Sequence[Name]) -> None:
        """Channels that a user names, before the first frame.

        Raises:
            ValueError: two of them are no relation.
        """
        for relation in named.relations(names):
            if relation.channel in self._wanted:
                self._add(relation)
                self._named.append(relation)
        if self._lines:
            self._tell()

    def identify(self) -> None:
        """Of whom the drives are whose channels were named, as far as the capture has shown it."""
        for each in self._named:
            each.vendor_id = self._maker(each.device)

    def configured(
        self,
        relations: Sequence[CyclicRelation],
        output: bytes,
        input_: bytes,
        frame: int | None = None,
    ) -> None:
        """A station of PROFIBUS gets its configuration: the channels in its data, in place of those before.

        `output` and `input_` are the sources of both sides (`ppo.source`): there may be no channel any more.
        """
        self.is_set_up = True
        relations = [each for each in relations if each.channel in self._wanted]
        if self._is_set_up_so(relations, output):
            if output in self._rows:
                self._rows[output].restarted = True
            return
        self._drop(output, input_, frame)
        for relation in relations:
            if len(self._relations) < self._bounds.relations:
                self._add(relation)
        self._tell()

    def _is_set_up_so(self, relations: Sequence[CyclicRelation], output: bytes) -> bool:
        """Whether these channels are at work already: a station that starts again has the same ones."""
        there = [line.relation for line in self._lines if line.relation.output.source == output]
        return [_shape(each) for each in there] == [_shape(each) for each in relations]

    def exchanged(self, source: bytes, data: bytes, frame: int, time_ns: int) -> None:
        """Data of a station of PROFIBUS; one side of a relation at a time (`ppo.source`)."""
        row, given_up = self._rows.get(source), False
        if row is None:
            return
        if row.ends[0][2]:
            row.pause(frame, time_ns)
        if not row.is_news(data):
            return
        for line, each, sent in row.ends:
            if len(data) >= each.offset + each.length:
                self._take(line, each, sent, data, frame, time_ns)
            if isinstance(line, DriveWords) and line.hopeless:
                self._lines.remove(line)
                given_up = True
        if given_up:
            self._tell()

    def _drop(
        self, output: bytes, input_: bytes, frame: int | None, lengths: Mapping[int, int] = _NONE
    ) -> None:
        """The stations set up all their channels anew; what was named stays where it fits the frames."""
        for line in list(self._lines):
            relation = line.relation
            stays = any(relation is each for each in self._named) and all(
                each.offset + each.length <= lengths.get(each.frame_id, _ANY)
                for each in (relation.output, relation.input)
            )
            if (relation.output.source, relation.input.source) == (output, input_) and not stays:
                self._leave(line, frame)

    def _leave(self, line: _Line, frame: int | None) -> None:
        self._end(line)
        self._lines = [each for each in self._lines if each is not line]
        if isinstance(line, DriveWords):  # what becomes of its fault the next one shows
            line.recorder.fault_since = None
            line.replaced = frame

    def _add(self, relation: CyclicRelation, behind: bool = False) -> None:
        self._relations.append(relation)
        if relation.channel == PKW:
            self._lines.append(_Requests(relation, self._closed, self._proven))
            return
        fault, warning = (
            offset_of(word, relation.telegrams) for word in ("FAULT_CODE", "WARN_CODE")
        )
        codes = None if fault is None or warning is None else (warning, fault)
        where = {"device": relation.device, "slot": relation.slot}
        operation = Operation(where, self._bounds)
        speed = _is_speed(relation.telegrams)
        recorder = Recorder(
            operation,
            not relation.is_foreign,
            speed,
            codes,
            self._bounds.events,
            relation.is_of_others,
        )
        drive = DriveWords(relation, recorder, behind)
        self._drives.append(drive)
        self._lines.append(drive)

    def _proven(self, pkw: CyclicRelation) -> None:
        """A relation is PKW: what is beside or behind it is PZD, and nothing else is in its bytes."""
        beside = [each for each in self._drives if each.relation.drive_key == pkw.drive_key]
        for each in list(beside):
            if each.relation.spot == pkw.spot and not each.behind:
                each.refuted = True
                beside.remove(each)
        if len(beside) == 1 and beside[0].relation.certainty != NAMED:
            beside[0].relation.certainty = SEEN

    def _tell(self) -> None:
        self._sides, self._sides_to, self._sequences = {}, {}, {}
        for line in self._lines:
            for each, sent in ((line.relation.output, True), (line.relation.input, False)):
                key, end = (each.source.hex(":"), each.frame_id), (line, each, sent)
                self._sides.setdefault(key, []).append(end)
                self._sides_to.setdefault((*key, _receiver(end)), []).append(end)
        for key, ends in self._sides.items():
            for line, _, sent in ends:
                if sent and isinstance(line, _Requests):
                    line.shared = self._is_shared(key, ends)
        self._busiest = max((each.rate for each in self._lines), default=0.0)
        self._rows = {
            bytes.fromhex(source.replace(":", "")): _Row(found)
            for (source, _), found in self._sides.items() if len(source) < _MAC
        }  # fmt: skip
        for row in self._rows.values():
            answered = _answered(row.ends)
            row.answered = self._rows.get(answered[0]) if answered is not None else None
        self._watch([
            Watch(
                bytes.fromhex(key[0].replace(":", "")), key[1],
                _apart(_parts(found, shared := self._is_shared(key, found))),
                follows=any(not each.cycle_ns for _, each, _ in found),
                answered=None if shared else _answered(found),
            )
            for key, found in self._sides.items()
            if len(key[0]) == _MAC
        ])  # fmt: skip

    def _is_shared(self, key: tuple[str, int], ends: list[tuple[_Line, CyclicSide, bool]]) -> bool:
        """Whether frames of one sender and frame id go to several receivers."""
        return key in self._shared or len({_receiver(end) for end in ends}) > 1

    def frame(self, packet: Packet) -> None:
        """A cyclic frame."""
        data, given_up = packet.payload, False
        found = self._ends(packet)
        if found and self._is_late(packet, found[0][1]):
            return
        self._look(packet.frame, packet.time_ns)
        if found and self._are_mixed(packet, found):
            return
        for line, each, sent in found:
            if len(data) >= _FRAME_ID + max(each.offset + each.length, (each.status or 0) + 1):
                self._take(line, each, sent, data[_FRAME_ID:], packet.frame, packet.time_ns)
            if isinstance(line, DriveWords) and line.hopeless:
                self._lines.remove(line)
                given_up = True
        if given_up:
            self._tell()

    def _look(self, frame: int, time_ns: int) -> None:
        """Tells each channel where there are fewer frames between two looks than it would have sent alone."""
        (first, since), self._looked = self._looked, (frame, time_ns)
        passed, there = time_ns - since, _SLOWER * (frame - first) + _ALLOWED
        if passed * self._busiest <= there:
            return
        for line in self._lines:
            if passed * line.rate > there:
                line.skipped(first, since, frame)

    def _ends(self, packet: Packet) -> list[tuple[_Line, CyclicSide, bool]]:
        """The directions of relations that are in a frame: two controllers may have the same frame id."""
        key = packet.src_mac or "", int.from_bytes(packet.payload[:_FRAME_ID])
        receiver = packet.dst_mac or ""
        to_it = self._sides_to.get((*key, receiver))
        if to_it is None and receiver and not int(receiver[:2], 16) & GROUP:
            if key not in self._shared:
                self._shared.add(key)
                self._tell()
            return []  # its Connect is not in the capture
        return to_it or self._sides.get(key, [])

    def _is_late(self, packet: Packet, side: CyclicSide) -> bool:
        """Whether a frame stands behind a later one of its sender: what it says is no news.

        The cycle counter goes back, too, else somebody set the clock; without one the time alone tells it.
        """
        key = _way(packet, side)
        counter = _counter(packet.payload[_FRAME_ID:], side)
        time_ns, before = self._newest.get(key, (packet.time_ns, counter))
        back_ns = time_ns - packet.time_ns
        went_on = None if counter is None or before is None else (counter - before) % _COUNTERS
        if 0 < back_ns < self._bounds.disorder_ns and (
            went_on is None or not 0 < went_on < _COUNTERS // 2
        ):
            count, first = self.late
            self.late = count + 1, first or packet.frame
            return True
        self._newest[key] = packet.time_ns, counter
        return False

    def _are_mixed(self, packet: Packet, found: list[tuple[_Line, CyclicSide, bool]]) -> bool:
        """Whether the frames of several sequences take turns: nothing is said of their relations any more."""
        line, side, _ = found[0]
        data = packet.payload[_FRAME_ID:]
        counter = _counter(data, side)
        if counter is None or not side.cycle_ns:
            return False
        key = _way(packet, side)
        sequences = self._sequences.get(key)
        if sequences is None:
            sequences = self._sequences[key] = Sequences(side.cycle_ns)
        several = sequences.are_several(counter, packet.time_ns, data, packet.frame)
        for each, _, sent in found:
            if isinstance(each, _Requests):
                (each.doubt.add if sequences.are_doubtful else each.doubt.discard)(sent)
        if not several:
            return False
        self.mixed.append(MixedFrames(packet.frame, line.relation.device, key[0], side.frame_id))
        gone = [line for line, _, _ in found]
        for line in gone:
            self._asked.add(line.relation.drive_key)
            if isinstance(line, DriveWords):
                line.cut(sequences.since)
                line.replaced = packet.frame
        self._lines = [line for line in self._lines if not any(line is each for each in gone)]
        self._tell()
        return True

    def _take(
        self, line: _Line, each: CyclicSide, sent: bool, data: bytes, frame: int, time_ns: int
    ) -> None:
        if line.start_ns is None:
            line.start_ns = time_ns
        if line.relation.frame is None:
            line.relation.frame = frame
        line.looks[sent] += 1
        cycle = (time_ns - line.start_ns) / each.cycle_ns if each.cycle_ns else line.looks[sent]
        at = CycleMoment(frame, time_ns, cycle)
        if isinstance(line, _Requests) and not sent:
            line.passes(at)
        if (each.status is None or data[each.status] & _VALID) and (
            each.iops is None or data[each.iops] & _GOOD
        ):
            line.take(sent, data[each.offset : each.offset + each.length], at)
        else:
            line.lost(sent, at)

    def finish(self) -> None:
        """The capture ends."""
        self.identify()
        for line in self._lines:
            self._end(line, self._bounds.unread_ns)

    def _end(self, line: _Line, within_ns: int | None = None) -> None:
        line.finish(within_ns)
        if isinstance(line, _Requests):
            job = line.unanswered(self._bounds.pkw_cycles)
            if job is not None:
                self._ignored.append((line.relation, job))
            if line.unused:
                self._without_request.append(line.relation)
            else:
                self._asked.add(line.relation.drive_key)


def _parts(
    ends: list[tuple[_Line, CyclicSide, bool]], shared: bool
) -> Iterator[tuple[tuple[int, int], ...]]:
    """What matters in frames of one sender and frame id; to several receivers each one does.

    What one of these says may be what another one said last.
    """
    for line, each, sent in ends:
        yield each.parts
        answers = not sent and isinstance(line, _Requests) and line.shared
        if (shared or answers) and each.status is not None:
            yield ((each.status - _COUNTER, _COUNTER),)


def _rate(relation: CyclicRelation) -> float:
    """Frames of both directions in a nanosecond; 0 where no Connect tells it."""
    cycles = relation.output.cycle_ns, relation.input.cycle_ns
    return sum(1 / each for each in cycles) if all(cycles) else 0.0


def _answered(ends: list[tuple[_Line, CyclicSide, bool]]) -> tuple[bytes, int] | None:
    """Source and frame id of the drive where requests of PKW are in frames: what it says next is looked at."""
    asked = (line.relation.input for line, _, sent in ends if sent and isinstance(line, _Requests))
    return next(((each.source, each.frame_id) for each in asked), None)


def _counter(data: bytes, side: CyclicSide) -> int | None:
    """The cycle counter of a frame; None if its offset is unknown, or the capture cut it."""
    if side.status is None or len(data) <= side.status:
        return None
    return int.from_bytes(data[side.status - _COUNTER : side.status])


def _way(packet: Packet, side: CyclicSide) -> tuple[str, int, str]:
    """Sender, frame id and receiver of a cyclic frame; "" where a cooked header does not know one."""
    return packet.src_mac or "", side.frame_id, packet.dst_mac or ""


def _receiver(end: tuple[_Line, CyclicSide, bool]) -> str:
    """The MAC address to which a direction goes."""
    line, _, sent = end
    return (line.relation.input if sent else line.relation.output).source.hex(":")


def _shape(relation: CyclicRelation) -> tuple[object, ...]:
    """What makes it another channel when it differs."""
    return relation.channel, relation.vendor_id, relation.output, relation.input


def _is_speed(numbers: tuple[int, ...]) -> bool | None:
    """Whether the word behind STW1 is a speed in all of these telegrams; None where some have another word."""
    known = {drive_telegrams()[number].out[1].startswith(_SPEED) for number in numbers}
    return known.pop() if len(known) == 1 else None


def _proves(job: PkwJob) -> bool:
    """Whether the drive responded to a request that was seen to begin, and with an edge of its own."""
    return job.state in (OK, ERROR) and job.began and not job.settled


def _apart(parts: Iterable[tuple[tuple[int, int], ...]]) -> tuple[tuple[int, int], ...]:
    """Parts of several channels of one frame in order, each byte in one of them."""
    bytes_ = sorted({
        at for several in parts for first, count in several for at in range(first, first + count)
    })  # fmt: skip
    found: list[tuple[int, int]] = []
    for at in bytes_:
        if found and sum(found[-1]) == at:
            found[-1] = found[-1][0], found[-1][1] + 1
        else:
            found.append((at, 1))
    return tuple(found)
