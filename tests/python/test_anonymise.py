"""`ds47 export --anonymise`: nothing of the names is left, everything else is as it was."""

from __future__ import annotations

import json
import random
import stat
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from frames import whole_frames
from of_profibus import of_ethernet

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Interface, PcapngWriter, WholeFrame, open_capture
from ds47.export import ExportOutcome, KeyFileError, Replacements, Selection, export
from ds47.export.anonymise import Anonymiser, Knowledge, internet_checksum
from ds47.export.drafts import Drafts
from ds47.export.tracking import Copy, TrackedMessage
from ds47.lab import ether, message, wire
from ds47.lab.client import OK, Client
from ds47.lab.naming import DCP, LLDP, dcp_identify, lldp
from ds47.lab.stage import Stage
from ds47.lab.wire import ar_request, ar_response
from ds47.model import DS47, CaptureResult, Transaction
from ds47.profinet.traces import DatagramPiece, Trace

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
EVERY = of_ethernet(sorted(CAPTURES.rglob("*.pcapng")))
"""Of Ethernet: frames of PROFIBUS are not anonymised (test_profibus_export.py)."""
ONLY = AnalysisOptions(channels=(DS47,))
"""Frames of other channels are not anonymised, either."""
TSHARK_CHECKSUMS = ("-o", "ip.check_checksum:TRUE", "-o", "udp.check_checksum:TRUE")
GOOD = "ip.checksum.status == 1 && udp.checksum.status == 1"


OF_VALUES = ("DS701", "DS714", "DS715", "DS716", "DS717")
"""Diagnoses that go by values: other values may mean something else, and then another rule explains a refusal."""
SECRET = b"name-of-customer"
OCTETS = 0x0A
UNASKED = frozenset(("DS403", "DS404", "DS405", "DS407"))
"""The response answers no request that is known, or another one: nobody knows of which parameters."""
UNREAD = frozenset(("DS302", "DS303", "DS305", "DS309", "DS312", "DS313", "DS315", "DS318"))
"""Some bytes of the message could not be read: they do not leave the house."""


def anonymised(source: Path, target: Path, **more: Any) -> tuple[ExportOutcome, Replacements]:
    key = Replacements()
    return export(source, target, Selection(), ONLY, key=key, **more), key


def story(item: Transaction, number: Callable[[int], int], values: bool) -> tuple[object, ...]:
    """A transaction without addresses, and with the frame numbers of the copy, which has no cyclic frames.

    Without values, too, where it asks for the name or the address of the station.
    """
    frames = [number(frame) for frame in item.frames.all()]
    values = values and not any(each.pnu in (61000, 61001) for each in item.parameters)
    values = values and not UNASKED.intersection(item.findings)
    unread = "DS302" in item.findings and not UNREAD.isdisjoint({*item.findings} - {"DS302"})
    exact = values and UNREAD.isdisjoint(item.findings)
    parameters = (
        [len(item.parameters)]
        if unread
        else [
            (each.pnu, each.subindex, each.attribute, each.element_count, each.format)
            + (each.value_count, each.error and (each.error.code, each.error.info))
            + ((each.values, each.scaled) if values else (len(each.values),))
            for each in item.parameters
        ]
    )
    return (
        item.operation, item.state, item.api, item.slot, item.subslot, item.index,
        item.request_reference, item.axis, frames, item.start_ns, item.duration_ns,
        item.write_status, item.read_status, parameters,
        [
            # A message that never became whole is none that can be written: the copy lacks all of it.
            "DS101" if rule == "DS105" else rule
            for rule in item.findings
            if (values and not unread) or rule not in OF_VALUES
        ],
        item.request if exact else None, item.response if exact else None,
    )  # fmt: skip


def stories(
    result: CaptureResult, outcome: ExportOutcome | None, values: bool = True
) -> list[object]:
    """All transactions of a capture; the frame numbers of the original as they are in the copy."""
    place = {frame: at for at, frame in enumerate(outcome.frames, 1)} if outcome else {}
    return [
        story(each, place.__getitem__ if outcome else int, values) for each in result.transactions
    ]


def originals(result: CaptureResult) -> list[bytes]:
    """What the capture must not show any more: MAC and IP in both forms, names."""
    found = []
    hosts = {each.ip for each in result.devices}
    hosts |= {ip for each in result.transactions for ip in (each.controller, each.device)}
    for ip in hosts:
        found += [ip.encode(), bytes(map(int, ip.split(".")))]
    for device in result.devices:
        if device.mac:
            found += [device.mac.encode(), bytes.fromhex(device.mac.replace(":", ""))]
        if device.station:
            found.append(device.station.encode())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("source", EVERY, ids=lambda path: path.stem)
def test_same_transactions_and_no_names(source: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.pcapng"
    outcome, key = anonymised(source, target)
    if not outcome.frames:
        assert not target.exists()
        return
    assert not outcome.leaks
    after = analyze(target)
    assert stories(after, None) == stories(outcome.result, outcome)
    assert [each.vendor_id for each in after.devices] == [
        each.vendor_id for each in outcome.result.devices
    ]
    data = target.read_bytes()
    for original in [*originals(outcome.result), *key.originals()]:
        assert original not in data


@pytest.mark.slow
@pytest.mark.parametrize("source", EVERY, ids=lambda path: path.stem)
def test_same_transactions_with_other_values(source: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target, everything=True)
    if outcome.frames:
        assert stories(analyze(target), None, False) == stories(outcome.result, outcome, False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["tour-machine", "naming-all", "transport-ip-fragments", "transport-rpc-fragments",
     "transport-vlan", "transport-qinq", "transport-big-endian", "record-multiple",
     "real-stacks/o1_profinetpy062_be", "real-stacks/o2_pyprofinet_le", "transport-sll2"],
)  # fmt: skip
def test_checksums_are_right(name: str, tmp_path: Path, tshark: Callable[..., str]) -> None:
    target = tmp_path / "out.pcapng"
    outcome, _ = anonymised(CAPTURES / f"{name}.pcapng", target)
    wrong = tshark(*TSHARK_CHECKSUMS, "-r", target, "-Y", f"udp && !({GOOD})", "-T", "fields",
                   "-e", "frame.number", "-e", "udp.checksum.status")  # fmt: skip
    # 3: the sender sent no checksum, and there is still none
    assert [line for line in wrong.splitlines() if not line.endswith("\t3")] == []
    assert outcome.frames


def test_tshark_sees_the_same_in_both(tmp_path: Path, tshark: Callable[..., str]) -> None:
    """What Wireshark makes of the frames: protocols, services, indices, lengths."""
    source = CAPTURES / "real-stacks" / "o1_profinetpy062_be.pcapng"
    target = tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target)
    fields = ("frame.time_epoch", "frame.len", "frame.protocols", "dcerpc.pkt_type",
              "dcerpc.opnum", "pn_io.index", "pn_io.record_data_length", "pn_io.error_code",
              "pn_dcp.service_id", "pn_dcp.suboption_device",
              "pn_dcp.suboption_vendor_id", "lldp.tlv.type")  # fmt: skip
    columns = ["-T", "fields", "-E", "occurrence=f", "-e", "frame.number"]
    columns += [word for name in fields for word in ("-e", name)]
    lines = tshark("-r", source, *columns).splitlines()
    wanted = [line for line in lines if int(line.split("\t")[0]) in set(outcome.frames)]
    there = tshark("-r", target, *columns).splitlines()
    assert [line.split("\t")[1:] for line in there] == [line.split("\t")[1:] for line in wanted]


def talk(stage: Stage) -> Client:
    """A machine that says its name in every way that the lab knows."""
    client = Client(stage)
    plc, motor = client.host, client.device
    stage.frame(ether.bare(motor.mac, plc.mac, DCP, dcp_identify(motor, "press-1-drive")))
    stage.frame(ether.bare(motor.mac, "01:80:c2:00:00:0e", LLDP, lldp(motor, "press-1-drive")))
    call = client.call(wire.CONNECT)
    client.ask(call, ar_request(client.channel.ar, plc, "plc-hall-7"))
    client.accept(call, OK, ar_response(client.channel.ar, motor))
    return client


def shoot(stage: Stage, path: Path) -> Path:
    with PcapngWriter(path, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    return path


def block(form: int, count: int, raw: bytes) -> bytes:
    return bytes((form, count)) + raw + bytes(len(raw) % 2)


@pytest.mark.parametrize("fragment", [None, 100])
@pytest.mark.parametrize("mtu", [None, 64])
def test_parameters_that_say_who_it_is(
    tmp_path: Path, mtu: int | None, fragment: int | None
) -> None:
    """Name, address and MAC of the station as values: replaced even where values are kept."""
    stage = Stage(mtu=mtu)
    client = talk(stage)
    client.fragment = fragment
    name = b"press-1-drive".ljust(240, b"\0")
    asked = message.read(1, 1, message.address(61000), message.address(61001), message.address(21))
    blocks = (block(0x0A, 240, name), block(0x0A, 4, bytes((192, 168, 133, 33))))
    client.exchange(asked, message.answer(1, 1, 1, *blocks, message.real(1500.0)))
    asked = message.read(2, 1, message.address(8935, 0, 6), message.address(8920, 0, 13))
    mac = bytes.fromhex("001ff8000001")
    blocks = (block(0x05, 6, mac), block(0x05, 13, b"press-1-drive"))
    answer = message.answer(2, 1, 1, *blocks)
    client.exchange(asked, answer)
    client.read(answer)  # a re-read says it again
    wide = b"".join(bytes((0, char)) for char in b"press-1-drive")
    asked = message.read(3, 1, message.address(199, 0, 13))
    client.exchange(asked, message.answer(3, 1, 1, block(0x06, 13, wide)))
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target)
    assert not outcome.leaks
    assert not outcome.left_out
    data = target.read_bytes()
    assert b"press-1" not in data
    assert b"\0p\0r\0e\0s\0s" not in data
    assert b"plc-hall-7" not in data
    assert bytes((192, 168, 133, 33)) not in data
    assert mac not in data
    after = analyze(target)
    assert [each.state for each in after.transactions] == ["ok"] * 3
    first, second, third = (each.parameters for each in after.transactions)
    station = after.devices[0].station
    assert station
    assert bytes.fromhex(str(first[0].values[0])).rstrip(b"\0").decode() == station
    assert ".".join(str(byte) for byte in bytes.fromhex(str(first[1].values[0]))) == (
        after.devices[0].ip
    )
    assert first[2].values == [1500.0]
    assert bytes(int(value) for value in second[0].values).hex(":") == after.devices[0].mac
    assert bytes(int(value) for value in second[1].values).decode() == station
    assert bytes(int(value) for value in third[0].values).decode() == station


def test_records_that_are_no_parameter_channel_become_zeros(tmp_path: Path) -> None:
    stage = Stage()
    client = talk(stage)
    client.read(b"serial S C-X4AB12 of plc-hall-7".ljust(54), at=client.at(index=0xAFF0))
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    anonymised(source, target)
    assert b"S C-X4AB12" not in target.read_bytes()
    after = analyze(target)
    assert after.records["45040"] == {"read": 1, "write": 0}
    assert len(after.transactions) == 1


def test_a_foreign_record_47_becomes_zeros(tmp_path: Path) -> None:
    target = tmp_path / "out.pcapng"
    anonymised(CAPTURES / "record-foreign.pcapng", target)
    assert b"Hello, world" not in target.read_bytes()


def test_a_value_that_holds_a_name_takes_its_frame_along(tmp_path: Path) -> None:
    stage = Stage()
    client = talk(stage)
    client.exchange(message.read(1, 1, message.address(7000)),
                    message.answer(1, 1, 1, block(0x09, 14, b"plc-hall-7 OK!")))  # fmt: skip
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target)
    assert [text for _, text in outcome.leaks] == ["plc-hall-7"]
    assert b"plc-hall-7" not in target.read_bytes()
    outcome, _ = anonymised(source, target, everything=True)
    assert not outcome.leaks
    assert b"plc-hall-7" not in target.read_bytes()


def test_values_stay_equal_and_different(tmp_path: Path) -> None:
    stage = Stage()
    client = Client(stage)
    ramp = message.address(1120)
    for number, value in enumerate((10.0, 20.0, 10.0), 1):
        client.exchange(message.change(number, 1, (ramp, message.real(value))),
                        message.changed(number, 1))  # fmt: skip
        client.exchange(message.read(number + 10, 1, ramp),
                        message.answer(number + 10, 1, 1, message.real(value)))  # fmt: skip
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    _, key = anonymised(source, target, everything=True)
    values = [each.parameters[0].values[0] for each in analyze(target).transactions]
    assert values[0] == values[1] == values[4] == values[5] != values[2] == values[3]
    assert not {10.0, 20.0} & set(values)
    assert not [each for each in analyze(target).findings if each.rule == "DS417"]
    key.save(tmp_path / "key.json")
    assert "4 41200000" in json.loads((tmp_path / "key.json").read_text())["value"]


def test_only_the_numbers_of_the_limits_stay(tmp_path: Path) -> None:
    """PNU 974 says how long a message may be; a text that stands there is one like any other."""
    stage = Stage()
    client = Client(stage)
    secret = b"customer-recipe-A1"
    wide = b"".join(bytes((0, char)) for char in secret)
    limits = struct.pack(">3H", 240, 39, 100)
    for number, (attribute, elements, answer) in enumerate(
        (
            (0x10, 3, block(0x06, 3, limits)),
            (0x10, 18, block(0x09, 18, secret)),
            (0x10, 18, block(0x05, 18, secret)),
            (0x10, 18, block(0x06, 18, wide)),
            (0x20, 18, block(0x0A, 18, secret)),
            (0x30, 18, block(0x09, 18, secret)),
        ),
        1,
    ):
        asked = message.address(974, 0, elements, attribute)
        client.exchange(message.read(number, 1, asked), message.answer(number, 1, 1, answer))
    asked = message.address(974, 0, 18)
    client.exchange(message.change(9, 1, (asked, block(0x09, 18, secret))), message.changed(9, 1))
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    anonymised(source, target, everything=True)
    data = target.read_bytes()
    assert secret not in data
    assert wide not in data
    first, *others = analyze(target).transactions
    assert first.parameters[0].values == [240, 39, 100]
    assert [each.state for each in (first, *others)] == ["ok"] * 7


def test_time_stamps_lengths_and_order_stay(tmp_path: Path) -> None:
    source, target = CAPTURES / "transport-ip-fragments-disorder.pcapng", tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target)
    wanted = [
        (each.time_ns, len(each.data), each.original_length)
        for each in whole_frames(source)
        if each.number in set(outcome.frames)
    ]
    assert [(e.time_ns, len(e.data), e.original_length) for e in whole_frames(target)] == wanted


def test_comments_and_interface_names_do_not_tell(tmp_path: Path) -> None:
    source = tmp_path / "in.pcapng"
    stage = Stage()
    talk(stage)
    with PcapngWriter(source, link_type=None) as writer:
        writer.add_interface(1, 0, [(2, b"eth-plc-hall-7"), (1, b"hall 7")])
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, comment="seen at press-1-drive")
    target = tmp_path / "out.pcapng"
    anonymised(source, target)
    data = target.read_bytes()
    assert b"hall" not in data
    assert b"press-1" not in data


def test_no_udp_checksum_stays_none_and_padding_is_cleared(tmp_path: Path) -> None:
    stage = Stage()
    talk(stage)
    source, target = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    with PcapngWriter(source) as writer:
        for shot in stage.shots:
            data = bytearray(shot.data)
            if data[12:14] == b"\x08\x00":
                data[40:42] = b"\0\0"
            writer.write(shot.time_ns, bytes(data) + b"left in the buffer")
    anonymised(source, target)
    assert b"left in the buffer" not in target.read_bytes()
    udp = [frame.data for frame in open_capture(target) if frame.data[12:14] == b"\x08\x00"]
    assert udp
    for data in udp:
        assert data[40:42] == b"\0\0"
        assert internet_checksum(data[14:34]) == 0


def test_a_cut_datagram_keeps_a_checksum_that_fits(tmp_path: Path) -> None:
    """With the bytes that the capture cut off, which nobody changed, the checksum is right again."""
    stage = Stage()
    client = talk(stage)
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    for snap in (150, 173, 200):
        source, target = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
        with PcapngWriter(source) as writer:
            for shot in stage.shots:
                writer.write(shot.time_ns, shot.data[:snap], len(shot.data))
        outcome, _ = anonymised(source, target)
        checked = 0
        for frame in whole_frames(target):
            whole = stage.shots[outcome.frames[frame.number - 1] - 1].data
            if frame.data[12:14] != b"\x08\x00" or len(whole) <= snap:
                continue
            data = frame.data + whole[len(frame.data) :]
            udp = data[34:]
            pseudo = data[26:34] + struct.pack(">2H", 17, len(udp))
            assert internet_checksum(pseudo + udp) in (0, 0xFFFF)
            checked += 1
        assert checked


def test_incomplete_fragments_are_left_out_and_said(tmp_path: Path) -> None:
    source = CAPTURES / "transport-ip-fragments-incomplete.pcapng"
    outcome, _ = anonymised(source, tmp_path / "out.pcapng")
    assert outcome.left_out
    plain = export(source, tmp_path / "plain.pcapng", Selection())
    assert set(outcome.left_out) <= set(plain.frames)


def test_one_key_for_several_captures(tmp_path: Path) -> None:
    key_file = tmp_path / "key.json"
    first, second = (Stage(), Stage())
    talk(first)
    client = talk(second)
    client.device.ip = "192.168.133.99"
    client.write(message.read(1, 1, message.address(21)))
    one, two = shoot(first, tmp_path / "1.pcapng"), shoot(second, tmp_path / "2.pcapng")
    key = Replacements()
    export(one, tmp_path / "o1.pcapng", Selection(), key=key)
    key.save(key_file)
    if sys.platform != "win32":
        assert stat.S_IMODE(key_file.stat().st_mode) == 0o600
    before = json.loads(key_file.read_text())
    again = Replacements.load(key_file)
    export(two, tmp_path / "o2.pcapng", Selection(), key=again)
    again.save(key_file)
    after = json.loads(key_file.read_text())
    assert before["ip"].items() < after["ip"].items()
    assert len(set(after["ip"].values())) == len(after["ip"])
    stations = [analyze(tmp_path / f"o{n}.pcapng").devices[0].station for n in (1, 2)]
    assert stations[0] == stations[1] == before["name"]["press-1-drive"]
    # backwards: the key gives the originals
    back = {new: old for old, new in after["ip"].items()}
    assert back[analyze(tmp_path / "o1.pcapng").devices[0].ip] == "192.168.133.33"


def test_a_replacement_is_never_an_original(tmp_path: Path) -> None:
    stage = Stage()
    client = Client(stage)
    client.host.ip, client.device.ip = "198.18.0.2", "198.18.0.1"
    client.host.mac, client.device.mac = "02:d4:70:00:00:02", "02:d4:70:00:00:01"
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    anonymised(source, target)
    data = target.read_bytes()
    for original in (bytes((198, 18, 0, 1)), bytes((198, 18, 0, 2)),
                     bytes.fromhex("02d470000001"), bytes.fromhex("02d470000002")):  # fmt: skip
        assert original not in data


def test_a_thing_that_is_no_key_file(tmp_path: Path) -> None:
    path = tmp_path / "key.json"
    for text in ("", "[]", "{}", '{"schema": "other"}', '{"schema": "ds47.key/1", "mac": 3}'):
        path.write_text(text)
        with pytest.raises(KeyFileError, match="not a key file"):
            Replacements.load(path)


@pytest.mark.parametrize(
    ("kind", "original", "new"),
    [
        ("mac", "02:00:00:00:00:01", "zz"),
        ("mac", "02:00:00:00:00:01", 3),
        ("mac", "x", "y"),
        ("ip", "10.0.0.1", "10.0.0"),
        ("ip", "10.0.0.1", "10.0.0.256"),
        ("name", "drive", "n"),
        ("name", "drive", "n\u20ac000"),
        ("uuid", "d4700000-0000-4000-8000-000000000001", "none"),
        ("value", "4 00000000", "2 00000000"),
        ("value", "4 00000000", "4 0000"),
        ("value", "4", "4"),
    ],
)
def test_a_key_file_that_somebody_changed(
    tmp_path: Path, kind: str, original: str, new: object
) -> None:
    path = tmp_path / "key.json"
    Replacements().save(path)
    document = json.loads(path.read_text())
    document[kind] = {original: new}
    path.write_text(json.dumps(document))
    with pytest.raises(KeyFileError) as problem:
        Replacements.load(path)
    text = f"{path}: {new!r} cannot replace the {kind} {original!r}: this key file was changed"
    assert str(problem.value) == text


@pytest.mark.parametrize(
    "part",
    [
        {"networks": {"10.0": ["198.18.0", 1]}},
        {"networks": {"10.0.0": [3, 1]}},
        {"counts": {"mac": float("inf")}},
    ],
    ids=str,
)
def test_a_key_file_whose_counts_somebody_changed(tmp_path: Path, part: dict[str, Any]) -> None:
    path = tmp_path / "key.json"
    Replacements().save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | part))
    with pytest.raises(KeyFileError, match="not a key file"):
        Replacements.load(path)


def test_lldp_and_dcp_option_by_option() -> None:
    from ds47.export.stations import dcp, lldp

    def both(change: Callable[[Replacements, bytes], bytes], data: bytes) -> bytes:
        key = Replacements()
        change(key, data)
        key.learning = False
        return change(key, data)

    def tlv(kind: int, value: bytes) -> bytes:
        return struct.pack(">H", kind << 9 | len(value)) + value

    mac = bytes.fromhex("001ff8000001")
    described = b"SINAMICS S120, S C-X4AB12, 00-1F-F8-00-00-01"
    data = tlv(1, b"\7" + described) + tlv(2, b"\7port-001.press-1-drive")
    data += tlv(3, b"\0\x14") + tlv(5, b"press-1-drive") + tlv(6, described)
    data += tlv(8, b"\5\1\xc0\xa8\x85\x21\2\0\0\0\1\0") + tlv(8, b"\7\6" + mac + b"\2\0\0\0\1\0")
    data += tlv(127, b"\x00\x0e\xcf\5" + mac) + tlv(127, b"\x00\x0e\xcf\6" + mac + bytes(range(40)))
    data += tlv(127, b"\x00\x80\xc2\3\0\1\x07vlan-77") + tlv(0, b"") + b"slack"
    out = both(lldp, data)
    assert len(out) == len(data)
    for secret in (b"press-1", b"S C-X4", mac, b"\xc0\xa8\x85\x21", b"vlan-77", b"slack"):
        assert secret not in out
    assert b"port-001." in out
    request = struct.pack(">HBBIHH", 0xFEFE, 5, 0, 1, 0, 18) + b"\2\2\0\x0dpress-1-drive\0"
    out = both(dcp, request + b"old frame")
    assert len(out) == len(request) + 9
    assert b"press-1" not in out
    assert b"old frame" not in out
    assert out[:16] == request[:16]
    settings = b"\0\0" + bytes((192, 168, 133, 33, 255, 255, 255, 0, 192, 168, 133, 1))
    frame = struct.pack(">HBBIHH", 0xFEFD, 4, 0, 1, 0, 40) + b"\1\2\0\x0e" + settings
    frame += b"\2\6\0\x18\0\0port-001.press-1-drive" + b"\x81\1\0\6\0\0abcd"
    out = both(dcp, frame)
    assert b"\xff\xff\xff\0" in out
    assert b"\xc0\xa8" not in out
    assert b"press-1" not in out
    assert b"abcd" not in out


@pytest.mark.slow
def test_broken_bytes_are_never_an_exception(tmp_path: Path) -> None:
    chance = random.Random(47)
    source, target = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    for name in ("naming-all", "transport-ip-fragments", "transport-rpc-fragments",
                 "record-multiple", "transport-sll", "record-polls", "format-mixed"):  # fmt: skip
        frames = list(whole_frames(CAPTURES / f"{name}.pcapng"))
        for _ in range(25):
            with PcapngWriter(source, link_type=frames[0].interface.link_type) as writer:
                for frame in frames:
                    data = bytearray(frame.data)
                    for _ in range(chance.choice((0, 0, 1, 4))):
                        data[chance.randrange(len(data))] = chance.randrange(256)
                    cut = chance.choice((len(data), len(data), chance.randrange(len(data))))
                    writer.write(frame.time_ns, bytes(data[:cut]), len(data))
            for everything in (False, True):
                export(source, target, Selection(), key=Replacements(), everything=everything)


# What was not read does not leave


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize(("mtu", "fragment", "snap"), [(800, None, 300), (None, 200, 250)])
def test_nothing_behind_a_hole_leaves(
    tmp_path: Path, mtu: int | None, fragment: int | None, snap: int, everything: bool
) -> None:
    stage = Stage()
    client = Client(stage)
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    stage.mtu, client.fragment, stage.snap = mtu, fragment, snap
    texts = [f"filler-{number}-".encode() * 12 for number in range(6)] + [b"name-of-customer"]
    pairs = [(message.address(8900, 0, len(each)), block(0x41, len(each), each)) for each in texts]
    client.exchange(message.change(2, 1, *pairs), message.changed(2, 1, len(pairs)))
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    outcome, _ = anonymised(source, target, everything=everything)
    data = target.read_bytes()
    assert b"filler" not in data
    assert b"customer" not in data
    assert len(outcome.frames) == len(stage.shots)
    assert stories(analyze(target), None, False) == stories(outcome.result, outcome, False)
    frames = zip(whole_frames(source), whole_frames(target), strict=True)
    assert all(len(before.data) == len(after.data) for before, after in frames)


def test_values_of_nobody_knows_what_are_replaced(tmp_path: Path) -> None:
    """Lost: the Write that asked. Another one asked before, so the second response looks like its."""
    stage = Stage()
    client = talk(stage)
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    client.write(message.read(2, 1, message.address(21)))
    client.read(message.answer(3, 1, 1, block(OCTETS, 16, b"name-of-customer")))
    client.read(message.answer(4, 1, 1, block(OCTETS, 16, b"a-second-secret.")))
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    anonymised(source, target)
    data = target.read_bytes()
    assert b"customer" not in data
    assert b"second" not in data
    assert analyze(target).transactions[0].parameters[0].values == [1.0]


@pytest.mark.parametrize(
    "record",
    [
        message.read(2, 1, message.address(21)) + SECRET,  # behind the message
        message.change(2, 1, (message.address(21), block(0xEE, 16, SECRET))),  # unknown format
        bytes((2, 0x77, 1, 2)) + SECRET,  # unknown kind
        bytes((2, 1, 1, 9)) + SECRET,  # fewer addresses than it says: the last one is not whole
    ],
)
def test_bytes_of_a_message_that_are_not_read(record: bytes, tmp_path: Path) -> None:
    stage = Stage()
    client = talk(stage)
    client.exchange(message.read(1, 1, message.address(21)),
                    message.answer(1, 1, 1, message.real(1.0)))  # fmt: skip
    client.write(record)
    client.read(bytes((2, 0x77, 1, 1)) + SECRET)
    source, target = shoot(stage, tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    for everything in (False, True):
        anonymised(source, target, everything=everything)
        assert b"customer" not in target.read_bytes()


def test_a_part_of_an_address_is_no_address() -> None:
    key = Replacements()
    assert key.mac(b"\0\x1f\xf8") == bytes(3)
    assert key.ip(b"\xc0\xa8") == bytes(2)
    assert key.uuid(b"GGGG") == bytes(4)


def test_an_option_keeps_no_more_than_it_has() -> None:
    from ds47.export.stations import dcp, lldp

    def option(number: int, suboption: int, data: bytes) -> bytes:
        return bytes((number, suboption)) + struct.pack(">H", len(data)) + data

    def frame(service: int, kind: int, blocks: bytes) -> bytes:
        return struct.pack(">HBBIHH", 0xFEFD, service, kind, 1, 0, len(blocks)) + blocks

    numbers = [(2, 3), (2, 4), (2, 5), (2, 7), (2, 8), (2, 10), (5, 3), (5, 4), (6, 1), (255, 255)]
    every = b"".join(option(*each, b"\0\0\2\2\2\3" + SECRET) for each in numbers)
    for data in (frame(5, 1, every), frame(3, 0, SECRET)):
        out = dcp(Replacements(), data)
        assert len(out) == len(data)
        assert b"cust" not in out
    assert b"\2\5\0\x16\0\0\2\2\2\3" in dcp(Replacements(), frame(5, 1, every))
    values = {
        3: b"\0\x14", 7: b"\0\x10\0\x10", 8: b"\5\1\xc0\xa8\x85\x21\2\0\0\0\1\0",
        127: b"\x00\x12\x0f\1" + bytes(12),
    }  # fmt: skip
    for kind, value in values.items():
        data = struct.pack(">H", kind << 9 | len(value + SECRET)) + value + SECRET + b"\0\0"
        assert b"cust" not in lldp(Replacements(), data)


def test_a_copy_of_what_was_not_rewritten_is_refused() -> None:
    foreign, copy, drafts = Trace(data=SECRET), Trace(), Drafts()
    drafts.add(WholeFrame(2, 0, Interface(1, 0), bytes(14 + 20) + SECRET, 50))
    copy.add(DatagramPiece(2, 0, 34, 0, len(SECRET)))
    story_of = TrackedMessage("foreign", 1, 0, parts=[[foreign]])
    assert not Anonymiser(Replacements(), Knowledge()).copy(Copy(story_of, copy, foreign), drafts)
