"""The result model: what an analysis says, in the words of the report.

Every attribute is a key of the JSON schema `ds47.report/2`, or (times and bytes) its exact source.
Plain values only: no decoding, no pairing and no formatting lives here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final, Literal, NamedTuple, get_args

from ds47.spec import Operation, Pnu, Severity, error_hex, error_text
from ds47.spec.cyclic import error_text as pkw_error_text
from ds47.spec.cyclic import meaning as pkw_meaning
from ds47.spec.plain import Plain
from ds47.spec.units import milliseconds, moment, status, timestamp

Value = int | float | str
"""One value as JSON shows it: docs/report.md, values."""

SIEMENS = 0x002A
"""PROFINET vendor id of the drives whose own parameters and error numbers are known."""
OPERATIONS: tuple[Operation, ...] = get_args(Operation)
State = Literal[
    "ok", "partial", "error", "mismatch", "refused", "unanswered", "superseded", "incomplete", "orphan"
]  # fmt: skip
"""What became of a transaction (docs/pairing.md)."""
STATES: tuple[State, ...] = get_args(State)
SEVERITIES: tuple[Severity, ...] = get_args(Severity)
"""From harmless to serious: a higher index is more serious."""
Channel = Literal["ds47", "pkw", "pzd", "s7"]
"""Records, parameters and process data inside cyclic frames, S7 communication."""
DS47: Final = "ds47"
PKW: Final = "pkw"
PZD: Final = "pzd"
S7: Final = "s7"
CHANNELS: tuple[Channel, ...] = (DS47, PKW, PZD, S7)
DIAGNOSIS = "DS7"
"""The prefix of the id of every diagnosis."""


@dataclass(slots=True, repr=False, eq=False)
class ParameterError(Plain):
    """What the drive answered instead of a value (docs/protocol.md A.7, B).

    Its `text` is English; `ds47.report.sentences` has both languages.
    """

    code: int | None
    info: int | None
    vendor_id: int | None = None
    """PROFINET vendor id of the device: it decides what a number of the vendor means."""
    said: str | None = None
    """The text in a stored result, if this version has another one for the number; else None."""
    ak: int | None = None
    """AK of a PKW response, which has other error numbers (docs/cyclic.md 2); else None."""

    @property
    def number(self) -> str | None:
        """The error number as manuals print it: `0x11`, for PKW `17`; None without one."""
        if self.code is None:
            return None
        return error_hex(self.code) if self.ak is None else str(self.code)

    @property
    def text(self) -> str:
        """What the error means, in English; empty without a number, except for PKW."""
        return error_words(self, "en")


def error_words(item: ParameterError, lang: str) -> str:
    """What an error means on the drive that sent it, in "en" or "zh"; `ParameterError.text` is the English one."""
    if item.said is not None:
        return item.said
    if item.ak is None:
        return error_text(item.code, lang, item.vendor_id)
    known = None if item.code is None else pkw_error_text(item.code, lang, item.vendor_id)
    return known or pkw_meaning(item.ak, True, lang)


class Described(NamedTuple):
    """What the drive (attribute 0x20) or a list of the user says about a parameter, as far as it is shown.

    `name` is None if neither names it. `frames` are the responses that say the name and the unit; empty if only
    a list says them.
    """

    name: str | None
    frames: tuple[int, ...]


@dataclass(slots=True, init=False, repr=False, eq=False)
class Parameter(Plain):
    """One parameter of a transaction; `pnu` and its address are None if no request names them."""

    pnu: int | None
    subindex: int | None
    attribute: str | None
    element_count: int | None
    listed: Pnu | None
    """The row for the PNU on this device in the tables (parameters.toml, drives.toml)."""
    unit: str | None
    format: str | None
    value_count: int | None
    values: list[Value]
    scaled: list[Value] | None
    error: ParameterError | None
    described: Described | None
    value_texts: Mapping[int | None, str] | None
    """Value -> its text in lists of the user. None -> the text for all values, in a stored result."""
    family: str | None
    """The family of the drive's parameters: "sinamics", "micromaster", "profile"; None if no drive is named."""

    def __init__(
        self,
        pnu: int | None,
        subindex: int | None,
        attribute: str | None,
        element_count: int | None,
        listed: Pnu | None = None,
        unit: str | None = None,
        format: str | None = None,  # noqa: A002 (a key of the report)
        value_count: int | None = None,
        values: list[Value] | None = None,
        scaled: list[Value] | None = None,
        error: ParameterError | None = None,
        described: Described | None = None,
        value_texts: Mapping[int | None, str] | None = None,
        family: str | None = None,
    ) -> None:
        self.pnu = pnu
        self.subindex = subindex
        self.attribute = attribute
        self.element_count = element_count
        self.listed = listed
        self.unit = unit
        self.format = format
        self.value_count = value_count
        self.values = [] if values is None else values
        self.scaled = scaled
        self.error = error
        self.described = described
        self.value_texts = value_texts
        self.family = family

    @property
    def name(self) -> str | None:
        """The name from the drive or a list of the user, else the English name in the tables; None without one."""
        if self.described is not None and self.described.name is not None:
            return self.described.name
        return None if self.listed is None else self.listed.name_en

    @property
    def described_in(self) -> list[int] | None:
        """Frames of the descriptions that say its name or unit; None without any."""
        said = self.described
        return None if said is None or not said.frames else list(said.frames)


class Read(NamedTuple):
    """The frames of one Read: a poll, or one that read the record again."""

    request: int | None
    response: int | None


@dataclass(slots=True, init=False, repr=False, eq=False)
class Frames(Plain):
    """Frame numbers of a transaction, as Wireshark shows them for the same file."""

    write_request: int | None
    write_response: int | None
    read_request: int | None
    read_response: int | None
    polls: list[Read]
    rereads: list[Read]

    def __init__(
        self,
        write_request: int | None = None,
        write_response: int | None = None,
        read_request: int | None = None,
        read_response: int | None = None,
        polls: list[Read] | None = None,
        rereads: list[Read] | None = None,
    ) -> None:
        self.write_request = write_request
        self.write_response = write_response
        self.read_request = read_request
        self.read_response = read_response
        self.polls = [] if polls is None else polls
        self.rereads = [] if rereads is None else rereads

    def first(self) -> int:
        """The first frame of the transaction, 0 if it has none."""
        there = (self.write_request, self.write_response, self.read_request, self.read_response)
        return min(self.all() if self.polls or self.rereads else filter(None, there), default=0)

    def all(self) -> list[int]:
        """Every frame of the transaction, sorted, each once."""
        found = {self.write_request, self.write_response, self.read_request, self.read_response}
        found.update(*self.polls, *self.rereads)
        return sorted([frame for frame in found if frame is not None])


class Status(NamedTuple):
    """The PNIO statuses of a transaction as 8 hex digits (docs/protocol.md C); None if none came."""

    write: str | None
    read: str | None


class Messages(NamedTuple):
    """The record data of a transaction in hex; None if the capture lacks it."""

    request: str | None
    response: str | None


@dataclass(slots=True, repr=False, eq=False)
class Item(Plain):
    """One variable of an S7 job, or data that a program sends; None for what the capture lacks."""

    address: str | None
    """As programs write it: DB1.DBB0..443."""
    area: str | None
    """The start of its address: DB, M, I, Q."""
    db: int | None
    start: int | None
    """Its first byte; for timers and counters, the number of the first one."""
    bit: int | None
    """The bit in that byte; None for whole bytes."""
    length: int | None
    """Bytes."""
    value: bytes | None
    """What was read, written or sent."""
    code: int | None
    """What the partner answered; 255 is success (docs/s7.md 3)."""
    drive_object: int | None = None
    """The drive object that the address names, if the partner is known to be a drive,"""
    parameter: Parameter | None = None
    """and the parameter element that it names, with its value."""


@dataclass(slots=True, repr=False, eq=False)
class Transaction(Plain):
    """One parameter request and everything that followed (docs/pairing.md), or an S7 job (docs/s7.md)."""

    operation: Operation
    state: State
    controller: str
    device: str
    ar: str | None
    api: int | None
    """None on PROFIBUS, like `subslot`. A channel named by hand has no slot either."""
    slot: int | None
    subslot: int | None
    index: int | None
    """Record index; None for a channel without one."""
    request_reference: int | None
    axis: int | None
    frames: Frames
    start_ns: int
    """Time of the first PDU, nanoseconds since 1970."""
    duration_ns: int | None
    """From the Write request to the first Read response that holds the record."""
    request: bytes | None
    response: bytes | None
    write_status: int | None
    read_status: int | None
    parameters: list[Parameter]
    position: int = 0
    """Place inside the first frame: an IODWriteMultiple carries several records."""
    findings: list[str] = field(default_factory=list)
    id: int = 0
    channel: Channel = DS47
    cycles: int | None = None
    """From a request in cyclic frames to its response, in cycles; None if these cannot be counted."""
    station: int | None = None
    """The address of the device on PROFIBUS; None on PROFINET."""
    connection: int | None = None
    """S7: the id of the connection; `items` are in the order of the request."""
    items: list[Item] = field(default_factory=list)
    r_id: int | None = None
    """BSEND and USEND only."""
    error: int | None = None
    """S7: error class and code of the answer (BSEND: of an acknowledgement) as one word; 0 for none."""
    segments: list[Read] = field(default_factory=list)
    """BSEND: the frames of its segments and of their acknowledgements."""
    drive_object: int | None = None
    """The number of the drive object that the request reaches; None where the capture does not prove one."""
    telegram: int | None = None
    """The PROFIdrive telegram of that drive object; None where nothing tells it, or nobody asked a report."""

    @property
    def start(self) -> str:
        """Time of the first PDU: ISO 8601 in UTC, nine digits."""
        return timestamp(self.start_ns)

    @property
    def start_time(self) -> datetime | None:
        """The same in UTC, to the microsecond; None in a year beyond `datetime`, because a clock may be wrong."""
        return moment(self.start_ns)

    @property
    def duration_ms(self) -> float | None:
        """From the Write request to the first Read response that holds the record."""
        return milliseconds(self.duration_ns)

    @property
    def status(self) -> Status:
        """The statuses of the Write and of the last Read: `DE80B500`."""
        return Status(status(self.write_status), status(self.read_status))

    @property
    def bytes(self) -> Messages:
        """The request and the response."""
        asked, told = self.request, self.response
        return Messages(
            None if asked is None else asked.hex(), None if told is None else told.hex()
        )


@dataclass(slots=True, repr=False, eq=False)
class Finding(Plain):
    """A rule that applies: in which frame, to which transaction, and on which facts.

    It has no text: `ds47.report.sentences` words it in either language.
    """

    rule: str
    severity: Severity
    frame: int
    frames: list[int] = field(default_factory=list)
    """All frames that it is about, sorted, including `frame`; without any, that one."""
    transaction: int | None = None
    offset: int | None = None
    """Byte of the DS47 message, for rules about a message."""
    args: dict[str, Any] = field(default_factory=dict)
    """The arguments that spec/rules.toml lists for the rule, in the units and names of the report."""
    said: str | None = None
    """The sentence in a result of `ds47.report/1`, which has no args; else None."""
    time_ns: int | None = None
    """Time of `frame`, nanoseconds since 1970; None where it is not known."""

    def __post_init__(self) -> None:
        self.frames = self.frames or [self.frame]

    @property
    def time(self) -> str | None:
        """Time of `frame`: ISO 8601 in UTC, nine digits."""
        return None if self.time_ns is None else timestamp(self.time_ns)

    @property
    def frame_time(self) -> datetime | None:
        """The same in UTC, to the microsecond; None also in a year beyond `datetime`."""
        return None if self.time_ns is None else moment(self.time_ns)

    @property
    def filter(self) -> str:
        """A Wireshark display filter that shows the frames."""
        return " or ".join(f"frame.number == {frame}" for frame in self.frames)

    @property
    def counted(self) -> list[int]:
        """The frames in which it happened: the argument `frames` of a rule that counts, else `frame` alone."""
        return self.args.get("frames") or [self.frame]


@dataclass(slots=True, repr=False, eq=False)
class Diagnosis(Plain):
    """One cause (DS7xx) and everything that it explains (docs/diagnoses.md)."""

    rule: str
    severity: Severity
    args: dict[str, Any] = field(default_factory=dict)
    """The arguments of its findings; None for each that differs between them."""
    device: str | None = None
    count: int = 0
    """Findings of this cause."""
    frames: list[int] = field(default_factory=list)
    """The frames of the findings, sorted, each once; only the first ones if there are very many."""
    transactions: list[int] = field(default_factory=list)
    """In the order of the findings: the first one belongs to the first frame."""
    corrected: bytes | None = None
    """The whole request as it should have been, if that can be computed."""
    said: str | None = None
    """As for a finding."""
    differs: list[str] = field(default_factory=list)
    """The names of the arguments that differ between the findings."""
    frames_left_out: int = 0
    """Frames for which `frames` has no room."""
    corrected_in: int | None = None
    """The transaction of the request that `corrected` replaces."""


@dataclass(slots=True, repr=False, eq=False)
class Device(Plain):
    """A device as the capture names it (RPC object UUID, Connect, DCP, LLDP)."""

    ip: str
    mac: str | None = None
    station: str | None = None
    vendor_id: int | None = None
    device_id: int | None = None
    assumed_vendor_id: int | None = None
    """The vendor id that the user gave, if the capture does not show one."""

    @property
    def vendor(self) -> int | None:
        """The vendor id that decides names and error numbers: as captured, else as assumed."""
        return self.assumed_vendor_id if self.vendor_id is None else self.vendor_id


LENGTHS, CONFIGURED, SEEN = "lengths", "configured", "seen"
"""How sure a relation is: its lengths fit, its configuration says so, or its frames prove a drive."""
NAMED, ODD, REFUTED = "named", "odd", "refuted"
"""It was named by hand; then its words may make no sense, or no drive has one of them."""


class Side(NamedTuple):
    """One direction of a relation: its sender, the id of its frames, and its first byte after that id.

    On PROFIBUS the sender is a station (`dp2`), and the frames of a data exchange have no id.
    """

    mac: str
    frame_id: int | None
    offset: int
    length: int


@dataclass(slots=True, repr=False, eq=False)
class Relation(Plain):
    """A channel in cyclic frames, as a Connect sets it up, or as it was named by hand (docs/cyclic.md 5).

    `telegrams` are those that the lengths allow, `frame` is the response to the Connect. `certainty` is LENGTHS,
    SEEN, NAMED, ODD (the words make no sense), REFUTED (no drive has one of the words), or CONFIGURED (Chk_Cfg and
    a known ident number show that it is PKW, but no request was answered).
    For a channel named by hand, `controller` and `device` are MAC addresses, `frame` is its first frame, and what
    only a Connect says is None.
    """

    channel: Channel
    controller: str
    device: str
    api: int | None
    slot: int | None
    subslot: int | None
    telegrams: list[int]
    output: Side
    """From the controller to the device."""
    input: Side
    cycle_ms: float | None
    frame: int | None
    certainty: str


class Sender(NamedTuple):
    """A station that sends cyclic frames without a known channel: its MAC address, and that of the receiver.

    `length` counts the bytes on the wire between frame id and cycle counter. `word` is STW1 or ZSW1, if its frames
    and those that come back show the `offset` of that word.
    """

    mac: str
    to: str
    frame_id: int
    length: int
    word: str | None = None
    offset: int | None = None

    def is_answered_by(self, other: Sender) -> bool:
        """Whether `other` sends in the opposite direction, between the same two stations."""
        return (self.mac, self.to) == (other.to, other.mac)


class Event(NamedTuple):
    """Something that happened to a drive: an edge of a bit of its words, or data that is no longer valid.

    `word` is "STW1", "ZSW1", or None without a word; `before` and `after` are the whole word. `state` and
    `overlays` are those of the drive from then on; `state` is None if its word is unknown. Ids: spec/pzd.toml.
    """

    frame: int
    time_ns: int
    """Nanoseconds since 1970."""
    name: str
    word: str | None
    before: int | None
    after: int | None
    state: str | None
    overlays: tuple[str, ...]


class Point(NamedTuple):
    """The effective setpoint, or the actual value, around a time: least and greatest; 16384 is 100 %."""

    time_ns: int
    least: int
    most: int


@dataclass(slots=True, repr=False, eq=False)
class Timeline(Plain):
    """What happened to a drive, according to its control and status words (docs/cyclic.md 6).

    `relation` counts from 1 in the relations of the capture.
    """

    relation: int
    events: list[Event] = field(default_factory=list)
    events_left_out: int = 0
    """Events for which there was no room."""
    end_ns: int | None = None
    """Time of the last frame that was evaluated."""
    setpoint: list[Point] = field(default_factory=list)
    actual: list[Point] = field(default_factory=list)


class Span(NamedTuple):
    """The least, the mean and the greatest of some times, in nanoseconds."""

    least_ns: int
    mean_ns: int
    most_ns: int

    @property
    def least_ms(self) -> float | None:
        """The least, in milliseconds."""
        return milliseconds(self.least_ns)

    @property
    def mean_ms(self) -> float | None:
        """The mean, in milliseconds."""
        return milliseconds(self.mean_ns)

    @property
    def most_ms(self) -> float | None:
        """The greatest, in milliseconds."""
        return milliseconds(self.most_ns)


class StationDiagnosis(NamedTuple):
    """The last answer of a station to Slave_Diag (docs/profibus.md 3)."""

    frame: int
    flags: list[str]
    """Ids of the bits that are set (spec/profibus.toml)."""
    master: int | None
    """The master that has parameterised it; None for none."""
    ident: int | None
    blocks: list[bytes]
    """Extended diagnosis."""


class BusStation(NamedTuple):
    """What a PROFIBUS station did in the capture (docs/profibus.md 7); None for what the capture does not say."""

    address: int
    role: str
    """"master" for one that asks, else "slave"."""
    ident: int | None
    """The ident number in Set_Prm, or in Slave_Diag."""
    ppo: int | None
    """The PPO number, from Chk_Cfg."""
    watchdog_ms: int | None
    """As Set_Prm sets it; None also if it is off."""
    requests: int
    """Requests to it, without repetitions and without FDL_Status that got no answer."""
    unanswered: int
    damaged: int
    """Damaged frames in place of answers."""
    retries: int
    exchanges: int
    """Data exchanges."""
    outputs: int | None
    """Bytes to it in the last data exchange,"""
    inputs: int | None
    """and from it."""
    cycle: Span | None
    """From one data exchange to the next,"""
    answer: Span | None
    """and from a request to its answer; None without times."""
    diagnoses_wanted: int
    """How often it began to ask for Slave_Diag,"""
    diagnoses_fetched: int
    """and how often the master read it then."""
    parameters: int | None
    """Frame of the last Set_Prm that was answered,"""
    configuration: int | None
    """and of the last Chk_Cfg."""
    diagnosis: StationDiagnosis | None


@dataclass(slots=True, repr=False, eq=False)
class Bus(Plain):
    """The PROFIBUS line of a capture. `stray` counts answers without a request."""

    frames: int
    tokens: int
    damaged: int
    stray: int
    stations: list[BusStation] = field(default_factory=list)


class Evidence(NamedTuple):
    """What an S7 server says about itself, and where; `name` is "order_number", "module" or "consistent".

    "consistent": how many bytes it reads consistently for a panel.
    """

    name: str
    value: int | str
    frame: int


class Drive(NamedTuple):
    """What shows that an S7 server is a drive, and the first address of a parameter element (docs/s7.md 8).

    `proof`: "chosen", "order", "records", "cyclic", "device", "station", "values"; "addresses" only suggest it.
    """

    proof: str
    address: str | None
    drive_object: int | None
    pnu: int | None
    subindex: int | None


@dataclass(slots=True, repr=False, eq=False)
class Connection(Plain):
    """An S7 connection (docs/s7.md 4); None for what the capture lacks."""

    id: int
    """Counts from 1, by first frame. Connections that turned out to be of another protocol leave gaps."""
    client: str
    client_port: int
    server: str
    server_port: int
    client_tsap: bytes | None
    server_tsap: bytes | None
    rack: int | None
    """Rack and slot, from the TSAP of the server."""
    slot: int | None
    pdu_length: int | None
    """The negotiated bytes of a PDU, and number of parallel jobs."""
    parallel: int | None
    most_open: int
    """The most jobs of one end that were open at once."""
    jobs: int
    refused: int
    """Jobs that were refused as a whole or in part."""
    unanswered: int
    orphans: int
    """Answers without a job."""
    read_bytes: int
    written_bytes: int
    sent_bytes: int
    answer: Span | None
    """From a job to its answer."""
    cyclic: int
    """PDUs of cyclic services."""
    other: int
    """PDUs of other services of S7."""
    plus: int
    """PDUs of S7CommPlus."""
    lost_bytes: int
    """Bytes that the capture lacks."""
    first_frame: int
    last_frame: int
    setup: int | None
    """Frame of the answer to the setup."""
    block: int | None = None
    """Bytes that the server copies at once, according to the user or the server; None if unknown."""
    evidence: list[Evidence] = field(default_factory=list)
    drive: Drive | None = None
    """What shows that the server is a drive; None for nothing."""


@dataclass(slots=True, repr=False, eq=False)
class CaptureFile(Plain):
    """One file of a series that was read as one capture; frame numbers run through all files.

    `missing_before`: how many files are missing before it. Before the first one, a ring buffer has overwritten
    them; before another one, somebody has removed them.
    """

    path: str
    first_frame: int
    frames: int = 0
    missing_before: int = 0
    problem: str | None = None
    sha256: str | None = None
    readable: bool = True
    """False if nothing of it could be read."""


@dataclass(slots=True, repr=False, eq=False)
class Narrowed(Plain):
    """Which part of a capture a result shows (`ds47.report.narrowing`)."""

    criteria: str
    """As options of the command line."""
    transactions: int
    """How many the whole capture has,"""
    findings: int
    """and how many findings."""
    unproved: int = 0
    """Transactions left out that may belong to the chosen drive object, because nothing proves it."""


@dataclass(slots=True, repr=False, eq=False)
class Expected(Plain):
    """What a capture shows of the parameters in a golden list (`ds47.report.expected`)."""

    parameters: int
    """How many are expected of its drives,"""
    seen: int
    """how many of them it has a value of,"""
    wrong: int
    """and how many of these are not as expected."""
    absent: list[str] = field(default_factory=list)
    """Drives in the list that are not in the capture."""


def worst(findings: Iterable[Finding]) -> int:
    """The severity of the worst of these findings: its index in `SEVERITIES`; -1 for none."""
    return max((SEVERITIES.index(each.severity) for each in findings), default=-1)


@dataclass(slots=True, repr=False, eq=False)
class CaptureResult(Plain):
    """All that one capture says. `files` only for a series, `relations` only if cyclic frames have channels.

    `timelines` are those of the drives among them. `senders` send cyclic frames, but their Connect is missing.
    """

    path: str
    sha256: str | None = None
    frames: int = 0
    start_ns: int | None = None
    """Time of the first frame, whatever it holds; nanoseconds since 1970. None without frames."""
    end_ns: int | None = None
    """Likewise for the last frame. None also in old stored results, which lack it."""
    complete: bool = True
    problem: str | None = None
    dropped: int | None = None
    rpc: dict[str, int] = field(default_factory=dict)
    records: dict[str, dict[str, int]] = field(default_factory=dict)
    devices: list[Device] = field(default_factory=list)
    transactions: list[Transaction] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    diagnoses: list[Diagnosis] = field(default_factory=list)
    summary: dict[str, int] = field(default_factory=dict)
    files: list[CaptureFile] = field(default_factory=list)
    relations: list[Relation] = field(default_factory=list)
    timelines: list[Timeline] = field(default_factory=list)
    senders: list[Sender] = field(default_factory=list)
    bus: Bus | None = None
    """None on PROFINET."""
    connections: list[Connection] = field(default_factory=list)
    """Those of S7."""
    connections_left_out: int = 0
    """Connections of S7 for which there was no room."""
    worst: int = -1
    """The severity of the worst finding that was handed out with its transaction, in `SEVERITIES`; -1 for none."""
    others: dict[str, int] = field(default_factory=dict)
    """The kinds of the first frames, if nothing is PROFINET, PROFIBUS or S7."""
    narrowed: Narrowed | None = None
    """None if everything is here."""
    expected: Expected | None = None
    """None without a golden list."""
    whole: CaptureResult | None = None
    """The whole result, if this one is narrowed: what it proves also holds for the part that is shown."""

    @property
    def nothing(self) -> bool:
        """Whether nothing in it is PROFINET, PROFIBUS or S7."""
        there = (
            self.transactions,
            self.devices,
            self.relations,
            self.senders,
            self.connections,
            self.findings,
        )
        return not (
            any(there) or any(self.rpc.values()) or self.bus or self.summary.get("transactions")
        )

    @property
    def entire(self) -> CaptureResult:
        """The whole result, whether it is shown or not: proofs come from all of it."""
        return self if self.whole is None else self.whole

    def named(self) -> Callable[[str], Device]:
        """Gives a device by its IP address, or by its MAC address if a channel was named by hand."""
        known = {
            name: each for each in reversed(self.devices) for name in (each.mac, each.ip) if name
        }
        return lambda name: known.get(name) or Device(name)

    @property
    def evidence(self) -> list[Transaction]:
        """All transactions, including those that are not shown."""
        return self.entire.transactions

    @property
    def start(self) -> str | None:
        """Time of the first frame, whatever it holds: ISO 8601 in UTC, nine digits."""
        return None if self.start_ns is None else timestamp(self.start_ns)

    @property
    def end(self) -> str | None:
        """Time of the last frame, whatever it holds: ISO 8601 in UTC, nine digits."""
        return None if self.end_ns is None else timestamp(self.end_ns)

    @property
    def lacking(self) -> str | None:
        """Why it was not read to its end; None if it was."""
        return None if self.complete else self.problem or "only partly read"

    @property
    def missing_files(self) -> list[int]:
        """How many files of a series are missing before each file that is there."""
        return [file.missing_before for file in self.files]


@dataclass(slots=True, repr=False, eq=False)
class Report(Plain):
    """The results of one run."""

    captures: list[CaptureResult] = field(default_factory=list)
