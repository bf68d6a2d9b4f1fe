"""S7 communication in words: its connections as a table, what servers say of themselves, the items of a job.

Used by the text report and by the HTML page; what is wrong there are findings like all others (docs/s7.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from ds47.model import CaptureResult, Connection, Item, Transaction
from ds47.profidrive import naming
from ds47.report.bilingual import Both, joined, say
from ds47.report.formatting import duration, escape, parameter
from ds47.spec import SINAMICS, s7

COLUMNS = (
    "connection", "tsaps", "pdu", "jobs", "refused", "unanswered", "read", "written", "sent", "answer", "also",
)  # fmt: skip
"""Of the table; their words are `s7_` and the name."""
BYTES_SHOWN = 16
"""A longer value is cut, and its length stated."""
LONGEST_PDU = 960
"""Bytes: CPUs agree to 240, 480 or 960."""
OK = 0xFF
"""The return code of an item that went well."""
PUT = "put"


def head() -> list[Both]:
    """The names of the columns."""
    return [say(f"s7_{name}") for name in COLUMNS]


def rows(result: CaptureResult) -> Iterator[list[Both]]:
    """A row for each connection."""
    for each in result.connections:
        yield [Both.same(ends(each)), _tsaps(each), *map(Both.same, _cells(each)), _also(each)]


def ends(item: Connection) -> str:
    """`10.0.0.1:49152 -> 10.0.0.2:102`."""
    client = f"{escape(item.client)}:{item.client_port}"
    return f"{client} -> {escape(item.server)}:{item.server_port}"


def _tsaps(item: Connection) -> Both:
    """Both TSAPs, who owns the connection, and the place of the CPU; nothing where they were not seen."""
    if item.client_tsap is None and item.server_tsap is None:
        return Both.same("")
    both = " -> ".join(tsap(each) for each in (item.client_tsap, item.server_tsap))
    shown, owner = Both.same(both), s7.owner(item.server_tsap)
    about = [say(f"s7_owner_{owner}")] if owner else []
    if item.rack is not None:
        about.append(say("s7_place", rack=item.rack, slot=item.slot))
    return shown.joined(joined(about), zh=" ") if about else shown


def tsap(data: bytes | None) -> str:
    """`01.00`, or its text where it is one."""
    if not data:
        return "?"
    text = data.decode("latin-1")
    return (
        text if len(data) > 2 and text.isascii() and text.isprintable() else data.hex(".").upper()
    )


def _cells(item: Connection) -> Iterator[str]:
    """PDU and parallel jobs, then the counts, then the answer times."""
    parallel = "" if item.parallel is None else f" x{item.parallel}"
    yield "" if item.pdu_length is None else f"{item.pdu_length}{parallel}"
    for number in (
        item.jobs, item.refused, item.unanswered, item.read_bytes, item.written_bytes, item.sent_bytes,
    ):  # fmt: skip
        yield f"{number:,}"
    answer = item.answer
    yield "" if answer is None else f"{duration(answer.mean_ns)} ({duration(answer.most_ns)})"


def _also(item: Connection) -> Both:
    counts = (
        ("s7_orphans", item.orphans), ("s7_cyclic", item.cyclic), ("s7_other", item.other),
        ("s7_plus", item.plus), ("s7_lost", item.lost_bytes),
    )  # fmt: skip
    counted = [say(key, n=number) for key, number in counts if number]
    return joined(counted) if counted else Both.same("")


def about(result: CaptureResult, most: int) -> Iterator[Both]:
    """Sentences below the table, at most so many of each kind."""
    for kind in (_evidence, _drives, _bsends):
        yield from islice(kind(result), most)


def _bsends(result: CaptureResult) -> Iterator[Both]:
    """How long the longest BSEND of each connection takes, and with the longest PDU that a CPU agrees to."""
    longest: dict[int | None, Transaction] = {}
    for each in result.transactions:
        if each.operation == "bsend" and each.state == "ok" and len(each.segments) > 1:
            before = longest.setdefault(each.connection, each)
            if len(each.segments) > len(before.segments):
                longest[each.connection] = each
    agreed: dict[int | None, int | None] = {each.id: each.pdu_length for each in result.connections}
    for connection, item in longest.items():
        took, size, count = item.duration_ns, len(item.items[0].value or b""), len(item.segments)
        if took is None or not size:
            continue
        pdu = agreed.get(connection) or LONGEST_PDU
        best = 1 - min(0, s7.room("bsend_first", LONGEST_PDU) - size) // s7.room(
            "bsend", LONGEST_PDU
        )
        yield say(
            "s7_bsend_takes" if pdu >= LONGEST_PDU else "s7_bsend_takes_longer",
            sender=escape(item.controller), receiver=escape(item.device), r_id=str(item.r_id),
            bytes=f"{size:,}", took=duration(took), n=count, each=duration(took // count), pdu=str(LONGEST_PDU),
            best=str(best),
        )  # fmt: skip


def _evidence(result: CaptureResult) -> Iterator[Both]:
    """What servers say of themselves, each thing once for a server."""
    seen: set[tuple[str, str, int | str]] = set()
    for connection in result.connections:
        for each in connection.evidence:
            key = connection.server, each.name, each.value
            if key not in seen:
                seen.add(key)
                yield say(
                    f"s7_{each.name}", server=escape(connection.server), frame=str(each.frame),
                    value=escape(str(each.value)),
                )  # fmt: skip


def _drives(result: CaptureResult) -> Iterator[Both]:
    """Which servers are drives, or may be, each once: what shows it, and what the first address stands for."""
    seen: set[str] = set()
    for each in result.connections:
        found = each.drive
        if found is None or each.server in seen:
            continue
        seen.add(each.server)
        example = Both.same("")
        if found.pnu is not None and found.subindex is not None:
            element = naming.element(found.pnu, found.subindex, SINAMICS)
            stands = {
                "address": found.address,
                "element": element,
                "number": str(found.drive_object),
            }
            example = say("s7_drive_example", **stands)
        seems = "s7_drive_seems" if found.proof == "addresses" else "s7_drive"
        yield say(
            seems,
            server=escape(each.server),
            proof=say(f"s7_drive_by_{found.proof}"),
            example=example,
        )


def blocks_missing(result: CaptureResult) -> bool:
    """Whether jobs access variables of a server with an unknown block size."""
    return any(
        each.block is None and each.drive is None and (each.read_bytes or each.written_bytes)
        for each in result.connections
    )


def listed(item: Transaction, every: bool) -> bool:
    """Whether a transaction of S7 stands in a list: one with findings, or that did not go well; or `every` one."""
    return every or bool(item.findings) or item.state != "ok"


def parts(item: Transaction, lang: str = "en") -> list[str]:
    """What a job is about, an entry for each item: `DB1.DBB0..3 = 00 00 00 07`, `R_ID 00000009 := ...`."""
    shown = [_part(each, item, lang) for each in item.items]
    if item.segments:
        shown[0] += f" ({say('s7_segments', n=len(item.segments)).text(lang)})"
    return shown


def _part(item: Item, job: Transaction, lang: str) -> str:
    if item.parameter is not None and item.code in (OK, None):
        shown = parameter(item.parameter, job.operation == PUT, lang)
        return say("s7_element", element=shown, number=str(item.drive_object)).text(lang)
    name = item.address or ("?" if job.r_id is None else f"R_ID {job.r_id:08X}")
    failed = "" if item.code in (OK, None) else " " + failure(item.code, lang)
    if item.value is None:
        return escape(name) + failed
    return f"{escape(name)} {'=' if job.operation == 'get' else ':='} {value(item.value, lang)}{failed}"


def failure(code: int | None, lang: str) -> str:
    """`0x05 address out of range`."""
    return f"0x{code or 0:02X} {s7.code_text('return_code', code or 0, lang)}"


def value(data: bytes, lang: str) -> str:
    """Bytes, cut where they are many: `00 01 02 ... (444 bytes)`."""
    shown = data[:BYTES_SHOWN].hex(" ").upper()
    if len(data) <= BYTES_SHOWN:
        return shown
    return f"{shown} ... ({say('s7_length', n=len(data)).text(lang)})"


def error(item: Transaction, lang: str) -> str:
    """Error class and code of an answer in words; empty where there is none."""
    return s7.error_text(item.error, lang) if item.error else ""
