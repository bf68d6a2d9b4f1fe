"""What is fuzzed: each target takes bytes, and raises where ds47 has a fault.

Refusing an input in words is no fault. Any exception but those that ds47 raises on purpose is one, so is exit
status 70, and so is a short way that says other than the long one.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import random
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest.mock import patch

from ds47 import report
from ds47.analysis import AnalysisOptions, analyze
from ds47.batch import settings
from ds47.capture import CaptureError, Frame, open_capture
from ds47.capture.scan import ETHERNET, relevant
from ds47.capture.writer import PcapngWriter, nearest
from ds47.cli import main
from ds47.model import Report
from ds47.profibus import dp, telegram
from ds47.profidrive import Options, decode_request, decode_response
from ds47.profidrive.parameter import encode_request, encode_response, shared_request
from ds47.profinet import connect, records, rpc
from ds47.profinet.link import Packets, dissect
from ds47.regression import config
from ds47.s7 import pdu as s7
from ds47.s7 import tpkt

Target = Callable[[bytes], None]
TARGETS: dict[str, Target] = {}
CAPTURES = Path(__file__).resolve().parents[2] / "captures"
LARGEST = 16_384
"""Bytes of an input."""
OURS = 70
FORMATS = tuple(name for name in report.FORMATS if name not in ("parquet", "html"))
"""The cheap ones; a page comes for one input in some tens."""


def target(function: Target) -> Target:
    """One that has the name of its function."""
    TARGETS[function.__name__] = function
    return function


class FaultError(Exception):
    """What ds47 did is a fault of its own."""


# Targets


@target
def capture(data: bytes) -> None:
    """The reader of captures, and the frames in them."""
    with contextlib.suppress(CaptureError), open_capture(io.BytesIO(data)) as found:
        for frame in found.everything():
            dissect(frame)
            relevant(frame.data, 0, len(frame.data), frame.link_type, frame.original_length)


@target
def calls(data: bytes) -> None:
    """One datagram of RPC: what a frame says by the short way and by the long one, and the records in it."""
    head = bytes.fromhex("02000000000202000000000108004500") + (len(data) + 28).to_bytes(2)
    head += bytes.fromhex("000100004011") + bytes(2) + bytes((10, 0, 0, 1, 10, 0, 0, 2))
    head += bytes.fromhex("88948894") + (len(data) + 8).to_bytes(2) + bytes(2)
    frame = Frame(1, 0, ETHERNET, head + data, len(head) + len(data))
    packet = dissect(frame)
    found = packet and packet.kind == "udp" and rpc.parse(packet)
    quick = rpc.from_frame(frame)
    if quick is not None and quick != found:
        raise FaultError(f"from_frame says {quick}, parse {found}")
    if not found:
        return
    records.parse_request(found)
    records.parse_response(found)
    records.parse_answers(found)
    records.released_ar(found)
    records.connected_ar(found)
    connect.parse_request(found)
    connect.parse_response(found)
    rpc.device_identity(found.object_uuid)


@target
def codec(data: bytes) -> None:
    """A request and its response: the first byte is the length of the request."""
    size = data[0] if data else 0
    asked, answer = data[1 : 1 + size], data[1 + size :]
    for options in (Options(), Options(True, True)):
        request = decode_request(asked, options)
        if shared_request(asked, options) != request:
            raise FaultError("a shared request is another one")
        for each in (request, None):
            response = decode_response(answer, each, options)
            if not response.flaws:
                encode_response(response)
        if not request.flaws and encode_request(request) != asked:
            raise FaultError(f"{asked.hex()} is written as {encode_request(request).hex()}")


@target
def telegrams(data: bytes) -> None:
    """One telegram of PROFIBUS, one PDU of S7."""
    found = telegram.decode(data)
    dp.service(found)
    dp.decode(found)
    dp.configuration(data)
    tpkt.decode(data)
    one = s7.decode(data)
    s7.setup(one)
    s7.variables(one)
    s7.results(one)
    s7.usend(one)
    about = s7.user_data(one)
    if about is not None:
        s7.segment(one, about)


@target
def pairing(data: bytes) -> None:
    """A capture to its reports."""
    options = AnalysisOptions(indices=frozenset({0xB02D}))
    with contextlib.suppress(CaptureError):
        result = analyze(io.BytesIO(data), options)
        chance = zlib.crc32(data)
        if chance & 0x600:  # a report costs more than what it tells of
            return
        name = "html" if chance % 40 == 0 else FORMATS[chance % len(FORMATS)]
        text = written(Report([result]), name, "zh" if chance & 0x100 else "en")
        if name == "json":
            json.loads(text)


def written(results: Report, name: str, lang: str) -> str:
    """A report as text."""
    out = io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", newline="\n")
    report.write_all(report.open_writer(name, out, report.ReportOptions(lang=lang)), results)
    out.flush()
    raw = out.buffer
    assert isinstance(raw, io.BytesIO)
    return raw.getvalue().decode("utf-8")


@target
def logs(data: bytes) -> None:
    """Text: logs of PROFIBUS, hex dumps."""
    pairing(data)


FILES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("ds47.toml", ("report", "-f", "overview", "{capture}")),
    ("a.ds47.json", ("check", "{capture}")),
    ("l.csv", ("report", "-f", "csv", "--params", "{file}", "{capture}")),
    ("l.toml", ("report", "-f", "csv", "--params", "{file}", "{capture}")),
    ("g.toml", ("report", "-f", "csv", "--expect", "{file}", "{capture}")),
    ("g.csv", ("report", "-f", "csv", "--expect", "{file}", "{capture}")),
    ("l.xlsx", ("params", "import", "--name", "x", "{file}")),
    ("key.json", ("export", "--anonymise", "--key", "{file}", "--force", "-o", "{folder}/y.pcapng", "{capture}")),
    ("d.json", ("diff", "{file}", "{capture}")),
)  # fmt: skip
"""A file that people write or keep, and a command that reads it; the first byte of the input chooses."""


@cache
def place(process: int) -> Path:
    """A folder of a process, because a child has its own, with a capture; it is gone when that ends."""
    folder = tempfile.TemporaryDirectory(prefix="ds47-fuzz-")
    _FOLDERS.append(folder)
    found = Path(folder.name)
    (found / "a.pcapng").write_bytes((CAPTURES / "conversation-error.pcapng").read_bytes())
    return found


_FOLDERS: list[tempfile.TemporaryDirectory[str]] = []


@target
def loaders(data: bytes) -> None:
    """Files that people write or keep, by the commands that read them."""
    name, words = FILES[(data[0] if data else 0) % len(FILES)]
    path = place(os.getpid()) / name
    path.write_bytes(data[1:])
    names = {"file": path, "folder": path.parent, "capture": path.parent / "a.pcapng"}
    said = io.StringIO()
    lists = {"DS47_PARAMS": str(path.parent / "lists")}
    settings._nearest.cache_clear()
    config._for_folder.cache_clear()
    try:
        with (
            patch.dict(os.environ, lists),
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(said),
        ):
            status = main([word.format(**names) for word in words])
    finally:
        path.unlink()
        gc.unfreeze()  # a command ends its process, and leaves its garbage to that
    if status == OURS or "internal fault" in said.getvalue():
        raise FaultError(said.getvalue())


# Where fuzzing begins


def frames(source: Path | bytes) -> list[Frame]:
    """The frames of a capture."""
    with open_capture(io.BytesIO(source) if isinstance(source, bytes) else source) as found:
        return [
            Frame(each.number, each.time_ns, each.link_type, each.data, each.original_length)
            for each in found.everything()
        ]


def _small(*folders: str) -> Iterator[Path]:
    for folder in folders:
        for path in sorted((CAPTURES / folder).glob("*.pcap*")):
            if path.stat().st_size <= LARGEST:
                yield path


def _of_calls() -> Iterator[bytes]:
    for path in _small("."):
        for packet in Packets().of(frames(path)):
            if packet.kind == "udp":
                yield packet.payload


def _of_codec() -> Iterator[bytes]:
    for path in _small("."):
        for each in analyze(path).transactions:
            asked = each.request or b""
            yield bytes([len(asked) & 0xFF]) + asked + (each.response or b"")


def _of_telegrams() -> Iterator[bytes]:
    for frame in frames(CAPTURES / "profibus/pyprofibus_ppo1.pcapng")[:200]:
        yield frame.data
    for path in _small("s7-stacks", "field"):
        for frame in frames(path)[:60]:
            if frame.data[23:24] == b"\x06" and len(frame.data) > 61:
                yield frame.data[61:]


def _of_logs() -> Iterator[bytes]:
    for path in sorted((CAPTURES / "field").iterdir()):
        if path.suffix in (".txt", ".log") and path.stat().st_size <= LARGEST:
            yield path.read_bytes()


def _of_loaders() -> Iterator[bytes]:
    stored = (CAPTURES / "conversation-error.ds47.json").read_bytes()
    for number, (name, _) in enumerate(FILES):
        if name in ("a.ds47.json", "d.json"):
            yield bytes([number]) + stored


SEEDS: dict[str, Callable[[], Iterator[bytes]]] = {
    "capture": lambda: (each.read_bytes() for each in _small(".", "field", "profibus")),
    "calls": _of_calls,
    "codec": _of_codec,
    "telegrams": _of_telegrams,
    "pairing": lambda: (each.read_bytes() for each in _small(".", "field", "s7-stacks", "profibus")),
    "logs": _of_logs,
    "loaders": _of_loaders,
}  # fmt: skip
"""Beside `kept/`: what the stored captures give for each target."""


# How a capture is changed: in its frames, because bytes of the file give refusals for the most part

BEGINNINGS = (0, 12, 14, 34, 42, 58, 82, 122, 142, 206)
"""Where headers end."""
Change = Callable[[bytes, int], bytes]


def other_frames(data: bytes, most: int, seed: int, change: Change) -> bytes:
    """The capture with some frames changed, doubled, gone, moved, late; or its bytes changed."""
    chance = random.Random(seed)
    try:
        shots = frames(data)
    except CaptureError:
        shots = []
    if not shots or chance.random() < 0.1:
        return change(data, most)
    for _ in range(chance.choice((1, 1, 2, 4))):
        at = chance.randrange(len(shots))
        kind, frame = chance.randrange(8), shots[at]
        if kind == 0:
            shots.insert(chance.randrange(len(shots) + 1), frame)
        elif kind == 1 and len(shots) > 1:
            del shots[at]
        elif kind == 2:
            shots.insert(chance.randrange(len(shots)), shots.pop(at))
        elif kind == 3:
            step = chance.choice((10**3, 10**6, 2 * 10**9, 61 * 10**9)) * chance.choice((-1, 1))
            shots[at] = replace(frame, time_ns=max(0, frame.time_ns + step))
        else:
            keep = min(chance.choice(BEGINNINGS), len(frame.data))
            body = change(frame.data[keep:], len(frame.data) - keep + 16)
            shots[at] = replace(
                frame, data=frame.data[:keep] + body, original_length=max(frame.original_length, keep + len(body))
            )  # fmt: skip
    made = io.BytesIO()
    with PcapngWriter(made, shots[0].link_type) as writer:
        for frame in shots:
            if len(made.getbuffer()) + len(frame.data) + 64 > most:
                break
            writer.write(nearest(frame.time_ns), frame.data, frame.original_length)
    return made.getvalue()


if __name__ == "__main__":  # python -m tests.fuzz.targets TARGET FILE ...: what an input does
    for name in sys.argv[2:]:
        TARGETS[sys.argv[1]](Path(name).read_bytes())
