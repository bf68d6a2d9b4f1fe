"""What a Connect sets up (profinet/connect), held against Wireshark's own dissector.

It finds the data of submodules in cyclic frames by the same Connect. The captures are those of real stacks:
their Connects, and their cyclic frames.
"""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47 import analysis
from ds47.profinet import connect, rpc
from ds47.profinet.stations import Stations
from ds47.spec.layouts import RPC_CONNECT

CAPTURES = (
    "real-stacks/o1_profinetpy062_be.pcapng",
    "real-stacks/o2_pyprofinet_le.pcapng",
    "real-stacks/o3_two_controllers.pcapng",
    "plc4x_working.pcapng",
)
SHOWN = 300
"""Frames that are held against tshark, of each capture."""
Area = tuple[str, int, int, int, int, int]
"""MAC address of the sender, frame id, slot, subslot, offset, length with IOPS."""


@pytest.fixture
def messages(monkeypatch: pytest.MonkeyPatch) -> list[rpc.Pdu]:
    """Collects the requests and responses of Connects while a capture is analysed."""
    heard: list[rpc.Pdu] = []
    told = Stations.message

    def message(self: Stations, pdu: rpc.Pdu) -> None:
        if pdu.opnum == RPC_CONNECT and pdu.ptype in (0, 2):
            heard.append(pdu)
        told(self, pdu)

    monkeypatch.setattr(Stations, "message", message)
    return heard


def areas(heard: list[rpc.Pdu]) -> set[Area]:
    """Where the data of submodules lies, by all Connects that were accepted."""
    asked: dict[bytes, connect.Connect] = {}
    found: set[Area] = set()
    for pdu in heard:
        if pdu.ptype == 0:
            request = connect.parse_request(pdu)
            if request is not None:
                asked[request.ar] = request
            continue
        response = connect.parse_response(pdu)
        if response is None or response[0] not in asked:
            continue
        ar, device_mac, frame_ids = response
        item = asked[ar].answered(frame_ids)
        for each in item.submodules:
            for mac, data in ((device_mac, each.input), (item.controller_mac, each.output)):
                if data is not None:
                    size = data.length + data.iops
                    found.add((mac, data.frame_id, each.slot, each.subslot, data.offset, size))
    return found


def dissected(path: Path) -> set[Area]:
    """The same by the cyclic frames of the capture, as tshark dissects them."""
    command = [
        "tshark",
        "-r",
        str(path),
        "-2",
        "-Y",
        "pn_rt.frame_id and pn_io.io_data_object",
        "-T",
        "pdml",
    ]
    text = subprocess.run(command, capture_output=True, check=True).stdout
    found: set[Area] = set()
    for packet in list(ET.fromstring(text))[:SHOWN]:
        source = next(
            each.get("show", "") for each in packet.iter() if each.get("name") == "eth.src"
        )
        frame_id = next(each for each in packet.iter() if each.get("name") == "pn_rt.frame_id")
        start = int(frame_id.get("pos", "0")) + 2
        for item in packet.iter():
            if item.get("name") != "pn_io.io_data_object" or item.get("size") == "1":
                continue  # one byte: the IOPS of a submodule without data
            place = re.search(
                r"Slot: 0x([0-9a-f]+) Subslot: 0x([0-9a-f]+)", item.get("showname", ""), re.I
            )
            assert place is not None
            found.add((
                source, int(frame_id.get("show", "0")), int(place[1], 16), int(place[2], 16),
                int(item.get("pos", "0")) - start, int(item.get("size", "0")),
            ))  # fmt: skip
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", CAPTURES)
def test_the_data_of_submodules_lies_where_tshark_finds_it(
    name: str, shared: Path, messages: list[rpc.Pdu]
) -> None:
    path = shared / "captures" / name
    analysis.analyze(path)
    seen = dissected(path)
    assert seen
    assert seen <= areas(messages)


# Hostile input


def pdu(body: bytes) -> rpc.Pdu:
    head = (0, True, bytes(16), bytes(16), 0, RPC_CONNECT, 0, True, False)
    return rpc.Pdu(*head, body, 0, 1, 0, "a", "b", 0, 0, None, "a", "b")


@given(st.binary(max_size=300))
def test_any_bytes_are_a_connect_or_none(body: bytes) -> None:
    connect.parse_request(pdu(body))
    connect.parse_response(pdu(body))


def test_a_connect_that_is_cut_says_nothing_else(shared: Path, messages: list[rpc.Pdu]) -> None:
    analysis.analyze(shared / "captures" / CAPTURES[3])
    whole = messages[0].body
    full = connect.parse_request(messages[0])
    assert full is not None
    assert full.submodules
    true = {(each.slot, each.subslot): {each.input, each.output, None} for each in full.submodules}
    for length in range(len(whole)):
        found = connect.parse_request(pdu(whole[:length]))
        for each in () if found is None else found.submodules:
            assert {each.input, each.output} <= true[each.slot, each.subslot], length
