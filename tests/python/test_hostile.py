"""Captures made to hurt: broken bytes, files cut anywhere, endless streams, texts that talk to a terminal."""

from __future__ import annotations

import csv
import gc
import io
import json
import random
import struct
import sys
import tracemalloc
from dataclasses import replace
from itertools import count
from uuid import UUID

import frames as make
import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47 import analysis, report
from ds47.acyclic.pairing import Pairing
from ds47.analysis import Analysis, AnalysisOptions, analyze
from ds47.capture import CaptureError, PcapngWriter, open_capture
from ds47.cli import main
from ds47.lab import message, wire
from ds47.model import Report
from ds47.profidrive import decode_request
from ds47.profinet import ip, rpc
from ds47.profinet.link import Packet
from ds47.profinet.records import Half, Peer, Record
from ds47.report.json import visible
from ds47.spec.semantics import limits
from ds47.spec.units import uuid_text

VALIDATOR = jsonschema.Draft202012Validator(report.schema())

# -- broken bytes -------------------------------------------------------------------------------

MUTATED = (
    "conversation-partial-change",
    "format-mixed",
    "message-error-words",
    "naming-all",
    "record-foreign-then-ours",
    "record-implicit-orphan",
    "record-multiple",
    "record-polls",
    "transport-big-little",
    "transport-ip-fragments-disorder",
    "transport-rpc-fragments",
    "transport-sll2",
    "transport-time-back",
    "transport-vlan",
)


def document(results, format_name="json"):
    out = io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace", newline="\n")
    options = report.ReportOptions(width=10_000)  # a line stays one, however long a text is
    report.write_all(report.open_writer(format_name, out, options), Report(results))
    out.flush()
    whole = out.buffer.getvalue()
    return whole if format_name == "parquet" else whole.decode("utf-8")


def is_valid(results):
    """The reports of every format can be written, and the JSON obeys the shipped schema."""
    for format_name in report.FORMATS:
        text = document(results, format_name)
        if format_name == "json":
            VALIDATOR.validate(json.loads(text))
    return True


def flip(dice, data):
    data = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 8))):
        if data:
            data[dice.randrange(len(data))] = dice.choice(
                (0, 1, 0x7F, 0x80, 0xFF, dice.getrandbits(8))
            )
    return bytes(data)


def length(dice, data):
    """A random number where a length may stand: two or four bytes, either order."""
    size = dice.choice((2, 4))
    if len(data) < size:
        return data
    number = dice.choice((0, 1, 2, 0xFF, 0xFFFF, len(data), dice.getrandbits(16)))
    at = dice.randrange(len(data) - size + 1)
    return data[:at] + number.to_bytes(size, dice.choice(("big", "little"))) + data[at + size :]


def cut(dice, data):
    return data[: dice.randrange(len(data) + 1)]


def grow(dice, data):
    at = dice.randrange(len(data) + 1)
    return data[:at] + dice.randbytes(dice.choice((1, 4, 64))) + data[at:]


def duplicate(dice, data):
    at = dice.randrange(len(data) + 1)
    return data[:at] + data[max(0, at - dice.randrange(1, 80)) : at] + data[at:]


CHANGES = (flip, flip, length, length, cut, grow, duplicate)


def mutated_frames(dice, frames):
    """Some frames changed behind their addresses, some twice, some gone, some elsewhere."""
    frames = list(frames)
    for _ in range(dice.randrange(1, 5)):
        at = dice.randrange(len(frames))
        kind = dice.randrange(8)
        frame = frames[at]
        if kind == 0:
            frames.insert(dice.randrange(len(frames) + 1), frame)
        elif kind == 1 and len(frames) > 1:
            del frames[at]
        elif kind == 2:
            frames.insert(dice.randrange(len(frames)), frames.pop(at))
        elif kind == 3:
            frames[at] = replace(
                frame, time_ns=max(0, frame.time_ns + dice.randrange(-(10**12), 10**12))
            )
        else:
            keep = dice.choice((0, 12, 34, 42, 82, 122, 142, 206))
            data = frame.data[:keep] + dice.choice(CHANGES)(dice, frame.data[keep:])
            frames[at] = replace(
                frame, data=data, original_length=max(frame.original_length, len(data))
            )
    return frames


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTATED)
def test_broken_frames_still_give_a_report(captures, name):
    dice = random.Random(name)
    with open_capture(captures / f"{name}.pcapng") as capture:
        originals = list(capture)
    results = []
    for _ in range(40):
        frames = mutated_frames(dice, originals)
        stream = io.BytesIO()
        with PcapngWriter(stream, frames[0].link_type) as writer:
            for frame in frames:
                writer.write(frame.time_ns, frame.data, frame.original_length)
        stream.seek(0)
        results.append(analyze(stream, AnalysisOptions(indices=frozenset({0xB02D}))))
        assert results[-1].complete
    assert is_valid(results)


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTATED)
def test_broken_files_give_a_report_or_say_why_not(captures, name):
    dice = random.Random(name)
    original = (captures / f"{name}.pcapng").read_bytes()
    results, refusals = [], []
    for _ in range(40):
        data = original[:28] + dice.choice(CHANGES)(dice, original[28:])
        if dice.random() < 0.1:
            data = flip(dice, data)
        try:
            result = analyze(io.BytesIO(data))
        except CaptureError as problem:
            refusals.append(problem.message)
            continue
        assert result.complete == (result.problem is None)
        results.append(result)
    assert all(text and "\n" not in text for text in refusals)
    assert is_valid(results)


@pytest.mark.parametrize(
    ("resolution", "offset", "stamp"),
    [(0, 0, 2**64 - 1), (0x80, 2**63 - 1, 2**64 - 1), (9, -(2**63), 0), (127, 0, 1), (255, -1, 5)],
)
def test_times_that_cannot_be(captures, resolution, offset, stamp):
    with open_capture(captures / "seed-g120-read.pcapng") as capture:
        frames = [frame.data for frame in capture]
    options = make.option(9, bytes([resolution])) + make.option(14, struct.pack("<q", offset))
    data = make.section() + make.interface(options=options + make.option(0, b""))
    data += b"".join(
        make.enhanced(frame, stamp=(stamp - number) % 2**64) for number, frame in enumerate(frames)
    )
    result = analyze(io.BytesIO(data))
    assert result.transactions
    assert is_valid([result])


# -- files cut anywhere -------------------------------------------------------------------------

CUT = (
    "conversation-partial-read",
    "format-mixed",
    "record-multiple",
    "transport-ip-fragments",
    "transport-two-controllers",
)


def block_ends(data):
    at = 0
    while at < len(data):
        at += int.from_bytes(data[at + 4 : at + 8], "little")
        yield at


@pytest.mark.parametrize("name", CUT)
def test_a_cut_file_is_reported_up_to_the_cut(captures, tmp_path, capsys, name):
    dice = random.Random(name)
    data = (captures / f"{name}.pcapng").read_bytes()
    ends = [0, *block_ends(data)]
    places = set(dice.sample(range(1, len(data)), 36)) | {1, 27, ends[1] + 1, len(data) - 1}
    path = tmp_path / "cut.pcapng"
    for place in sorted(places - set(ends)):
        whole = max(end for end in ends if end < place)
        path.write_bytes(data[:place])
        status = main(["report", "-f", "json", str(path)])
        out, err = capsys.readouterr()
        assert status == 3, place
        assert err.count("\n") == 1, err
        assert err.startswith("ds47: ")
        assert path.name in err
        shown = json.loads(out)["captures"]
        if not whole:
            assert shown == []
            continue
        path.write_bytes(data[:whole])
        assert main(["report", "-f", "json", str(path)]) == 0
        (expected,) = json.loads(capsys.readouterr().out)["captures"]
        assert shown == [expected | {"complete": False}], place


# -- endless streams ----------------------------------------------------------------------------

SECOND = 1_000_000_000
START = 1_767_225_600 * SECOND
CONTROLLER, DEVICE = "192.168.0.1", "192.168.0.2"
AR = UUID(int=1)
NODE = wire.object_uuid(7, 42)
SMALL = limits().but(
    activities=32,
    calls=8,
    answered_calls=32,
    datagrams=256,
    channels=32,
    pending_writes=8,
    waiting_calls=16,
    written_values=64,
    longest_messages=32,
    proven_ars=48,
    stations=64,
    reads=50,
    fragment_bytes=10_000,
)
"""The same limits, so small that a short stream is over all of them."""


class Wire:
    """Packets as `Packets` would give them, a millisecond apart."""

    def __init__(self):
        self.numbers = count(1)

    def packet(self, payload, source, target):
        number = next(self.numbers)
        time_ns = START + number * 2_000_000
        addresses = {"src_ip": source, "dst_ip": target, "ip_id": number & 0xFFFF}
        return Packet("udp", number, time_ns, payload, "02:00:00:00:00:01", None, **addresses)

    def call(self, kind, body, *, activity=1, sequence=1, opnum=wire.READ, **more):
        payload = wire.pdu(
            kind, "<", wire.Call(UUID(int=activity), sequence, opnum, NODE), body, **more
        )
        ends = (CONTROLLER, DEVICE) if kind == wire.REQUEST else (DEVICE, CONTROLLER)
        return self.packet(payload, *ends)

    def write_request(self, data, channel, **more):
        block = wire.write_request(0, channel, data)
        return self.call(wire.REQUEST, wire.request_body("<", block), opnum=wire.WRITE, **more)

    def write_response(self, channel, status=0, **more):
        body = wire.response_body("<", status, wire.write_response(0, channel, 0, status))
        return self.call(wire.RESPONSE, body, opnum=wire.WRITE, **more)

    def read_request(self, channel, **more):
        return self.call(
            wire.REQUEST, wire.request_body("<", wire.read_request(0, channel)), **more
        )

    def read_response(self, channel, data, status=0, **more):
        body = wire.response_body("<", status, wire.read_response(0, channel, data))
        return self.call(wire.RESPONSE, body, **more)

    def transaction(self, number, channel, pnu=1082):
        reference, sequence = number % 255 + 1, {"sequence": 2 * number & 0xFFFFFFFF}
        yield self.write_request(ask(reference, pnu), channel, **sequence)
        yield self.write_response(channel, **sequence)
        sequence = {"sequence": 2 * number + 1 & 0xFFFFFFFF}
        yield self.read_request(channel, **sequence)
        yield self.read_response(channel, answer(reference, number), **sequence)


def ask(reference=1, pnu=1082):
    return message.read(reference, 1, message.address(pnu))


def answer(reference=1, value=0):
    return message.header(reference, 1, 1, 1) + message.real(value % 1000)


def ar(number):
    return wire.RecordId(UUID(int=number + 1))


def activities(wire_, number):
    yield wire_.read_request(ar(0), activity=number)


def unanswered_calls(wire_, number):
    yield wire_.read_request(ar(0), sequence=number)


def unanswered_writes(wire_, number):
    yield wire_.write_request(ask(), ar(0), sequence=number)


def channels(wire_, number):
    yield wire_.write_request(ask(), ar(number), sequence=number)
    yield wire_.write_response(ar(number), sequence=number)


def orphans(wire_, number):
    yield wire_.read_response(ar(number), answer(1, number), sequence=number)


def foreign_records(wire_, number):
    yield wire_.write_request(
        b"\xff" * 40, ar(number // 40), activity=number // 40, sequence=number
    )


def controllers(wire_, number):
    for packet in wire_.transaction(number, ar(0)):
        ends = ("src_ip", "dst_ip") if packet.src_ip == CONTROLLER else ("dst_ip", "src_ip")
        yield replace(
            packet, **dict(zip(ends, (f"10.0.{number}.1", f"10.1.{number}.1"), strict=True))
        )


def changes(wire_, number):
    reference = number % 255 + 1
    data = (
        message.header(reference, 2, 1, 1) + message.address(number % 60_000 + 1) + message.real(1)
    )
    done = message.header(reference, 2, 1, 1)
    yield wire_.write_request(data, ar(0), sequence=number)
    yield wire_.write_response(ar(0), sequence=number)
    yield wire_.read_response(ar(0), done, sequence=number)


def rpc_fragments(wire_, number):
    yield wire_.call(
        wire.REQUEST, bytes(60), activity=number // 50, fragment=number % 50, flags=wire.FRAGMENT
    )


def stations(wire_, number):
    name = b"drive-%d" % number
    head = b"\xfe\xff\x05\x01" + bytes(6) + struct.pack(">H", 6 + len(name))
    payload = head + struct.pack(">BBHH", 2, 2, 2 + len(name), 0) + name
    yield Packet("dcp", number, START, payload, f"mac-{number}", "02:00:00:00:00:01")


def addresses(wire_, number):
    """One station that has another IP address each time."""
    block = struct.pack(">BBHH4s8x", 1, 2, 14, 1, number.to_bytes(4, "big"))
    head = b"\xfe\xff\x05\x01" + bytes(6) + struct.pack(">H", len(block))
    yield Packet("dcp", number, START, head + block, "mac", "02:00:00:00:00:01")


STREAMS = (
    activities, unanswered_calls, unanswered_writes, channels, orphans, foreign_records,
    controllers, changes, rpc_fragments, stations, addresses,
)  # fmt: skip


def kept(run):
    """How many things of each kind a run keeps."""
    calls = run._calls._activities.values()
    places = run._pairing.channels.values()
    held = run._events._index47._held.values()
    partial = run._calls._fragments._partial.values()
    return {
        "activities": len(calls),
        "calls": max((len(each.calls) for each in calls), default=0),
        "answered": len(run._calls._answered),
        "connects": len(run._calls._connects),
        "datagrams": len(run._calls._recent) + len(run._calls._earlier),
        "channels": len(places),
        "asked": max((len(each.asked) for each in places), default=0),
        "answers": len(run._answers),
        "transactions": len(run._transactions),
        "open": len(run._events._index47.open),
        "held ARs": len(held),
        "held": sum(len(each.events) for each in held),
        "messages": len(partial),
        "fragments": sum(len(each.parts) for each in partial),
        "given up": len(run._calls._fragments.given_up),
        "written": len(run._judge._written._written),
        "longest": len(run._judge._longest),
        "servers": len(run._stations._servers),
        "stations": len(run._stations._stations),
        "addresses": len(run._stations._by_ip),
    }


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(analysis, "limits", lambda: SMALL)


def feed(run: Analysis, packet: Packet) -> None:
    """What an analysis does with a packet."""
    pdu = run._brought(packet)
    for what, call, said in () if pdu is None else run._calls.take(pdu):
        run._records.handlers[what](call, said)
    run._process()


@pytest.mark.parametrize("stream", STREAMS, ids=lambda each: each.__name__)
@pytest.mark.usefixtures("small")
def test_an_endless_stream_stays_within_the_limits(stream):
    run = Analysis(AnalysisOptions(), lambda transaction, findings: None)
    run._calls._fragments = rpc.Fragments(SMALL.fragment_expiry_ns, limit=16, fragments=300)
    wire_ = Wire()
    for number in range(1500):
        for packet in stream(wire_, number):
            feed(run, packet)
    most = {
        "activities": 32, "calls": 8 + 1, "answered": 32, "connects": 32, "datagrams": 2 * 256,
        "channels": 32, "asked": 8,
        "answers": 32, "transactions": 0, "open": 48, "held ARs": 16, "held": 16 * 16,
        "messages": 16, "fragments": 300, "given up": 0, "written": 64, "longest": 32,
        "servers": 64, "stations": 64, "addresses": 64,
    }  # fmt: skip
    over = {key: number for key, number in kept(run).items() if number > most[key]}
    assert over == {}


def growth(stream, first, then, options=None):
    """Bytes by which a streaming analysis grows from transaction to transaction.

    Both counts have to leave as many datagrams behind those that were forgotten last, 256 in one go.
    """
    run = Analysis(options or AnalysisOptions(), lambda transaction, findings: None)
    wire_ = Wire()
    tracemalloc.start()
    try:
        for number in range(first + then):
            if number == first:
                gc.collect()
                before = tracemalloc.get_traced_memory()[0]
            for packet in stream(wire_, number):
                feed(run, packet)
        gc.collect()
        return (tracemalloc.get_traced_memory()[0] - before) / then
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("keeps", [True, False])
@pytest.mark.usefixtures("small")
def test_what_is_over_needs_nobody_to_look_for_garbage(keeps):
    """Whoever reads many captures looks only between two of them (`ds47.batch.memory`)."""
    run = Analysis(AnalysisOptions(), None if keeps else lambda transaction, findings: None)
    wire_ = Wire()
    gc.collect()
    gc.disable()
    try:
        for number in range(200):
            for packet in wire_.transaction(number, ar(0)):
                feed(run, packet)
        assert gc.collect() < 200
    finally:
        gc.enable()


def finished(wire_, number):
    yield from wire_.transaction(number, ar(0))


def reconnects(wire_, number):
    """One transaction per AR, which is released."""
    yield from wire_.transaction(number, ar(number))
    block = struct.pack(">HHBBH", 0x0114, 28, 1, 0, 0) + ar(number).ar.bytes + bytes(8)
    yield wire_.call(
        wire.REQUEST, wire.request_body("<", block), opnum=wire.RELEASE, sequence=number + 2**31
    )


def polls(wire_, number):
    if not number:
        yield wire_.write_request(ask(), ar(0))
        yield wire_.write_response(ar(0))
    yield wire_.read_request(ar(0), sequence=number + 2)
    yield wire_.read_response(ar(0), b"", 0xDE80B500, sequence=number + 2)


def rereads(wire_, number):
    if not number:
        yield from wire_.transaction(0, ar(0))
    yield wire_.read_request(ar(0), sequence=number + 9)
    yield wire_.read_response(ar(0), answer(1, 0), sequence=number + 9)


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_a_finished_transaction_leaves_nothing_behind():
    assert growth(finished, 256, 512) < 16


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_a_released_ar_leaves_nothing_behind():
    for number in range(
        uuid_text.cache_info().maxsize or 0
    ):  # that memory is bounded, and full by then
        uuid_text(number.to_bytes(16))
    assert growth(reconnects, 256, 512) < 16


@pytest.mark.slow
@pytest.mark.parametrize("stream", [polls, rereads], ids=lambda each: each.__name__)
@pytest.mark.usefixtures("small")
def test_an_endless_transaction_does_not_grow(stream):
    assert growth(stream, 256, 512) < 16


def lost_writes(wire_, number):
    """Each with a finding on a call (DS103), which knows its job, and a finished transaction."""
    packets = list(wire_.transaction(number, ar(0)))
    yield packets[0]
    yield replace(packets[0], ip_id=packets[0].ip_id ^ 0x8000)
    yield from packets[1:]


def test_a_transport_finding_holds_no_finished_transaction():
    run = Analysis(AnalysisOptions(), lambda transaction, findings: None)
    wire_ = Wire()
    for number in range(20):
        for packet in lost_writes(wire_, number):
            feed(run, packet)
    assert run._remarks
    assert not any(remark.job for remark in run._findings._remarks)
    assert not any(job.over for job in run._remarks)
    for what, call, said in run._calls.finish():
        run._records.handlers[what](call, said)
    run._process()
    run._pairing.finish()
    run._process()
    assert not run._remarks


def test_interface_statistics_do_not_pile_up():
    def lost(number, amount):
        return make.block(
            5, struct.pack("<III", number, 0, 0) + make.option(5, struct.pack("<Q", amount))
        )

    data = (make.section() + make.interface() + lost(0, 2) + lost(0, 3)) * 300
    with open_capture(
        io.BytesIO(data + b"".join(lost(number, 1) for number in range(1, 300)))
    ) as capture:
        assert list(capture) == []
        assert capture.dropped == 900
        assert len(capture._reader._lost) == 1


# -- whole and wrong fragments ------------------------------------------------------------------


def test_rpc_fragments_behind_the_last_one_are_none_of_the_message():
    wire_ = Wire()
    fragments = rpc.Fragments(30 * SECOND)

    def feed(number, flags=wire.FRAGMENT):
        body = b"%d" % number
        return fragments.feed(
            rpc.parse(wire_.call(wire.REQUEST, body, fragment=number, flags=flags))
        )

    assert feed(7) is None
    assert feed(0) is None
    assert feed(2, wire.FRAGMENT | wire.LAST_FRAGMENT) is None
    assert feed(9, wire.FRAGMENT | wire.LAST_FRAGMENT) is None
    whole = feed(1)
    assert whole is not None
    assert whole.body == b"012"
    assert fragments.unfinished() == []
    assert fragments._fragments == 0


def test_an_rpc_message_without_end_is_given_up():
    wire_ = Wire()
    fragments = rpc.Fragments(30 * SECOND, limit=4, fragments=10)
    for number in range(95):
        packet = wire_.call(wire.REQUEST, b"x", fragment=number, flags=wire.FRAGMENT)
        assert fragments.feed(rpc.parse(packet)) is None
    assert (
        sum(len(each.parts) for each in fragments._partial.values()) == fragments._fragments <= 10
    )
    assert len(fragments.unfinished()) <= 4 + 1


# -- work ---------------------------------------------------------------------------------------


def steps(work):
    """Lines of ds47 that run, a loop's as often as it turns: work without a clock."""
    number = 0

    def line(frame, event, argument):
        nonlocal number
        number += event == "line"
        return line

    def call(frame, event, argument):
        return line if "ds47" in frame.f_code.co_filename else None

    before = sys.gettrace()
    sys.settrace(call)
    try:
        work()
    finally:
        sys.settrace(before)
    return number


def is_linear(work, size):
    """Twice as much costs about twice as many steps (four times, were it quadratic)."""
    return steps(lambda: work(2 * size)) < 2.6 * steps(lambda: work(size))


@pytest.mark.parametrize(
    "stream", [*STREAMS[:-2], finished, rereads, rpc_fragments], ids=lambda each: each.__name__
)
def test_a_stream_costs_its_length(stream):
    def work(size):
        run = Analysis(AnalysisOptions(), lambda transaction, findings: None)
        wire_ = Wire()
        for number in range(size):
            for packet in stream(wire_, number):
                feed(run, packet)
        run._calls.finish()
        run._pairing.finish()

    work(5)
    assert is_linear(work, 150)


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_a_full_analysis_costs_the_length_of_its_stream():
    def work(size):
        run = Analysis(AnalysisOptions(), lambda transaction, findings: None)
        wire_ = Wire()
        for number in range(size):
            for stream in (channels, foreign_records, activities, unanswered_writes):
                for packet in stream(wire_, number):
                    feed(run, packet)

    assert is_linear(work, 150)


def test_a_release_looks_at_its_own_channels():
    request = decode_request(ask())
    peer = Peer(CONTROLLER, DEVICE)

    def work(size):
        pairing = Pairing(limits(), [])
        for number in range(size):
            key = number.to_bytes(16, "big")
            record = Record(True, False, key, 0, 1, 1, 47, 0, Half(1, START))
            pairing.write_request(record.of(peer), request)
        for number in range(size):
            pairing.release(CONTROLLER, DEVICE, number.to_bytes(16, "big"))
        assert not pairing.channels

    assert is_linear(work, 200)


def test_ip_fragments_cost_their_number():
    def work(size):
        reassembler = ip.Reassembler()
        for number in [size - 1, *range(size - 1)]:
            part = ip.Datagram(
                CONTROLLER, DEVICE, 17, 1, number * 8, number != size - 1, bytes(8), 0
            )
            whole = reassembler.feed(part, number, START)
        assert whole is not None

    assert is_linear(work, 200)


# -- texts that talk ----------------------------------------------------------------------------

NASTY = "\x1b]0;gone\x07\x1b[2J\r\n\x9b31m\x85\x00\x7f"
"""As Latin-1, which is what a drive and DCP can send; the bidi marks below come by way of the model."""
BIDI = "\u202e\u2066\u200f\u2028\u2029\ud800"


def nasty_result(text):
    run = Analysis(AnalysisOptions(), None)
    wire_ = Wire()
    packets = list(wire_.transaction(1, ar(0)))
    value = text.encode("latin-1")
    block = message.raw_block(0x09, len(value), value)
    packets[3] = wire_.read_response(ar(0), message.header(2, 1, 1, 1) + block, sequence=3)
    name = b"\x00\x00" + value
    head = b"\xfe\xff\x05\x01" + bytes(6) + struct.pack(">H", 4 + len(name))
    payload = head + struct.pack(">BBH", 2, 2, len(name)) + name
    packets.append(Packet("dcp", 9, START, payload, "02:00:00:00:00:01", "02:00:00:00:00:02"))
    stream = io.BytesIO(make.section())
    with open_capture(stream, name=text) as capture:
        for packet in packets:
            feed(run, packet)
        return run.run(capture)


@pytest.mark.parametrize("bidi", ["", BIDI])
def test_the_text_report_cannot_be_told_what_to_do(bidi):
    result = nasty_result(NASTY)
    assert result.transactions[0].parameters[0].values == [NASTY]
    assert result.devices[0].station == NASTY.rstrip("\0")
    result.devices[0].station += bidi
    result.transactions[0].parameters[0].values[0] += bidi
    result.path += bidi
    plain = nasty_result("harmless")
    text = document([result], "text")
    assert all(line.isprintable() for line in text.split("\n"))
    assert text.count("\n") == document([plain], "text").count("\n")
    assert "\\x1b" in text
    whole = json.loads(document([result], "json"))
    VALIDATOR.validate(whole)
    assert whole["captures"][0]["devices"][0]["station"] == result.devices[0].station
    for format_name in ("json", "ndjson", "csv"):
        lines = document([result], format_name).split("\n")
        assert all(line.removesuffix("\r").isprintable() for line in lines), format_name
        if format_name == "ndjson":
            assert all(map(json.loads, lines[:-1]))


@given(st.text())
def test_json_in_which_nothing_is_invisible_says_the_same(text):
    document = visible(json.dumps({"text": text}, ensure_ascii=False))
    assert document.isprintable()
    assert json.loads(document) == {"text": text}


def test_a_problem_on_stderr_is_one_plain_line(tmp_path, capsys):
    assert main(["report", str(tmp_path / "\x1b[2J\n\u202e.pcap")]) == 3
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.rstrip("\n").isprintable()


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", " =1"])
def test_a_spreadsheet_takes_no_text_for_a_formula(text):
    result = nasty_result(text)
    (row,) = csv.DictReader(io.StringIO(document([result], "csv"), newline=""))
    assert row["values"] == "'" + text
    assert row["path"] == "'" + text


@pytest.mark.parametrize(
    ("text", "cell"),
    [("\r=1", r"\r=1"), ("a\r=1", r"a\r=1"), ("\t=1", r"\t=1"), ("\x1b[2J", r"\x1b[2J")],
)
def test_a_text_stays_in_its_cell_and_commands_no_terminal(text, cell):
    (row,) = csv.DictReader(io.StringIO(document([nasty_result(text)], "csv"), newline=""))
    assert row["values"] == cell
