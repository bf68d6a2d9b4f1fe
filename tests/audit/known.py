"""What the reports say wrongly today, and why: a complaint that is in this table is counted, and fails nothing.

The table must become empty. A rule (or part of the report) and an expression of the complaint -> what is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from tests.audit.reading import Complaint

KNOWN: dict[tuple[str, str], str] = {
    ("DS401", "channel goes on"): "the channel goes on, and 'the capture ends'",
    ("DS402", "channel goes on"): "the channel goes on, and 'the capture ends'",
    ("DS403", "same response"): "a ReadImplicit is called a response without a request",
    ("DS704", "none of the refused"): "which Write was refused before the response was read once more",
    ("DS705", "is in the capture"): "only the newest request of a place is remembered",
    ("headline", ""): "headlines name what is true of the first case only; their filters show the first frames",
    ("DS413", "that followed|was fetched"): "with a lost Write response the new request is another",
    ("DS414", "that followed|was fetched"): "with a lost Write response the new request is another",
    ("line", "PLC"): "what the PLC saw: refused in part, another request, BUSY, RDREC, LEN",
    ("transaction", "state ok"): "a response that ends too early leaves the state ok",
    ("transaction", "is one of its frames"): "a Read whose response was lost is given to a later request",
}  # fmt: skip


def split(complaints: Iterable[Complaint]) -> tuple[list[Complaint], list[Complaint]]:
    """Complaints that nobody knows, and those that are known."""
    new: list[Complaint] = []
    known: list[Complaint] = []
    for each in complaints:
        (known if reason(each) is not None else new).append(each)
    return new, known


def reason(complaint: Complaint) -> str | None:
    """Why a complaint is known; None where it is not."""
    for (rule, form), text in KNOWN.items():
        if rule == complaint.rule and re.search(form, f"{complaint.where} {complaint.text}"):
            return text
    return None
