"""What the reports say wrongly today, and why: a complaint that is in this table is counted, and fails nothing.

The table must become empty. A rule (or part of the report) and an expression of the complaint -> what is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from tests.audit.reading import Complaint

KNOWN: dict[tuple[str, str], str] = {
    ("DS107", "step back|two frames|milliseconds"): "events of an AR that proves itself late come out of order",
    ("DS401", "channel goes on"): "the channel goes on, and 'the capture ends'",
    ("DS402", "channel goes on"): "the channel goes on, and 'the capture ends'",
    ("DS403", "same response"): "a ReadImplicit is called a response without a request",
    ("DS410", "code|info"): "the words behind response ID 0x80 are those of an error",
    ("DS416", "milliseconds"): "the pause ends with the first poll whose request is there",
    ("DS703", "count"): "the Reads that DS706 explains are left out, and the sentence speaks of all",
    ("DS704", "none of the refused"): "which Write was refused before the response was read once more",
    ("DS706", "asked there"): "a Write whose request was lost is there, too",
    ("DS722", "another AR"): "a Connect of another AR of the same station is said to end the connection",
    ("DS723", "count|period"): "a run is counted in the order in which jobs are closed",
    ("DS705", "is in the capture"): "only the newest request of a place is remembered",
    ("DS708", "accepted in frame|no call there"): "one refusal is said to be all, or stands on another frame",
    ("DS714", "reads it as"): "the table of parameters is believed, not what the drive reads",
    ("DS721", ""): "changes are counted whose outcome nobody knows; p0971 of one drive object counts for all",
    ("DS709", "corrected|changes drive object|drive answers|does not decode|nothing proves|keeps"):
        "a corrected request goes to a guessed drive object",
    ("DS714", "drive answers|nothing proves|keeps"): "the corrected request keeps what was refused",
    ("DS715", "drive answers|nothing proves|keeps|to which"): "the corrected request is not proven",
    ("DS716", "drive answers|nothing proves|keeps|to which"): "the corrected request is not proven",
    ("DS717", "does not decode|drive answers|nothing proves|keeps|to which"): "keeps what was refused",
    ("DS413", "that followed|was fetched"): "with a lost Write response the new request is another",
    ("DS414", "that followed|was fetched"): "with a lost Write response the new request is another",
    ("DS725", "count"): "what is cut is counted by records of the channel, not by frames",
    ("transaction", "state ok"): "a response that ends too early leaves the state ok",
    ("DS714", "is not read in this format there"): "what was read of another drive object is told, or of an element",
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
