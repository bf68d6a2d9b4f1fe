"""From a capture to transactions and findings: the pipeline.

    frames -> RPC messages -> record calls -> jobs -> transactions with findings

Each step is a module of its own; this one only joins them. It prints nothing and knows no output format.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

from ds47.acyclic import learning
from ds47.acyclic.index47 import SHARED_INDEX, ArKey, Index47
from ds47.acyclic.judge import Judge
from ds47.acyclic.pairing import Job, Outcome, Pairing
from ds47.acyclic.record_calls import OPERATIONS, RecordCalls
from ds47.acyclic.record_events import RecordEvents
from ds47.acyclic.transactions import build, summarise
from ds47.capture import Capture, CaptureError, Frame, Series, open_capture, sha256
from ds47.capture.scan import Watch
from ds47.diagnosis import Diagnoses
from ds47.findings.collection import Findings, rules_of_others
from ds47.findings.remark import AnyJob, Remark
from ds47.findings.times import NO_CLOCK, FrameTimes
from ds47.model import (
    CHANNELS,
    DS47,
    PKW,
    PZD,
    S7,
    CaptureResult,
    Finding,
    Relation,
    Transaction,
    worst,
)  # fmt: skip
from ds47.profibus import LINK_TYPES
from ds47.profidrive import Options, decode_response
from ds47.profidrive.dictionary import Dictionary, explain_transaction
from ds47.profidrive.drive_objects import DriveObjects
from ds47.profinet.calls import CallTracker
from ds47.profinet.completeness import Completeness, Missing
from ds47.profinet.ip import Reassembler
from ds47.profinet.link import Packets
from ds47.profinet.records import ChannelKey, Half, Record
from ds47.profinet.rpc import GivenUp, from_frame, parse
from ds47.profinet.stations import Stations as Names
from ds47.s7.choices import Choices
from ds47.s7.late import LateCommunication
from ds47.spec import s7
from ds47.spec.semantics import limits
from ds47.spec.statuses import status_hex

if TYPE_CHECKING:
    from ds47.acyclic.lines import ProfibusLine
    from ds47.cyclic.channels import CyclicChannels
    from ds47.cyclic.conclusions import Conclusions
    from ds47.cyclic.handshake import PkwJob
    from ds47.cyclic.named import Name
    from ds47.cyclic.relations import CyclicRelation
    from ds47.parameters.lists import ParameterList
    from ds47.profinet.link import Packet
    from ds47.profinet.rpc import Pdu
    from ds47.s7.communication import Communication
    from ds47.s7.model import S7Job

OnTransaction = Callable[[Transaction, list[Finding]], None]


class Early(NamedTuple):
    """Listeners that hear of things at once, not only when a transaction is over (`ds47.watch`).

    Attributes:
        settled: gets a transaction as soon as it has its response, or its Write was refused, with the
            findings so far. `on_transaction` gets it again when it is over.
        found: gets a finding at once, if its transaction is not over yet or it belongs to none.
    """

    settled: OnTransaction
    found: Callable[[Finding], None]


class AnalysisOptions(NamedTuple):
    """What a user may choose.

    Attributes:
        indices: further record indices that carry the parameter channel.
        slow_ms: a transaction is slow if the drive takes longer than that; None for the shipped limit.
        select: rule ids or prefixes to report; empty for all.
        ignore: rule ids or prefixes to leave out.
        codec: dialects of the parameter channel.
        digest: whether to compute the SHA-256 of the file (reads every byte).
        pkw_layouts: the layout of IND ("cyclic" or "uss", docs/cyclic.md 2) by the IP address of the device;
            "" for all others.
        channels: which of `model.CHANNELS` to report.
        cyclic: channels in cyclic frames named by hand: two names each, in the order of `cyclic.named.pairs`.
        ppos: numbers of PPO by the address of the station, for captures of PROFIBUS without Chk_Cfg.
        s7: choices for S7 communication.
        vendor_id: PROFINET vendor id for devices without one in the capture; None: they have none.
        lists: lists of parameters that name what the drive does not name itself.
    """

    indices: frozenset[int] = frozenset()
    slow_ms: float | None = None
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    codec: Options = Options()
    digest: bool = False
    pkw_layouts: tuple[tuple[str, str], ...] = ()
    channels: tuple[str, ...] = CHANNELS
    cyclic: tuple[Name, ...] = ()
    ppos: tuple[tuple[int, int], ...] = ()
    s7: Choices = Choices()
    vendor_id: int | None = None
    lists: tuple[ParameterList, ...] = ()


def analyze(
    source: str | Path | BinaryIO | Capture | Series,
    options: AnalysisOptions | None = None,
    on_transaction: OnTransaction | None = None,
) -> CaptureResult:
    """Analyses one capture.

    Args:
        source: path, "-" for standard input, a binary stream, or an open capture or series.
        options: choices of the user.
        on_transaction: called for each finished transaction with its findings. The result then holds
            no transactions, and only findings that belong to none; memory grows with these alone. `id`
            counts in the order in which transactions began.

    Raises:
        ds47.capture.CaptureError: the source cannot be read at all.
    """
    options = options or AnalysisOptions()
    if isinstance(source, (Capture, Series)):
        return _told(source, options, on_transaction)
    with open_capture(source) as capture:
        result = _told(capture, options, on_transaction)
    if options.digest and isinstance(source, (str, Path)) and str(source) != "-":
        result.sha256 = sha256(source)
    return result


def _told(
    capture: Capture | Series, options: AnalysisOptions, on_transaction: OnTransaction | None
) -> CaptureResult:
    """The result. A file without a Connect is read again: who sends cyclic frames? What are its frames at all?"""
    analysis = Analysis(options, on_transaction)
    result = analysis.run(capture)
    alone = isinstance(capture, Capture) and Path(capture.path).is_file()
    if alone and result.frames and analysis.lacks_connect:
        from ds47.cyclic.senders import RT_MARK, senders

        with suppress(CaptureError), open_capture(capture.path) as again:
            result.senders = [] if again.lacks(RT_MARK) else senders(again.everything())
        if result.nothing:
            from ds47.capture.kinds import kinds

            with suppress(CaptureError), open_capture(capture.path) as again:
                result.others = kinds(again.everything())
    return result


@dataclass(slots=True, eq=False, repr=False)
class _Over:
    """A finished transaction of PKW or S7, as its findings refer to it."""

    order: int
    device: str
    over: bool = True


def _names(lists: Sequence[ParameterList]) -> Callable[..., object] | None:
    """What gives a transaction the names from lists; None without lists, so that most captures import nothing."""
    if not lists:
        return None
    from ds47.parameters import naming
    from ds47.parameters.catalogue import Catalogue

    catalogue = Catalogue(lists)
    return lambda transaction, *device: naming.explain(transaction, catalogue, *device)


class Analysis:
    """One run over one capture; most want `analyze`.

    Args:
        options: choices of the user.
        on_transaction: as for `analyze`.
        early: hears more, and earlier than `on_transaction`, which it needs. The result then holds no
            findings.
    """

    def __init__(
        self,
        options: AnalysisOptions,
        on_transaction: OnTransaction | None,
        early: Early | None = None,
    ) -> None:
        self._options = options
        self._on_transaction = on_transaction
        self._early = early
        bounds = limits()
        slow_ms = options.slow_ms
        slow_ns = bounds.slow_ns if slow_ms is None else int(slow_ms * 1e6)
        self._times = FrameTimes(bounds.frame_times)
        self._findings = Findings(
            options.select, options.ignore, early and early.found, self._times, bounds.lone_findings,
            rules_of_others(options.channels),
        )  # fmt: skip
        self._outcomes: list[Outcome] = []
        index47 = Index47(
            options.indices, bounds.waiting_calls, bounds.waiting_ars, bounds.proven_ars,
            self._outcomes,
        )  # fmt: skip
        self._judge = Judge(
            bounds, slow_ns,
            lambda peer, frame: index47.waits(peer.device) or self._pairing.may_lack(peer, frame),
        )  # fmt: skip
        self._name = _names(options.lists)
        self._built: Callable[[Job], Transaction] = build if self._name is None else self._named
        self._dictionary = Dictionary(self._judge.objects, bounds.described_parameters)
        self._completeness = Completeness(
            bounds.activities, lambda station: self._lines.line.lost(station) if self._lines else 0
        )
        self._diagnoses = Diagnoses(options.codec, self._completeness, self._judge.shown)
        self._pairing = Pairing(bounds, self._outcomes, self._completeness)
        self._stations = Names(bounds.stations, options.vendor_id)
        self._vendor = self._stations.vendor if options.vendor_id is not None else None
        self._layouts = dict(options.pkw_layouts)
        self._cyclic: Conclusions | None = None
        """What is in cyclic frames; None until something sets it up or names it."""
        self._events = RecordEvents(index47, self._pairing, options.codec, self._outcomes)
        self._records = RecordCalls(
            self._events, self._pairing, self._outcomes, self._completeness, bounds, self._vendor
        )
        self._calls = CallTracker(bounds, self._completeness, self._stations)
        ports = options.s7.every_port if S7 in options.channels else ()
        self._s7 = LateCommunication(ports, self._made_s7, bounds.s7_memories)
        self._packets = Packets(
            Reassembler(
                bounds.fragment_expiry_ns, bounds.ip_datagrams, bounds.ip_fragments,
                bounds.fragment_bytes,
            )
        )  # fmt: skip
        self._lines: ProfibusLine | None = None
        """What PROFIBUS adds; None until its first frame."""
        self._answers: dict[Job, list[Remark]] = {}
        self._unsure: dict[ArKey, deque[tuple[int, Callable[[], None]]]] = {}
        """Calls that wait until an AR with a question has proved itself (P20), each with the time of its event."""
        self._remarks: dict[AnyJob, list[Remark]] = {}
        """The transport findings of open jobs."""
        self._transactions: dict[int, Transaction] = {}
        """By the order of their jobs, so that the jobs themselves need not be kept."""
        self._unproven: set[str] = set()
        """S7 servers that were not known as drives yet when one of their jobs was over."""
        self._ended: Counter[tuple[str, str]] = Counter()
        """How many transactions ended, by state and operation."""
        self._worst = -1
        """The worst severity of a finding that was handed out with its transaction."""
        self._objects = DriveObjects()
        self._capture: Capture | Series | None = None
        self._untimed = False
        """Whether its frames have no times, as in some logs of PROFIBUS."""

    def run(self, capture: Capture | Series) -> CaptureResult:
        """Reads the capture to its end and sums up."""
        self._capture = capture
        if self._options.cyclic:
            self._channels().name(self._options.cyclic)
        capture.tcp(self._s7.ports)
        self._frames(capture)
        self._findings.frames_dropped = capture.gaps
        for packet, have in self._packets.unfinished():
            self._given_up(packet, have)
        self._process()
        self._s7.finish()
        for what, call, message in self._calls.finish():
            self._records.handlers[what](call, message)
        self._process()
        if self._lines is not None:
            self._lines.finish()
        self._pairing.finish(self._events.newest_ns)
        self._process()
        self._records.finish()
        self._events.finish()
        self._process()
        self._operation()
        self._proven_late()
        self._diagnose(capture)
        asked = self._events.requests
        return CaptureResult(
            path=capture.path,
            frames=capture.frames,
            start_ns=capture.first_ns,
            end_ns=capture.last_ns,
            complete=capture.complete,
            problem=capture.problem,
            dropped=capture.dropped,
            files=capture.files if isinstance(capture, Series) else [],
            rpc=self._calls.counts,
            records={
                str(index): {"read": asked[index, False], "write": asked[index, True]}
                for index in sorted({index for index, _ in asked})
            },
            devices=self._stations.devices(),
            transactions=self._numbered(),
            findings=self._findings.result(self._transactions),
            diagnoses=self._findings.diagnoses(),
            summary=summarise(self._ended),
            worst=self._worst,
            relations=self._relations(),
            timelines=[] if self._cyclic is None else self._channels().timelines(),
            bus=None if self._lines is None else self._lines.result(capture.timed),
            connections=self._s7.result(),
            connections_left_out=self._s7.left_out,
        )

    @property
    def lacks_connect(self) -> bool:
        """Whether cyclic channels are wanted, but no Connect sets one up and none is named by hand."""
        wanted = {PKW, PZD} & set(self._options.channels)
        told = self._cyclic is not None and self._channels().is_set_up
        return bool(wanted) and not (self._options.cyclic or told)

    def _relations(self) -> list[Relation]:
        """All channels in cyclic frames, if PKW or PZD is reported: timelines refer to them by number."""
        if self._cyclic is None or not {PKW, PZD} & set(self._options.channels):
            return []
        return [each.result() for each in self._channels().relations()]

    def _frames(self, frames: Capture | Series) -> None:
        times, other, handlers = self._times, self._other, self._records.handlers
        for frame in frames:
            on_bus = frame.link_type in LINK_TYPES
            self._untimed = on_bus and not frames.timed
            if not self._untimed:
                times.newest = frame
                if times.room:
                    times.room, now = times.room - 1, frame.time_ns
                    times.numbers.append(frame.number)
                    times.times.append(now if -NO_CLOCK < now < NO_CLOCK else NO_CLOCK)
            if on_bus:
                if self._lines is None:
                    self._lines = self._made_lines()
                self._lines.take(frame)
            elif (pdu := from_frame(frame) or other(frame)) is not None:
                if pdu.cut is not None and pdu.opnum in OPERATIONS:
                    self._diagnoses.cut(pdu.cut)
                for what, call, message in self._calls.take(pdu):
                    handlers[what](call, message)
            if self._outcomes:
                self._process()

    def _other(self, frame: Frame) -> Pdu | None:
        """The PDU in a frame that `from_frame` does not take, or that it completes; None without one.

        Everything else in the frame goes to the step that takes it.
        """
        if self._s7.frame(frame):
            return None
        packet = self._packets.packet(frame)
        for each in self._packets.given_up():
            self._given_up(*each)
        for first in self._packets.begun():
            if (begun := parse(first)) is not None:
                self._calls.take_fragment(begun)
        return None if packet is None else self._brought(packet)

    def _brought(self, packet: Packet) -> Pdu | None:
        """The same for a packet."""
        if packet.kind == "rt":
            if self._cyclic is not None:
                self._cyclic.channels.frame(packet)
        elif packet.kind == "tcp":
            self._s7.packet(packet)
        elif packet.kind != "udp":
            self._stations.station(packet)
        elif (pdu := parse(packet)) is not None:
            return pdu
        elif packet.missing and packet.cut is not None:
            self._diagnoses.cut(packet.cut)
        return None

    def _given_up(self, packet: Packet, have: int, limit: str = "") -> None:
        """An IP datagram was given up before it was complete."""
        pdu = parse(packet)
        if pdu is not None:
            self._records.incomplete(GivenUp(pdu, have, limit), "IP", self._calls.open_call(pdu))

    def _process(self) -> None:
        """Processes the outcomes of the steps, in the order in which they happened."""
        for what, about, more in self._outcomes:
            if what == "answered":
                self._answered(about)
            elif what == "closed":
                self._closed(about)
            elif what == "asked":
                self._judge.asked(about)
                self._tell(about.key, self._diagnoses.asked, about)
            elif what == "remark":
                channel = about.job.key if about.job else more.channel if more else None
                self._tell(channel, self._remark, about)
            elif what == "refused":
                self._refused(about)
            elif what == "nothing":
                self._nothing_to_read(about, more)
            elif what == "connected":
                self._judge.connected(about, more)
            elif what == "set_up":
                self._channels().connected(about, more)
            elif what == "foreign":
                self._diagnoses.foreign(about)
            else:
                self._proof(what, about)
        self._outcomes.clear()

    def _proof(self, what: str, ar: ArKey) -> None:
        """An AR needs a proof, has it, or is none of a drive: then what waits for the proof is dropped."""
        if what == "questions":
            self._unsure[ar] = deque()
            return
        unsure = self._unsure.pop(ar)
        for _, tell in unsure if what == "proven" else ():
            tell()

    def _tell(
        self,
        channel: ChannelKey | None,
        tell: Callable[..., None],
        *about: Any,
        refused: bool = False,
    ) -> None:
        """Calls `tell` once its channel is known to be one of DS47 (P20).

        A live watch waits less: not at all for a refusal, else until a Read is unlikely to come (`unread_ns`).
        """
        unsure = self._unsure.get(channel[:3]) if self._unsure and channel else None
        if unsure is None or channel is None or channel[-1] != SHARED_INDEX:
            tell(*about)
            return
        live, now = self._early is not None, self._events.newest_ns
        unsure.append((now, partial(tell, *about)))
        while live and unsure and (refused or now - unsure[0][0] > limits().unread_ns):
            unsure.popleft()[1]()

    def _made_s7(self) -> Communication:
        from ds47.s7.communication import Communication  # few captures have any

        choices = self._options.s7 if S7 in self._options.channels else None
        return Communication(choices, limits(), self._communicated, self._remark, self._drive)

    def _made_lines(self) -> ProfibusLine:
        from ds47.acyclic.lines import ProfibusLine  # few captures have one

        return ProfibusLine(
            limits(), self._events, self._pairing, self._outcomes, self._channels(),
            dict(self._options.ppos), self._options.vendor_id,
        )  # fmt: skip

    def _diagnose(self, capture: Capture | Series) -> None:
        """What only the whole capture can show."""
        if DS47 in self._options.channels:
            for remark in self._diagnoses.finish(
                capture.dropped, capture.gaps, capture.complete, excerpt=capture.excerpt
            ):
                self._findings.add(remark)
        frame, count = self._findings.left_out
        if count:
            args = {"limit": "lone_findings", "most": limits().lone_findings, "count": count}
            self._findings.add(Remark("DS109", frame, args), of_all=True)

    def _remark(self, remark: Remark) -> None:
        """A transport finding. If transactions are handed out, it goes with that of its job."""
        if remark.rule == "DS107":
            self._diagnoses.steps_back(remark.frame, remark.args["milliseconds"])
        job = remark.job
        if self._on_transaction is not None and job is not None:
            if not job.over:
                self._remarks.setdefault(job, []).append(remark)
                if self._early is not None and self._findings.wanted(remark.rule):
                    self._early.found(self._findings.finding(remark, job.order))
                return
            remark.job = None  # handed out already
        self._findings.add(remark)

    def _answered(self, job: Job) -> None:
        half, message, device = job.read_response, job.message, job.peer.device
        if half is not None and half.data:
            job.response = decode_response(half.data, message, self._options.codec, cut=half.cut)
        remarks = self._answers[job] = self._judge.answered(job)
        if not self._dictionary.is_empty or (message is not None and message.describes):
            learning.answered(self._dictionary, job)
        if device not in self._s7.drives:
            self._tell(job.key, self._s7.records, device)
        if self._early is not None:  # more remarks come when it is over
            self._tell(job.key, self._settled, job, list(remarks), self._early)

    def _refused(self, job: Job) -> None:
        self._judge.refused(job)
        if self._early is not None:
            learning.ask(self._dictionary, job)
            self._settled(job, self._judge.closed(job), self._early)

    def _settled(self, job: Job, remarks: list[Remark], early: Early) -> None:
        if DS47 not in self._options.channels:
            return
        remarks = remarks + self._remarks.get(job, [])
        self._hand_out(job.order, self._built(job), remarks, early.settled)

    def _closed(self, job: Job) -> None:
        remarks = self._answers.pop(job, None)
        response = job.response
        if response is None:
            learning.ask(self._dictionary, job)
        if remarks is None:
            remarks = self._judge.unanswered(job, dropped=self._findings.frames_dropped)
            if job.limit and job.write_request is not None:
                self._events.push_out(job.limit, job.write_request.frame)
        remarks += self._judge.closed(job)
        if not job.shows_nothing_new:
            remarks += self._diagnoses.closed(job)
        transaction = self._built(job)
        if self._untimed:
            transaction.duration_ns = None
        if response is not None and response.failed and self._cyclic is not None:
            for remark in self._cyclic.transaction(transaction):
                remark.job = job
                remarks.append(remark)
        if self._unsure:
            refused = transaction.state == "refused"
            self._tell(job.key, self._over, job, transaction, remarks, refused=refused)
        else:
            self._over(job, transaction, remarks)

    def _over(self, job: Job, transaction: Transaction, remarks: list[Remark]) -> None:
        """A transaction is over, and known to be one of DS47."""
        if not job.shows_nothing_new or self._diagnoses.storms:
            self._diagnoses.over(job)
            self._objects.transaction(transaction)
        remarks += self._remarks.pop(job, ())
        job.forget()
        if DS47 in self._options.channels:
            self._finished(job, transaction, remarks)

    def _named(self, job: Job) -> Transaction:
        """The transaction of a job, with the names from lists."""
        transaction = build(job)
        if self._name is not None:
            self._name(transaction, job.peer.vendor_id, job.peer.device_id)
        return transaction

    def _channels(self) -> CyclicChannels:
        if self._cyclic is None:
            # slow to import, and captures of record calls alone need none
            from ds47.cyclic.channels import CyclicChannels
            from ds47.cyclic.conclusions import Conclusions

            channels = CyclicChannels(
                self._exchanged, self._watch, limits(), self._options.channels, self._vendor,
                self._stations.vendor_of,
            )  # fmt: skip
            self._cyclic = Conclusions(limits(), self._layout, channels)
        return self._cyclic.channels

    def _layout(self, device: str) -> str:
        """The layout of IND for a device: its own, the one for all others, or that of cyclic transfer."""
        from ds47.cyclic.pkw import CYCLIC

        return self._layouts.get(device, self._layouts.get("", CYCLIC))

    def _watch(self, watches: Sequence[Watch]) -> None:
        """Sets the cyclic frames that matter from the next frame on."""
        if self._capture is not None:
            self._capture.watch(watches)

    def _exchanged(self, relation: CyclicRelation, job: PkwJob) -> None:
        """A transaction of PKW is over."""
        from ds47.cyclic.transactions import build as build_pkw

        assert self._cyclic is not None
        self._cyclic.channels.identify()
        transaction = build_pkw(relation, job, self._layout(relation.device))
        explain_transaction(self._dictionary, transaction, relation.vendor_id, relation.family)
        if self._name is not None:
            self._name(transaction, relation.vendor_id, None)
        self._objects.transaction(transaction)
        if relation.is_bus:
            unseen = 0 if self._lines is None else self._lines.unseen(relation.device)
            if unseen >= job.request.at.frame:
                job.heard = False  # its response may be missing from the capture of the line
        order, remarks = self._pairing.number(), self._cyclic.exchanged(relation, job)
        remarks += self._cyclic.transaction(transaction)
        if PKW in self._options.channels:
            self._cyclic.reported(relation, job)
            self._finished(_Over(order, transaction.device), transaction, remarks)

    def _drive(self, ip: str) -> str | None:
        """What shows so far, apart from S7 and record calls, that an IP address is a drive or a CPU."""
        drives = () if self._cyclic is None else self._cyclic.channels.drives()
        if any(each.relation.device == ip for each in drives):
            return "cyclic"
        identity, kind = self._stations.identity(ip), self._stations.kind(ip)
        if identity is not None and s7.is_drive_device(*identity):
            return "device"
        if kind is not None and s7.is_drive(kind):
            return "station"
        return s7.CPU if s7.is_cpu(kind, identity) else None

    def _communicated(self, job: S7Job, remarks: list[Remark]) -> None:
        """A job of S7 is over."""
        from ds47.s7.transactions import build as build_s7  # few captures have S7

        job.order = self._pairing.number()
        of_drive = self._s7.is_drive(job.partner.ip)
        if not of_drive:
            self._unproven.add(job.partner.ip)
        transaction = build_s7(job, of_drive=of_drive)
        self._finished(_Over(job.order, transaction.device), transaction, remarks)

    def _proven_late(self) -> None:
        """Names elements in the S7 jobs of a drive that were over before it was known as one."""
        late = set(filter(self._s7.is_drive, self._unproven))
        if not late:
            return
        from ds47.s7.transactions import name_elements

        for transaction in self._transactions.values():
            if transaction.channel == S7 and transaction.device in late:
                name_elements(transaction)

    def _finished(self, job: AnyJob, transaction: Transaction, remarks: list[Remark]) -> None:
        """A transaction is over: it is counted, and handed out or kept."""
        self._ended[transaction.state, transaction.operation] += 1
        if self._on_transaction is not None:
            self._hand_out(job.order, transaction, remarks, self._on_transaction)
            return
        self._transactions[job.order] = transaction
        for remark in remarks:
            remark.job = job
            self._findings.add(remark)

    def _operation(self) -> None:
        """What the cyclic channels, and the stations of PROFIBUS, show when the capture is over."""
        if self._cyclic is not None:
            self._cyclic.channels.finish()
            for remark in self._cyclic.finish():
                self._findings.add(remark)
        for remark in self._lines.remarks() if self._lines is not None else ():
            self._findings.add(remark)

    def _hand_out(
        self, order: int, transaction: Transaction, remarks: list[Remark], to: OnTransaction
    ) -> None:
        objects, transaction.id = self._objects, order
        transaction.drive_object = objects.reached(transaction)
        if objects.telegrams:
            transaction.telegram = objects.telegram(transaction)
        findings: list[Finding] = []
        if remarks:
            remarks = [remark for remark in remarks if self._findings.wanted(remark.rule)]
            transaction.findings = sorted({remark.rule for remark in remarks})
            findings = [self._findings.reported(remark, order) for remark in remarks]
            self._worst = max(self._worst, worst(findings))
        to(transaction, findings)

    def _nothing_to_read(self, record: Record, missing: Missing | None) -> None:
        half = record.response
        if half is None or half.status is None:
            return  # it is DS108, the cause
        remark = self._not_asked(record, half)
        if remark.rule == "DS808":
            missing = None
        elif missing is not None:
            remark = Remark("DS110", half.frame, missing._asdict())
        # The proof may come when much more is missing: that is not before this frame.
        self._tell(record.channel, self._diagnoses.nothing_to_read, record, missing)
        self._tell(record.channel, self._findings.add, remark)

    def _not_asked(self, record: Record, half: Half) -> Remark:
        """The finding for a Read that found nothing: DS808 if nothing was written since the start-up."""
        status, device, index = status_hex(half.status or 0), record.peer.device, record.index
        if self._lines is not None and self._lines.was_never_written(device, index, half.frame):
            args = {"device": device, "index": index, "status": status}
            return Remark("DS808", half.frame, args)
        return Remark("DS206", half.frame, {"status": status})

    def _numbered(self) -> list[Transaction]:
        """The transactions in the order of their first frame, then of the position inside it."""
        ordered = sorted(self._transactions.values(), key=lambda t: (t.frames.first(), t.position))
        for number, transaction in enumerate(ordered, 1):
            transaction.id, transaction.drive_object = number, self._objects.reached(transaction)
        return ordered
