"""The captures of two S7 stacks: what their log says was asked, what tshark reads and what ds47 says, alike.

The log has no decoder in it (tools/oracles/record.py), tshark is another's, and nothing here decodes for ds47.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from beside import beside, fits

from ds47.model import CaptureResult, Item

STORED = Path(__file__).resolve().parents[2] / "captures" / "s7-stacks"
FOLDER = Path(os.environ.get("DS47_S7_STACKS", STORED)).resolve()
"""`make oracles` names the folder with what it recorded just now."""
NAMES = sorted(path.stem for path in FOLDER.glob("*.pcapng"))
AREAS = {"I": 0x81, "Q": 0x82, "M": 0x83, "DB": 0x84, "C": 0x1C, "T": 0x1D}
BITS = {1: 1, 2: 8, 3: 8, 4: 16, 5: 16, 6: 32, 7: 32, 8: 32, 0x1C: 16, 0x1D: 16}
"""Bits of an element by transport size."""
JOB, ACK, ANSWER, USERDATA = "1", "2", "3", "7"
GET, PUT, SETUP = 4, 5, 0xF0
RESPONSE = ("8", "2")
"""The type of user data: tshark 4.0 shows the four bits above the group, 4.4 and later the first two of them."""
FIELDS = (
    "frame.number", "tcp.stream", "tcp.srcport", "s7comm.header.rosctr", "s7comm.header.pduref",
    "s7comm.header.errcls", "s7comm.header.errcod", "s7comm.param.func", "s7comm.param.itemcount",
    "s7comm.param.item.area", "s7comm.param.item.db", "s7comm.param.item.address",
    "s7comm.param.item.transp_size", "s7comm.param.item.length", "s7comm.data.returncode",
    "s7comm.data.length", "s7comm.resp.data", "s7comm.param.item.syntaxid",
    "s7comm.param.pdu_length", "s7comm.param.maxamq_calling",
)  # fmt: skip
SEGMENT_FIELDS = (
    "frame.number", "tcp.srcport", "s7comm.header.pduref", "s7comm.header.datlg",
    "s7comm.param.userdata.type", "s7comm.param.userdata.funcgroup", "s7comm.param.userdata.seq_num",
    "s7comm.param.userdata.dataunitref", "s7comm.param.userdata.lastdataunit", "s7comm.param.errcod",
    "s7comm.pbc.req.bsend.r_id", "s7comm.pbc.req.bsend.len", "s7comm.data.returncode", "s7comm.data.length",
)  # fmt: skip
CODES = {"00c00000": 0x0A, "00900000": 0x05, "(0x0a)": 0x0A, "(0x05)": 0x05}
"""How the two stacks say that an item was refused: C++ Snap7 by its number, python-snap7 by the code itself."""


@dataclass(slots=True)
class Job:
    """A read or write: `items` are (area, block, first bit or element, bytes)."""

    put: bool
    items: list[tuple[int, int, int, int]]
    stream: int = 0
    """Number of the TCP connection, from 0, among those that have a job."""
    asked: int = 0
    """Frame of the request; 0 in the log, which knows none,"""
    answered: int = 0
    """and of the answer."""
    reference: int = 0
    error: int = 0
    """Class and code of a job that was refused as a whole."""
    codes: list[int] = field(default_factory=list)
    values: list[str] = field(default_factory=list)
    """What was read, or was to be written, of each item whose data there is, as hexadecimal digits."""


def log() -> Iterator[dict[str, Any]]:
    """The lines of the log."""
    for text in (FOLDER / "EXPECTED.jsonl").read_text("utf-8").splitlines():
        yield json.loads(text)


@cache
def lines(name: str) -> list[dict[str, Any]]:
    """The calls of one capture."""
    return [line for line in log() if line["capture"] == name]


def logged_items(job: list[Any], word: str = "byte") -> list[tuple[int, int, int, int]]:
    """The items of a job in the log: `start` counts bytes there, bits or elements where it must."""
    return [
        (AREAS[area], db, start if area in "CT" or word == "bit" else start * 8, size)
        for area, db, start, size in job
    ]


def logged(name: str) -> list[tuple[dict[str, Any], list[Job]]]:
    """Each call that reads or writes, with the jobs that it must have taken, in this order."""
    streams: dict[int, int] = {}
    found = []
    for line in lines(name):
        if line["jobs"] and line["call"] != "bsend":
            stream = streams.setdefault(line["end"], len(streams))
            jobs = [
                Job(
                    "write" in line["call"],
                    logged_items(job, line.get("word", "byte")),
                    stream,
                    error=refused(line),
                    codes=codes(line, job),
                )
                for job in line["jobs"]
            ]
            found.append((line, jobs))
    return found


def refused(line: dict[str, Any]) -> int:
    """Class and code, where the server of python-snap7 refuses a write as a whole: 84 04."""
    error = line.get("error", "")
    whole = "02300000" in error or "class=0x84, code=0x04" in error
    return 0x8404 if whole else 0


def codes(line: dict[str, Any], job: list[Any]) -> list[int]:
    """The return codes of a job as the stack told them; where it did not, those that the call was made for."""
    if refused(line):
        return []
    said = line.get("ok")
    if isinstance(said, list) and "many" in line["call"] and line["stack"] == "cpp":
        return [code_of(each) for each in said]
    if "error" not in line:
        return [0xFF] * max(1, len(job))
    if "invalid CPU answer" in line["error"]:
        return [0xFF]  # short_cpp_pure: one code for three items
    if "truncated" in line["error"]:  # python-snap7 does not read an error of C++ Snap7
        return [0x0A] if not job or line["db"] == 99 else [0x05]
    return [code_of(line["error"])]


def code_of(said: Any) -> int:
    """The return code that a text of a stack names; a text without one, and data, are no error."""
    return next((code for text, code in CODES.items() if text in str(said)), 0xFF)


def same_bytes(said: Any, data: bytes) -> bool:
    """Whether bytes are what the log has of them: digits, or length and digest of many."""
    if isinstance(said, dict):
        return (said["bytes"], said["sha256"]) == (len(data), hashlib.sha256(data).hexdigest())
    return bool(said == data.hex())


def rows(
    tshark: Callable[..., str], path: Path, fields: tuple[str, ...], only: str
) -> Iterator[dict[str, str]]:
    """What tshark says of the frames that it shows, field by field; a field that is there twice has a comma."""
    options = [word for each in fields for word in ("-e", each)]
    for line in tshark("-r", path, "-Y", only, "-T", "fields", *options).splitlines():
        yield dict(zip(fields, line.split("\t"), strict=True))


def split(text: str) -> list[str]:
    return text.split(",") if text else []


def numbers(text: str) -> list[int]:
    return [int(each, 0) for each in split(text)]


def read_items(row: dict[str, str]) -> list[tuple[int, int, int, int]]:
    """The items of a request by tshark."""
    names = ("area", "db", "address", "transp_size", "length")
    columns = [numbers(row[f"s7comm.param.item.{name}"]) for name in names]
    return [
        (area, db, start, (count * BITS[kind] + 7) // 8)
        for area, db, start, kind, count in zip(*columns, strict=True)
    ]


MALFORMED = "_ws.malformed"
SHOWN = f"s7comm.header.rosctr < 7 || {MALFORMED}"
READ: dict[Path, list[dict[str, str]]] = {}
"""By capture: one run has one tshark."""


def read_beside(tshark: Callable[..., str], captures: dict[Path, bytes]) -> None:
    """Reads many at once, beside each other: a start of tshark takes longer than what it says of one."""
    whole = beside({str(path): each for path, each in captures.items() if fits(each)})
    READ.update({Path(name): [] for name, _ in whole.owners})
    with tempfile.NamedTemporaryFile(suffix=".pcapng") as file:
        file.write(whole.content)
        file.flush()
        for row in rows(tshark, Path(file.name), (*FIELDS, MALFORMED), SHOWN):
            name, number = whole.owners[int(row["frame.number"]) - 1]
            READ[Path(name)].append(row | {"frame.number": str(number)})


def read_rows(tshark: Callable[..., str], path: Path) -> list[dict[str, str]]:
    """What tshark says of the jobs, answers and setups of a capture; and of what it calls malformed."""
    if path not in READ and path.parent == FOLDER:
        read_beside(tshark, {each: each.read_bytes() for each in FOLDER.glob("*.pcapng")})
    if path not in READ:
        READ[path] = list(rows(tshark, path, (*FIELDS, MALFORMED), SHOWN))
    return READ[path]


def agreed(tshark: Callable[..., str], path: Path) -> list[tuple[int, int, int]]:
    """What the answers to setups agree on by tshark: frame, length of a PDU, parallel jobs."""
    names = ("frame.number", "s7comm.param.pdu_length", "s7comm.param.maxamq_calling")
    return [
        (int(row[names[0]]), int(row[names[1]]), int(row[names[2]]))
        for row in read_rows(tshark, path)
        if row["s7comm.header.rosctr"] == ANSWER and numbers(row["s7comm.param.func"]) == [SETUP]
    ]


def read_jobs(tshark: Callable[..., str], path: Path) -> list[Job]:
    """The reads and writes of a capture by tshark: an answer belongs to the open request of its number."""
    found: list[Job] = []
    still: dict[tuple[int, int], Job] = {}
    streams: dict[int, int] = {}
    for row in (each for each in read_rows(tshark, path) if each["s7comm.header.rosctr"]):
        key = int(row["tcp.stream"]), int(row["s7comm.header.pduref"])
        kind, function = row["s7comm.header.rosctr"], numbers(row["s7comm.param.func"])
        frame = int(row["frame.number"])
        if kind == JOB and function in ([GET], [PUT]):
            stream = streams.setdefault(key[0], len(streams))
            job = Job(function == [PUT], read_items(row), stream, frame, reference=key[1])
            job.values = split(row["s7comm.resp.data"]) if job.put else []
            found.append(job)
            still[key] = job
        elif kind in (ACK, ANSWER) and key in still:
            job = still.pop(key)
            job.answered = frame
            job.error = int(row["s7comm.header.errcls"], 0) << 8 | int(
                row["s7comm.header.errcod"], 0
            )
            job.codes = numbers(row["s7comm.data.returncode"])
            if not job.put:
                job.values = split(row["s7comm.resp.data"])
    return found


@dataclass(slots=True)
class Transfer:
    """A BSEND."""

    port: int
    """TCP port of its sender."""
    r_id: int
    asked: int
    """Frame of the first segment."""
    segments: list[int] = field(default_factory=list)
    """Bytes of each."""
    total: int = 0
    """Bytes that it announces."""
    acknowledged: int = 0
    """Segments that were acknowledged,"""
    errors: list[int] = field(default_factory=list)
    """and the error words of the acknowledges."""


def read_transfers(tshark: Callable[..., str], path: Path) -> list[Transfer]:
    """The BSENDs of a capture by tshark, which tells R_ID and sum in the frame of the last segment."""
    only = "s7comm.param.userdata.funcgroup == 6 && s7comm.param.userdata.subfunc == 1"
    found: list[Transfer] = []
    still: dict[str, Transfer] = {}
    owner: dict[str, Transfer] = {}
    for row in rows(tshark, path, SEGMENT_FIELDS, only):
        reference, port = row["s7comm.header.pduref"], row["tcp.srcport"]
        if row["s7comm.param.userdata.type"] in RESPONSE:
            owner[reference].acknowledged += 1
            owner[reference].errors += [
                each for each in numbers(row["s7comm.param.errcod"]) if each
            ]
            continue
        first = port not in still
        if first:
            r_id = numbers(row["s7comm.pbc.req.bsend.r_id"])[0]
            still[port] = Transfer(int(port), r_id, int(row["frame.number"]))
            found.append(still[port])
        owner[reference] = still[port]
        # 4 bytes of return code, size and length, and 8 of the R_ID; the first segment tells the sum in 2 more
        owner[reference].segments.append(int(row["s7comm.header.datlg"]) - 12 - 2 * first)
        if int(row["s7comm.param.userdata.lastdataunit"], 0) == 0:
            still.pop(port).total = numbers(row["s7comm.pbc.req.bsend.len"])[0]
    return found


def our_jobs(result: CaptureResult) -> list[Job]:
    """The reads and writes of a capture by ds47, in the order of their requests."""
    asked = [
        each
        for each in result.transactions
        if each.operation in ("get", "put") and each.frames.write_request
    ]
    asked.sort(key=lambda each: each.frames.write_request or 0)
    streams: dict[int | None, int] = {}
    return [
        Job(
            each.operation == "put",
            [our_item(item) for item in each.items],
            streams.setdefault(each.connection, len(streams)),
            each.frames.write_request or 0,
            each.frames.read_response or 0,
            each.request_reference or 0,
            each.error or 0,
            [item.code for item in each.items if item.code is not None],
            [item.value.hex() for item in each.items if item.value],
        )
        for each in asked
    ]


def our_item(item: Item) -> tuple[int, int, int, int]:
    """An item of ds47 as (area, block, first bit or element, bytes)."""
    area, start = AREAS[item.area or ""], item.start or 0
    first = start if item.area in ("C", "T") else start * 8 + (item.bit or 0)
    return area, item.db or 0, first, item.length or 0
