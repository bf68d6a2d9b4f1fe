"""Which drive object a request reaches, and what a capture has to show before two are the same or are not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from talk import job

from ds47.acyclic.transactions import build
from ds47.lab import message
from ds47.model import Transaction
from ds47.profidrive.drive_objects import LOCAL, DriveAccess, DriveObjects, access
from ds47.spec.semantics import known

AXIS_ERROR = 0x19
RAMP, GLOBAL = 1120, 61000
TWO, THREE = access("d", 47, 1, 1, 2), access("d", 0xB02F, 2, 1, 3)
SUB_1, SUB_2 = access("d", LOCAL, 1, 1, 9), access("d", LOCAL, 2, 1, 9)
IDENTIFICATION = message.address(975, 7)


@pytest.fixture
def objects() -> DriveObjects:
    return DriveObjects()


def looking(objects: DriveObjects, device: str = "d") -> None:
    """The device refuses an axis number."""
    objects.refused(access(device, 47, 1, 1, 77), AXIS_ERROR)


def names(objects: DriveObjects, one: DriveAccess, number: int) -> None:
    """A submodule says its DO-ID."""
    objects.identified(one, 7, [number])


def pair(
    objects: DriveObjects, one: DriveAccess, other: DriveAccess, pnu: int = RAMP
) -> tuple[bool, bool]:
    """Whether they are surely the same, and surely another; the order does not matter."""
    found = objects.same(one, other, pnu), objects.other(one, other, pnu)
    assert found == (objects.same(other, one, pnu), objects.other(other, one, pnu))
    identical = objects.identity(one, pnu) == objects.identity(other, pnu)
    assert identical == found[0]
    return found


SAME, OTHER, UNKNOWN = (True, False), (False, True), (False, False)


def test_of_the_axis_byte_nothing_is_known_until_the_device_refuses_one(
    objects: DriveObjects,
) -> None:
    elsewhere = TWO._replace(slot=5)
    assert pair(objects, TWO, TWO) == SAME
    assert pair(objects, TWO, THREE) == UNKNOWN
    assert pair(objects, TWO, elsewhere) == UNKNOWN
    looking(objects)
    assert pair(objects, TWO, THREE) == OTHER
    assert pair(objects, TWO, elsewhere) == SAME


def test_axis_0_names_no_drive_object(objects: DriveObjects) -> None:
    looking(objects)
    zero = TWO._replace(axis=0)
    assert objects.number(zero) is None
    assert pair(objects, TWO, zero) == UNKNOWN
    assert pair(objects, zero, zero._replace(slot=5)) == UNKNOWN
    assert pair(objects, zero, zero) == SAME


def test_a_submodule_is_known_once_it_names_itself(objects: DriveObjects) -> None:
    assert pair(objects, SUB_1, SUB_2) == UNKNOWN
    assert pair(objects, SUB_1, SUB_1) == SAME
    names(objects, SUB_1, 2)
    assert pair(objects, SUB_1, SUB_2) == UNKNOWN
    names(objects, SUB_2, 3)
    assert pair(objects, SUB_1, SUB_2) == OTHER
    assert pair(objects, TWO, SUB_1) == UNKNOWN  # perhaps the device goes by the submodule alone
    looking(objects)
    assert pair(objects, TWO, SUB_1) == SAME
    assert pair(objects, TWO, SUB_2) == OTHER


def test_two_submodules_of_one_drive_object_are_the_same(objects: DriveObjects) -> None:
    names(objects, SUB_1, 3)
    names(objects, SUB_2, 3)
    assert pair(objects, SUB_1, SUB_2) == SAME


def test_local_access_and_another_one_are_two_ways(objects: DriveObjects) -> None:
    here = access("d", 47, 1, 1, None)
    assert pair(objects, here, SUB_1) == UNKNOWN
    assert pair(objects, here, here) == SAME


def test_a_submodule_with_two_names_has_none(objects: DriveObjects) -> None:
    for number in (3, 3):
        names(objects, SUB_1, number)
    assert objects.number(SUB_1) == 3
    for number in (4, 4):
        names(objects, SUB_1, number)
        assert objects.number(SUB_1) is None


def test_only_element_7_through_local_access_names_a_submodule(objects: DriveObjects) -> None:
    objects.identified(SUB_1, 6, [3])
    objects.identified(SUB_1, 8, [3])
    objects.identified(SUB_1, 7, ["3"])
    objects.identified(SUB_1, 0, [0, 1, 2])
    assert objects.number(SUB_1) is None
    objects.identified(access("d", 0xB02F, 1, 1, 1), 7, [3])
    assert objects.number(SUB_1) is None
    objects.identified(SUB_1, 6, [0, 3, 0])
    assert objects.number(SUB_1) == 3


def test_another_device_is_another_drive_object(objects: DriveObjects) -> None:
    assert pair(objects, TWO, TWO._replace(device="e")) == OTHER
    assert pair(objects, TWO, TWO._replace(device="e"), GLOBAL) == OTHER


def test_a_parameter_of_the_whole_device_is_one(objects: DriveObjects) -> None:
    looking(objects)
    assert pair(objects, TWO, THREE, GLOBAL) == SAME
    assert objects.identity(TWO) != objects.identity(THREE)


def test_an_identity_says_whether_the_submodule_counts(objects: DriveObjects) -> None:
    assert objects.identity(TWO).by_submodule
    looking(objects)
    assert not objects.identity(TWO).by_submodule
    assert not objects.identity(SUB_1, GLOBAL).by_submodule


def test_a_refused_axis_does_not_exist(objects: DriveObjects) -> None:
    objects.refused(TWO, 0x11)
    objects.refused(SUB_1, AXIS_ERROR)
    assert objects.exists("d", 2)
    assert not objects.looks_at_axis("d")
    objects.refused(access("d", 47, 1, 1, None), AXIS_ERROR)
    assert objects.looks_at_axis("d")
    objects.refused(TWO, AXIS_ERROR)
    assert not objects.exists("d", 2)
    assert objects.exists("d", 3)
    assert objects.exists("e", 2)


def test_the_memory_is_bounded(objects: DriveObjects) -> None:
    for number in range(known().history):
        looking(objects, f"d{number}")
    assert objects.looks_at_axis("d0")
    looking(objects, "d0")
    looking(objects, "one more")
    assert objects.looks_at_axis("d0")  # refused again later
    assert not objects.looks_at_axis("d1")
    assert [objects.exists(device, 77) for device in ("d0", "d1", "d2")] == [False, True, False]


# Of whole transactions


def read(*answer: bytes, **more: Any) -> Transaction:
    """PNU 975[7], and perhaps others, read through a submodule."""
    where = more.pop("where", (IDENTIFICATION,))
    at = more.pop("at", (1, 1, LOCAL))
    head = (more.pop("reference", 1), more.pop("id", 1), 1)
    return build(job(message.read(1, 1, *where), message.answer(*head, *answer), at=at, **more))


def test_a_transaction_shows_what_its_parameters_say() -> None:
    refused = read(message.error(AXIS_ERROR), id=0x81, at=(1, 1, 47))
    objects = DriveObjects.of([read(message.word(3)), refused])
    assert objects.number(SUB_1) == 3
    assert not objects.exists("d", 1)


def test_a_refused_change_shows_that_the_device_looks_at_the_axis() -> None:
    asked = message.change(1, 1, (message.address(RAMP), message.word(1)))
    refused = message.answer(1, 0x82, 1, message.error(AXIS_ERROR))
    objects = DriveObjects.of([build(job(asked, refused))])
    assert objects.looks_at_axis("d")
    assert not objects.exists("d", 1)


@pytest.mark.parametrize(
    "shown",
    [
        read(message.word(3), reference=2),
        read(message.word(3), where=(message.address(RAMP, 7),)),
        read(message.word(3), where=(message.address(975, 7, attribute=message.TEXT),)),
        read(message.error(0x11), id=0x81),
        build(
            job(
                message.change(1, 1, (IDENTIFICATION, message.word(3))),
                message.changed(1, 1),
                at=(1, 1, LOCAL),
            )
        ),
        replace(read(message.word(3)), operation="vendor"),
    ],
    ids=["mismatch", "other PNU", "text", "error", "change", "vendor"],
)
def test_nothing_else_names_a_submodule(shown: Transaction) -> None:
    assert DriveObjects.of([shown]).number(SUB_1) is None


@pytest.mark.parametrize(
    "changes", [{"state": "mismatch"}, {"operation": "vendor"}, {"operation": "unknown"}]
)
def test_what_answers_another_request_refuses_no_axis(changes: dict[str, Any]) -> None:
    refused = read(message.error(AXIS_ERROR), id=0x81, at=(1, 1, 47))
    objects = DriveObjects.of([replace(refused, **changes)])
    assert not objects.looks_at_axis("d")
    assert objects.exists("d", 1)
