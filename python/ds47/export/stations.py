"""DCP and LLDP without names: the same frame, its addresses and texts replaced.

What a frame of these kinds may say is known option by option; what is not known becomes zeros.
`ds47.profinet.dcp` and `.lldp` read the few of them that name a station.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from .mapping import Replacements

_GET, _SET, _IDENTIFY, _HELLO = 3, 4, 5, 6
_REQUEST = 0
_DCP_HEADER, _DELAY = 12, slice(8, 10)

_RESERVED = range(7, 128)
"""No options, but letters and digits."""

_PORT = re.compile(rb"port-\d{3}(-\d{5})?", re.IGNORECASE)
_END, _CHASSIS, _PORT_ID, _TTL, _CAPABILITIES, _MANAGEMENT, _ORGANISATION = 0, 1, 2, 3, 7, 8, 127
_NUMBERS = {_TTL: 2, _CAPABILITIES: 4}
_INTERFACE = 6
"""Bytes of a management address behind the address: kind and number of interface, length of a name."""
_LLDP_TEXTS = (4, 5, 6)
"""Port description, system name, system description."""
_SUBTYPE_MAC, _SUBTYPE_ADDRESS = {_CHASSIS: 4, _PORT_ID: 3}, {_CHASSIS: 5, _PORT_ID: 4}
_PROFINET, _IEEE_802_3 = b"\x00\x0e\xcf", b"\x00\x12\x0f"
_LONGEST_802_3 = 16

_Map = Callable[[Replacements, bytes], bytes]


def blank(data: bytes) -> bytes:
    """As many zeros."""
    return bytes(len(data))


def _keep(size: int) -> _Map:
    """So many bytes stay, as many as such an option has; what stands behind them is not known."""
    return lambda _key, data: data[:size] + blank(data[size:])


def _options(_key: Replacements, data: bytes) -> bytes:
    """Numbers of options and suboptions; zeros for those that are none."""
    pairs = (data[at : at + 2] for at in range(0, len(data), 2))
    return b"".join(blank(each) if each[0] in _RESERVED else each for each in pairs)


def _zero(_key: Replacements, data: bytes) -> bytes:
    return blank(data)


def _mac(key: Replacements, data: bytes) -> bytes:
    return key.mac(data[:6]) + blank(data[6:])


def _name(key: Replacements, data: bytes) -> bytes:
    return key.name(data)


def port_name(key: Replacements, data: bytes) -> bytes:
    """`port-001` stays; of `port-001.drive-1` the name of the station is replaced."""
    core = data.rstrip(b"\0 ")
    if _PORT.fullmatch(core):
        return data
    port, dot, station = core.partition(b".")
    if dot and _PORT.fullmatch(port):
        return port + dot + key.name(data[len(port) + 1 :]) if station else data
    return key.name(data)


def _ip_suite(key: Replacements, data: bytes) -> bytes:
    """Address, mask, gateway; then the addresses of name servers."""
    words = [data[at : at + 4] for at in range(0, len(data), 4)]
    return b"".join(
        word if number == 1 else key.ip(word) if len(word) == 4 else blank(word)
        for number, word in enumerate(words)
    )


_DCP: dict[tuple[int, int], _Map] = {
    (1, 1): _mac,
    (1, 2): _ip_suite,
    (1, 3): _ip_suite,
    (2, 1): _name,  # type of station
    (2, 2): _name,
    (2, 3): _keep(4),  # vendor and device id
    (2, 4): _keep(1),  # role
    (2, 5): _options,  # the options that the device knows
    (2, 6): port_name,  # alias
    (2, 7): _keep(2),  # instance
    (2, 8): _keep(4),  # vendor and device id of the maker
    (2, 10): _keep(2),  # kinds of reset
    **{(5, number): _keep(3) for number in range(1, 7)},
    (6, 1): _keep(2),
}
"""Option and suboption -> what becomes of its content; zeros for all others."""


def dcp(key: Replacements, data: bytes) -> bytes:
    """A DCP frame from the frame id on, padding included."""
    if len(data) < _DCP_HEADER:
        return data
    service, kind = data[2], data[3]
    request = kind == _REQUEST
    head = bytearray(data[:_DCP_HEADER])
    if service != _IDENTIFY or not request:
        head[_DELAY] = b"\0\0"  # reserved in all others
    end = min(_DCP_HEADER + int.from_bytes(data[10:12], "big"), len(data))
    if service == _GET and request:
        return bytes(head) + _options(key, data[_DCP_HEADER:end]) + blank(data[end:])
    info = 0 if service == _IDENTIFY and request else 2  # block information, or a qualifier
    out = bytes(head)
    while len(out) + 4 <= end:
        at = len(out)
        size = int.from_bytes(data[at + 2 : at + 4], "big")
        content = data[at + 4 : min(at + 4 + size, end)]
        change = _DCP.get((data[at], data[at + 1]), _zero)
        pad = blank(data[at + 4 + size : at + 4 + size + size % 2])
        out += data[at : at + 4] + content[:info] + change(key, content[info:]) + pad
        out = out[:end]
    return out + blank(data[len(out) :])


def lldp(key: Replacements, data: bytes) -> bytes:
    """An LLDPDU, padding included."""
    out = b""
    while len(out) + 2 <= len(data):
        at = len(out)
        head = data[at] << 8 | data[at + 1]
        kind, length = head >> 9, head & 0x1FF
        value = data[at + 2 : at + 2 + length]
        out += data[at : at + 2] + _tlv(key, kind, value)
        if kind == _END:
            break
    return out + blank(data[len(out) :])


def _tlv(key: Replacements, kind: int, value: bytes) -> bytes:
    if kind in (_CHASSIS, _PORT_ID) and value:
        subtype, content = value[0], value[1:]
        if subtype == _SUBTYPE_MAC[kind]:
            return value[:1] + _mac(key, content)
        if subtype == _SUBTYPE_ADDRESS[kind]:
            return value[:2] + (key.ip(content[1:]) if len(content) == 5 else blank(content[1:]))
        return value[:1] + port_name(key, content)
    if kind in _LLDP_TEXTS:
        return key.name(value)
    if kind == _MANAGEMENT:
        return _management(key, value)
    if kind == _ORGANISATION:
        return _organisation(key, value)
    known = _NUMBERS.get(kind, 0)
    return value[:known] + blank(value[known:])


def _management(key: Replacements, value: bytes) -> bytes:
    """Length, subtype and address, then interface number and object identifier."""
    size = value[0] if value else 0
    address = value[2 : 1 + size]
    rest = value[1 + size :]
    rest = rest[:_INTERFACE] + blank(rest[_INTERFACE:])
    if value[1:2] == b"\1":
        return value[:2] + (key.ip(address) if len(address) == 4 else blank(address)) + rest
    if value[1:2] == b"\6":
        return value[:2] + _mac(key, address) + rest
    return value[:2] + blank(address) + blank(rest)


def _organisation(key: Replacements, value: bytes) -> bytes:
    head, content = value[:4], value[4:]
    if value[:3] == _IEEE_802_3:
        return value[:_LONGEST_802_3] + blank(value[_LONGEST_802_3:])
    if value[:3] != _PROFINET or len(value) < 4:
        return head + blank(content)
    subtype = value[3]
    if subtype in (1, 2):  # delays, state of the port
        known = 20 if subtype == 1 else 4
        return head + content[:known] + blank(content[known:])
    if subtype == 3:
        return head + port_name(key, content)
    if subtype == 4:  # redundancy: domain UUID, state
        return head + key.uuid(content[:16]) + content[16:20] + blank(content[20:])
    if subtype == 5:
        return head + _mac(key, content)
    if subtype == 6:  # clock: master, subdomain, data
        master, first, second = content[:6], content[6:22], content[22:38]
        return head + key.mac(master) + key.uuid(first) + key.uuid(second) + blank(content[38:])
    return head + blank(content)
