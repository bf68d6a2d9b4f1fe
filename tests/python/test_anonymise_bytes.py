"""`ds47 export --anonymise` proves itself: whatever byte changes, what its export shows of that is on a list.

The list is anonymised_fields.py: every field of every frame by name. A change of any other byte leaves the export
as it was, to the last byte.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from anonymised_fields import KEPT, MARKED, REPLACED, UNREAD, Field, fields_of
from frames import whole_frames

from ds47.capture import PcapngWriter
from ds47.export import Replacements, Selection, anonymise, blocks, export, stations
from ds47.lab import ether, message
from ds47.lab.client import Client
from ds47.lab.cyclic import Cyclic
from ds47.lab.naming import DCP, LLDP, LLDP_MULTICAST, dcp_identify, lldp
from ds47.lab.stage import Stage

PATTERNS = (0xFF, 0x5A, 0x01)
"""What the bytes are changed by."""


def dcp_response(*options: tuple[int, int, bytes]) -> bytes:
    """A DCP Identify response with these options, each with a block information of its own."""
    body = b""
    for number, suboption, data in options:
        body += (
            struct.pack(">BBHH", number, suboption, len(data) + 2, 1) + data + bytes(len(data) % 2)
        )
    return struct.pack(">HBBIHH", 0xFEFF, 5, 1, 0x4701, 0, len(body)) + body


def said(client: Client) -> None:
    """DCP, LLDP, a Connect with cyclic relations, parameters, another record, a Release."""
    plc, motor = client.host, client.device
    client.stage.frame(ether.bare(motor.mac, plc.mac, DCP, dcp_identify(motor, "press-1-drive")))
    options = ((2, 4, b"\1\0"), (0x80, 3, b"of the maker!"), (2, 2, b"press-1-drive"))
    client.stage.frame(ether.bare(motor.mac, plc.mac, DCP, dcp_response(*options)))
    client.stage.frame(ether.bare(motor.mac, LLDP_MULTICAST, LLDP, lldp(motor, "press-1-drive")))
    Cyclic(client).connect("plc-hall-7")
    ramp, bytes_of = message.address(1120), message.address(2000, 0, 3)
    client.exchange(message.change(1, 1, (ramp, message.real(20.0))), message.changed(1, 1))
    read = message.read(2, 1, ramp, bytes_of)
    answer = message.answer(2, 1, 1, message.real(20.0), message.raw_block(0x41, 3, b"\1\2\3"))
    client.exchange(read, answer, polls=1)
    client.read(b"serial number of something", at=client.at(index=0xAFF0))
    client.release()


@cache
def frames() -> tuple[bytes, ...]:
    """The frames of a short capture: both byte orders, a VLAN tag, paddings behind the frames."""
    shots = []
    for order in ("<", ">"):
        stage = Stage()
        said(Client(stage, order=order))  # type: ignore[arg-type]
        shots += [shot.data for shot in stage.shots]
    tagged = shots[-1]
    shots.append(tagged[:12] + b"\x81\0\xc0\5" + tagged[12:])
    return tuple(data + bytes(4) for data in shots)


def exported(shots: Sequence[bytes], path: Path) -> bytes:
    """The anonymised export of a capture of these frames, as a file."""
    with PcapngWriter(path) as writer:
        for number, data in enumerate(shots):
            writer.write(number * 2_000_000, data)
    out = io.BytesIO()
    export(path, out, Selection(), key=Replacements())
    return out.getvalue()


def changed(data: bytes, fields: Sequence[Field], by: int) -> bytes:
    """The frame with all bytes of these fields changed."""
    out = bytearray(data)
    for each in fields:
        out[each.start : each.end] = bytes(byte ^ by for byte in out[each.start : each.end])
    return bytes(out)


def unread(data: bytes) -> list[Field]:
    """The fields of a frame that must not be in the export."""
    return [each for each in fields_of(data) if each.kind == UNREAD]


def shown(path: Path, numbers: Iterable[int], patterns: Sequence[int] = PATTERNS) -> set[str]:
    """Names of the fields that must not be in the export, and change it nevertheless."""
    before, found = exported(frames(), path), set()
    for number in numbers:
        for by in patterns:
            if differs(path, before, number, unread(frames()[number]), by):
                fields = unread(frames()[number])
                found |= {
                    each.name for each in fields if differs(path, before, number, [each], by)
                } or {"all together"}
    return found


def differs(path: Path, before: bytes, number: int, fields: Sequence[Field], by: int) -> bool:
    """Whether the export changes with these fields of a frame."""
    shots = list(frames())
    shots[number] = changed(shots[number], fields, by)
    return exported(shots, path) != before


@pytest.mark.parametrize("number", range(len(frames())))
def test_the_list_has_every_byte(number: int) -> None:
    data = frames()[number]
    fields = fields_of(data)
    assert {each.kind for each in fields} <= {KEPT, REPLACED, MARKED, UNREAD}
    assert all(first.end == second.start for first, second in pairwise(fields))
    assert (fields[0].start, fields[-1].end) == (0, len(data))


def test_what_is_not_on_the_list_is_not_in_the_export(tmp_path: Path) -> None:
    assert shown(tmp_path / "in.pcapng", range(len(frames()))) == set()


@pytest.mark.slow
def test_no_single_byte_beside_the_list_is_in_the_export(tmp_path: Path) -> None:
    path = tmp_path / "in.pcapng"
    before = exported(frames(), path)
    for number, data in enumerate(frames()):
        for each in unread(data):
            for at in range(each.start, each.end):
                single = Field(each.name, at, at + 1, UNREAD)
                assert not differs(path, before, number, [single], 0x80), (number, each, at)


@pytest.mark.parametrize(
    ("module", "name", "instead", "seen"),
    [
        (anonymise, "_UNREAD", (), {"boot time", "more flags", "authentication, serial number"}),
        (anonymise, "_cleared", bytes, {"hints", "interface version", "boot time"}),
        (anonymise, "_TAGS", {ether.ETHERNET: 99}, {"priority and VLAN"}),
        (blocks, "blank", bytes, {"offset of array", "padding of place", "padding of record"}),
        (blocks, "_LIFE", None, {"reserved"}),
        (stations, "blank", bytes, {"unknown option", "padding of option", "padding of frame"}),
        (stations, "_DELAY", slice(0, 0), {"delay"}),
    ],
)
def test_a_field_that_is_not_cleared_is_found(
    module: Any,
    name: str,
    instead: Any,
    seen: set[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if name == "_LIFE":
        plain = replace(blocks._LIFE, words=())
        monkeypatch.setattr(blocks, "_BLOCKS", {**blocks._BLOCKS, 0x0114: plain, 0x8114: plain})
    else:
        monkeypatch.setattr(module, name, instead)
    first = (1, 5, 8, 15, len(frames()) - 1)
    assert shown(tmp_path / "in.pcapng", first, PATTERNS[:1]) >= seen


def test_what_is_on_the_list_is_there_or_replaced(tmp_path: Path) -> None:
    copies = copied(exported(frames(), tmp_path / "in.pcapng"), tmp_path)
    assert len(copies) == len(frames())
    for data, copy in zip(frames(), copies, strict=True):
        for each in fields_of(data):
            same = data[each.start : each.end] == copy[each.start : each.end]
            group = each.name == "destination" and data[0] & 1  # multicast
            if each.kind in (KEPT, REPLACED):
                assert same == (each.kind == KEPT or bool(group)), each


def test_an_original_that_changes_does_not_show(tmp_path: Path) -> None:
    for number, data in enumerate(frames()):
        fields = [each for each in fields_of(data) if each.kind == REPLACED]
        shots = list(frames())
        shots[number] = changed(data, fields, 0x14)
        copies = b"".join(copied(exported(shots, tmp_path / "in.pcapng"), tmp_path))
        for each in fields:
            if not (each.name == "destination" and data[0] & 1):
                assert shots[number][each.start : each.end] not in copies, each


def test_a_padding_of_values_only_shows_that_it_is_not_zero(tmp_path: Path) -> None:
    marked = [
        (number, each)
        for number, data in enumerate(frames())
        for each in fields_of(data)
        if each.kind == MARKED
    ]
    assert marked
    for number, each in marked:
        shots = list(frames())
        shots[number] = changed(shots[number], [each], 0x5A)
        copy = copied(exported(shots, tmp_path / "in.pcapng"), tmp_path)[number]
        assert copy[each.start : each.end] == b"\xa5"


def test_what_stands_behind_the_lists_of_a_block_is_not_in_the_export() -> None:
    cyclic, text = Cyclic(Client(Stage())), b"of customer"
    diff = struct.pack(">HHHHIHHIHHHIH", 0x8104, 30, 0x100, 1, 0, 1, 2, 0x4700, 0, 1, 2, 0x4711, 7)
    for block in (cyclic._relation(1, 0x8001), cyclic._expected(), diff):
        longer = block[:2] + struct.pack(">H", len(block) - 4 + len(text)) + block[4:] + text
        assert blocks._blocks(Replacements(), block) == block
        assert blocks._blocks(Replacements(), longer) == longer[: len(block)] + bytes(len(text))


def copied(export_: bytes, folder: Path) -> list[bytes]:
    """The frames of an export."""
    target = folder / "out.pcapng"
    target.write_bytes(export_)
    return [each.data for each in whole_frames(target)]
