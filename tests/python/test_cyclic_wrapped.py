"""PKW and PZD are the same whatever is around their frames: VLAN tags, cooked headers, IP fragments."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from test_parameter_channels import BOTH, Machine, short, talk
from test_wireshark_cyclic import compare, saved
from test_wireshark_plugin import COMPLETE, Tshark, columns, rows, tshark
from tests.audit import run

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.scan import ETHERNET, SLL, SLL2
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult

__all__ = ["tshark"]  # the fixture
Around = Callable[[bytes], Iterator[bytes]]
IP, UDP, LEAST = 14, 34, 96


def two_tags(data: bytes) -> Iterator[bytes]:
    yield data[:12] + bytes.fromhex("88a800078100c000") + data[12:]


def cooked(data: bytes) -> Iterator[bytes]:
    yield b"\0\0\0\1\0\6" + data[6:12] + b"\0\0" + data[12:]


def cooked2(data: bytes) -> Iterator[bytes]:
    yield data[12:14] + bytes(6) + b"\0\1\0\6" + data[6:12] + b"\0\0" + data[14:]


def fragments(data: bytes) -> Iterator[bytes]:
    """An IP datagram in two parts, as far as it is longer than the first."""
    if data[12:14] != b"\x08\x00" or len(data) <= UDP + LEAST:
        yield data
        return
    end = IP + int.from_bytes(data[IP + 2 : IP + 4])
    for first, behind, flags in ((0, LEAST, 0x2000), (LEAST, end - UDP, LEAST // 8)):
        head = bytearray(data[:UDP])
        head[IP + 2 : IP + 4] = (UDP - IP + behind - first).to_bytes(2)
        head[IP + 6 : IP + 8] = flags.to_bytes(2)
        yield bytes(head) + data[UDP + first : UDP + behind]


def backwards(data: bytes) -> Iterator[bytes]:
    """The same, the first part behind the second."""
    yield from reversed(list(fragments(data)))


WAYS: dict[str, tuple[Around, int]] = {
    "two tags": (two_tags, ETHERNET), "SLL": (cooked, SLL), "SLL2": (cooked2, SLL2),
    "fragments": (fragments, ETHERNET), "fragments backwards": (backwards, ETHERNET),
}  # fmt: skip


def wrapped(content: bytes, way: str) -> bytes:
    around, link = WAYS[way]
    target = io.BytesIO()
    with open_capture(io.BytesIO(content)) as capture, PcapngWriter(target, link) as writer:
        for frame in capture.everything():
            for data in around(frame.data):
                writer.write(frame.time_ns, data, len(data))
    return target.getvalue()


def said(result: CaptureResult) -> dict[str, Any]:
    """What does not depend on the numbers of the frames."""
    return {
        "transactions": [short(each) for each in result.transactions],
        "rules": sorted(each.rule for each in result.findings),
        "events": [
            (each.name, each.time_ns) for line in result.timelines for each in line.events
        ],
        "relations": [
            (each.device, each.channel, each.certainty, each.output.offset, each.input.offset)
            for each in result.relations
        ],
    }  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_pkw_is_the_same(way: str) -> None:
    content = talk(Machine().connect()).capture()
    result = analyze(io.BytesIO(wrapped(content, way)))
    assert [short(each) for each in result.transactions] == BOTH
    assert said(result) == said(analyze(io.BytesIO(content)))


@pytest.mark.parametrize("way", WAYS)
def test_pzd_is_the_same(captures: Path, way: str) -> None:
    content = (captures / "cyclic-does-not-start.pcapng").read_bytes()
    found = said(analyze(io.BytesIO(wrapped(content, way))))
    assert found == said(analyze(io.BytesIO(content)))
    assert "DS523" in found["rules"]


@pytest.mark.parametrize("way", WAYS)
def test_the_auditor_reads_the_same(captures: Path, tmp_path: Path, way: str) -> None:
    path = tmp_path / "wrapped.pcapng"
    for content in (
        talk(Machine().connect()).capture(),
        (captures / "cyclic-does-not-start.pcapng").read_bytes(),
    ):
        path.write_bytes(wrapped(content, way))
        assert [str(each) for each in run.audit(path)] == []


@pytest.mark.parametrize("way", WAYS)
def test_the_plugin_shows_the_same(
    tshark: Tshark, tmp_path: Path, captures: Path, way: str
) -> None:
    path = saved(tmp_path, wrapped(talk(Machine().connect()).capture(), way))
    assert compare(tshark, path, *COMPLETE) == 2
    content = (captures / "cyclic-does-not-start.pcapng").read_bytes()
    path = saved(tmp_path, wrapped(content, way))
    shown = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.zsw1", *columns("ds47.pzd.zsw1")))
    assert len(shown) > 100


def test_the_capture_of_a_connect_in_fragments(captures: Path) -> None:
    result = analyze(captures / "field/connect-response-in-fragments.pcapng")
    assert [each.rule for each in result.findings] == ["DS523"]
