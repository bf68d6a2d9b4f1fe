"""Record how two S7 stacks that nobody here wrote talk to each other: captures and a log of what was asked.

    python tools/oracles/record.py FOLDER PURE CPP

PURE and CPP are the Pythons of the two environments (`make oracles` makes them). Each capture is recorded by
dumpcap on the loopback of a network namespace of its own (Linux, `unshare --net`): so nothing else is in it, and
port 102 is free. Beside the captures EXPECTED.jsonl has a line per call: what the stack was told, what it gave
back, and the jobs that it must have taken, from the sizes below. Not here: any decoder, ours or of others.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ds47.capture.writer import PcapngWriter

END = Path(__file__).with_name("snap7_end.py")
SERVER, PASSIVE, ACTIVE = "127.0.0.2", "127.0.0.2", "127.0.0.1"
READS = {
    "cpp": {240: 222, 480: 462, 960: 942},
    "pure": {240: 222, 480: 462, 960: 942},
}
"""The most bytes that a stack reads by one job, by PDU size: PDU - 18, in both the same."""
WRITES = {
    "cpp": {240: 212, 480: 452, 960: 932},
    "pure": {240: 205, 480: 445, 960: 925},
}
"""The most that it writes by one job: C++ PDU - 28, Python PDU - 35 (`_max_write_size` of its client_base.py)."""
FIRST, NEXT = 36, 34
"""What a segment of BSEND leaves of the PDU in the C++ stack: of the first one, of the others."""


def content(size: int, seed: int = 1) -> bytes:
    """Bytes that do not repeat soon."""
    return bytes((number * 7 + (number >> 8) * 3 + seed) & 0xFF for number in range(size))


def shares() -> list[tuple[str, int, str]]:
    """What every server has: (area, number, content)."""
    sizes = [
        ("DB", 1, 2000),
        ("DB", 2, 64),
        ("I", 0, 128),
        ("Q", 0, 128),
        ("M", 0, 256),
        ("T", 0, 64),
        ("C", 0, 64),
    ]
    return [
        (name, number, content(size, 3 + len(name) + number).hex()) for name, number, size in sizes
    ]


class End:
    """A process that is a client, a server or a partner of one stack."""

    def __init__(self, stack: str, role: str, python: str) -> None:
        self.stack, self.role, self.pdu = stack, role, 0
        self.process = subprocess.Popen(
            [python, str(END), role],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def tell(self, do: str, **arguments: Any) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
        self.process.stdin.flush()

    def hear(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        said: dict[str, Any] = json.loads(self.process.stdout.readline())
        return said

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.tell(do, **arguments)
        return self.hear()

    def must(self, do: str, **arguments: Any) -> Any:
        said = self.ask(do, **arguments)
        if "error" in said:
            raise RuntimeError(f"{self.stack} {do}: {said['error']}")
        return said["ok"]

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Talk:
    """One capture: its ends, and the lines of its log."""

    def __init__(self, name: str, pythons: dict[str, str]) -> None:
        self.name, self.pythons = name, pythons
        self.ends: list[End] = []
        self.lines: list[dict[str, Any]] = []

    def end(self, stack: str, role: str) -> End:
        made = End(stack, role, self.pythons[stack])
        self.ends.append(made)
        return made

    def server(self, stack: str, clients: int | None = None) -> End:
        made = self.end(stack, "server")
        made.must("serve", ip=SERVER, areas=shares(), clients=clients)
        return made

    def client(self, stack: str, pdu: int = 480, slot: int = 2) -> End:
        """A client that is connected; the PDU size that was agreed is its `pdu`."""
        made = self.end(stack, "client")
        said = made.ask("connect", ip=SERVER, rack=0, slot=slot, pdu=pdu)
        made.pdu = said.get("ok", 0)
        self.log(made, "connect", {"slot": slot, "pdu": pdu}, said, [])
        return made

    def log(
        self, end: End, call: str, told: dict[str, Any], said: dict[str, Any], jobs: list[Any]
    ) -> None:
        """A line: the jobs are lists of items [area, db, start, bytes]."""
        line = {"capture": self.name, "n": len(self.lines) + 1, "stack": end.stack}
        line |= {"end": self.ends.index(end)}
        line |= {"call": call, **told, "agreed": end.pdu, **said, "jobs": jobs}
        self.lines.append(shortened(line))

    def read(
        self, end: End, area: str, db: int, start: int, count: int, word: str = "byte"
    ) -> dict[str, Any]:
        """Read an area; the jobs follow from the stack's sizes."""
        told = {"area": area, "db": db, "start": start, "count": count, "word": word}
        said = end.ask("read", **told)
        size = {"byte": 1, "bit": 1, "word": 2, "dword": 4, "real": 4}[word]
        size = 2 if area in ("C", "T") else size
        most = READS[end.stack][end.pdu] // size * size
        self.log(end, "read", told, said, pieces(area, db, start, count * size, most))
        return said

    def write(
        self, end: End, area: str, db: int, start: int, data: bytes, word: str = "byte"
    ) -> None:
        told = {"area": area, "db": db, "start": start, "data": data.hex(), "word": word}
        said = end.ask("write", **told)
        most = WRITES[end.stack][end.pdu]
        self.log(end, "write", told, said, pieces(area, db, start, len(data), most))

    def read_many(
        self, end: End, items: list[tuple[str, int, int, int]], jobs: list[Any] | None = None
    ) -> None:
        """Read many items; without `jobs` one job has them all as they stand there."""
        said = end.ask("read_many", items=items)
        self.log(end, "read_many", {"items": items}, said, [items] if jobs is None else jobs)

    def write_many(self, end: End, items: list[tuple[str, int, int, bytes]]) -> None:
        told = [(area, db, start, data.hex()) for area, db, start, data in items]
        said = end.ask("write_many", items=told)
        job = [[area, db, start, len(data)] for area, db, start, data in items]
        self.log(end, "write_many", {"items": told}, said, [job])

    def partners(self, active: str, passive: str, pdu: int | None = None) -> tuple[End, End]:
        """Two partners that are connected: (active, passive)."""
        one, two = self.end(active, "partner"), self.end(passive, "partner")
        two.must("start", active=False, local=PASSIVE, remote=ACTIVE)
        one.must("start", active=True, local=ACTIVE, remote=PASSIVE, pdu=pdu)
        one.must("linked_soon")
        two.must("linked_soon")
        return one, two

    def send(self, source: End, target: End, r_id: int, data: bytes, pdu: int = 480) -> None:
        """BSEND from one partner to the other; the jobs are [bytes of each segment]."""
        target.tell("receive")
        time.sleep(0.05)
        said = source.ask("send", r_id=r_id, data=data.hex())
        received = target.hear()
        source.pdu = pdu
        told = {"r_id": r_id, "data": data.hex(), "received": received}
        self.log(source, "bsend", told, said, segments(source.stack, len(data), pdu))

    def close(self) -> None:
        """Clients go first, so that each connection ends as its client ends it."""
        for each in reversed(self.ends):
            each.ask("disconnect" if each.role == "client" else "stop")
            each.close()


def shortened(value: Any) -> Any:
    """The same, with a digest in place of each text of hexadecimal digits that is long."""
    if isinstance(value, dict):
        return {name: shortened(each) for name, each in value.items()}
    if isinstance(value, str) and len(value) > 128:
        data = bytes.fromhex(value)
        return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    return value


def pieces(area: str, db: int, start: int, size: int, most: int) -> list[Any]:
    """The jobs of a read or write: pieces of at most `most` bytes, each the only item of its job."""
    return [[[area, db, start + at, min(most, size - at)]] for at in range(0, size, most)]


def segments(stack: str, size: int, pdu: int) -> list[int]:
    """Bytes of each segment of a BSEND; the stack in Python makes one, however long."""
    if stack == "pure" or size <= pdu - FIRST:
        return [size]
    found, left = [pdu - FIRST], size - (pdu - FIRST)
    while left:
        found.append(min(pdu - NEXT, left))
        left -= found[-1]
    return found


SCENES: dict[str, tuple[str, Callable[[Talk], None]]] = {}
"""By the name of the capture: its title, and what happens in it."""


def scene(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorator: a function makes a capture of each name; what stands behind "_" are its arguments."""

    def enter(play: Callable[..., None]) -> Callable[..., None]:
        for name in names:
            words = name.split("_")[1:]
            title = (play.__doc__ or "").strip().splitlines()[0].rstrip(".")
            SCENES[name] = title, lambda talk, words=words: play(talk, *words)
        return play

    return enter


SIZED = [f"{ends}_{pdu}" for pdu in (240, 480, 960) for ends in ("areas_cpp_cpp", "areas_pure_cpp")]


@scene(*SIZED, "areas_cpp_pure_480", "areas_pure_pure_480", "areas_pure_pure_240")
def areas(talk: Talk, client: str, server: str, pdu: str) -> None:
    """Reads and writes of one job, of just one, of two and of many; all areas."""
    talk.server(server)
    end = talk.client(client, int(pdu))
    most, wide = READS[client][end.pdu], WRITES[client][end.pdu]
    for size in (1, most, most + 1, 2 * most, 1500):
        talk.read(end, "DB", 1, 10, size)
    for start, size in ((20, 2), (30, wide), (40, wide + 1), (50, 2 * wide + 7)):
        talk.write(end, "DB", 1, start, content(size, size & 0xFF))
    talk.read(end, "DB", 2, 0, 64)
    for area in ("I", "Q", "M"):
        talk.read(end, area, 0, 5, 17)
    talk.write(end, "M", 0, 100, content(9))
    talk.write(end, "Q", 0, 3, content(1))
    talk.read(end, "M", 0, 90, 30)


@scene("words_cpp_cpp", "words_pure_cpp")
def words(talk: Talk, client: str, server: str) -> None:
    """Elements that are no bytes: words, double words, floating point, timers, counters, one bit."""
    talk.server(server)
    end = talk.client(client, 240)
    for word, count in (("word", 3), ("dword", 2), ("real", 5), ("word", 120)):
        talk.read(end, "DB", 1, 100, count, word)
    talk.read(end, "T", 0, 4, 3)
    talk.read(end, "C", 0, 0, 8)
    talk.read(end, "M", 0, 83, 1, "bit")
    talk.write(end, "M", 0, 83, b"\1", "bit")
    talk.read(end, "M", 0, 83, 1, "bit")
    talk.write(end, "DB", 1, 200, content(4), "real")


@scene("multi_cpp_cpp", "multi_cpp_pure")
def multi(talk: Talk, client: str, server: str) -> None:
    """Many items in one job: even and odd lengths, other areas, and some that are missing."""
    talk.server(server)
    end = talk.client(client, 480)
    talk.read_many(end, [("DB", 1, 0, 4), ("DB", 1, 7, 3), ("M", 0, 10, 1), ("DB", 2, 60, 4)])
    talk.read_many(end, [("DB", 1, 3 * n, 1 + n % 5) for n in range(20)])
    talk.read_many(end, [("DB", 1, 0, 5), ("DB", 99, 0, 4), ("DB", 2, 62, 8), ("Q", 0, 1, 1)])
    talk.read_many(end, [("DB", 98, 0, 2)])
    if server == "cpp":
        talk.write_many(
            end, [("DB", 1, 300, content(5)), ("M", 0, 40, content(1)), ("DB", 2, 8, content(8))]
        )
        talk.write_many(
            end, [("DB", 1, 310, content(3)), ("DB", 97, 0, content(2)), ("Q", 0, 9, content(1))]
        )


@scene("multi_pure_cpp")
def merged(talk: Talk, client: str, server: str) -> None:
    """The client of python-snap7 sorts items and joins those with five bytes or fewer between them."""
    talk.server(server)
    end = talk.client(client, 480)
    items = [("DB", 1, 60, 4), ("M", 0, 10, 3), ("DB", 1, 0, 4), ("DB", 1, 4, 6)]
    talk.read_many(end, items, [[["M", 0, 10, 3], ["DB", 1, 0, 10], ["DB", 1, 60, 4]]])


@scene("parallel_pure_cpp")
def parallel(talk: Talk, client: str, server: str) -> None:
    """It sends jobs at once where many items need many, whatever number of jobs was agreed.

    Whether an answer comes in between is up to the server: eight times, so that once it does not.
    """
    talk.server(server)
    end = talk.client(client, 240)
    items = [("DB", 1, 100 * n, 80) for n in range(6)]
    jobs = [[["DB", 1, 100 * n, 80], ["DB", 1, 100 * n + 100, 80]] for n in (0, 2, 4)]
    for _ in range(8):
        talk.read_many(end, items, jobs)


@scene("short_cpp_pure")
def short(talk: Talk, client: str, server: str) -> None:
    """The server of python-snap7 writes the first item of many and answers with one code."""
    talk.server(server)
    end = talk.client(client, 480)
    talk.write_many(
        end, [("DB", 1, 300, content(5)), ("M", 0, 40, content(1)), ("DB", 2, 8, content(8))]
    )


@scene("errors_cpp_cpp", "errors_cpp_pure", "errors_pure_cpp", "errors_pure_pure")
def errors(talk: Talk, client: str, server: str) -> None:
    """A block that is not there, addresses behind its end, both read and written; then one that goes well."""
    talk.server(server)
    end = talk.client(client, 480)
    talk.read(end, "DB", 99, 0, 4)
    talk.read(end, "DB", 2, 60, 8)
    talk.read(end, "DB", 2, 100, 2)
    talk.write(end, "DB", 99, 0, content(4))
    talk.write(end, "DB", 2, 60, content(8))
    talk.write(end, "DB", 2, 100, content(2))
    talk.read(end, "DB", 2, 0, 64)


@scene("polled_cpp_cpp", "polled_pure_pure")
def polled(talk: Talk, client: str, server: str) -> None:
    """Reads that follow each other in memory and are no split: none fills its PDU."""
    talk.server(server)
    end = talk.client(client, 240)
    for _ in range(3):
        talk.read(end, "DB", 1, 0, 32)
        talk.read(end, "DB", 1, 32, 4)
    talk.read(end, "DB", 1, 0, 150)
    talk.read(end, "DB", 1, 150, 150)
    talk.write(end, "DB", 1, 0, content(40))
    talk.write(end, "DB", 1, 40, content(40))


@scene(
    *(
        f"{what}_{ends}"
        for what in ("torn", "newer", "older")
        for ends in ("cpp_pure_cpp", "pure_cpp_pure")
    )
)
def between(talk: Talk, reader: str, writer: str, server: str) -> None:
    """A read by two jobs, and a write of another client between them: into both parts, or into one.

    It is read before, too: so the capture has what the write changes.
    """
    talk.server(server)
    one, two = talk.client(reader, 480), talk.client(writer, 480)
    start, size = {"torn": (454, 16), "newer": (462, 8), "older": (454, 8)}[talk.name.split("_")[0]]
    talk.read(one, "DB", 1, 0, 600)
    talk.read(one, "DB", 1, 0, 462)
    talk.write(
        two, "DB", 1, start, bytes(255 - each for each in content(1000)[start : start + size])
    )
    talk.read(one, "DB", 1, 462, 138)


@scene("tornput_cpp_pure_cpp", "tornput_pure_cpp_pure")
def between_writes(talk: Talk, writer: str, reader: str, server: str) -> None:
    """A write by two jobs, and a read of another client between them, of bytes of both."""
    talk.server(server)
    one, two = talk.client(writer, 480), talk.client(reader, 480)
    most = WRITES[writer][480]
    data = bytes(255 - each for each in content(600))
    talk.read(two, "DB", 1, most - 20, 40)
    talk.write(one, "DB", 1, 0, data[:most])
    talk.read(two, "DB", 1, most - 20, 40)
    talk.write(one, "DB", 1, most, data[most:])
    talk.read(two, "DB", 1, most - 20, 40)


@scene("identity_cpp_cpp", "identity_pure_cpp", "identity_pure_pure")
def identity(talk: Talk, client: str, server: str) -> None:
    """What a server says of itself, beside a read: no job of ours."""
    talk.server(server)
    end = talk.client(client, 480)
    for number, index in ((0x0011, 0), (0x001C, 0), (0x0131, 3), (0x0232, 4)):
        talk.log(
            end,
            "szl",
            {"id": number, "index": index},
            end.ask("szl", number=number, index=index),
            [],
        )
    # python-snap7 3.3.0 asks for the state by a read that has no number of items and no item
    talk.log(end, "cpu", {}, end.ask("cpu"), [] if client == "cpp" else [[]])
    talk.read(end, "DB", 1, 0, 8)


@scene("refused_pure_cpp", "refused_cpp_pure")
def refused(talk: Talk, client: str, server: str) -> None:
    """A server that takes one client; another comes."""
    talk.server(server, clients=1)
    one = talk.client(client, 480)
    talk.read(one, "DB", 1, 0, 4)
    talk.client(client, 480, slot=5)
    talk.read(one, "DB", 1, 4, 4)


SENT = (10, 443, 444, 445, 890, 891, 2000, 10000, 30000)
"""Bytes of each BSEND: around one and two segments at 480, and more."""


@scene("bsend_cpp_cpp")
def sent(talk: Talk, active: str, passive: str) -> None:
    """BSEND from both ends."""
    one, two = talk.partners(active, passive)
    for number, size in enumerate(SENT):
        talk.send(one, two, 0x100 + number, content(size))
    for size in (10, 1000):
        talk.send(two, one, 0x7700, content(size, 9))


@scene("bsend_cpp_pure", "bsend_pure_cpp", "bsend_pure_pure")
def sent_once(talk: Talk, active: str, passive: str) -> None:
    """BSEND of one segment between the two stacks; longer ones the stack in Python sends as one PDU."""
    one, two = talk.partners(active, passive)
    for number, size in enumerate((10, 443) if active == "cpp" else (10, 443, 2000, 30000)):
        talk.send(one, two, 0x200 + number, content(size))


@contextmanager
def recorded(path: Path) -> Iterator[None]:
    """What goes over the loopback meanwhile, into a file without a word of who recorded it and where."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder, "raw.pcap")
        dumpcap = subprocess.Popen(
            ["dumpcap", "-q", "-i", "lo", "-P", "-w", str(raw), "-f", "tcp port 102"],
            stderr=subprocess.PIPE,
            text=True,
        )
        assert dumpcap.stderr is not None
        while "File:" not in dumpcap.stderr.readline():
            if dumpcap.poll() is not None:
                raise RuntimeError("dumpcap does not record")
        try:
            yield
            time.sleep(0.7)  # it hands packets over in portions
        finally:
            dumpcap.send_signal(signal.SIGINT)
            dumpcap.wait()
        rewrite(raw.read_bytes(), path)


def rewrite(raw: bytes, path: Path) -> None:
    """A little-endian pcap with microseconds as pcapng: the frames and times, and nothing else."""
    magic, *_, link = struct.unpack("<IHHiIII", raw[:24])
    if (magic, link) != (0xA1B2C3D4, 1):
        raise RuntimeError(f"pcap {magic:08x}, link type {link}")
    with PcapngWriter(path, link_type=link, nanosecond=False) as writer:
        at = 24
        while at < len(raw):
            seconds, micro, kept, length = struct.unpack_from("<4I", raw, at)
            at += 16
            writer.write((seconds * 1_000_000 + micro) * 1000, raw[at : at + kept], length)
            at += kept


def record(name: str, folder: Path, pythons: dict[str, str]) -> list[dict[str, Any]]:
    """One capture and its lines."""
    talk = Talk(name, pythons)
    with recorded(folder / f"{name}.pcapng"):
        try:
            SCENES[name][1](talk)
        finally:
            talk.close()
    return talk.lines


ENDS = {"cpp": "C++ Snap7", "pure": "python-snap7 3.3.0"}
HEAD = """\
# Captures of two S7 stacks that talk to themselves and to each other, README.md here.
# Written by tools/oracles/record.py. EXPECTED.jsonl is the log of what the ends were told and gave back.
"""


def manifest_entry(path: Path) -> str:
    """The TOML table of one capture."""
    data = path.read_bytes()
    frames = sum(1 for kind, _ in blocks(data) if kind == 6)
    ends = [ENDS[word] for word in path.stem.split("_") if word in ENDS]
    return f"""
[[capture]]
file = "{path.name}"
sha256 = "{hashlib.sha256(data).hexdigest()}"
frames = {frames}
made = "recorded between real stacks, see README.md"
title = {json.dumps(SCENES[path.stem][0])}
shows = "{", ".join(ends)}"
log = "EXPECTED.jsonl"
"""


def blocks(data: bytes) -> Iterator[tuple[int, int]]:
    """Kind and length of the blocks of a little-endian pcapng."""
    at = 0
    while at < len(data):
        kind, length = struct.unpack_from("<2I", data, at)
        yield kind, length
        at += length


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("pure", help="Python of the environment with python-snap7 3.x")
    parser.add_argument("cpp", help="that with 2.1.0")
    parser.add_argument("--only", action="append", help="a capture; the log has its lines only")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.inside:
        root = [] if os.geteuid() == 0 else ["--map-root-user"]
        os.execvp("unshare", ["unshare", *root, "--net", sys.executable, *sys.argv, "--inside"])
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for name in arguments.only or SCENES:
        found = record(name, arguments.folder, {"pure": arguments.pure, "cpp": arguments.cpp})
        print(f"{name}: {len(found)} calls", flush=True)
        lines += found
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (arguments.folder / "EXPECTED.jsonl").write_text(text, encoding="utf-8")
    entries = (manifest_entry(path) for path in sorted(arguments.folder.glob("*.pcapng")))
    (arguments.folder / "MANIFEST.toml").write_text(HEAD + "".join(entries), encoding="utf-8")


if __name__ == "__main__":
    main()
