"""`ds47 watch`: every transaction at once, from a slow pipe and from the loopback interface, for days."""

from __future__ import annotations

import io
import json
import os
import queue
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import jsonschema
import pytest
from frames import whole_frames
from handmade import finding
from test_readme import Command, read_commands, run

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import PcapngWriter, open_capture
from ds47.cli import main
from ds47.lab import message
from ds47.lab.client import BUSY, Client
from ds47.lab.ether import Host
from ds47.lab.stage import Stage
from ds47.live import dumpcap
from ds47.live.show import NdjsonShow, Tally
from ds47.live.traffic import Live
from ds47.model import Finding, Transaction
from ds47.report import schema
from ds47.report.contract import FINDING, TRANSACTION
from ds47.report.sentences import sentence

ROOT = Path(__file__).resolve().parents[2]
CAPTURES = ROOT / "captures"
TOUR = CAPTURES / "tour-machine.pcapng"
PAGE = ROOT / "docs" / "watch.md"
LINE = jsonschema.Draft202012Validator(schema("transaction-2"))
SOON = 2.0
"""Seconds within which a line has to be there; on this many cores with others one is not always enough."""

posix = pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")


class Watch:
    """A running `ds47 watch`, its lines as they come."""

    def __init__(self, *arguments: str, stdin: int | None = subprocess.PIPE) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "ds47", "watch", *arguments],
            stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
            env={**os.environ, "PYTHONUTF8": "1", "NO_COLOR": "1"},
        )  # fmt: skip
        self.lines: queue.Queue[str] = queue.Queue()
        self.errors: queue.Queue[str] = queue.Queue()
        for stream, lines in (
            (self.process.stdout, self.lines), (self.process.stderr, self.errors),
        ):  # fmt: skip
            threading.Thread(target=self._collect, args=(stream, lines), daemon=True).start()

    @staticmethod
    def _collect(stream: io.RawIOBase, lines: queue.Queue[str]) -> None:
        for line in io.TextIOWrapper(io.BufferedReader(stream), encoding="utf-8"):
            if not line.endswith(" first transaction\n"):  # the zone, told before the first one
                lines.put(line.rstrip("\n"))

    def write(self, data: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(data)
        self.process.stdin.flush()

    def line(self, seconds: float = 10.0) -> str:
        return self.lines.get(timeout=seconds)

    def rest(self) -> list[str]:
        """Ends its input and gives all that it still says."""
        if self.process.stdin is not None:
            self.process.stdin.close()
        self.process.wait(30)
        time.sleep(0.1)
        return [self.lines.get_nowait() for _ in range(self.lines.qsize())]


@contextmanager
def watching(*arguments: str, stdin: int | None = subprocess.PIPE) -> Iterator[Watch]:
    watch = Watch(*arguments, stdin=stdin)
    try:
        yield watch
    finally:
        watch.process.kill()
        watch.process.wait()


def blocks(path: Path) -> list[bytes]:
    """The blocks of a little-endian pcapng, each alone."""
    data, found = path.read_bytes(), []
    while data:
        (total,) = struct.unpack_from("<I", data, 4)
        found.append(data[:total])
        data = data[total:]
    return found


PAUSES = (0.12, 0.6, 2.5)
"""Seconds in which a line has to come; a busy machine gets more of them before that is an error."""


def after_each_frame(path: Path, pause: float) -> list[list[str]]:
    """What is printed after each frame, when nothing comes for a while."""
    first, second, *frames = blocks(path)
    out = []
    with watching("-") as watch:
        watch.write(first + second + frames[0])
        time.sleep(12 * pause)  # until it runs
        for frame in [*frames[1:], None]:
            time.sleep(pause)
            out.append([watch.lines.get_nowait() for _ in range(watch.lines.qsize())])
            if frame is not None:
                watch.write(frame)
        out.append(watch.rest())
    return out


@pytest.mark.slow
def test_a_line_comes_with_the_last_frame_of_its_transaction() -> None:
    result = analyze(TOUR)
    last = {f"#{each.id}": max(each.frames.all()) for each in result.transactions}
    del last["#8"]  # nobody read it: only the end tells
    for pause in PAUSES:
        said = after_each_frame(TOUR, pause)
        starts = {line.split()[0]: number for number, lines in enumerate(said, 1)
                  for line in lines if line.startswith("#")}  # fmt: skip
        end = starts.pop("#8")
        if starts == last:
            break
    assert starts == last
    assert end > 35


def said_of(lines: list[str]) -> dict[str, list[str]]:
    """The words of each transaction; where a line is broken depends on what else is known."""
    found: dict[str, list[str]] = {}
    for line in lines:
        if line.startswith("#"):
            found[line.split()[0]] = line.split()
        elif line.startswith("      p"):
            found[[*found][-1]] += line.split()
    return {
        number: [each for each in words if each not in ("1", "parameter")]
        for number, words in found.items()
    }


def test_lines_are_those_of_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(TOUR)]) == 0
    report = said_of(capsys.readouterr().out.splitlines())
    done = subprocess.run([sys.executable, "-m", "ds47", "watch", "-"], input=TOUR.read_bytes(),
                          capture_output=True, timeout=60, check=True)  # fmt: skip
    lines = done.stdout.decode().splitlines()
    assert lines[0] == "2026-01-01 08:00:00.001 +00:00 (local) first transaction"
    watched = said_of(lines)
    assert len(watched) == 8
    for number, words in watched.items():
        seconds = report[number].pop(
            2
        )  # since the first frame, which nobody sees of a live capture
        assert float(seconds) < 2
        assert sorted(words) == sorted(report[number])
    for words in ("8 transactions: 4 ok, 1 partial, 1 error, 1 refused, 1 unanswered",
                  "9 findings: 5 error, 2 warning, 2 note", '"press-1-drive"'):  # fmt: skip
        assert words in done.stdout.decode()


@pytest.mark.parametrize("source", sorted(CAPTURES.rglob("*.pcapng")), ids=lambda p: p.stem)
def test_watch_and_report_say_the_same(source: Path, tmp_path: Path) -> None:
    """The last line of each transaction, and all findings, are those of the report."""
    from ds47.analysis import AnalysisOptions
    from ds47.capture import open_capture
    from ds47.live.traffic import Live

    out = io.StringIO()
    show = NdjsonShow(out, "x", io.StringIO())
    with open_capture(source) as capture:
        show.end(Live(AnalysisOptions(), show).watch(capture))
    lines = [json.loads(line) for line in out.getvalue().splitlines()]
    last = {
        line["transaction"]["id"]: line["transaction"] for line in lines if "transaction" in line
    }
    told: list[object] = []
    result = analyze(source)

    def comparable(start: str, frames: object, state: str, findings: list[str]) -> str:
        """DS101 comes when its call is given up, perhaps long behind the transaction: by itself then."""
        at_once = [each for each in findings if each != "DS101"]
        return json.dumps([start, frames, state, at_once], sort_keys=True)

    wanted = [TRANSACTION.plain(each) for each in result.transactions]
    assert sorted(
        comparable(e["start"], e["frames"], e["state"], e["findings"]) for e in last.values()
    ) == sorted(comparable(e["start"], e["frames"], e["state"], e["findings"]) for e in wanted)
    for line in lines:
        told += line.get("findings", []) + ([line["finding"]] if "finding" in line else [])
    seen = {(each["rule"], each["frame"], each["message"]) for each in told}  # type: ignore[index]
    reported = [FINDING.plain(each) for each in result.findings]
    assert seen == {(each["rule"], each["frame"], each["message"]) for each in reported}
    assert show.tally.severities.total() == len(reported)
    assert +show.tally.states == {
        state: number for state, number in result.summary.items() if state in show.tally.states
    }
    assert lines[-1]["capture"]["summary"] == result.summary


@pytest.mark.slow
def test_a_refused_write_is_told_at_once() -> None:
    for pause in PAUSES:
        *_, said, _ = after_each_frame(CAPTURES / "record-write-refused.pcapng", pause)
        if len(said) > 1:  # the transaction and its finding
            break
    assert "[refused DF80B700]" in said[0]
    assert "DS203" in said[1]


def test_a_transaction_that_is_read_again_comes_again_as_ndjson() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ds47", "watch", "-", "-f", "ndjson"],
        input=(CAPTURES / "record-reread.pcapng").read_bytes(), capture_output=True, timeout=60,
        check=True,
    )  # fmt: skip
    first, found, second, end = map(json.loads, done.stdout.splitlines())
    for line in (first, found, second, end):
        LINE.validate(line)
    assert found["finding"]["rule"] == "DS704"
    assert first["transaction"]["id"] == second["transaction"]["id"] == 1
    assert (len(first["transaction"]["frames"]["rereads"]),
            len(second["transaction"]["frames"]["rereads"])) == (0, 2)  # fmt: skip
    assert end["capture"]["summary"]["transactions"] == 1


class Told:
    """A listener that keeps what it hears."""

    def __init__(self) -> None:
        self.findings: list[tuple[str, int, str]] = []

    def finished(self, _transaction: Transaction, findings: list[Finding]) -> None:
        for each in findings:
            self.found(each)

    def changed(self, before: Transaction, after: Transaction, findings: list[Finding]) -> None: ...

    def found(self, finding: Finding) -> None:
        self.findings.append((finding.rule, finding.frame, sentence(finding)))


def test_diagnoses_are_told_as_findings_and_counted_at_the_end() -> None:
    rules = set[str]()
    for path in sorted(CAPTURES.glob("diagnosis-*.pcapng")):
        listener, expected = Told(), list[Finding]()

        def finished(
            _transaction: Transaction, findings: list[Finding], expected: list[Finding] = expected
        ) -> None:
            expected += findings

        report = analyze(path, on_transaction=finished)
        with open_capture(path) as capture:
            result = Live(AnalysisOptions(), listener).watch(capture)
        wanted = [
            (each.rule, each.frame, sentence(each))
            for each in expected + report.findings
            if each.rule.startswith("DS7")
        ]
        told = [each for each in listener.findings if each[0].startswith("DS7")]
        assert sorted(told) == sorted(wanted), path.name
        assert result.diagnoses == report.diagnoses, path.name
        rules |= {each.rule for each in result.diagnoses}
    assert len(rules) == 25


@pytest.mark.slow
def test_every_line_of_ndjson_is_in_the_schema() -> None:
    kinds = Counter[str]()
    for name in ("real-stacks/o1_profinetpy062_be", "message-empty", "record-length"):
        done = subprocess.run(
            [sys.executable, "-m", "ds47", "watch", "-", "-f", "ndjson"],
            input=(CAPTURES / f"{name}.pcapng").read_bytes(), capture_output=True, timeout=60,
            check=True,
        )  # fmt: skip
        for line in map(json.loads, done.stdout.splitlines()):
            LINE.validate(line)
            kinds[next(kind for kind in ("transaction", "finding", "capture") if kind in line)] += 1
    assert kinds["transaction"] > 50
    assert kinds["finding"] > 5
    assert kinds["capture"] == 3


def test_ndjson_is_flushed_per_line() -> None:
    first, second, *frames = blocks(TOUR)
    with watching("-", "-f", "ndjson") as watch:
        watch.write(first + second + b"".join(frames[:5]))
        line = json.loads(watch.line())
        assert line["transaction"]["state"] == "ok"
        assert line["path"] == "-"


def test_bytes_one_by_one() -> None:
    data = b"".join(blocks(TOUR)[:7])
    with watching("-") as watch:
        for at in range(0, len(data), 7):
            watch.write(data[at : at + 7])
        assert watch.line().startswith("#1 ")


def test_a_pcap_stream_too(tmp_path: Path) -> None:
    frames = list(whole_frames(TOUR))
    data = struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1)
    with watching("-") as watch:
        watch.write(data)
        for frame in frames[:5]:
            seconds, fraction = divmod(frame.time_ns, 10**9)
            size = len(frame.data)
            watch.write(struct.pack("<4I", seconds, fraction, size, size) + frame.data)
        assert watch.line().startswith("#1 ")


@posix
def test_a_named_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with watching(str(pipe), stdin=subprocess.DEVNULL) as watch:
        with pipe.open("wb") as stream:
            stream.write(TOUR.read_bytes())
        assert watch.line().startswith("#1 ")
        assert watch.process.wait(20) == 0


@posix
def test_a_file_is_followed_as_it_grows(tmp_path: Path) -> None:
    parts = blocks(TOUR)
    path = tmp_path / "growing.pcapng"
    path.write_bytes(b"".join(parts[:7]) + parts[7][:20])
    with watching(str(path), stdin=subprocess.DEVNULL) as watch:
        assert watch.errors.get(timeout=10).startswith(f"ds47: {path} is followed as it grows; ")
        assert watch.line().startswith("#1 ")
        time.sleep(0.6)  # it has seen the end of the file, and more than once
        assert watch.lines.empty()
        with path.open("ab", buffering=0) as stream:
            stream.write(parts[7][20:] + b"".join(parts[8:]))
        assert watch.line(SOON).startswith("#2 ")
        watch.process.send_signal(signal.SIGINT)
        assert watch.process.wait(10) == 0
        assert "Summary of 37 frames" in watch.rest()
        assert watch.errors.empty()


@posix
def test_a_file_that_is_followed_may_be_empty_yet(tmp_path: Path) -> None:
    path = tmp_path / "new.pcapng"
    path.touch()
    with watching(str(path), stdin=subprocess.DEVNULL) as watch:
        watch.errors.get(timeout=10)
        path.write_bytes(TOUR.read_bytes())
        assert watch.line(SOON).startswith("#1 ")


@posix
def test_a_followed_file_that_is_written_anew_is_told(tmp_path: Path) -> None:
    path = tmp_path / "again.pcapng"
    shutil.copy(TOUR, path)
    with watching(str(path), stdin=subprocess.DEVNULL) as watch:
        watch.line()
        path.write_bytes(b"")
        assert watch.process.wait(10) == 3
        watch.errors.get(timeout=5)
        assert watch.errors.get(timeout=5) == (
            f"ds47: error: {path}: the file became shorter while it was followed"
        )


# Ending, and looking in between


@posix
def test_a_summary_on_demand_and_ctrl_c() -> None:
    data = b"".join(blocks(TOUR)[:7])
    with watching("-") as watch:
        watch.write(data)
        assert watch.line().startswith("#1 ")
        watch.process.send_signal(signal.SIGUSR1)
        assert watch.line(SOON) == "Summary of 5 frames"
        assert "1 transaction: 1 ok; 1 read" in watch.line()
        watch.process.send_signal(signal.SIGINT)
        assert watch.process.wait(10) == 0
        said = watch.rest()
        assert "Summary of 5 frames" in said
        assert watch.errors.empty()


@posix
def test_ctrl_c_in_the_middle_of_a_frame_is_no_fault() -> None:
    data = b"".join(blocks(TOUR)[:7]) + blocks(TOUR)[7][:20]
    with watching("-") as watch:
        watch.write(data)
        watch.line()
        watch.process.send_signal(signal.SIGTERM)
        assert watch.process.wait(10) == 0
        assert watch.errors.empty()


@posix
def test_enter_on_a_terminal_shows_a_summary(tmp_path: Path) -> None:
    import pty

    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    master, slave = pty.openpty()
    with watching(str(pipe), stdin=slave) as watch, pipe.open("wb", buffering=0) as stream:
        stream.write(b"".join(blocks(TOUR)[:7]))
        watch.line()
        os.write(master, b"\n")
        assert watch.line(SOON) == "Summary of 5 frames"
    os.close(master)
    os.close(slave)


def test_a_stream_that_breaks_off_is_told() -> None:
    with watching("-") as watch:
        watch.write(b"".join(blocks(TOUR)[:7]) + blocks(TOUR)[7][:20])
        said = watch.rest()
        assert watch.process.returncode == 3
        assert any(line.startswith("#1 ") for line in said)
        assert "needs" in watch.errors.get(timeout=5)


def test_exit_statuses(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    tour = ["watch", str(TOUR), "--no-follow"]
    assert main(tour) == 0
    assert main([*tour, "--fail-on", "error"]) == 1
    assert main([*tour, "--fail-on", "error", "--select", "DS1", "--select", "DS3"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["watch"]) == 2
    assert main(["watch", "-", "-i", "lo"]) == 2
    assert main(["watch", "-", "--duration", "3"]) == 2
    assert main(["watch", "-i", "lo", "--duration", "-3"]) == 2
    assert main(["watch", str(tmp_path / "nowhere")]) == 2
    (tmp_path / "text").write_text("this is no capture")
    assert main(["watch", str(tmp_path / "text")]) == 3
    assert "not a capture" in capsys.readouterr().err


def test_nothing_at_all_on_stdin() -> None:
    with watching("-") as watch:
        assert watch.rest() == []
        assert watch.process.returncode == 3
        assert "empty" in watch.errors.get(timeout=5)


# Memory


SEQUENCE = 42 + 64
"""Where the sequence number stands in an Ethernet frame with an RPC PDU."""


def long_stream(rounds: int) -> Iterator[bytes]:
    """A pcapng stream of `rounds` times 250 transactions on ever new time, half an hour apart."""
    stage = Stage()
    client = Client(stage)
    for number in range(250):
        reference = number % 254 + 1
        client.exchange(message.read(reference, 1, message.address(21)),
                        message.answer(reference, 1, 1, message.real(float(number))))  # fmt: skip
        if number % 10 == 0:
            client.write(message.read(255, 1, message.address(22)), status=0xDF80B500)
        if number % 25 == 0:
            client.poll(BUSY, at=client.at(slot=number))
    buffer = io.BytesIO()
    writer = PcapngWriter(buffer)
    yield buffer.getvalue()
    for number in range(rounds):
        buffer.seek(0)
        buffer.truncate()
        for shot in stage.shots:
            data = bytearray(shot.data)
            (call,) = struct.unpack_from("<I", data, SEQUENCE)
            struct.pack_into("<I", data, SEQUENCE, call + 10_000 * number)
            writer.write(shot.time_ns + number * 1800 * 10**9, bytes(data))
        yield buffer.getvalue()


def resident(process: int) -> int:
    """Kilobytes of memory that a process has."""
    text = Path(f"/proc/{process}/status").read_text()
    return int(text.split("VmRSS:")[1].split()[0])


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize("form", ["text", "ndjson"])
def test_memory_is_steady(form: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "ds47", "watch", "-", "-f", form],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    assert process.stdin is not None
    sizes = []
    for number, piece in enumerate(long_stream(36)):
        process.stdin.write(piece)
        if number % 6 == 0:
            sizes.append(resident(process.pid))
    process.stdin.flush()
    time.sleep(0.5)
    sizes.append(resident(process.pid))
    process.stdin.close()
    assert process.wait(60) == 0
    # 9,000 transactions in 37,000 frames: 0.4 kB of each would be 2.4 MB from the third on
    assert sizes[-1] - sizes[2] < 2_400, sizes


EVER_NEW = """
import struct, sys
from ds47.analysis import Analysis, AnalysisOptions, Early
from ds47.capture import Frame, open_capture
from ds47.spec.semantics import limits

class Endless:
    path, complete, problem, dropped, gaps, timed = "x", True, None, None, False, True
    excerpt = False
    first_ns = last_ns = None
    frames = 0
    def tcp(self, ports):
        pass
    def __iter__(self):
        exchange = [bytearray(frame.data) for frame in open_capture(sys.argv[1]).everything()]
        for activity in range(int(1.5 * limits().activities)):
            for call in range(8):
                for data in exchange[2 * (call % 2):][:2]:
                    self.frames += 1
                    order = "<I" if data[46] & 0x10 else ">I"
                    data[82:86] = struct.pack("<I", activity)
                    data[106:110] = struct.pack(order, call)
                    data[18:20] = struct.pack(">H", self.frames & 0xFFFF)
                    yield Frame(self.frames, 10**18 + self.frames * 2_000_000, 1, bytes(data), len(data))

done = []
count = lambda *_: done.append(None)
result = Analysis(AnalysisOptions(), count, Early(count, count)).run(Endless())
assert result.rpc["requests"] == 8 * int(1.5 * limits().activities), result.rpc
text = open("/proc/self/status").read()
print(int(text.split("VmHWM:")[1].split()[0]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_a_controller_that_never_uses_an_activity_twice_takes_little_memory() -> None:
    exchange = CAPTURES / "seed-g120-read.pcapng"
    command = [sys.executable, "-c", EVER_NEW, str(exchange)]
    done = subprocess.run(command, capture_output=True, timeout=120, check=True)
    assert int(done.stdout) < 100_000, "kB"


def test_a_summary_on_demand_is_chinese_where_the_lines_are_for_programs() -> None:
    lines, aside = io.StringIO(), io.StringIO()
    show = NdjsonShow(lines, "eth0", aside, "zh")
    show.found(finding("DS105", "warning", "文", 1))
    show.summary(3)
    assert aside.getvalue() == "3 帧的汇总\n  0 个任务\n  1 个结论：1 警告；DS105 1\n"
    assert json.loads(lines.getvalue())["finding"]["severity"] == "warning"


def test_durations_are_kept_by_number_of_digits() -> None:
    tally = Tally()
    (item,) = analyze(CAPTURES / "record-global.pcapng").transactions
    for number in range(20_000):
        item.duration_ns = 3_000_000 + number * 17
        tally.transaction(item)
    assert len(tally._latency._times) < 40
    assert "p50 3.2 ms, p95 3.3 ms, p99 3.3 ms, max 3.3 ms" in tally.lines(0, "en")[-1]
    assert tally.lines(0, "zh")[-1] == "  耗时 p50 3.2 ms，p95 3.3 ms，p99 3.3 ms，最长 3.3 ms"


# dumpcap


def needs_dumpcap() -> str:
    program = shutil.which("dumpcap")
    if program is None or not sys.platform.startswith("linux"):
        pytest.skip("needs dumpcap and a loopback interface named lo")
    test = subprocess.run([program, "-i", "lo", "-a", "duration:0.1", "-w", os.devnull, "-q"],
                          capture_output=True, check=False, timeout=60)  # fmt: skip
    if test.returncode:
        pytest.skip(f"dumpcap may not capture here: {test.stderr.decode()[-200:]}")
    return program


@dataclass(slots=True)
class Loopback(Stage):
    """A stage on the loopback interface: what is said goes through UDP sockets."""

    sockets: dict[tuple[str, int], socket.socket] = field(default_factory=dict)

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        sport, dport = ports or (source.port, target.port)
        self._socket(source.ip, sport).sendto(payload, (target.ip, dport))
        time.sleep(0.005)

    def _socket(self, ip: str, port: int) -> socket.socket:
        if (ip, port) not in self.sockets:
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            made.bind((ip, port))
            self.sockets[ip, port] = made
        return self.sockets[ip, port]


@contextmanager
def loopback() -> Iterator[Client]:
    stage = Loopback()
    client = Client(stage)
    client.host = Host("127.0.0.1", "00:00:00:00:00:00", port=49347)
    client.device = Host("127.0.0.2", "00:00:00:00:00:00", port=34964)
    stage._socket("127.0.0.2", 34964)
    stage._socket("127.0.0.1", 49347)
    try:
        yield client
    finally:
        for made in stage.sockets.values():
            made.close()


def say(client: Client, number: int, value: float) -> None:
    asked = message.read(number, 2, message.address(50303, 0, 1))
    client.exchange(asked, message.answer(number, 1, 2, message.real(value)))


def started(watch: Watch, client: Client) -> str:
    """Says transactions until one is heard: dumpcap needs a while to open the interface."""
    for number in range(1, 60):
        say(client, number, float(number))
        end = time.monotonic() + 0.5
        with suppress(queue.Empty):  # a capture may begin inside of a transaction: not that one
            while time.monotonic() < end:
                line = watch.line(0.5)
                whole = "orphan" not in line
                if whole and (line.startswith("#") or '"transaction": {' in line):
                    return line
    raise AssertionError([watch.errors.get_nowait() for _ in range(watch.errors.qsize())])


@pytest.mark.slow
def test_on_the_loopback_interface() -> None:
    needs_dumpcap()
    with loopback() as client, watching("-i", "lo", stdin=subprocess.DEVNULL) as watch:
        assert "127.0.0.2 DO 2  p50303[0]" in started(watch, client)
        time.sleep(0.5)
        while not watch.lines.empty():
            watch.lines.get()
        for value in (1.5, 2.5, 3.5):
            begin = time.monotonic()
            say(client, 200 + int(value), value)
            line = watch.line(SOON)
            assert f"= {value}" in line
            assert time.monotonic() - begin < SOON
        watch.process.send_signal(signal.SIGINT)
        assert watch.process.wait(20) == 0
        assert any("transactions:" in line for line in watch.rest())
        assert watch.errors.empty()


def test_a_pipe_from_dumpcap() -> None:
    program = needs_dumpcap()
    words = [program, "-i", "lo", "-q", "-w", "-"]
    with (
        subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as source,
        loopback() as client,
        watching("-", "-f", "ndjson", stdin=source.stdout.fileno()) as watch,  # type: ignore[union-attr]
    ):
        line = json.loads(started(watch, client))
        assert line["transaction"]["device"] == "127.0.0.2"
        source.terminate()
        assert watch.process.wait(20) == 0


@pytest.mark.slow
def test_an_end_after_a_time() -> None:
    needs_dumpcap()
    with watching("-i", "lo", "--duration", "1", stdin=subprocess.DEVNULL) as watch:
        assert watch.process.wait(30) == 0
        assert any(line.startswith("Summary") for line in watch.rest())


def test_an_interface_that_is_not_there() -> None:
    needs_dumpcap()
    with watching("-i", "nowhere0", stdin=subprocess.DEVNULL) as watch:
        assert watch.process.wait(30) == 3
        said = watch.errors.get(timeout=5)
        assert 'no device named "nowhere0"' in said
        assert "dumpcap -D" in said


def test_the_filter_is_one(tmp_path: Path) -> None:
    """And it leaves out the cyclic data, with and without a tag."""
    program = needs_dumpcap()
    for name in ("lo", "any"):
        words = dumpcap.arguments([name], None)
        given = words[words.index("-f") + 1]
        done = subprocess.run([program, "-i", name, "-f", given, "-d"], capture_output=True,
                              check=False, timeout=30)  # fmt: skip
        assert done.returncode == 0, done.stderr


def test_the_filter_keeps_what_matters(tmp_path: Path) -> None:
    """libpcap itself, through scapy's reader or tcpdump where there is one."""
    tcpdump = shutil.which("tcpdump")
    if tcpdump is None:
        pytest.skip("needs tcpdump")
    import frames as make

    fragment = make.ethernet(0x0800, make.ipv4(b"x" * 24, offset=800))
    tagged = make.ethernet(0x8100, b"\0\1\x08\0" + make.ipv4(make.udp(make.rpc())))
    dcp = make.ethernet(0x8100, b"\xc0\0\x88\x92\xfe\xfd" + bytes(40))
    kept = [make.call(), fragment, tagged, dcp, make.DCP, make.LLDP]
    left = [make.RT, make.RT_TAGGED, make.ethernet(0x0806, bytes(46))]
    source, target = tmp_path / "in.pcap", tmp_path / "out.pcap"
    source.write_bytes(make.pcap([*kept, *left]))
    subprocess.run([tcpdump, "-r", source, "-w", target, dumpcap.CAPTURE_FILTER], check=True,
                   capture_output=True, timeout=60)  # fmt: skip
    assert [frame.data for frame in whole_frames(target)] == kept


def test_without_dumpcap(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(shutil, "which", lambda *_, **__: None)
    monkeypatch.setattr(dumpcap, "usual_folders", lambda *_: [])
    assert main(["watch", "-i", "eth0"]) == 3
    assert "apt install wireshark-common" in capsys.readouterr().err
    assert main(["watch", "-i", "eth0", "--dumpcap", "nothing"]) == 3
    assert "nothing is not a program" in capsys.readouterr().err


@posix
def test_without_permission(tmp_path: Path) -> None:
    fake = tmp_path / "dumpcap"
    fake.write_text(
        "#!/bin/sh\necho \"dumpcap: The capture session could not be initiated on interface 'eth0' "
        "(You don't have permission to capture on that device).\" >&2\nexit 1\n"
    )
    fake.chmod(0o755)
    with watching("-i", "eth0", "--dumpcap", str(fake), stdin=subprocess.DEVNULL) as watch:
        assert watch.process.wait(30) == 3
        said = watch.errors.get(timeout=5)
        assert "permission" in said
        if sys.platform.startswith("linux"):
            assert "group wireshark" in said
            assert "sudo dumpcap -i eth0 -w - | ds47 watch -" in said


@posix
def test_dumpcap_that_dies_in_between(tmp_path: Path) -> None:
    fake = tmp_path / "dumpcap"
    fake.write_text(
        f"#!/bin/sh\ncat '{TOUR}'\necho 'dumpcap: The network adapter is no longer running' >&2\nexit 2\n"
    )
    fake.chmod(0o755)
    with watching("-i", "eth0", "--dumpcap", str(fake), stdin=subprocess.DEVNULL) as watch:
        assert watch.process.wait(30) == 3
        assert sum(line.startswith("#") for line in watch.rest()) == 8
        assert "no longer running" in watch.errors.get(timeout=5)


@posix
@pytest.mark.parametrize("noisy", [False, True], ids=["silent", "never silent"])
def test_dumpcap_that_does_not_end(tmp_path: Path, noisy: bool) -> None:
    """It knows no duration and no TERM."""
    fake = tmp_path / "dumpcap"
    goes_on = f"while :; do tail -c +{len(b''.join(blocks(TOUR)[:2])) + 1} '{TOUR}'; done"
    fake.write_text(
        f"#!/bin/sh\ntrap '' TERM INT\ncat '{TOUR}'\n{goes_on if noisy else 'exec sleep 90'}\n"
    )
    fake.chmod(0o755)
    words = ("-i", "eth0", "--dumpcap", str(fake), "--duration", "0.5")
    with watching(*words, stdin=subprocess.DEVNULL) as watch:
        assert watch.line(30).startswith("#")
        begin = time.monotonic()
        assert watch.process.wait(45) == 0
        assert time.monotonic() - begin < 30
        lines = [watch.lines.get_nowait() for _ in range(watch.lines.qsize())]
        assert any("transactions:" in line for line in lines)
        assert watch.errors.empty()


@posix
@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("Capturing on eth0\ncannot open eth0: driver says 17", "status 1: cannot open eth0: driver says 17"),
        ("", "dumpcap ended with status 1"),
    ],
)  # fmt: skip
def test_what_dumpcap_said_is_shown(tmp_path: Path, said: str, shown: str) -> None:
    fake = tmp_path / "dumpcap"
    fake.write_text(f"#!/bin/sh\necho '{said}' >&2\nexit 1\n")
    fake.chmod(0o755)
    with watching("-i", "eth0", "--dumpcap", str(fake), stdin=subprocess.DEVNULL) as watch:
        assert watch.process.wait(30) == 3
        assert watch.errors.get(timeout=5).endswith(shown)


@posix
def test_a_summary_that_is_asked_for_too_early_ends_nothing() -> None:
    script = (
        "import os, signal, sys; sys.argv = ['ds47', 'watch', '-']; import ds47.cli;"
        "os.kill(os.getpid(), signal.SIGUSR1); sys.exit(ds47.cli.main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], input=TOUR.read_bytes(), capture_output=True, check=False
    )
    assert done.returncode == 0
    assert b"transactions:" in done.stdout


def test_arguments_for_dumpcap() -> None:
    words = dumpcap.arguments(["eth0", "eth1"], None, 2.5)
    assert words == ["-q", "-w", "-", "-f", dumpcap.CAPTURE_FILTER, "-i", "eth0", "-i", "eth1",
                     "-a", "duration:2.5"]  # fmt: skip
    assert "-f" not in dumpcap.arguments(["eth0"], "")
    assert dumpcap.arguments(["any"], None)[4] == "udp"


# The page


@pytest.fixture(scope="module")
def page_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("watch")
    shutil.copytree(CAPTURES, copy / "captures")
    return copy


@pytest.mark.slow
@pytest.mark.parametrize("command", read_commands(PAGE.read_text("utf-8")), ids=lambda c: c.line)
def test_command_of_the_page(command: Command, page_folder: Path) -> None:
    if " -i " in command.line:
        needs_dumpcap()
    if command.line.startswith("dumpcap"):
        _run_pipe(command.line)
        return
    status, output, errors = run(command, page_folder)
    assert status == command.status, errors
    assert "Traceback" not in errors
    lines = iter(output.splitlines())
    for line in command.output:
        if line.strip() not in ("", "..."):
            assert line.rstrip() in (each.rstrip() for each in lines), line


def _run_pipe(line: str) -> None:
    """dumpcap | ds47, on the loopback interface for a second."""
    first, second = (part.split() for part in line.split("|"))
    with subprocess.Popen([*first, "-a", "duration:1"], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL) as source:  # fmt: skip
        done = subprocess.run([sys.executable, "-m", *second], stdin=source.stdout,
                              capture_output=True, timeout=60, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
