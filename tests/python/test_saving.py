"""Which changes are lost at power-off (diagnosis/saving), and when two requests reach one drive object (targets).

Every moment is a frame and a position in it, typed by hand; the sentences are those of DS721 in docs/diagnoses.md.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from ds47.diagnosis import saving
from ds47.diagnosis.saving import Moment, Unsaved
from ds47.diagnosis.targets import LOCAL, Target, reach_of, target_of

TWO, THREE = Target(local=False, first=2), Target(local=False, first=3)
NONE = Target(local=False, first=0)
P1120 = (1120,)
SLOT = Target(local=True, first=2, second=1)


def at(frame: int, position: int = 0) -> Moment:
    return frame, position


def changed(*moments: Moment, to: Target = TWO) -> Unsaved:
    """A device on which these changes succeeded."""
    device = Unsaved()
    for moment in moments:
        device.change(moment, to, P1120, seen=True)
    return device


def numbers(device: Unsaved) -> tuple[int, int, int, int, int] | None:
    """Count, unknown, targets, first and last frame."""
    told = device.told()
    return told and tuple(told[name] for name in ("count", "unknown", "targets", "first", "last"))


# Drive objects


def test_under_0xb02e_the_slot_decides_elsewhere_the_axis_byte() -> None:
    assert target_of(2, 1, LOCAL, 7) == target_of(2, 1, LOCAL, None) == SLOT
    assert target_of(2, 1, 47, 7) == target_of(9, 9, 0xB02F, 7) == Target(local=False, first=7)
    assert target_of(2, 1, 47, None) == NONE


def test_two_requests_of_one_axis_or_slot_go_to_one_drive_object_those_of_axis_0_need_not() -> None:
    assert [each.is_known() for each in (TWO, Target(local=False, first=1), SLOT, NONE)] == [
        True, True, True, False,
    ]  # fmt: skip
    assert Target(local=True, first=0).is_known()  # the slot decides, whatever its number


def test_two_targets_may_be_one_drive_object_unless_their_axes_differ() -> None:
    assert TWO.may_be(TWO)
    assert TWO.may_be(NONE)
    assert NONE.may_be(TWO)
    assert TWO.may_be(SLOT)
    assert SLOT.may_be(TWO)
    assert not TWO.may_be(THREE)
    assert not TWO.may_be(Target(local=False, first=1))
    assert SLOT.may_be(Target(local=True, first=3, second=1)), "two submodules may belong to one"


def test_the_way_to_a_drive_object_has_an_axis_except_under_0xb02e() -> None:
    def reach(index: int, axis: int | None) -> tuple[int, int, int]:
        return reach_of(("", "", bytes(16), 0, 2, 1, index), axis)

    assert reach(47, 7) == (2, 1, 7)
    assert reach(LOCAL, 7) == reach(LOCAL, 8) != reach(47, 7)
    assert reach(47, None) not in (reach(47, 0), reach(47, 255))


# What a save takes


def test_a_change_behind_the_save_in_one_request_is_not_saved() -> None:
    """Both have the moment of their request."""
    device = changed(at(5, 1))
    device.save(at(5, 1), None, seen=True)
    assert numbers(device) == (1, 0, 1, 5, 5)
    device.save(at(5, 2), None, seen=True)
    assert numbers(device) is None


def test_a_change_heard_of_after_its_save_is_saved_if_it_was_asked_before() -> None:
    device = Unsaved()
    device.save(at(8), TWO, seen=True)
    for moment in (at(7), at(8), at(9)):
        device.change(moment, TWO, P1120, seen=True)
    device.change(at(3), THREE, P1120, seen=True)
    assert numbers(device) == (3, 0, 2, 3, 9)


def test_a_save_of_no_known_drive_object_saves_none_for_certain() -> None:
    device = Unsaved()
    device.save(at(8), NONE, seen=True)
    device.change(at(7), NONE, P1120, seen=True)
    device.change(at(9), TWO, P1120, seen=True)
    assert numbers(device) == (1, 1, 1, 9, 9)


def test_a_save_that_may_have_failed_leaves_open_what_was_asked_before_it_and_nothing_else() -> (
    None
):
    device = changed(at(3), at(5), at(7))
    device.save(at(5), TWO, seen=False)
    device.change(at(4), TWO, P1120, seen=True)
    device.change(at(5), TWO, P1120, seen=True)
    device.change(at(4), THREE, P1120, seen=True)
    assert numbers(device) == (4, 2, 2, 4, 7)


def test_a_later_save_settles_what_was_open_on_its_drive_object_alone() -> None:
    device = changed(at(1))
    device.change(at(2), TWO, P1120, seen=False)
    device.change(at(3), THREE, P1120, seen=False)
    device.save(at(4), TWO, seen=True)
    device.change(at(5), TWO, P1120, seen=True)
    assert numbers(device) == (1, 1, 1, 5, 5)
    device.save(at(4), None, seen=True)
    assert numbers(device) == (1, 0, 1, 5, 5)


# Many changes: of those older than the newest 16 the number and the span


def many(count: int) -> Unsaved:
    return changed(*(at(frame) for frame in range(1, count + 1)))


def test_a_save_among_the_newest_changes_takes_each_before_it() -> None:
    device = many(16)
    device.save(at(3), None, seen=True)
    assert numbers(device) == (14, 0, 1, 3, 16)
    device = many(17)
    device.save(at(3), None, seen=True)
    assert numbers(device) == (15, 0, 1, 3, 17)


def test_which_of_the_older_changes_a_save_reached_is_not_known() -> None:
    """20 changes, of which 4 are told by their span: frames 1 to 4."""
    device = many(20)
    assert numbers(device) == (20, 0, 1, 1, 20)
    device.save(at(3), None, seen=True)
    assert numbers(device) == (16, 4, 1, 5, 20)
    device.save(at(5), None, seen=True)
    assert numbers(device) == (16, 0, 1, 5, 20)


def test_a_save_before_all_of_the_older_changes_reached_none_of_them() -> None:
    device = many(20)
    device.save(at(1), None, seen=True)
    assert numbers(device) == (20, 0, 1, 1, 20)


def test_the_older_changes_are_counted_on_after_they_were_saved() -> None:
    device = many(20)
    device.save(at(21), None, seen=True)
    assert numbers(device) is None
    for frame in range(31, 51):
        device.change(at(frame), TWO, P1120, seen=True)
    assert numbers(device) == (20, 0, 1, 31, 50)


def test_older_changes_stay_among_those_whose_save_is_not_known() -> None:
    device = many(20)
    device.save(at(21), None, seen=False)
    device.change(at(30), THREE, P1120, seen=True)
    assert numbers(device) == (1, 20, 1, 30, 30)
    device.save(at(22), TWO, seen=True)
    assert numbers(device) == (1, 0, 1, 30, 30)


def test_the_span_of_older_changes_is_in_frames_whatever_the_order_in_which_they_are_heard() -> (
    None
):
    device = changed(at(50), at(10), *(at(frame) for frame in range(60, 76)))
    assert numbers(device) == (18, 0, 1, 10, 75)
    device.save(at(20), None, seen=True)
    assert numbers(device) == (16, 2, 1, 60, 75)


def test_the_last_change_may_be_an_older_one() -> None:
    assert numbers(changed(at(99), *(at(frame) for frame in range(1, 17)))) == (17, 0, 1, 1, 99)


# What is named


def named(device: Unsaved) -> tuple[list[int], int | None]:
    """The parameters, and the axis."""
    told = device.told()
    assert told is not None
    return told["pnus"], told["axis"]


def test_what_is_not_saved_is_named_and_the_axis_where_there_is_one() -> None:
    device = Unsaved()
    device.change(at(1), TWO, (1121, 1120), seen=True)
    device.change(at(2), TWO, (1120,), seen=True)
    device.change(at(3), TWO, (2900,), seen=False)
    assert named(device) == ([1120, 1121], 2)
    device.save(at(2), TWO, seen=True)
    device.change(at(4), SLOT, (1070,), seen=True)
    assert named(device) == ([1070, 1120], None), "an axis and a slot"
    assert named(changed(at(1), to=SLOT)) == ([1120], None)
    assert named(changed(at(1), to=NONE)) == ([1120], None)


def test_those_of_older_changes_are_named_too_and_forgotten_with_them() -> None:
    device = Unsaved()
    for frame in range(1, 25):
        device.change(at(frame), TWO, (2900 - frame,), seen=True)
    assert named(device) == ([*range(2876, 2892)], 2), "of 24 the 16 with the lowest numbers"
    device.save(at(24), None, seen=True)
    assert named(device) == ([2876], 2)


def test_what_a_save_may_have_reached_is_not_named() -> None:
    device = Unsaved()
    for frame in range(1, 25):
        device.change(at(frame), TWO, (1000 + frame,), seen=True)
    device.save(at(24), TWO, seen=False)
    assert named(device) == ([1024], 2)


# The memory is bounded


@pytest.fixture
def _two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saving, "known", lambda: SimpleNamespace(history=2))


def axis(number: int) -> Target:
    return Target(local=False, first=number)


@pytest.mark.usefixtures("_two")
def test_the_oldest_save_is_forgotten_first() -> None:
    device = Unsaved()
    for number in (1, 2, 3):
        device.save(at(10), axis(number), seen=True)
    for number in (1, 2, 3):
        device.change(at(5), axis(number), P1120, seen=True)
    assert numbers(device) == (1, 0, 1, 5, 5)  # that of axis 1


@pytest.mark.usefixtures("_two")
def test_of_changes_to_too_many_drive_objects_it_is_not_known_whether_they_are_saved() -> None:
    device = Unsaved()
    for number in (1, 2, 3, 1):
        device.change(at(number), axis(number), P1120, seen=True)
    assert numbers(device) == (3, 1, 2, 1, 2)
