"""S7 of two stacks and of public captures: what tshark reads, against the log of the stacks and against ds47.

Run on each tshark of the matrix. What tshark says differently in some version is named here.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from s7_stacks import FOLDER, NAMES, lines, logged, read_jobs, read_transfers, same_bytes

Tshark = Callable[..., str]


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
