"""Cyclic frames: a Connect that sets them up, and the frames of both directions, cycle by cycle.

What controller and drive say in them is decided by the scene. Layouts: docs/protocol.md F.6, docs/cyclic.md 5.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from ds47.lab import ether, wire
from ds47.lab.client import OK, Client

INPUT, OUTPUT = 1, 2
GOOD, BAD = 0x80, 0x00
_TICK_NS = 31_250
_CLOCK = 32
"""Of 31.25 us: one millisecond."""
_LEAST = 40
"""Bytes of data in a frame."""
_RUN = 0x35
"""Status of a frame: primary, valid, run, no problem."""


@dataclass(frozen=True, slots=True)
class LabModule:
    """A submodule with so many bytes of data in both directions, or with `out` bytes from the controller."""

    slot: int
    subslot: int
    length: int
    ident: int = 0x4711
    out: int | None = None

    def size(self, kind: int) -> int:
        """Bytes of data in a direction."""
        return self.out if kind == OUTPUT and self.out is not None else self.length


PKW, PZD = LabModule(2, 2, 8), LabModule(2, 3, 4)
"""Telegram 353: four words of PKW, two of PZD, in the slot of one drive object."""


@dataclass(slots=True)
class Cyclic:
    """The cyclic frames of a client's AR.

    `frame_ids` are those of input and output that are asked for; `given` is that of the output as the device
    gives it in its response.
    """

    client: Client
    modules: Sequence[LabModule] = (PKW, PZD)
    frame_ids: tuple[int, int] = (0x8001, 0xFFFF)
    given: int = 0x8002
    reduction: float = 4
    """Cycles of one millisecond from one frame to the next, a whole number."""
    iops: dict[int, int] = field(default_factory=lambda: {INPUT: GOOD, OUTPUT: GOOD})
    status: int = _RUN
    data: dict[tuple[LabModule, int], bytes] = field(default_factory=dict)
    """What a module has in a direction; else zeros."""

    def connect(self, station: str = "plc") -> None:
        """The AR is set up with its communication relations and submodules."""
        client = self.client
        call = client.call(wire.CONNECT)
        asked = wire.ar_request(client.channel.ar, client.host, station)
        asked += self._relation(INPUT, self.frame_ids[0]) + self._relation(
            OUTPUT, self.frame_ids[1]
        )
        client.ask(call, asked + self._expected())
        blocks = wire.ar_response(client.channel.ar, client.device)
        for kind, frame_id in ((INPUT, self.frame_ids[0]), (OUTPUT, self.given)):
            blocks += _block(0x8102, struct.pack(">HHH", kind, kind, frame_id))
        client.accept(call, OK, blocks)

    def _offsets(self, kind: int) -> list[tuple[LabModule, int]]:
        """Where the data of each module begins; IOPS stands behind it."""
        found, at = [], 0
        for module in self.modules:
            found.append((module, at))
            at += module.size(kind) + 1
        return found

    @property
    def length(self) -> int:
        """Bytes of data in a frame: those of the modules, with IOPS and an IOCS of each, and padding."""
        sides = (INPUT, OUTPUT)
        return max(_LEAST, *(sum(each.size(kind) + 2 for each in self.modules) for kind in sides))

    def _relation(self, kind: int, frame_id: int) -> bytes:
        head = struct.pack(
            ">HHHIHHHHHHIHHH6sH", kind, kind, 0x8892, 1, self.length, frame_id, _CLOCK,
            round(self.reduction), 1, 0, 0xFFFFFFFF, 3, 3, 0xC000, bytes(6), 1,
        )  # fmt: skip
        places = [
            struct.pack(">HHH", module.slot, module.subslot, at)
            for module, at in self._offsets(kind)
        ]
        end = sum(module.size(kind) + 1 for module in self.modules)
        states = [
            struct.pack(">HHH", module.slot, module.subslot, end + number)
            for number, module in enumerate(self.modules)
        ]
        count = struct.pack(">H", len(self.modules))
        body = struct.pack(">I", 0) + count + b"".join(places) + count + b"".join(states)
        return _block(0x0102, head + body)

    def _expected(self) -> bytes:
        blocks = b""
        for slot in sorted({module.slot for module in self.modules}):
            inside = [module for module in self.modules if module.slot == slot]
            body = struct.pack(">HIHIHH", 1, 0, slot, 0x4700, 0, len(inside))
            for module in inside:
                body += struct.pack(">HIH", module.subslot, module.ident, 3)
                for kind in (INPUT, OUTPUT):
                    body += struct.pack(">HHBB", kind, module.size(kind), 1, 1)
            blocks += _block(0x0104, body)
        return blocks

    # Frames

    def say(self, module: LabModule, kind: int, data: bytes) -> None:
        """From the next cycle on a module has this data in a direction."""
        self.data[module, kind] = data

    def cycle(self, count: int = 1) -> None:
        """So many cycles go by: a frame of the controller, and one of the device."""
        for _ in range(count):
            begun = self.client.stage.now_ns
            self._send(OUTPUT)
            self._send(INPUT)
            self.client.stage.now_ns = begun + round(self.reduction) * _CLOCK * _TICK_NS

    def _send(self, kind: int) -> None:
        host, device = self.client.host, self.client.device
        source, target = (host, device) if kind == OUTPUT else (device, host)
        frame_id = self.given if kind == OUTPUT else self.frame_ids[0]
        data = b"".join(
            self.data.get((module, kind), b"").ljust(module.size(kind), b"\0")
            + bytes((self.iops[kind],))
            for module in self.modules
        )
        counter = self.client.stage.now_ns // _TICK_NS & 0xFFFF
        tail = struct.pack(">HBB", counter, self.status, 0)
        data += bytes((GOOD,)) * len(self.modules)  # IOCS of what comes the other way
        payload = struct.pack(">H", frame_id) + data.ljust(self.length, b"\0") + tail
        stage = self.client.stage
        now = stage.now_ns
        stage.frame(ether.bare(source.mac, target.mac, 0x8892, payload))
        stage.now_ns = now + 100_000


def _block(kind: int, body: bytes) -> bytes:
    return struct.pack(">HHBB", kind, len(body) + 2, 1, 0) + body
