"""Everything below RPC and TPKT, as scapy layers: Ethernet, VLAN tags, Linux cooked headers, IPv4, UDP, TCP.

The only file of the lab that knows scapy, which is imported when a frame is made and not before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from typing import Any

ETHERNET, COOKED, COOKED2 = 1, 113, 276
"""Link types of a capture file."""

PNIO_PORT = 34964
CTAG, STAG = 0x8100, 0x88A8


@dataclass(slots=True)
class Host:
    """A controller or device on the wire. Its IP identification counts up from a fixed start."""

    ip: str
    mac: str
    port: int = PNIO_PORT
    device_id: int = 0x0501
    vendor_id: int = 0x002A
    identification: count[int] = field(default_factory=lambda: count(0x4700))


def udp(source: Host, target: Host, ports: tuple[int, int], payload: bytes) -> Any:
    """The IPv4 packet; ports are (source, target)."""
    from scapy.layers.inet import IP, UDP

    head = IP(src=source.ip, dst=target.ip, id=next(source.identification) & 0xFFFF, ttl=64)
    return head / UDP(sport=ports[0], dport=ports[1]) / payload


def tcp(
    source: Host,
    target: Host,
    ports: tuple[int, int],
    flags: str,
    numbers: tuple[int, int],
    payload: bytes,
) -> Any:
    """The IPv4 packet; ports are (source, target), numbers (sequence, acknowledged), flags letters of scapy."""
    from scapy.layers.inet import IP, TCP

    head = IP(
        src=source.ip, dst=target.ip, id=next(source.identification) & 0xFFFF, ttl=64, flags="DF"
    )
    sequence, acknowledged = numbers
    segment = TCP(
        sport=ports[0], dport=ports[1], flags=flags, seq=sequence, ack=acknowledged, window=8192
    )
    return head / segment / payload


def fragments(packet: Any, size: int | None) -> list[Any]:
    """The packet, or its IP fragments of at most `size` bytes of IP payload each."""
    from scapy.layers.inet import fragment

    return [packet] if size is None else list(fragment(packet, fragsize=size))


def framed(
    packet: Any, macs: tuple[str, str], link: int = ETHERNET, tags: Sequence[tuple[int, int]] = ()
) -> bytes:
    """The packet under its link header; macs are (source, target), tags (ethertype, VLAN id)."""
    from scapy.layers.l2 import CookedLinux, CookedLinuxV2, Dot1AD, Dot1Q, Ether

    if link == COOKED:
        mac = bytes.fromhex(macs[0].replace(":", ""))
        return bytes(
            CookedLinux(pkttype=0, lladdrtype=1, lladdrlen=6, src=mac, proto=0x0800) / packet
        )
    if link == COOKED2:
        mac = bytes.fromhex(macs[0].replace(":", ""))
        return bytes(
            CookedLinuxV2(
                proto=0x0800, ifindex=2, lladdrtype=1, pkttype=0, lladdrlen=6, src=mac + bytes(2)
            )
            / packet
        )
    frame: Any = Ether(src=macs[0], dst=macs[1])
    for ethertype, vlan in tags:
        frame = frame / (
            Dot1AD(vlan=vlan, prio=6) if ethertype == STAG else Dot1Q(vlan=vlan, prio=6)
        )
    return bytes(frame / packet)


def bare(source: str, target: str, ethertype: int, payload: bytes) -> bytes:
    """A frame without IP: DCP, LLDP, cyclic data."""
    return _header(source, target, ethertype) + payload


@cache
def _header(source: str, target: str, ethertype: int) -> bytes:
    """Made once for all the cycles of a relation."""
    from scapy.layers.l2 import Ether

    return bytes(Ether(src=source, dst=target, type=ethertype))
