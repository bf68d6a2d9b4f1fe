"""What ds47 says of two S7 stacks, against the log of what they were told (captures/s7-stacks).

The same jobs against tshark: test_wireshark_s7.py.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from functools import cache

import pytest
from s7_stacks import FOLDER, NAMES, STORED, lines, logged, our_jobs, same_bytes

from ds47.analysis import analyze
from ds47.model import CaptureResult, Finding

BSENDS = [name for name in NAMES if name.startswith("bsend")]
DROPPED = ("bsend_pure_cpp", 4)
"""The C++ partner closes the connection when a PDU of 30,000 bytes comes."""
INCONSISTENT = {name for name in NAMES if name.split("_")[0] in ("torn", "tornput")}
OPERATION = {"read": "GET", "write": "PUT"}
BY_HAND = {"torn", "newer", "older", "tornput"}
"""Captures whose splits the program made itself: each read or written by two jobs."""


@cache
def result_of(name: str) -> CaptureResult:
    return analyze(FOLDER / f"{name}.pcapng")


def found(name: str, rule: str) -> list[Finding]:
    return [each for each in result_of(name).findings if each.rule == rule]


def test_there_are_as_many_as_the_manifest_has() -> None:
    entries = tomllib.loads((FOLDER / "MANIFEST.toml").read_text("utf-8"))["capture"]
    assert [entry["file"] for entry in entries] == [f"{name}.pcapng" for name in NAMES]
    for entry in entries:
        result = result_of(entry["file"].removesuffix(".pcapng"))
        assert (result.frames, result.complete) == (entry["frames"], True)
    assert len(NAMES) == 39


def test_the_log_is_of_these_captures() -> None:
    assert FOLDER != STORED or {line["capture"] for name in NAMES for line in lines(name)} == set(
        NAMES
    )


@pytest.mark.parametrize("name", NAMES)
def test_every_job_and_no_other(name: str) -> None:
    """Connection, operation, items, error and codes of each job, in the order of the log."""
    wanted = [job for _, jobs in logged(name) for job in jobs]
    told = [(each.stream, each.put, each.items, each.error) for each in our_jobs(result_of(name))]
    assert told == [(each.stream, each.put, each.items, each.error) for each in wanted]
    codes = [each.codes for each in our_jobs(result_of(name)) if each.items]
    assert codes == [each.codes for each in wanted if each.items]


@pytest.mark.parametrize("name", NAMES)
def test_the_bytes_that_the_stacks_gave_back(name: str) -> None:
    jobs = iter(our_jobs(result_of(name)))
    for line, wanted in logged(name):
        values = [value for _ in wanted for value in next(jobs).values]
        data = bytes.fromhex("".join(values))
        if line["call"] == "write":
            assert same_bytes(line["data"], data), line
        elif line["call"] == "read" and "error" not in line:
            assert same_bytes(line["ok"], data), line
        elif line["call"] == "read_many" and line["stack"] == "cpp":
            assert [each for each in line["ok"] if not each.startswith("error")] == values


@pytest.mark.parametrize("name", NAMES)
def test_what_became_of_each_job(name: str) -> None:
    """All items went well, some, none, or the job was refused as a whole."""
    states = [
        each.state
        for each in sorted(result_of(name).transactions, key=lambda each: each.frames.write_request or 0)
        if each.operation in ("get", "put") and each.items
    ]  # fmt: skip
    wanted = [
        "refused" if job.error else became(job.codes, len(job.items))
        for _, jobs in logged(name)
        for job in jobs
        if job.items
    ]
    assert states == wanted


def became(codes: list[int], items: int) -> str:
    well = codes.count(0xFF)
    return "ok" if well == items else "partial" if well else "error"


@pytest.mark.parametrize("name", NAMES)
def test_what_was_agreed(name: str) -> None:
    """Each connection with the PDU size that its client had in the end, and none for those that were refused."""
    agreed = [line["agreed"] or None for line in lines(name) if line["call"] == "connect"]
    sizes = [each.pdu_length for each in result_of(name).connections]
    assert sizes == (agreed if name not in BSENDS else [480])


@pytest.mark.parametrize("name", BSENDS)
def test_every_bsend_sums_up(name: str) -> None:
    """R_ID, data, segments and the end that sends; one job each, however many segments."""
    sent = [each for each in result_of(name).transactions if each.operation == "bsend"]
    for line, transaction in zip(lines(name), sent, strict=True):
        assert transaction.r_id == line["r_id"]
        assert transaction.controller == ("127.0.0.1" if line["end"] == 0 else "127.0.0.2")
        assert len(transaction.segments) == len(line["jobs"])
        (item,) = transaction.items
        assert item.value is not None
        assert same_bytes(line["data"], item.value)
        dropped = (name, line["n"]) == DROPPED
        assert transaction.state == ("unanswered" if dropped else "ok")
        acknowledged = [each for each in transaction.segments if each.response is not None]
        assert len(acknowledged) == (0 if dropped else len(line["jobs"]))


def name_of(area: str, db: int, start: int, size: int) -> str:
    """An area as a finding names it."""
    assert area == "DB"
    return f"DB{db}.DBB{start}..{start + size - 1}"


def split_calls(name: str) -> Counter[tuple[str, str, int]]:
    """(operation, area, jobs) of each call that its stack split, from the log alone."""
    calls = [
        (line["call"], line["area"], line["db"], line["start"], jobs)
        for line, jobs in logged(name)
        if len(jobs) > 1 and line["call"] in ("read", "write")
    ]
    found = Counter(
        (OPERATION[call], name_of(area, db, start, sum(job.items[0][3] for job in jobs)), len(jobs))
        for call, area, db, start, jobs in calls
    )
    what = name.split("_")[0]
    if what in BY_HAND:
        found["PUT" if what == "tornput" else "GET", "DB1.DBB0..599", 2] += 1
    return found


@pytest.mark.parametrize("name", NAMES)
def test_every_split_and_no_other(name: str) -> None:
    """DS904 once for each area that a stack split, with its jobs and how often; nowhere else."""
    told = Counter[tuple[str, str, int]]()
    for each in found(name, "DS904"):
        told[each.args["operation"], each.args["area"], each.args["jobs"]] += each.args["count"]
    assert told == split_calls(name)


def test_how_many_splits_there_are() -> None:
    """By hand: five calls in each of nine captures, one in each of two, and those around a write."""
    assert sum(split_calls(name).total() for name in NAMES) == 9 * 5 + 2 + 6 * 2 + 2


@pytest.mark.parametrize("name", NAMES)
def test_inconsistent_where_it_is_and_nowhere_else(name: str) -> None:
    """One DS905 where another client wrote, or read, across the border of two jobs."""
    told = found(name, "DS905")
    if name not in INCONSISTENT:
        assert told == []
        return
    (finding,) = told
    first, second = (int(finding.args[key].removeprefix("DB1.DBB")) for key in ("first", "second"))
    border = {"torn": 462, "tornput_cpp": 452, "tornput_pure": 445}
    at = next(at for key, at in border.items() if name.startswith(key + "_"))
    assert first < at <= second < at + 20
    assert finding.args["case"] == ("mixed_put" if name.startswith("tornput") else "mixed_split")


def expected_rules(name: str) -> set[str]:
    """All rules of a capture but DS914, from the log."""
    rules = {"DS904"} if split_calls(name) else set()
    rules |= {"DS905"} if name in INCONSISTENT else set()
    for _, jobs in logged(name):
        for job in jobs:
            rules |= {"DS909"} if job.error else set()
            rules |= {"DS908"} if set(job.codes) - {0xFF} and job.items else set()
            rules |= {"DS918"} if not job.error and len(job.codes) < len(job.items) else set()
            whole = job.codes == [0xFF] * len(job.items)
            rules |= {"DS906"} if len(job.items) > 1 and whole else set()
    for line in lines(name):
        refused = line["call"] == "connect" and "error" in line
        rules |= {"DS917"} if refused else set()
        if line["call"] == "bsend":
            rules |= {"DS902"} if max(line["jobs"]) > line["agreed"] - 36 + 2 else set()
            rules |= {"DS911"} if "error" in line else set()
    return rules


@pytest.mark.parametrize("name", NAMES)
def test_every_finding_and_no_other(name: str) -> None:
    told = {each.rule for each in result_of(name).findings} - {"DS914"}
    assert told == expected_rules(name)


@pytest.mark.parametrize("name", NAMES)
def test_jobs_at_once(name: str) -> None:
    """DS914 where more jobs are open than the two ends agreed on: counted from the frames of the jobs."""
    jobs = our_jobs(result_of(name))
    most = [
        max((sum(each.asked <= job.asked <= each.answered for each in there) for job in there), default=0)
        for there in ([job for job in jobs if job.stream == stream] for stream in range(2))
    ]  # fmt: skip
    told = found(name, "DS914")
    assert bool(told) == (max(most) > 1)
    if name == "parallel_pure_cpp":
        assert told or FOLDER != STORED
    for finding in told:
        assert (finding.args["most"], finding.args["agreed"]) == (max(most), 1)


def test_what_is_longer_than_agreed() -> None:
    """The PDUs of 2000 and of 30,000 bytes: with 36 bytes around the data."""
    for name in ("bsend_pure_cpp", "bsend_pure_pure"):
        (finding,) = found(name, "DS902")
        assert (finding.args["count"], finding.args["size"]) == (2, 30_036)


def test_which_item_is_refused() -> None:
    told = [(each.args["area"], each.args["code"]) for each in found("multi_cpp_cpp", "DS908")]
    assert told == [
        ("DB99.DBB0..3", 0x0A), ("DB2.DBB62..69", 0x05), ("DB98.DBB0..1", 0x0A), ("DB97.DBB0..1", 0x0A),
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["refused_pure_cpp", "refused_cpp_pure"])
def test_which_connection_is_refused(name: str) -> None:
    """The second one: it wants slot 5, and is reset after its CR."""
    (finding,) = found(name, "DS917")
    assert (finding.args["rack"], finding.args["slot"]) == (0, 5)
    assert finding.args["case"] == "refused_reset"


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("identity")])
def test_what_a_server_says_of_itself(name: str) -> None:
    """C++ Snap7 calls itself a CPU 315-2 PN/DP; both numbers as tshark 4.0 shows them."""
    said = {each.name: each.value for each in result_of(name).connections[0].evidence}
    if name.endswith("cpp"):
        assert str(said["order_number"]).strip() == "6ES7 315-2EH14-0AB0"
        assert said["consistent"] == 480
