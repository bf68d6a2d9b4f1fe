"""Connections of S7: TPDUs and PDUs to what was agreed, to jobs, and to what the ends say of themselves.

Takes the segments of TCP (`tcp`, `tpkt`), gives each PDU to `jobs`, `transfers` or `szl`, and counts the
rest. What is wrong with it is said elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from ds47.s7 import pdu as pdus
from ds47.s7 import szl
from ds47.s7.jobs import OPERATIONS, Hear, Jobs
from ds47.s7.model import (
    DONE,
    ERROR,
    GET,
    ORPHAN,
    PARTIAL,
    PUT,
    REFUSED,
    UNANSWERED,
    At,
    JobCounts,
    S7Connection,
    S7Job,
    S7Listener,
)
from ds47.s7.pdu import ACKNOWLEDGE, ANSWER, JOB, SETUP, USER_DATA, S7Pdu, UserData
from ds47.s7.tcp import Streams, Talk, TcpPiece, TcpSegment
from ds47.s7.tpkt import CC, CR, DR, DT, LEAST, TpduReader, WholeTpdu
from ds47.s7.transfers import Transfers
from ds47.spec.semantics import Limits

_ONE_BSEND = 1
"""Subfunction of a BSEND in its group."""
_READ_SZL = 1
"""Subfunction of reading an SZL in the group of the CPU."""
_EVIDENCE = 8
"""What is kept of what a server says of itself."""


@dataclass(slots=True, eq=False)
class _Line:
    """What is kept of a TCP connection."""

    forward: TpduReader = field(default_factory=TpduReader)
    backward: TpduReader = field(default_factory=TpduReader)
    connection: S7Connection | None = None
    refused: bool = False
    asked: At | None = None
    """CR."""
    asked_setup: int | None = None
    """Reference of the setup that was not answered yet."""


class Connections:
    """All connections of a capture.

    Args:
        ports: of servers.
        bounds: how much is kept.
        over: gets each finished job, after the listener.
        listener: hears of what happens.
    """

    def __init__(
        self,
        ports: frozenset[int],
        bounds: Limits,
        over: Hear,
        listener: S7Listener | None = None,
    ) -> None:
        self._bounds = bounds
        self._settle = over
        self._listener = S7Listener() if listener is None else listener
        self._streams = Streams(
            ports, self._take, self._over, bounds.s7_connections, bounds.s7_bytes
        )
        self._jobs = Jobs(bounds, self._asked, self._settled)
        self._transfers = Transfers(bounds, self._asked, self._settled)
        self._number = 0
        self._frame, self._position = 0, 0
        """The frame of the last PDU, and its position in it."""
        self._all: list[S7Connection] = []
        self.left_out = 0
        """Connections for which there was no room."""

    def feed(self, segment: TcpSegment, at: At) -> None:
        """The next segment of TCP."""
        self._streams.feed(segment, at)

    def finish(self) -> None:
        """Nothing more comes."""
        self._streams.finish()

    def all(self) -> Iterator[S7Connection]:
        """Those of S7, in the order of their first frames; connections of other protocols on its port are none."""
        return (each for each in self._all if not each.foreign or _is_s7(each))

    # From bytes to PDUs

    def _take(self, talk: Talk, from_client: bool, piece: TcpPiece) -> None:
        line: _Line | None = talk.owner
        if line is None:
            line = talk.owner = _Line()
        reader = line.forward if from_client else line.backward
        before, held = reader.lost, reader.held
        if piece.lost:
            if not piece.data and reader.held >= LEAST and line.connection is None:
                self._connection(talk, line, piece.at)  # cut off in its first TPDU
            self._lose(line)
        for whole in reader.take(piece):
            self._tpdu(talk, line, from_client, whole)
        if reader.lost > before and line.connection is not None:
            line.connection.lost_bytes += reader.lost - before
            self._lose(line)
        talk.kept += reader.held - held

    def _lose(self, line: _Line) -> None:
        """Bytes are lost: what its setup and its open jobs wait for may be among them."""
        line.asked_setup = None
        if line.connection is not None:
            self._jobs.lose(line.connection)
            self._transfers.lose(line.connection)

    def _over(self, talk: Talk, reset: bool, at: At) -> None:
        line: _Line | None = talk.owner
        if line is None:
            if reset and talk.begun and not talk.lacks(True) and not talk.lacks(False):
                line = talk.owner = _Line()
                self._refuse(line, self._connection(talk, line, at), "reset", at)
            return
        connection = line.connection
        if connection is None:
            return
        since = at.time_ns - self._bounds.unread_ns if talk.open_ended else None
        asked = line.asked
        waited = asked is not None and (since is None or asked.time_ns < since)
        if waited and self._unconfirmed(line, connection):
            self._refuse(line, connection, "reset" if reset else "no_confirm", asked or at)
        self._jobs.close(connection, since)
        self._transfers.close(connection, since)
        connection.closed = True
        connection.missing, connection.cut = _missing(talk), talk.cut
        self._listener.closed(connection)
        talk.owner = None

    def _tpdu(self, talk: Talk, line: _Line, from_client: bool, whole: WholeTpdu) -> None:
        tpdu, at = whole.tpdu, whole.at
        if tpdu.kind not in (CR, CC, DR, DT) or (tpdu.kind == DT and not whole.data):
            return
        connection = line.connection or self._connection(talk, line, at)
        connection.disordered |= at.time_ns < connection.last.time_ns
        if at > connection.last:
            connection.last = at
        if tpdu.kind == DT:
            self._data(line, connection, from_client, whole)
        elif tpdu.kind == DR:
            if line.asked is not None and not from_client and self._unconfirmed(line, connection):
                self._refuse(line, connection, "disconnect", at, tpdu.reason or 0)
        else:
            connection.client_tsap = tpdu.calling or connection.client_tsap
            connection.server_tsap = tpdu.called or connection.server_tsap
            connection.tpdu_size = tpdu.size or connection.tpdu_size
            if tpdu.kind == CR:
                connection.begun, line.asked = True, at
            else:
                connection.confirmed = at

    def _connection(self, talk: Talk, line: _Line, at: At) -> S7Connection:
        self._number += 1
        line.connection = S7Connection(
            self._number, talk.client, talk.server, at, at, talk.begun, talk.lacks
        )
        if len(self._all) < self._bounds.s7_told:
            self._all.append(line.connection)
        else:
            self.left_out += 1
        self._listener.opened(line.connection)
        return line.connection

    def _unconfirmed(self, line: _Line, connection: S7Connection) -> bool:
        """Whether there was no CC, nor what follows one, and the capture lacks nothing of the server."""
        answered = connection.confirmed is not None or _is_s7(connection)
        return not (answered or line.backward.lost or connection.lacks(False))

    def _refuse(
        self, line: _Line, connection: S7Connection, why: str, at: At, code: int = 0
    ) -> None:
        if not line.refused:
            line.refused = True
            self._listener.refused(connection, why, at, code)

    # What a PDU is

    def _data(
        self, line: _Line, connection: S7Connection, from_client: bool, whole: WholeTpdu
    ) -> None:
        first, at = whole.data[0], whole.at
        if first != pdus.PROTOCOL:
            if first == pdus.PLUS:
                connection.plus += 1
            else:
                connection.foreign += 1
            return
        self._position = self._position + 1 if at.frame == self._frame else 0
        self._frame = at.frame
        pdu = pdus.decode(whole.data)
        pdu.frames = whole.frames
        if pdu.kind is None:
            connection.other += 1
            return
        agreed = connection.pdu_length
        if agreed is not None and pdu.size > agreed:
            self._listener.larger(connection, from_client, at, pdu.size)
        if pdu.kind == JOB:
            known = self._job(line, connection, from_client, pdu, at)
        elif pdu.kind in (ACKNOWLEDGE, ANSWER):
            known = self._answer(line, connection, from_client, pdu, at)
        else:
            known = pdu.kind == USER_DATA and self._user_data(connection, from_client, pdu, at)
        connection.other += not known

    def _job(
        self, line: _Line, connection: S7Connection, from_client: bool, pdu: S7Pdu, at: At
    ) -> bool:
        if pdu.function in OPERATIONS:
            self._jobs.asked(connection, from_client, pdu, at)
            return True
        found = pdus.setup(pdu) if pdu.function == SETUP else None
        if found is None:
            return False
        connection.asked_pdu = found.pdu_length
        line.asked_setup = pdu.reference
        return True

    def _answer(
        self, line: _Line, connection: S7Connection, from_client: bool, pdu: S7Pdu, at: At
    ) -> bool:
        if self._jobs.answered(connection, from_client, pdu, at):
            return True
        if pdu.error and pdu.reference == line.asked_setup:
            line.asked_setup = None
            self._refuse(line, connection, "setup", at, pdu.error)
            return True
        found = pdus.setup(pdu) if pdu.function == SETUP else None
        if found is None:
            return False
        line.asked_setup = None
        connection.pdu_length, connection.parallel = found.pdu_length, found.calling
        connection.setup = at
        self._listener.agreed(connection)
        return True

    def _user_data(self, connection: S7Connection, from_client: bool, pdu: S7Pdu, at: At) -> bool:
        sent = pdus.usend(pdu)
        if sent is not None:
            self._transfers.usend(connection, from_client, pdu, sent, at)
            return True
        data = pdus.user_data(pdu)
        if data is None:
            return False
        if data.group == pdus.PROGRAM and data.subfunction == _ONE_BSEND:
            if data.type == pdus.REQUEST:
                part = pdus.segment(pdu, data)
                if part is not None:
                    self._transfers.sent(connection, from_client, pdu, part, at)
                return part is not None
            return self._transfers.acknowledged(connection, from_client, pdu, data, at)
        if data.group == pdus.CYCLIC:
            connection.cyclic += 1
            return True
        if data.group == pdus.CPU and data.subfunction == _READ_SZL and data.type == pdus.RESPONSE:
            self._szl(connection, data, at)
        return False

    def _szl(self, connection: S7Connection, data: UserData, at: At) -> None:
        for found in szl.evidence(data, at):
            known = [each.name for each in connection.evidence]
            if found.name not in known and len(known) < _EVIDENCE:
                connection.evidence.append(found)
                self._listener.evidence(connection, found)

    # What becomes of jobs

    def _asked(self, job: S7Job) -> None:
        job.position = self._position
        self._listener.asked(job)

    def _settled(self, job: S7Job) -> None:
        if job.state == ORPHAN and not job.segments:
            job.position = self._position
        count(job.connection.counts, job)
        self._listener.over(job)
        self._settle(job)


def _missing(talk: Talk) -> str | None:
    """What the capture lacks of a connection: a key of diagnoses.toml."""
    silent = talk.silent()
    if silent is not None:
        return "s7_client_missing" if silent else "s7_server_missing"
    lost = talk.forward.lost or talk.backward.lost or talk.lacks(True) or talk.lacks(False)
    return "s7_bytes_missing" if lost else None


def count(counts: JobCounts, job: S7Job) -> None:
    """One more job is over."""
    state, operation = job.state, job.operation
    if state == ORPHAN:
        counts.orphans += 1
        counts.refused += any(item.code not in (DONE, None) for item in job.items)
    else:
        counts.jobs += 1
        counts.refused += state in (ERROR, PARTIAL, REFUSED)
        counts.unanswered += state == UNANSWERED
    for item in job.items:
        code, size = item.code, len(item.value or b"")
        if operation == PUT:
            counts.written += size if code == DONE else 0
        elif code == DONE or code is None:
            if operation == GET:
                counts.read += size
            else:
                counts.sent += size
    took = job.duration_ns
    if took is not None:
        counts.least_ns = took if not counts.timed else min(counts.least_ns, took)
        counts.most_ns = took if not counts.timed else max(counts.most_ns, took)
        counts.timed += 1
        counts.total_ns += took


def _is_s7(connection: S7Connection) -> bool:
    """Whether a PDU of S7 or S7CommPlus was seen."""
    counts = connection.counts
    return bool(
        connection.plus or connection.cyclic or connection.other or connection.asked_pdu
        or connection.setup or counts.jobs or counts.orphans
    )  # fmt: skip
