"""When the trail of a parameter knows the value before a change: requests that overlap, in every order."""

from __future__ import annotations

import csv
import io
import json
import re
from copy import copy
from pathlib import Path

import pytest

from ds47.analysis import analyze
from ds47.cli import main
from ds47.model import CaptureResult, Frames, Parameter, Transaction
from ds47.report.trail import trail

STORED = Path(__file__).parents[2] / "captures/tour-machine.pcapng"


def transaction(
    number: int, operation: str, value: int, asked: int, answered: int | None
) -> Transaction:
    """A transaction of p50303[0] in DO 2; `answered` None: its response was not fetched."""

    made = copy(analyze(STORED).transactions[0])
    made.id, made.operation, made.state = number, operation, "ok" if answered else "unanswered"
    made.index, made.slot, made.subslot, made.axis, made.channel = 47, 1, 1, 2, "ds47"
    made.write_status, made.findings, made.ar = 0, [], "one"
    response = answered
    made.frames = Frames(
        asked, asked + 1, None if response is None else response - 1, response, [], []
    )
    made.parameters = [
        Parameter(50303, 0, "value", 0, format="Integer32", value_count=1, values=[value])
    ]
    return made


def old(*before: tuple[str, int, int, int | None]) -> tuple[object, int] | None:
    """The value that is known before a change in frame 90."""
    start = transaction(1, "read", 0, 1, 4)  # the first one of the AR: behind its Connect
    items = [transaction(number, *each) for number, each in enumerate(before, 2)]
    last = transaction(99, "change", 9, 90, 94)
    found = trail(CaptureResult(path="x", transactions=[start, *items, last]))
    known = found.changes[-1].old
    return None if known is None else (known.value, known.frame)


@pytest.mark.parametrize(
    ("before", "known"),
    [
        ([("read", 5, 10, 14)], (5, 14)),
        ([("read", 5, 10, 14), ("change", 6, 20, 24)], (6, 24)),
        ([("read", 5, 10, 30), ("change", 6, 20, 24)], None),
        ([("change", 6, 20, 30), ("read", 5, 22, 26)], (6, 30)),
        ([("change", 6, 20, 30), ("change", 7, 22, 26)], None),
        ([("change", 6, 20, 95)], None),
        ([("read", 5, 10, 14), ("change", 6, 20, None)], None),
        ([("change", 6, 20, None), ("read", 5, 30, 34)], (5, 34)),
    ],
)  # fmt: skip
def test_overlaps(before: list[tuple[str, int, int, int | None]], known: object) -> None:
    assert old(*before) == known


def test_writes_whose_drive_object_is_not_proved_are_counted(captures, capsys):
    """Who asks for one drive object shall not take the list for all there is."""
    path = str(captures / "real-stacks" / "o3_two_controllers.pcapng")
    assert main(["trail", path, "--do", "3", "-f", "json"]) == 0
    some = capsys.readouterr()
    assert main(["trail", path, "-f", "json"]) == 0
    everything = capsys.readouterr()
    (all_,) = json.loads(everything.out)["captures"]
    unproved = [each for each in all_["changes"] if each["drive_object"] is None]
    assert unproved
    assert f"{len(unproved)} further changes went to drive objects" in some.err
    assert everything.err == ""


def test_what_the_first_transaction_of_a_connection_reads_is_known(captures, capsys):
    """The drive may have been off before the Connect, not behind the first request."""
    assert (
        main(["trail", str(captures / "tour-machine.pcapng"), "--pnu", "50303", "-f", "json"]) == 0
    )
    (told,) = json.loads(capsys.readouterr().out)["captures"]
    assert [(each["frame"], each["old"], each["old_frame"]) for each in told["changes"]] == [
        (22, 10.0, 5), (34, 10.0, 33),
    ]  # fmt: skip


def test_csv_has_a_row_of_what_json_says_of_a_change(capsys):
    assert main(["trail", str(STORED), "-f", "csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert main(["trail", str(STORED), "-f", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["captures"]
    assert len(rows) == len(told["changes"]) == 4
    for row, change in zip(rows, told["changes"], strict=True):
        del row["path"]
        for name, text in row.items():
            value = change[name]
            assert text == ("" if value is None else str(value)), name


@pytest.mark.parametrize(
    ("options", "parameters"),
    [
        ([], ["p50304[0]", "p50303[0]", "p50076[1]", "p50303[0]"]),
        (["--from", "08:00:00.7"], ["p50303[0]", "p50076[1]", "p50303[0]"]),
        (["--to", "0.5"], ["p50304[0]"]),
        (["--state", "ok", "--state", "error"], ["p50304[0]", "p50076[1]"]),
        (["--rule", "DS719"], ["p50076[1]"]),
        (["--device", "PRESS-1-DRIVE", "--pnu", "p50303[0]"], ["p50303[0]", "p50303[0]"]),
        (["-t", "5-6"], ["p50303[0]", "p50076[1]"]),
    ],
)
def test_it_is_narrowed_as_a_report_is(
    captures: Path, capsys: pytest.CaptureFixture[str], options: list[str], parameters: list[str]
) -> None:
    assert main(["trail", str(captures / "tour-machine.pcapng"), "--tz", "UTC", *options]) == 0
    out, err = capsys.readouterr()
    assert re.findall(r"\b[pr]\d+\[\d+\]", out) == parameters
    assert err == ""


def test_where_no_change_matches_it_says_what_there_is(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["trail", str(captures / "tour-machine.pcapng"), "--device", "nobody"]) == 1
    assert capsys.readouterr().err == (
        "ds47: error: no write matches --device nobody; there is 192.168.133.33 (press-1-drive)\n"
    )


def test_what_is_wrong_with_a_capture_is_said_once(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut = tmp_path / "cut.pcapng"
    cut.write_bytes((captures / "tour-machine.pcapng").read_bytes()[:3000])
    assert main(["trail", str(cut)]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"ds47: error: {cut}: damaged at byte")
