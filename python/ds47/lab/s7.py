"""A simulated CPU with memory, and the connections of clients and partners to it.

Written for scenes: `get` and `put` are whole jobs, which the memory answers; `ask_*` and `answer` their halves, so
that what happens between the two is a line of its own. The bytes are in `s7_wire`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ds47.lab import ether, s7_wire
from ds47.lab.ether import Host
from ds47.lab.s7_wire import ACK, ANSWER, DONE, JOB, READ, USERDATA, WRITE, Var
from ds47.lab.stage import Stage

PORT = 102
CLIENT_TSAP, SERVER_TSAP = b"\x01\x00", b"\x03\x02"
"""The second one: an operator station wants rack 0, slot 2."""
FIRST, NEXT = 36, 34
"""What a segment of BSEND leaves of the PDU: of the first one, of the others."""


DRIVE_TSAP = b"\x03\x00"
"""That of a drive: rack 0, slot 0."""


def station(number: int) -> Host:
    """Station n of the lab: 192.168.134.n."""
    return Host(f"192.168.134.{number}", f"00:1b:1b:00:00:{number:02x}")


@dataclass(slots=True)
class Cpu:
    """A CPU with memory that clients read and write."""

    stage: Stage
    host: Host = field(default_factory=lambda: station(1))
    memory: dict[tuple[int, int], bytearray] = field(default_factory=dict)
    refused: dict[tuple[int, int], int] = field(default_factory=dict)
    """Areas that are not there, or not for clients: their return codes."""
    tsap: bytes = SERVER_TSAP
    links: int = 0

    def link(self, number: int = 2) -> Link:
        """A new connection of station n, not yet opened."""
        self.links += 1
        return Link(self, station(number), 49200 + self.links)

    def bytes_of(self, variable: Var) -> bytearray:
        """The whole area in which a variable is; fresh ones hold a pattern."""
        key = variable.area, variable.db
        return self.memory.setdefault(key, bytearray((at * 7 + 3) & 0xFF for at in range(2000)))

    def read(self, variable: Var) -> tuple[int, bytes]:
        """Return code and bytes."""
        code = self.refused.get((variable.area, variable.db), DONE)
        there = self.bytes_of(variable)[variable.start : variable.start + variable.size]
        return (DONE, bytes(there)) if code == DONE else (code, b"")

    def write(self, variable: Var, data: bytes) -> int:
        """Return code; the bytes are there from now on."""
        code = self.refused.get((variable.area, variable.db), DONE)
        if code == DONE:
            self.bytes_of(variable)[variable.start : variable.start + variable.size] = data
        return code


@dataclass(slots=True)
class DriveCpu(Cpu):
    """A drive that answers with its parameters: each element is by itself, whatever lies beside it."""

    elements: dict[tuple[int, int], bytes] = field(default_factory=dict)
    """By data block and address; what is asked with another length is out of range."""
    tsap: bytes = DRIVE_TSAP

    def read(self, variable: Var) -> tuple[int, bytes]:
        """Return code and bytes."""
        there = self.elements.get((variable.db, variable.start))
        if there is None:
            return s7_wire.MISSING, b""
        return (DONE, there) if len(there) == variable.size else (s7_wire.OUT_OF_RANGE, b"")

    def write(self, variable: Var, data: bytes) -> int:
        """Return code; the element has this value from now on."""
        code, _ = self.read(variable)
        if code == DONE:
            self.elements[variable.db, variable.start] = data
        return code


@dataclass(frozen=True, slots=True)
class Asked:
    """A job that was sent."""

    reference: int
    variables: tuple[Var, ...]
    data: tuple[bytes, ...] | None = None
    """What is to be written; None for a read."""


@dataclass(slots=True)
class Link:
    """A TCP connection of a client to a CPU. Between partners either end may send."""

    cpu: Cpu
    client: Host
    port: int
    reference: int = 0
    sequence: dict[bool, int] = field(default_factory=lambda: {True: 1000, False: 70000})
    """The next number of the stream from the client (True) and to it."""
    sent: int = 0
    """Segments of BSEND so far, of both ends."""
    tpdu: int | None = None
    """Bytes of a PDU in one COTP DT; None sends each whole."""
    pdu: int = 480

    # Below S7

    def segment(
        self, from_client: bool, payload: bytes = b"", flags: str = "PA", back: int = 0
    ) -> None:
        """A TCP segment goes past; one that is sent again goes `back` so many bytes."""
        client, server = self.client, self.cpu.host
        source, target = (client, server) if from_client else (server, client)
        ports = (self.port, PORT) if from_client else (PORT, self.port)
        numbers = self.sequence[from_client] - back, self.sequence[not from_client]
        if flags == "S":
            numbers = numbers[0], 0
        packet = ether.tcp(source, target, ports, flags, numbers, payload)
        self.cpu.stage.frame(ether.framed(packet, (source.mac, target.mac)))
        if not back:
            self.sequence[from_client] += len(payload) + ("S" in flags or "F" in flags)

    def say(
        self,
        from_client: bool,
        kind: int,
        reference: int,
        parameter: bytes,
        data: bytes = b"",
        error: int = 0,
    ) -> None:
        """A PDU goes past."""
        pdu = s7_wire.pdu(kind, reference, parameter, data, error)
        size = self.tpdu or len(pdu)
        for at in range(0, len(pdu), size):
            last = at + size >= len(pdu)
            self.segment(from_client, s7_wire.data(pdu[at : at + size], last))

    def open(self, pdu: int = 480, parallel: int = 1) -> Link:
        """TCP, COTP and the setup, all accepted."""
        self.dial().confirm()
        self.pdu = pdu
        self.say(True, JOB, self.next(), s7_wire.setup(pdu, parallel))
        self.say(False, ANSWER, self.reference, s7_wire.setup(pdu, parallel))
        return self

    def dial(self) -> Link:
        """TCP is connected, and the client asks for a connection by CR."""
        self.segment(True, flags="S")
        self.segment(False, flags="SA")
        self.segment(True, flags="A")
        self.segment(True, s7_wire.connect(CLIENT_TSAP, self.cpu.tsap))
        return self

    def confirm(self) -> Link:
        """CC."""
        self.segment(False, s7_wire.confirm(CLIENT_TSAP, self.cpu.tsap))
        return self

    def close(self, by_client: bool = True) -> None:
        """One end says FIN, then the other."""
        self.segment(by_client, flags="FA")
        self.segment(not by_client, flags="FA")

    def next(self) -> int:
        """The number of the next PDU."""
        self.reference = self.reference % 0xFFFF + 1
        return self.reference

    # Jobs

    def ask_get(self, *variables: Var) -> Asked:
        """The request of a read alone."""
        asked = Asked(self.next(), variables)
        self.say(True, JOB, asked.reference, s7_wire.items(READ, variables))
        return asked

    def ask_put(self, *pairs: tuple[Var, bytes]) -> Asked:
        """The request of a write alone: variables with their bytes."""
        asked = Asked(
            self.next(), tuple(each for each, _ in pairs), tuple(data for _, data in pairs)
        )
        values = s7_wire.values([(0, data) for _, data in pairs])
        self.say(True, JOB, asked.reference, s7_wire.items(WRITE, asked.variables), values)
        return asked

    def answer(self, asked: Asked) -> None:
        """The CPU does what was asked, and says so."""
        function = READ if asked.data is None else WRITE
        parameter = bytes((function, len(asked.variables)))
        if asked.data is None:
            data = s7_wire.values([self.cpu.read(each) for each in asked.variables])
        else:
            data = bytes(map(self.cpu.write, asked.variables, asked.data))
        self.say(False, ANSWER, asked.reference, parameter, data)

    def refuse(self, asked: Asked, error: int) -> None:
        """The CPU refuses a whole job with an error class and code."""
        self.say(False, ACK, asked.reference, b"", error=error)

    def get(self, *variables: Var) -> Link:
        """A read and its answer."""
        self.answer(self.ask_get(*variables))
        return self

    def put(self, *pairs: tuple[Var, bytes]) -> Link:
        """A write and its answer."""
        self.answer(self.ask_put(*pairs))
        return self

    def szl(self, number: int, index: int, *parts: bytes) -> Link:
        """The client asks for a part of the system status list, and the CPU has it."""
        self.say(True, USERDATA, self.next(), *s7_wire.ask_szl(number, index))
        answer = s7_wire.tell_szl(number, index, len(parts[0]), parts)
        self.say(False, USERDATA, self.reference, *answer)
        return self

    # Partners

    def send(
        self,
        r_id: int,
        data: bytes,
        *,
        from_client: bool = True,
        total: int | None = None,
        ended: bool = True,
        lost: Sequence[int] = (),
        error: int = 0,
    ) -> Link:
        """BSEND.

        Args:
            r_id: R_ID of the block.
            data: what it sends.
            from_client: which end sends.
            total: bytes that it announces, where that is a lie.
            ended: whether the last segment says that it is the last one.
            lost: numbers of segments, from 0, that are not acknowledged.
            error: the error word of the last acknowledge.
        """
        parts = cut(data, self.pdu)
        sequence = 0
        for number, part in enumerate(parts):
            last = number == len(parts) - 1
            announced = (len(data) if total is None else total) if number == 0 else None
            place = 0 if len(parts) == 1 else self.sent & 0xFF
            self.part(r_id, part, place, sequence, last and ended, announced, from_client)
            sequence = sequence or self.sent & 0xFF or 1
            if number not in lost:
                answer = s7_wire.acknowledge(sequence, error if last else 0)
                self.say(not from_client, USERDATA, self.reference, *answer)
        return self

    def part(
        self,
        r_id: int,
        part: bytes,
        place: int,
        sequence: int,
        last: bool,
        total: int | None,
        from_client: bool,
    ) -> None:
        """One segment."""
        self.sent += 1
        segment = s7_wire.segment(r_id, part, place, sequence, last, total)
        self.say(from_client, USERDATA, self.next(), *segment)

    def usend(self, r_id: int, *parts: bytes, from_client: bool = True) -> Link:
        """USEND: nobody answers."""
        self.say(from_client, USERDATA, self.next(), *s7_wire.usend(r_id, parts))
        return self


def cut(data: bytes, pdu: int) -> list[bytes]:
    """The segments of a BSEND."""
    first = pdu - FIRST
    rest = range(first, len(data), pdu - NEXT)
    return [data[:first], *(data[at : at + pdu - NEXT] for at in rest)]
