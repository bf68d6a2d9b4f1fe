"""Every row of `ds47 trail` and of `ds47 report -f parameters`, against the transactions of the JSON report.

A second, naive reading: it shares no code with what it checks, and knows nothing but the rows and the JSON.
"""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ds47.cli import main

Json = dict[str, Any]
CAPTURES = sorted(
    path
    for folder in ("captures", "captures/real-stacks")
    for path in (Path(__file__).parents[2] / folder).glob("*.pcapng")
)
STRINGS = {"VisibleString": 1, "OctetString": 2, "BitString": 2, "OctetString_S": 2}


def told(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    capsys.readouterr()
    main([str(each) for each in words])
    return capsys.readouterr().out


def elements(item: Json) -> Iterator[tuple[Json, int, Any]]:
    """Parameter, subindex and value of all that a transaction asked for."""
    for each in item["parameters"]:
        if each["pnu"] is None or each["attribute"] != "value":
            continue
        values = each["values"]
        width = STRINGS.get(each["format"])
        if width:
            text = "".join(values)
            values = [text[at : at + width] for at in range(0, len(text), width)]
        count = max(1, each["element_count"] or 0, len(values) if width else 0)
        for step in range(count):
            yield each, (each["subindex"] or 0) + step, values[step] if step < len(values) else None


def frames(item: Json) -> list[int]:
    own = item["frames"]
    several = [
        number for each in (*own["polls"], *own["rereads"]) for number in each.values() if number
    ]
    return [number for number in (*own.values(), *several) if isinstance(number, int)]


def way(item: Json) -> tuple[Any, ...]:
    axis = None if item["index"] in (None, 0xB02E) else item["axis"]
    return item["device"], item["index"], item["slot"], item["subslot"], axis


def brought(report: list[Json], device: str, frame: int, pnu: int, subindex: int) -> list[Any]:
    """The values that the response in a frame brought or accepted."""
    return [
        value
        for item in report
        if item["device"] == device
        and frame in frames(item)
        and item["operation"] in ("read", "change")
        for each, at, value in elements(item)
        if (each["pnu"], at) == (pnu, subindex) and each["error"] is None
    ]


def may_have_written(item: Json, pnu: int, subindex: int) -> bool:
    return (
        item["operation"] == "change"
        and item["status"]["write"] in (None, "00000000")
        and any(
            (each["pnu"], at) == (pnu, subindex) and each["error"] is None
            for each, at, _ in elements(item)
        )
    )


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_every_change(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads(told(capsys, "report", "-f", "json", path))["captures"][0]["transactions"]
    rows = json.loads(told(capsys, "trail", "-f", "json", path))["captures"][0]["changes"]
    by_id = {item["id"]: item for item in report}
    sure = [
        item
        for item in report
        if item["operation"] == "change" and item["state"] not in ("orphan", "mismatch")
    ]
    asked = Counter(
        (item["id"], each["pnu"], at) for item in sure for each, at, _ in elements(item)
    )
    assert not sure or rows
    shown = Counter((row["transaction"], row["pnu"], row["subindex"]) for row in rows)
    foreign = {item["id"] for item in report if item["state"] == "mismatch"}
    assert {key: n for key, n in shown.items() if key[0] not in foreign} == asked
    assert [row["frame"] for row in rows] == sorted(row["frame"] for row in rows)
    for row in rows:
        item = by_id[row["transaction"]]
        assert (row["controller"], row["device"], row["time"]) == (
            item["controller"],
            item["device"],
            item["start"],
        )
        assert row["frame"] == item["frames"]["write_request"]
        if item["state"] == "mismatch":
            assert row["outcome"] == "sent"
            continue
        mine = [
            (each, value)
            for each, at, value in elements(item)
            if (each["pnu"], at) == (row["pnu"], row["subindex"])
        ]
        assert row["new"] in [value for _, value in mine]
        assert row["outcome"] in [outcome(item, each) for each, _ in mine]
        if row["old_known"] is not None:
            check_old(report, row, item)


def outcome(item: Json, each: Json) -> str:
    if each["error"] is not None:
        return "negative"
    if item["status"]["write"] not in (None, "00000000"):
        return "refused"
    if item["state"] == "ok":
        return "accepted"
    if item["state"] != "partial" or {"DS106", "DS309", "DS313", "DS315"} & set(item["findings"]):
        return "sent"
    position = item["parameters"].index(each)
    return "accepted" if position < bytes.fromhex(item["bytes"]["response"])[3] else "sent"


def check_old(report: list[Json], row: Json, item: Json) -> None:
    """The old value was in the frame, and nothing went the same way between that could have changed it."""
    assert row["old_frame"] < row["frame"]
    values = brought(report, row["device"], row["old_frame"], row["pnu"], row["subindex"])
    assert row["old"] in values
    for other in report:
        if way(other) == way(item) and may_have_written(other, row["pnu"], row["subindex"]):
            own = other["frames"]
            done = own["read_response"] if other["state"] != "mismatch" else None
            began, ended = own["write_request"], done or max(frames(other))
            assert began >= row["frame"] or ended <= row["old_frame"], (row, other["id"])


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_every_last_value(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads(told(capsys, "report", "-f", "json", path))["captures"][0]["transactions"]
    rows = list(csv.DictReader(io.StringIO(told(capsys, "report", "-f", "parameters", path))))
    reads, negative = Counter[Any](), Counter[Any]()
    for item in report:
        if item["operation"] == "read" and item["state"] in ("ok", "partial", "error"):
            for each, at, _ in elements(item):
                reads[item["device"], each["pnu"], at] += 1
                negative[item["device"], each["pnu"], at] += each["error"] is not None
    shown, refused = Counter[Any](), Counter[Any]()
    for row in rows:
        key = row["device"], int(row["pnu"]), int(row["subindex"])
        shown[key] += int(row["reads"])
        refused[key] += int(row["negative"])
        if row["known"]:
            values = [
                str(each) for each in brought(report, row["device"], int(row["frame"]), *key[1:])
            ]
            assert row["value"] in values or "'" + row["value"][1:] in [
                "'" + each for each in values
            ], row
    assert +shown == reads
    assert all(refused[key] >= count for key, count in negative.items())


@pytest.mark.slow
def test_narrowed_to_a_drive_object(capsys: pytest.CaptureFixture[str]) -> None:
    path = next(each for each in CAPTURES if each.stem.startswith("o3"))
    everything = json.loads(told(capsys, "trail", "-f", "json", path))["captures"][0]["changes"]
    for option, key in (("--do", "drive_object"), ("--pnu", "pnu"), ("--controller", "controller")):
        for wanted in {row[key] for row in everything} - {None}:
            narrow = told(capsys, "trail", "-f", "json", option, wanted, path)
            found = json.loads(narrow)["captures"][0]["changes"]
            assert found == [row for row in everything if row[key] == wanted]


@pytest.mark.slow
def test_there_are_old_values_of_both_kinds_and_all_outcomes(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = [
        row
        for path in CAPTURES
        for capture in json.loads(told(capsys, "trail", "-f", "json", path))["captures"]
        for row in capture["changes"]
    ]
    assert {row["old_known"] for row in rows} == {None, "read", "written"}
    assert {row["outcome"] for row in rows} == {"accepted", "negative", "refused", "sent"}
