"""What a capture says of its parameters: from the description on, and the same in every format."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from uuid import UUID

import pytest

from ds47 import spec
from ds47.acyclic import learning
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab import message, wire
from ds47.lab.client import Client, controller
from ds47.lab.stage import Stage
from ds47.model import Finding, Parameter, Report, Transaction
from ds47.profidrive.dictionary import Dictionary, explain_transaction
from ds47.profidrive.drive_objects import LOCAL, DriveObjects, access_of
from ds47.regression.compare import compare
from ds47.regression.config import Config
from ds47.report import contract, csv, formatting, load, write_all
from ds47.report import json as report_json
from ds47.report.contract import PARAMETER, TRANSACTION
from ds47.report.text import Writer as TextWriter

CAPTURE = Path(__file__).resolve().parents[2] / "captures/format-described.pcapng"
RAMP = message.address(1999)
ABOUT = message.address(1999, 0, 1, message.DESCRIPTION)
NAMED = '("Ramp-up time")'
LISTED = "Ramp-function generator, ramp-up time"
DOWN = "Ramp-function generator, ramp-down time"


def description(name: bytes = b"Ramp-up time", conversion: int = -2) -> bytes:
    """A description: Unsigned16, a time."""
    head = (
        bytes.fromhex("0006 0000 3f800000 04")
        + conversion.to_bytes(1, "big", signed=True)
        + bytes(4)
    )
    return message.raw_block(0x0A, 46, head + name.ljust(16) + bytes(16))


def describe(client: Client, reference: int = 1, axis: int = 2, **said: bytes) -> None:
    client.exchange(
        message.read(reference, axis, ABOUT),
        message.answer(reference, 1, axis, description(**said)),
    )


def read(client: Client, reference: int = 2, axis: int = 2) -> None:
    client.exchange(
        message.read(reference, axis, RAMP), message.answer(reference, 1, axis, message.word(1000))
    )


def rival(stage: Stage) -> Client:
    """Another controller, with an AR of its own."""
    channel = wire.RecordId(UUID(int=7 << 64))
    return Client(stage, host=controller(2), channel=channel, activity=UUID(int=9))


def file_of(stage: Stage, path: Path) -> Path:
    with PcapngWriter(path, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    return path


@pytest.fixture
def stage() -> Stage:
    return Stage()


@pytest.fixture
def told(stage: Stage, tmp_path: Path) -> Callable[[], list[str]]:
    """The values of what was played, in words."""

    def tell() -> list[str]:
        result = analyze(file_of(stage, tmp_path / "x.pcapng"))
        return [
            formatting.parameter(item, each.operation == "change")
            for each in result.transactions
            for item in each.parameters
            if item.attribute == "value"
        ]

    return tell


def test_values_are_named_from_the_description_on(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    client = Client(stage)
    read(client, 1)
    describe(client, 2)
    read(client, 3)
    read(client, 4, axis=3)
    assert told() == ["p1999[0] = 1000", f"p1999[0] {NAMED} = 1000 (10.0 s)", "p1999[0] = 1000"]


def test_one_response_may_describe_its_own_values(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    request = message.read(1, 2, RAMP, ABOUT)
    Client(stage).exchange(request, message.answer(1, 1, 2, message.word(5), description()))
    assert told() == [f"p1999[0] {NAMED} = 5 (0.05 s)"]


def test_the_response_counts_and_not_when_a_request_is_over(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    one = Client(stage)
    other = rival(stage)
    read(other)  # is open until the end: nothing more is asked there
    describe(one)
    assert told() == ["p1999[0] = 1000"]


def test_nor_when_its_ar_proves_itself(stage: Stage, told: Callable[[], list[str]]) -> None:
    one, other = Client(stage), rival(stage)
    unknown = bytes((1, 0x7F)) + message.read(1, 2, RAMP)[2:]
    other.exchange(unknown, message.answer(1, 0x80, 2, message.error(0x21)))
    describe(one)
    read(other)
    first, second = told()
    assert NAMED not in first
    assert NAMED in second


def test_without_a_response_it_counts_what_was_said_up_to_the_end(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    other = rival(stage)
    other.write(message.change(1, 2, (RAMP, message.word(100))))
    describe(Client(stage))
    assert told() == [f"p1999[0] {NAMED} := 100 (1.0 s)"]


def test_the_later_of_two_counts(stage: Stage, told: Callable[[], list[str]]) -> None:
    client = Client(stage)
    describe(client, 1)
    describe(client, 2, name=b"Another", conversion=-3)
    read(client, 3)
    assert told() == ['p1999[0] ("Another") = 1000 ms']


BROKEN = {
    "another reference": message.answer(9, 1, 2, description()),
    "another drive object": message.answer(1, 1, 3, description()),
    "a negative response": message.answer(1, 0x81, 2, message.error(9)),
    "of a change": message.answer(1, 2, 2, description()),
    "not supported": message.answer(1, 0x80, 2, description()),
    "cut": message.answer(1, 1, 2, description())[:-1],
    "left over": message.answer(1, 1, 2, description()) + b"\1\1",
    "a control character": message.answer(1, 1, 2, description(b"Ramp\x1b[31m")),
    "no type": message.answer(1, 1, 2, message.raw_block(0x0A, 46, b"\0\xee" + description()[4:])),
    "another length": message.answer(1, 1, 2, message.raw_block(0x0A, 45, description()[2:47])),
    "nothing": message.answer(1, 1, 2, message.raw_block(0x40, 0, b"")),
}


@pytest.mark.parametrize("response", BROKEN.values(), ids=BROKEN)
def test_a_broken_one_teaches_nothing(
    response: bytes, stage: Stage, told: Callable[[], list[str]]
) -> None:
    client = Client(stage)
    client.exchange(message.read(1, 2, ABOUT), response)
    read(client)
    assert told() == ["p1999[0] = 1000"]


def test_octets_that_are_a_value_describe_nothing(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    client = Client(stage)
    other = message.address(1121, 0, 1, message.DESCRIPTION)
    request = message.read(1, 2, RAMP, other)
    client.exchange(request, message.answer(1, 1, 2, description(b"Octets"), description(b"Other")))
    read(client)
    assert told()[-1] == "p1999[0] = 1000"


def test_several_elements_at_once_are_none(stage: Stage, told: Callable[[], list[str]]) -> None:
    client = Client(stage)
    several = message.address(1999, 0, 2, message.DESCRIPTION)
    client.exchange(message.read(1, 2, several), message.answer(1, 1, 2, description()))
    read(client)
    assert told() == ["p1999[0] = 1000"]


def test_what_is_written_as_a_description_is_none(
    stage: Stage, told: Callable[[], list[str]]
) -> None:
    client = Client(stage)
    client.exchange(message.change(1, 2, (ABOUT, description())), message.changed(1, 2))
    read(client)
    assert told() == ["p1999[0] = 1000"]


def test_a_name_cannot_talk_to_the_terminal_or_the_page(
    stage: Stage, told: Callable[[], list[str]], tmp_path: Path
) -> None:
    client = Client(stage)
    describe(client, name=b'=<b>"\xad\\')
    read(client)
    assert told() == [r'p1999[0] ("=<b>\"\xad\\") = 1000 (10.0 s)'.replace("\\\\", "\\")]
    stream = io.StringIO()
    write_all(csv.Writer(stream), Report([analyze(tmp_path / "x.pcapng")]))
    assert "'=<b>" in stream.getvalue()


def lines(result_path: Path) -> list[dict[str, object]]:
    found: list[dict[str, object]] = []

    def take(item: Transaction, _findings: list[Finding]) -> None:
        found.append(json.loads(report_json.transaction_line(item, "en")))

    analyze(result_path, AnalysisOptions(), take)
    return found


def test_every_format_names_the_same() -> None:
    result = analyze(CAPTURE)
    complete = [TRANSACTION.plain(each) for each in result.transactions]
    assert complete == lines(CAPTURE)
    named = [(each.parameters[0].name, each.parameters[0].unit) for each in result.transactions]
    assert named == [
        (LISTED, None), (LISTED, None), ("Ramp-up time", "s"), (LISTED, None), (DOWN, None),
        ("Ramp-down time", None), ("Ramp-down time", "s"),
    ]  # fmt: skip
    stream = io.StringIO()
    write_all(TextWriter(stream), Report([result]))
    assert f"p1120[0] {NAMED} = 1000 (10.0 s)" in stream.getvalue()
    stream = io.StringIO()
    write_all(csv.Writer(stream), Report([result]))
    assert stream.getvalue().count("Ramp-up time,s,Unsigned16,1,1000,10.0") == 1


def test_a_result_is_loaded_with_its_names() -> None:
    result = analyze(CAPTURE)
    for lang in ("en", "zh"):
        for each in result.transactions:
            plain = TRANSACTION.plain(each, lang)
            again = load.transaction(plain, 0x2A)
            assert TRANSACTION.plain(again, lang) == plain
            for one, other in zip(again.parameters, each.parameters, strict=True):
                assert one.described == other.described


def test_names_of_the_list_stay_names_of_the_list() -> None:
    """A description that gives a unit alone, of a listed parameter: its name is that of each language."""
    plain = PARAMETER.plain(Parameter(922, 0, "value", 0, listed=spec.parameter(922)), "zh")
    item = contract.PARAMETER.load(plain | {"described_in": [4]})
    assert item.described == (None, (4,))
    assert item.name == "Telegram selection"
    assert contract.PARAMETER.load(plain).described is None
    item = contract.PARAMETER.load(plain | {"name": "Telegram", "described_in": [4]})
    assert (item.described, item.name) == (("Telegram", (4,)), "Telegram")


def test_a_stored_result_without_the_key_is_as_before() -> None:
    old = report_json.capture(analyze(CAPTURE))
    new = json.loads(json.dumps(old))
    for each in old["transactions"]:
        for item in each["parameters"]:
            if item.pop("described_in", None):
                item |= {"name": None, "unit": None, "scaled": None}
    assert not list(compare(old, new, Config(), CAPTURE))
    new["transactions"][2]["parameters"][0]["values"] = [7]
    assert [each.kind for each in compare(old, new, Config(), CAPTURE)]


def test_pkw_is_named_by_a_description_of_its_submodule() -> None:
    known = Dictionary(DriveObjects(), 10)
    asked = analyze(CAPTURE).transactions[2]
    asked.channel, asked.index, asked.axis = "pkw", None, None
    item = asked.parameters[0]
    item.described, item.scaled, item.unit, item.format = None, None, None, "Word"
    item.values = [250]
    access = access_of(asked)
    assert access.record_index == LOCAL
    values = [description()[2:].hex()]
    known.learn(access, 1120, 0, "OctetString", values, 8)
    assert asked.frames.read_response == 12
    explain_transaction(known, asked, None)
    assert (item.name, item.scaled, item.unit) == ("Ramp-up time", [2.5], "s")
    item.described = item.scaled = item.unit = None
    known.learn(access, 1120, 0, "OctetString", values, 13)  # after its response
    explain_transaction(known, asked, None)
    assert (item.name, item.scaled, item.unit) == (LISTED, None, None)
    known.learn(access, 1120, 0, "OctetString", values, 9)
    item.format = None  # a number of elements
    explain_transaction(known, asked, None)
    assert (item.name, item.scaled, item.unit) == ("Ramp-up time", None, None)


def test_a_flood_of_descriptions_is_bounded() -> None:
    known = Dictionary(DriveObjects(), 64)
    access = access_of(analyze(CAPTURE).transactions[2])
    values = [description()[2:].hex()]
    for frame in range(5000):
        way = access._replace(axis=frame % 251, device=f"10.0.0.{frame % 7}")
        known.learn(way, frame % 997, 0, "OctetString", values, frame + 1)
    assert len(known._said) == sum(map(len, known._ways.values())) == 64


def test_nothing_is_asked_where_nothing_is_described() -> None:
    """The usual capture: no transaction pays for it."""
    known = Dictionary(DriveObjects(), 10)
    assert known.is_empty
    learning.ask(known, None)  # type: ignore[arg-type]  # looks at nothing
