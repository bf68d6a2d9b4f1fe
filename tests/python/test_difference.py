"""`ds47 diff`: what differs between two captures, and what the numbers allow to say."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import pytest

from ds47.analysis import analyze
from ds47.regression import baseline
from ds47.regression.chance import fisher, mann_whitney
from ds47.regression.difference import difference
from ds47.regression.difference_report import lines, write
from ds47.regression.difference_words import place_text
from ds47.regression.shape import flaw

LOCAL = 0xB02E


@pytest.fixture
def a(captures):
    return baseline.content(analyze(captures / "tour-machine.pcapng"))


def asked(number: int, *values: Any, code: int | None = None, **changes: Any) -> dict[str, Any]:
    """A transaction of one parameter. With `code` a negative response, without values no outcome."""
    parameter = {
        "pnu": number, "subindex": 0, "attribute": "value", "element_count": max(1, len(values)), "name": None,
        "unit": None, "format": "Unsigned16" if values else None, "value_count": len(values),
        "values": list(values), "scaled": None,
        "error": None if code is None else {"code": code, "text": f"text {code}", "info": 0},
    }  # fmt: skip
    item = {
        "id": 1, "operation": "read", "state": "ok" if code is None else "error", "controller": "10.0.0.1",
        "device": "10.0.0.2", "slot": 1, "subslot": 1, "index": 47, "request_reference": 1, "axis": 2,
        "duration_ms": 1.0, "status": {"write": "00000000", "read": "00000000"}, "findings": [],
        "bytes": {"request": None, "response": None}, "parameters": [parameter],
    }  # fmt: skip
    parameter |= {key: changes.pop(key) for key in list(changes) if key in parameter}
    return item | changes


def capture(*items: dict[str, Any], station: str | None = None) -> dict[str, Any]:
    return {
        "devices": [{"ip": "10.0.0.2", "station": station, "vendor_id": 0x2A}],
        "transactions": [item | {"id": n} for n, item in enumerate(items, 1)],
        "findings": [],
    }


CONCLUDED = "what changed in B, the worst first:"


def told(a: dict[str, Any], b: dict[str, Any]) -> list[str]:
    """The lines from the verdict on, without conclusions, findings, states and durations."""
    all_ = list(lines(difference(a, b, ("a", "b")), everything=True))[3:]
    if CONCLUDED in all_:
        start = all_.index(CONCLUDED)
        del all_[start : all_.index("", start)]
    return [
        line
        for line in all_
        if line
        and not line.startswith(
            ("states", "findings", "duration", "  10.0.0.2 read:", "  10.0.0.2 change:")
        )
        and " -> " not in line
    ]


LOOKS = asked(1, code=0x19, axis=7)
"""A negative response that proves: the device looks at the axis byte."""


def is_do(number: int, slot: int = 1) -> dict[str, Any]:
    """What proves that a submodule is a drive object."""
    return asked(975, number, index=LOCAL, slot=slot, subindex=7)


def test_nothing_differs_from_itself(a):
    found = difference(a, deepcopy(a), ("a", "b"))
    assert found.rows
    assert found.changed == []
    assert found.compared > 5
    assert all(was == now for _, was, now in found.findings)


def test_a_read_is_never_compared_with_a_change():
    refused = asked(20, 5, operation="change", code=0x01)
    one = capture(asked(20, 7), refused)
    other = capture(refused, asked(20, 7))
    assert told(one, other) == [
        "The one parameter element that both captures show is the same in both."
    ]
    assert told(capture(asked(20, 7)), capture(refused)) == [
        "No parameter element is in both captures: there is nothing to compare.",
        "requested in both captures, but read or changed in one only: 1 element",
        "  10.0.0.2 slot 1.1 axis 2 r0020[0] change  A: none; B: 1 x negative response 0x01 text 1",
        "  10.0.0.2 slot 1.1 axis 2 r0020[0] read  A: 1 x = 7; B: none",
    ]


def test_one_negative_response_is_not_what_a_parameter_became():
    one = capture(*[asked(2, 10)] * 27, asked(2, code=0x01, element_count=1))
    assert told(one, capture(*[asked(2, 10)] * 3)) == [
        "The one parameter element that both captures show is the same in both.",
        "the same last value in both; the failures are within chance:",
        "  10.0.0.2 slot 1.1 axis 2 r0002[0] read  A: 27 x = 10, 1 x negative response 0x01 text 1; B: 3 x = 10",
    ]


def test_values_that_differ_are_told_with_their_counts():
    one = capture(asked(2, 9), asked(2, 10), asked(3, 1))
    other = capture(asked(2, 11), asked(3, 1))
    assert told(one, other) == [
        "1 of 2 parameter elements that both captures show differs.",
        "parameter elements that differ:",
        "  10.0.0.2 slot 1.1 axis 2 r0002[0] read  A: 2 x, 2 different values, the last 10; B: 1 x = 11",
    ]


def test_elements_that_follow_one_another_are_one_line():
    other = asked(2, 1, 2, 7, 8, 9)
    assert told(capture(asked(2, 1, 2, 3, 4, 5)), capture(other))[1:] == [
        "parameter elements that differ:",
        "  10.0.0.2 slot 1.1 axis 2 r0002[2..4] read  A: 1 x = 3, 4, 5; B: 1 x = 7, 8, 9",
    ]


def text(pnu: int, value: str, format_name: str = "OctetString", **changes: Any) -> dict[str, Any]:
    size = len(value) // 2 if format_name == "OctetString" else len(value)
    about = {"format": format_name, "element_count": size, "value_count": size}
    return asked(pnu, value, **about, **changes)


def test_strings_are_compared_as_far_as_both_were_read():
    one = capture(text(8560, "0708", subindex=6), text(199, "X-L", "VisibleString"))
    other = capture(text(8560, "070809", subindex=6), text(199, "X", "VisibleString"))
    assert told(one, other) == [
        "None of the 3 parameter elements that both captures show differs.",
        "requested in one capture only: 2 elements in A, 1 element in B",
        '  10.0.0.2 slot 1.1 axis 2 p0199[1..2] read  A: 1 x = "-L"; B: none',
        "  10.0.0.2 slot 1.1 axis 2 p8560[8] read  A: none; B: 1 x = 09",
    ]
    assert told(
        capture(text(199, "NEAR", "VisibleString")),
        capture(text(199, "R", "VisibleString", subindex=3)),
    ) == [
        "The one parameter element that both captures show is the same in both.",
        "requested in one capture only: 3 elements in A",
        '  10.0.0.2 slot 1.1 axis 2 p0199[0..2] read  A: 1 x = "NEA"; B: none',
    ]


def test_the_same_bits_are_the_same_value():
    one = capture(asked(304, -32765, format="Integer16"), asked(305, 10))
    other = capture(asked(304, 32771), asked(305, 10.0, format="Float32"))
    assert told(one, other) == ["None of the 2 parameter elements that both captures show differs."]
    zeros = (capture(asked(304, zero, format="Float32")) for zero in (0.0, -0.0))
    assert told(*zeros)[-1].endswith("A: 1 x = 0.0; B: 1 x = -0.0")
    one, other = capture(asked(304, -1, format="Integer16")), capture(asked(304, 1))
    assert told(one, other)[-1].endswith("A: 1 x = -1 (Integer16); B: 1 x = 1 (Unsigned16)")


@pytest.mark.parametrize(
    "item",
    [
        asked(46, code=0x19, element_count=5),
        asked(46, element_count=5, state="refused", status={"write": "DF80B600", "read": None}),
        asked(46, element_count=5, state="superseded"),
        asked(46, element_count=5, state="unanswered"),
        asked(46, element_count=5, operation="vendor"),
        asked(
            46, state="mismatch", pnu=None, subindex=None, attribute=None,
            bytes={"request": "010102011005002e0000", "response": None},
        ),
    ],
    ids=lambda item: item["state"],
)  # fmt: skip
def test_what_was_asked_for_without_success_was_asked_for(item):
    found = difference(capture(item), capture(asked(46, 1, subindex=3)), ("a", "b"))
    rows = [row for row in found.rows if row.element.subindex == 3]
    assert rows
    assert {row.result for row in rows}.isdisjoint({"only", "different"})


def test_a_response_without_a_request_may_have_been_asked_for_anything():
    orphan = asked(1, 5, state="orphan", pnu=None, subindex=None, attribute=None)
    assert told(capture(asked(2, 1), asked(3, 1)), capture(asked(3, 1), orphan))[-1] == (
        "B has 1 transaction that does not show everything that was requested"
    )


def test_other_requests_may_have_other_outcomes():
    one = capture(
        asked(46, code=0x03, element_count=5), asked(47, 900, operation="change", code=0x02)
    )
    other = capture(asked(46, 1), asked(47, 9, operation="change"))
    assert told(one, other) == [
        "No parameter element is in both captures: there is nothing to compare.",
        "other negative responses, but to other requests:",
        "  10.0.0.2 slot 1.1 axis 2 r0046[0] read  A: 1 x negative response 0x03 text 3; B: 1 x = 1",
        "  10.0.0.2 slot 1.1 axis 2 p0047[0] change  A: 1 x negative response 0x02 text 2; B: 1 x accepted := 9",
        "requested in one capture only: 4 elements in A",
        "  10.0.0.2 slot 1.1 axis 2 r0046[1..4] read  A: 1 x negative response 0x03 text 3; B: none",
    ]
    same = asked(46, 1, code=0x03), asked(46, 1)
    assert "differs" in told(*map(capture, same))[0]


def test_a_change_without_its_response_is_neither_accepted_nor_refused():
    change = asked(5, 7, operation="change")
    found = told(capture(change), capture(change | {"state": "superseded"}))
    assert found[-1].endswith("change  A: 1 x accepted := 7; B: 1 x outcome not in the capture")


@pytest.mark.parametrize(
    ("response", "findings", "seen"),
    [
        ("01820201400044020011", [], "1 x accepted := 7"),
        ("01820201", ["DS315"], "1 x outcome not in the capture"),
        ("01820201", [], "1 x accepted := 7"),
        ("01820200", [], "1 x outcome not in the capture"),
        (None, [], "1 x outcome not in the capture"),
    ],
)
def test_a_change_that_is_accepted_in_part(response, findings, seen):
    item = asked(5, 7, operation="change", state="partial", findings=findings)
    item["bytes"]["response"] = response
    found = told(capture(asked(5, 7, operation="change")), capture(item))
    if "accepted" in seen:
        assert found == ["The one parameter element that both captures show is the same in both."]
    else:
        assert found[-1].endswith(f"A: 1 x accepted := 7; B: {seen}")
    item["state"] = "error"  # a negative response that names no parameter
    found = told(capture(asked(5, 7, operation="change")), capture(item))
    assert found[-1].endswith("B: 1 x outcome not in the capture")


def test_a_response_to_another_request_proves_nothing():
    foreign = asked(1, code=0x19, axis=7, state="mismatch", pnu=None, subindex=None, attribute=None)
    both = capture(foreign, is_do(2), asked(10, 1))
    places = {place_text(row.element.place) for row in difference(both, both, ("a", "b")).rows}
    assert places == {"10.0.0.2 DO 2 (0xB02E)", "10.0.0.2 slot 1.1 axis 2"}


def test_a_drive_object_is_joined_by_proof_of_both_captures():
    proved = (LOOKS, is_do(2))
    one = capture(*proved, asked(10, 1))
    other = capture(*proved, asked(10, 3, index=LOCAL, axis=0))
    assert told(one, other)[-1] == "  10.0.0.2 DO 2 p0010[0] read  A: 1 x = 1; B: 1 x = 3"
    for without in ((is_do(2),), (LOOKS, asked(975, 1, index=LOCAL))):
        unproved = capture(*without, asked(10, 3, index=LOCAL, axis=0))
        rows = [row for row in difference(one, unproved, ("a", "b")).rows if row.element.pnu == 10]
        assert [row.result for row in rows] == ["other way", "other way"]
        assert len({place_text(row.element.place) for row in rows}) == 2


def test_an_axis_number_by_local_access_is_no_drive_object():
    one = capture(LOOKS, asked(922, code=0x19, axis=9))
    other = capture(LOOKS, asked(922, code=0x05, axis=9, index=LOCAL))
    assert [row.result for row in difference(one, other, ("a", "b")).rows if row.element.pnu == 922] == [
        "other way", "other way",
    ]  # fmt: skip
    assert told(one, other)[-2:] == [
        "  10.0.0.2 slot 1.1 (0xB02E) p0922[0] read  A: none; B: 1 x negative response 0x05 text 5",
        "  10.0.0.2 slot 1.1 axis 9 p0922[0] read  A: 1 x negative response 0x19 text 25; B: none",
    ]


def test_an_axis_that_was_refused_may_be_the_drive_object_of_a_submodule():
    one = capture(LOOKS, asked(922, code=0x19, axis=9))
    other = capture(LOOKS, is_do(9), asked(922, 1, index=LOCAL))
    rows = [row for row in difference(one, other, ("a", "b")).rows if row.element.pnu == 922]
    assert [row.result for row in rows] == ["other way", "other way"]


def test_no_two_places_have_the_same_label():
    ways = [
        (47, 1, 2),
        (47, 2, 2),
        (LOCAL, 1, 2),
        (LOCAL, 2, 0),
        (LOCAL, 3, 0),
        (47, 1, 0),
        (47, 1, 7),
    ]
    items = [asked(10, 1, index=index, slot=slot, axis=axis) for index, slot, axis in ways]
    for proof in ((), (LOOKS,), (is_do(2), is_do(3, slot=2)), (LOOKS, is_do(2), is_do(3, slot=2))):
        both = capture(*proof, *items)
        places = {row.element.place for row in difference(both, both, ("a", "b")).rows}
        assert len({place_text(place) for place in places}) == len(places)


def test_a_parameter_of_the_device_is_one_by_whatever_axis():
    assert told(capture(asked(964, 1, axis=1)), capture(asked(964, 2, axis=3)))[-1] == (
        "  10.0.0.2 r0964[0] read  A: 1 x = 1; B: 1 x = 2"
    )


def test_two_addresses_of_one_drive_are_one_drive(a):
    b = json.loads(
        json.dumps(a).replace("192.168.133.33", "10.0.0.7").replace("press-1-drive", "press-2")
    )
    assert difference(a, b, ("a", "b")).changed == []


def test_two_drives_of_one_name_are_two():
    second = asked(2, 5, device="10.0.0.3")
    one = capture(asked(2, 1), second, station="press")
    one["devices"].append({"ip": "10.0.0.3", "station": "press"})
    other = capture(asked(2, 1), second, station="press")
    assert {row.element.place.device for row in difference(one, one, ("a", "b")).rows} == {
        "10.0.0.2", "10.0.0.3",
    }  # fmt: skip
    assert difference(one, other, ("a", "b")).different == 0


def test_a_name_that_one_capture_lacks_is_that_of_the_other():
    second = asked(2, 5, device="10.0.0.3")
    one, other = capture(asked(2, 1), second, station="press"), capture(asked(2, 1), second)
    assert difference(one, other, ("a", "b")).changed == []


def elsewhere(made: dict[str, Any], ip: str, **device: Any) -> dict[str, Any]:
    """The same capture with its drive at another address, as another device."""
    other = deepcopy(made)
    other["devices"] = [{**made["devices"][0], "ip": ip, **device}]
    for item in other["transactions"]:
        item["device"] = ip
    return other


@pytest.mark.parametrize(
    ("ip", "device", "compared"),
    [
        ("10.0.0.9", {"station": "press-2", "device_id": 7}, 1),
        ("10.0.0.9", {"station": "press-2", "device_id": None}, 1),
        ("10.0.0.9", {"station": "press-2", "device_id": 8}, 0),
        ("10.0.0.9", {"station": "press-1", "device_id": 8}, 1),  # its successor in the same place
        ("dp3", {"station": None, "device_id": None}, 0),
    ],
)
def test_drives_of_different_types_are_not_compared(ip, device, compared):
    one = capture(asked(2, 1), station="press-1")
    one["devices"][0]["device_id"] = 7
    found = difference(one, elsewhere(one, ip, **device), ("a", "b"))
    assert found.compared == compared
    assert (found.strangers is None) == bool(compared)


def test_without_a_common_drive_the_first_line_says_so_and_nothing_is_compared():
    one = capture(asked(2, 1), station="press")
    one["devices"][0]["device_id"] = 7
    other = elsewhere(one, "10.0.0.9", station="pump", device_id=8)
    other["transactions"][0]["state"] = "error"
    found = difference(one, other, ("a", "b"))
    assert list(lines(found)) == [
        "A a", "B b", "",
        "No drive is in both captures (A: press; B: pump), so nothing is compared.", "",
        "requested in one capture only: 1 element in A, 1 element in B", "(--all lists them)",
    ]  # fmt: skip
    assert list(lines(found, "zh"))[3].startswith("没有驱动器")
    stream = io.StringIO()
    write(found, "html", stream)
    assert "duration, write request to response" not in stream.getvalue()
    stream = io.StringIO()
    write(found, "json", stream)
    document = json.loads(stream.getvalue())
    assert [document[key] for key in ("states", "findings", "latency", "compared")] == [
        [],
        [],
        [],
        0,
    ]


def test_what_only_one_capture_has_is_one_line_without_all():
    one = capture(asked(2, 1), *(asked(number, 1) for number in range(100, 150)))
    text = list(lines(difference(one, capture(asked(2, 1)), ("a", "b"))))
    assert [line for line in text if "100" in line] == []
    assert "requested in one capture only: 50 elements in A" in text
    assert "(--all lists them)" in text
    order = [next(n for n, line in enumerate(text) if line.startswith(each)) for each in (
        "The one parameter", "states", "findings", "requested", "duration",
    )]  # fmt: skip
    assert order == sorted(order)


@pytest.mark.parametrize(
    ("paths", "called"),
    [
        (("/home/me/a.pcapng", "/home/me/b.pcapng"), ("a.pcapng", "b.pcapng")),
        (("/home/me/mon/a.pcapng", "/home/me/tue/a.pcapng"), ("mon/a.pcapng", "tue/a.pcapng")),
        (("/home/me/a.pcapng", "/home/me/a.pcapng"), ("a.pcapng", "a.pcapng")),
    ],
)
def test_the_page_names_captures_without_the_folders_of_a_machine(a, paths, called):
    stream = io.StringIO()
    write(difference(a, a, paths), "html", stream)
    shown = re.findall(r'class="path">(.*?)</span>', stream.getvalue())
    assert tuple(shown) == called
    assert "/home/me" not in stream.getvalue()


def test_json_and_html(a):
    b = deepcopy(a)
    b["devices"][0]["station"] = '<script>alert("1")</script>'
    found = difference(a, b, ("a&b", '"<b>"'))
    stream = io.StringIO()
    write(found, "html", stream)
    page = stream.getvalue()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    assert "a&amp;b" in page
    stream = io.StringIO()
    write(found, "json", stream)
    document = json.loads(stream.getvalue())
    assert document["schema"] == "ds47.diff/2"
    assert len(document["parameters"]) == len(found.rows)
    assert (document["compared"], document["different"]) == (found.compared, 0)


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_text_page_and_json_say_the_same(lang):
    one = capture(asked(2, 9), asked(3, 1, 2, operation="change"), asked(5, 1))
    other = capture(
        asked(2, 10), asked(3, 1, 2, operation="change", code=0x11), asked(4, code=0x00)
    )
    found = difference(one, other, ("a", "b"))
    stream = io.StringIO()
    write(found, "html", stream, lang)
    page = re.sub(
        r'<span lang="(\w\w)">(.*?)</span>',
        lambda each: each[2] if each[1] == lang else "",
        stream.getvalue(),
    )
    for line in lines(found, lang, everything=True):
        parts = line.replace("：", ": ").replace("；", "; ").split("  A: ")
        if len(parts) == 2:
            for part in parts[1].split("; B: "):
                assert f"<td>{part}</td>" in page.replace("：", ": ")
    assert found.different == 3
    stream = io.StringIO()
    write(found, "json", stream)
    rows = json.loads(stream.getvalue())["parameters"]
    assert [row["pnu"] for row in rows if row["result"] == "different"] == [2, 3, 3]
    change = next(row for row in rows if row["operation"] == "change")
    assert change["a"] | {"format": None} == {
        "asked": 1, "values": 1, "distinct": 1, "last": 1, "format": None, "negative": [], "refused": [],
        "open": 0,
    }  # fmt: skip
    assert change["b"]["negative"] == [{"code": 0x11, "text": "text 17", "count": 1}]


def test_a_time_before_the_request_is_no_duration(a):
    item = next(item for item in a["transactions"] if item["duration_ms"])
    times = [-5.0, *(float(n) for n in range(1, 21))]
    a["transactions"] = [deepcopy(item) | {"duration_ms": each} for each in times]
    (each,) = difference(a, a, ("a", "b")).latencies
    assert (each.counts, each.p95) == ((20, 20), (19.0, 19.0)), "nearest rank, as the report has it"


def concluded(a: dict[str, Any], b: dict[str, Any]) -> list[str]:
    """The conclusions that the text opens with."""
    all_ = list(lines(difference(a, b, ("a", "b"))))
    if CONCLUDED not in all_:
        return []
    start = all_.index(CONCLUDED) + 1
    return all_[start : all_.index("", start)]


def test_it_opens_with_what_is_otherwise_the_worst_first():
    one = capture(
        asked(2, 10), asked(5, 7, operation="change"), asked(6, 1), asked(21, 50), asked(8, code=0x02),
        asked(9, code=0x00),
    )  # fmt: skip
    change = asked(5, 7, operation="change", code=0x11)
    refused = asked(6, state="refused", status={"write": "DF80B600", "read": None})
    other = capture(asked(2, 11), change, refused, asked(21, 51), asked(8, code=0x03), asked(9, 4))
    for side in (one, other):
        side["transactions"][3]["parameters"][0]["name"] = "Actual frequency"
    place = "10.0.0.2 slot 1.1 axis 2"
    assert concluded(one, other) == [
        f"  {place}: changes that A shows accepted fail in B: p0005[0] (0x11 text 17)",
        f"  {place}: reads that brought a value in A fail in B: p0006[0] (STATUS DF80B600)",
        f"  {place}: other values read: r0002[0] 10 -> 11",
        f"  {place}: the same requests (read) fail in both, in B with: p0008[0] (0x03 text 3)",
        f"  {place}: reads that failed in A bring a value in B: p0009[0] (0x00 text 0)",
        f"  {place}: other values of parameters that the drive changes by itself: r0021[0] 50 -> 51",
    ]
    assert concluded(one, one) == []


def test_a_conclusion_names_few_parameters_and_counts_the_others():
    one = capture(*(asked(number, 1) for number in range(100, 120, 2)))
    other = capture(*(asked(number, 2) for number in range(100, 120, 2)))
    assert concluded(one, other) == [
        "  10.0.0.2 slot 1.1 axis 2: other values read: p0100[0] 1 -> 2, p0102[0] 1 -> 2, p0104[0] 1 -> 2, "
        "7 more elements"
    ]
    many = [asked(5, 1, axis=axis) for axis in range(1, 15)]
    changed = [asked(5, 2, axis=axis) for axis in range(1, 15)]
    assert concluded(capture(*many), capture(*changed))[-1] == "  and 2 more: see below"


def test_an_error_of_another_request_is_not_named():
    """p0005[0] by another number of elements failed in both; that is no part of what is otherwise."""
    always = asked(5, code=0x04, element_count=9)
    one, other = capture(always, asked(5, 1)), capture(always, asked(5, code=0x11))
    assert concluded(one, other) == [
        "  10.0.0.2 slot 1.1 axis 2: reads that brought a value in A fail in B: p0005[0] (0x11 text 17)"
    ]


def test_failures_beside_values_count_where_they_are_more_than_chance():
    def often(failures: int) -> dict[str, Any]:
        return capture(
            *[asked(5, 1)] * (40 - failures), *[asked(5, code=0x11)] * failures, asked(5, 1)
        )

    few, many = often(1), often(20)
    assert concluded(often(0), few) == []
    assert difference(often(0), few, ("a", "b")).rows[0].result == "sometimes"
    place = "10.0.0.2 slot 1.1 axis 2"
    assert concluded(few, many) == [
        f"  {place}: the same requests (read) fail more often in B (failed/asked): p0005[0] 1/41 -> 20/41"
    ]
    assert concluded(many, few) == [
        f"  {place}: the same requests (read) fail less often in B (failed/asked): p0005[0] 20/41 -> 1/41"
    ]


def test_faults_and_latency_are_conclusions(a):
    def with_faults(n: int, left_out: int = 0) -> dict[str, Any]:
        relation = {"device": "10.0.0.2", "slot": 1, "subslot": 1}
        events = [{"name": name} for name in ["running", *["fault", "fault-cleared"] * n]]
        timeline = {"relation": 1, "events": events, "events_left_out": left_out}
        times = [asked(5, 1, duration_ms=10.0 + n * 5 + step / 10) for step in range(20)]
        return capture(*times) | {"relations": [relation], "timelines": [timeline]}

    assert concluded(with_faults(0), with_faults(2)) == [
        "  10.0.0.2 slot 1.1: the status word began to report a fault, times: 0 -> 2",
        "  10.0.0.2: read is slower in B: median 10.9 -> 20.9 ms (p = 6.8e-08)",
    ]
    assert [line.partition(": ")[2][:24] for line in concluded(with_faults(2), with_faults(0))] == [
        "the status word began to", "read is quicker in B: me",
    ]  # fmt: skip
    assert difference(with_faults(0, 1), with_faults(2), ("a", "b")).faults == []
    assert difference(a, with_faults(2), ("a", "b")).faults == []


def test_fisher_against_published_values():
    # The lady tasting tea, and values of R's fisher.test.
    assert fisher(3, 1, 1, 3) == pytest.approx(0.4857143)
    assert fisher(1, 11, 9, 3) == pytest.approx(0.002759456)
    assert fisher(0, 10, 5, 5) == pytest.approx(0.03250774)
    assert fisher(0, 0, 5, 5) == fisher(7, 0, 0, 0) == 1.0
    assert 0 <= fisher(1000, 49000, 3000, 47000) < 1e-200


def test_mann_whitney_against_published_values():
    # Values computed with R's wilcox.test(exact = FALSE), which uses the same corrections.
    assert mann_whitney([1.0] * 10, [1.0] * 10) == 1.0
    low, high = [float(n) for n in range(1, 11)], [float(n) for n in range(11, 21)]
    assert mann_whitney(low, high) == pytest.approx(0.0001826718, rel=1e-4)
    mixed = mann_whitney([1.0, 3, 5, 7, 9, 11, 13, 15], [2.0, 4, 6, 8, 10, 12, 14, 16])
    assert mixed == pytest.approx(0.7132, abs=2e-3)


def test_a_shift_is_called_real_only_where_it_is(a):
    item = next(item for item in a["transactions"] if item["duration_ms"])
    a["transactions"] = [deepcopy(item) | {"duration_ms": 10.0 + n / 10} for n in range(30)]
    b = deepcopy(a)
    (same,) = difference(a, b, ("a", "b")).latencies
    assert not same.significant
    for each in b["transactions"]:
        each["duration_ms"] += 5
    (slower,) = difference(a, b, ("a", "b")).latencies
    assert slower.significant
    assert slower.medians[1] - slower.medians[0] == pytest.approx(5)
    few = {**b, "transactions": b["transactions"][:3]}
    (unknown,) = difference(a, few, ("a", "b")).latencies
    assert unknown.probability is None


@pytest.mark.parametrize("other", [None, "zz", -7, 1.5, [], {}, [None], {"code": "x"}], ids=str)
def test_a_result_that_is_not_ours_breaks_nothing(captures, other):
    """Whatever stands anywhere in a stored result that is taken for whole."""
    now = baseline.content(analyze(captures / "conversation-error.pcapng"))
    compared = 0
    for path in list(places_in(now)):
        stored = deepcopy(now)
        place: Any = stored
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = other
        if flaw(stored) is None:
            compared += 1
            found = difference(stored, now, ("a", "b"))
            for format_name in ("text", "json"):
                write(found, format_name, io.StringIO(), everything=True)
    assert compared


def places_in(item: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    rows = item.items() if isinstance(item, dict) else enumerate(item)
    for key, value in rows:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places_in(value, (*path, key))
