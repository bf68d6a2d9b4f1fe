"""The layers for scapy: every vector and every stored capture, and the examples of the documentation."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
from of_profibus import of_ethernet
from scapy.contrib.pnio_rpc import (
    IODReadRes,
    IODWriteMultipleReq,
    IODWriteReq,
    PNIOServiceReqPDU,
    PNIOServiceResPDU,
)
from scapy.layers.dcerpc import DceRpc4
from scapy.layers.inet import IP, UDP
from scapy.layers.l2 import Ether
from scapy.packet import Packet, Raw
from scapy.utils import rdpcap

from ds47.analysis import analyze
from ds47.capture.writer import PcapngWriter
from ds47.model import S7
from ds47.scapy import DS47Address, DS47Block, DS47Request, DS47Response

ROOT = Path(__file__).resolve().parents[2]
MESSAGES = json.loads((ROOT / "tests/vectors/messages.json").read_text(encoding="utf-8"))[
    "messages"
]
WHOLE = [vector for vector in MESSAGES if len(vector["hex"]) >= 8]
CAPTURES = of_ethernet(sorted((ROOT / "captures").rglob("*.pcapng")))
OBJECT = UUID("dea00000-6c97-11d1-8271-00010501002a")
# A second response with other bytes belongs to no transaction (DS111).
UNUSED = {"transport-second-response.pcapng": 1}
# Messages in fragments, in an IODWriteMultiple (a field scapy does not search), between two ports that
# are not 34964, cut by the snap length, or on index 47 without the shape of one: not seen by scapy.
UNSEEN = {
    "transport-ip-fragments.pcapng": 3,
    "transport-ip-fragments-disorder.pcapng": 2,
    "transport-ip-fragments-incomplete.pcapng": 2,
    "transport-rpc-fragments.pcapng": 2,
    "transport-rpc-fragments-incomplete.pcapng": 1,
    "transport-ephemeral-port.pcapng": 3,
    "transport-snap-length.pcapng": 1,
    "record-multiple.pcapng": 3,
    "record-multiple-refused.pcapng": 3,
    "record-foreign-then-ours.pcapng": 1,
    **dict.fromkeys(  # a message without the shape of one is no layer on index 47
        (
            "diagnosis-bytes-swapped.pcapng",
            "diagnosis-data-block-layout-even.pcapng",
            "diagnosis-data-block-layout.pcapng",
            "diagnosis-half-captured-cut.pcapng",
            "diagnosis-read-length.pcapng",
            "diagnosis-request-length.pcapng",
        ),
        1,
    ),
    "o1_profinetpy062_be.pcapng": 5,
    "o2_pyprofinet_le.pcapng": 4,
}


def layer(vector: dict[str, Any]) -> type[Packet]:
    return DS47Request if vector["kind"] == "request" else DS47Response


def frame(blocks: list[Packet], *, response: bool = False, endian: int = 1) -> Packet:
    """A whole frame around record blocks."""
    body = PNIOServiceResPDU if response else PNIOServiceReqPDU
    rpc = DceRpc4(endian=endian, opnum=3, object=OBJECT, act_id=UUID(int=1), flags1="idempotent")
    hosts = IP(src="192.168.133.2", dst="192.168.133.33") / UDP()
    return (
        Ether(src="00:1c:06:00:00:01", dst="00:1f:f8:00:00:01") / hosts / rpc / body(blocks=blocks)
    )


def record(message: Packet, **header: Any) -> Packet:
    header = {"ARUUID": UUID(int=47), "slotNumber": 1, "subslotNumber": 1} | header
    block = IODWriteReq if isinstance(message, DS47Request) else IODReadRes
    return block(**header) / message


@pytest.mark.parametrize("vector", WHOLE, ids=lambda vector: vector["id"])
def test_a_vector_comes_out_as_it_went_in(vector: dict[str, Any]) -> None:
    message, expect = layer(vector)(bytes.fromhex(vector["hex"])), vector["expect"]
    for name in ("request_reference", "request_id", "response_id", "axis", "parameter_count"):
        if name in expect:
            assert getattr(message, name) == expect[name], name
    assert bytes(message).hex() == vector["hex"]
    message.clear_cache()
    assert bytes(message).hex() == vector["hex"]
    assert message.show(dump=True).count("parameter_count") == 1


@pytest.mark.parametrize("vector", WHOLE, ids=lambda vector: vector["id"])
def test_a_vector_can_be_built_from_its_fields(vector: dict[str, Any]) -> None:
    seen = layer(vector)(bytes.fromhex(vector["hex"]))
    parts = {
        name: [type(part)(**part.fields) for part in seen.fields[name]]
        for name in ("addresses", "blocks")
        if name in seen.fields
    }
    assert bytes(type(seen)(**(seen.fields | parts))).hex() == vector["hex"]


@pytest.mark.parametrize("vector", MESSAGES, ids=lambda vector: vector["id"])
@pytest.mark.parametrize("endian", [0, 1])
def test_a_vector_in_a_frame(vector: dict[str, Any], endian: int) -> None:
    data, is_answer = bytes.fromhex(vector["hex"]), vector["kind"] == "response"
    block = (IODReadRes if is_answer else IODWriteReq)(ARUUID=UUID(int=47), index=0xB02F) / Raw(
        data
    )
    received = Ether(bytes(frame([block], response=is_answer, endian=endian)))
    assert (layer(vector) in received) == (len(data) >= 4)
    if len(data) >= 4:
        assert bytes(received[layer(vector)]) == data


def test_the_first_parameter_is_at_hand() -> None:
    request = DS47Request(
        addresses=[DS47Address(pnu=2902, subindex=2, element_count=4), DS47Address(pnu=21)]
    )
    assert (request.pnu, request.subindex, request.attribute, request.element_count) == (
        2902,
        2,
        0x10,
        4,
    )
    assert request.parameter_count is None
    assert bytes(request).hex() == "01010102" + "10040b560002" + "100100150000"
    response = DS47Response(
        response_id=0x81, blocks=[DS47Block(format=0x44, error_words=[0x6B, 1])]
    )
    assert bytes(response).hex() == "01810101" + "4402006b0001"
    assert (response.format, response.error_words, response.values) == (0x44, [0x6B, 1], [])
    assert (DS47Request().pnu, DS47Response().values) == (None, None)


def test_a_change_without_errors_has_a_header_alone() -> None:
    assert (
        bytes(DS47Response(request_reference=9, response_id="change", axis=2)).hex() == "09020201"
    )


def test_values_that_do_not_fit_are_wrong_use() -> None:
    with pytest.raises(ValueError, match="256 does not fit Unsigned8"):
        bytes(DS47Response(blocks=[DS47Block(format=5, values=[256])]))
    with pytest.raises(ValueError, match="error_words"):
        bytes(DS47Response(blocks=[DS47Block(format=0x44)]))


def test_broken_messages_can_be_built() -> None:
    block = DS47Block(format=0x7F, value_count=3, raw=b"\1\2\3", pad=b"\xff")
    request = DS47Request(
        parameter_count=9, addresses=[DS47Address(pnu=1)], blocks=[block], rest=b"\0"
    )
    assert bytes(request).hex() == "01010109" + "100100010000" + "7f03010203ff" + "00"


def test_lengths_and_the_index_come_by_themselves() -> None:
    received = Ether(bytes(frame([record(DS47Request(addresses=[DS47Address(pnu=50303)]))])))
    block = received[IODWriteReq]
    assert (block.index, block.recordDataLength, block.block_length) == (47, 10, 60)
    assert received[PNIOServiceReqPDU].args_length == 74
    assert received[UDP].dport == 34964
    assert received[DS47Request].pnu == 50303
    assert "50303" in received.show(dump=True)


def test_a_change_of_what_was_received_is_sent() -> None:
    block = DS47Block(format="Float32", values=[100.0])
    change = DS47Request(request_id="change", addresses=[DS47Address(pnu=50304)], blocks=[block])
    received = Ether(bytes(frame([record(change)])))
    received[DS47Request].addresses[0].pnu = 21
    received[DS47Request].blocks[0].values = [5.0]
    assert bytes(received)[-16:].hex() == "01020101" + "100100150000" + "080140a00000"
    received[DS47Request].axis = 9
    assert Ether(bytes(received))[DS47Request].axis == 9


def test_several_records_in_one_frame() -> None:
    requests = [record(DS47Request(axis=n, addresses=[DS47Address(pnu=n)])) for n in (1, 2, 3)]
    multiple = IODWriteMultipleReq(ARUUID=UUID(int=47), blocks=requests)
    received = Ether(bytes(frame([multiple])))
    assert [b[DS47Request].pnu for b in received[IODWriteMultipleReq].blocks] == [1, 2, 3]


def test_record_47_of_something_else_stays_raw() -> None:
    for text in (b"Hello, world", b"\xff" * 8, b"\1\1"):
        block = IODWriteReq(ARUUID=UUID(int=47), index=47) / Raw(text)
        received = Ether(bytes(frame([block])))
        assert DS47Request not in received
        assert received[Raw].load == text


@pytest.mark.slow
@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.name)
def test_a_stored_capture(path: Path) -> None:
    result = analyze(path)
    ours = [each for each in result.transactions if each.channel != S7]
    there = {data for each in ours for data in (each.request, each.response) if data}
    seen = set()
    for packet in rdpcap(str(path)):
        for kind in (DS47Request, DS47Response):
            number = 1
            while (message := packet.getlayer(kind, number)) is not None:
                seen.add(bytes(message))
                number += 1
        assert bytes(packet) == packet.original
    assert len(seen - there) == UNUSED.get(path.name, 0)
    assert len(there - seen) == UNSEEN.get(path.name, 0)


def test_what_is_built_is_what_the_analyzer_reads(tmp_path: Path) -> None:
    path = tmp_path / "built.pcapng"
    change = DS47Request(
        request_reference=7,
        request_id="change",
        axis=2,
        addresses=[DS47Address(pnu=50304), DS47Address(pnu=2900, element_count=3)],
        blocks=[DS47Block(format=8, values=[100.0]), DS47Block(format=5, values=[1, 2, 3])],
    )
    with PcapngWriter(path) as writer:
        writer.write(0, bytes(frame([record(change)])))
    (transaction,) = analyze(path).transactions
    assert (transaction.request_reference, transaction.axis) == (7, 2)
    assert [p.values for p in transaction.parameters] == [[100.0], [1, 2, 3]]
    assert [p.pnu for p in transaction.parameters] == [50304, 2900]


def test_the_examples_of_the_documentation(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs/engines.md").read_text(encoding="utf-8")
    looking, making = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    captures = ROOT / "captures"
    exec(looking.replace('"captures/', f'"{captures}/'), {})
    said = capsys.readouterr().out.splitlines()
    assert said
    assert all(line.startswith(("read ", "got [")) for line in said)
    names: dict[str, Any] = {}
    exec(making, names)
    assert capsys.readouterr().out.strip() == "07020101" + "10010b560002" + "080141c80000"
    received = Ether(bytes(names["packet"]))
    assert (received[DS47Request].pnu, received[DS47Request].blocks[0].values) == (2902, [25.0])


def test_ds47_itself_does_not_need_scapy() -> None:
    program = (
        "import sys\n"
        "import ds47, ds47.cli, ds47.analysis, ds47.profidrive, ds47.lab, ds47.wireshark.engine\n"
        "assert not any(name.split('.')[0] in ('scapy', 'pyshark') for name in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
