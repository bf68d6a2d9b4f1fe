"""The parameters of a request as variables of an SCL block, and the statements that make bytes of them and back.

The block around them, and its words, are `scl`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.profidrive import Address, Block, Request, Value
from ds47.profidrive.model import VALUE
from ds47.profidrive.naming import spelling

LONGEST: Final = 240
"""Bytes of a request and of a response that every drive takes; RECORD of RDREC has so many."""
_BLOCK_AT: Final = 4
_HEAD: Final = 2
_MOST: Final = LONGEST - _BLOCK_AT - _HEAD

VALUES, TEXT, BYTES, NUMBER, CONSTANT = "values", "text", "bytes", "number", "constant"
"""How a field is kept: values of one type, characters, bytes as they come, numbers of any format, in the block."""


class Kind(NamedTuple):
    """A type of SCL: its name, the bit string with the same bits, and how many bytes they are."""

    type: str
    bits: str
    size: int


_OCTET: Final = Kind("Byte", "Byte", 1)
_BITS: Final = {1: "Byte", 2: "Word", 4: "DWord", 8: "LWord"}
_NUMBERS: Final = {
    "b": "SInt", "B": "USInt", "h": "Int", "H": "UInt", "i": "DInt", "I": "UDInt",
    "q": "LInt", "Q": "ULInt", "f": "Real", "d": "LReal",
}  # fmt: skip
_UNTYPED: Final = ("BitString", "V2")
_ANY_BYTES: Final = {
    1: (0x01, 0x02, 0x05, 0x09, 0x0A, 0x16, 0x41),
    2: (0x03, 0x06, 0x17, 0x42),
    4: (0x04, 0x07, 0x08, 0x18, 0x43),
}
"""The formats for raw bytes of an unknown type, by bytes per value."""
_ANY_NUMBER: Final = (
    (Kind("SInt", "Byte", 1), (0x02,)),
    (Kind("USInt", "Byte", 1), (0x05, 0x41)),
    (Kind("Int", "Word", 2), (0x03,)),
    (Kind("UInt", "Word", 2), (0x06, 0x42)),
    (Kind("DInt", "DWord", 4), (0x04,)),
    (Kind("UDInt", "DWord", 4), (0x07, 0x43)),
    (Kind("Real", "DWord", 4), (0x08,)),
)
"""The formats for a number of unknown type, by the type that reads them; LReal holds each exactly."""


@dataclass(frozen=True, slots=True)
class Field:
    """One parameter of a request, as a variable.

    Attributes:
        number: its position in the request, from 1.
        name: of the variable.
        address: which parameter, and how many elements.
        way: one of VALUES, TEXT, BYTES, NUMBER, CONSTANT.
        format: code of the format, None where the drive says it.
        kind: the type of one value, None for characters and bytes.
        count: how many values, characters or bytes there are.
        size: bytes (characters) per value.
        start: the start value, "" without.
        block: what a change carries, None for a read.
    """

    number: int
    name: str
    address: Address
    way: str
    format: int | None
    kind: Kind | None = None
    count: int = 1
    size: int = 1
    start: str = ""
    block: Block | None = None

    @property
    def first(self) -> int:
        """The index of its first value in the variable: the subindex of the parameter."""
        return self.address.subindex if self.way in (VALUES, NUMBER) or self.size > 1 else 0

    @property
    def whole(self) -> bool:
        """Whether the value is one text, of as many characters as it has at the time."""
        row = spec.formats().get(-1 if self.format is None else self.format)
        return self.way == TEXT and row is not None and row.whole

    @property
    def type(self) -> str:
        """The type of the variable, as it is declared."""
        if self.whole:
            return f"String[{self.count}]"
        if self.way == TEXT:
            one = f"String[{self.size}]"
        else:
            one = "LReal" if self.way == NUMBER else self.kind.type if self.kind else "Byte"
        single = self.count == 1 and self.way != BYTES
        return one if single else f"Array[{self.first}..{self.first + self.count - 1}] of {one}"

    @property
    def wide(self) -> bool:
        """Whether it needs 64 bits, which S7-1200 has not."""
        return self.kind is not None and self.kind.size == 8

    @property
    def one(self) -> str:
        """One value of it in a statement; in a loop `#tempIndex` chooses it."""
        return f"#{self.name}" if self.count == 1 or self.whole else f"#{self.name}[#tempIndex]"


def fields(request: Request) -> list[Field]:
    """The parameters of a read or a change, each with a name of its own."""
    found: list[Field] = []
    for number, address in enumerate(request.addresses, 1):
        name = _name(address, [each.name for each in found])
        block = request.blocks[number - 1] if request.blocks else None
        found.append(
            _asked(number, name, address)
            if block is None
            else _written(number, name, address, block)
        )
    return found


def _name(address: Address, taken: Sequence[str]) -> str:
    number = spelling(address.pnu)
    # No name of a variable begins with a digit.
    name = number if number[0].isalpha() else f"p{number}"
    name += f"_{address.subindex}" if address.subindex else ""
    name += "" if address.attribute == VALUE else f"_{address.attribute_name.capitalize()}"
    while name in taken:
        name += "_b"
    return name


# What a change carries


def _written(number: int, name: str, address: Address, block: Block) -> Field:
    row = spec.formats().get(block.format)
    kind = None if row is None else kind_of(row)
    if kind is not None and kind.type == "Bool" and not {0, 1}.issuperset(block.values):
        kind = _OCTET
    count = block.value_count
    base = Field(number, name, address, CONSTANT, block.format, block=block)
    if row is None or block.meaning is not None or not block.raw or not _finite(block.values):
        return base
    if row.kind == "text":
        size = 1 if row.whole else row.size or 1
        start = _texts(block, size, row.whole)
        return Field(number, name, address, TEXT, block.format, None, count, size, start, block)
    if kind is None:
        start = _list(f"16#{byte:02X}" for byte in block.raw)
        return Field(
            number, name, address, BYTES, block.format, None, len(block.raw), 1, start, block
        )
    literals = [_literal(value, kind) for value in block.values]
    start = literals[0] if count == 1 else _list(literals)
    return Field(number, name, address, VALUES, block.format, kind, count, kind.size, start, block)


def kind_of(row: spec.Format) -> Kind | None:
    """The type of SCL for a format; None where it is kept as bytes."""
    size = row.size
    if (
        row.whole
        or size not in _BITS
        or row.kind not in ("number", "float", "date", "time_of_day", "duration")
    ):
        return None
    bits = _BITS[size]
    if row.name == "Boolean":
        return Kind("Bool", bits, size)
    if row.plc in ("BYTE", "WORD", "DWORD") or row.name.startswith(_UNTYPED):
        return Kind(bits, bits, size)
    return Kind(_NUMBERS[row.pack] if row.pack else "UDInt", bits, size)


def _finite(values: Iterable[Value]) -> bool:
    """Whether each value can be a start value: SCL has no constant for the others."""
    return not any(isinstance(each, float) and not math.isfinite(each) for each in values) and not (
        {"NaN", "Infinity", "-Infinity"} & {each for each in values if isinstance(each, str)}
    )


def _literal(value: Value, kind: Kind) -> str:
    if kind.type == "Bool":
        return "TRUE" if int(value) else "FALSE"
    if kind.type in _BITS.values():
        return f"16#{int(value):0{2 * kind.size}X}"
    if kind.type in ("Real", "LReal"):
        text = repr(float(value))
        return text if "." in text else text.replace("e", ".0e")
    return str(int(value))


def _texts(block: Block, size: int, whole: bool) -> str:
    raw = block.raw
    parts = [raw] if whole else [raw[at : at + size] for at in range(0, len(raw), size)]
    literals = [_quoted(part) for part in parts]
    return literals[0] if len(literals) == 1 else _list(literals)


def _quoted(text: bytes) -> str:
    """Characters as SCL writes them: a dollar sign, an apostrophe and what is not ASCII by its code."""
    plain = (
        chr(byte) if 0x20 <= byte < 0x7F and byte not in b"$'" else f"${byte:02X}" for byte in text
    )
    return f"'{''.join(plain)}'"


def _list(parts: Iterable[str]) -> str:
    return f"[{', '.join(parts)}]"


# What a read asks for


def _asked(number: int, name: str, address: Address) -> Field:
    elements = address.element_count
    known = spec.usual(address.pnu) if address.attribute == VALUE else None
    row = spec.format_named(known.type.partition("[")[0]) if known else None
    if address.attribute != VALUE:
        return Field(number, name, address, BYTES, None, None, _MOST)
    if row is None:
        return Field(number, name, address, NUMBER, None, None, max(elements, 1), 4)
    if row.kind == "text" and row.whole:
        return Field(number, name, address, TEXT, row.code, None, elements or _MOST)
    kind = kind_of(row)
    if kind is None:
        bytes_ = (row.size or 1) * elements if elements else _MOST
        return Field(number, name, address, BYTES, row.code, None, min(bytes_, _MOST))
    return Field(number, name, address, VALUES, row.code, kind, max(elements, 1), kind.size)


# Statements


def addressing(field: Field) -> list[str]:
    """The six bytes of its parameter address."""
    address, at = field.address, _BLOCK_AT + 6 * (field.number - 1)
    spoken = field.whole and field.block is not None and address.element_count == field.count
    elements = f"INT_TO_BYTE(LEN(#{field.name}))" if spoken else f"16#{address.element_count:02X}"
    texts = (
        f"16#{address.attribute:02X}",
        elements,
        *_word(address.pnu),
        *_word(address.subindex),
    )
    return [f"#statRequest[{at + number}] := {text};" for number, text in enumerate(texts)]


def _word(value: int) -> tuple[str, str]:
    return f"16#{value >> 8:02X}", f"16#{value & 0xFF:02X}"


def writing(field: Field) -> list[str]:
    """Statements that put its value block at `#tempAt` of the request."""
    block = field.block
    assert block is not None
    if field.way == CONSTANT:
        raw = bytes((block.format, block.value_count)) + block.raw + block.pad
        return [*_constants(raw), f"#tempAt := #tempAt + {len(raw)};"]
    count = f"INT_TO_BYTE(LEN(#{field.name}))" if field.whole else f"16#{block.value_count:02X}"
    lines = [
        f"#statRequest[#tempAt] := 16#{block.format:02X};",
        f"#statRequest[#tempAt + 1] := {count};",
        f"#tempAt := #tempAt + {_HEAD};",
    ]
    if field.whole:
        lines += _loop(
            "#tempChar",
            "1",
            f"LEN(#{field.name})",
            _one_byte(f"CHAR_TO_BYTE(#{field.name}[#tempChar])"),
        )
        return [
            *lines,
            f"IF LEN(#{field.name}) MOD 2 = 1 THEN",
            *_in(_one_byte("16#00")),
            "END_IF;",
        ]
    body = list(_store(field))
    if field.count == 1 and field.way != BYTES:
        lines += body
    else:
        lines += _loop("#tempIndex", str(field.first), str(field.first + field.count - 1), body)
    return [*lines, *(_one_byte("16#00") if block.pad else ())]


def _constants(raw: bytes) -> Iterator[str]:
    for at, byte in enumerate(raw):
        yield f"#statRequest[#tempAt{f' + {at}' if at else ''}] := 16#{byte:02X};"


def _store(field: Field) -> Iterator[str]:
    """One value into the request."""
    if field.way == TEXT:
        character = [
            "IF #tempChar <= LEN({0}) THEN",
            "   #tempByte := CHAR_TO_BYTE({0}[#tempChar]);",
        ]
        body = [
            *(line.format(field.one) for line in character),
            "ELSE",
            "   #tempByte := 16#20;",
            "END_IF;",
        ]
        yield from _loop("#tempChar", "1", str(field.size), [*body, *_one_byte("#tempByte")])
        return
    kind = field.kind
    if kind is None:
        yield from _one_byte(f"#{field.name}[#tempIndex]")
        return
    value = (
        field.one
        if kind.type == kind.bits
        else f"{kind.type.upper()}_TO_{kind.bits.upper()}({field.one})"
    )
    if kind.size == 1:
        yield from _one_byte(value)
        return
    yield f"#temp{kind.bits} := {value};"
    for at in range(kind.size):
        yield f"#statRequest[#tempAt{f' + {at}' if at else ''}] := #temp{kind.bits}.%B{kind.size - 1 - at};"
    yield f"#tempAt := #tempAt + {kind.size};"


def _one_byte(value: str) -> list[str]:
    return [f"#statRequest[#tempAt] := {value};", "#tempAt := #tempAt + 1;"]


def _loop(variable: str, first: str, last: str, body: Iterable[str]) -> list[str]:
    return [f"FOR {variable} := {first} TO {last} DO", *_in(body), "END_FOR;"]


def _in(lines: Iterable[str]) -> list[str]:
    return [f"   {line}" for line in lines]


def _taken(field: Field) -> list[int]:
    """The formats that a response may have: the known one, and the one that says its length only (41 to 43)."""
    plain = {1: 0x41, 2: 0x42, 4: 0x43}.get(_bytes_per_value(field))
    return [code for code in dict.fromkeys((field.format, plain)) if code is not None]


def reading(field: Field) -> list[str]:
    """Statements that take its values out of the response, from `#tempAt` on.

    `#tempFormat` and `#tempCount` are those of the block, and `#tempSize` becomes the bytes per value: 0 says
    that the block is none of this field.
    """
    lines = _sizes(field)
    least = "#tempCount < 0" if field.way in (TEXT, BYTES) else f"#tempCount < {field.count}"
    lines += [
        f"IF #tempSize = 0 OR {least} OR #tempAt + #tempSize * #tempCount > #tempEnd THEN",
        "   #failure := #FAIL_CONTENT;",
        "   EXIT;",
        "END_IF;",
    ]
    if field.format is None:
        lines.append(f"#{field.name}Format := #tempFormat;")
    if field.way == TEXT:
        return [*lines, *_read_text(field)]
    if field.way == BYTES:
        return [*lines, *_read_bytes(field)]
    body = list(_fetch(field))
    if field.count == 1:
        return [*lines, "#tempPlace := #tempAt;", *body]
    last = str(field.first + field.count - 1)
    return [*lines, "#tempPlace := #tempAt;", *_loop("#tempIndex", str(field.first), last, body)]


def _bytes_per_value(field: Field) -> int:
    row = spec.formats().get(-1 if field.format is None else field.format)
    return (row.size if row else None) or 1


def _sizes(field: Field) -> list[str]:
    known = {_bytes_per_value(field): _taken(field)}
    sizes = _any_sizes(field) if field.format is None else known
    return _chain({size: [f"#tempSize := {size};"] for size in sizes}, sizes, ["#tempSize := 0;"])


def _chain(
    bodies: Mapping[Any, Iterable[str]],
    codes: Mapping[Any, Sequence[int]],
    rest: Sequence[str] = (),
) -> list[str]:
    """IF, ELSIF and so on: statements by the formats for which they are."""
    lines: list[str] = []
    for key, body in bodies.items():
        lines += [f"{'ELSIF' if lines else 'IF'} {_is_one_of(codes[key])} THEN", *_in(body)]
    return [*lines, *(["ELSE", *_in(rest)] if rest else []), "END_IF;"]


def _any_sizes(field: Field) -> Mapping[int, Sequence[int]]:
    """The formats for an unknown type, by their bytes per value."""
    if field.way != NUMBER:
        return _ANY_BYTES
    sizes: dict[int, list[int]] = {}
    for kind, codes in _ANY_NUMBER:
        sizes.setdefault(kind.size, []).extend(codes)
    return sizes


def _is_one_of(codes: Iterable[int]) -> str:
    return " OR ".join(f"#tempFormat = 16#{code:02X}" for code in codes)


def _read_text(field: Field) -> list[str]:
    character = "CHAR_TO_STRING(BYTE_TO_CHAR(#statResponse[#tempAt + #tempIndex]))"
    one = f"#{field.name} := CONCAT(IN1 := #{field.name}, IN2 := {character});"
    return [
        f"#{field.name} := '';",
        *_loop("#tempIndex", "0", f"MIN(IN1 := #tempCount, IN2 := {field.count}) - 1", [one]),
    ]


def _read_bytes(field: Field) -> list[str]:
    length = f"#{field.name}Length"
    return [
        f"{length} := MIN(IN1 := #tempSize * #tempCount, IN2 := {field.count});",
        *_loop(
            "#tempIndex",
            "0",
            f"{length} - 1",
            [f"#{field.name}[#tempIndex] := #statResponse[#tempAt + #tempIndex];"],
        ),
    ]


def _fetch(field: Field) -> Iterator[str]:
    """One value out of the response, from `#tempPlace` on."""
    if field.way == NUMBER:
        value = f"{field.one} := {{}}_TO_LREAL({{}});"
        bodies = {
            kind: [*_bits_of(kind), value.format(kind.type.upper(), _typed(kind))]
            for kind, _ in _ANY_NUMBER
        }
        yield from _chain(bodies, dict(_ANY_NUMBER))
        if field.count > 1:
            yield "#tempPlace := #tempPlace + #tempSize;"
        return
    kind = field.kind
    assert kind is not None
    yield from _bits_of(kind)
    yield f"{field.one} := {_typed(kind)};"
    if field.count > 1:
        yield f"#tempPlace := #tempPlace + {kind.size};"


def _bits_of(kind: Kind) -> Iterator[str]:
    if kind.size == 1:
        yield "#tempByte := #statResponse[#tempPlace];"
        return
    for at in range(kind.size):
        index = f"#tempPlace{f' + {at}' if at else ''}"
        yield f"#temp{kind.bits}.%B{kind.size - 1 - at} := #statResponse[{index}];"


def _typed(kind: Kind) -> str:
    """The bits in their type."""
    bits = f"#temp{kind.bits}"
    if kind.type == "Bool":
        return f"{bits} <> 16#00"
    return bits if kind.type == kind.bits else f"{kind.bits.upper()}_TO_{kind.type.upper()}({bits})"
