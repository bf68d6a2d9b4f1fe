"""Messages as people write them: hexadecimal text, and one readable line per request.

    read ref 3 axis 2 p50303[0]              one element of an array; [0] counts as one
    read p2900 R2902[2]*4 pnu 945[0..3]      without an index: 0 elements; *4 and [0..3]: four elements
    read p1082.description[6]                attributes: .description .text .0x80
    change ref 2 axis 2 p50304=Float32:100.0
    change p922=Unsigned16:1,2 p1=VisibleString:"a b"
    change p50304[0..1] := REAL:10, 5        as many values as the range has elements
    0x51 ref 1 p10                           any other request id

`ref` and `axis` are 1 if not given. The style of reports is understood, too: `DO 2` or `DO2`, `p922[0] (its
name) := `, spaces after commas. A line that begins with DO, axis or ref is a change if it has values, else a
read. `literals` reads formats and values; `build` and `parameter` make messages and bytes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import NamedTuple

from ds47 import spec
from ds47.profidrive import literals
from ds47.profidrive.build import build_request, make_block
from ds47.profidrive.literals import QUOTED
from ds47.profidrive.model import VALUE, Address, Block, Request
from ds47.profidrive.naming import spelling

_PREFIX = re.compile(r"^(?:(DW|D|W|B)?#?16#|0x|\\x|\$)", re.IGNORECASE)
_WIDTH = {"B": 2, "W": 4, "D": 8, "DW": 8}
_TOKEN = re.compile(rf'(?:{QUOTED}|[^\s"])+')
_ADDRESS = r"(?:p|r|pnu)?\d+(?:\.\w+)?(?:\[\d+(?:\.\.\d+)?\])?(?:\*\d+)?(?:\.\w+)?"
_REPORTED = re.compile(
    rf"(?<!\S)({_ADDRESS})(?:\s+\([^()]*\))?(?:\s*:?=\s*|(?=\s|$))", re.IGNORECASE
)
_NEXT = re.compile(r",\s+(?=(?:p|r|pnu)\d)", re.IGNORECASE)
_PNU = re.compile(r"(?<!\S)(p|r|pnu)\s+(?=\d)", re.IGNORECASE)
_COMMA = re.compile(r",\s+")
_PARAMETER = re.compile(
    r"(?:p|r|pnu)?(?P<pnu>\d+)(?:\.(?P<early>\w+))?(?:\[(?P<first>\d+)(?:\.\.(?P<last>\d+))?\])?"
    r"(?:\*(?P<count>\d+))?(?:\.(?P<late>\w+))?(?P<change>=(?P<value>.*))?",
    re.IGNORECASE | re.DOTALL,
)
_FORMAT = re.compile(r"(\w[\w+]*):(.*)", re.DOTALL)
_OPERATIONS = {"read": 0x01, "change": 0x02, "write": 0x02}
_FIELDS = {"ref": "ref", "axis": "axis", "do": "axis"}
_FUSED = re.compile(r"(ref|axis|do)(\d+)", re.IGNORECASE)


def parse_hex(text: str) -> bytes:
    """Bytes from hexadecimal text in the forms that engineers use.

    Takes `03 01 02`, `030102`, `03-01:02`, `0x03,0x01`, `16#0301 W#16#0203`, `03h`, `0301h`, and several
    lines. A number with a prefix has the width of its prefix or of its digits.

    Raises:
        ValueError: a part is not a hexadecimal number, or has an odd number of digits.
    """
    separated = re.sub(r"(?<=.)(?=\\x)", " ", text)
    tokens = [token for token in re.split(r"[\s,;:\[\](){}-]+", separated) if token]
    return b"".join(_hex_token(token) for token in tokens)


def _hex_token(token: str) -> bytes:
    prefix = _PREFIX.match(token)
    digits = token[prefix.end() :] if prefix else token
    digits = digits.replace("_", "")
    if prefix is None and digits[-1:] in ("h", "H"):
        digits = digits[:-1]
    if not re.fullmatch(r"[0-9A-Fa-f]+", digits):
        raise ValueError(f"{token!r} is not a hexadecimal number")
    width = _WIDTH.get((prefix.group(1) or "").upper(), 0) if prefix else 0
    if len(digits) % 2 and (prefix or len(digits) == 1):
        digits = "0" + digits
    if len(digits) % 2:
        raise ValueError(f"{token!r} has an odd number of hexadecimal digits")
    if width and len(digits) > width:
        raise ValueError(f"{token!r} has more digits than its prefix allows")
    return bytes.fromhex(digits.rjust(width, "0"))


class RequestLine(NamedTuple):
    """The request of a line, and what the line left out.

    Attributes:
        request: the complete request.
        axis_given: whether the line names the drive object.
        taken: positions, from 0, of the parameters with a format from the table of parameters.
    """

    request: Request
    axis_given: bool
    taken: tuple[int, ...]


def parse_request_line(text: str) -> Request:
    """The request in a readable line (see the top of this file).

    Raises:
        ValueError: the line cannot be understood, or a value does not fit; the message names the part.
    """
    return read_request_line(text, complete=False).request


def read_request_line(text: str, complete: bool = True) -> RequestLine:
    """`parse_request_line` for people: a value without a format takes the format of a known parameter.

    Args:
        text: the line.
        complete: whether to take formats from the table of parameters.

    Raises:
        ValueError: like `parse_request_line`.
    """
    words = _apart(_tokens(text))
    request_id = None if words and words[0].lower() in _FIELDS else _request_id(words.pop(0))
    tokens = iter(words)
    fields: dict[str, int] = {}
    addresses: list[Address] = []
    blocks: list[Block] = []
    taken = []
    for token in tokens:
        if token.lower() in _FIELDS:
            fields[_FIELDS[token.lower()]] = _number(next(tokens, ""), token)
            continue
        whole = _with_format(token) if complete else token
        if whole != token:
            taken.append(len(addresses))
        address, block = _parameter(whole)
        addresses.append(address)
        blocks += [block] if block else []
    if not addresses:
        raise ValueError("no parameter given, for example: read axis 1 p922")
    if request_id is None:
        request_id = 0x02 if blocks else 0x01
    if len(blocks) != len(addresses) and (blocks or request_id == 0x02):
        raise ValueError("every parameter of a change needs a value, as in p922=Unsigned16:1")
    if request_id == 0x01 and blocks:
        raise ValueError("a read takes no values; use change")
    request = build_request(
        request_id, addresses, blocks, reference=fields.get("ref", 1), axis=fields.get("axis", 1)
    )
    return RequestLine(request, "axis" in fields, tuple(taken))


def _with_format(token: str) -> str:
    """`p2900=10.0` with the format of this parameter; unchanged if it has one, or if that is unknown."""
    match = _PARAMETER.fullmatch(token)
    if not match or not match["value"] or match["early"] or match["late"]:
        return token
    known = _known_format(match)
    if known is None or _FORMAT.fullmatch(match["value"]) or spec.format_named(match["value"]):
        return token
    return f"{_name(match)}={known.name}:{match['value']}"


def _known_format(match: re.Match[str]) -> spec.Format | None:
    """The format of a parameter from the table."""
    known = spec.usual(int(match["pnu"]))
    return spec.format_named(known.type.partition("[")[0]) if known else None


def format_request_line(request: Request, family: str | None = None) -> str:
    """The readable line of a request; `parse_request_line` gives the same bytes again.

    Args:
        request: what to write.
        family: of the drive's parameters; None if no drive is named.

    Raises:
        ValueError: the request cannot be written as a line: truncated, with extra bytes, or with
            unusual padding.
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
        raise ValueError("the request is incomplete")
    names = {code: name for name, code in reversed(_OPERATIONS.items())}
    operation = names.get(request.request_id or 0, f"0x{request.request_id:02X}")
    parts = [operation, f"ref {request.request_reference}", f"axis {request.axis}"]
    for number, address in enumerate(request.addresses):
        parts.append(_show_parameter(address, blocks[number] if blocks else None, family))
    return " ".join(parts)


def _request_id(word: str) -> int:
    known = _OPERATIONS.get(word.lower())
    if known is not None:
        return known
    if not re.fullmatch(r"0x[0-9a-fA-F]{1,2}", word):
        raise ValueError(
            f"{word!r}: a request begins with read, change or a request id such as 0x51"
        )
    return int(word, 16)


def _number(word: str, name: str) -> int:
    try:
        return int(word, 0)
    except ValueError:
        raise ValueError(f"{name} needs a number, not {word!r}") from None


def _tokens(text: str) -> list[str]:
    """The words of a line; a parameter in the style of reports becomes one word."""
    parts = re.split(f"({QUOTED})", text)
    for at in range(0, len(parts), 2):  # between the quoted ones
        separated = _COMMA.sub(",", _NEXT.sub(" ", _PNU.sub(r"\1", parts[at])))
        parts[at] = _REPORTED.sub(_plainly, separated)
    line = "".join(parts)
    if '"' in _TOKEN.sub("", line):
        raise ValueError("a quotation mark is not closed")
    return _TOKEN.findall(line)


def _apart(tokens: Sequence[str]) -> list[str]:
    """The words with `DO3` as `DO`, `3`; at least one."""
    found: list[str] = []
    for token in tokens:
        match = _FUSED.fullmatch(token)
        found += match.groups() if match else (token,)
    return found or [""]


def _plainly(found: re.Match[str]) -> str:
    return found[1] + ("=" if found[0].rstrip().endswith("=") else "")


def _parameter(token: str) -> tuple[Address, Block | None]:
    match = _PARAMETER.fullmatch(token)
    if not match:
        raise ValueError(
            f"{token!r} is not a parameter such as p922, p945[0..3], r2902[2]*4 or p922=Unsigned16:1;"
            " write values without a unit"
        )
    part = match.groupdict()
    if part["early"] and part["late"]:
        raise ValueError(f"{token!r} has two attributes")
    attribute = _attribute(part["early"] or part["late"] or "value")
    block = _block(match) if part["change"] else None
    stated = _stated(match)
    if block is not None and part["last"] and stated != block.value_count:
        raise ValueError(f"{_name(match)} has {stated} elements, but {block.value_count} values")
    indexed = part["first"] is not None or attribute != VALUE
    count = block.value_count if block else int(indexed)
    count = count if stated is None else stated
    return Address(attribute, count, int(part["pnu"]), int(part["first"] or 0)), block


def _name(match: re.Match[str]) -> str:
    """The parameter without its value."""
    return match.string[: match.start("change")] if match["change"] else match.string


def _stated(match: re.Match[str]) -> int | None:
    """The number of elements that the line gives with `[a..b]` or `*n`."""
    if not match["last"]:
        return int(match["count"]) if match["count"] else None
    if match["count"]:
        raise ValueError(f"{_name(match)} gives its number of elements twice")
    count = int(match["last"]) - int(match["first"]) + 1
    if count < 1:
        raise ValueError(f"{_name(match)}: the last index is before the first")
    return count


def _block(match: re.Match[str]) -> Block:
    name, text = _name(match), match["value"]
    given = _FORMAT.fullmatch(text)
    if given is None:
        raise ValueError(_without_format(match))
    try:
        code = literals.format_code(given[1])
        _refuse_comma(match, code, given[2])
        return make_block(code, literals.values(code, given[2]))
    except ValueError as problem:
        raise ValueError(f"{name}: {problem}") from None


def _without_format(match: re.Match[str]) -> str:
    """What is missing in `p1120=10` or `p1120=Float32`, with an example."""
    name, text = _name(match), match["value"]
    if not text:
        return f"{name} has no value, for example {name}=Float32:10.0"
    if spec.format_named(text):
        return f"{name}: the value after the format is missing, for example {name}=Unsigned16:1"
    row = _known_format(match)
    example = "VisibleString" if text.startswith('"') else row.name if row else "Float32"
    return f"{name}: the format of the value is missing, for example {name}={example}:{text}"


def _refuse_comma(match: re.Match[str], code: int, text: str) -> None:
    """Raises ValueError if a decimal comma would give several values, and the line does not say how many."""
    meant, count = literals.as_one_number(code, text), text.count(",") + 1
    if not meant or _stated(match) == count:
        return
    bare = re.sub(r"\[[\d.]+\]|\*\d+", "", _name(match))
    first = int(match["first"] or 0)
    index = "" if match["first"] is None else f"[{first}]"
    form = match["value"].partition(":")[0]
    one = " or ".join(f"{bare}{index}={form}:{number}" for number in meant)
    several = f"{bare}[{first}..{first + count - 1}]={form}:{text}"
    raise ValueError(
        f"{text} can mean one value or {count}: write {one} for one, {several} for {count}"
    )


def _attribute(name: str) -> int:
    for known in spec.attributes().values():
        if known.name == name.lower():
            return known.code
    if not re.fullmatch(r"0x[0-9a-fA-F]{1,2}", name):
        names = ", ".join(known.name for known in spec.attributes().values())
        raise ValueError(f"unknown attribute {name!r}. Accepted: {names}, 0x80")
    return int(name, 16)


def _show_parameter(address: Address, block: Block | None, family: str | None) -> str:
    plain = address.attribute == VALUE
    indexed = address.subindex or (plain and block is None and address.element_count)
    implied = block.value_count if block else int(bool(indexed) or not plain)
    text = spelling(address.pnu, family) + (f"[{address.subindex}]" if indexed else "")
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
