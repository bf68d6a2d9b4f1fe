"""Which responses teach the dictionary, and when it explains the parameters of a job.

A description counts from its response on: a transaction uses what was said up to its own response, or up to its
end if it has none. So a line of ndjson, which cannot be changed later, has the same names as a report.
`ds47.profidrive.dictionary` decides what the elements of a description mean, and for which drive objects.
"""

from __future__ import annotations

from typing import Final

from ds47.acyclic.pairing import Job
from ds47.acyclic.readback import access_of
from ds47.profidrive import Request
from ds47.profidrive.dictionary import Dictionary
from ds47.profidrive.model import DESCRIPTION, VALUE

_READ: Final = (0x01, 0x81)
"""Response ids of a read, all of it or a part."""
_BROKEN: Final = frozenset(("DS309", "DS313", "DS315"))
"""Flaws of a response that is not decoded to its end: unknown format, bytes left over, bytes missing."""


def answered(dictionary: Dictionary, job: Job) -> None:
    """A job has its response: learns its descriptions, then looks its parameters up.

    If its AR proves itself late, descriptions from behind its response are known already.
    """
    half = job.read_response
    if job.message is not None and job.message.describes and job.message.operation == "read":
        _learn(dictionary, job, job.message)
    ask(dictionary, job, None if half is None else half.frame)


def ask(dictionary: Dictionary, job: Job, until: int | None = None) -> None:
    """Notes on a job what the drive has said about its parameters, so far or up to the frame `until`."""
    if dictionary.is_empty or job.message is None:
        return
    access, peer = access_of(job), job.peer
    found = [
        dictionary.meaning(access, each.pnu, peer.vendor_id, until, peer.family)
        if each.attribute == VALUE
        else None
        for each in job.message.addresses
    ]
    job.meanings = [None if each is None or not each.is_said else each for each in found]


def _learn(dictionary: Dictionary, job: Job, request: Request) -> None:
    """The descriptions in a response, if it is whole and belongs to its request."""
    response, half = job.response, job.read_response
    if response is None or half is None or response.response_id not in _READ:
        return
    broken = half.missing or half.status or any(flaw.rule in _BROKEN for flaw in response.flaws)
    if broken or job.stray:
        return
    access = access_of(job)
    for address, block in zip(request.addresses, response.blocks, strict=False):
        if address.attribute == DESCRIPTION and address.element_count <= 1 and block.error is None:
            dictionary.learn(
                access, address.pnu, address.subindex, block.format_name, block.values, half.frame
            )
