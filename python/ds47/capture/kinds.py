"""The kinds of frames in a capture without PROFINET, PROFIBUS and S7, so that a user sees what was captured.

Not here: which frames matter (scan.py).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import islice
from typing import Final

from .frame import Frame
from .scan import IPV4, TCP, UDP, network_layer

FRAMES: Final = 10_000
"""How many frames to look at."""
ETHER_TYPES: Final = {
    0x0806: "ARP", 0x86DD: "IPv6", 0x8892: "PROFINET", 0x88A4: "EtherCAT", 0x88AB: "POWERLINK", 0x88CC: "LLDP",
    0x88E3: "MRP", 0x88F7: "PTP", 0x8847: "MPLS",
}  # fmt: skip
_PROTOCOLS: Final = {1: "ICMP", 2: "IGMP", TCP: "TCP", UDP: "UDP"}
_PORTS: Final = {502: "Modbus TCP", 2222: "EtherNet/IP", 4840: "OPC UA", 44818: "EtherNet/IP"}
"""Ports of other protocols of machines: the capture is from the wrong line, or the wrong port of the switch."""
_LENGTHS: Final = 0x0600
"""Below it an EtherType is a length."""


def kinds(frames: Iterable[Frame]) -> dict[str, int]:
    """How many of the first FRAMES frames are of each kind, the most frequent first: `{"TCP": 20, "ARP": 2}`."""
    return dict(Counter(map(_kind, islice(frames, FRAMES))).most_common())


def _kind(frame: Frame) -> str:
    data = frame.data
    kind, at = network_layer(data, 0, len(data), frame.link_type)
    if kind != IPV4:
        return ETHER_TYPES.get(kind) or ("LLC" if 0 < kind < _LENGTHS else "other")
    if len(data) < at + 20:
        return "IPv4"
    protocol, start = data[at + 9], at + (data[at] & 15) * 4
    ports = data[start : start + 4]
    if protocol in (TCP, UDP) and len(ports) == 4:
        for port in (int.from_bytes(ports[2:]), int.from_bytes(ports[:2])):
            if port in _PORTS:
                return _PORTS[port]
    return _PROTOCOLS.get(protocol, "IPv4")
