"""The hot loops: over bytes and over unpacked fields, compiled and plain, they find the same frames."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from types import ModuleType
from typing import Any

import frames as make
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47.capture import open_capture, scan

CALL = make.call()
BIG = make.ethernet(0x0800, make.ipv4(make.udp(make.rpc(make.UUID_LITTLE))), (0x88A8, 0x8100))
FRAGMENT = make.ethernet(0x0800, make.ipv4(bytes(48), offset=1480, more=True))
OTHER_PORT = make.ethernet(0x0800, make.ipv4(make.udp(make.rpc(), (1, 2))), (0x9100,))
TCP = make.ethernet(0x0800, make.ipv4(bytes(60), proto=6))
SEGMENT = make.ethernet(0x0800, make.ipv4(struct.pack(">2H", 49152, 102) + bytes(36), proto=6))
BACK = make.ethernet(
    0x0800, make.ipv4(struct.pack(">2H", 1102, 2000) + bytes(36), proto=6), (0x8100,)
)
PART = make.ethernet(
    0x0800, make.ipv4(struct.pack(">2H", 102, 102) + bytes(36), proto=6, more=True)
)
ALARM = make.ethernet(0x8892, b"\xfe\x01" + bytes(44))
TAGGED_DCP = make.ethernet(0x8892, b"\xfe\xfc" + bytes(44), (0x8100,))
SLL_CALL = bytes(14) + b"\x08\x00" + make.ipv4(make.udp(make.rpc()))
SHAPES = (
    make.RT, make.RT_TAGGED, make.DNS, make.DCP, make.LLDP, CALL, BIG, FRAGMENT, OTHER_PORT, TCP,
    SEGMENT, BACK, PART, SEGMENT[:36], ALARM, TAGGED_DCP, SLL_CALL, make.RT[:15], make.RT_TAGGED[:19],
    make.RT[:14], b"", CALL[:70],
)  # fmt: skip


def mutated(frame: bytes, at: int, value: int) -> bytes:
    """The frame with one byte overwritten, most often in the headers."""
    return frame[:at] + bytes([value]) + frame[at + 1 :] if at < len(frame) else frame


frame = st.builds(
    mutated,
    st.sampled_from(SHAPES),
    st.integers(0, 100),
    st.sampled_from((0, 4, 6, 17, 69, 129, 136, 254)),
)
traffic = st.lists(st.one_of(frame, st.sampled_from(SHAPES)), max_size=30)
orders = st.sampled_from("<>")
wanted_ports = st.sampled_from(((), (102,), (1102, 102), (0,), tuple(range(96, 103))))
kinds = st.sampled_from((0xA1B2C3D4, 0xA1B23C4D, 0xA1B2CD34))
links = st.sampled_from((1, 113, 276, 101, 147))
cuts = st.sampled_from((0, 0, 14, 18, 40, 60, 70, 82))


def walk(scanner: Any, method: str, data: bytes, pieces: list[int]) -> list[object]:
    """Everything a loop says while the buffer grows piece by piece, as a file that is being read does."""
    said: list[object] = []
    padded = data + bytes(range(64))
    for end in [*sorted(pieces), len(data)]:
        while True:
            scanner.paused = False
            found = getattr(scanner, method)(padded, min(end, len(data)))
            newest = scanner.interface, scanner.high, scanner.low
            said += [*found, (scanner.position, scanner.frames, scanner.paused, newest)]
            if len(found) < scan.BATCH and not scanner.paused:
                break
    return said


def both(
    make_scanner: Callable[[ModuleType], Any], data: bytes, pieces: list[int], *modules: ModuleType
) -> None:
    """`_plain` of this module, `_compiled` run as Python, and `scan` of the others say the same."""
    methods = [(scan, "scan")] if scan.COMPILED else [(scan, "_plain"), (scan, "_compiled")]
    methods += [(module, "scan") for module in modules]
    said = [walk(make_scanner(module), method, data, pieces) for module, method in methods]
    for each in said[1:]:
        assert each == said[0]


def pcap_scanner(order: str, magic: int, link: int) -> Callable[[ModuleType], Any]:
    def made(module: ModuleType) -> Any:
        scanner = module.PcapScan(
            "little" if order == "<" else "big", 24 if magic == 0xA1B2CD34 else 16, link
        )
        scanner.position = 24
        return scanner

    return made


def for_ports(
    make_scanner: Callable[[ModuleType], Any], ports: tuple[int, ...]
) -> Callable[[ModuleType], Any]:
    def made(module: ModuleType) -> Any:
        scanner = make_scanner(module)
        scanner.tcp(ports)
        return scanner

    return made


def pcapng_scanner(order: str, interfaces: list[int]) -> Callable[[ModuleType], Any]:
    def made(module: ModuleType) -> Any:
        scanner = module.PcapngScan()
        scanner.section("little" if order == "<" else "big")
        scanner.links += interfaces
        return scanner

    return made


def enhanced(frames: list[bytes], order: str, snap: int, interfaces: int) -> bytes:
    out = []
    for number, data in enumerate(frames):
        kept = data[:snap] if snap else data
        head = struct.pack(order + "5I", number % interfaces, 1, number, len(kept), len(data))
        out.append(make.block(6, head + make.padded(kept), order))
    return b"".join(out)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(traffic, orders, kinds, links, cuts, st.lists(st.integers(24, 3000), max_size=3), st.data())
def test_pcap_loops_agree(
    plain_scan: ModuleType, compiled_scan: ModuleType, frames: list[bytes], order: str, magic: int,
    link: int, snap: int, pieces: list[int], more: st.DataObject,
) -> None:  # fmt: skip
    data = bytearray(make.pcap(frames, order=order, magic=magic, link_type=link, snap=snap))
    for _ in range(more.draw(st.integers(0, 2))):  # also lengths that lie
        if len(data) > 24:
            data[more.draw(st.integers(24, len(data) - 1))] = more.draw(st.integers(0, 255))
    made = for_ports(pcap_scanner(order, magic, link), more.draw(wanted_ports))
    both(made, bytes(data), pieces, plain_scan, compiled_scan)


@settings(max_examples=300, deadline=None)
@given(traffic, orders, cuts, st.lists(links, min_size=1, max_size=3), st.lists(st.integers(0, 3000), max_size=3),
       st.data())  # fmt: skip
def test_pcapng_loops_agree(
    plain_scan: ModuleType, compiled_scan: ModuleType, frames: list[bytes], order: str, snap: int,
    interfaces: list[int], pieces: list[int], more: st.DataObject,
) -> None:  # fmt: skip
    data = bytearray(enhanced(frames, order, snap, len(interfaces)))
    for _ in range(more.draw(st.integers(0, 2))):
        if data:
            data[more.draw(st.integers(0, len(data) - 1))] = more.draw(st.integers(0, 255))
    made = for_ports(pcapng_scanner(order, interfaces), more.draw(wanted_ports))
    both(made, bytes(data), pieces, plain_scan, compiled_scan)


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("ng", [False, True])
def test_long_runs_are_counted_frame_by_frame(
    plain_scan: ModuleType, compiled_scan: ModuleType, order: str, ng: bool
) -> None:
    """Cyclic frames of some lengths, many more than it takes to learn them, with others in between."""
    lengths = [make.RT, make.RT_TAGGED, make.RT + bytes(7), make.RT_TAGGED + bytes(90)]
    frames = [lengths[number * number % 4] for number in range(15_000)]
    for place, other in enumerate(SHAPES):
        frames[5_000 + 501 * place : 5_000 + 501 * place] = [other] * (place + 1)
    if ng:
        both(
            pcapng_scanner(order, [1]),
            enhanced(frames, order, 0, 1),
            [9_000],
            plain_scan,
            compiled_scan,
        )
        return
    data = make.pcap(frames, order=order)
    both(pcap_scanner(order, 0xA1B2C3D4, 1), data, [9_000, 400_000], plain_scan, compiled_scan)
    with open_capture(io.BytesIO(data)) as capture:
        found = list(capture)
    assert capture.frames == len(frames)
    assert all(frames[each.number - 1] == each.data for each in found)
    assert [each.number for each in found] == [
        number
        for number, each in enumerate(frames, 1)
        if scan.relevant(each, 0, len(each), 1, len(each))
    ]


SENDERS = (bytes.fromhex("0200000000a1"), bytes.fromhex("0200000000d2"))
SECOND = SENDERS[1], 0x8002
WATCHES: list[tuple[bytes, int, tuple[tuple[int, int], ...], bool, tuple[bytes, int] | None]] = [
    (SENDERS[0], 0x8001, ((0, 4), (6, 3)), False, SECOND),
    (*SECOND, ((2, 2),), True, None),
]
"""Of the second the frame behind one that says something new is given, too, whichever of the two says it."""


def cyclic(sender: int, frame_id: int, data: bytes, tag: tuple[int, ...] = ()) -> bytes:
    """A cyclic frame: 40 bytes of data, then the APDU status."""
    payload = frame_id.to_bytes(2) + data.ljust(40, b"\0") + b"\x12\x34\x35\0"
    made = make.ethernet(0x8892, payload, tag)
    return made[:6] + SENDERS[sender] + made[12:]


def cooked(frame: bytes, link: int) -> bytes:
    """An Ethernet frame as it stands in a capture of another link type."""
    if link == 113:
        return b"\0\0\0\1\0\6" + frame[6:12] + b"\0\0" + frame[12:]
    if link == 276:
        return frame[12:14] + bytes(6) + b"\0\1\0\6" + frame[6:12] + b"\0\0" + frame[14:]
    return frame


def expected(frames: list[bytes]) -> list[int]:
    """The numbers of the watched frames that are to be given, and of all others that matter, told slowly."""
    last: dict[tuple[bytes, bytes], tuple[list[bytes], int]] = {}
    wanted = []
    for number, data in enumerate(frames, 1):
        at = data.find(b"\x88\x92", 12, 22)
        key = data[6:12], data[at + 2 : at + 4]
        for source, frame_id, parts, follows, answered in WATCHES:
            whole = at > 0 and len(data) >= at + 4 + sum(parts[-1])
            if whole and key == (source, frame_id.to_bytes(2)):
                told = [data[at + 4 + first : at + 4 + first + size] for first, size in parts]
                said = told, number // scan.sampled(number, len(WATCHES))
                before = last.get(key)
                if before != said:
                    wanted.append(number)
                changed = before is None or before[0] != told
                last[key] = (told, -1) if follows and changed else said
                other = answered and (answered[0], answered[1].to_bytes(2))
                if changed and other in last:
                    last[other] = last[other][0], -1
        if scan.relevant(data, 0, len(data), 1, len(data)):
            wanted.append(number)
    return wanted


def watching(make_scanner: Callable[[ModuleType], Any]) -> Callable[[ModuleType], Any]:
    def made(module: ModuleType) -> Any:
        scanner = make_scanner(module)
        scanner.watch([module.Watch(*each) for each in WATCHES])
        return scanner

    return made


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("ng", [False, True])
@pytest.mark.parametrize("tag", [(), (0x8100,), (0x88A8, 0x8100)], ids=["", "tagged", "two tags"])
@pytest.mark.parametrize("link", [1, 113, 276], ids=["ethernet", "sll", "sll2"])
def test_watched_frames_are_given_when_they_say_something_new(
    plain_scan: ModuleType,
    compiled_scan: ModuleType,
    order: str,
    ng: bool,
    tag: tuple[int, ...],
    link: int,
) -> None:
    """Two senders whose values move in every frame, a third one that is not watched, and what else goes by."""
    frames: list[bytes] = []
    for cycle in range(4_000):
        moving = cycle.to_bytes(2)
        state = (cycle // 701).to_bytes(1)
        frames.append(cyclic(0, 0x8001, b"\x34\x3a\0" + state + moving + b"\x04\x7f\x80", tag))
        frames.append(cyclic(1, 0x8002, moving + b"\xfb" + (cycle // 997).to_bytes(1), tag))
        frames.append(cyclic(1, 0x8009, moving + moving, tag))
        if cycle % 400 == 399:
            frames += [CALL, make.DCP, cyclic(0, 0x8001, b"", tag)[:24], make.RT]
    there = [cooked(each, link) for each in frames]
    if ng:
        data, made = enhanced(there, order, 0, 1), pcapng_scanner(order, [link])
    else:
        data = make.pcap(there, order=order, link_type=link)
        made = pcap_scanner(order, 0xA1B2C3D4, link)
    both(watching(made), data, [9_000, 400_000], plain_scan, compiled_scan)
    said = walk(watching(made)(plain_scan), "_plain", data, [])
    assert [each[0] for each in said if len(each) == 6] == expected(frames)  # type: ignore[arg-type, index]


@pytest.mark.parametrize("kind", [0, 2], ids=["request", "response"])
@pytest.mark.parametrize("ng", [False, True])
def test_it_stops_behind_both_halves_of_a_connect(
    plain_scan: ModuleType, compiled_scan: ModuleType, ng: bool, kind: int
) -> None:
    """Somebody looks at it, and watches what it sets up from the next frame on."""
    answered = bytearray(make.rpc())
    answered[1], answered[68:70] = kind, b"\0\0"
    response = make.ethernet(0x0800, make.ipv4(make.udp(bytes(answered))))
    frames = [cyclic(0, 0x8001, b""), CALL, response, cyclic(0, 0x8001, b""), CALL, response]
    for module in (plain_scan, compiled_scan):
        if ng:
            data, scanner = enhanced(frames, "<", 0, 1), pcapng_scanner("<", [1])(module)
        else:
            data, scanner = make.pcap(frames), pcap_scanner("<", 0xA1B2C3D4, 1)(module)
        padded = data + bytes(scan.PADDING)
        assert [each[0] for each in scanner.scan(padded, len(data))] == [2, 3]
        assert scanner.paused
        scanner.watch([module.Watch(*WATCHES[0])])
        assert [each[0] for each in scanner.scan(padded, len(data))] == [4, 5, 6]
        assert scanner.paused
        assert scanner.scan(padded, len(data)) == []
        assert not scanner.paused


def test_it_stops_behind_each_fragment_of_one(
    plain_scan: ModuleType, compiled_scan: ModuleType
) -> None:
    """Whichever comes last: from the first one on those of the same number, and no others."""
    answered = bytearray(make.udp(make.rpc(body=bytes(1200))))
    answered[9], answered[76:78] = 2, b"\0\0"
    asked = bytes(make.udp(make.rpc(body=bytes(1200))))

    def piece(data: bytes, first: int, end: int, number: int) -> bytes:
        whole = make.ipv4(data[first:end], offset=first, more=end < len(data), ident=number)
        return make.ethernet(0x0800, whole)

    end = len(answered)
    response = [piece(bytes(answered), a, b, 7) for a, b in ((0, 80), (80, 800), (800, end))]
    request = [piece(asked, a, b, 8) for a, b in ((0, 800), (800, end))]
    short = [piece(bytes(answered), a, b, 9) for a, b in ((0, 72), (72, end))]
    for module in (plain_scan, compiled_scan):
        frames = [
            response[2],
            *request,
            response[0],
            CALL,
            response[1],
            *request,
            *short,
            response[2],
        ]
        data, scanner = make.pcap(frames), pcap_scanner("<", 0xA1B2C3D4, 1)(module)
        padded, stops = data + bytes(scan.PADDING), []
        while found := scanner.scan(padded, len(data)):
            stops += [found[-1][0]] if scanner.paused else []
        assert stops == [4, 6, 9, 10]


@pytest.mark.parametrize("ng", [False, True])
def test_segments_of_tcp_are_given_for_wanted_ports_alone(
    plain_scan: ModuleType, compiled_scan: ModuleType, ng: bool
) -> None:
    """Either end may have the port; fragments, and what is cut before it, are never given."""
    frames = [SEGMENT, BACK, PART, TCP, SEGMENT[:37], SEGMENT[:38], CALL]
    for ports, wanted in (
        ((), [7]),
        ((102,), [1, 6, 7]),
        ((102, 1102), [1, 2, 6, 7]),
        ((2000,), [2, 7]),
    ):
        for module in (plain_scan, compiled_scan):
            if ng:
                data, scanner = enhanced(frames, "<", 0, 1), pcapng_scanner("<", [1])(module)
            else:
                data, scanner = make.pcap(frames), pcap_scanner("<", 0xA1B2C3D4, 1)(module)
            scanner.tcp(ports)
            found = scanner.scan(data + bytes(scan.PADDING), len(data))
            assert [each[0] for each in found] == wanted
            tcp = [
                scan.relevant(each, 0, len(each), 1, len(each), scanner.ports) for each in frames
            ]
            assert [number for number, each in enumerate(tcp, 1) if each] == wanted


def test_more_ports_than_there_is_room_for_are_left_out() -> None:
    scanner = scan.PcapScan("little", 16, 1)
    scanner.tcp(range(1, 40))
    assert scanner.ports == scan.tcp_ports(range(1, 17))


def test_a_buffer_without_room_is_refused() -> None:
    for scanner in (scan.PcapScan("little", 16, 1), scan.PcapngScan()):
        with pytest.raises(ValueError, match="room"):
            scanner.scan(bytes(100), 100)


def test_more_than_a_batch() -> None:
    data = make.pcap([CALL] * (2 * scan.BATCH + 5))
    scanner = scan.PcapScan("little", 16, 1)
    scanner.position = 24
    sizes = [len(scanner.scan(data + bytes(scan.PADDING), len(data))) for _ in range(4)]
    assert sizes == [scan.BATCH, scan.BATCH, 5, 0]
    assert scanner.frames == 2 * scan.BATCH + 5
