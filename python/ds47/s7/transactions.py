"""Jobs that are over as transactions of the report, and connections as it tells of them.

What was wrong with them is not said here.
"""

from __future__ import annotations

from functools import lru_cache
from typing import cast

from ds47 import model
from ds47.model import S7, Frames, Read, State, Transaction
from ds47.s7 import addresses, drives
from ds47.s7.blocks import BlockSize
from ds47.s7.drives import DriveElement
from ds47.s7.model import S7Address, S7Connection, S7Item, S7Job
from ds47.spec import Operation, s7

_BYTE = 8


def build(job: S7Job, *, of_drive: bool) -> Transaction:
    """The transaction of a job that is over; `of_drive`: its partner is known as a drive."""
    asked, answered = job.asked, job.answered
    first = asked or answered
    assert first is not None
    segments = [
        Read(each.at.frame, each.acknowledged and each.acknowledged.frame) for each in job.segments
    ]
    transaction = Transaction(
        operation=cast(Operation, job.operation),
        state=cast(State, job.state),
        controller=job.asker.ip,
        device=job.partner.ip,
        ar=None,
        api=None,
        slot=None,
        subslot=None,
        index=None,
        request_reference=job.reference,
        axis=None,
        frames=Frames(asked and asked.frame, read_response=answered and answered.frame),
        start_ns=first.time_ns,
        duration_ns=job.duration_ns,
        request=job.request or None,
        response=job.response or None,
        write_status=None,
        read_status=None,
        parameters=[],
        position=job.position,
        channel=S7,
        connection=job.connection.number,
        items=[_item(each, job) for each in job.items],
        r_id=job.r_id,
        error=job.error,
        segments=segments,
    )
    if of_drive:
        name_elements(transaction)
    return transaction


def name_elements(transaction: Transaction) -> None:
    """Adds the drive element to each item: the partner is a drive."""
    for item in transaction.items:
        found = drives.element_of(item)
        if found is not None:
            item.drive_object = found.drive_object
            item.parameter = drives.parameter(found, item.value)


def _item(item: S7Item, job: S7Job) -> model.Item:
    """An item of the report; of what is sent the bytes are all that is known."""
    address = item.address
    if address is None:
        length = len(item.value) if job.r_id is not None and item.value is not None else None
        return model.Item(None, None, None, None, None, length, item.value, item.code)
    return model.Item(*_named(address), item.value, item.code)


@lru_cache(maxsize=4096)
def _named(address: S7Address) -> tuple[str, str | None, int | None, int, int | None, int | None]:
    """An address as the report has it: its text, letter of the area, DB, start, bit, bytes."""
    row = s7.areas().get(address.area)
    elements = row is not None and row.elements
    start, bit = (address.start, None) if elements else divmod(address.start, _BYTE)
    return (
        addresses.text(address),
        None if row is None else row.letter,
        address.db if row is not None and row.numbered else None,
        start,
        bit if address.size == 1 or bit else None,
        address.length if address.size else None,
    )


def connection(
    item: S7Connection,
    block: BlockSize | None,
    drive: tuple[str, tuple[str, DriveElement] | None] | None,
) -> model.Connection:
    """A connection in the form of the report, with the block size of its server, and the proof of a drive."""
    rack_and_slot, counts = s7.rack_and_slot(item.server_tsap), item.counts
    span = None
    if counts.timed:
        mean = counts.total_ns // counts.timed
        span = model.Span(counts.least_ns, mean, counts.most_ns)
    return model.Connection(
        id=item.number,
        client=item.client.ip,
        client_port=item.client.port,
        server=item.server.ip,
        server_port=item.server.port,
        client_tsap=item.client_tsap,
        server_tsap=item.server_tsap,
        rack=rack_and_slot and rack_and_slot[0],
        slot=rack_and_slot and rack_and_slot[1],
        pdu_length=item.pdu_length,
        parallel=item.parallel,
        most_open=item.most_open,
        jobs=counts.jobs,
        refused=counts.refused,
        unanswered=counts.unanswered,
        orphans=counts.orphans,
        read_bytes=counts.read,
        written_bytes=counts.written,
        sent_bytes=counts.sent,
        answer=span,
        cyclic=item.cyclic,
        other=item.other,
        plus=item.plus,
        lost_bytes=item.lost_bytes,
        first_frame=item.opened.frame,
        last_frame=item.last.frame,
        setup=item.setup and item.setup.frame,
        block=None if block is None else block.size,
        drive=None if drive is None else _drive(*drive),
        evidence=[model.Evidence(each.name, each.value, each.at.frame) for each in item.evidence],
    )


def _drive(proof: str, example: tuple[str, DriveElement] | None) -> model.Drive:
    address, found = example or (None, None)
    return model.Drive(proof, address, *(found or (None, None, None)))
