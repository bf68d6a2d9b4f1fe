"""What reports call the place that a request addresses: a drive object only where it is proved to be one.

The tables of the page, the lines of the text report, and the same lines in Lua.
"""

from __future__ import annotations

import re
from pathlib import Path

import handmade
import pytest
from test_report_opening import DRIVE, capture, opening, written

from ds47.analysis import analyze
from ds47.model import Diagnosis, Parameter, ParameterError
from ds47.profidrive.drive_objects import DriveObjects, access_of
from ds47.report.html.views.drives import drives
from ds47.report.html.views.elements import elements
from ds47.report.html.views.rows import ROW, packed_rows
from ds47.report.targets import Targets

STACKS = Path(__file__).resolve().parents[3] / "shared/captures/real-stacks"
LOCAL, GLOBAL = 0xB02E, 0xB02F


def job(number=1, axis=2, index=47, slot=1, pnu=2900, value=1, error=None, **changes):
    """A read of one parameter."""
    failed = None if error is None else ParameterError(error, 0)
    item = Parameter(
        pnu, 0, "value", 0, format="Unsigned16", values=[] if failed else [value], error=failed
    )
    state = "error" if failed else "ok"
    given = {"state": state, "parameters": [item], **changes}
    return handmade.transaction(id=number, axis=axis, index=index, slot=slot, **given)


def identified(number, slot, drive_object):
    """A local read of PNU 975 that names the drive object of its submodule."""
    values = [0, 0, 0, 0, 0, 0, 0, drive_object]
    item = Parameter(975, 0, "value", 8, format="Unsigned16", values=values)
    return handmade.transaction(id=number, axis=9, index=LOCAL, slot=slot, parameters=[item])


def rows(*jobs):
    """(drive object, PNU, subindex, reads with a value) of the table of parameters."""
    table, _ = elements(capture(*jobs), Targets(jobs))
    return [(row[1], row[2], row[3], row[7]) for row in table["rows"]]


def of_2900(*jobs):
    return [(row[0], row[3]) for row in rows(*jobs) if row[1] == 2900]


REFUSED = {"number": 90, "axis": 9, "error": 0x19}
"""A drive object that is not there: the device looks at the axis byte."""


# One identity


def test_one_parameter_through_several_access_points_is_one_row():
    ways = [job(1), job(2, index=GLOBAL), job(3, slot=2), job(4, index=LOCAL, slot=1, axis=7)]
    assert of_2900(*ways, identified(5, 1, 2), job(**REFUSED)) == [("DO 2", 4), ("axis 9", 0)]


def test_without_evidence_submodules_stay_apart_and_are_told_apart_by_their_slot():
    ways = [
        job(1, index=LOCAL, axis=2),
        job(2, index=LOCAL, slot=2, axis=2),
        job(3, index=LOCAL, axis=0),
    ]
    assert of_2900(*ways) == [("slot 1.1", 2), ("slot 2.1", 1)]


def test_a_device_that_never_looked_at_the_axis_byte_may_go_by_the_submodule():
    ways = [job(1), job(2, slot=2), job(3, axis=0), job(4, axis=0, slot=2)]
    assert of_2900(*ways) == [
        ("slot 1.1 DO 2", 1), ("slot 1.1 axis 0", 1), ("slot 2.1 DO 2", 1), ("slot 2.1 axis 0", 1),
    ]  # fmt: skip


def test_what_a_device_has_once_is_one_row_whichever_drive_object_is_asked():
    found = rows(job(1, pnu=964), job(2, axis=3, pnu=964), job(3, index=LOCAL, pnu=964))
    assert found == [("", 964, 0, 3)]


@pytest.mark.parametrize("path", sorted(STACKS.glob("*.pcapng")), ids=lambda path: path.stem)
def test_real_stacks(path: Path):
    """Identity and `same` agree, labels are never equal, what was refused with 0x19 is no drive object."""
    result = analyze(path)
    targets, shown = Targets(result.transactions), DriveObjects.of(result.transactions)
    labels = targets.labels(result.transactions)
    assert len({(key.device, label) for key, label in labels.items()}) == len(labels)
    first = {}
    for each in result.transactions:
        first.setdefault((access_of(each), each.axis), each)
    for one in first.values():
        for other in first.values():
            for pnu in (964, 2900):
                alike = targets.identity(one, pnu) == targets.identity(other, pnu)
                assert alike == shown.same(access_of(one), access_of(other), pnu)
    missing = {
        (each.device, each.axis)
        for each in result.transactions
        if each.index != LOCAL and any(p.error and p.error.code == 0x19 for p in each.parameters)
    }
    for drive in drives(result, targets):
        assert not any((drive.device.ip, number) in missing for number in drive.objects)
        for number in drive.objects:
            assert any(each.axis == number and each.index != LOCAL for each in result.transactions)
    text = written(result)
    for _, axis in missing:
        assert not re.search(rf"\bDO {axis}\b", text)


# Drives


def test_a_drive_lists_the_drive_objects_that_answered():
    jobs = [
        job(1), job(2, axis=0), job(3, axis=4, error=0x6B), job(4, axis=5, state="unanswered"),
        job(5, index=LOCAL, axis=8), identified(6, 3, 6), job(**REFUSED),
    ]  # fmt: skip
    (drive,) = drives(capture(*jobs), Targets(jobs))
    assert drive.objects == {2, 4, 6}


def test_of_a_wrong_drive_object_those_that_answer_are_named():
    told = Diagnosis("DS709", "error", {"axis": 9, "device": DRIVE}, DRIVE, 1, [9], [90])
    jobs = [job(1), job(2, axis=0), job(3, index=LOCAL, axis=8), job(**REFUSED)]
    assert "    these respond here: DO 2" in opening(capture(*jobs, diagnoses=[told]))


# Transactions of the page


def test_rows_name_what_they_reach_and_keep_the_axis_byte():
    jobs = [job(1, index=LOCAL, axis=9), job(2), job(3, slot=2, index=LOCAL)]
    data = packed_rows(capture(*jobs), 100, Targets(jobs))
    place, axis = ROW.index("object"), ROW.index("axis")
    assert [(data["objects"][row[place]], row[axis]) for row in data["rows"]] == [
        ("slot 1.1", 9), ("DO 2", 2), ("slot 2.1", 2),
    ]  # fmt: skip


# Lines of the text report


def lines(*jobs):
    return re.findall(rf"(?m)^#.*{re.escape(DRIVE)} (.*?)  ", written(capture(*jobs)))


def test_a_line_calls_drive_object_what_is_one():
    assert lines(job(1), job(2, axis=0), job(**REFUSED)) == ["DO 2", "axis 0", "axis 9"]


def test_a_line_of_local_access_has_its_slot():
    assert lines(job(1, index=LOCAL, axis=9), job(2)) == ["slot 1.1", "DO 2"]
    assert lines(job(1, index=LOCAL, axis=9), identified(2, 1, 3)) == ["slot 1.1 DO 3"] * 2
