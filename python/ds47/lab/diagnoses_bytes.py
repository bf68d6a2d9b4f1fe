"""Scenarios: causes (DS7xx) that the bytes of a request or the length of a message betray.

DS711 to DS713 (lengths) and DS714 to DS716 (requests that make sense when they are mended). See `diagnoses`.
"""

from __future__ import annotations

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.diagnoses import CYCLE, FIXED, read, speed
from ds47.lab.diagnoses_refused import (
    DATA_TYPE,
    DE_LENGTH,
    LIMITS,
    NEGATIVE_READ,
    TOO_LONG,
    UNKNOWN,
    RequestAndReply,
    bounced,
    change,
    dword,
    failed,
    play_all,
    taken,
)
from ds47.lab.scenario import Book

BOOK = Book("diagnosis")

# Requests that make sense when they are mended (DS714 to DS716)

TEN = 0x41200000
"""The bits of 10.0."""


def swapped(request: bytes) -> bytes:
    """Every word with its low byte first."""
    return b"".join(request[at : at + 2][::-1] for at in range(0, len(request), 2))


def interleaved(request: bytes) -> bytes:
    """Every byte kept in a word of its own."""
    return b"".join(bytes((0, byte)) for byte in request)


def spread(request: bytes) -> bytes:
    """Single bytes at even offsets, the words of an address as they are: a block of BYTE and WORD fields."""
    head, addresses = request[:4], request[4:]
    parts = [bytes((byte, 0)) for byte in head]
    for at in range(0, len(addresses), 6):
        attribute, elements = addresses[at : at + 2]
        parts += [bytes((attribute, 0, elements, 0)), addresses[at + 2 : at + 6]]
    return b"".join(parts)


def little(pnu: int) -> bytes:
    """An address whose words have the low byte first."""
    plain = message.address(pnu, 0, 1)
    return plain[:2] + swapped(plain[2:])


FIRST = RequestAndReply(read(3), speed(3))
"""A good job first, so that index 47 is known to be a parameter channel."""
ARRAY = read(4, message.address(2902, 2, 4))
ARRAY_READ = RequestAndReply(ARRAY, message.answer(4, 1, 1, message.real(10.0, 20.0, 50.0, 100.0)))

BOOK.scenes(
    play_all,
    ("value-in-wrong-type", "A REAL under an integer format",
     "P2900 gets the bits of 10.0 as Unsigned32 1092616192: error 0x05", "change error, DS410 DS714",
     failed(change(1, FIXED, dword(TEN)), DATA_TYPE)),
    ("value-in-wrong-type-not", "A REAL under its own format",
     "the same bits as Float32: the drive takes them", "2 change ok",
     taken(change(1, FIXED, message.real(10.0)))),
    ("value-in-wrong-type-integer", "A whole number under a floating-point format",
     "p0922 gets DINT 1 with format 08, which is 1.4e-45: error 0x05", "change error, DS410 DS714",
     failed(change(1, message.address(922), dword(1, message.FLOAT32)), DATA_TYPE)),
    ("value-in-wrong-type-taken", "A whole number under a floating-point format, and the drive takes it",
     "P2900 := 10 as DINT with format 08: the drive sets 1.4e-44 %, which is nothing", "2 change ok, DS714",
     taken(change(1, FIXED, dword(10, message.FLOAT32)))),
    ("bytes-swapped", "A request with the low byte of each word first",
     "reference 4 arrives as request ID 4: the Write is refused",
     "read ok, unknown refused, DS203 DS302 DS305 DS715", FIRST, bounced(swapped(ARRAY))),
    ("bytes-swapped-not", "The same request with the high byte first",
     "the same request, high byte first: the drive answers", "2 read ok", FIRST, ARRAY_READ),
    ("bytes-swapped-fields", "An address with the low byte first",
     "P2900 arrives as 21515, which the drive does not have: error 0x00", "read error, DS410 DS715",
     failed(read(1, little(2900)), UNKNOWN)),
    ("bytes-swapped-fields-not", "A parameter whose number looks swapped",
     "parameter 21515, and the drive has it", "read ok",
     RequestAndReply(read(1, little(2900)), speed(1, 10.0))),
    ("bytes-swapped-values", "A value with the low byte first", "10.0 arrives as 1.1e-41: error 0x02",
     "change error, DS410 DS715",
     failed(change(1, FIXED, message.raw_block(8, 1, TEN.to_bytes(4, "little"))), LIMITS)),
    ("data-block-layout", "Every byte in a word of its own",
     "an array of WORD instead of BYTE: zeros between the bytes, the Write is refused",
     "read ok, unknown refused, DS203 DS301 DS302 DS305 DS313 DS716", FIRST, bounced(interleaved(ARRAY))),
    ("data-block-layout-not", "The same request without the zeros",
     "the same request from an array of BYTE: the drive answers", "2 read ok", FIRST, ARRAY_READ),
    ("data-block-layout-even", "Fields of one byte at even offsets",
     "an optimised data block: a fill byte behind each single byte, the Write is refused",
     "read ok, unknown refused, DS203 DS302 DS303 DS313 DS716", FIRST, bounced(spread(ARRAY))),
)  # fmt: skip

# Lengths of the request and of the response (DS711, DS713)

ARRAYS = [message.address(2902, 0, 8)] * 8
"""34 bytes of response each: seven of them do not fit into 240 bytes."""
VALUES = message.real(0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 150.0, 200.0)
WHOLE_CHANGE = change(4, FIXED, message.real(10.0))


def arrays(answered: int, limit: int = 0) -> list[RequestAndReply]:
    """Eight arrays asked for, some answered; before that r0974 where there is a limit."""
    first = read(1, message.address(974, 0, 3))
    known = RequestAndReply(first, message.answer(1, 1, 1, message.word(limit, 39, 0)))
    reference = 2 if limit else 1
    many = RequestAndReply(
        read(reference, *ARRAYS), message.answer(reference, 1, 1, *[VALUES] * answered)
    )
    return [known, many] if limit else [many]


BOOK.scenes(
    play_all,
    ("request-length", "LEN smaller than the request",
     "LEN 12 for a change of 16 bytes: the value is missing, the Write is refused",
     "read ok, change refused, DS203 DS315 DS711", FIRST, bounced(WHOLE_CHANGE[:12])),
    ("request-length-not", "LEN greater than the request",
     "LEN 20 for a change of 16 bytes: four zeros behind it, the drive does not mind",
     "read ok, 2 change ok, DS314", FIRST, taken(WHOLE_CHANGE + bytes(4))),
    ("response-too-long", "More values than one response can carry",
     "8 arrays of 34 bytes each asked for: the drive answers the 6 that fit into 240 bytes",
     "read partial, DS407 DS713", *arrays(6)),
    ("response-too-long-not", "Fewer parameters answered, though there was room",
     "the same request, 5 answered: the sixth would have fitted, so this has another reason",
     "read partial, DS407", *arrays(5)),
    ("response-too-long-refused", "More values than one response can carry: refused with a number",
     "the same request, the last two refused with 0x15", "read partial, DS410 DS713",
     RequestAndReply(
         read(1, *ARRAYS),
         message.answer(1, NEGATIVE_READ, 1, *[VALUES] * 6, *[message.error(TOO_LONG)] * 2))),
    ("response-too-long-limit", "A drive whose messages are shorter than usual",
     "r0974 says 139 bytes: three of eight arrays are answered, a fourth would make 140",
     "read ok, read partial, DS407 DS713", *arrays(3, limit=139)),
    ("response-too-long-limit-not", "A drive whose messages may be longer than usual",
     "r0974 says 242 bytes: six of eight arrays are answered, a seventh would make 242",
     "read ok, read partial, DS407", *arrays(6, limit=242)),
)  # fmt: skip


# MLEN of RDREC (DS712)


def _four(client: Client, maximum: int) -> None:
    """Four Float32 asked for, 22 bytes; the Read wants `maximum` bytes and the drive keeps to it."""
    client.write(read(1, message.address(2902, 2, 4)))
    client.wait(CYCLE)
    _fetch_four(client, maximum)


def _fetch_four(client: Client, maximum: int) -> None:
    call = client.ask_read(maximum=maximum)
    whole = message.answer(1, 1, 1, message.real(10.0, 20.0, 50.0, 100.0))
    client.accept_read(call, whole[:maximum])


BOOK.scenes(
    _four,
    ("read-length", "MLEN smaller than the response",
     "MLEN 10 for a response of 22 bytes: the drive sends 10", "read error, DS315 DS712", 10),
    ("read-length-not", "MLEN as long as the response", "MLEN 22, the response to the byte", "read ok",
     22),
)  # fmt: skip


@BOOK.scene(
    "MLEN 10 for a response of 22 bytes: the drive refuses the Read, one with 240 brings the response",
    "read ok, DS201 DS712",
)
def read_length_refused(client: Client) -> None:
    """MLEN smaller than the response: refused."""
    client.write(read(1, message.address(2902, 2, 4)))
    client.wait(CYCLE)
    client.refuse_read(client.ask_read(maximum=10), DE_LENGTH)
    client.wait(CYCLE)
    _fetch_four(client, 240)


@BOOK.scene(
    "MLEN 22, and the drive refuses the Read: the request asks for no more", "read refused, DS201"
)
def read_length_alone_not(client: Client) -> None:
    """A Read that was too short, as far as its status says."""
    client.write(read(1, message.address(2902, 2, 4)))
    client.wait(CYCLE)
    client.refuse_read(client.ask_read(maximum=22), DE_LENGTH)


@BOOK.scene("MLEN 22, and the same status all the same: it has another reason", "read ok, DS201")
def read_length_refused_not(client: Client) -> None:
    """A Read refused for another reason."""
    client.write(read(1, message.address(2902, 2, 4)))
    client.wait(CYCLE)
    client.refuse_read(client.ask_read(maximum=22), DE_LENGTH)
    client.wait(CYCLE)
    _fetch_four(client, 22)
