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
from ds47.model import CaptureResult, Finding, Transaction

BSENDS = [name for name in NAMES if name.startswith("bsend")]
DROPPED = ("bsend_pure_cpp", 4)
"""The C++ partner closes the connection when a PDU of 30,000 bytes comes."""
INCONSISTENT = {name for name in NAMES if name.split("_")[0] in ("torn", "tornput")}
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


def transactions(finding: Finding) -> list[Transaction]:
    """The jobs whose frames a finding names."""
    frames = set(finding.frames)
    return [
        each
        for each in result_of(finding.capture).transactions
        if each.frames.write_request in frames
    ]


def split_calls(name: str) -> Counter[tuple[str, str, int]]:
    """(operation, first byte, jobs) of each call that its stack split, from the log alone."""
    calls = [
        ("put" if line["call"] == "write" else "get", line["start"], len(jobs))
        for line, jobs in logged(name)
        if len(jobs) > 1 and line["call"] in ("read", "write")
    ]
    what = name.split("_")[0]
    if what in BY_HAND:
        calls.append(("put" if what == "tornput" else "get", 0, 2))
    return Counter(calls)
