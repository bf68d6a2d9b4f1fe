"""The transport modules of lua/ds47 against the Python ones: the same frames, the same PDUs, records and events.

The stored captures as they are, and as broken by chance (seeded): lost, doubled, swapped, cut and changed
frames, jumping times, IP fragments in any order. tests/lua/transport.lua holds the unit checks of the Lua side.
"""

from __future__ import annotations

import json
import operator
import os
import random
import shutil
import struct
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from ds47.acyclic.index47 import Index47
from ds47.acyclic.pairing import Moment
from ds47.acyclic.record_calls import RecordCalls
from ds47.acyclic.record_events import RecordEvents
from ds47.capture import Frame, open_capture
from ds47.capture.scan import IPV4, network_layer
from ds47.findings.remark import Remark
from ds47.profidrive import Options
from ds47.profinet import connect, dcp, ip, lldp, rpc
from ds47.profinet.calls import Became, CallTracker
from ds47.profinet.completeness import Completeness
from ds47.profinet.link import Packet, Packets, dissect, mac
from ds47.profinet.records import Half, Peer, Record, parse_request, parse_response, released_ar
from ds47.profinet.stations import Stations
from ds47.spec.layouts import RECORD_WRITE_MULTIPLE
from ds47.spec.semantics import limits

TESTS = Path(__file__).resolve().parent.parent
VERSIONS = ("5.2", "5.3", "5.4")
SECOND = 1_000_000_000
STATION = ("mac", "ip", "name", "vendor_id", "device_id")


def lua(version: str, script: str, *arguments: str, stdin: str = "") -> str:
    """What a script of tests/lua prints; the test fails when it fails."""
    program = shutil.which(f"lua{version}")
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"lua{version} is missing", pytrace=False)
        pytest.skip(f"lua{version} is missing")
    command = [program, TESTS / "lua" / script, TESTS.parent / "lua", *arguments]
    result = subprocess.run(
        command, input=stdin, capture_output=True, encoding="utf-8", timeout=120, check=False
    )
    assert result.returncode == 0, result.stderr + result.stdout
    return result.stdout


# What is fed to Lua


def lines_of(frames: Iterable[Frame]) -> Iterator[str]:
    """The input of tests/lua/transport_trace.lua for one capture."""
    for frame in frames:
        line = _line(frame)
        if line is not None:
            yield "\t".join("-" if part is None else str(part) for part in line)
    yield "end"


def _line(frame: Frame) -> tuple[object, ...] | None:
    packet, lengths = dissect(frame), (len(frame.data), frame.original_length)
    if packet is not None and packet.kind == "udp":
        return ("packet", packet.frame, packet.time_ns, packet.src_ip, packet.dst_ip,
                packet.ip_id, packet.src_mac, *lengths, packet.payload.hex(),
                packet.src_port)  # fmt: skip
    if packet is not None:
        return "station", packet.kind, packet.src_mac, packet.dst_mac, packet.payload.hex()
    kind, at = network_layer(frame.data, 0, len(frame.data), frame.link_type)
    part = ip.parse(frame.data, at) if kind == IPV4 else None
    if part is None or part.protocol != ip.UDP or part.whole:
        return None
    return ("fragment", frame.number, frame.time_ns, part.source, part.destination,
            part.identification, mac(frame.data[6:12]), *lengths, part.offset, int(part.more),
            part.missing, part.payload.hex())  # fmt: skip


# What Python says of the same frames


def _known(**content: Any) -> dict[str, Any]:
    return {key: value for key, value in content.items() if value is not None}


def _half(half: Half | None) -> dict[str, Any] | None:
    if half is None:
        return None
    return _known(
        frame=half.frame, time_ns=half.time_ns, data=half.data.hex(), stated=half.stated,
        missing=half.missing, status=half.status,
    )  # fmt: skip


def _record(record: Record) -> dict[str, Any]:
    return _known(
        write=record.write, implicit=record.implicit, ar=record.ar.hex(), api=record.api,
        slot=record.slot, subslot=record.subslot, index=record.index, position=record.position,
        request=_half(record.request), response=_half(record.response),
    )  # fmt: skip


def _peer(peer: Peer) -> dict[str, Any]:
    return _known(**peer._asdict())


class JobNumber(int):
    """Stands for a job."""

    insisted = False


@dataclass
class Ear:
    """Stands for pairing and for whoever takes the findings, as `Ear` of the Lua script does."""

    told: list[dict[str, Any]] = field(default_factory=list)
    jobs: int = 0
    replaced: bool = False

    def tell(self, kind: str, **content: Any) -> None:
        self.told.append(_known(event=kind, **content))

    def write_request(self, record: Record, message: Any) -> int:
        self.jobs += 1
        self.tell("write_request", job=self.jobs, peer=_peer(record.peer), record=_record(record),
                  shaped=message.shaped)  # fmt: skip
        return JobNumber(self.jobs)

    def write_response(self, job: int, half: Half | None, *, fault: bool = False) -> None:
        self.tell("write_response", job=job, half=_half(half), fault=fault)

    def read_response(self, record: Record) -> None:
        self.tell("read_response", peer=_peer(record.peer), record=_record(record))

    def read_request(self, record: Record) -> None:
        pass

    def read_over(self, record: Record) -> None:
        pass

    def read_lost(self, record: Record) -> None:
        self.tell("read_lost", peer=_peer(record.peer), record=_record(record))

    def read_asked_late(self, record: Record, answer: int) -> None:
        self.tell("read_asked_late", peer=_peer(record.peer), record=_record(record), answer=answer)

    def release(
        self, controller: str, device: str, ar: bytes, at: Moment, index: int | None = None
    ) -> None:
        self.tell("release", controller=controller, device=device, ar=ar.hex(), frame=at.frame,
                  index=index)  # fmt: skip

    def set_up(self, request: rpc.Pdu, response: rpc.Pdu) -> None:
        """A Connect with the frame ids that the device gave."""
        asked, told = connect.parse_request(request), connect.parse_response(response)
        if asked is None or told is None:
            self.tell("set_up", asked=asked is not None, told=told is not None)
            return
        ar, mac, ids = told
        place = operator.attrgetter("api", "slot", "subslot")
        found = [each._asdict() for each in sorted(asked.answered(ids).submodules, key=place)]
        for each in found:
            for key in ("input", "output"):
                data = each.pop(key)
                if data is not None:
                    each[key] = data._asdict()
        self.tell(
            "set_up", asked=asked.ar.hex(), told=ar.hex(), device_mac=mac.replace(":", ""),
            controller_mac=asked.controller_mac.replace(":", ""), submodules=found,
        )  # fmt: skip

    def connected(
        self,
        controller: str,
        device: str,
        at: Moment,
        ar: bytes | None = None,
        *,
        only: bool = False,
    ) -> None:
        self.tell("connected", controller=controller, device=device, frame=at.frame, only=only)

    def write_unasked(self, record: Record) -> None:
        self.tell("write_unasked", peer=_peer(record.peer), record=_record(record))

    def is_again(self, record: Record) -> bool:
        return False

    def goes_on(self, controller: str, device: str, ar: bytes) -> None:
        pass

    def remark(self, remark: Remark) -> None:
        self.tell("remark", rule=remark.rule, frame=remark.frame, args=remark.args,
                  offset=remark.offset, job=remark.job)  # fmt: skip

    def pdu(self, kind: str, pdu: rpc.Pdu) -> None:
        vendor_id, device_id = rpc.device_identity(pdu.object_uuid) or (None, None)
        self.tell(
            kind, ptype=pdu.ptype, little=pdu.little, object_uuid=pdu.object_uuid.hex(),
            activity=pdu.activity.hex(), seq=pdu.seq, opnum=pdu.opnum, fragment=pdu.fragment,
            last=pdu.last, fragmented=pdu.fragmented, body=pdu.body.hex(), missing=pdu.missing,
            frame=pdu.frame, time_ns=pdu.time_ns, source=pdu.source, destination=pdu.destination,
            client=pdu.client, server=pdu.server, source_mac=pdu.source_mac,
            vendor_id=vendor_id, device_id=device_id,
        )  # fmt: skip

    def records(self, pdu: rpc.Pdu) -> None:
        requests, multiple = parse_request(pdu)
        status, answers = parse_response(pdu)
        released = released_ar(pdu)
        self.tell(
            "records", multiple=multiple, status=status,
            nested=any(each.index == RECORD_WRITE_MULTIPLE for each in requests if multiple),
            requests=[*map(_record, requests)], answers=[*map(_record, answers)],
            released=released.hex() if released else None,
        )  # fmt: skip


class Outcomes(list[Any]):
    """Gives each outcome to an ear at once; writes to foreign indices are the analyzer's alone."""

    def __init__(self, ear: Ear) -> None:
        super().__init__()
        self.ear = ear

    def append(self, outcome: tuple[str, Any, Any]) -> None:
        what, about, more = outcome
        if what == "remark":
            self.ear.remark(about)
        elif what == "set_up":
            self.ear.set_up(about, more)


class Without47(Index47):
    """What `forbid_47` of `Index47` in Lua means."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.concerned -= {47}


class Run:
    """The steps of an analysis up to pairing, for one capture."""

    def __init__(self, index47: Index47) -> None:
        self.ear = Ear()
        self.naming = Stations()
        outcomes = Outcomes(self.ear)
        self.events = RecordEvents(index47, self.ear, Options(), outcomes)  # type: ignore[arg-type]
        missing = Completeness(limits().activities)
        self.records = RecordCalls(self.events, self.ear, outcomes, missing, limits())  # type: ignore[arg-type]
        self.calls = Messages(missing, self)
        self.given_up: list[Became] = []

    def run(self, frames: Iterable[Frame]) -> list[dict[str, Any]]:
        source = Packets()
        for packet in source.of(frames):
            self.packet(packet)
        told = self.calls.finish()
        for each in (*self.given_up, *told):
            if each[0] == "incomplete":
                self.records.handlers[each[0]](*each[1:])
        for packet, have, limit in [
            *source.given_up(),
            *((*each, "") for each in source.unfinished()),
        ]:
            pdu = rpc.parse(packet)
            if pdu is not None:
                self.ear.pdu("unfinished", pdu)
                self.records.incomplete(rpc.GivenUp(pdu, have, limit), "IP")
        self.tell([each for each in told if each[0] != "incomplete"])
        self.records.finish()
        asked = self.events.requests
        counts = {
            str(index): {"read": asked[index, False], "write": asked[index, True]}
            for index, _ in list(asked)
        }
        devices = [
            _known(ip=device.ip, mac=device.mac, station=device.station,
                   vendor_id=device.vendor_id, device_id=device.device_id)
            for device in self.naming.devices()
        ]  # fmt: skip
        self.ear.tell("end", rpc=self.calls.counts, records=counts, devices=devices)
        return self.ear.told

    def packet(self, packet: Packet) -> None:
        if packet.kind != "udp":
            station = dcp.parse(packet) if packet.kind == "dcp" else lldp.parse(packet)
            content = station and _known(**{name: getattr(station, name) for name in STATION})
            self.ear.tell("station", station=content)
            self.naming.station(packet)
            return
        pdu = rpc.parse(packet)
        if pdu is None:
            return
        self.ear.pdu("pdu", pdu)
        self.tell(self.calls.take(pdu))

    def message(self, whole: rpc.Pdu, *, joined: bool) -> None:
        if joined:
            self.ear.pdu("whole", whole)
        self.ear.records(whole)
        self.naming.message(whole)

    def tell(self, told: Sequence[Became]) -> None:
        """What became of calls; the other one tells of messages that do not become whole when all is read."""
        for became in told:
            if became[0] == "incomplete":
                self.given_up.append(became)
            else:
                self.records.handlers[became[0]](*became[1:])


class Messages(CallTracker):
    """Tells of whole messages."""

    def __init__(self, missing: Completeness, run: Run) -> None:
        super().__init__(limits(), missing)
        self._run = run
        self._whole: rpc.Pdu | None = None

    def take(self, pdu: rpc.Pdu) -> Sequence[Became]:
        before, fragmented = self.counts["copies"], pdu.fragmented
        self._whole = None if fragmented else pdu
        told = super().take(pdu)
        if self._whole is not None and self.counts["copies"] == before:
            self._run.message(self._whole, joined=fragmented)
        return told

    def _joined(self, pdu: rpc.Pdu, told: list[Became]) -> rpc.Pdu | None:
        self._whole = super()._joined(pdu, told)
        return self._whole


# Where frames come from


def stored(path: Path) -> list[Frame]:
    """The frames of a capture, moved in time: a double of Lua 5.2 holds its nanoseconds exactly."""
    with open_capture(path) as capture:
        frames = list(capture)
    base = frames[0].time_ns - 1_000_000 * SECOND if frames else 0
    return [replace(frame, time_ns=frame.time_ns - base) for frame in frames]


def datagram_frames(packet: Packet, chance: random.Random, first: int) -> list[Frame]:
    """One UDP datagram on Ethernet, whole or in fragments that may overlap and come in any order."""
    payload = packet.payload
    stated = chance.choice([8 + len(payload)] * 8 + [0, 4 + len(payload)])
    data = struct.pack(">4H", packet.src_port, packet.dst_port, stated, 0) + payload
    cuts = [0, len(data)]
    if chance.random() < 0.3:
        cuts = sorted({0, len(data), *(8 * chance.randrange(1, 12) for _ in range(3))})
        cuts = [cut for cut in cuts if cut <= len(data)]
    pieces = []
    for start, end in pairwise(cuts):
        longer = end + chance.choice([0, 0, 0, 8, 16])
        last = end == len(data)
        pieces.append((start, not last, data[start : end if last else longer]))
    if len(pieces) > 1:
        chance.shuffle(pieces)
        pieces += [piece for piece in pieces if chance.random() < 0.15]
        pieces = [piece for piece in pieces if chance.random() < 0.97]
    addresses = bytes(map(int, f"{packet.src_ip}.{packet.dst_ip}".split(".")))
    frames = []
    for number, (start, more, piece) in enumerate(pieces, first):
        flags = start // 8 | (0x2000 if more else 0)
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(piece), packet.ip_id, flags, 64, 17, 0)
        ethernet = (
            bytes(6) + bytes.fromhex((packet.src_mac or "0" * 12).replace(":", "")) + b"\x08\0"
        )
        whole = ethernet + head + addresses + piece
        kept = len(whole) - (chance.randrange(1, 20) if chance.random() < 0.02 else 0)
        frames.append(
            Frame(number=number, time_ns=packet.time_ns, link_type=1, data=whole[:kept],
                  original_length=len(whole))
        )  # fmt: skip
    return frames


def broken_payload(payload: bytes, chance: random.Random) -> bytes:
    """Changed bytes, most of them where something is decided; the interface UUID stays."""
    data = bytearray(payload)
    for _ in range(chance.choice([0] * 6 + [1, 2, 3])):
        at = chance.choice(
            [1, 2, 4, 64, 67, 68, 69, 74, 75, 76, 77, chance.randrange(80, 170), len(data) - 1]
        )
        if at < len(data):
            data[at] = chance.choice([0, 1, 2, 4, 16, 0x2F, 0x80, 0xE0, chance.randrange(256)])
    if chance.random() < 0.03:
        del data[chance.randrange(len(data)) :]
    return bytes(data)


def broken(packets: list[Packet], chance: random.Random) -> list[Frame]:
    """A conversation to which everything happens that can happen to a capture."""
    frames: list[Frame] = []
    later = 0
    sequence = [packet for packet in packets if chance.random() < 0.96]
    sequence += chance.choices(packets, k=len(packets) // 4)
    if chance.random() < 0.5:
        sequence.sort(key=lambda packet: packet.frame)
    elif chance.random() < 0.5:
        chance.shuffle(sequence)
    for packet in sequence:
        jumps = [0] * 60 + [999_999, 1_000_000, 1_000_001, SECOND, 11 * SECOND, 61 * SECOND,
                            601 * SECOND, -SECOND, -61 * SECOND]  # fmt: skip
        later += chance.choice(jumps)
        changed = replace(
            packet,
            payload=broken_payload(packet.payload, chance),
            time_ns=packet.time_ns + later,
            ip_id=(packet.ip_id + chance.choice([0] * 9 + [1, 256])) % 65536,
        )
        frames += datagram_frames(changed, chance, len(frames) + 1)
    return frames


def broken_station(frame: Frame, chance: random.Random) -> Frame:
    """A DCP or LLDP frame with changed bytes, or cut."""
    data = bytearray(frame.data)
    for _ in range(chance.randrange(4)):
        data[chance.randrange(16, len(data))] = chance.choice([0, 1, 2, 7, 46, 97, 0xE9, 255])
    if chance.random() < 0.2:
        del data[chance.randrange(18, len(data)) :]
    return replace(frame, data=bytes(data))


# The tests


@pytest.mark.parametrize("version", VERSIONS)
def test_unit_checks(version: str) -> None:
    assert "checks passed" in lua(version, "transport.lua")


def compare(version: str, captures: list[tuple[str, list[Frame]]], *, forbid: bool = False) -> None:
    """Every line that Lua prints is what Python says at that place."""
    stdin = "".join(f"{line}\n" for _, frames in captures for line in lines_of(frames))
    arguments = ("forbid_47",) if forbid else ()
    printed = iter(lua(version, "transport_trace.lua", *arguments, stdin=stdin).splitlines())
    kind = Without47 if forbid else Index47
    for name, frames in captures:
        told = Run(kind(frozenset(), limits().waiting_calls)).run(frames)
        for number, expected in enumerate(told):
            assert json.loads(next(printed)) == expected, f"{name}, line {number}"
    assert next(printed, None) is None


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_stored_captures(version: str, captures: Path) -> None:
    paths = sorted(captures.glob("*.pcapng"))
    assert len(paths) > 50
    compare(version, [(path.name, stored(path)) for path in paths])


@pytest.mark.parametrize("version", VERSIONS)
def test_broken_captures(version: str, captures: Path) -> None:
    cases = []
    for path in sorted(captures.glob("*.pcapng")):
        packets = [packet for packet in Packets().of(stored(path)) if packet.kind == "udp"]
        if 0 < len(packets) < 200:
            cases.append((path.name, broken(packets, random.Random(path.name))))
    compare(version, cases)


@pytest.mark.parametrize("version", VERSIONS)
def test_broken_stations(version: str, captures: Path) -> None:
    chance = random.Random(47)
    frames = stored(captures / "naming-all.pcapng")
    stations = [frame for frame in frames if (found := dissect(frame)) and found.kind != "udp"]
    assert {found.kind for found in map(dissect, stations) if found} == {"dcp", "lldp"}
    case = [broken_station(frame, chance) for frame in stations * 200]
    compare(version, [("stations", case)])


def test_index_47_forbidden(captures: Path) -> None:
    paths = sorted(captures.glob("record-*.pcapng"))
    compare(VERSIONS[0], [(path.name, stored(path)) for path in paths], forbid=True)
