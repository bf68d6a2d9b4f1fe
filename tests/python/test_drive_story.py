"""After which command a drive did something: only while it is in force, and where nothing nearer explains it."""

from __future__ import annotations

import pytest

from ds47.cyclic.operation import Now, Operation
from ds47.cyclic.timeline import Recorder
from ds47.model import Timeline
from ds47.report import timelines
from ds47.spec.semantics import Limits, limits

OFF, ON, NO_ENABLE = 0x047E, 0x047F, 0x0477
READY, SWITCHED_ON, RUNS, FAULT, RUNS_WITH_FAULT = 0x0231, 0x0233, 0x0237, 0x0248, 0x023F
LOST_OUT, LOST_IN = "output lost", "input lost"


def told(*steps: tuple[int | str, float], begin: tuple[int, int] = (OFF, READY)) -> list[str]:
    """What is said last of a drive to which these words come, at these seconds; a word with bit 9 is its own."""
    recorder = Recorder(Operation({}, limits()), trusted=True, speed=True)
    say(recorder, begin[0], 1, 0)
    say(recorder, begin[1], 2, 0)
    for number, (what, seconds) in enumerate(steps, 3):
        say(recorder, what, number, round(seconds * 1e9))
    rows = timelines.rows(Timeline(1, recorder.result()))
    return [timelines.words(each).en for each in rows][2:]


def say(recorder: Recorder, what: int | str, frame: int, time_ns: int) -> None:
    if isinstance(what, str):
        recorder.lost(what == LOST_OUT, frame, time_ns)
        return
    data = what.to_bytes(2) + bytes(2)
    (recorder.answered if what & 0x0200 else recorder.sent)(data, frame, time_ns)


RUNNING = (ON, RUNS)


@pytest.mark.parametrize(("gap", "rules"), [(4096, []), (4097, ["DS526"])])
def test_a_deviation_begins_beyond_its_limit(gap: int, rules: list[str]) -> None:
    """A quarter of the full scale of 16,384 is allowed."""
    operation = Operation({}, Limits(**limits().columns() | {"deviation_percent": 25}))
    for frame, actual in enumerate((8192, 8192 - gap, 8192 - gap), 1):
        at = frame * 10**10
        operation.look(Now(frame, at, ON, ON, RUNS & ~0x100, 8192, actual, (at, frame)))
    operation.finish()
    assert [each.rule for each in operation.remarks] == rules


@pytest.mark.parametrize(
    ("steps", "last"),
    [
        ([(OFF, 1), (READY, 3)], "no longer ready, no longer running, 2.00 s after OFF1"),
        ([(OFF, 1), (ON, 1.5), (READY, 3)], "no longer ready, no longer running"),
        (
            [(OFF, 1), (ON, 1.5), (NO_ENABLE, 4), (SWITCHED_ON, 4.001)],
            "no longer running, 1.0 ms after operation no longer enabled",
        ),
        ([(OFF, 1), (RUNS_WITH_FAULT, 2), (FAULT, 3)], None),
        ([(OFF, 1), (FAULT, 3)], None),
        ([(OFF, 1), (LOST_OUT, 2), (READY, 3)], None),
        ([(OFF, 1), (LOST_IN, 2), (READY, 3)], None),
        ([(OFF, 1), (0x0221, 3)], None),
        ([(0x047D, 1), (0x0227, 1.1), (0x0260, 1.2)], "200.0 ms after OFF2"),
        ([(OFF, 1), (0x0227, 1.1), (0x0260, 1.2)], None),
        ([(0x047D, 1), (ON, 2), (0x0000, 90), (READY, 90.1)], None),
        ([(0x0478, 1), (0x0240, 1.1)], "after OFF2"),
        ([(0x047C, 1), (0x0260, 1.1)], "after OFF2"),
    ],
)
def test_what_ends_operation(steps: list[tuple[int | str, float]], last: str | None) -> None:
    found = next(each for each in reversed(told(*steps, begin=RUNNING)) if "running" in each)
    if last is None:
        assert " after " not in found
    else:
        assert found.endswith(last) or last in found


@pytest.mark.parametrize(
    ("steps", "last"),
    [
        ([(ON, 1), (RUNS, 1.5)], "running, 500.0 ms after ON"),
        (
            [(NO_ENABLE, 1), (SWITCHED_ON, 1.1), (ON, 3), (RUNS, 3.001)],
            "running, 1.0 ms after enable operation",
        ),
        ([(ON, 1), (0x0371 | 0x0200, 1.2), (RUNS, 3)], None),
        ([(ON, 1), (OFF, 2), (RUNS, 3)], None),
        ([(ON, 1), (LOST_OUT, 1.2), (ON, 1.4), (RUNS, 3)], None),
        ([(ON, 1), (FAULT, 1.2), (READY, 2), (RUNS, 3)], None),
    ],
)
def test_what_begins_operation(steps: list[tuple[int | str, float]], last: str | None) -> None:
    found = next(each for each in reversed(told(*steps)) if "running" in each)
    assert found.endswith(last) if last else " after " not in found


def test_a_fault_goes_after_its_acknowledgement() -> None:
    steps = [(FAULT, 1), (0x04FE, 2), (0x0240, 2.5)]
    assert told(*steps)[-1].endswith("fault gone, 500.0 ms after acknowledge fault")
    assert " after " not in told(*steps[:2], (0x0240, 9))[-1]  # DS524: it had no effect
    assert " after " not in told((0x04FE, 1), (FAULT, 1.5), (0x0240, 2))[-1]


@pytest.mark.parametrize(
    ("after", "rules"),
    [
        ([(0x047C, 1.004), (0x0260, 1.1), (OFF, 3)], []),
        ([(0x0260, 1.1), (OFF, 3)], ["DS529"]),
        ([(0x0260, 1.1), (0x047C, 2), (OFF, 3)], ["DS529"]),
    ],
)
def test_an_off_whose_command_comes_a_frame_late_is_none_of_the_drive(
    after: list[tuple[int | str, float]], rules: list[str]
) -> None:
    """The capture lost the frame with the command, or has the two in the other order."""
    operation = Operation({}, limits())
    recorder = Recorder(operation, trusted=True, speed=True)
    steps = [(ON, 0), (RUNS, 0), (0x0227, 1), *after]
    for number, (what, seconds) in enumerate(steps, 1):
        say(recorder, what, number, round(seconds * 1e9))
    assert [each.rule for each in operation.remarks] == rules
