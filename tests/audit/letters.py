"""Whether the letter in front of a number is the one that the tables of its family of drives say.

The tables are read as they stand. Whose parameters a drive has: of the vendor on PROFINET, on PROFIBUS of the ident
number of the GSD, which is not looked at here, so that a family is asked for there and none is judged.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.audit.meant import rows_of
from tests.audit.reading import Complaint, Finding, Reading

SIEMENS = 0x002A
FAMILIES = {
    "sinamics": ("sinamics", "sinamics-dcm", "siemens", "encoder", "profile"),
    "micromaster": ("micromaster", "siemens", "profile"),
    "profile": ("profile",),
}
_SPELLED = re.compile(r"\b([prP])(\d{4,5})\b")


def check(finding: Finding, reading: Reading) -> Iterator[Complaint]:
    """All complaints about the letters in the sentence of a finding."""
    item = finding.rule == "DS908" and finding.args.get("family") is None  # of a CPU
    if item or "family" not in finding.args:
        return
    for text in _family(finding, reading):
        yield Complaint(finding.rule, f"frame {finding.frame}, family", text)
    known = finding.args["family"] in FAMILIES
    for text in problems(finding.message, finding.args["family"]) if known else ():
        yield Complaint(finding.rule, f"frame {finding.frame}, sentence", text)


def _family(finding: Finding, reading: Reading) -> Iterator[str]:
    told, deal = finding.args["family"], reading.deal(finding)
    device = deal.device if deal is not None else finding.args.get("device", "")
    if told not in FAMILIES:
        yield f"{told!r} is no family"
    elif not str(device).startswith("dp") and device in reading.vendors:
        truth = "sinamics" if reading.vendors[device] == SIEMENS else "profile"
        if told != truth:
            yield f"{told!r} is {truth!r}"


def problems(text: str, family: str) -> Iterator[str]:
    """The numbers in a text that have another letter than on drives of this family; not what a maker says of its own."""
    for letter, number in _SPELLED.findall(re.sub(r'".*?"|SINAMICS: .*', "", text)):
        truth = expected(int(number), family)
        if letter != truth:
            yield f"says {letter}{number}, which is {truth}{number} on {family}"


def expected(number: int, family: str) -> str:
    """`r` where the nearest table that says the access has it so, else the letter of what may be written."""
    rows = rows_of(number)
    said = [
        row["access"]
        for name in FAMILIES[family]
        for row in rows
        if row.get("family", "profile") == name and "access" in row
    ]
    if said[:1] == ["r"]:
        return "r"
    return "P" if family == "micromaster" else "p"
