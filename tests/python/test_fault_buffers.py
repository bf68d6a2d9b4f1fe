"""Buffers of faults and alarms as tables: what belongs to one entry stands side by side, in Python and in Lua."""

from __future__ import annotations

import copy
import io
from typing import Any

import handmade
import jsonschema
from tests.audit.buffers import problems

from ds47 import spec
from ds47.model import CaptureResult, Frames, Parameter, Report, Transaction
from ds47.report import buffers, contract, html, json, schema, write_all

PLAIN = {
    945: "Unsigned16",
    947: "Unsigned16",
    948: "TimeDifference",
    949: "Integer32",
    2122: "Unsigned16",
}


def part(pnu: int, values: list[Any], first: int = 0, family: str = "sinamics") -> Parameter:
    return Parameter(
        pnu, first, "value", len(values), spec.parameter(pnu, family), None, PLAIN.get(pnu, "Unsigned32"),
        len(values), values, family=family,
    )  # fmt: skip


def read(number: int, *parts: Parameter, **changes: Any) -> Transaction:
    frames = Frames(4 * number - 3, 4 * number - 2, 4 * number - 1, 4 * number)
    return handmade.transaction(id=number, frames=frames, parameters=list(parts), **changes)


def capture(*items: Transaction) -> CaptureResult:
    return CaptureResult(
        "x", frames=4 * len(items), start_ns=items[0].start_ns, transactions=list(items),
        summary={"transactions": len(items)},
    )  # fmt: skip


def told(*items: Transaction, lang: str = "en") -> list[str]:
    """The head and the cells of each row, of every buffer."""
    found = []
    for each in buffers.buffers(capture(*items)):
        found.append(buffers.head(each).text(lang))
        found += [" | ".join(cell.text(lang) for cell in row) for row in buffers.rows(each)]
    return found


TWO = [7900, 30002, 0, 0, 0, 0, 0, 0, 7901]
FULL = [
    read(1, part(945, TWO), part(947, TWO)),
    read(2, part(948, [5000, 5250, 0, 0, 0, 0, 0, 0, 100])),
    read(3, part(949, [0, -3, 0, 0, 0, 0, 0, 0, 1]), part(2109, [0, 0, 0, 0, 0, 0, 0, 0, 200])),
]


def test_what_belongs_to_one_entry_stands_in_one_row() -> None:
    assert told(*FULL) == [
        "Faults of 192.168.133.33 DO 2, read in frames 4, 8, 12",
        "active | [0] | 7900 | at 5000 ms |  | value 0",
        "active | [1] | 30002 | at 5250 ms (+250 ms) |  | value -3",
        "acknowledged situation 1 | [8] | 7901 | at 100 ms | gone at 200 ms | value 1",
    ]
    assert told(*FULL, lang="zh")[0] == "192.168.133.33 DO 2 的故障缓冲器，读取于帧 4, 8, 12"


def test_numbers_alone_are_no_table() -> None:
    assert told(read(1, part(945, TWO)), read(2, part(947, TWO))) == []
    assert told(read(1, part(945, [0] * 8)), read(2, part(949, [0] * 8))) == []
    assert (
        told(read(1, part(949, [5])), read(2, part(945, [7900]))) == []
    )  # of which fault, is not known


def test_time_and_value_of_an_earlier_fault_do_not_stay() -> None:
    """A new fault moves the others: what was read before belongs to other places."""
    value, again = read(2, part(949, [7, 8])), read(3, part(945, [7900, 0]))
    assert told(read(1, part(945, [7900, 0])), value, again) == [
        "Faults of 192.168.133.33 DO 2, read in frames 8, 12", "active | [0] | 7900 | value 7",
    ]  # fmt: skip
    assert told(read(1, part(945, [7900, 0])), value, read(3, part(945, [30001, 7900]))) == []


def test_a_value_in_the_response_of_the_number_is_of_it() -> None:
    both = read(1, part(949, [5]), part(945, [7900]))
    assert told(both)[1:] == ["active | [0] | 7900 | value 5"]


def test_drive_objects_have_buffers_of_their_own() -> None:
    other = [read(3, part(945, [1]), part(949, [2]), axis=3)]
    assert len(told(read(1, part(945, [7900]), part(949, [5])), *other)) == 4
    assert told(read(1, part(945, [7900])), read(2, part(949, [5]), axis=3)) == []


def test_alarms_are_a_buffer_too() -> None:
    alarms = [7991, *[0] * 7, 7920]
    parts = part(2122, alarms), part(2123, [10, *[0] * 7, 3]), part(2124, [1, *[0] * 7, 2])
    assert told(read(1, *parts)) == [
        "Alarms of 192.168.133.33 DO 2, read in frames 4", "active | [0] | 7991 | at 10 ms | value 1",
        "gone | [8] | 7920 | at 3 ms | value 2",
    ]  # fmt: skip


def test_of_another_make_it_is_not_said_which_situation() -> None:
    """Its number and its code are two things, and its places may begin elsewhere."""
    parts = [
        part(pnu, values, family="profile") for pnu, values in ((947, [5]), (945, [9]), (949, [3]))
    ]
    assert told(read(1, *parts))[1:] == ["[0] | 5, code 9 | value 3"]


def test_a_text_of_a_list_stands_for_the_number() -> None:
    number = part(945, [7900])
    number.value_texts = {7900: "F07900 motor blocked"}
    assert told(read(1, number, part(949, [5])))[1:] == [
        "active | [0] | F07900 motor blocked | value 5"
    ]


def test_json_has_the_entries() -> None:
    (found,) = contract.CAPTURE_HEAD.plain(capture(*FULL))["buffers"]
    assert (found["kind"], found["device"], found["frames"]) == (
        "faults",
        "192.168.133.33",
        [4, 8, 12],
    )
    assert found["entries"][1] == {
        "subindex": 1, "situation": 0,
        "number": {"value": 30002, "frame": 4}, "code": {"value": 30002, "frame": 4},
        "time": {"value": 5250, "frame": 8}, "gone": {"value": 0, "frame": 12},
        "value": {"value": -3, "frame": 12},
    }  # fmt: skip


def test_the_page_has_the_table() -> None:
    stream = io.StringIO()
    write_all(html.Writer(stream), Report([capture(*FULL)]))
    text = stream.getvalue()
    assert 'id="buffers-1"' in text
    assert "value -3" in text
    stream = io.StringIO()
    write_all(html.Writer(stream), Report([capture(FULL[0])]))
    assert "buffers-1" not in stream.getvalue()


def test_the_auditor_reads_what_belongs_together() -> None:
    """It has nothing to say of the truth, and complains of each cell that is another."""
    plain = json.document(Report([capture(*FULL)]))["captures"][0]
    (told_,) = plain["buffers"]
    assert list(problems(told_, plain["transactions"])) == []
    for name in ("number", "time", "value"):
        wrong = copy.deepcopy(told_)
        wrong["entries"][1][name]["value"] = 77
        assert list(problems(wrong, plain["transactions"])), name
    wrong = copy.deepcopy(told_)
    wrong["entries"][2]["situation"] = 0
    assert list(problems(wrong, plain["transactions"]))
    jsonschema.validate(json.document(Report([capture(*FULL)])), schema())
