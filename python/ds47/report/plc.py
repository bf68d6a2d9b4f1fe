"""What the PLC saw of a job: the outputs of WRREC and RDREC as a program would see them.

Derived from the transaction alone (docs/explain.md): every call of a block with DONE or VALID, ERROR,
STATUS and LEN. What STATUS means is the business of `ds47.explain`; the words are in spec/report.toml.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

from ds47.model import Transaction
from ds47.report.bilingual import Both, joined, say

NOT_READY: Final = 0xDE80B500
"""The STATUS of a poll: state conflict on a Read (docs/protocol.md E.1)."""
REFUSED: Final = 0x80
"""The bit of byte 1 of a response that says that something was refused (docs/protocol.md A.3)."""

OTHER: Final = "other"


class Call(NamedTuple):
    """One call of a block, or several that looked alike.

    `block` is "WRREC" or "RDREC"; `outcome` what it ended with:
    `done` (DONE, VALID), `error`, `fault` (ERROR, the STATUS is made by the PLC), `busy` (until the block
    gives up), `assumed` (done, though its response is not in the capture), `missing` (not in the capture),
    `polled` (ERROR with DE80B500), `again` (VALID once more), `never`, `given_up` (not started, not
    started again).
    """

    block: str
    outcome: str
    status: int | None = None
    times: int = 1
    length: int | None = None
    """LEN of RDREC: bytes in RECORD."""


def saw(item: Transaction) -> list[Call]:
    """The calls of a job in their order."""
    return [_write(item), *_reads(item)]


def _write(item: Transaction) -> Call:
    frames = item.frames
    if frames.write_request is None:
        return Call("WRREC", "missing")
    if item.write_status is not None:
        return Call("WRREC", "error" if item.write_status else "done", item.write_status)
    if frames.write_response is not None:
        return Call("WRREC", "fault")
    if frames.read_response is not None or frames.polls:
        return Call("WRREC", "assumed")
    return Call("WRREC", "busy")


def _reads(item: Transaction) -> list[Call]:
    frames, calls = item.frames, []
    if frames.polls:
        calls.append(Call("RDREC", "polled", NOT_READY, len(frames.polls)))
    length = len(item.response) if item.response is not None else 0
    if frames.read_response is not None and item.read_status:
        calls.append(Call("RDREC", "error", item.read_status))
    elif frames.read_response is not None:
        calls.append(Call("RDREC", "done", 0, length=length))
    elif frames.read_request is not None:
        calls.append(Call("RDREC", "busy"))
    else:
        calls.append(Call("RDREC", "given_up" if frames.polls else "never"))
    if frames.rereads:
        calls.append(Call("RDREC", "again", 0, len(frames.rereads), length))
    return calls


def remark(item: Transaction) -> str:
    """What STATUS does not tell: OTHER (the record answers another request), or the response id that refuses."""
    response = item.response
    if response is None or item.read_status:
        return ""
    if item.state == "mismatch":
        return OTHER
    return f"{response[1]:02X}" if len(response) > 1 and response[1] & REFUSED else ""


def text(item: Transaction) -> Both:
    """`WRREC DONE, STATUS 00000000; RDREC 3 x ERROR, STATUS DE80B500; RDREC VALID ...`."""
    return _told(tuple(saw(item)), remark(item))


def line(item: Transaction) -> Both:
    """The same with `PLC: ` in front."""
    return say("plc_line", calls=text(item))


@lru_cache(maxsize=4096)
def _told(calls: tuple[Call, ...], more: str) -> Both:
    told = joined([_words(call) for call in calls], "; ", "；")
    if not more:
        return told
    return told.joined(
        say("plc_other") if more == OTHER else say("plc_refused", id=more), " - ", "，"
    )


def _words(call: Call) -> Both:
    kind = "write" if call.block == "WRREC" else "read"
    status = f"{call.status or 0:08X}"
    return say(f"plc_{kind}_{call.outcome}", n=call.times, status=status, length=call.length)
