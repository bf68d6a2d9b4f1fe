"""What reports of the two ends of a wire say, against what clients and drive did.

Every request is one transaction, however often its datagram was sent, and has the response that its client got. Where
the client got no answer to a call, it has none, or one that the drive gave to the same request.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tests.audit import lossy, run
from tests.audit.reading import Complaint, Deal, Reading, read

OF_THE_WIRE = {
    "DS101", "DS102", "DS109", "DS401", "DS402", "DS403", "DS413", "DS414", "DS702", "DS703", "DS704", "DS705",
    "DS706", "DS722",
}  # fmt: skip
"""What is said of calls without an answer, of requests that were not fetched, and of answers to other requests."""

EITHER = ("it is known whose request was open", "the drive reads it as")
"""A drive that executes a repeated call: which of two answers its client has nobody knows, nor what was done last."""


def of(made: lossy.Conversation, folder: Path) -> Iterator[Complaint]:
    """What is not so in the reports of both ends."""
    for name, tap in (("near the controllers", made.near), ("near the drive", made.far)):
        path = folder / "end.pcap"
        tap.write(path)
        item = read(path, page=False)
        for each in (*run.complaints(item, {}), *told(made, tap, item)):
            if made.plan.cache or not each.text.startswith(EITHER):
                yield Complaint(each.rule, f"{each.where} ({name})", each.text)


def told(made: lossy.Conversation, tap: lossy.Tap, item: Reading) -> Iterator[Complaint]:
    """What is not so in the report of one end."""
    yield from _requests(made, tap, item)
    yield from _displaced(made, tap, item)
    calls = {(job.client, each.sequence, True) for job in made.jobs for each in job.calls}
    if not all(each.sure for each in made.jobs):
        return
    if calls <= tap.whole and (made.plan.cache or tap is made.near):
        for deal in (each for each in item.deals if each.write is None):
            yield Complaint("wire", f"#{deal.id}", "has a request that is in the capture")
    untrue = OF_THE_WIRE - _own(made) if made.plan.repeats else set()
    for finding in item.findings:
        if finding.rule in untrue:
            yield Complaint(finding.rule, f"frame {finding.frame}", finding.message)


def _requests(made: lossy.Conversation, tap: lossy.Tap, item: Reading) -> Iterator[Complaint]:
    """Each Write of which a whole datagram was there is one transaction, and there are no others."""
    deals: dict[lossy.Label, list[Deal]] = {}
    for deal in item.deals:
        if deal.write is not None:
            deals.setdefault(tap.labels[deal.write - 1], []).append(deal)
    for job in made.jobs:
        label = job.client, job.write.sequence, True
        found = deals.pop(label, [])
        if len(found) != (label in tap.whole):
            text = f"are {len(found)} transactions"
            yield Complaint("wire", f"Write {job.write.sequence} of {job.client}", text)
        for deal in found:
            for text in _job(made, job, deal, tap):
                yield Complaint("wire", f"#{deal.id}", text)
    for deal in (each for several in deals.values() for each in several):
        yield Complaint("wire", f"#{deal.id}", "is no request that was written")


def _displaced(made: lossy.Conversation, tap: lossy.Tap, item: Reading) -> Iterator[Complaint]:
    """No connection ended while a request was open, where its channel took another one before."""
    taken = {
        (job.client, job.write.at): job.write.sequence
        for job in made.jobs if job.write.got and not job.write.got.status
    }  # fmt: skip
    by_call = {(job.client, job.write.sequence): job.write.at for job in made.jobs}
    for finding in item.findings:
        if finding.rule in ("DS401", "DS402", "DS722"):
            client, sequence, _ = tap.labels[finding.frame - 1]
            at = by_call.get((client, sequence))
            if at is not None and taken.get((client, at), 0) > sequence:
                later = taken[client, at]
                text = f"Write {later} was accepted there [{finding.message}]"
                yield Complaint(finding.rule, f"frame {finding.frame}", text)


def _own(made: lossy.Conversation) -> set[str]:
    """Rules that speak of what a program does, whatever the wire did."""
    unread = any(job.response is None for job in made.jobs)
    own = {"DS401", "DS402", "DS413", "DS414", "DS702", "DS722"} if unread else set()
    if (
        not made.plan.cache
    ):  # what is executed once more displaces and refuses, and answers what nobody asks any more
        own |= {"DS403", "DS703", "DS704", "DS705", "DS706"}
    return own


def _job(made: lossy.Conversation, job: lossy.Job, deal: Deal, tap: lossy.Tap) -> Iterator[str]:
    raw = deal.plain["bytes"]
    asked, answer = raw["request"], raw["response"]
    if asked != (job.write.data or b"").hex():
        yield "has another request"
    got = None if job.response is None else job.response.hex()
    if job.sure and made.plan.repeats and (made.plan.cache or tap is made.near):
        possible = {got}
        # The refusal of a record that is too long ends it only where no Read may be missing behind that.
        polls = len(deal.polls) - (deal.state == "incomplete" and job.ended_short)
        if tap is made.near and polls != job.polls:
            yield f"has {polls} polls, not {job.polls}"
    else:
        reads = (
            said for other in made.jobs if other.write.at == job.write.at
            for each in other.reads for said in each.said
        )  # fmt: skip
        possible = {None, got, *(said.data.hex() for said in reads if said.to == job.write.data)}
    if answer not in possible and deal.state != "mismatch":
        yield f"has the response {answer}, not {got}"
