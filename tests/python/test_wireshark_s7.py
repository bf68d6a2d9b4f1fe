"""S7 of two stacks and of public captures: what tshark reads, against the log of the stacks and against ds47.

The plugin has no part in it, so this machine's tshark is enough. What others say differently is named here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from s7_scenes import BOOK
from s7_stacks import (
    FIELDS,
    FOLDER,
    MALFORMED,
    NAMES,
    READ,
    Job,
    agreed,
    lines,
    logged,
    our_jobs,
    read_beside,
    read_jobs,
    read_transfers,
    rows,
    same_bytes,
)  # fmt: skip

from ds47.analysis import analyze
from ds47.lab import captured

Tshark = Callable[..., str]
PUBLIC = {
    "s7comm_varservice_libnodavedemo.pcap": 7, "snap7_s300_everything.pcapng": 4, "step7_s300_rwVarTab.pcapng": 0,
    "wincc_s300_setup-alarm-read-write.pcapng": 74, "icsnpp_s7ident.pcap": 1, "icsnpp_s7comm_plus.pcap": 16,
    "s7-1200-hmi.pcap": 0,
}  # fmt: skip
"""Captures of other projects, with the number of reads and writes in each, as tshark counts the requests."""
SCENES = {each.name: each for each in BOOK.scenarios}
PLAYED = Path("scenes")
TWICE = "s7comm.header.pduref == 3 && s7comm.header.pduref == 4"


def test_there_are_captures() -> None:
    assert len(NAMES) == 39


@pytest.mark.parametrize("name", NAMES)
def test_the_jobs_of_the_log_are_on_the_wire(tshark: Tshark, name: str) -> None:
    """Every job with its items, its answer and its codes, in the order of the log, and no other job."""
    wanted = [job for _, jobs in logged(name) for job in jobs]
    found = read_jobs(tshark, FOLDER / f"{name}.pcapng")
    told = [(job.stream, job.put, job.items, job.codes, job.error) for job in found]
    assert told == [(job.stream, job.put, job.items, job.codes, job.error) for job in wanted]


@pytest.mark.parametrize("name", NAMES)
def test_the_bytes_of_the_log_are_on_the_wire(tshark: Tshark, name: str) -> None:
    """What a call gave back, or was given, is what its jobs carried."""
    found = iter(read_jobs(tshark, FOLDER / f"{name}.pcapng"))
    for line, wanted in logged(name):
        values = [value for _ in wanted for value in next(found).values]
        data = bytes.fromhex("".join(values))
        if line["call"] == "write":
            assert same_bytes(line["data"], data), line
        elif line["call"] == "read" and "error" not in line:
            assert same_bytes(line["ok"], data), line
        elif line["call"] == "read_many" and line["stack"] == "cpp":
            assert [each for each in line["ok"] if not each.startswith("error")] == values


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("bsend")])
def test_the_transfers_of_the_log_are_on_the_wire(tshark: Tshark, name: str) -> None:
    found = read_transfers(tshark, FOLDER / f"{name}.pcapng")
    ports: dict[int, int] = {}
    for line, transfer in zip(lines(name), found, strict=True):
        assert ports.setdefault(line["end"], transfer.port) == transfer.port
        assert (transfer.r_id, transfer.segments) == (line["r_id"], line["jobs"])
        assert (transfer.total, transfer.errors) == (sum(line["jobs"]), [])
        well = "error" not in line
        assert transfer.acknowledged == (len(line["jobs"]) if well else 0)
        if well:
            assert line["received"]["ok"] == {"r_id": line["r_id"], "data": line["data"]}


def fields(job: Job) -> tuple[object, ...]:
    """Everything that both say of a job. Of an answer to a job without items, as python-snap7 sends one, tshark
    shows an item, and ds47 none."""
    told = (job.codes, job.values) if job.items else ([], [])
    return job.asked, job.answered, job.stream, job.put, job.reference, job.items, job.error, told


def field_by_field(tshark: Tshark, path: Path) -> int:
    """Compare every job of a capture; the number of jobs."""
    result = analyze(path)
    ours, theirs = our_jobs(result), read_jobs(tshark, path)
    assert [fields(job) for job in ours] == [fields(job) for job in theirs]
    known = [each for each in result.connections if each.setup is not None]
    assert [(each.setup, each.pdu_length, each.parallel) for each in known] == agreed(tshark, path)
    return len(ours)


@pytest.mark.parametrize("name", NAMES)
def test_field_by_field_of_the_stacks(tshark: Tshark, name: str) -> None:
    jobs = field_by_field(tshark, FOLDER / f"{name}.pcapng")
    assert jobs == sum(len(line["jobs"]) for line, _ in logged(name))


@pytest.mark.parametrize(("name", "jobs"), PUBLIC.items())
def test_field_by_field_of_public_captures(
    tshark: Tshark, shared: Path, name: str, jobs: int
) -> None:
    assert field_by_field(tshark, shared / "captures" / "s7" / name) == jobs


@pytest.mark.parametrize("name", SCENES)
def test_field_by_field_of_the_scenes(tshark: Tshark, tmp_path: Path, name: str) -> None:
    """Two PDUs in one frame (s7-tcp-pieces) the fields of tshark do not tell apart: there the jobs are counted."""
    if PLAYED / name not in READ:
        read_beside(tshark, {PLAYED / each: captured(SCENES[each].play()) for each in SCENES})
    path = tmp_path / f"{name}.pcapng"
    path.write_bytes(captured(SCENES[name].play()))
    READ.setdefault(path, READ[PLAYED / name])
    assert not [row for row in READ[path] if row[MALFORMED]]
    if name == "s7-tcp-pieces":
        (asked,) = {each["s7comm.param.itemcount"] for each in rows(tshark, path, FIELDS, TWICE)}
        assert asked == "1,1"
    else:
        field_by_field(tshark, path)
