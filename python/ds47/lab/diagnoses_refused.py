"""Scenarios: causes (DS7xx) that an error number betrays. See `diagnoses`.

Most of them are one transaction, so they stand in a table: what is asked, what the drive answers. A change
that the drive takes is followed by p0977 = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.diagnoses import CYCLE, DF_HEADER, read, save, speed
from ds47.lab.scenario import Book

BOOK = Book("diagnosis")

NEGATIVE_READ = 0x81

# Error numbers (docs/protocol.md B)
UNKNOWN, READ_ONLY, LIMITS, NO_SUBINDEX, NO_ARRAY, DATA_TYPE = range(6)
RUNNING, TOO_LONG, ADDRESS, FORMAT, COUNT, NO_AXIS = 0x11, 0x15, 0x16, 0x17, 0x18, 0x19
ENABLED, QUICK_COMMISSIONING, NO_LINK = 0x6B, 0x70, 0x83

UNSIGNED32 = 0x07
DE_LENGTH = 0xDE80B100

CONSTANTS = message.address(2902, 2, 1)
FILTER = message.address(10)
MAXIMUM_SPEED, MOTOR_VOLTAGE = message.address(1082), message.address(304)
SETPOINT = message.address(1070)


@dataclass(frozen=True, slots=True)
class RequestAndReply:
    """A request and what the drive says to it: a response, or a status of the Write."""

    request: bytes
    response: bytes = b""
    status: int = 0

    def play(self, client: Client) -> None:
        """Let it happen, then let a cycle of the program pass."""
        if self.status:
            client.write(self.request, status=self.status)
        else:
            client.write(self.request)
            client.wait(CYCLE)
            client.read(self.response)
        client.wait(CYCLE)


def taken(request: bytes) -> RequestAndReply:
    """A change that the drive takes: its response mirrors the header."""
    return RequestAndReply(request, request[:4])


def failed(request: bytes, code: int, info: int = 0) -> RequestAndReply:
    """A request for one parameter that fails with an error number."""
    answer = message.answer(request[0], request[1] | 0x80, request[2], message.error(code, info))
    return RequestAndReply(request, answer)


def bounced(request: bytes) -> RequestAndReply:
    """A request whose header makes no sense to the drive: the Write is refused."""
    return RequestAndReply(request, status=DF_HEADER)


def play_all(client: Client, *exchanges: RequestAndReply) -> None:
    """One after the other; changes that were taken are saved."""
    for each in exchanges:
        each.play(client)
    if any(each.response == each.request[:4] for each in exchanges):
        save(client, exchanges[-1].request[0] + 1)


def change(reference: int, where: bytes, block: bytes) -> bytes:
    """A change of one parameter of DO 1."""
    return message.change(reference, 1, (where, block))


def dword(value: int, format_code: int = UNSIGNED32) -> bytes:
    """A block of one 32-bit value."""
    return message.block(format_code, "I", value)


BOOK.scenes(
    play_all,
    ("refusal-not-seen", "A refusal inside a record that was carried well",
     "r2902 cannot be changed; WRREC and RDREC both end with DONE and STATUS 0",
     "change error, DS410 DS701", failed(change(1, CONSTANTS, message.real(10.0)), READ_ONLY, 2)),
    ("refusal-not-seen-state", "A read that the operating state forbids",
     "r0722 is read: error 0x11; nothing was to be changed", "read error, DS410 DS701",
     failed(read(1, message.address(722)), RUNNING)),
    ("refusal-not-seen-not", "A refusal of the whole record",
     "the same change, refused at the Write: WRREC ends with ERROR, the program cannot miss it",
     "change refused, DS203", bounced(change(1, CONSTANTS, message.real(10.0)))),
    ("wrong-drive-object", "A drive object that the drive does not have",
     "a G120 asked for DO 1, then for DO 2", "read ok, read error, DS410 DS709",
     RequestAndReply(read(1), speed(1)), failed(read(2, axis=2), NO_AXIS)),
    ("wrong-drive-object-not", "Two drive objects, both there",
     "an S120 asked for DO 1, then for DO 2: both answer", "2 read ok", RequestAndReply(read(1), speed(1)),
     RequestAndReply(read(2, axis=2), speed(2, axis=2))),
    ("index-and-count", "A subindex on a parameter that is no array", "P2900 with subindex 1: error 0x04",
     "read error, DS410 DS717", failed(read(1, message.address(2900, 1, 1)), NO_ARRAY)),
    ("index-and-count-not", "A subindex on a parameter that is an array",
     "r2902 with subindex 1: the drive answers", "read ok",
     RequestAndReply(read(1, message.address(2902, 1, 1)), speed(1, 0.0))),
    ("index-and-count-subindex", "An array asked for past its end",
     "r2902 has 16 elements; 4 from subindex 14 on are asked for: error 0x03", "read error, DS410 DS717",
     failed(read(1, message.address(2902, 14, 4)), NO_SUBINDEX, 16)),
    ("index-and-count-address", "Subindex and number of elements the wrong way round",
     "P2900 with 2 elements: error 0x16", "read error, DS410 DS717",
     failed(read(1, message.address(2900, 0, 2)), ADDRESS)),
    ("index-and-count-values", "One value for two elements",
     "a change of two elements of p1021 that brings one value: error 0x18",
     "change error, DS310 DS410 DS717",
     failed(change(1, message.address(1021, 0, 2), message.real(5.0)), COUNT)),
    ("commissioning-state", "A motor parameter outside of quick commissioning",
     "p0304 := 400 with p0010 = 0: error 0x70", "change error, DS410 DS718",
     failed(change(1, MOTOR_VOLTAGE, message.word(400)), QUICK_COMMISSIONING)),
    ("commissioning-state-not", "A motor parameter in quick commissioning",
     "the same change between p0010 := 1 and p0010 := 0", "4 change ok",
     taken(change(1, FILTER, message.word(1))), taken(change(2, MOTOR_VOLTAGE, message.word(400))),
     taken(change(3, FILTER, message.word(0)))),
    ("drive-running", "A parameter that is locked while the drive runs",
     "P1082 := 40 with the enable on: error 0x6B (Siemens)", "change error, DS410 DS719",
     failed(change(1, MAXIMUM_SPEED, message.real(40.0)), ENABLED)),
    ("drive-running-not", "The same parameter at standstill",
     "P1082 := 40 with the enable off: the drive takes it", "2 change ok",
     taken(change(1, MAXIMUM_SPEED, message.real(40.0)))),
    ("drive-running-state", "A request that the operating state forbids",
     "p0972 := 1 (reset) while the drive runs: error 0x11 of the profile", "change error, DS410 DS719",
     failed(change(1, message.address(972), message.word(1)), RUNNING)),
    ("connector-as-number", "A setpoint written into the connector of the setpoint",
     "p1070 := 50.0 as Float32: error 0x05", "change error, DS410 DS720",
     failed(change(1, SETPOINT, message.real(50.0)), DATA_TYPE)),
    ("connector-as-number-not", "A connector written as such",
     "p1070 := 16#08020000, which is r2050[0] of DO 0: the drive takes it", "2 change ok",
     taken(change(1, SETPOINT, dword(2050 << 16)))),
    ("connector-as-number-word", "A connector written with 16 bits", "p0840 := 1 as Unsigned16: error 0x17",
     "change error, DS410 DS720", failed(change(1, message.address(840), message.word(1)), FORMAT)),
    ("connector-as-number-link", "A connector that cannot be wired to this source",
     "p1070 := r0052, a word where a floating-point number is needed: error 0x83",
     "change error, DS410 DS720", failed(change(1, SETPOINT, dword(52 << 16)), NO_LINK)),
)  # fmt: skip
