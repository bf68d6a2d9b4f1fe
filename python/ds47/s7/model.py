"""What is known of S7 communication: connections, PDUs, items, jobs (docs/s7.md).

Plain values only, which every other module of this room fills or reads; nothing is decoded, paired or judged here.
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
"""States of a job: all items went well, none, some; the whole job was refused; no answer; none in a capture that
lacks something there; no request."""
DB = 0x84
"""The area of data blocks; all others have no number."""
ELEMENTS = frozenset((0x1C, 0x1D))
"""Areas whose addresses are numbers of elements: counters and timers."""
DONE = 0xFF
"""The return code of an item that went well."""


class End(NamedTuple):
    """One end of a TCP connection."""

    ip: str
    port: int


class At(NamedTuple):
    """Where something stands in the capture: the frame that completes it, nanoseconds since 1970."""

    frame: int
    time_ns: int


class Cut(NamedTuple):
    """Frames that the capture cut to a length."""

    frame: int
    """The first of them."""
    frames: int
    captured: int
    """Bytes of one that the capture has, at the most."""


@dataclass(slots=True, init=False)
class S7Address:
    """What an item names: `start` counts bits, in timers and counters elements; `count` elements of `size`.

    Jobs that name the same share it: nobody changes one.
    """

    area: int
    """Its code (spec/s7.toml)."""
    db: int
    """Number of the data block; 0 in all other areas."""
    start: int
    size: int
    """Bits of one element; 0 where that is not known."""
    count: int
    transport: int
    """Transport size of the item (spec/s7.toml)."""
    end: int = field(compare=False, repr=False)
    """The first bit behind it, in timers and counters the first element."""
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
    """None where nothing of the request is known, where its syntax is an unknown one, and in what is sent."""
    value: bytes | None
    """What was read, where it was read, or what was to be written; None where it is not there."""
    code: int | None
    """What the partner answered (spec/s7.toml); None without an answer, and in what is sent."""
    syntax: int | None
    """Syntax of the address, where it is an unknown one."""

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
    """Its place in the stream of segments, as the sender counts it."""
    sequence: int
    last: bool
    pdu: int = 0
    """Bytes of its PDU."""
    reference: int = 0
    acknowledged: At | None = None
    assigned: int | None = None
    """The sequence that its acknowledge names,"""
    error: int | None = None
    """and its error word, 0 for none."""


class SzlEvidence(NamedTuple):
    """What the server said of itself in an SZL."""

    at: At
    szl_id: int
    szl_index: int
    name: str
    """"consistent" for the bytes that can be read consistently, "order" for the order number."""
    value: int | str


@dataclass(slots=True, eq=False)
class JobCounts:
    """What came of the jobs of a connection."""

    jobs: int = 0
    """All that are over."""
    refused: int = 0
    """Those that were refused, or of which an item was;"""
    unanswered: int = 0
    orphans: int = 0
    """answers without a job."""
    read: int = 0
    """Bytes that GET brought, PUT took, and BSEND and USEND sent."""
    written: int = 0
    sent: int = 0
    timed: int = 0
    """Jobs with a request and an answer, and their times in nanoseconds."""
    total_ns: int = 0
    least_ns: int = 0
    most_ns: int = 0


@dataclass(slots=True, eq=False)
class S7Connection:
    """A TCP connection of S7; what the capture does not have of it is None.

    The client is the end that opened it; where that was not seen, the end that sent the first job.
    """

    number: int
    """From 1, by the first frame."""
    client: End
    server: End
    opened: At
    """The first frame of it."""
    last: At
    begun: bool = False
    """Whether its beginning is in the capture (SYN, or CR)."""
    lacks: Callable[[bool], bool] = lambda _: False
    """Whether the capture lacks what the client, or the server, has sent last, or all of it."""
    cut: Cut | None = None
    """Frames of it that the capture cut."""
    missing: str | None = None
    """What the capture lacks of it when it is over: all that one end sent, or a part; a key of diagnoses.toml."""
    client_tsap: bytes | None = None
    server_tsap: bytes | None = None
    tpdu_size: int | None = None
    """Bytes of a TPDU, as it was agreed."""
    confirmed: At | None = None
    """CC."""
    asked_pdu: int | None = None
    """PDU length of the setup, as the client wants it,"""
    pdu_length: int | None = None
    """and as it was agreed; parallel jobs too."""
    parallel: int | None = None
    setup: At | None = None
    """The answer to the setup."""
    plus: int = 0
    """PDUs of S7CommPlus."""
    cyclic: int = 0
    """PDUs of cyclic services, which bring data without a job."""
    other: int = 0
    """All other PDUs that are no job and belong to none: SZL, blocks, programming device."""
    lost_bytes: int = 0
    """Bytes that the capture does not have."""
    disordered: bool = False
    """Whether its frames are not in the order of their times: which job was open then is not known."""
    foreign: int = 0
    """PDUs of other protocols."""
    closed: bool = False
    most_open: int = 0
    """Jobs of one end without an answer, at the most."""
    counts: JobCounts = field(default_factory=JobCounts)
    evidence: list[SzlEvidence] = field(default_factory=list)

    def end(self, from_client: bool) -> End:
        """Who sends in one direction."""
        return self.client if from_client else self.server


@dataclass(slots=True, init=False, eq=False)
class S7Job:
    """A GET or PUT with its answer, a BSEND with its segments, or a USEND."""

    operation: str
    """One of OPERATIONS."""
    connection: S7Connection
    from_client: bool
    """Whether the end that opened the connection asks, or sends."""
    reference: int
    """PDU reference: of a BSEND that of its first segment."""
    asked: At | None
    """The request; None for an answer without one."""
    items: list[S7Item]
    answered: At | None
    """The answer, of a BSEND the acknowledge of the last segment."""
    request: bytes
    """The S7 PDU, from its header on; empty for a BSEND,"""
    response: bytes
    """and that of the answer."""
    error: int | None
    """Error class and code of the answer as one word, of a BSEND that of an acknowledge; 0 for none."""
    r_id: int | None
    """Of BSEND and USEND."""
    total: int | None
    """Bytes that a BSEND announces."""
    groups: list[int]
    """Of each item the number of the address in the request: one address may name several."""
    segments: list[BsendSegment]
    state: str
    flaws: list[Flaw]
    answer_flaws: list[Flaw]
    frames: list[int]
    """All frames that it stands in: a PDU may be in several segments of TCP."""
    lost: bool
    """Whether the capture lacks bytes of the connection while it was open: its answer may be among them."""
    place: int
    """Among the PDU that begin in the frame of the first one."""
    order: int
    """Its number among all transactions of the capture; the analysis gives it."""
    phase: str
    """"closed" when everybody knows that it is over."""

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
        self.lost = False
        self.place = 0
        self.order = 0
        self.phase = "open"

    @property
    def asker(self) -> End:
        """Who asks, or sends."""
        return self.connection.end(self.from_client)

    @property
    def partner(self) -> End:
        """Who answers, or receives."""
        return self.connection.end(not self.from_client)

    @property
    def device(self) -> str:
        """IP address of the partner: whoever wants findings by device asks for it so."""
        return self.partner.ip

    @property
    def over(self) -> bool:
        """Whether nothing more comes of it."""
        return self.phase == "closed"

    @property
    def duration_ns(self) -> int | None:
        """From the request to its answer."""
        both = self.asked is not None and self.answered is not None
        return self.answered.time_ns - self.asked.time_ns if both else None  # type: ignore[union-attr]


class S7Listener:
    """Hears of what happens on the connections, in the order of the frames; who wants a thing overrides that.

    A job that `asked` tells of is told to be `over` later, in the order in which answers come; then it stays as
    it is. An answer without a request is only told to be over.
    """

    def opened(self, connection: S7Connection) -> None:
        """A connection has its first S7 PDU, CR or CC."""

    def agreed(self, connection: S7Connection) -> None:
        """The setup was answered: `pdu_length` and `parallel` are there."""

    def refused(self, connection: S7Connection, why: str, at: At, code: int) -> None:
        """Nothing comes of a connection.

        Args:
            connection: it.
            why: "no_confirm" (CR without CC), "disconnect" (DR), "reset" (RST of the server), "setup" (refused).
            at: the frame that shows it.
            code: reason of DR, error class and code of the setup; else 0.
        """

    def larger(self, connection: S7Connection, from_client: bool, at: At, size: int) -> None:
        """A PDU says to have so many bytes, which are more than were agreed."""

    def asked(self, job: S7Job) -> None:
        """A request, or the first segment, was seen."""

    def over(self, job: S7Job) -> None:
        """Nothing more comes of a job: it is answered, acknowledged, sent, or given up."""

    def evidence(self, connection: S7Connection, found: SzlEvidence) -> None:
        """The server said what it is."""

    def closed(self, connection: S7Connection) -> None:
        """A connection is over, or the capture is; its open jobs were told of before."""
