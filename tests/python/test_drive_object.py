"""The key `drive_object` of a transaction: the number of the drive object that it is proved to reach.

What proves one is tested in test_drive_objects.py. Here: when that counts, and that all three sides agree on it.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pytest
from test_engine import program, ready  # noqa: F401
from test_lua_analysis import VERSIONS, Source, compare

from ds47.analysis import analyze
from ds47.lab import captured, message
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import CaptureResult
from ds47.report import json as report
from ds47.report import load

LOCAL, GLOBAL = 0xB02E, 0xB02F
AXIS_ERROR = 0x19
RAMP = message.address(1120)
DO_ID = message.address(975, 7)


@pytest.fixture(scope="module")
def talk() -> bytes:
    """Reads of a drive whose submodule 2 says only later that it is drive object 5."""
    stage = Stage()
    client = Client(stage)

    def read(axis: int, index: int, answer: bytes, where: bytes = RAMP, subslot: int = 1) -> None:
        at = client.at(index=index, subslot=subslot)
        identifier = 0x81 if answer == message.error(AXIS_ERROR) else 0x01
        asked = message.read(1, axis, where)
        client.exchange(asked, message.answer(1, identifier, axis, answer), at)

    read(2, 47, message.word(1))
    read(3, GLOBAL, message.word(1))
    read(0, 47, message.word(1))
    read(9, 47, message.word(1))
    read(7, LOCAL, message.word(1), subslot=2)
    read(7, LOCAL, message.word(1), subslot=3)
    read(9, 47, message.error(AXIS_ERROR))
    read(7, LOCAL, message.word(5), DO_ID, subslot=2)
    read(7, LOCAL, message.real(4.0), DO_ID, subslot=3)
    read(7, LOCAL, message.word(1), subslot=2)
    return captured(stage)


WHOLE = [2, 3, None, None, 5, None, None, 5, None, 5]
"""By all of it: 0 and 9 name no drive object, submodule 2 is number 5, a Float32 is no number of one."""
AS_IT_COMES = [2, 3, None, 9, None, None, None, 5, None, 5]


def numbers(result: CaptureResult) -> list[int | None]:
    return [each.drive_object for each in result.transactions]


def test_all_of_a_capture_counts(talk: bytes) -> None:
    assert numbers(analyze(BytesIO(talk))) == WHOLE


def test_what_is_written_as_it_comes_has_what_came_before(talk: bytes) -> None:
    found: list[int | None] = []
    analyze(BytesIO(talk), on_transaction=lambda item, _: found.append(item.drive_object))
    assert sorted(found, key=str) == sorted(AS_IT_COMES, key=str)


def test_a_result_without_the_key_is_loaded(talk: bytes) -> None:
    told = report.capture(analyze(BytesIO(talk)))
    assert numbers(load.capture(told)) == WHOLE
    for each in told["transactions"]:
        del each["drive_object"]
    assert numbers(load.capture(told)) == [None] * len(WHOLE)


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, talk: bytes, tmp_path: Path) -> None:
    compare(version, "en", [Source("talk", talk, True)], tmp_path)


def test_wireshark_says_the_same(ready, talk: bytes, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]  # noqa: F811
    path = tmp_path / "talk.pcapng"
    path.write_bytes(talk)
    assert numbers(ready("tshark").analyze(path)) == WHOLE
    assert "DS601" not in {each.rule for each in ready().analyze(path).findings}
