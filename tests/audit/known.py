"""What the reports say wrongly today, and why: a complaint that is in this table is counted, and fails nothing.

The table must become empty. A rule (or part of the report) and an expression of the complaint -> what is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from tests.audit.reading import Complaint

KNOWN: dict[tuple[str, str], str] = {
    ("headline", ""): "headlines name what is true of the first case only; their filters show the first frames",
    ("line", "PLC"): "what the PLC saw: refused in part, another request, BUSY, RDREC, LEN",
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
