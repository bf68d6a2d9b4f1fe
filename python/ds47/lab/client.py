"""A simulated controller of one device: RPC calls and record services, answered or not.

The device has no logic of its own: the scenario says what it answers. So faults, lost frames and
dialects are one-liners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from uuid import UUID

from ds47.lab import wire
from ds47.lab.ether import Host
from ds47.lab.stage import Stage
from ds47.lab.wire import Call, Order, PduContent, RecordId

OK = 0
BUSY = 0xDE80B500

CONTROLLER_AR = UUID("47474747-0001-4000-8000-000000000001")
CHANNEL = RecordId(CONTROLLER_AR)
CONTROLLER_ACTIVITY = UUID("1f2e3d4c-5b6a-11f0-8a47-00000a0b0c01")


def controller(number: int = 1) -> Host:
    """Controller n of the lab: 192.168.133.n+1, with its own port."""
    return Host(f"192.168.133.{number + 1}", f"00:1c:06:00:00:{number:02x}", port=49151 + number)


def drive(number: int = 1, device_id: int = 0x0501, vendor_id: int = 0x002A) -> Host:
    """Drive n of the lab: 192.168.133.32+n."""
    mac = f"00:1f:f8:00:00:{number:02x}"
    return Host(f"192.168.133.{32 + number}", mac, device_id=device_id, vendor_id=vendor_id)


@dataclass(slots=True)
class Client:
    """One AR of a controller with a device."""

    stage: Stage
    host: Host = field(default_factory=controller)
    device: Host = field(default_factory=drive)
    order: Order = "<"
    answer_order: Order | None = None
    """Byte order of the device's PDUs; None follows the request."""
    channel: RecordId = CHANNEL
    activity: UUID = CONTROLLER_ACTIVITY
    sequence: int = 0
    fragment: int | None = None
    """Bytes of body per RPC fragment; None sends each body in one PDU."""
    answer_port: int | None = None
    """The port of the device's answers, and of requests after its first answer."""
    server_port: int | None = None

    def at(self, **changes: Any) -> RecordId:
        """The client's channel with another slot, subslot, index, API or AR."""
        return replace(self.channel, **changes)

    def wait(self, milliseconds: float) -> None:
        """Let time pass; a negative number steps the clock of the capture point back."""
        self.stage.wait(milliseconds)

    # RPC

    def call(self, opnum: int) -> Call:
        """A new call: the next sequence number of the activity."""
        call = Call(
            self.activity,
            self.sequence,
            opnum,
            wire.object_uuid(self.device.device_id, self.device.vendor_id),
        )
        self.sequence += 1
        return call

    def ask(self, call: Call, blocks: bytes, kind: int = wire.REQUEST, **said: Any) -> None:
        """The controller sends a PDU of a call; `said` are fields of `PduContent`."""
        body = wire.request_body(self.order, blocks) if kind == wire.REQUEST else blocks
        ports = (self.host.port, self.server_port or self.device.port)
        self.stage.said = PduContent(call, True, self.host.ip, **said)
        for part in wire.pdus(kind, self.order, call, body, self.fragment):
            self.stage.send(self.host, self.device, part, ports)
        self.stage.said = None

    def reply(self, call: Call, body: bytes, kind: int = wire.RESPONSE, **said: Any) -> None:
        """The device sends a PDU of a call with a complete body; `said` are fields of `PduContent`."""
        ports = (self.answer_port or self.device.port, self.host.port)
        self.server_port = self.answer_port
        self.stage.said = PduContent(call, False, self.host.ip, **said)
        for part in wire.pdus(kind, self.reply_order, call, body, self.fragment):
            self.stage.send(self.device, self.host, part, ports)
        self.stage.said = None

    @property
    def reply_order(self) -> Order:
        """Byte order of the device's PDUs."""
        return self.answer_order or self.order

    def accept(self, call: Call, status: int, blocks: bytes, record: bytes = b"") -> None:
        """The device answers a call with a PNIOStatus and blocks; `record` is the record in them."""
        body = wire.response_body(self.reply_order, status, blocks)
        self.reply(call, body, status=status, record=record)

    def connect(self, station: str, kind: int = wire.IO_AR) -> None:
        """The AR is set up with this kind; the controller calls itself `station`."""
        call = self.call(wire.CONNECT)
        self.ask(call, wire.ar_request(self.channel.ar, self.host, station, kind))
        self.accept(call, OK, wire.ar_response(self.channel.ar, self.device))

    def release(self) -> None:
        """The AR is given up."""
        call = self.call(wire.RELEASE)
        self.ask(call, wire.release_request(self.channel.ar))
        self.accept(call, OK, wire.release_response(self.channel.ar))

    # Record services

    def ask_write(
        self,
        record: bytes,
        at: RecordId | None = None,
        stated: int | None = None,
        again: Call | None = None,
    ) -> Call:
        """Write request alone; `again` is an earlier call to repeat."""
        call = again or self.call(wire.WRITE)
        channel = at or self.channel
        block = wire.write_request(call.sequence, channel, record, stated)
        self.ask(call, block, target=channel, record=record)
        return call

    def accept_write(
        self, call: Call, record: bytes, at: RecordId | None = None, status: int = OK
    ) -> None:
        """Write response alone."""
        length = 0 if status else len(record)
        block = wire.write_response(call.sequence, at or self.channel, length, status)
        self.accept(call, status, block)

    def write(self, record: bytes, status: int = OK, at: RecordId | None = None) -> None:
        """A whole Write."""
        self.accept_write(self.ask_write(record, at), record, at, status)

    def ask_read(
        self, at: RecordId | None = None, maximum: int = 4096, again: Call | None = None
    ) -> Call:
        """Read request alone; `again` is an earlier call to repeat."""
        call = again or self.call(wire.READ)
        target = at or self.channel
        block = wire.read_request(call.sequence, target, maximum)
        self.ask(call, block, target=target, room=maximum)
        return call

    def ask_implicit(self, at: RecordId) -> Call:
        """Request of a ReadImplicit alone; the record has no AR."""
        call = self.call(wire.READ_IMPLICIT)
        self.ask(call, wire.read_request(call.sequence, at), target=at)
        return call

    def accept_read(
        self, call: Call, record: bytes, at: RecordId | None = None, stated: int | None = None
    ) -> None:
        """Positive Read response alone."""
        block = wire.read_response(call.sequence, at or self.channel, record, stated)
        self.accept(call, OK, block, record)

    def refuse_read(
        self, call: Call, status: int, at: RecordId | None = None, with_header: bool = True
    ) -> None:
        """Negative Read response, with an IODReadResHeader of length 0 or without any block."""
        block = wire.read_response(call.sequence, at or self.channel, b"") if with_header else b""
        self.accept(call, status, block)

    def read(self, record: bytes, at: RecordId | None = None) -> None:
        """A whole Read that returns the record."""
        self.accept_read(self.ask_read(at), record, at)

    def poll(
        self, status: int = BUSY, at: RecordId | None = None, with_header: bool = True
    ) -> None:
        """A whole Read that is refused."""
        self.refuse_read(self.ask_read(at), status, at, with_header)

    def exchange(
        self, request: bytes, response: bytes, at: RecordId | None = None, polls: int = 0
    ) -> None:
        """A whole transaction."""
        self.write(request, at=at)
        for _ in range(polls):
            self.poll(at=at)
            self.wait(10)
        self.read(response, at)

    def write_multiple(self, records: Sequence[tuple[RecordId, bytes, int]]) -> None:
        """IODWriteMultiple with (channel, record, status) inside."""
        call = self.call(wire.WRITE)
        outer = self.at(slot=0xFFFF, subslot=0xFFFF, api=0xFFFFFFFF, index=wire.WRITE_MULTIPLE)
        asked = [wire.write_request(n, where, data) for n, (where, data, _) in enumerate(records)]
        inner = wire.padded(asked)
        self.ask(call, wire.write_request(call.sequence, outer, inner))
        answers = [
            wire.write_response(n, where, 0 if status else len(data), status)
            for n, (where, data, status) in enumerate(records)
        ]
        head = wire.write_response(call.sequence, outer, len(inner), OK)
        self.accept(call, OK, head + b"".join(answers))
