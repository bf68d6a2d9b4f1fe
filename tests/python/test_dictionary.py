"""The dictionary: what a drive has said of a parameter comes before what is listed, for one drive object."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from ds47.model import SIEMENS, Parameter, Value
from ds47.profidrive.dictionary import Dictionary, Meaning, explain, is_known, listed, unit_of
from ds47.profidrive.drive_objects import LOCAL, DriveAccess, DriveObjects
from ds47.spec.semantics import known, limits

DRIVE, OTHER = "192.168.0.2", "192.168.0.3"
TWO = DriveAccess(DRIVE, 47, 1, 1, 2)
WORD, INTEGER, FLOAT = 0x06, 0x03, 0x08
HERTZ, SECONDS, POWER = 28, 4, 9
OCTETS = "OctetString"


def whole(
    name: bytes = b"Max_frequency",
    code: int = FLOAT,
    quantity: int = HERTZ,
    conversion: int = 0,
    factor: float = 1.0,
    bits: int = 0,
    low: bytes = bytes(4),
    high: bytes = bytes(4),
) -> list[Value]:
    """A description of 46 bytes, as the decoder shows it."""
    head = struct.pack(
        ">HHfBb4x16s", bits << 8 | code, 0, factor, quantity, conversion, name.ljust(16)
    )
    return [(head + low + high + bytes(8)).hex()]


class Drive:
    """A dictionary, and what fills it: each response stands in a frame of its own."""

    def __init__(self, most: int = 100) -> None:
        self.objects = DriveObjects()
        self.dictionary = Dictionary(self.objects, most)
        self.frame = 0

    def says(
        self,
        values: list[Value],
        access: DriveAccess = TWO,
        pnu: int = 1082,
        subindex: int = 0,
        format_name: str = OCTETS,
    ) -> int:
        self.frame += 1
        self.dictionary.learn(access, pnu, subindex, format_name, values, self.frame)
        return self.frame

    def of(self, access: DriveAccess = TWO, pnu: int = 1082, vendor: int | None = None) -> Meaning:
        return self.dictionary.meaning(access, pnu, vendor)

    def told(
        self, format_name: str, *values: Value, pnu: int = 1082, vendor: int | None = None
    ) -> Parameter:
        """A parameter of a transaction, explained."""
        row = listed(pnu, vendor)
        item = Parameter(
            pnu, 0, "value", 0, row, unit_of(row, format_name), format_name, len(values), list(values)
        )  # fmt: skip
        explain(item, self.of(pnu=pnu, vendor=vendor))
        return item


@pytest.fixture
def drive() -> Drive:
    return Drive()


def test_nothing_is_known_before(drive: Drive) -> None:
    assert drive.dictionary.is_empty
    assert drive.of() == Meaning(None)
    assert not drive.of().is_said


def test_a_whole_description(drive: Drive) -> None:
    frame = drive.says(whole(low=struct.pack(">f", 1.5), high=struct.pack(">f", 210)))
    found = drive.of()
    assert found.name == ("Max_frequency", frame)
    assert found.type == ("Float32", frame)
    assert found.measure == (0, "Hz", (frame,))
    assert (found.low, found.high) == ((1.5, frame), (210.0, frame))


def test_the_drive_comes_before_the_list(drive: Drive) -> None:
    assert drive.told("Unsigned16", 9, pnu=922).name == "Telegram selection"
    drive.says(whole(b"Telegram", WORD, 0), pnu=922)
    item = drive.told("Unsigned16", 9, pnu=922)
    assert (item.name, item.described_in) == ("Telegram", [1])
    assert item.listed


def test_a_name_that_the_drive_does_not_say_is_that_of_the_list(drive: Drive) -> None:
    drive.says(whole(b"", WORD, HERTZ), pnu=922)
    item = drive.told("Unsigned16", 9, pnu=922)
    assert (item.name, item.unit, item.described_in) == ("Telegram selection", "Hz", [1])


def test_the_list_speaks_of_its_maker_alone() -> None:
    assert listed(1082, None) is None
    names = [
        each and each.name_en for each in (listed(1082, SIEMENS), listed(1082, None, "micromaster"))
    ]
    assert names == ["Maximum speed", "Maximum frequency"]
    row = listed(806, SIEMENS)
    assert row is not None
    assert listed(row.number, 0x0042) is None
    assert listed(922, 0x0042) is not None
    assert listed(None, SIEMENS) is None


def test_of_an_unknown_make_every_number_of_a_table_is_known() -> None:
    known = [
        is_known(2900, *whose) for whose in ((None,), (SIEMENS,), (0x0042,), (None, "micromaster"))
    ]
    assert known == [True, True, False, False]
    assert not is_known(1999, None)


@pytest.mark.parametrize(
    ("pnu", "format_name", "unit"),
    [
        (1120, "Float32", "s"), (1120, "Unsigned16", None), (1120, None, "s"), (297, "Word", "V"),
        (297, "Unsigned16", "V"), (297, "DoubleWord", None), (1080, "Float32", "rpm"), (1080, "Unsigned32", None),
        (39, "Float32", "kWh"), (722, "Unsigned32", None),
    ],
)  # fmt: skip
def test_a_unit_is_that_of_values_of_the_listed_type(
    pnu: int, format_name: str | None, unit: str | None
) -> None:
    assert unit_of(listed(pnu, SIEMENS), format_name) == unit


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (whole(code=0x7E), "a type that there is not"),
        (whole(code=0x44), "an error as type"),
        (whole(b"Max\x07frequency"), "a control character"),
        (whole(b"Max\x9bfrequency"), "a control character of the upper half"),
        (whole(b"Max\xa0frequency"), "a blank that is none"),
        ([bytes(46).hex()], "nothing but zero"),
        ([("ff" * 46)], "nothing but ones"),
        ([whole()[0][:-2]], "a byte too few"),  # type: ignore[index]
        ([1.5], "a number"),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_a_description_that_is_not_sensible_teaches_nothing(
    drive: Drive, values: list[Value], why: str
) -> None:
    drive.says(values)
    assert drive.dictionary.is_empty, why


def test_letters_of_latin_1_are_a_name(drive: Drive) -> None:
    drive.says(whole("Höchstdrehzahl µ".encode("latin-1")))
    assert drive.told("Float32", 1.0).name == "Höchstdrehzahl µ"


def test_the_later_of_two_descriptions_counts(drive: Drive) -> None:
    drive.says(whole(b"First", INTEGER, HERTZ, -1))
    drive.says(whole(b"Second", INTEGER, HERTZ, -2))
    item = drive.told("Integer16", 500)
    assert (item.name, item.scaled, item.described_in) == ("Second", [5.0], [2])


def test_a_whole_one_leaves_nothing_of_the_one_before(drive: Drive) -> None:
    drive.says(whole(b"First", INTEGER, HERTZ))
    drive.says(whole(b"", INTEGER, 0))
    item = drive.told("Integer16", 500)
    assert (item.name, item.unit, item.described_in) == (None, None, None)


def test_elements_are_put_together(drive: Drive) -> None:
    drive.says(["Ramp"], subindex=6, format_name="VisibleString16")
    assert drive.told("Unsigned16", 12).described == ("Ramp", (1,))
    drive.says([SECONDS << 8 | 0xFE], subindex=4, format_name="Word")
    assert drive.told("Unsigned16", 12).unit is None  # of which type it is nobody said
    drive.says([WORD], subindex=1, format_name="Word")
    item = drive.told("Unsigned16", 12)
    assert (item.unit, item.scaled, item.described_in) == ("s", [0.12], [1, 2, 3])
    drive.says(whole(b"Other", WORD, 0))
    item = drive.told("Unsigned16", 12)
    assert (item.name, item.unit, item.scaled, item.described_in) == ("Other", None, None, [4])


def test_an_element_is_newer_than_a_whole_one(drive: Drive) -> None:
    drive.says(whole())
    drive.says(["Nmax"], subindex=6, format_name="VisibleString16")
    item = drive.told("Float32", 50.0)
    assert (item.name, item.unit, item.described_in) == ("Nmax", "Hz", [1, 2])


SCALES: list[tuple[dict[str, Any], str, Value, str | None, list[Value] | None]] = [
    ({"code": INTEGER, "conversion": -1}, "Integer16", -300, "Hz", [-30.0]),
    ({"code": INTEGER, "conversion": -2}, "Integer16", 7, "Hz", [0.07]),
    ({"code": WORD, "conversion": 1}, "Unsigned16", 3, "Hz", [30.0]),
    ({"code": WORD, "conversion": 3}, "Unsigned16", 3, "kHz", None),
    ({"code": WORD, "quantity": SECONDS, "conversion": -3}, "Unsigned16", 250, "ms", None),
    ({"code": WORD, "quantity": SECONDS, "conversion": 70}, "Unsigned16", 2, "min", None),
    ({"code": WORD, "quantity": POWER, "conversion": -2}, "Word", 150, "W", [1.5]),
    ({"code": INTEGER, "conversion": -1}, "Word", 65535, None, None),  # its sign is not known
    ({"code": WORD, "conversion": -1}, "DoubleWord", 5, None, None),
    ({"code": WORD, "conversion": -1}, "Float32", 5.0, None, None),
    ({"code": FLOAT}, "Float32", 5.0, "Hz", None),
    ({"code": FLOAT, "conversion": -1}, "Float32", 5.0, None, None),
    ({"code": WORD, "conversion": -1, "factor": 0.1}, "Unsigned16", 5, "Hz", [0.5]),
    ({"code": WORD, "conversion": -1, "factor": 10.0}, "Unsigned16", 5, "Hz", [0.5]),
    ({"code": WORD, "conversion": -1, "factor": 0.3}, "Unsigned16", 5, None, None),
    ({"code": WORD, "conversion": 0, "factor": 0.1}, "Unsigned16", 5, None, None),
    ({"code": WORD, "factor": float("nan")}, "Unsigned16", 5, None, None),
    ({"code": WORD, "factor": 0.0}, "Unsigned16", 5, None, None),
    ({"code": WORD, "bits": 1}, "Unsigned16", 5, None, None),  # bit 8: they say nothing
    ({"code": WORD, "quantity": 99}, "Unsigned16", 5, None, None),
    ({"code": WORD, "conversion": 100}, "Unsigned16", 5, None, None),
    ({"code": WORD, "conversion": -23}, "Unsigned16", 5, None, None),
    ({"code": 0x71}, "N2", 5, None, None),
]


@pytest.mark.parametrize(("said", "format_name", "value", "unit", "scaled"), SCALES)
def test_how_a_value_is_measured(
    drive: Drive,
    said: dict[str, Any],
    format_name: str,
    value: Value,
    unit: str | None,
    scaled: list[Value] | None,
) -> None:
    drive.says(whole(**said))
    item = drive.told(format_name, value)
    assert (item.unit, item.scaled) == (unit, scaled)
    assert item.described_in == [1]


def test_a_unit_of_the_list_is_not_that_of_another_type(drive: Drive) -> None:
    row = next(
        each for each in (listed(number, SIEMENS) for number in range(3000)) if each and each.unit
    )
    assert row.type == "Float32"
    drive.says(whole(b"Same", FLOAT, 0), pnu=row.number)
    assert drive.told("Float32", 1.0, pnu=row.number, vendor=SIEMENS).unit == row.unit
    drive.says(whole(b"Another", WORD, 0), pnu=row.number)
    assert drive.told("Unsigned16", 1, pnu=row.number, vendor=SIEMENS).unit is None


def test_what_is_said_of_a_drive_object_says_nothing_of_others(drive: Drive) -> None:
    drive.says(whole())
    assert drive.of().name is not None
    assert drive.of(TWO._replace(record_index=0xB02F)).name is not None
    for other in (
        TWO._replace(axis=3), TWO._replace(axis=0), TWO._replace(device=OTHER),
        TWO._replace(slot=2), TWO._replace(record_index=LOCAL, axis=None),
    ):  # fmt: skip
        assert not drive.of(other).is_said, other
    assert not drive.of(pnu=1083).is_said


def test_what_proves_a_drive_object_names_by_other_ways(drive: Drive) -> None:
    drive.says(whole())
    elsewhere = TWO._replace(slot=2)
    local = DriveAccess(DRIVE, LOCAL, 2, 1, None)
    assert not drive.of(elsewhere).is_said
    drive.objects.refused(TWO._replace(axis=9), known().axis_error)  # it looks at the axis byte
    assert drive.of(elsewhere).is_said
    assert not drive.of(local).is_said
    drive.objects.identified(local, 7, [2])
    assert drive.of(local).is_said
    drive.objects.identified(local, 7, [3])  # now it is not known any more
    assert not drive.of(local).is_said


def test_of_two_ways_the_newer_counts(drive: Drive) -> None:
    other = TWO._replace(slot=2)
    drive.objects.refused(TWO._replace(axis=9), known().axis_error)
    drive.says(whole(b"First", INTEGER, HERTZ, -1))
    drive.says(["Second"], access=other, subindex=6, format_name="VisibleString16")
    for access in (TWO, other):
        found = drive.of(access)
        assert found.name == ("Second", 2)
        assert found.measure == (-1, "Hz", (1,))
    drive.says(whole(b"", WORD, 0))
    assert drive.of(other).name is None


def test_a_global_parameter_is_one_for_the_device(drive: Drive) -> None:
    pnu = min(known().global_pnus)
    drive.says(whole(b"Ident", WORD, 0), pnu=pnu)
    assert drive.of(TWO._replace(axis=5, slot=7), pnu).name == ("Ident", 1)


def test_nothing_later_names_what_was_before(drive: Drive) -> None:
    drive.says(whole(b"First"))
    drive.says(["Second"], subindex=6, format_name="VisibleString16")
    assert drive.dictionary.meaning(TWO, 1082, None, until=0) == Meaning(None)
    found = drive.dictionary.meaning(TWO, 1082, None, until=1)
    assert (found.name, found.measure) == (None, (0, "Hz", (1,)))
    assert drive.dictionary.meaning(TWO, 1082, None, until=2).name == ("Second", 2)


def test_so_many_descriptions_are_remembered() -> None:
    drive = Drive(most=3)
    for pnu in range(1, 4):
        drive.says(whole(b"Name"), pnu=pnu)
    drive.says(whole(b"Anew"), pnu=1)
    drive.says(whole(b"Fourth"), pnu=4)
    assert [pnu for pnu in range(1, 5) if drive.of(pnu=pnu).is_said] == [1, 3, 4]


def test_a_parameter_has_so_many_ways(drive: Drive) -> None:
    ways = [TWO._replace(axis=axis) for axis in range(1, 18)]
    for way in ways[:16]:
        drive.says(whole(), access=way)
    assert all(drive.of(way).is_said for way in ways[:16])
    drive.says(whole(), access=ways[16])
    assert [drive.of(way).is_said for way in ways] == [False] + [True] * 16


def test_the_limit_holds_a_whole_drive() -> None:
    assert limits().described_parameters >= 4 * 4096
