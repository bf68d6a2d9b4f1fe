"""Writes tests/vectors/messages.json: single messages, formats and texts, and what they must become.

What is expected is typed by hand, from docs/protocol.md and from how such numbers are written, and never
taken from a decoder: nothing of the program is imported here. Texts of numbers stand in message_texts.txt.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
TARGET = ROOT / "tests/vectors/messages.json"
TEXTS = ROOT / "tests/vectors/sources/message_texts.txt"
ABOUT = (
    "DS47 messages, formats and texts, and what they become, for every implementation. "
    "tests/vectors/README.md says what the keys mean; tests/vectors/sources/messages.py writes this file."
)
Row = dict[str, Any]


# The words of this file


def A(pnu: int, subindex: int = 0, n: int = 1, attribute: str = "value") -> Row:  # noqa: N802
    """A parameter address with n elements."""
    return {"attribute": attribute, "element_count": n, "pnu": pnu, "subindex": subindex}


def V(name: str, *values: Any, n: int | None = None, scaled: list[Any] | None = None) -> Row:  # noqa: N802
    """A value block; n is the number of values it states, where that is not how many there are."""
    return {
        "format": name,
        "value_count": len(values) if n is None else n,
        "values": list(values),
        "scaled": scaled,
        "error": None,
        "words": None,
    }


def E(*words: int, n: int | None = None, vendor: bool = False) -> Row:  # noqa: N802
    """An error block; inside vendor messages a first word up to 0xFF is no error number."""
    known = [None, None] if vendor and words[0] < 0x100 else [*words, None, None]
    return {
        "format": None,
        "value_count": len(words) if n is None else n,
        "values": [],
        "scaled": None,
        "error": {"code": known[0], "info": known[1]},
        "words": list(words),
    }


def F(rule: str, offset: int, **args: Any) -> Row:  # noqa: N802
    """A finding: the rule, the byte, and what its message names."""
    return {"rule": rule, "offset": offset, "args": args}


NO_ADDRESS: Row = {"attribute": None, "element_count": None, "pnu": None, "subindex": None}
NO_BLOCK: Row = {
    "format": None,
    "value_count": None,
    "values": [],
    "scaled": None,
    "error": None,
    "words": None,
    "offset": None,
}
MESSAGES: list[Row] = []
OPERATIONS = {1: "read", 2: "change", **dict.fromkeys((0x40, 0x41, 0x42, 0x51, 0x52), "vendor")}


def spelled(text: str) -> tuple[str, list[int]]:
    """Hexadecimal digits without the signs between them, and the bytes before which a | stands."""
    parts = ["".join(part.split()) for part in text.split("|")]
    starts = [sum(len(part) for part in parts[:n]) // 2 for n in range(1, len(parts))]
    return "".join(parts), starts


def message(
    kind: str,
    name: str,
    flags: str,
    text: str,
    head: Sequence[int | None],
    addresses: Sequence[Row] = (),
    blocks: Sequence[Row] = (),
    findings: Sequence[Row] = (),
    rest: str = "",
    shaped: bool = True,
    **how: Any,
) -> None:
    """A message; a | stands before each value block. `how`: options, and the request that it answers."""
    digits, starts = spelled(text)
    assert len(starts) == len(blocks), f"{name}: a | before every block"
    placed = [{**block, "offset": start} for block, start in zip(blocks, starts, strict=True)]
    number = max(len(addresses), len(placed))
    parameters = [
        {
            **(addresses[n] if n < len(addresses) else NO_ADDRESS),
            **(placed[n] if n < len(placed) else NO_BLOCK),
        }
        for n in range(number)
    ]
    padded = [*head, None, None, None, None]
    expect: Row = {
        "request_reference": padded[0],
        f"{kind}_id": padded[1],
        "axis": padded[2],
        "parameter_count": padded[3],
    }
    if kind == "request":
        expect["operation"] = OPERATIONS.get(padded[1] or 0, "unknown")
    expect |= {
        "parameters": parameters,
        "rest": rest.replace(" ", ""),
        "shaped": shaped,
        "findings": [{key: one[key] for key in ("rule", "offset")} for one in findings],
        "args": [one["args"] for one in findings],
    }
    row: Row = {"id": name, "flags": flags.split(), "kind": kind, "hex": digits}
    row |= how
    assert name not in {other["id"] for other in MESSAGES}, name
    MESSAGES.append({**row, "expect": expect})


request = partial(message, "request")


def response(
    name: str,
    flags: str,
    text: str,
    head: Sequence[int | None],
    blocks: Sequence[Row] = (),
    *more: Any,
    to: str | None = None,
    asked: Sequence[Row] = (),
    **how: Any,
) -> None:
    """A response, to a request where there is one."""
    if to is not None:
        how["request"] = spelled(to)[0]
    message("response", name, flags, text, head, asked, blocks, *more, **how)


V3 = {"profile_v3_types": True}
G120 = {"legacy_g120_formats": True}


# Messages of the application notes


request("s000-fig5-1-req", "example", "03010201 1001c47f0000", (3, 1, 2, 1), [A(50303)])
response(
    "s000-fig5-1-rsp", "example", "03010201 |0801 41200000", (3, 1, 2, 1), [V("Float32", 10.0)],
    to="03010201 1001c47f0000", asked=[A(50303)],
)  # fmt: skip
request(
    "s000-fig5-3-req", "example", "02020201 1001c4800000 |0801 42c80000", (2, 2, 2, 1),
    [A(50304)], [V("Float32", 100.0)],
)  # fmt: skip
response(
    "s000-fig5-3-rsp", "example", "02020201", (2, 2, 2, 1),
    to="02020201 1001c4800000 0801 42c80000", asked=[A(50304)],
)  # fmt: skip
request(
    "s001-fig3-5-req", "example array", "01010102 10000b540000 10040b560002", (1, 1, 1, 2),
    [A(2900, n=0), A(2902, 2, 4)],
)  # fmt: skip
response(
    "s001-fig3-5-rsp", "example array",
    "01010102 |0801 00000000 |0804 41200000 41a00000 42480000 42c80000", (1, 1, 1, 2),
    [V("Float32", 0.0), V("Float32", 10.0, 20.0, 50.0, 100.0)],
    to="01010102 10000b540000 10040b560002", asked=[A(2900, n=0), A(2902, 2, 4)],
)  # fmt: skip
request(
    "s001-fig3-6-req", "example",
    "01020102 10010b540000 10010b550000 |0801 41300000 |0801 41b00000", (1, 2, 1, 2),
    [A(2900), A(2901)], [V("Float32", 11.0), V("Float32", 22.0)],
)  # fmt: skip
response(
    "s001-fig3-6-rsp", "example", "01020102", (1, 2, 1, 2),
    to="01020102 10010b540000 10010b550000 0801 41300000 0801 41b00000",
    asked=[A(2900), A(2901)],
)  # fmt: skip


# Requests and their fields


request(
    "every-attribute", "attribute",
    "0101010b 100103b00000 200103b00000 300103b00000 800103b00000 900103b00000 a00103b00000"
    "b00103b00000 c00103b00000 d00103b00000 e00103b00000 f00103b00000",
    (1, 1, 1, 11),
    [
        A(944, attribute=name)
        for name in (
            *("value", "description", "text", "0x80", "0x90", "0xA0"),
            *("0xB0", "0xC0", "0xD0", "0xE0", "0xF0"),
        )
    ],
)  # fmt: skip
request(
    "reserved-attributes", "attribute", "01010103 000100020000 110100020000 700100020000",
    (1, 1, 1, 3),
    [A(2, attribute="0x00"), A(2, attribute="0x11"), A(2, attribute="0x70")],
    findings=[
        F("DS305", 4, attribute="0x00"),
        F("DS305", 10, attribute="0x11"),
        F("DS305", 16, attribute="0x70"),
    ],
)  # fmt: skip
request(
    "ends-of-ranges", "limits", "ff01ff02 10ea ffff ff16 1000 0001 0000", (255, 1, 255, 2),
    [A(65535, 65302, 234), A(1, 0, 0)],
)  # fmt: skip
request(
    "one-past-the-ranges", "limits", "ff01ff02 10eb ffff ff15 1001 0001 ffff", (255, 1, 255, 2),
    [A(65535, 65301, 235), A(1, 65535, 1)],
    findings=[F("DS307", 5, count=235, limit=234)],
)  # fmt: skip
request(
    "past-the-last-subindex", "limits", "01010102 1002 0001 ffff 1000 0001 ffff", (1, 1, 1, 2),
    [A(1, 65535, 2), A(1, 65535, 0)],
    findings=[F("DS308", 8, subindex=65535, count=2)],
)  # fmt: skip
for number in (0x81, 0x82):
    request(
        f"attribute-of-stoeber-{number:02x}", "attribute", f"01010101 {number:02x}01 2011 0000", (1, 1, 1, 1),
        [A(8209, 0, 1, f"0x{number:02X}")],
    )  # fmt: skip
request(
    "bad-address", "attribute limits", "01010101 50ff 0000 ffff", (1, 1, 1, 1),
    [A(0, 65535, 255, "0x50")],
    findings=[
        F("DS305", 4, attribute="0x50"),
        F("DS306", 6),
        F("DS307", 5, count=255, limit=234),
        F("DS308", 8, subindex=65535, count=255),
    ],
)  # fmt: skip
request(
    "reference-zero", "header", "00010101 100003b00000", (0, 1, 1, 1), [A(944, n=0)],
    findings=[F("DS301", 0)],
)  # fmt: skip
request(
    "thirty-nine-parameters", "limits", "01010127" + " 1001039a0000" * 39, (1, 1, 1, 39),
    [A(922)] * 39,
)  # fmt: skip
request(
    "forty-parameters", "limits", "01010128" + " 1001039a0000" * 40, (1, 1, 1, 40), [A(922)] * 40,
    findings=[F("DS304", 3, count=40, limit=39)],
)  # fmt: skip
request(
    "change-array", "array", "04020101 10030b560001 |0603 000100020003", (4, 2, 1, 1),
    [A(2902, 1, 3)], [V("Unsigned16", 1, 2, 3)],
)  # fmt: skip
request(
    "change-sizes-for-types", "sizes",
    "04020103 100100010000 100100020000 100100030000 |4101 7f00 |4201 8000 |4301 fffffffe",
    (4, 2, 1, 3), [A(1), A(2), A(3)],
    [V("Byte", 127), V("Word", 32768), V("DoubleWord", 4294967294)],
)  # fmt: skip
request(
    "change-without-elements", "array", "04020101 100003eb0000 |0501 0100", (4, 2, 1, 1),
    [A(1003, n=0)], [V("Unsigned8", 1)],
)  # fmt: skip
request(
    "value-count", "count", "2b020101 100303eb0000 |0502 0102", (43, 2, 1, 1),
    [A(1003, n=3)], [V("Unsigned8", 1, 2)],
    [F("DS310", 11, values=2, elements=3)],
)  # fmt: skip
request(
    "value-count-of-second", "count",
    "2b020102 100003eb0000 100203ec0000 |0502 0102 |0601 0009", (43, 2, 1, 2),
    [A(1003, n=0), A(1004, n=2)], [V("Unsigned8", 1, 2), V("Unsigned16", 9)],
    [F("DS310", 17, values=2, elements=1), F("DS310", 21, values=1, elements=2)],
)  # fmt: skip
request(
    "change-of-text-counts-otherwise", "count attribute",
    "2b020101 300103eb0000 |0904 50756d70", (43, 2, 1, 1),
    [A(1003, attribute="text")], [V("VisibleString", "Pump", n=4)],
)  # fmt: skip
request(
    "zeros-behind", "padding", "01010101 100000020000 00000000", (1, 1, 1, 1), [A(2, n=0)],
    findings=[F("DS314", 10, count=4)], rest="00000000",
)  # fmt: skip
request(
    "bytes-behind", "reject padding", "01010101 100000020000 dead", (1, 1, 1, 1), [A(2, n=0)],
    findings=[F("DS313", 10, count=2)], rest="dead", shaped=False,
)  # fmt: skip
request(
    "change-zeros-behind", "padding", "01020101 100100020000 |0601 0007 0000", (1, 2, 1, 1),
    [A(2)], [V("Unsigned16", 7)], [F("DS314", 14, count=2)], rest="0000",
)  # fmt: skip
request(
    "change-with-error-block", "error-words", "01020101 100100020000 |4401 0011", (1, 2, 1, 1),
    [A(2)], [E(0x11)],
)  # fmt: skip


# Responses: errors, pads, strings


response(
    "change-partial", "errors", "16820104 |4000 |4402 00020000 |4000 |4402 00010003",
    (22, 0x82, 1, 4), [V("Zero"), E(2, 0), V("Zero"), E(1, 3)],
)  # fmt: skip
response(
    "read-partial-odd-pad", "errors padding",
    "11810103 |0503 010203 00 |4402 00030006 |0601 001f", (17, 0x81, 1, 3),
    [V("Unsigned8", 1, 2, 3), E(3, 6), V("Unsigned16", 31)],
)  # fmt: skip
response(
    "strings-padded", "strings padding",
    "0f010102 |0907 50554d502d4131 00 |0a04 c0a82f02", (15, 1, 1, 2),
    [V("VisibleString", "PUMP-A1", n=7), V("OctetString", "c0a82f02", n=4)],
)  # fmt: skip
response(
    "strings-empty", "strings", "0f010103 |0900 |0a00 |0601 0007", (15, 1, 1, 3),
    [V("VisibleString", n=0), V("OctetString", n=0), V("Unsigned16", 7)],
)  # fmt: skip
response(
    "string-of-all-kinds", "strings", "0f010101 |0906 00 0a 7f 80 e4 ff", (15, 1, 1, 1),
    [V("VisibleString", "\x00\n\x7f\x80ä\xff", n=6)],
)  # fmt: skip
response(
    "not-supported", "errors", "3d800100 |4401 0021", (61, 0x80, 1, 0), [E(0x21)], shaped=False
)
response("not-supported-nothing", "errors", "3d800100", (61, 0x80, 1, 0), shaped=False)
response(
    "not-supported-counted", "errors error-words", "3d800101 |4403 0021 0000 0000", (61, 0x80, 1, 1),
    [E(0x21, 0, 0)], [F("DS318", 5, count=3)],
)  # fmt: skip
response(
    "not-supported-zeros", "errors padding", "3d800101 |4401 0021 0000", (61, 0x80, 1, 1),
    [E(0x21)], [F("DS314", 8, count=2)], rest="0000",
)  # fmt: skip
response(
    "not-supported-odd", "errors cut", "3d800101 |4401 0021 44", (61, 0x80, 1, 1),
    [E(0x21)], [F("DS315", 9, need=1, what="block header")], rest="44", shaped=False,
)  # fmt: skip
response(
    "error-no-words", "error-words", "01810101 |4400", (1, 0x81, 1, 1), [E()],
    [F("DS318", 5, count=0)],
)  # fmt: skip
response("error-one-word", "error-words", "01810101 |4401 0011", (1, 0x81, 1, 1), [E(0x11)])
response(
    "error-three-words", "error-words", "01810101 |4403 0002 0001 0009", (1, 0x81, 1, 1),
    [E(2, 1, 9)], [F("DS318", 5, count=3)],
)  # fmt: skip
# The error number is the whole first word: its low byte alone would be another number.
response(
    "error-high-byte", "error-words", "01810101 |4402 ff02 0001", (1, 0x81, 1, 1), [E(0xFF02, 1)]
)
response("error-of-a-maker", "error-words", "01810001 |4401 0811", (1, 0x81, 0, 1), [E(0x0811)])
response("error-last-subindex", "error-words", "01810101 |4402 0003 ffff", (1, 0x81, 1, 1), [
    E(3, 65535)
])  # fmt: skip
response(
    "shorter-than-request", "errors", "01810101 |4402 00150000", (1, 0x81, 1, 1), [E(0x15, 0)],
    to="01010102 100100010000 100100020000", asked=[A(1), A(2)],
)  # fmt: skip
for first in (0x00, 0x40, 0x80, 0xC0):
    response(
        f"errors-{first:02x}-to-{first + 63:02x}", "errors",
        "01810140" + "".join(f" |4402 00{code:02x} 0000" for code in range(first, first + 64)),
        (1, 0x81, 1, 64), [E(code, 0) for code in range(first, first + 64)],
    )  # fmt: skip
response(
    "pad-not-zero", "padding", "01010101 |0501 07 55", (1, 1, 1, 1), [V("Unsigned8", 7)],
    [F("DS312", 7, pad="0x55")],
)  # fmt: skip
response(
    "pad-missing-at-end", "padding", "01010101 |0501 07", (1, 1, 1, 1), [V("Unsigned8", 7)],
    [F("DS311", 7)],
)  # fmt: skip
response(
    "pad-missing-inside", "padding", "01010102 |0501 07 |0601 0009", (1, 1, 1, 2),
    [V("Unsigned8", 7), V("Unsigned16", 9)], [F("DS311", 7)],
)  # fmt: skip
response(
    "positive-with-error", "sign", "01010101 |4402 00000000", (1, 1, 1, 1), [E(0, 0)],
    [F("DS411", 1)],
)  # fmt: skip
response(
    "negative-without-error", "sign", "01810101 |0601 0001", (1, 0x81, 1, 1),
    [V("Unsigned16", 1)], [F("DS412", 1)],
)  # fmt: skip
response(
    "change-negative-without-error", "sign", "01820101 |4000", (1, 0x82, 1, 1), [V("Zero")],
    [F("DS412", 1)],
)  # fmt: skip
response(
    "change-done-with-zeros", "padding", "01020101 0000", (1, 2, 1, 1),
    findings=[F("DS314", 4, count=2)], rest="0000",
)  # fmt: skip
response(
    "change-done-with-blocks", "reject padding", "01020101 4000", (1, 2, 1, 1),
    findings=[F("DS313", 4, count=2)], rest="4000", shaped=False,
)  # fmt: skip
response(
    "description", "description",
    "01010101 |0a2e 0203 0001 3f800000 0000 00000000 53706565642073657470 6f696e742020"
    "c61c4000 461c4000 0000 0000 0000 0071",
    (1, 1, 1, 1),
    [V("OctetString", "0203" "0001" "3f800000" "0000" "00000000" "53706565642073657470"
       "6f696e742020" "c61c4000" "461c4000" "0000" "0000" "0000" "0071", n=46)],
    to="01010101 200104600000", asked=[A(1120, attribute="description")],
)  # fmt: skip
response(
    "reference-zero-mirrored", "header", "00010101 |0601 0001", (0, 1, 1, 1), [V("Unsigned16", 1)]
)


# Times with two sizes, formats with two meanings, dialects


response(
    "time-difference-4", "two-sizes", "01010102 |0d01 000003e8 |0601 0001", (1, 1, 1, 2),
    [V("TimeDifference", 1000, scaled=[1.0]), V("Unsigned16", 1)],
)  # fmt: skip
response(
    "time-difference-6", "two-sizes", "01010102 |0d01 000003e80002 |0601 0001", (1, 1, 1, 2),
    [V("TimeDifference", 65536002, scaled=[172801.0]), V("Unsigned16", 1)],
)  # fmt: skip
response(
    "time-difference-ambiguous", "two-sizes", "01010101 |0d01 000003e8 00000000", (1, 1, 1, 1),
    [V("TimeDifference", 1000, scaled=[1.0])],
    [F("DS317", 4, format="0x0D", size=4), F("DS314", 10, count=4)], rest="00000000",
)  # fmt: skip
request(
    "time-difference-change-6", "two-sizes count",
    "01020101 100300020000 |0d02 000003e80002 00000000ffff",
    (1, 2, 1, 1), [A(2, n=3)],
    [V("TimeDifference", 65536002, 65535, scaled=[172801.0, 5662224000.0])],
    [F("DS310", 11, values=2, elements=3)],
)  # fmt: skip
response(
    "v3-size-by-length", "two-meanings", "01010101 |2101 2000", (1, 1, 1, 1),
    [V("N2", 8192, scaled=[50.0])], [F("DS317", 4, format="0x21", size=2)],
)  # fmt: skip
response(
    "v3-option", "option", "01010101 |2101 2000", (1, 1, 1, 1), [V("N2", 8192, scaled=[50.0])],
    options=V3,
)  # fmt: skip
response(
    "v3-every-code", "option",
    "0101010c |2101 c000 |2201 20000000 |2301 a5c3 |2401 1234 |2501 0002 |2601 ffff |2701 fffffffe"
    "|2801 c000 |2901 0180 |2a01 fffe7960 |2b01 ffff |2c01 80000000",
    (1, 1, 1, 12),
    [
        V("N2", -16384, scaled=[-100.0]),
        V("N4", 536870912, scaled=[50.0]),
        V("V2", 0xA5C3),
        V("L2", 0x1234),
        V("R2", 2),
        V("T2", 65535),
        V("T4", 4294967294),
        V("D2", -16384),
        V("E2", 384, scaled=[3.0]),
        V("C4", -100000, scaled=[-10.0]),
        V("X2", -1),
        V("X4", -2147483648),
    ],
    options=V3,
)  # fmt: skip
request(
    "v3-change", "option", "01020101 100100020000 |2101 4000", (1, 2, 1, 1), [A(2)],
    [V("N2", 16384, scaled=[100.0])], options=V3,
)  # fmt: skip
V3_BY_LENGTH = (
    (0x22, "20000000", V("N4", 536870912, scaled=[50.0])),
    (0x23, "a5c31234", V("V2", 0xA5C3, 0x1234)),
    (0x24, "1234ffff", V("L2", 0x1234, 0xFFFF)),
    (0x25, "0002", V("R2", 2)),
    (0x26, "ffff", V("T2", 65535)),
    (0x27, "fffffffe", V("T4", 4294967294)),
    (0x28, "c000", V("D2", -16384)),
    (0x29, "0180", V("E2", 384, scaled=[3.0])),
    (0x2A, "fffe7960", V("C4", -100000, scaled=[-10.0])),
    (0x2B, "ffff", V("X2", -1)),
    (0x2C, "80000000", V("X4", -2147483648)),
)
for code, data, block in V3_BY_LENGTH:
    n = block["value_count"]
    if (
        code == 0x24
    ):  # two characters of two bytes, or two values of two: the IEC meaning is the usual
        block = V("UnicodeChar", "1234", "ffff")
    size = {0x22: 4, 0x27: 4, 0x2A: 4, 0x2C: 4}.get(code, 2)
    response(
        f"v3-by-length-{code:02x}", "two-meanings", f"01010101 |{code:02x}{n:02x} {data}",
        (1, 1, 1, 1), [block],
        [] if code == 0x24 else [F("DS317", 4, format=f"0x{code:02X}", size=size)],
    )  # fmt: skip
response(
    "bcd-or-v2", "two-meanings padding", "01010101 |2301 a5 c3", (1, 1, 1, 1), [V("BCD", "a5")],
    [F("DS312", 7, pad="0xC3")],
)  # fmt: skip
response(
    "iec-octets-8", "two-meanings", "01010101 |2101 0001020304050607", (1, 1, 1, 1),
    [V("OctetString8", "0001020304050607")],
)  # fmt: skip
response(
    "g120-option", "option padding", "01010101 |1003 010203 00", (1, 1, 1, 1),
    [V("OctetString", "010203", n=3)], options=G120,
)  # fmt: skip
response(
    "g120-time-4", "option two-sizes", "01010101 |1301 000003e8", (1, 1, 1, 1),
    [V("TimeDifference", 1000, scaled=[1.0])], options=G120,
)  # fmt: skip
response(
    "g120-time-6", "option two-sizes", "01010102 |1301 000003e80002 |0601 0007", (1, 1, 1, 2),
    [V("TimeDifference", 65536002, scaled=[172801.0]), V("Unsigned16", 7)], options=G120,
)  # fmt: skip
response(
    "g120-time-ambiguous", "option two-sizes", "01010101 |1301 000003e8 00000000",
    (1, 1, 1, 1),
    [V("TimeDifference", 1000, scaled=[1.0])],
    [F("DS317", 4, format="0x13", size=4), F("DS314", 10, count=4)], rest="00000000",
    options=G120,
)  # fmt: skip
request(
    "g120-change", "option", "01020101 100200020000 |1002 c0a8", (1, 2, 1, 1), [A(2, n=2)],
    [V("OctetString", "c0a8", n=2)], options=G120,
)  # fmt: skip
response(
    "universal-time-without-option", "two-meanings", "01010101 |1001 000102030405060708090a0b",
    (1, 1, 1, 1), [V("UniversalTime", "000102030405060708090a0b")],
)  # fmt: skip
response(
    "0x13-without-option", "reject unknown-format", "01010101 |1301 000003e8", (1, 1, 1, 1),
    [V("0x13", n=1)], [F("DS309", 4, format="0x13")], rest="000003e8", shaped=False,
)  # fmt: skip
response(
    "both-options", "option", "01010102 |1002 c0a8 |7101 4000", (1, 1, 1, 2),
    [V("OctetString", "c0a8", n=2), V("N2", 16384, scaled=[100.0])], options={**G120, **V3},
)  # fmt: skip
response(
    "both-options-v3-code", "option", "01010102 |1002 c0a8 |2101 4000", (1, 1, 1, 2),
    [V("OctetString", "c0a8", n=2), V("N2", 16384, scaled=[100.0])], options={**G120, **V3},
)  # fmt: skip


# Formats whose blocks cannot be skipped


response(
    "unknown-format", "reject unknown-format", "01010102 |7f01 0001 0601 0002", (1, 1, 1, 2),
    [V("0x7F", n=1)], [F("DS309", 4, format="0x7F")], rest="0001 0601 0002", shaped=False,
)  # fmt: skip
response(
    "unknown-format-second", "reject unknown-format", "01010102 |0601 0002 |ff02 0001",
    (1, 1, 1, 2), [V("Unsigned16", 2), V("0xFF", n=2)],
    [F("DS309", 8, format="0xFF")], rest="0001", shaped=False,
)  # fmt: skip
request(
    "unknown-format-change", "reject unknown-format", "01020101 100100020000 |0001 0001",
    (1, 2, 1, 1), [A(2)], [V("Reserved", n=1)], [F("DS309", 10, format="0x00")],
    rest="0001", shaped=False,
)  # fmt: skip
response(
    "unsized-format", "reject unknown-format", "01010101 |2701 0041", (1, 1, 1, 1),
    [V("UnicodeString", n=1)], [F("DS309", 4, format="0x27")], rest="0041", shaped=False,
)  # fmt: skip
UNSIZED = {
    0x00: "Reserved",
    0x25: "CompactBooleanArray",
    0x26: "CompactBCDArray",
    0x27: "UnicodeString",
    0x28: "BinaryTime0",
    0x29: "BinaryTime1",
    0x2A: "BinaryTime2",
    0x2B: "BinaryTime3",
    0x2C: "BinaryTime4",
    0x2D: "BinaryTime5",
    0x2E: "BinaryTime6",
    0x2F: "BinaryTime7",
    0x30: "BinaryTime8",
    0x31: "BinaryTime9",
}
for code, name in UNSIZED.items():
    response(
        f"format-{code:02x}-has-no-size", "reject unknown-format",
        f"01010102 |0601 0002 |{code:02x}01 010203040506", (1, 1, 1, 2),
        [V("Unsigned16", 2), V(name, n=1)],
        [F("DS309", 8, format=f"0x{code:02X}")], rest="010203040506", shaped=False,
    )  # fmt: skip


# Ids


request("read", "id", "01010101 1001039a0000", (1, 1, 1, 1), [A(922)])
request("sew-service", "id vendor", "01400001 100100020000", (1, 0x40, 0, 1), [A(2)], shaped=True)
request(
    "sew-service-with-block", "id vendor padding", "01400001 500100000000 |4301 00000007 0000",
    (1, 0x40, 0, 1), [A(0, attribute="0x50")], [V("DoubleWord", 7)],
    [F("DS314", 16, count=2)], rest="0000",
)  # fmt: skip
request(
    "sew-service-opaque", "reject id vendor", "01400001 100100020000 0102030405",
    (1, 0x40, 0, 1), [A(2)], findings=[F("DS313", 10, count=5)], rest="0102030405", shaped=False,
)  # fmt: skip
request(
    "sew-data", "id vendor", "01410001 100100020000 |4101 0700 0000", (1, 0x41, 0, 1),
    [A(2)], [V("Byte", 7)], [F("DS314", 14, count=2)], rest="0000",
)  # fmt: skip
request(
    "vlt-change-stored", "id vendor", "01420001 100100010000 |4301 000003e8", (1, 0x42, 0, 1),
    [A(1)], [V("DoubleWord", 1000)],
)  # fmt: skip
request("vlt-read", "id vendor", "01510001 100000010000", (1, 0x51, 0, 1), [A(1, n=0)])
request(
    "vlt-change", "id vendor", "01520001 100100010000 |4302 000003e8 00000000", (1, 0x52, 0, 1),
    [A(1)], [V("DoubleWord", 1000, 0)],
)  # fmt: skip
response(
    "sew-service-answer", "id vendor", "01400001 |4301 00000007 0000", (1, 0x40, 0, 1),
    [V("DoubleWord", 7)], [F("DS314", 10, count=2)], rest="0000",
)  # fmt: skip
response(
    "sew-service-error", "id vendor", "01c00001 |4402 0811 0000 00", (1, 0xC0, 0, 1),
    [E(0x0811, 0, vendor=True)], [F("DS314", 10, count=1)], rest="00",
)  # fmt: skip
response(
    "sew-service-error-one-word", "id vendor", "01c00001 |4401 0811", (1, 0xC0, 0, 1),
    [E(0x0811, vendor=True)], to="01400001 100100020000", asked=[A(2)],
)  # fmt: skip
response(
    "vendor-request-not-supported", "id vendor errors", "6a800201 |4401 0021", (0x6A, 0x80, 2, 1),
    [E(0x21)], to="6a400201 100100020000", asked=[A(2)],
)  # fmt: skip
response(
    "sew-service-error-opaque", "reject id vendor", "01c00001 0811", (1, 0xC0, 0, 1),
    findings=[F("DS313", 4, count=2)], rest="0811", shaped=False,
)  # fmt: skip
response(
    "sew-data-transport", "id vendor", "01410001 |0601 0001", (1, 0x41, 0, 1),
    [V("Unsigned16", 1)],
)  # fmt: skip
response(
    "sew-data-transport-failed", "id vendor", "01410001 |4402 0002 0000 00", (1, 0x41, 0, 1),
    [E(2, 0, vendor=True)], [F("DS314", 10, count=1)], rest="00",
)  # fmt: skip
response(
    "vlt-stored-answer", "id vendor", "01420001 |4000 00", (1, 0x42, 0, 1), [V("Zero")],
    [F("DS314", 6, count=1)], rest="00",
)  # fmt: skip
response(
    "vlt-stored-answer-empty", "id vendor", "01420001 0000", (1, 0x42, 0, 1),
    findings=[F("DS314", 4, count=2)], rest="0000",
)  # fmt: skip
response(
    "vlt-stored-error", "id vendor", "01c20001 |4401 0002", (1, 0xC2, 0, 1), [E(2, vendor=True)]
)
response(
    "vlt-read-answer", "id vendor", "01510001 |4301 000003e8", (1, 0x51, 0, 1),
    [V("DoubleWord", 1000)], to="01510001 100000010000", asked=[A(1, n=0)],
)  # fmt: skip
response(
    "vlt-error-is-not-profidrive", "id vendor", "01d10001 |4402 00020000", (1, 0xD1, 0, 1),
    [E(2, 0, vendor=True)], to="01510001 100000010000", asked=[A(1, n=0)],
)  # fmt: skip
response(
    "vlt-answer-with-standard-id", "id vendor", "01810001 |4402 00020000", (1, 0x81, 0, 1),
    [E(2, 0, vendor=True)], to="01510001 100000010000", asked=[A(1, n=0)],
)  # fmt: skip
response(
    "vlt-read-sign", "id vendor sign", "01510001 |4401 0002", (1, 0x51, 0, 1),
    [E(2, vendor=True)], [F("DS411", 1)],
)  # fmt: skip
response(
    "vlt-change-answer", "id vendor", "01520001 |4000 00", (1, 0x52, 0, 1), [V("Zero")],
    [F("DS314", 6, count=1)], rest="00",
)  # fmt: skip
response(
    "vlt-change-error", "id vendor", "01d20001 |4401 0002", (1, 0xD2, 0, 1), [E(2, vendor=True)]
)
response(
    "vlt-change-error-without", "id vendor sign", "01d20001 |4000", (1, 0xD2, 0, 1), [V("Zero")],
    [F("DS412", 1)],
)  # fmt: skip


# Rejects: what must not be taken for DS47, though some of it looks like it


request(
    "nothing", "reject cut", "", (), findings=[F("DS315", 0, need=4, what="header")], shaped=False
)
response(
    "no-answer", "reject cut", "", (), findings=[F("DS315", 0, need=4, what="header")], shaped=False
)
request(
    "cut-header", "reject cut", "3b0101", (59, 1, 1),
    findings=[F("DS315", 3, need=1, what="header")], shaped=False,
)  # fmt: skip
request(
    "cut-address", "reject cut", "01010102 100000020000 1000", (1, 1, 1, 2), [A(2, n=0)],
    findings=[F("DS315", 12, need=4, what="address 2 of 2")], rest="1000", shaped=False,
)  # fmt: skip
response(
    "cut-values", "reject cut", "01010101 |0604 0001 0002 00", (1, 1, 1, 1),
    [V("Unsigned16", 1, 2, n=4)],
    [F("DS315", 11, need=3, what="values of block 1")], shaped=False,
)  # fmt: skip
response(
    "cut-blocks", "reject cut", "01010102 |0601 0001", (1, 1, 1, 2), [V("Unsigned16", 1)],
    [F("DS315", 8, need=2, what="value block 2 of 2")], shaped=False,
)  # fmt: skip
response(
    "single-access", "count", "01810102 |4402 0023 0000", (1, 0x81, 1, 2), [E(0x23, 0)],
    to="01010102 10013b100000 10013b110000", asked=[A(15120), A(15121)],
)  # fmt: skip
response(
    "single-access-not", "reject cut", "01810102 |4402 0022 0000", (1, 0x81, 1, 2), [E(0x22, 0)],
    [F("DS315", 10, need=2, what="value block 2 of 2")], shaped=False,
)  # fmt: skip
response(
    "single-access-two", "reject cut", "01810103 |4402 0023 0000 |4402 0023 0000", (1, 0x81, 1, 3),
    [E(0x23, 0), E(0x23, 0)], [F("DS315", 16, need=2, what="value block 3 of 3")], shaped=False,
)  # fmt: skip
request(
    "count-zero", "reject header", "01010100", (1, 1, 1, 0), findings=[F("DS303", 3)], shaped=False
)
response(
    "count-zero-answer", "reject header", "01010100", (1, 1, 1, 0), findings=[F("DS303", 3)],
    shaped=False,
)  # fmt: skip
request(
    "count-too-high", "reject cut", "010101ff 1001039a0000", (1, 1, 1, 255), [A(922)],
    findings=[
        F("DS304", 3, count=255, limit=39),
        F("DS315", 10, need=1524, what="address 2 of 255"),
    ],
    shaped=False,
)  # fmt: skip
request(
    "unknown-request-id", "reject id", "01050101 100000020000", (1, 5, 1, 1), [A(2, n=0)],
    findings=[F("DS302", 1, id="0x05")], shaped=False,
)  # fmt: skip
response(
    "unknown-response-id", "reject id", "01070101 |0601 0001", (1, 7, 1, 1),
    [V("Unsigned16", 1)], [F("DS319", 1, id="0x07")], shaped=False,
)  # fmt: skip
request(
    "response-id-in-request", "reject id", "01810101 1001039a0000", (1, 0x81, 1, 1), [A(922)],
    findings=[F("DS302", 1, id="0x81")], shaped=False,
)  # fmt: skip
request(
    "zeros", "reject foreign", "0000000000000000 0000", (0, 0, 0, 0),
    findings=[F("DS301", 0), F("DS302", 1, id="0x00"), F("DS303", 3), F("DS314", 4, count=6)],
    rest="000000000000", shaped=False,
)  # fmt: skip
response(
    "zeros-answer", "reject foreign", "0000000000000000 0000", (0, 0, 0, 0),
    findings=[F("DS319", 1, id="0x00"), F("DS303", 3), F("DS314", 4, count=6)],
    rest="000000000000", shaped=False,
)  # fmt: skip
request(
    "all-ones", "reject foreign", "ffffffff ffffffff", (255, 255, 255, 255),
    findings=[
        F("DS302", 1, id="0xFF"),
        F("DS304", 3, count=255, limit=39),
        F("DS315", 8, need=1526, what="address 1 of 255"),
    ],
    rest="ffffffff", shaped=False,
)  # fmt: skip
response(
    "all-ones-answer", "reject foreign", "ffffffff ffffffff", (255, 255, 255, 255),
    findings=[F("DS319", 1, id="0xFF"), F("DS313", 4, count=4)], rest="ffffffff", shaped=False,
)  # fmt: skip
response(
    "text-of-another-device", "reject foreign", "48656c6c6f2c20576f726c64", (0x48, 0x65, 0x6C, 0x6C),
    findings=[F("DS319", 1, id="0x65"), F("DS313", 4, count=8)], rest="6f2c20576f726c64",
    shaped=False,
)  # fmt: skip
response(
    "identification-record", "reject foreign",
    "00200038 0100 002a 36534c33", (0, 0x20, 0, 0x38),
    findings=[F("DS319", 1, id="0x20"), F("DS313", 4, count=8)], rest="0100002a36534c33",
    shaped=False,
)  # fmt: skip
request(
    "pkw-telegram", "reject foreign", "14010000 00000000", (0x14, 1, 0, 0),
    findings=[F("DS303", 3), F("DS314", 4, count=4)], rest="00000000", shaped=False,
)  # fmt: skip
response(
    "request-read-back", "reject foreign", "03010201 |1001 c47f0000", (3, 1, 2, 1),
    [V("UniversalTime", n=1)], [F("DS315", 10, need=8, what="values of block 1")], shaped=False,
)  # fmt: skip
request(
    "response-as-request", "look-alike", "03010201 0801 4120 0000", (3, 1, 2, 1),
    [A(0x4120, attribute="0x08")], findings=[F("DS305", 4, attribute="0x08")],
)  # fmt: skip
request(
    "read-with-values", "reject padding", "02010201 1001c4800000 0801 42c80000", (2, 1, 2, 1),
    [A(50304)], findings=[F("DS313", 10, count=6)], rest="080142c80000", shaped=False,
)  # fmt: skip
request(
    "change-without-values", "reject cut", "02020201 1001c4800000", (2, 2, 2, 1), [A(50304)],
    findings=[F("DS315", 10, need=2, what="value block 1 of 1")], shaped=False,
)  # fmt: skip


# Messages cut at each byte


HEADER = (0, 4, "header", 4, {})


def cut(
    kind: Any,
    name: str,
    whole: str,
    head: Sequence[int],
    starts: Sequence[int],
    *parts: tuple[int, int, str, int, Row],
) -> None:
    """A message that ends too early, at each byte.

    `starts` are the bytes at which its value blocks begin. Each of `parts` says for which ends it is: from, and up
    to; what is cut there and where that would be complete; and what was decoded before.
    """
    for first, last, what, complete, before in parts:
        for end in range(first, last):
            edges = [0, *starts[: len(before.get("blocks", ()))], end]
            text = "|".join(whole[2 * one : 2 * two] for one, two in pairwise(edges))
            opaque = what.startswith(("address", "value block"))
            kind(
                f"{name}-cut-{end:02d}", "reject cut", text, head[:end], **before,
                findings=[F("DS315", end, need=complete - end, what=what)],
                rest=whole[2 * first : 2 * end] if opaque else "", shaped=False,
            )  # fmt: skip


# A read of two parameters: header, address, address.
WHOLE, HEAD = "070103021001039a000020020b540003", (7, 1, 3, 2)
cut(
    request, "read", WHOLE, HEAD, (), HEADER,
    (4, 10, "address 1 of 2", 16, {}),
    (10, 16, "address 2 of 2", 16, {"addresses": [A(922)]}),
)  # fmt: skip
request("read-cut-none", "none", WHOLE, HEAD, [A(922), A(2900, 3, 2, "description")])

# A change: header, address, one Float32.
WHERE = {"addresses": [A(50304)]}
cut(
    request, "change", "020202011001c4800000080142c80000", (2, 2, 2, 1), (10,), HEADER,
    (4, 10, "address 1 of 1", 10, {}),
    (10, 12, "value block 1 of 1", 12, WHERE),
    (12, 16, "values of block 1", 16, {**WHERE, "blocks": [V("Float32", n=1)]}),
)  # fmt: skip

# A response: header, one Float32, three Unsigned8 and their pad.
WHOLE, HEAD, TEN = "07010302080141200000050301020300", (7, 1, 3, 2), V("Float32", 10.0)
cut(
    response, "answer", WHOLE, HEAD, (4, 10), HEADER,
    (4, 6, "value block 1 of 2", 6, {}),
    (6, 10, "values of block 1", 10, {"blocks": [V("Float32", n=1)]}),
    (10, 12, "value block 2 of 2", 12, {"blocks": [TEN]}),
    (12, 13, "values of block 2", 15, {"blocks": [TEN, V("Unsigned8", n=3)]}),
    (13, 14, "values of block 2", 15, {"blocks": [TEN, V("Unsigned8", 1, n=3)]}),
    (14, 15, "values of block 2", 15, {"blocks": [TEN, V("Unsigned8", 1, 2, n=3)]}),
)  # fmt: skip
response(
    "answer-cut-15", "cut padding", "07010302 |080141200000 |0503010203", HEAD,
    [TEN, V("Unsigned8", 1, 2, 3)], [F("DS311", 15)],
)  # fmt: skip

# A negative response: header, one Unsigned16, an error of two words.
WORD = V("Unsigned16", 31)
cut(
    response, "error", "098101020601001f440200030006", (9, 0x81, 1, 2), (4, 8), HEADER,
    (4, 6, "value block 1 of 2", 6, {}),
    (6, 8, "values of block 1", 8, {"blocks": [V("Unsigned16", n=1)]}),
    (8, 10, "value block 2 of 2", 10, {"blocks": [WORD]}),
    (10, 12, "values of block 2", 14, {"blocks": [WORD, E(n=2)]}),
    (12, 14, "values of block 2", 14, {"blocks": [WORD, E(3, n=2)]}),
)  # fmt: skip


# Formats: code, name, bytes per value, unit, then samples: bytes, how many values, values, scaled

Sample = tuple[Any, ...]
WEEK, OCTETS = "75301e0c2e0718", "000102030405060708090a0b0c0d0e0f"
FORMATS: tuple[tuple[int, str, int, str | None, tuple[Sample, ...]], ...] = (
    (0x01, "Boolean", 1, None, (("0001ff02", 4, [0, 1, 255, 2]),)),
    (0x02, "Integer8", 1, None, (("fb7f80", 3, [-5, 127, -128]),)),
    (0x03, "Integer16", 2, None, (("fed47fff8000ffff", 4, [-300, 32767, -32768, -1]),)),
    (0x04, "Integer32", 4, None, (
        ("fffe1dc0", 1, [-123456]), ("7fffffff80000000", 2, [2147483647, -2147483648]),
    )),
    (0x05, "Unsigned8", 1, None, (("c8", 1, [200]), ("00ff", 2, [0, 255]))),
    (0x06, "Unsigned16", 2, None, (("ffff", 1, [65535]), ("01020304", 2, [258, 772]))),
    (0x07, "Unsigned32", 4, None, (("80000001", 1, [2147483649]), ("01020304", 1, [16909060]))),
    (0x08, "Float32", 4, None, (
        ("3dcccccdff800000", 2, [0.1, "-Infinity"]),
        ("7fc000007f800000", 2, ["NaN", "Infinity"]),
        ("00000000800000003f800000c0490fdb", 4, [0.0, -0.0, 1.0, -3.1415927]),
        ("42f6e979461c4000", 2, [123.456, 10000.0]),
        ("4b8000014cbebc207f000000", 3, [16777218.0, 100000000.0, 1.7014118e38]),
        ("00000001007fffff7f7fffff7f7fc99e", 4, [1e-45, 1.1754942e-38, 3.4028235e38, 3.4e38]),
    )),
    (0x09, "VisibleString", 1, None, (("50e4", 2, ["Pä"]), ("53706565642031", 7, ["Speed 1"]))),
    (0x0A, "OctetString", 1, None, (("c0a8", 2, ["c0a8"]), ("00ff10", 3, ["00ff10"]))),
    (0x0B, "BinaryDate", 7, None, (
        (WEEK, 1, ["32985477886641944"], ["2024-07-14T12:30:30.000"]),
    )),
    (0x0C, "TimeOfDay", 6, None, (
        ("000000010002", 1, [65538], ["1984-01-03T00:00:00.001"]),
        ("02932e000000", 1, [2831155200000], ["1984-01-01T12:00:00.000"]),
        ("05265bff016ef00000000001", 2, [5662310334830, 263882790666241],
         ["1985-01-01T23:59:59.999", "1984-01-02T00:00:00.000"]),
    )),
    (0x0D, "TimeDifference", 4, "s", (
        ("000005dc", 1, [1500], [1.5]),
        ("00000000ffffffff", 2, [0, 4294967295], [0.0, 4294967.295]),
    )),
    (0x0E, "BitString", 1, None, (("0f", 1, ["0f"]), ("0f80", 2, ["0f80"]))),
    (0x0F, "Float64", 8, None, (
        ("400921fb54442d18", 1, [3.141592653589793]),
        ("c08f4000000000003fb999999999999a", 2, [-1000.0, 0.1]),
        ("7ff00000000000000000000000000001", 2, ["Infinity", 5e-324]),
        ("7fefffffffffffff", 1, [1.7976931348623157e308]),
    )),
    (0x10, "UniversalTime", 12, None, ((OCTETS[:24], 1, [OCTETS[:24]]),)),
    (0x11, "FieldbusTime", 7, None, ((OCTETS[:14], 1, [OCTETS[:14]]),)),
    (0x15, "TimeValue", 8, None, ((OCTETS[:16], 1, [OCTETS[:16]]),)),
    (0x16, "BitString8", 1, None, (("80", 1, [128]),)),
    (0x17, "BitString16", 2, None, (("8001", 1, [32769]),)),
    (0x18, "BitString32", 4, None, (("80000001", 1, [2147483649]),)),
    (0x19, "VisibleString1", 1, None, (("4142", 2, ["A", "B"]),)),
    (0x1A, "VisibleString2", 2, None, (("41426364", 2, ["AB", "cd"]),)),
    (0x1B, "VisibleString4", 4, None, (("4142636465666768", 2, ["ABcd", "efgh"]),)),
    (0x1C, "VisibleString8", 8, None, (("5075 6d70 2020 2020", 1, ["Pump    "]),)),
    (0x1D, "VisibleString16", 16, None, (("53706565642073657470 6f696e742020", 1,
                                          ["Speed setpoint  "]),)),
    (0x1E, "OctetString1", 1, None, (("a55a", 2, ["a5", "5a"]),)),
    (0x1F, "OctetString2", 2, None, (("a5a55a5a", 2, ["a5a5", "5a5a"]),)),
    (0x20, "OctetString4", 4, None, (("a5a5a5a55a5a5a5a", 2, ["a5a5a5a5", "5a5a5a5a"]),)),
    (0x21, "OctetString8", 8, None, ((OCTETS, 2, [OCTETS[:16], OCTETS[16:]]),)),
    (0x22, "OctetString16", 16, None, ((OCTETS * 2, 2, [OCTETS, OCTETS]),)),
    (0x23, "BCD", 1, None, (("42", 1, ["42"]), ("4299", 2, ["42", "99"]))),
    (0x24, "UnicodeChar", 2, None, (("0041", 1, ["0041"]),)),
    (0x32, "Date", 7, None, (
        (WEEK, 1, ["32985477886641944"], ["2024-07-14T12:30:30.000"]),
        ("00000000210154", 1, [2163028], ["1984-01-01T00:00:00.000"]),
        ("ea5f3b97ff0c53", 1, ["65969854108077139"], ["2083-12-31T23:59:59.999"]),
    )),
    (0x33, "BinaryDate2000", 8, None, ((OCTETS[:16], 1, [OCTETS[:16]]),)),
    (0x34, "TimeOfDayWithoutDate", 4, None, (
        ("02932e00", 1, [43200000], ["12:00:00.000"]),
        ("05265bff00000000", 2, [86399999, 0], ["23:59:59.999", "00:00:00.000"]),
    )),
    (0x35, "TimeDifferenceWithDate", 6, "s", (
        ("000003e80001", 1, [65536001], [86401.0]),
        ("ffffffffffff", 1, [281474976710655], [5666518967.295]),
    )),
    (0x36, "TimeDifferenceWithoutDate", 4, "s", (("000005dc", 1, [1500], [1.5]),)),
    (0x37, "Integer64", 8, None, (
        ("ffffff0000000000", 1, [-1099511627776]),
        ("80000000000000007fffffffffffffff", 2,
         ["-9223372036854775808", "9223372036854775807"]),
        ("ffdfffffffffffffffe0000000000000", 2, ["-9007199254740993", -9007199254740992]),
    )),
    (0x38, "Unsigned64", 8, None, (
        ("80000000000000050020000000000000", 2, ["9223372036854775813", 9007199254740992]),
        ("ffffffffffffffff0020000000000001", 2, ["18446744073709551615", "9007199254740993"]),
    )),
    (0x39, "BitString64", 8, None, (("0000000000000001", 1, [1]),
                                    ("8000000000000000", 1, ["9223372036854775808"]))),
    (0x3A, "NetworkTime", 8, None, ((OCTETS[:16], 1, [OCTETS[:16]]),)),
    (0x3B, "NetworkTimeDifference", 8, None, ((OCTETS[:16], 1, [OCTETS[:16]]),)),
    (0x40, "Zero", 0, None, (("", 0, []),)),
    (0x41, "Byte", 1, None, (("ff", 1, [255]),)),
    (0x42, "Word", 2, None, (("8000", 1, [32768]),)),
    (0x43, "DoubleWord", 4, None, (("ffffffff", 1, [4294967295]),)),
    (0x65, "Float32+Unsigned8", 5, None, (
        ("3f80000080", 1, ["3f80000080"], [1.0]),
        ("3dcccccd01ff80000002", 2, ["3dcccccd01", "ff80000002"], [0.1, "-Infinity"]),
    )),
    (0x66, "Unsigned8+Unsigned8", 2, None, (("0780ff00", 2, ["0780", "ff00"], [7, 255]),)),
    (0x67, "OctetString2+Unsigned8", 3, None, (("010280", 1, ["010280"]),)),
    (0x68, "Unsigned16_S", 2, None, (("ffff", 1, [65535]),)),
    (0x69, "Integer16_S", 2, None, (("ffff", 1, [-1]),)),
    (0x6A, "Unsigned8_S", 1, None, (("ff", 1, [255]),)),
    (0x6B, "OctetString_S", 1, None, (("0102", 2, ["0102"]),)),
    (0x6E, "FMessageTrailer4", 4, None, (("01020304", 1, ["01020304"]),)),
    (0x6F, "FMessageTrailer5", 5, None, (("0102030405", 1, ["0102030405"]),)),
    (0x70, "FMessageTrailer6", 6, None, (("010203040506", 1, ["010203040506"]),)),
    (0x71, "N2", 2, "%", (
        ("4000c000", 2, [16384, -16384], [100.0, -100.0]),
        ("7fff80000001", 3, [32767, -32768, 1], [199.993896484375, -200.0, 0.006103515625]),
    )),
    (0x72, "N4", 4, "%", (
        ("4000000080000000", 2, [1073741824, -2147483648], [100.0, -200.0]),
        ("e0000000", 1, [-536870912], [-50.0]),
    )),
    (0x73, "V2", 2, None, (("a5c3", 1, [42435]),)),
    (0x74, "L2", 2, None, (("1234ffff", 2, [4660, 65535]),)),
    (0x75, "R2", 2, None, (("ffff", 1, [65535]),)),
    (0x76, "T2", 2, None, (("ffff", 1, [65535]),)),
    (0x77, "T4", 4, None, (("ffffffff", 1, [4294967295]),)),
    (0x78, "D2", 2, None, (("ffff4000", 2, [-1, 16384]),)),
    (0x79, "E2", 2, None, (
        ("ff8000018000", 3, [-128, 1, -32768], [-1.0, 0.0078125, -256.0]),
    )),
    (0x7A, "C4", 4, None, (
        ("fffe796000000001", 2, [-100000, 1], [-10.0, 0.0001]),
        ("80000000", 1, [-2147483648], [-214748.3648]),
    )),
    (0x7B, "X2", 2, None, (("ffff7fff", 2, [-1, 32767]),)),
    (0x7C, "X4", 4, None, (("ffffffff", 1, [-1]),)),
)  # fmt: skip


def format_rows() -> Iterator[Row]:
    for code, name, size, unit, samples in FORMATS:
        for data, count, values, *scaled in samples:
            yield {
                "format": code,
                "name": name,
                "size": size,
                "unit": unit,
                "raw": data.replace(" ", ""),
                "value_count": count,
                "values": values,
                "scaled": scaled[0] if scaled else None,
            }


# Texts of numbers

Texts = dict[int, tuple[str, ...]]


def sections() -> dict[str, Texts]:
    """message_texts.txt: [section] -> number -> (what the second word says,) English, Chinese."""
    found: dict[str, Texts] = {}
    texts: Texts = {}
    name = ""
    for line in TEXTS.read_text("utf-8").splitlines():
        if line.startswith("["):
            name = line.strip("[]")
            texts = found.setdefault(name, {})
        elif line and not line.startswith("#"):
            numbers, words = line.split(maxsplit=1)
            info = ()
            if name == "profile":
                kind, words = words.split(maxsplit=1)
                info = (kind,)
            english, chinese = words.split(" | ")
            first, _, last = numbers.partition("-")
            for code in range(int(first, 16), int(last or first, 16) + 1):
                above = f"{code - int(first, 16):02X}"
                told = (text.replace("{above}", above) for text in (english, chinese))
                assert code not in texts, f"{name} {code:02X} twice"
                texts[code] = (*info, *told)
    return found


SECTIONS = sections()


def vendor_tables() -> Iterator[tuple[str, int | None, Texts]]:
    """The name, the vendor id where one is known, and the numbers of each [vendor NAME 0xID]."""
    for section, texts in SECTIONS.items():
        if section.startswith("vendor "):
            name, _, number = section.removeprefix("vendor ").partition(" 0x")
            yield name, int(number, 16) if number else None, texts


ANOTHER = 0xFEFE
"""A vendor id that has no table."""
WITHOUT_TABLE = {
    ANOTHER: ("the device", "该设备"), 0x0213: ("Yaskawa", "Yaskawa"), 0x010B: ("Stöber", "Stöber"),
}  # fmt: skip
"""What the maker is called whose manual has the numbers: of an unknown id, of one with a name or a file."""
WIDE = {0x0100, 0x0811, 0x0826, 0xFF02, 0xFFFF}
"""Error numbers beyond a byte, told for everyone: a low byte that the profile knows is no reason."""


def error_rows() -> Iterator[Row]:
    """Every error number as it is told where no vendor is known, for each that has a table, and for others."""
    profile, sinamics = SECTIONS["profile"], SECTIONS["vendor SINAMICS 0x002A"]
    tables: dict[int | None, Texts] = {None: {}}
    tables |= {vendor: own for _, vendor, own in vendor_tables() if vendor is not None}
    for vendor, own in (tables | {number: {} for number in WITHOUT_TABLE}).items():
        for code in sorted({*range(256), *own, *WIDE}):
            shown = f"0x{code:02X}" if code < 0x100 else f"0x{code:04X}"
            english, chinese = f"Manufacturer-specific error {shown}", f"制造商特定错误 {shown}"
            if code in own:
                english, chinese = own[code]
            elif code in profile:
                _, english, chinese = profile[code]
            elif vendor is None and code in sinamics:
                english += f" (SINAMICS: {sinamics[code][0]})"
                chinese += f" (SINAMICS: {sinamics[code][1]})"
            elif vendor in WITHOUT_TABLE and 0x65 <= code <= 0xFF:
                names = WITHOUT_TABLE[vendor]
                english += f": see the manual of {names[0]}, vendor 0x{vendor:04X}"
                chinese += f"：见{names[1]}的手册，制造商 0x{vendor:04X}"
            info = profile[code][0] if code in profile else "unknown"
            yield {"code": code, "vendor_id": vendor, "en": english, "zh": chinese, "info": info}


def vendor_rows() -> Iterator[Row]:
    """The tables of the vendors, also of those whose id is not known."""
    for name, vendor, texts in vendor_tables():
        for code, (english, chinese) in texts.items():
            yield {"vendor": name, "vendor_id": vendor, "code": code, "en": english, "zh": chinese}


def status(value: int, english: str, chinese: str) -> Row:
    return {"status": f"{value:08X}", "en": english, "zh": chinese}


def status_rows() -> Iterator[Row]:
    """A PNIOStatus in words: ErrorCode, ErrorDecode, ErrorCode1, ErrorCode2."""
    code, decode = SECTIONS["status code"], SECTIONS["status decode"]
    yield status(0, "ok", "正常")
    yield status(0xDE80B500, "read: access: state conflict", "读取：访问：状态冲突")
    yield status(0xDF80B700, "write: access: invalid range", "写入：访问：范围无效")
    for number, (english, chinese) in code.items():
        yield status(
            number << 24 | 0x80B000,
            f"{english}: access: invalid index",
            f"{chinese}：访问：索引无效",
        )
    yield status(0x1280B000, "unknown 0x12: access: invalid index", "未知 0x12：访问：索引无效")
    for number, (english, chinese) in SECTIONS["status access"].items():
        yield status(0xDE800000 | number << 8, f"read: {english}", f"读取：{chinese}")
    yield status(0xDE809F00, "read: unknown 0x9F", "读取：未知 0x9F")
    yield status(0xDE80D001, "read: unknown 0xD0: user value 0x01", "读取：未知 0xD0：用户值 0x01")
    yield status(
        0xDF80A7FF, "write: application: busy: user value 0xFF", "写入：应用：忙：用户值 0xFF"
    )
    for number, (english, chinese) in SECTIONS["status protocol"].items():
        yield status(
            0xDB810000 | number << 8, f"connect: protocol: {english}", f"建立连接：协议：{chinese}"
        )
    yield status(0xDB810B00, "connect: protocol: unknown 0x0B", "建立连接：协议：未知 0x0B")
    yield status(
        0xDB810104, "connect: protocol: faulty ARBlockReq: detail 0x04",
        "建立连接：协议：ARBlockReq 有误：细节 0x04",
    )  # fmt: skip
    for number, (english, chinese) in decode.items():
        if number > 0x81:
            yield status(
                0xDE000712 | number << 16, f"read: {english}: 0x07: detail 0x12",
                f"读取：{chinese}：0x07：细节 0x12",
            )  # fmt: skip
    yield status(0xDE7F0000, "read: unknown 0x7F: 0x00", "读取：未知 0x7F：0x00")
    yield status(
        0x00000001, "unknown 0x00: unknown 0x00: 0x00: detail 0x01",
        "未知 0x00：未知 0x00：0x00：细节 0x01",
    )  # fmt: skip


# The file


def dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def text() -> str:
    """The whole file: a line per case."""
    parts = {
        "messages": MESSAGES,
        "formats": list(format_rows()),
        "errors": list(error_rows()),
        "vendors": list(vendor_rows()),
        "statuses": list(status_rows()),
    }
    lines = ['"$schema": "messages.schema.json"', f'"about": {dump(ABOUT)}']
    lines.append(f'"count": {dump({name: len(rows) for name, rows in parts.items()})}')
    for name, rows in parts.items():
        lines.append(f'"{name}": [\n' + ",\n".join(dump(row) for row in rows) + "\n]")
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    target.write_text(text(), "utf-8", newline="\n")
