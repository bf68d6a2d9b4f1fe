"""Conversations of S7 that chance seldom makes: the edges of DS905, DS907, DS910 and DS912.

Each is a few jobs of some clients in the order in which they were heard. All findings are written here.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
import s7_segments as s7
from frames import pcap

from ds47.analysis import analyze
from ds47.model import Finding
from ds47.spec.semantics import limits

FULL = 240 - 28
"""Bytes of a PUT that fills its PDU."""
PATTERN = bytes(range(1, 33))


class Plant:
    """Clients of one server; all that they say is one capture, a microsecond apart."""

    def __init__(self, clients: int = 2) -> None:
        self.talks = [s7.Talk((f"10.0.1.{n}", 49152 + n)) for n in range(1, clients + 1)]
        self._heard = [0] * clients
        self._frames: list[bytes] = []
        self._reference = 0
        self.goes_on = False
        """Whether the last frame comes once more, 12 s later: what did not come until then will not come."""
        for number, talk in enumerate(self.talks):
            talk.opened(pdu=240)
            self._hear(number)

    def _hear(self, client: int) -> None:
        frames = self.talks[client].frames()
        self._frames += frames[self._heard[client] :]
        self._heard[client] = len(frames)

    def say(self, client: int, up: bool, pdu: bytes) -> None:
        self.talks[client].say(up, s7.dt(pdu))
        self._hear(client)

    def close(self, client: int) -> None:
        self.talks[client].closed()
        self._hear(client)

    def reference(self) -> int:
        self._reference += 1
        return self._reference

    def put(self, client: int, start: int, value: bytes) -> None:
        reference = self.reference()
        where = s7.item(1, 8 * start, len(value))
        self.say(client, True, s7.put(reference, where, value))
        self.say(client, False, s7.taken(reference, 0xFF))

    def ask(self, client: int, start: int, count: int) -> int:
        """The request of a GET."""
        reference = self.reference()
        self.say(client, True, s7.get(reference, s7.item(1, 8 * start, count)))
        return reference

    def tell(self, client: int, reference: int, value: bytes) -> None:
        self.say(client, False, s7.got(reference, s7.entry(value)))

    def send(self, client: int, r_id: int, *, last: bool, total: int = 20) -> None:
        """The first segment of a BSEND, 20 bytes, and its acknowledge."""
        reference = self.reference()
        data = s7.bsend(reference, r_id, bytes(20), last=last, total=total)
        self.say(client, True, data)
        self.say(client, False, s7.received(reference, 7))

    def capture(self) -> bytes:
        whole = pcap(self._frames, apart_s=0)
        last = self._frames[-1]
        late = struct.pack("<4I", 1012, 0, len(last), len(last)) + last
        return whole + late if self.goes_on else whole


def a_read_between_the_parts_that_is_answered_later() -> Plant:
    """The PUT in two parts is complete before the answer: bytes of both its old and its new value are in there."""
    plant = Plant()
    plant.put(0, 0, bytes(FULL))
    plant.put(0, FULL, bytes(48))
    plant.put(0, 0, b"\x11" * FULL)
    reference = plant.ask(1, FULL - 8, 16)
    plant.put(0, FULL, b"\x11" * 48)
    plant.tell(1, reference, b"\x11" * 8 + bytes(8))
    return plant


def a_read_of_what_stood_there_before_the_put() -> Plant:
    """Two parts of a PUT, and a read of what is behind them."""
    plant = Plant()
    plant.put(0, 0, bytes(FULL))
    plant.put(0, FULL, bytes(48))
    plant.tell(1, plant.ask(1, FULL - 8, 16), bytes(16))
    return plant


def two_writers_of_the_same_values() -> Plant:
    """Where both write they write the same, and only there."""
    plant = Plant()
    plant.put(0, 4, PATTERN[4:20])
    plant.put(1, 8, PATTERN[8:24])
    return plant


def two_writers_of_other_values() -> Plant:
    """They agree in all common bytes but the last."""
    plant = Plant()
    plant.put(0, 0, PATTERN[:16])
    plant.put(1, 8, PATTERN[8:15] + b"\xff" + PATTERN[16:24])
    return plant


def a_client_leaves_while_another_one_sends() -> Plant:
    """Both have a BSEND with the same R_ID open; that of the other goes on, and is begun anew."""
    plant = Plant(3)
    for client in (0, 1, 2):
        plant.send(client, 9, last=False, total=40)
    plant.close(1)
    plant.send(2, 9, last=True)
    return plant


def a_transfer_that_does_not_end() -> Plant:
    """All bytes that were announced, and no last segment."""
    plant = Plant(1)
    plant.send(0, 3, last=False)
    plant.close(0)
    return plant


def more_transfers_than_are_remembered() -> Plant:
    """Open BSENDs of more R_IDs than are kept, of two clients, and then those at the edge begun anew."""
    plant, most = Plant(2), limits().s7_notes
    for r_id in range(most + 2):
        plant.send(r_id % 2, r_id, last=False, total=40)
    for r_id in (most + 1, most, most - 1, 0):
        plant.send(r_id % 2, r_id, last=False, total=40)
    plant.goes_on = True
    return plant


PUT = [*range(15, 21), 22, 23]
SAID: dict[Callable[[], Plant], list[tuple[str, list[int]]]] = {
    a_read_between_the_parts_that_is_answered_later: [
        ("DS904", PUT),
        ("DS905", list(range(19, 25))),
    ],
    a_read_of_what_stood_there_before_the_put: [("DS904", list(range(15, 19)))],
    two_writers_of_the_same_values: [],
    two_writers_of_other_values: [("DS907", [15, 17])],
    a_client_leaves_while_another_one_sends: [  # that of the first may go on behind the capture
        ("DS725", [22]),
        ("DS910", [24]),
        ("DS912", [26, 31]),
    ],
    a_transfer_that_does_not_end: [("DS910", [8])],
}
"""The rules, each with its frames."""


def findings(plant: Plant) -> list[Finding]:
    return analyze(io.BytesIO(plant.capture())).findings


@pytest.mark.parametrize("play", SAID, ids=lambda play: play.__name__)
def test_what_is_said(play: Callable[[], Plant]) -> None:
    assert [(each.rule, each.frames) for each in findings(play())] == SAID[play]


def test_the_bytes_that_were_not_there_together() -> None:
    *_, mixed = findings(a_read_between_the_parts_that_is_answered_later())
    told = [mixed.args[name] for name in ("first", "first_value", "second", "second_value")]
    assert told == ["DB1.DBB211", 0x11, "DB1.DBB219", 0]
    (other,) = findings(two_writers_of_other_values())
    assert other.args["byte"] == "DB1.DBB15"


@pytest.mark.slow
def test_as_many_transfers_are_remembered() -> None:
    """Each of them ends without its last segment; of those that are begun anew one is forgotten."""
    told = findings(more_transfers_than_are_remembered())
    begun = [each.args["r_id"] for each in told if each.rule == "DS912"]
    most = limits().s7_notes
    assert begun == [most + 1, most, most - 1]
    assert sum(each.rule == "DS910" for each in told) == most


# Areas in parts (DS904): signs beside a full PDU


def told(
    *pieces: tuple[int, int], asked: bool = False, between: tuple[int, int] | None = None
) -> list[str]:
    """The areas in parts where a client reads these pieces, each by start and length.

    `asked`: all are asked for before the first is there. `between`: read behind the first.
    """
    plant, open_still = Plant(1), []
    for number, (start, length) in enumerate(pieces):
        reference = plant.ask(0, start, length)
        if asked:
            open_still.append((reference, length))
            continue
        plant.tell(0, reference, bytes(length))
        if number == 0 and between is not None:
            plant.tell(0, plant.ask(0, *between), bytes(between[1]))
    for reference, length in open_still:
        plant.tell(0, reference, bytes(length))
    return [str(each.args["area"]) for each in findings(plant) if each.rule == "DS904"]


def test_pieces_of_one_length_behind_each_other_are_an_area() -> None:
    assert told((0, 96), (96, 96), (192, 96)) == ["DB1.DBB0..287"]
    assert told((0, 96), (96, 96), (192, 96), (288, 5)) == ["DB1.DBB0..292"]
    assert told((0, 9), (9, 9), (18, 9)) == ["DB1.DBB0..26"]


@pytest.mark.parametrize(
    "pieces",
    [
        ((0, 96), (96, 96)),  # two may be two
        ((0, 96), (96, 50)),
        ((0, 96), (96, 95), (191, 96)),
        ((0, 96), (96, 96), (192, 97)),  # the last one is longer
        ((0, 96), (97, 96), (193, 96)),  # a byte is left out
        ((192, 96), (96, 96), (0, 96)),
        ((0, 8), (8, 8), (16, 8), (24, 8)),  # variables
    ],
)
def test_other_pieces_are_none(pieces: tuple[tuple[int, int], ...]) -> None:
    assert told(*pieces) == []


def test_what_is_read_between_ends_an_area() -> None:
    assert told((0, 96), (96, 96), (192, 96), between=(500, 4)) == []


def test_pieces_that_are_open_together_are_none_but_for_halves() -> None:
    assert told((0, 96), (96, 96), (192, 96), asked=True) == []
    assert told((100, 50), (50, 50), asked=True) == ["DB1.DBB50..149"]
    assert told((50, 50), (100, 51), asked=True) == ["DB1.DBB50..150"]
    assert told((50, 50), (100, 52), asked=True) == []
    assert told((50, 50), (101, 50), asked=True) == []
    assert told((50, 50), (50, 50), asked=True) == []
    assert told((0, 8), (8, 8), asked=True) == []
    assert told((50, 50), (100, 50)) == []


def test_halves_where_one_is_refused_are_none() -> None:
    plant = Plant(1)
    first, second = plant.ask(0, 0, 50), plant.ask(0, 50, 50)
    plant.tell(0, first, bytes(50))
    plant.say(0, False, s7.got(second, s7.entry(b"", 0x05)))
    assert "DS904" not in {each.rule for each in findings(plant)}


def test_each_area_that_s7connector_splits_is_told(captures: Path) -> None:
    """It reads and writes in pieces of 96 bytes whatever the PDU has room for."""
    path, log = (
        captures / "lossy-stacks/s7connector.pcapng",
        captures / "lossy-stacks/EXPECTED.jsonl",
    )
    asked = map(json.loads, log.read_text("utf-8").splitlines())
    split = {
        f"DB{each['db']}.DBB{each['start']}..{each['start'] + each['length'] - 1}"
        for each in asked
        if each["capture"] == "s7connector"
        and each["op"] in ("read", "write")
        and each["length"] > 2 * 96
    }
    areas = [each.args["area"] for each in analyze(path).findings if each.rule == "DS904"]
    assert set(areas) == split
    assert len(areas) == 10
