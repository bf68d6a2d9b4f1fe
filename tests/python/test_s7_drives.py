"""Parameters of drives that S7 reads and writes (docs/s7.md 8): what proves a drive, and what is told then."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from s7_scenes import drive

from ds47.analysis import AnalysisOptions, analyze
from ds47.cli import main
from ds47.lab import captured, ether
from ds47.lab.client import Client
from ds47.lab.naming import DCP, dcp_identify
from ds47.lab.s7 import Cpu, DriveCpu, Link, station
from ds47.lab.s7_wire import Var, db, flags
from ds47.lab.stage import Stage
from ds47.model import CaptureResult
from ds47.report.sentences import message
from ds47.s7.choices import Choices
from ds47.s7.drives import DriveElement, element
from ds47.s7.model import DB, S7Address

RAMP, NEXT = db(1120, 2048, 4), db(1120, 2049, 4)


def real(value: float) -> bytes:
    return struct.pack(">f", value)


def talk(act: Callable[[DriveCpu], object], *, slot: int = 0) -> bytes:
    """A capture of what a drive is asked."""
    stage = Stage()
    there = drive(Client(stage))
    there.tsap = bytes((3, slot))
    act(there)
    return captured(stage)


def told(act: Callable[[DriveCpu], object], *, slot: int = 0, **choices: Any) -> CaptureResult:
    return analyze(io.BytesIO(talk(act, slot=slot)), AnalysisOptions(s7=Choices(**choices)))


def elements(result: CaptureResult) -> list[tuple[int | None, str]]:
    """Drive object, and parameter with its values, of each item that is told as one."""
    return [
        (item.drive_object, f"{item.parameter.pnu}[{item.parameter.subindex}] {item.parameter.values}")
        for each in result.transactions for item in each.items if item.parameter is not None
    ]  # fmt: skip


def proof(result: CaptureResult) -> str | None:
    found = {each.drive.proof if each.drive else None for each in result.connections}
    return found.pop()


def reads(there: DriveCpu) -> Link:
    return there.link().open().get(RAMP).get(db(2114, 1025, 4))


def rewritten(there: DriveCpu) -> Link:
    """Values that lie on each other are written, and the first is still there."""
    link = there.link().open()
    link.put((RAMP, real(12.5))).put((NEXT, real(25.0)))
    return link.get(RAMP)


@pytest.mark.parametrize(
    ("address", "stands"),
    [
        (S7Address(DB, 2114, 8 * 1024, 8, 4), DriveElement(1, 2114, 0)),
        (S7Address(DB, 2000, 0, 8, 4), DriveElement(0, 2000, 0)),
        (S7Address(DB, 1120, 8 * 3075, 32, 1, 8), DriveElement(3, 1120, 3)),
        (S7Address(DB, 1120, 8 * 1024 + 1, 1, 1, 1), None),
        (S7Address(0x83, 0, 8 * 1024, 8, 4), None),
        (None, None),
    ],
)
def test_an_address_is_an_element(address: S7Address | None, stands: DriveElement | None) -> None:
    assert element(address) == stands


def test_addresses_alone_only_suggest_a_drive() -> None:
    found = told(reads)
    assert proof(found) == "addresses"
    assert elements(found) == []
    (connection,) = found.connections
    assert connection.drive == ("addresses", "DB1120.DBB2048..2051", 2, 1120, 0)


@pytest.mark.parametrize(
    "act",
    [
        lambda there: reads(there).get(flags(0, 4)),
        lambda there: reads(there).get(db(1120, 2048 + 500, 4)),
        lambda there: there.link().open().get(db(7777, 1024, 4)),
    ],
    ids=["bit memory", "a high index", "no parameter"],
)
def test_other_addresses_suggest_none(act: Callable[[DriveCpu], object]) -> None:
    def with_all(there: DriveCpu) -> None:
        there.elements |= {(0, 0): bytes(4), (1120, 2548): bytes(4), (7777, 1024): bytes(4)}
        act(there)

    assert proof(told(with_all)) is None


def test_a_cpu_in_slot_2_is_none() -> None:
    assert proof(told(reads, slot=2)) is None


def test_values_that_share_no_bytes_prove_a_drive() -> None:
    """The writes before the proof are told as elements, too."""
    found = told(rewritten)
    assert proof(found) == "values"
    assert elements(found) == [(2, "1120[0] [12.5]"), (2, "1120[1] [25.0]"), (2, "1120[0] [12.5]")]
    assert {each.drive_object for each in found.transactions} == {2}


@pytest.mark.parametrize(
    ("slot", "whole", "part"),
    [
        (2, db(10, 0, 20), db(10, 4, 1)),
        (1, db(10, 0, 2), db(10, 1, 1)),
        (0, db(10, 0, 2), db(10, 1, 1)),
        (0, db(10, 0, 20), db(10, 4, 1)),
        (2, db(10, 0, 4), db(10, 1, 4)),
    ],
)
def test_what_the_program_of_a_cpu_takes_back_proves_nothing(
    slot: int, whole: Var, part: Var
) -> None:
    """A handshake: a client sets what the program of the CPU sets to 0 again."""
    stage = Stage()
    plc = Cpu(stage, tsap=bytes((3, slot)))
    link = plc.link().open()
    link.put((whole, bytes(whole.size))).put((part, b"\1".ljust(part.size, b"\2")))
    plc.write(whole, bytes(whole.size))
    link.get(whole)
    found = analyze(io.BytesIO(captured(stage)))
    assert proof(found) in (None, "addresses")
    assert elements(found) == []


def test_a_value_that_another_one_does_not_touch_proves_nothing() -> None:
    def act(there: DriveCpu) -> None:
        link = there.link().open().put((RAMP, real(12.5))).put((db(1120, 2049, 4), real(25.0)))
        link.put((RAMP, real(12.5))).get(RAMP)  # written anew behind that

    assert proof(told(act)) == "addresses"


def test_the_user_says_that_it_is_one() -> None:
    for kinds in ((("", "sinamics"),), (("192.168.134.1", "sinamics"),)):
        found = told(reads, slot=2, cpus=kinds)
        assert proof(found) == "chosen"
        assert elements(found) == [(2, "1120[0] [10.0]"), (1, "2114[1] [4]")]
    assert elements(told(reads, cpus=(("192.168.134.9", "sinamics"),))) == []


def test_its_order_number_proves_a_drive() -> None:
    def act(there: DriveCpu) -> None:
        number = struct.pack(">H20sHHH", 1, b"6SL3 244-0BB13-1FA0", 0, 0, 0)
        link = there.link().open().szl(0x0011, 0, number)
        link.get(RAMP)

    found = told(act, slot=2)
    assert proof(found) == "order"
    assert elements(found) == [(2, "1120[0] [10.0]")]


def of_cpu(there: DriveCpu) -> None:
    """Two stations write a data block with the number of a parameter, and one that is missing is read."""
    one, two = there.link(2).open(), there.link(3).open()
    one.szl(0x0011, 0, struct.pack(">H20sHHH", 1, b"6ES7 214-1AG40-0XB0", 0, 0, 0))
    one.get(RAMP).put((RAMP, real(1.0)))
    two.put((RAMP, real(2.0))).get(db(9999, 1024, 4))


def test_the_order_number_of_a_cpu_refutes_what_addresses_suggest() -> None:
    found = told(of_cpu)
    assert proof(found) is None
    assert {each.rule for each in found.findings} == {"DS907", "DS908"}
    (refused,) = [each for each in found.findings if each.rule == "DS908"]
    assert "drive" not in message(refused)


def test_the_user_who_names_a_cpu_refutes_what_addresses_suggest() -> None:
    for kinds in ((("", "s7-1500"),), (("192.168.134.1", "s7-400"), ("", "sinamics"))):
        assert proof(told(reads, cpus=kinds)) is None


def test_the_order_number_of_a_cpu_does_not_refute_a_proof() -> None:
    def act(there: DriveCpu) -> None:
        rewritten(there)
        of_cpu(there)

    assert proof(told(act)) == "values"


def test_what_addresses_suggest_is_told_with_both_readings() -> None:
    found = told(lambda there: reads(there).get(db(9999, 1024, 4)))
    assert proof(found) == "addresses"
    (refused,) = [each for each in found.findings if each.severity == "error"]
    assert (refused.rule, refused.args["pnu"], refused.args["drive_object"]) == ("DS908", 9999, 1)
    both = "GET DB9999.DBB1024..1027 (p9999[0] of drive object 1, if it is a drive) refused by "
    assert message(refused).startswith(both)
    assert "若为驱动器，则为驱动对象 1 的 p9999[0]" in message(refused, "zh")


def test_values_prove_nothing_where_a_write_is_missing() -> None:
    """The capture lacks the write by which the value is there again."""

    def act(there: DriveCpu) -> None:
        link = there.link().open().put((RAMP, real(12.5))).put((NEXT, real(25.0)))
        there.stage.deaf = True
        link.put((RAMP, real(12.5)))
        there.stage.deaf = False
        link.get(RAMP).get(RAMP)

    assert proof(told(act)) == "addresses"


@pytest.mark.parametrize(
    ("device_id", "shown"), [(0x0507, "device"), (0x010E, None), (0x0301, "addresses")]
)
def test_its_device_id_proves_a_drive_or_a_cpu(device_id: int, shown: str | None) -> None:
    """Class 05 are drives, 01 CPUs; a class that says neither leaves what addresses suggest."""
    stage = Stage()
    there = drive(Client(stage))
    host = replace(there.host, vendor_id=0x002A, device_id=device_id)
    frame = ether.bare(host.mac, station(2).mac, DCP, dcp_identify(host, "press-1"))
    stage.frame(frame)
    there.link().open().get(RAMP)
    found = analyze(io.BytesIO(captured(stage)))
    assert proof(found) == shown
    assert elements(found) == ([(2, "1120[0] [10.0]")] if shown == "device" else [])


@pytest.mark.parametrize(
    ("station_type", "shown"), [(b"SINAMICS G120C", "station"), (b"S7-1500", None)]
)
def test_its_type_of_station_proves_a_drive_or_a_cpu(
    station_type: bytes, shown: str | None
) -> None:
    stage = Stage()
    there = drive(Client(stage))
    name = dcp_identify(replace(there.host, vendor_id=0x0123), "press-1")
    kind = b"\2\1" + struct.pack(">H", 2 + len(station_type)) + bytes(2) + station_type
    kind += bytes(len(kind) % 2)
    length = struct.unpack(">H", name[10:12])[0] + len(kind)
    stage.frame(
        ether.bare(
            there.host.mac,
            station(2).mac,
            DCP,
            name[:10] + struct.pack(">H", length) + name[12:] + kind,
        )
    )
    there.link().open().get(RAMP)
    found = analyze(io.BytesIO(captured(stage)))
    assert proof(found) == shown
    assert elements(found) == ([(2, "1120[0] [10.0]")] if shown else [])


def test_its_parameter_channel_proves_a_drive() -> None:
    stage = Stage()
    client = Client(stage)
    there = drive(client)
    client.device = there.host
    client.exchange(
        bytes.fromhex("01010101100104600000"), bytes.fromhex("010101010801" + "41200000")
    )
    there.link().open().get(RAMP)
    found = analyze(io.BytesIO(captured(stage)))
    assert proof(found) == "records"
    assert elements(found) == [(2, "1120[0] [10.0]")]


@pytest.mark.parametrize(
    ("pnu", "size", "raw", "values", "also"),
    [
        (1120, 4, real(2.5), [2.5], None),
        (2, 2, b"\0\x0a", [10], None),
        (2, 4, b"\0\0\0\x0a", [10], None),
        (2114, 4, real(123456.0), [0x47F12000], "Float32 123456.0"),
        (2114, 4, b"\x12\x34\x56\x78", [0x12345678], None),
        (6543, 1, b"\x07", [7], None),
        (6543, 3, b"\1\2\3", [], None),
    ],
)
def test_values_have_the_type_of_the_tables_where_it_fits(
    pnu: int, size: int, raw: bytes, values: list[Any], also: str | None
) -> None:
    def act(there: DriveCpu) -> None:
        there.elements[pnu, 1024] = raw
        there.link().open().get(db(pnu, 1024, size))

    (item,) = told(act, cpus=(("", "sinamics"),)).transactions[0].items
    assert item.parameter is not None
    assert item.parameter.values == values
    assert item.parameter.value_texts == (None if also is None else {None: also})


def command(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    main(list(arguments))
    return capsys.readouterr().out


@pytest.fixture
def capture(tmp_path: Path) -> str:
    path = tmp_path / "drive.pcapng"

    def act(there: DriveCpu) -> None:
        link = rewritten(there)
        link.put((RAMP, real(3.0)), (db(2114, 1024, 4), bytes(4))).get(RAMP, db(2114, 1025, 4))

    path.write_bytes(talk(act))
    return str(path)


def test_the_report_tells_parameters(capture: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = command(capsys, "report", "--channels", "s7", capture)
    assert "DO 2 p1120[0] (Ramp-function generator, ramp-up time) = 12.5 s" in text
    assert "192.168.134.1 is a drive (its values share no bytes)" in text
    assert "areas larger than the block" not in text
    page = command(capsys, "report", "-f", "html", capture)
    assert "DO 2 p1120[0]" in page


def test_a_drive_that_is_only_suggested_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "drive.pcapng"
    path.write_bytes(talk(reads))
    text = " ".join(command(capsys, "report", "--channels", "s7", str(path)).split())
    assert (
        "192.168.134.1 answers like a drive (slot 0, and data blocks with numbers of parameters): "
        "DB1120.DBB2048..2051 is p1120[0] of drive object 2; if it is one, "
        "--s7-cpu 192.168.134.1=sinamics reads its parameters"
    ) in text


def test_tables_have_a_row_for_each_element(
    capture: str, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = json.loads(command(capsys, "report", "-f", "json", capture))["captures"][0]
    last = plain["transactions"][-1]
    assert [(each["drive_object"], each["parameter"]["pnu"]) for each in last["items"]] == [
        (2, 1120),
        (1, 2114),
    ]
    assert last["drive_object"] is None
    assert plain["connections"][0]["drive"]["proof"] == "values"
    lines = command(capsys, "report", "-f", "csv", capture).splitlines()
    assert ",1120,0,value," in lines[-2]
    assert ",2114,1,value," in lines[-1]
    told_again = [
        json.loads(line) for line in command(capsys, "report", "-f", "ndjson", capture).splitlines()
    ]
    jobs = [
        each["transaction"]
        for each in told_again
        if "transaction" in each and isinstance(each["transaction"], dict)
    ]
    assert not jobs or jobs[-1]["items"] == last["items"]


def test_the_trail_goes_through_s7(capture: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = command(capsys, "trail", "-f", "json", capture)
    *_, change, other = json.loads(text)["captures"][0]["changes"]
    assert (change["pnu"], change["old"], change["new"], change["way"]) == (1120, 12.5, 3.0, "S7")
    assert (change["drive_object"], change["outcome"]) == (2, "accepted")
    assert (other["pnu"], other["old"], other["new"]) == (2114, None, 0)
    last = command(capsys, "report", "-f", "parameters", capture).splitlines()
    assert ",DO 2 S7,2,1120,0," in last[-2]
    assert ",3.0,Float32," in last[-2]
    assert ",DO 2 S7,2,1120,1," in last[-1]


def test_a_refused_write_is_a_change_that_did_not_come(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def act(there: DriveCpu) -> None:
        rewritten(there).put((RAMP, real(1.0)), (db(9999, 1024, 4), bytes(4)))

    path = tmp_path / "drive.pcapng"
    path.write_bytes(talk(act))
    changes = json.loads(command(capsys, "trail", "-f", "json", str(path)))["captures"][0][
        "changes"
    ]
    assert [(each["pnu"], each["outcome"]) for each in changes] == [
        (1120, "accepted"),
        (1120, "accepted"),
        (1120, "accepted"),
        (9999, "refused"),
    ]


def test_the_captures_of_the_field_are_read(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """r2114[0] and r2114[1] of DO 1, r0021 of DO 2, p1120[0] of DO 2 := 10.0, and why two were refused."""
    path = captures / "field/s7-drive.pcap"
    text = command(capsys, "report", "--channels", "s7", "--s7-cpu", "sinamics", str(path))
    for line in (
        "DO 1 r2114[0] (Total system runtime) = 1206984704 (Float32 123456.0)",
        "DO 2 r0021[0] (Actual speed, smoothed) = 1450.5 rpm",
        "DO 2 p1120[0] (Ramp-function generator, ramp-up time) := 10.0 s",
    ):
        assert line in text
    seen = {each.rule for each in analyze(path).findings if each.severity == "error"}
    assert seen == {"DS908"}  # nothing proves a drive
    findings = analyze(path, AnalysisOptions(s7=Choices(cpus=(("", "sinamics"),)))).findings
    assert {(each.rule, each.args.get("code")) for each in findings if each.severity == "error"} == {
        ("DS919", 0x05), ("DS919", 0x0A),
    }  # fmt: skip
    elements_ = analyze(
        captures / "field/s7-drive-elements.pcap", AnalysisOptions(s7=Choices(readback=True))
    )
    assert {each.rule for each in elements_.findings} == {"DS906"}


@pytest.mark.parametrize("seed", range(6))
def test_drives_by_chance(seed: int) -> None:
    """Clients that write and read elements of drives and bytes of a CPU: each item is known beforehand."""
    random = Random(seed)
    stage = Stage()
    there = drive(Client(stage))
    plc = Cpu(stage, station(9))
    spots = [
        (pnu, 1024 * number + index, size)
        for pnu, size in ((1120, 4), (2, 2), (2114, 4)) for number in (1, 2) for index in range(3)
    ]  # fmt: skip
    there.elements = {(pnu, at): random.randbytes(size) for pnu, at, size in spots}
    links = [there.link(number).open() for number in (2, 3)] + [plc.link(4).open()]
    asked: list[list[tuple[int, int]]] = []
    for _ in range(120):
        link = random.choice(links)
        chosen = random.sample(spots, random.randint(1, 4))
        places = [db(pnu, at, size) for pnu, at, size in chosen]
        if link.cpu is plc:
            places = [db(each.db, each.start % 1900, each.size) for each in places]
        if random.random() < 0.5:
            link.get(*places)
        else:
            link.put(*((each, random.randbytes(each.size)) for each in places))
        asked.append([(each.db, each.start) for each in places] if link.cpu is there else [])
    found = analyze(io.BytesIO(captured(stage)), AnalysisOptions(s7=Choices(readback=True)))
    assert not [
        each
        for each in found.findings
        if each.args.get("device") == there.host.ip and each.rule != "DS906"
    ]
    assert {each.drive.proof if each.drive else None for each in found.connections} == {
        "values",
        None,
    }
    jobs = [each for each in found.transactions if each.operation in ("get", "put")]
    assert len(jobs) == len(asked)
    since = next(n for n, each in enumerate(jobs) if any(item.parameter for item in each.items))
    for job, places in zip(jobs[since:], asked[since:], strict=True):
        told = [
            (item.parameter.pnu, 1024 * (item.drive_object or 0) + (item.parameter.subindex or 0))
            for item in job.items if item.parameter is not None
        ]  # fmt: skip
        assert told == places
    values = {(pnu, at): raw for (pnu, at), raw in there.elements.items()}
    for item in jobs[-1].items if asked[-1] and jobs[-1].operation == "get" else ():
        assert item.value == values[item.db or 0, item.start or 0]
