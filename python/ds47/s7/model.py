"""The data of S7 communication: connections, PDUs, items, jobs (docs/s7.md).

Plain values only. The other modules of this room fill and read them; nothing is decoded, paired or judged here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from ds47.spec.words import Flaw

GET, PUT, BSEND, USEND = OPERATIONS = ("get", "put", "bsend", "usend")
OK, ERROR, PARTIAL, REFUSED, UNANSWERED, INCOMPLETE, ORPHAN = (
    "ok", "error", "partial", "refused", "unanswered", "incomplete", "orphan",
)  # fmt: skip
"""States of a job: all items succeeded, none, some; the whole job was refused; no answer; no answer, but the
capture has a gap there; no request."""
DB = 0x84
"""The area of data blocks; other areas have no number."""
ELEMENTS = frozenset((0x1C, 0x1D))
"""Areas whose addresses are numbers of elements: counters and timers."""
DONE = 0xFF
"""The return code of an item that succeeded."""


class End(NamedTuple):
    """One end of a TCP connection."""

    ip: str
    port: int


class At(NamedTuple):
    """Where something is in the capture: the frame that completes it, nanoseconds since 1970."""

    frame: int
    time_ns: int


class Cut(NamedTuple):
    """Frames that the capture truncated."""

    frame: int
    """The first of them."""
    frames: int
    captured: int
    """The most bytes that the capture has of one."""


@dataclass(slots=True, init=False)
class S7Address:
    """The address of an item: `count` elements of `size` from `start`, in bits (timers and counters: in elements).

    Jobs with the same address share one object, so it must not be changed.
    """

    area: int
    """Its code (spec/s7.toml)."""
    db: int
    """Number of the data block; 0 in all other areas."""
    start: int
    size: int
    """Bits of one element; 0 if unknown."""
    count: int
    transport: int
    """Transport size of the item (spec/s7.toml)."""
    end: int = field(compare=False, repr=False)
    """The first bit after it (timers and counters: the first element)."""
    length: int = field(compare=False, repr=False)
    """Bytes of its data."""

    def __init__(
        self, area: int, db: int, start: int, size: int, count: int, transport: int = 2
    ) -> None:
        self.area = area
        self.db = db
        self.start = start
        self.size = size
        self.count = count
        self.transport = transport
        self.end = start + count * (1 if area in ELEMENTS else size)
        self.length = (count * size + 7) // 8

    def __hash__(self) -> int:
        return hash((self.area, self.db, self.start, self.size, self.count, self.transport))


@dataclass(slots=True, init=False, eq=False)
class S7Item:
    """One variable of a job, or one area of a USEND; the data of a BSEND is one item."""

    address: S7Address | None
    """None if the request is missing, if its syntax is unknown, and for BSEND and USEND."""
    value: bytes | None
    """The value that was read, or was to be written; None if it is missing."""
    code: int | None
    """The return code of the partner (spec/s7.toml); None without an answer, and for BSEND and USEND."""
    syntax: int | None
    """Syntax of the address, if it is an unknown one."""

    def __init__(
        self,
        address: S7Address | None,
        value: bytes | None = None,
        code: int | None = None,
        syntax: int | None = None,
    ) -> None:
        self.address = address
        self.value = value
        self.code = code
        self.syntax = syntax


@dataclass(slots=True, eq=False)
class BsendSegment:
    """A part of a BSEND."""

    at: At
    size: int
    """Bytes of data."""
    number: int
    """Its position in the stream of segments, as the sender counts."""
    sequence: int
    last: bool
    pdu: int = 0
    """Bytes of its PDU."""
    reference: int = 0
    acknowledged: At | None = None
    assigned: int | None = None
    """The sequence in its acknowledge,"""
    error: int | None = None
    """and the error word there, 0 for none."""


class SzlEvidence(NamedTuple):
    """What the server says about itself in an SZL."""

    at: At
    szl_id: int
    szl_index: int
    name: str
    """"consistent": the bytes that can be read consistently; "order": the order number."""
    value: int | str


@dataclass(slots=True, eq=False)
class JobCounts:
    """The outcomes of the jobs of a connection, counted."""

    jobs: int = 0
    """All finished jobs."""
    refused: int = 0
    """Jobs that were refused as a whole or in part."""
    unanswered: int = 0
    orphans: int = 0
    """Answers without a job."""
    read: int = 0
    """Bytes read by GET, written by PUT, sent by BSEND and USEND."""
    written: int = 0
    sent: int = 0
    timed: int = 0
    """Jobs with a request and an answer, and their durations in nanoseconds."""
    total_ns: int = 0
    least_ns: int = 0
    most_ns: int = 0


@dataclass(slots=True, eq=False)
class S7Connection:
    """A TCP connection of S7; None stands for what the capture lacks.

    The client is the end that opened it, or sent the first job if the opening was not captured.
    """

    number: int
    """Counts from 1, in the order of the first frames."""
    client: End
    server: End
    opened: At
    """Its first frame."""
    last: At
    begun: bool = False
    """Whether the capture has its beginning (SYN, or CR)."""
    lacks: Callable[[bool], bool] = lambda _: False
    """Whether the capture lacks the last bytes of the client (of the server, for False), or all of them."""
    cut: Cut | None = None
    """Its frames that the capture truncated."""
    missing: str | None = None
    """Known at its end: whether the capture lacks a part, or all that one end sent; a key of diagnoses.toml."""
    client_tsap: bytes | None = None
    server_tsap: bytes | None = None
    tpdu_size: int | None = None
    """The negotiated size of a TPDU in bytes."""
    confirmed: At | None = None
    """CC."""
    asked_pdu: int | None = None
    """The PDU length that the client asks for in the setup."""
    pdu_length: int | None = None
    """The negotiated PDU length, and number of parallel jobs."""
    parallel: int | None = None
    setup: At | None = None
    """The answer to the setup."""
    plus: int = 0
    """PDUs of S7CommPlus."""
    cyclic: int = 0
    """PDUs of cyclic services, which bring data without a job."""
    other: int = 0
    """All other PDUs that belong to no job: SZL, blocks, programming device."""
    lost_bytes: int = 0
    """Bytes that the capture lacks."""
    disordered: bool = False
    """Whether its frames are not in the order of their times, so that the open jobs are unknown."""
    foreign: int = 0
    """PDUs of other protocols."""
    closed: bool = False
    most_open: int = 0
    """The most jobs of one end that were open at once."""
    counts: JobCounts = field(default_factory=JobCounts)
    evidence: list[SzlEvidence] = field(default_factory=list)

    def end(self, from_client: bool) -> End:
        """The sender in one direction."""
        return self.client if from_client else self.server


@dataclass(slots=True, init=False, eq=False)
class S7Job:
    """A GET or PUT with its answer, a BSEND with its segments, or a USEND."""

    operation: str
    """One of OPERATIONS."""
    connection: S7Connection
    from_client: bool
    """Whether the client sends the job, not the server."""
    reference: int
    """PDU reference; for a BSEND, the one of its first segment."""
    asked: At | None
    """The request; None for an answer without one."""
    items: list[S7Item]
    answered: At | None
    """The answer; for a BSEND, the acknowledge of the last segment."""
    request: bytes
    """The S7 PDU from its header on; empty for a BSEND."""
    response: bytes
    """The S7 PDU of the answer."""
    error: int | None
    """Error class and code of the answer (BSEND: of an acknowledge) as one word; 0 for none."""
    r_id: int | None
    """Of BSEND and USEND."""
    total: int | None
    """Bytes that a BSEND announces."""
    groups: list[int]
    """For each item the number of its address in the request: one address may name several items."""
    segments: list[BsendSegment]
    state: str
    flaws: list[Flaw]
    answer_flaws: list[Flaw]
    frames: list[int]
    """All its frames: a PDU may span several TCP segments."""
    lost: bool
    """Whether the capture lacks bytes of the connection while the job was open: they may hold its answer."""
    same_reference: bool
    """Whether the job before it on the connection, of the same end, had its reference."""
    position: int
    """Its position among the PDUs that begin in the frame of its first one."""
    order: int
    """Its number among all transactions of the capture; the analysis sets it."""
    phase: str
    """"closed" when all listeners know that it is over."""

    def __init__(
        self,
        operation: str,
        connection: S7Connection,
        from_client: bool,
        reference: int,
        asked: At | None,
        items: list[S7Item],
        answered: At | None = None,
        request: bytes = b"",
        response: bytes = b"",
        error: int | None = None,
        r_id: int | None = None,
        total: int | None = None,
        groups: list[int] | None = None,
        state: str = "unanswered",  # a name as default takes the signature away where this is compiled
        flaws: list[Flaw] | None = None,
        answer_flaws: list[Flaw] | None = None,
        frames: list[int] | None = None,
    ) -> None:
        self.operation = operation
        self.connection = connection
        self.from_client = from_client
        self.reference = reference
        self.asked = asked
        self.items = items
        self.answered = answered
        self.request = request
        self.response = response
        self.error = error
        self.r_id = r_id
        self.total = total
        self.groups = [] if groups is None else groups
        self.segments = []
        self.state = state
        self.flaws = [] if flaws is None else flaws
        self.answer_flaws = [] if answer_flaws is None else answer_flaws
        self.frames = [] if frames is None else frames
        self.lost = self.same_reference = False
        self.position = 0
        self.order = 0
        self.phase = "open"

    @property
    def asker(self) -> End:
        """The end that asks, or sends."""
        return self.connection.end(self.from_client)

    @property
    def partner(self) -> End:
        """The end that answers, or receives."""
        return self.connection.end(not self.from_client)

    @property
    def device(self) -> str:
        """IP address of the partner: the device of its findings."""
        return self.partner.ip

    @property
    def over(self) -> bool:
        """Whether it is finished."""
        return self.phase == "closed"

    @property
    def duration_ns(self) -> int | None:
        """From the request to its answer."""
        both = self.asked is not None and self.answered is not None
        return self.answered.time_ns - self.asked.time_ns if both else None  # type: ignore[union-attr]


class S7Listener:
    """Hears what happens on the connections, in the order of the frames. Subclasses override what they need.

    Each job of `asked` is later passed to `over`, in the order of the answers, and does not change after that.
    An answer without a request is passed to `over` alone.
    """

    def opened(self, connection: S7Connection) -> None:
        """A connection has its first S7 PDU, CR or CC."""

    def agreed(self, connection: S7Connection) -> None:
        """The setup was answered: `pdu_length` and `parallel` are there."""

    def refused(self, connection: S7Connection, why: str, at: At, code: int) -> None:
        """A connection was not established.

        Args:
            connection: it.
            why: "no_confirm" (CR without CC), "disconnect" (DR), "reset" (RST of the server), "setup" (refused).
            at: the frame that shows it.
            code: reason of DR, or error class and code of the setup; else 0.
        """

    def larger(self, connection: S7Connection, from_client: bool, at: At, size: int) -> None:
        """A PDU announces more bytes than were negotiated."""

    def asked(self, job: S7Job) -> None:
        """A request, or the first segment, was seen."""

    def over(self, job: S7Job) -> None:
        """A job is finished: it is answered, acknowledged, sent, or given up."""

    def evidence(self, connection: S7Connection, found: SzlEvidence) -> None:
        """The server said what it is."""

    def closed(self, connection: S7Connection) -> None:
        """A connection is over, or the capture is. Its open jobs went to `over` before."""
