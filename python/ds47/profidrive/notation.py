"""Messages as people write them: hexadecimal text, and one readable line per request.

    read ref 3 axis 2 p50303[0]              one element of an array; [0] counts as one
    read p2900 r2902[2]*4                    without an index: 0 elements; *4: four elements
    read p1082.description[6]                attributes: .description .text .0x80
    change ref 2 axis 2 p50304=Float32:100.0
    change p922=Unsigned16:1,2 p1=VisibleString:"a b"
    0x51 ref 1 p10                           any other request id

`ref` and `axis` are 1 if not given. Bytes and messages are made in `build` and `parameter`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from ds47 import spec
from ds47.profidrive.build import build_request, make_block
from ds47.profidrive.model import VALUE, Address, Block, Request, Value

_PREFIX = re.compile(r"^(?:(DW|D|W|B)?#?16#|0x|\\x|\$)", re.IGNORECASE)
_WIDTH = {"B": 2, "W": 4, "D": 8, "DW": 8}
_TOKEN = re.compile(r'(?:"(?:[^"\\]|\\.)*"|[^\s"])+')
_PARAMETER = re.compile(
    r"[pr]?(\d+)(?:\.(\w+))?(?:\[(\d+)\])?(?:\*(\d+))?(?:\.(\w+))?(?:=(\w[\w+]*):(.*))?",
    re.IGNORECASE | re.DOTALL,
)
_VALUES = re.compile(r'"(?:[^"\\]|\\.)*"|[^,"]+')
_OPERATIONS = {"read": 0x01, "change": 0x02, "write": 0x02}


def parse_hex(text: str) -> bytes:
    """Bytes from hexadecimal text as an engineer has it in hand.

    Takes `03 01 02`, `030102`, `03-01:02`, `0x03,0x01`, `16#0301 W#16#0203` and several lines. A
    number with a prefix has the width of its prefix or of its digits.

    Raises:
        ValueError: something is no hexadecimal number, or an odd digit is left.
    """
    separated = re.sub(r"(?<=.)(?=\\x)", " ", text)
    tokens = [token for token in re.split(r"[\s,;:\[\](){}-]+", separated) if token]
    return b"".join(_hex_token(token) for token in tokens)


def _hex_token(token: str) -> bytes:
    prefix = _PREFIX.match(token)
    digits = token[prefix.end() :] if prefix else token
    digits = digits.replace("_", "")
    if not re.fullmatch(r"[0-9A-Fa-f]+", digits):
        raise ValueError(f"{token!r} is no hexadecimal number")
    width = _WIDTH.get((prefix.group(1) or "").upper(), 0) if prefix else 0
    if len(digits) % 2 and (prefix or len(digits) == 1):
        digits = "0" + digits
    if len(digits) % 2:
        raise ValueError(f"{token!r} has an odd number of hexadecimal digits")
    if width and len(digits) > width:
        raise ValueError(f"{token!r} has more digits than its prefix allows")
    return bytes.fromhex(digits.rjust(width, "0"))


def parse_request_line(text: str) -> Request:
    """The request a readable line describes (see the top of this file).

    Raises:
        ValueError: the line cannot be understood, or a value does not fit; the message says which
            part.
    """
    tokens = iter(_TOKEN.findall(text))
    request_id = _request_id(next(tokens, ""))
    fields = {"ref": 1, "axis": 1}
    addresses: list[Address] = []
    blocks: list[Block] = []
    for token in tokens:
        if token.lower() in fields:
            fields[token.lower()] = _number(next(tokens, ""), token)
            continue
        address, block = _parameter(token)
        addresses.append(address)
        blocks += [block] if block else []
    if not addresses:
        raise ValueError("no parameter given, for example: read axis 1 p922")
    if blocks and len(blocks) != len(addresses):
        raise ValueError("every parameter of a change needs a value, as in p922=Unsigned16:1")
    if request_id == 0x02 and not blocks:
        raise ValueError("a change needs values, as in p922=Unsigned16:1")
    if request_id == 0x01 and blocks:
        raise ValueError("a read has no values; use change")
    return build_request(
        request_id, addresses, blocks, reference=fields["ref"], axis=fields["axis"]
    )


def format_request_line(request: Request) -> str:
    """The readable line of a request; `parse_request_line` gives the same bytes again.

    Raises:
        ValueError: the request cannot be written as a line: cut, with bytes left over, or odd in
            its pads.
    """
    head = (request.request_reference, request.request_id, request.axis)
    blocks = request.blocks
    whole = len(request.addresses) == request.parameter_count
    if (
        None in head
        or request.rest
        or not whole
        or (blocks and len(blocks) != len(request.addresses))
    ):
        raise ValueError("the request is not whole")
    names = {code: name for name, code in reversed(_OPERATIONS.items())}
    operation = names.get(request.request_id or 0, f"0x{request.request_id:02X}")
    parts = [operation, f"ref {request.request_reference}", f"axis {request.axis}"]
    for number, address in enumerate(request.addresses):
        parts.append(_show_parameter(address, blocks[number] if blocks else None))
    return " ".join(parts)


def _request_id(word: str) -> int:
    known = _OPERATIONS.get(word.lower())
    if known is not None:
        return known
    if not re.fullmatch(r"0x[0-9a-fA-F]{1,2}", word):
        raise ValueError(f"{word!r}: a line begins with read, change or a request id such as 0x51")
    return int(word, 16)


def _number(word: str, name: str) -> int:
    try:
        return int(word, 0)
    except ValueError:
        raise ValueError(f"{name} needs a number, not {word!r}") from None


def _parameter(token: str) -> tuple[Address, Block | None]:
    match = _PARAMETER.fullmatch(token)
    if not match:
        raise ValueError(f"{token!r} is no parameter such as p922, r2902[2]*4 or p922=Unsigned16:1")
    pnu, early, index, elements, late, format_name, values = match.groups()
    if early and late:
        raise ValueError(f"{token!r} has two attributes")
    attribute = _attribute(early or late) if early or late else VALUE
    block = None if format_name is None else make_block(_format(format_name), list(_values(values)))
    count = block.value_count if block else int(index is not None or attribute != VALUE)
    count = int(elements) if elements else count
    return Address(attribute, count, int(pnu), int(index or 0)), block


def _attribute(name: str) -> int:
    for known in spec.attributes().values():
        if known.name == name.lower():
            return known.code
    if not re.fullmatch(r"0x[0-9a-fA-F]{1,2}", name):
        raise ValueError(f"unknown attribute {name!r}")
    return int(name, 16)


def _format(name: str) -> int:
    for known in spec.formats().values():
        if known.name.lower() == name.lower():
            return known.code
    if not re.fullmatch(r"0x[0-9a-fA-F]{1,2}|\d{1,3}", name):
        raise ValueError(f"unknown format {name!r}")
    return int(name, 0)


def _values(text: str) -> Iterator[Value]:
    for word in _VALUES.findall(text):
        yield json.loads(word) if word.startswith('"') else word


def _show_parameter(address: Address, block: Block | None) -> str:
    plain = address.attribute == VALUE
    indexed = address.subindex or (plain and block is None and address.element_count)
    implied = block.value_count if block else int(bool(indexed) or not plain)
    text = f"p{address.pnu}" + (f"[{address.subindex}]" if indexed else "")
    text += "" if address.element_count == implied else f"*{address.element_count}"
    text += "" if plain else f".{address.attribute_name}"
    return text if block is None else f"{text}={_show_block(block)}"


def _show_block(block: Block) -> str:
    known = spec.formats().get(block.format)
    values = [json.dumps(v) if isinstance(v, str) else repr(v) for v in block.values]
    try:
        same = make_block(block.format, block.values)
    except ValueError:
        same = None
    if known is None or same is None or (same.raw, same.pad) != (block.raw, block.pad):
        raise ValueError(f"the block at byte {block.offset} cannot be written as values")
    return f"{known.name}:{','.join(values)}"
