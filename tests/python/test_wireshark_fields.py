"""The reader of tshark's PDML: small documents made here, without tshark."""

from __future__ import annotations

import io
from typing import Any
from xml.etree.ElementTree import ParseError
from xml.sax.saxutils import quoteattr

import pytest

from ds47 import spec
from ds47.spec.codes import codes
from ds47.wireshark.fields import Fields, read

Tree = tuple[str, object, list["Tree"]]


CODED = {
    "channel": "channels",
    "operation": "operations",
    "state": "states",
    "finding.severity": "severities",
}
"""Fields that tshark shows as the number of a word."""


def item(name: str, show: object, *below: Tree) -> Tree:
    """A field as tshark shows it: what is a word here is a number there."""
    if name in CODED:
        show = codes(CODED[name])[str(show)]
    elif name.endswith("format"):
        known = spec.format_named(str(show))
        show = f"0x{known.code:02x}" if known else show
    return (f"ds47.{name}", show, list(below))


def xml(tree: Tree) -> str:
    name, show, below = tree
    return f'<field name="{name}" show={quoteattr(str(show))}>{"".join(map(xml, below))}</field>'


def packet(number: int, *trees: list[Tree]) -> str:
    told = xml(("frame.number", number, [])) + xml(
        ("frame.time_epoch", f"1767225600.{number - 1:09}", [])
    )
    frame = f'<proto name="frame">{told}</proto>'
    protos = "".join(f'<proto name="ds47">{"".join(map(xml, tree))}</proto>' for tree in trees)
    return f"<packet>{frame}{protos}</packet>"


def pdml(*packets: str) -> Fields:
    text = f'<?xml version="1.0" encoding="utf-8"?><pdml>{"".join(packets)}</pdml>'
    return read(io.BytesIO(text.encode()))


def transaction(number: int, *more: Tree, **frames: int) -> Tree:
    return item(
        "transaction",
        number,
        item("operation", "read"),
        item("state", "ok"),
        item("controller", "10.0.0.1"),
        item("device", "10.0.0.2"),
        item("api", 0x3A00),
        item("slot", 1),
        item("subslot", 2),
        item("index", 47),
        *(item(f"frames.{key}", value) for key, value in frames.items()),
        *more,
    )


def parameter(*fields: Tree) -> dict[str, Any]:
    """The one parameter of a response with these fields."""
    tree = [item("parameter", "p1", *fields), transaction(1, read_response=1)]
    (found,) = pdml(packet(1, tree)).transactions
    (only,) = found["parameters"]
    assert isinstance(only, dict)
    return only


def values(format_name: str, *fields: Tree) -> list[Any]:
    found = parameter(item("format", format_name), *fields)["values"]
    assert isinstance(found, list)
    return found


ASKED = [
    item("request_reference", 3),
    item("request_id", "0x01"),
    item("axis", 2),
    item("parameter", "p50303[0]", item("pnu", 50303)),
    transaction(1, item("bytes.request", "03:01"), write_request=1, read_response=4),
]
ANSWERED = [
    item("request_reference", 9),  # a response need not mirror it
    item("response_id", "0x01"),
    item("axis", 7),
    item(
        "parameter",
        "p50303[0] = 10.0",
        item("pnu", 50303),
        item("subindex", 0),
        item("attribute", "0x10"),
        item("element_count", 1),
        item("format", "Float32"),
        item("value_count", 1),
        item("value", "10.0", item("value.float", 10)),
    ),
    transaction(
        1,
        item("frames.poll.response", 2),
        item("frames.poll.request", 3),
        item("frames.poll.response", 4),
        item("frames.reread.request", 5),
        item("frames.reread.response", 6),
        item("duration_ms", 12.5),
        item("status.write", "0x00000000"),
        item("status.read", "0xde80b500"),
        item("bytes.response", "03:02"),
        item("drive_object", 2),
        write_request=1,
        read_response=4,
    ),
]


def test_a_transaction_is_put_together_from_its_frames() -> None:
    (found,) = pdml(packet(1, ASKED), packet(2), packet(4, ANSWERED)).transactions
    assert found == {
        "id": 1,
        "channel": "ds47",
        "operation": "read",
        "state": "ok",
        "controller": "10.0.0.1",
        "device": "10.0.0.2",
        "station": None,
        "ar": None,
        "api": 0x3A00,
        "slot": 1,
        "subslot": 2,
        "index": 47,
        "request_reference": 3,
        "axis": 2,
        "drive_object": 2,
        "telegram": None,  # which the plugin does not tell
        "frames": {
            "write_request": 1,
            "write_response": None,
            "read_request": None,
            "read_response": 4,
            "polls": [{"request": None, "response": 2}, {"request": 3, "response": 4}],
            "rereads": [{"request": 5, "response": 6}],
        },
        "start": "2026-01-01T00:00:00.000000000Z",
        "duration_ms": 12.5,
        "cycles": None,
        "bytes": {"request": "0301", "response": "0302"},
        "status": {"write": "00000000", "read": "DE80B500"},
        "parameters": [
            {
                "pnu": 50303,
                "subindex": 0,
                "attribute": "value",
                "element_count": 1,
                "name": None,
                "unit": None,
                "format": "Float32",
                "value_count": 1,
                "values": [10.0],
                "scaled": None,
                "error": None,
            }
        ],
        "findings": [],
    }


def test_the_write_request_tells_everything_where_nothing_was_read() -> None:
    tree = [*ASKED[:-1], transaction(1, write_request=1)]
    (found,) = pdml(packet(1, tree)).transactions
    assert [each["pnu"] for each in found["parameters"]] == [50303]
    assert found["request_reference"] == 3


def test_several_transactions_in_a_frame_come_by_id() -> None:
    second, first = transaction(2, write_request=1), transaction(1, write_request=1)
    found = pdml(packet(1, [second], [first])).transactions
    assert [each["id"] for each in found] == [1, 2]


@pytest.mark.parametrize(
    ("format_name", "shown", "value"),
    [
        ("Integer16", "-32768", -32768),
        ("Unsigned32", "4294967295", 4294967295),
        ("Unsigned64", "18446744073709551615", "18446744073709551615"),
        ("Integer64", "-9007199254740993", "-9007199254740993"),
        ("Integer64", "9007199254740992", 9007199254740992),
        ("Float32", "0.1", 0.1),
        ("Float32", "-Infinity", "-Infinity"),
        ("Float64", "NaN", "NaN"),
        ("OctetString", "0102", "0102"),
        ("VisibleString", '"12"', "12"),
        ("N2", "16384", 16384),
        ("Float32+Unsigned8", "4120000080", "4120000080"),
    ],
)
def test_a_value_has_the_type_of_the_report(format_name: str, shown: str, value: object) -> None:
    found = values(format_name, item("value", shown))
    assert found == [value]
    assert type(found[0]) is type(value)


def test_text_that_is_shown_with_escapes_is_read_from_its_bytes() -> None:
    shown = item("value", '"a\\x00\\"ÿ"', item("value.bytes", "61:00:22:ff"))
    assert values("VisibleString", shown) == ['a\0"ÿ']


def test_several_values_stay_in_order() -> None:
    assert values("Unsigned8", item("value", 3), item("value", 1), item("value", 2)) == [3, 1, 2]


@pytest.mark.parametrize(
    ("format_name", "shown", "value"),
    [
        ("N2", "100.0", 100.0),
        ("TimeOfDay", "1984-01-02T01:00:00.000", "1984-01-02T01:00:00.000"),
        ("TimeDifference", "1.0", 1.0),
        ("Unsigned8+Unsigned8", "1", 1),
    ],
)
def test_a_physical_value_has_its_type_too(format_name: str, shown: str, value: object) -> None:
    one = item("value", "1", item("scaled", shown))
    found = parameter(item("format", format_name), one)["scaled"]
    assert found == [value]
    assert type(found[0]) is type(value)


def test_a_format_with_physical_values_has_a_list_of_them_even_without_a_value() -> None:
    assert parameter(item("format", "N2"))["scaled"] == []
    assert parameter(item("format", "Unsigned16"))["scaled"] is None
    assert parameter(item("format", "0x7F"))["scaled"] is None


def test_an_error_may_have_no_number() -> None:
    with_all = (item("error.code", "0x6b"), item("error.text", "why"), item("error.info", 3))
    assert parameter(*with_all)["error"] == {"code": 0x6B, "text": "why", "info": 3}
    assert parameter(item("error.text", ""))["error"] == {"code": None, "text": "", "info": None}


def test_the_format_of_an_error_block_is_no_format_of_values() -> None:
    found = parameter(item("format", "Error"), item("value_count", 2), item("error.text", ""))
    assert (found["format"], found["value_count"]) == (None, None)


@pytest.mark.parametrize("on_the_wire", ["Zero", "Error"])
def test_a_change_has_the_format_that_its_request_wrote(on_the_wire: str) -> None:
    """Beneath the response stand its own block and copies of what was written."""
    block = [item("format", on_the_wire), item("value_count", 2)]
    copies = [
        item("written.format", "Unsigned16"),
        item("written.value_count", 1),
        item("value", 7),
    ]
    done = transaction(1, write_request=1, read_response=4)
    done[2][0] = item("operation", "change")
    for below, wanted in ((block, (None, None, [])), (block + copies, ("Unsigned16", 1, [7]))):
        tree = [item("parameter", "p1", *below), done]
        (found,) = pdml(packet(4, tree)).transactions
        (only,) = found["parameters"]
        assert (only["format"], only["value_count"], only["values"]) == wanted


def test_an_attribute_without_a_name_is_its_code() -> None:
    assert parameter(item("attribute", "0x5f"))["attribute"] == "0x5F"
    assert parameter(item("attribute", "0x30"))["attribute"] == "text"


def finding(rule: str, *more: Tree) -> Tree:
    severity = item("finding.severity", "warning")
    return item("finding", rule, severity, item("finding.message", "words"), *more)


def test_findings_come_in_the_order_of_the_report() -> None:
    late = packet(9, [finding("DS103")])
    early = packet(
        2,
        [finding("DS415", item("finding.transaction", 1)), transaction(1, write_request=2)],
        [
            finding(
                "DS301",
                item("finding.offset", 4),
                item("finding.transaction", 1),
                item("finding.args", '{"count":2}'),
                item("finding.frame", 1),
            )
        ],
    )
    result = pdml(late, early)
    assert [(each["frame"], each["rule"]) for each in result.findings] == [
        (2, "DS301"),
        (2, "DS415"),
        (9, "DS103"),
    ]
    assert result.findings[0] == {
        "rule": "DS301",
        "severity": "warning",
        "message": "words",
        "args": {"count": 2},
        "frame": 2,
        "frames": [1, 2],
        "transaction": 1,
        "offset": 4,
    }
    assert result.findings[2]["transaction"] is None
    assert result.transactions[0]["findings"] == ["DS301", "DS415"]


def test_packets_without_the_plugin_say_nothing() -> None:
    assert pdml(packet(1), packet(2)) == Fields([], [])


def test_a_document_that_ends_early_is_an_error() -> None:
    with pytest.raises(ParseError):
        read(io.BytesIO(b"<pdml><packet>"))
