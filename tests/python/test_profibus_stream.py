"""Frames among bytes without borders: every one is found, and a wrong byte costs the frame that it is in."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profibus import telegram
from ds47.profibus.stream import LinePiece, TelegramReader, split

TOKEN, SHORT = bytes.fromhex("dc0202"), b"\xe5"
STATUS = telegram.encode(3, 2, 0x49)
READ = telegram.encode(3, 2, 0x7D, bytes.fromhex("5e002ff0"), 51, 51)
DIAGNOSIS = bytes.fromhex("a28283083e3c000400ff80b5bf16")


def frames(chance: random.Random, count: int) -> list[bytes]:
    """Frames as they stand on a line, longest ones among them."""
    found = []
    for _ in range(count):
        kind = chance.random()
        if kind < 0.15:
            found.append(bytes((0xDC, 2, chance.choice((2, 2, 2, 5)))))
        elif kind < 0.3:
            found.append(SHORT)
        elif kind < 0.5:
            found.append(chance.choice((STATUS, DIAGNOSIS, telegram.encode(2, 3, 0x00))))
        else:
            du = chance.randbytes(chance.choice((0, 4, 12, 12, 30, 244)))
            saps: tuple[int | None, int | None] = chance.choice(((None, None), (51, 51)))
            fc = chance.choice((0x5D, 0x7D, 0x08))
            found.append(telegram.encode(chance.randrange(2, 8), 2, fc, du, *saps))
    return found


def told(pieces: list[LinePiece]) -> list[bytes]:
    """The frames without a flaw."""
    return [each.telegram.data for each in pieces if not each.telegram.flaws]


def in_parts(data: bytes, chance: random.Random) -> list[LinePiece]:
    """What a reader says to bytes that come a few at a time."""
    reader, found, at = TelegramReader(), [], 0
    while at < len(data):
        step = chance.randint(1, 400)
        found += reader.feed(data[at : at + step])
        at += step
    return [*found, *reader.finish()]


@given(st.integers(0, 1 << 32))
def test_whole_frames_are_found(seed: int) -> None:
    known = frames(random.Random(seed), 12)
    assert told(split(b"".join(known))) == known


@pytest.mark.parametrize("first", range(0, 400, 100))
def test_a_wrong_byte_costs_one_frame(first: int) -> None:
    for seed in range(first, first + 100):
        chance = random.Random(seed)
        known = frames(chance, 12)
        data = bytearray(b"".join(known))
        at = chance.randrange(len(data))
        data[at] ^= chance.randint(1, 255)
        pieces = split(bytes(data))
        assert b"".join(each.telegram.data for each in pieces) == data
        assert [each.offset for each in pieces[1:]] == [
            each.offset + len(each.telegram.data) for each in pieces[:-1]
        ]
        offset = 0
        standing = {(each.offset, each.telegram.data) for each in pieces if not each.telegram.flaws}
        for frame in known:
            if not offset <= at < offset + len(frame):
                assert (offset, frame) in standing, (seed, at)
                standing.discard((offset, frame))
            offset += len(frame)
        assert len(standing) <= 1  # a token says another station, and nothing shows it
        assert in_parts(bytes(data), chance) == pieces


@pytest.mark.parametrize("seed", range(50))
def test_a_missing_byte_costs_one_frame_and_what_nothing_proves_behind_it(seed: int) -> None:
    chance = random.Random(seed)
    known = [each for each in frames(chance, 12) if each not in (SHORT,) and each[0] != 0xDC]
    at = chance.randrange(len(b"".join(known)))
    data = b"".join(known)[:at] + b"".join(known)[at + 1 :]
    assert len(told(split(data))) == len(known) - 1


@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_split(data: bytes, border: bool) -> None:
    pieces = split(data, border)
    assert b"".join(each.telegram.data for each in pieces) == data


def test_a_recording_that_begins_in_a_frame() -> None:
    pieces = split(READ[5:] + TOKEN + READ + SHORT, border=False)
    assert told(pieces) == [TOKEN, READ, SHORT]
    assert pieces[0].telegram.data == READ[5:]


def test_a_token_between_damaged_bytes_is_not_proved() -> None:
    (piece,) = split(b"\xff" + TOKEN + b"\xff")
    assert piece.telegram.flaws


def test_the_length_that_differs_is_found_by_the_other_one() -> None:
    damaged = bytearray(READ)
    damaged[1] = 0x20
    pieces = split(bytes(damaged) + SHORT + TOKEN)
    assert [each.telegram.data for each in pieces] == [bytes(damaged), SHORT, TOKEN]
    assert [each.kind for each in pieces[0].telegram.flaws] == ["lengths"]


def test_noise_is_told_in_pieces_and_not_kept() -> None:
    reader = TelegramReader()
    pieces = [piece for _ in range(20) for piece in reader.feed(bytes(1000))]
    pieces += reader.finish()
    assert sum(len(each.telegram.data) for each in pieces) == 20_000
    assert max(len(each.telegram.data) for each in pieces) <= 4096


def test_an_idle_line_between_damaged_bytes_is_read() -> None:
    """Tokens in a row for long need no frame that proves them; a few do."""
    assert told(split(b"\xff" + TOKEN * 100 + b"\xff")) == [TOKEN] * 100
    assert told(split(b"\xff" + TOKEN * 10 + b"\xff")) == []


def test_bytes_that_lead_nowhere_are_followed_once() -> None:
    assert told(split((b"\x00" + SHORT * 99) * 500 + b"\x00")) == []
