"""What programs send each other: BSEND with its segments and their acknowledgements, and USEND (docs/s7.md 5).

A BSEND is known by its R_ID until its last segment is acknowledged; each acknowledgement has the PDU reference of
its segment. Whether a BRCV of this R_ID takes it, no frame says.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from ds47.s7.jobs import is_recent
from ds47.s7.model import (
    BSEND,
    INCOMPLETE,
    OK,
    ORPHAN,
    PARTIAL,
    REFUSED,
    UNANSWERED,
    USEND,
    At,
    BsendSegment,
    S7Connection,
    S7Item,
    S7Job,
)
from ds47.s7.pdu import S7Pdu, SegmentData, Usend, UserData
from ds47.spec.semantics import Limits

_Key = tuple[int, bool, int]
"""Number of the connection, whether its client sends, and the R_ID or the reference."""
MOST_SEGMENTS = 4096
"""Segments of a BSEND; one of 65534 bytes has 290 where a PDU has 260 bytes."""
_MOST_BYTES = 1 << 16
Hear = Callable[[S7Job], None]


@dataclass(slots=True, eq=False)
class _Open:
    """A BSEND that is not over."""

    job: S7Job
    key: _Key
    whole: bool
    """Whether its first segment was seen."""
    data: bytearray = field(default_factory=bytearray)


class Transfers:
    """The open BSEND of all connections.

    Args:
        bounds: how many may be open.
        asked: gets each transfer at its first segment.
        over: gets each finished transfer.
    """

    def __init__(self, bounds: Limits, asked: Hear, over: Hear) -> None:
        self._bounds = bounds
        self._asked = asked
        self._over = over
        self._open: OrderedDict[_Key, _Open] = OrderedDict()
        self._waiting: dict[_Key, tuple[_Open, BsendSegment]] = {}
        """Segments without acknowledgement, by their references."""

    def sent(
        self, connection: S7Connection, from_client: bool, pdu: S7Pdu, new: SegmentData, at: At
    ) -> None:
        """A segment of a BSEND."""
        key = connection.number, from_client, new.r_id
        found = self._open.get(key)
        if found is None or new.total is not None:
            found = self._begin(key, connection, pdu, new, at)
        part = BsendSegment(
            at, len(new.data), new.number, new.sequence, new.last, len(pdu.data), pdu.reference
        )
        found.job.segments.append(part)
        found.job.flaws += pdu.flaws
        found.job.frames += pdu.frames
        found.data += new.data
        if len(found.data) > _MOST_BYTES or len(found.job.segments) > MOST_SEGMENTS:
            self._give_up(found)
            return
        self._waiting[connection.number, from_client, pdu.reference] = found, part

    def acknowledged(
        self, connection: S7Connection, from_client: bool, pdu: S7Pdu, data: UserData, at: At
    ) -> bool:
        """An acknowledgement; False where nothing waits for it."""
        key = connection.number, not from_client, pdu.reference
        found, part = self._waiting.pop(key, (None, None))
        if found is None or part is None:
            return False
        part.acknowledged, part.assigned, part.error = at, data.sequence, data.error
        job = found.job
        job.answer_flaws += pdu.flaws
        job.frames += pdu.frames
        if data.error:
            job.state, job.error, job.answered = REFUSED, data.error, at
            self._close(found)
        elif part.last:
            job.error, job.answered = 0, at
            whole = found.whole and len(found.data) == job.total
            short = INCOMPLETE if job.lost else PARTIAL  # lost segments were not left out
            job.state = OK if whole else short if found.whole else ORPHAN
            self._close(found)
        return True

    def usend(
        self, connection: S7Connection, from_client: bool, pdu: S7Pdu, sent: Usend, at: At
    ) -> None:
        """A USEND, which has no answer."""
        job = S7Job(
            USEND, connection, from_client, pdu.reference, at, [S7Item(None, area) for area in sent.areas],
            request=pdu.data, r_id=sent.r_id, state=OK, flaws=pdu.flaws, frames=pdu.frames,
        )  # fmt: skip
        self._asked(job)
        self._over(job)
        job.phase = "closed"

    def lose(self, connection: S7Connection) -> None:
        """Bytes of a connection are lost: segments or acknowledgements may be among them."""
        for found in self._open.values():
            if found.job.connection is connection:
                found.job.lost = True

    def close(self, connection: S7Connection, since: int | None) -> None:
        """A connection is over. With a time, the capture is over, and younger transfers may be incomplete."""
        for found in [each for each in self._open.values() if each.job.connection is connection]:
            found.job.lost = found.job.lost or is_recent(found.job, since)
            self._give_up(found)

    def _begin(
        self, key: _Key, connection: S7Connection, pdu: S7Pdu, new: SegmentData, at: At
    ) -> _Open:
        """Begins a transfer; an unfinished one with the same R_ID is given up after that."""
        job = S7Job(
            BSEND, connection, key[1], pdu.reference, at, [], r_id=new.r_id, total=new.total
        )
        before, found = self._open.get(key), _Open(job, key, new.total is not None)
        self._asked(job)
        if before is not None:
            self._give_up(before)
        self._open[key] = found
        if len(self._open) > self._bounds.s7_transfers:
            self._give_up(next(iter(self._open.values())))
        return found

    def _give_up(self, found: _Open) -> None:
        job = found.job
        job.lost = job.lost or job.connection.lacks(True) or job.connection.lacks(False)
        silent = INCOMPLETE if job.lost else UNANSWERED
        job.state = silent if found.whole else ORPHAN
        self._close(found)

    def _close(self, found: _Open) -> None:
        job = found.job
        self._open.pop(found.key, None)
        for part in job.segments:
            key = job.connection.number, job.from_client, part.reference
            if self._waiting.get(key, (None,))[0] is found:
                del self._waiting[key]
        job.items = [S7Item(None, bytes(found.data))]
        self._over(job)
        job.phase = "closed"
