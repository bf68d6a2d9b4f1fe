"""An interpreter of SCL, as far as the function blocks of `ds47 encode -f scl-fb` use it.

It is strict where TIA Portal is, or stricter: no implicit conversion, no value beyond its type, no temporary
variable read before it is written, no conversion that is not in the list.

The conversions are those that the help of STEP 7 lists under "Explicit conversion", and do what it says:
REAL_TO_DWORD, DWORD_TO_REAL and their like carry the bits over. Nothing is shared with what makes the blocks. What
WRREC and RDREC do is `Records`; what a drive does is not here.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

TOKEN = re.compile(
    r"(?P<space>\s+|//[^\n]*)|(?P<text>'[^']*')|(?P<pragma>\{[^}]*\})"
    r"|(?P<time>T#\d+(?:ms|s))|(?P<hex>16#[0-9A-F]+)|(?P<real>\d+\.\d+(?:e[+-]?\d+)?)|(?P<int>\d+)"
    r"|(?P<local>#\w+)|(?P<name>[A-Za-z_]\w*)|(?P<quoted>\"[^\"]*\")|(?P<slice>%[BW]\d+)"
    r"|(?P<sign>:=|=>|<>|<=|>=|\.\.|[-+*=<>:;,.()\[\]])"
)
INTEGERS = {
    "SInt": (1, True), "USInt": (1, False), "Int": (2, True), "UInt": (2, False),
    "DInt": (4, True), "UDInt": (4, False), "LInt": (8, True), "ULInt": (8, False), "HW_IO": (2, False),
}  # fmt: skip
BITS = {"Byte": 1, "Word": 2, "DWord": 4, "LWord": 8}
REALS = {"Real": ">f", "LReal": ">d"}
PATTERNS = (
    "SInt Byte", "USInt Byte", "Int Word", "UInt Word", "DInt DWord", "UDInt DWord", "LInt LWord", "ULInt LWord",
    "Real DWord", "LReal LWord",
)  # fmt: skip
"""Types that become each other bit by bit."""
NUMERIC = (
    "Int Byte", "Byte Int", "UInt Int", "Int UInt", "UInt DInt", "Real LReal", "SInt LReal", "USInt LReal",
    "Int LReal", "UInt LReal", "DInt LReal", "UDInt LReal",
)  # fmt: skip
"""Types of which the first becomes the second as a number, where it fits."""
LITERALS = ("int", "hex", "real")


class SclError(Exception):
    """The source is no SCL, or does what SCL would not let pass."""


@dataclass(frozen=True)
class Value:
    """A value and its type; constants without a type have the name of their token."""

    type: str
    value: Any


@dataclass
class Variable:
    """A declared variable: its section, its type, bounds of an array, characters of a text, its value."""

    section: str
    type: str
    bounds: tuple[int, int] | None = None
    length: int | None = None
    value: Any = None
    start: Any = None


@dataclass
class Block:
    """A parsed function block."""

    name: str
    variables: dict[str, Variable]
    body: list[Any]
    calls: list[tuple[str, dict[str, tuple[str, Any]]]] = field(default_factory=list)


def tokens(source: str) -> list[tuple[str, str]]:
    """The tokens of a source, comments left out."""
    found, at = [], 0
    while at < len(source):
        match = TOKEN.match(source, at)
        if match is None:
            raise SclError(f"no token: {source[at : at + 30]!r}")
        if match.lastgroup != "space":
            found.append((str(match.lastgroup), match[0]))
        at = match.end()
    return [*found, ("end", "")]


class Parser:
    """A function block, as text, to a `Block`."""

    def __init__(self, source: str) -> None:
        self.tokens = tokens(source)
        self.at = 0
        self.calls: list[tuple[str, dict[str, tuple[str, Any]]]] = []

    # Tokens

    @property
    def here(self) -> str:
        return self.tokens[self.at][1]

    def take(self, *wanted: str) -> str:
        kind, text = self.tokens[self.at]
        if wanted and text not in wanted and kind not in wanted:
            raise SclError(
                f"{' or '.join(wanted)} expected, not {text!r}: {self.tokens[self.at - 8 : self.at + 3]}"
            )
        self.at += 1
        return text

    def comes(self, *wanted: str) -> bool:
        kind, text = self.tokens[self.at]
        if text in wanted or kind in wanted:
            self.at += 1
            return True
        return False

    # Declarations

    def block(self) -> Block:
        self.take("FUNCTION_BLOCK")
        name = self.take("quoted").strip('"')
        self.take("pragma")
        self.take("VERSION")
        self.take(":")
        self.take("real")
        variables: dict[str, Variable] = {}
        while self.here in ("VAR_INPUT", "VAR_OUTPUT", "VAR_IN_OUT", "VAR", "VAR_TEMP"):
            section = self.take()
            section = "CONSTANT" if self.comes("CONSTANT") else section
            while not self.comes("END_VAR"):
                variable, declared = self.declaration(section)
                if variable.lower() in {each.lower() for each in variables}:
                    raise SclError(f"{variable} is declared twice")
                variables[variable] = declared
        self.take("BEGIN")
        body = self.statements("END_FUNCTION_BLOCK")
        self.take("END_FUNCTION_BLOCK")
        self.take("end")
        return Block(name, variables, body, self.calls)

    def declaration(self, section: str) -> tuple[str, Variable]:
        name = self.take("name")
        self.take(":")
        bounds = None
        if self.comes("Array"):
            self.take("[")
            first = int(self.take("int"))
            self.take("..")
            bounds = (first, int(self.take("int")))
            self.take("]")
            self.take("of")
        kind = self.take("name")
        length = None
        if kind == "String":
            self.take("[")
            length = int(self.take("int"))
            self.take("]")
            if not 1 <= length <= 254:
                raise SclError(f"String[{length}]")
        variable = Variable(section, kind, bounds, length)
        start = self.start() if self.comes(":=") else None
        self.take(";")
        if section == "VAR_IN_OUT" and start is not None:
            raise SclError("an InOut has no start value")
        variable.start = start
        return name, variable

    def start(self) -> Any:
        if not self.comes("["):
            return self.constant()
        values: list[Value] = []
        while True:
            if self.tokens[self.at][0] == "int" and self.tokens[self.at + 1][1] == "(":
                count = int(self.take("int"))
                self.take("(")
                values += [self.constant()] * count
                self.take(")")
            else:
                values.append(self.constant())
            if not self.comes(","):
                break
        self.take("]")
        return values

    def constant(self) -> Value:
        sign = -1 if self.comes("-") else 1
        kind, text = self.tokens[self.at]
        self.at += 1
        if text in ("TRUE", "FALSE"):
            return Value("Bool", text == "TRUE")
        if kind == "hex":
            return Value("hex", sign * int(text[3:], 16))
        if kind == "int":
            return Value("int", sign * int(text))
        if kind == "real":
            return Value("real", sign * float(text))
        if kind == "time":
            return Value("Time", int(text[2:].rstrip("ms")) * (1 if text.endswith("ms") else 1000))
        if kind == "text":
            plain = re.sub(r"\$([0-9A-F]{2})", lambda found: chr(int(found[1], 16)), text[1:-1])
            if "$" in re.sub(r"\$[0-9A-F]{2}", "", text):
                raise SclError(f"{text}: $ without a code")
            return Value("String", plain)
        raise SclError(f"no constant: {text!r}")

    # Statements

    def statements(self, *until: str) -> list[Any]:
        found = []
        while self.here not in until and not self._label(until):
            found.append(self.statement())
        return found

    def _label(self, until: tuple[str, ...]) -> bool:
        """Whether a label of CASE comes: values with a colon behind."""
        if "label" not in until:
            return False
        at = self.at
        while self.tokens[at][0] in ("int", "hex", "local"):
            if self.tokens[at + 1][1] == ":":
                return True
            if self.tokens[at + 1][1] != ",":
                return False
            at += 2
        return False

    def statement(self) -> Any:
        if self.comes(";"):
            return ("nothing",)
        made: Callable[[], Any] | None = {
            "IF": self.branch, "CASE": self.case, "FOR": self.loop,
        }.get(self.here)  # fmt: skip
        if made is not None:
            self.take()
            return made()
        if self.comes("EXIT"):
            self.take(";")
            return ("exit",)
        name = self.take("local")
        if self.comes("("):
            return self.call(name[1:])
        target = self.target(name)
        self.take(":=")
        value = self.expression()
        self.take(";")
        return ("assign", target, value)

    def branch(self) -> Any:
        arms = []
        while True:
            condition = self.expression()
            self.take("THEN")
            arms.append((condition, self.statements("ELSIF", "ELSE", "END_IF")))
            if not self.comes("ELSIF"):
                break
        rest = self.statements("END_IF") if self.comes("ELSE") else []
        self.take("END_IF")
        self.take(";")
        return ("if", arms, rest)

    def case(self) -> Any:
        value = self.expression()
        self.take("OF")
        arms = []
        while self._label(("label",)):
            labels = [self.primary()]
            while self.comes(","):
                labels.append(self.primary())
            self.take(":")
            arms.append((labels, self.statements("ELSE", "END_CASE", "label")))
        rest = self.statements("END_CASE") if self.comes("ELSE") else []
        self.take("END_CASE")
        self.take(";")
        return ("case", value, arms, rest)

    def loop(self) -> Any:
        name = self.take("local")[1:]
        self.take(":=")
        first = self.expression()
        self.take("TO")
        last = self.expression()
        self.take("DO")
        body = self.statements("END_FOR")
        self.take("END_FOR")
        self.take(";")
        return ("for", name, first, last, body)

    def call(self, name: str) -> Any:
        given: dict[str, tuple[str, Any]] = {}
        while True:
            parameter = self.take("name")
            way = self.take(":=", "=>")
            if parameter in given:
                raise SclError(f"{parameter} twice")
            given[parameter] = (
                way,
                self.target(self.take("local")) if way == "=>" else self.expression(),
            )
            if not self.comes(","):
                break
        self.take(")")
        self.take(";")
        self.calls.append((name, given))
        return ("call", name, given)

    # Expressions

    def target(self, name: str) -> Any:
        node: Any = ("variable", name[1:])
        while True:
            if self.comes("["):
                node = ("index", node, self.expression())
                self.take("]")
            elif self.here == "." and self.tokens[self.at + 1][0] == "slice":
                self.take()
                part = self.take("slice")
                node = ("slice", node, part[1], int(part[2:]))
            elif self.here == "." and self.tokens[self.at + 1][0] == "name":
                self.take()
                node = ("member", node, self.take("name"))
            else:
                return node

    def expression(self, level: int = 0) -> Any:
        levels = (("OR",), ("AND",), ("=", "<>"), ("<", ">", "<=", ">="), ("+", "-"), ("*", "MOD"))
        if level == len(levels):
            return self.unary()
        left = self.expression(level + 1)
        while self.here in levels[level]:
            sign = self.take()
            left = ("binary", sign, left, self.expression(level + 1))
        return left

    def unary(self) -> Any:
        if self.comes("NOT"):
            return ("not", self.unary())
        return self.primary()

    def primary(self) -> Any:
        kind, text = self.tokens[self.at]
        if self.comes("("):
            inside = self.expression()
            self.take(")")
            return inside
        if kind == "local":
            return self.target(self.take())
        if kind == "name" and text not in ("TRUE", "FALSE"):
            self.take()
            self.take("(")
            arguments: list[tuple[str, Any]] = []
            while True:
                named = self.tokens[self.at + 1][1] == ":="
                name = self.take("name") if named else ""
                if named:
                    self.take(":=")
                arguments.append((name, self.expression()))
                if not self.comes(","):
                    break
            self.take(")")
            return ("function", text, arguments)
        return ("constant", self.constant())


class _Exit(Exception):
    pass


UNSET = object()


class Machine:
    """A function block with its instance data; `call` is one call of it.

    Args:
        block: what is run.
        clock: the time in milliseconds.
        records: what WRREC and RDREC do, by the name of the instance.
    """

    def __init__(
        self, block: Block, clock: Callable[[], int], records: Callable[[str, str], Any]
    ) -> None:
        self.block, self.clock = block, clock
        self.instances: dict[str, Any] = {}
        for name, variable in block.variables.items():
            if variable.type in ("WRREC", "RDREC"):
                self.instances[name] = records(name, variable.type)
            elif variable.type == "TON_TIME":
                self.instances[name] = Timer(clock)
            elif variable.section != "VAR_TEMP":
                variable.value = self._initial(variable)

    def _initial(self, variable: Variable) -> Any:
        if variable.bounds is None:
            return (
                self._fit(variable, variable.start)
                if variable.start is not None
                else zero(variable.type)
            )
        count = variable.bounds[1] - variable.bounds[0] + 1
        if variable.start is None:
            return [zero(variable.type)] * count
        if len(variable.start) != count:
            raise SclError("a start value has another number of elements")
        return [self._fit(variable, each) for each in variable.start]

    def call(self, **inputs: Any) -> None:
        """One call: inputs and InOuts are set first, everything temporary is gone."""
        for name, value in inputs.items():
            variable = self.block.variables[name]
            if variable.section not in ("VAR_INPUT", "VAR_IN_OUT"):
                raise SclError(f"{name} is no input")
            variable.value = value
        for variable in self.block.variables.values():
            if variable.section == "VAR_TEMP":
                variable.value = UNSET
        self.run(self.block.body)

    def __getitem__(self, name: str) -> Any:
        return self.block.variables[name].value

    # Statements

    def run(self, body: list[Any]) -> None:
        for each in body:
            getattr(self, "do_" + each[0])(*each[1:])

    def do_nothing(self) -> None:
        """An empty statement."""

    def do_exit(self) -> None:
        raise _Exit

    def do_assign(self, target: Any, value: Any) -> None:
        self.store(target, self.value(value))

    def do_if(self, arms: list[Any], rest: list[Any]) -> None:
        for condition, body in arms:
            if self.truth(condition):
                self.run(body)
                return
        self.run(rest)

    def do_case(self, chosen: Any, arms: list[Any], rest: list[Any]) -> None:
        value = self.value(chosen)
        if value.type not in INTEGERS:
            raise SclError(f"CASE of {value.type}")
        for labels, body in arms:
            if value.value in [self.value(label).value for label in labels]:
                self.run(body)
                return
        self.run(rest)

    def do_for(self, name: str, first: Any, last: Any, body: list[Any]) -> None:
        start, end = self.value(first), self.value(last)
        self.store(("variable", name), start)
        try:
            for number in range(start.value, end.value + 1):
                self.store(("variable", name), Value("int", number))
                self.run(body)
        except _Exit:
            pass

    def do_call(self, name: str, given: dict[str, tuple[str, Any]]) -> None:
        inputs = {key: self.actual(value) for key, (way, value) in given.items() if way == ":="}
        outputs = self.instances[name].call(**inputs)
        for key, (way, target) in given.items():
            if way == "=>":
                self.store(target, outputs[key])

    def actual(self, node: Any) -> Value:
        """An actual parameter; of an array, the list itself."""
        if node[0] == "variable" and self.block.variables[node[1]].bounds is not None:
            variable = self.block.variables[node[1]]
            return Value(f"Array of {variable.type}", variable.value)
        return self.value(node)

    # Variables

    def store(self, target: Any, value: Value) -> None:
        if target[0] == "slice":
            whole = self.peek(target[1])
            self.put(target[1], self._with(whole, target[2], target[3], value))
        else:
            self.put(target, value)

    def _with(self, whole: Value, width: str, at: int, value: Value) -> Value:
        size = {"B": 1, "W": 2}[width]
        expected = {1: "Byte", 2: "Word"}[size]
        if value.type != expected or (at + 1) * size > BITS[whole.type]:
            raise SclError(f"{value.type} into %{width}{at} of {whole.type}")
        shift = 8 * size * at
        mask = ((1 << 8 * size) - 1) << shift
        return Value(whole.type, (whole.value & ~mask) | (value.value << shift))

    def peek(self, node: Any) -> Value:
        """A bit string that gets a part; what is not set yet begins with zeros."""
        variable = self.block.variables[node[1]]
        return Value(variable.type, 0 if variable.value is UNSET else variable.value)

    def put(self, target: Any, value: Value) -> None:
        node = target[1] if target[0] == "index" else target
        variable = self.block.variables[node[1]]
        if variable.section in ("CONSTANT", "VAR_INPUT"):
            raise SclError(f"{node[1]} is written")
        if target[0] == "index":
            at = self.value(target[2]).value
            if variable.bounds is None or not variable.bounds[0] <= at <= variable.bounds[1]:
                raise SclError(f"{node[1]}[{at}]")
            variable.value[at - variable.bounds[0]] = self._fit(variable, value)
            return
        if variable.bounds is not None:
            raise SclError(f"{node[1]} as a whole")
        variable.value = self._fit(variable, value)

    def _fit(self, variable: Variable, value: Value) -> Any:
        kind = variable.type
        if value.type != kind and not (value.type in LITERALS and fits(value, kind)):
            raise SclError(f"{value.type} {value.value} into {kind}")
        if kind == "String" and len(value.value) > (variable.length or 254):
            raise SclError(f"{value.value!r} into String[{variable.length}]")
        return typed(kind, value.value)

    # Values

    def truth(self, node: Any) -> bool:
        value = self.value(node)
        if value.type != "Bool":
            raise SclError(f"{value.type} as a condition")
        return bool(value.value)

    def value(self, node: Any) -> Value:
        return getattr(self, "of_" + node[0])(*node[1:])

    def of_constant(self, value: Value) -> Value:
        return value

    def of_variable(self, name: str) -> Value:
        variable = self.block.variables[name]
        if variable.value is UNSET:
            raise SclError(f"{name} is read before it is written")
        if variable.bounds is not None:
            raise SclError(f"{name} as a whole")
        return Value(variable.type, variable.value)

    def of_index(self, node: Any, index: Any) -> Value:
        at = self.value(index).value
        if node[0] == "variable" and self.block.variables[node[1]].bounds is not None:
            variable = self.block.variables[node[1]]
            first, last = variable.bounds or (0, 0)
            if not first <= at <= last:
                raise SclError(f"{node[1]}[{at}]")
            return Value(variable.type, variable.value[at - first])
        text = self.value(node)
        if text.type != "String" or not 1 <= at <= len(text.value):
            raise SclError(f"[{at}] of {text}")
        return Value("Char", text.value[at - 1])

    def of_slice(self, node: Any, width: str, at: int) -> Value:
        whole = self.value(node)
        size = {"B": 1, "W": 2}[width]
        if (at + 1) * size > BITS[whole.type]:
            raise SclError(f"%{width}{at} of {whole.type}")
        return Value(
            {1: "Byte", 2: "Word"}[size], whole.value >> 8 * size * at & ((1 << 8 * size) - 1)
        )

    def of_member(self, node: Any, name: str) -> Value:
        return self.instances[node[1]].output(name)

    def of_not(self, node: Any) -> Value:
        return Value("Bool", not self.truth(node))

    def of_binary(self, sign: str, one: Any, other: Any) -> Value:
        left, right = self.value(one), self.value(other)
        kind = right.type if left.type in LITERALS else left.type
        for each in (left, right):
            if each.type != kind and not (each.type in LITERALS and fits(each, kind)):
                raise SclError(f"{left.type} {sign} {right.type}")
        if sign in ("AND", "OR"):
            if kind not in (*BITS, "Bool"):
                raise SclError(f"{sign} of {kind}")
            return Value(
                kind, left.value & right.value if sign == "AND" else left.value | right.value
            )
        if sign in ("+", "-", "*", "MOD"):
            if kind not in (*INTEGERS, "int"):
                raise SclError(f"{sign} of {kind}")
            number = {
                "+": left.value + right.value,
                "-": left.value - right.value,
                "*": left.value * right.value,
            }
            result = left.value % right.value if sign == "MOD" else number[sign]
            return Value(kind, result if kind == "int" else typed(kind, result))
        compare = {
            "=": left.value == right.value, "<>": left.value != right.value, "<": left.value < right.value,
            ">": left.value > right.value, "<=": left.value <= right.value, ">=": left.value >= right.value,
        }  # fmt: skip
        return Value("Bool", compare[sign])

    def of_function(self, name: str, arguments: list[tuple[str, Any]]) -> Value:
        values = {key: self.value(node) for key, node in arguments}
        if name == "MIN":
            first, second = values["IN1"], values["IN2"]
            if first.type != "Int" or second.type not in ("Int", "int"):
                raise SclError("MIN of other types")
            return Value("Int", min(first.value, second.value))
        if name == "CONCAT":
            return Value("String", values["IN1"].value + values["IN2"].value)
        (value,) = values.values()
        if name == "LEN" and value.type == "String":
            return Value("Int", len(value.value))
        return convert(name, value)


def convert(name: str, value: Value) -> Value:
    """A conversion by its name, as `REAL_TO_DWORD`."""
    source, target = name.split("_TO_")
    if value.type.upper() != source:
        raise SclError(f"{name} of {value.type}")
    special = {
        "CHAR_TO_BYTE": lambda: Value("Byte", ord(value.value)),
        "BYTE_TO_CHAR": lambda: Value("Char", chr(value.value)),
        "CHAR_TO_STRING": lambda: Value("String", value.value),
        "BOOL_TO_BYTE": lambda: Value("Byte", int(value.value)),
    }  # fmt: skip
    if name in special:
        return special[name]()
    for pair in PATTERNS:
        first, second = pair.split()
        if (source, target) == (first.upper(), second.upper()):
            return Value(second, int.from_bytes(raw(first, value.value)))
        if (source, target) == (second.upper(), first.upper()):
            return Value(first, unraw(first, value.value.to_bytes(BITS[second])))
    for pair in NUMERIC:
        first, second = pair.split()
        if (source, target) == (first.upper(), second.upper()):
            return Value(
                second, typed(second, float(value.value) if second == "LReal" else value.value)
            )
    raise SclError(f"{name}: no such conversion")


def raw(kind: str, value: Any) -> bytes:
    """The bytes of a number, the highest first."""
    if kind in REALS:
        return struct.pack(REALS[kind], value)
    size, signed = INTEGERS[kind]
    return int(value).to_bytes(size, signed=signed)


def unraw(kind: str, data: bytes) -> Any:
    """A number from its bytes."""
    if kind in REALS:
        return struct.unpack(REALS[kind], data)[0]
    return int.from_bytes(data, signed=INTEGERS[kind][1])


def zero(kind: str) -> Any:
    """What a variable without a start value has."""
    return {"Bool": False, "String": ""}.get(kind, 0.0 if kind in REALS else 0)


def fits(value: Value, kind: str) -> bool:
    """Whether a constant without a type may be of this one."""
    if value.type == "real":
        return kind in REALS
    if kind in BITS:
        return value.type == "hex" and 0 <= value.value < 1 << 8 * BITS[kind]
    return kind in INTEGERS or (value.type == "int" and kind == "int")


def typed(kind: str, value: Any) -> Any:
    """A value of this type. Raises SclError where it does not hold it."""
    if kind in INTEGERS:
        try:
            return unraw(kind, raw(kind, value))
        except OverflowError:
            raise SclError(f"{value} does not fit {kind}") from None
    if kind in BITS and not 0 <= value < 1 << 8 * BITS[kind]:
        raise SclError(f"{value} does not fit {kind}")
    if kind == "Real":
        return struct.unpack(">f", struct.pack(">f", value))[0]
    return value


@dataclass
class Timer:
    """TON."""

    clock: Callable[[], int]
    since: int | None = None
    q: bool = False

    def call(self, **inputs: Value) -> dict[str, Value]:
        if {name: value.type for name, value in inputs.items()} != {"IN": "Bool", "PT": "Time"}:
            raise SclError("TON of other types")
        if not inputs["IN"].value:
            self.since = None
        elif self.since is None:
            self.since = self.clock()
        self.q = self.since is not None and self.clock() - self.since >= inputs["PT"].value
        return {}

    def output(self, name: str) -> Value:
        return {"Q": Value("Bool", self.q)}[name]


@dataclass
class Records:
    """WRREC or RDREC: a job begins with REQ, runs for some calls, and its end is shown in one of them.

    Attributes:
        kind: WRREC or RDREC.
        done: (ID, INDEX, data or MLEN) -> (STATUS, data): the end of a job, asked when it ends.
        lasts: calls of a job in which BUSY is 1.
        edge: whether REQ counts as an edge. Manuals say that 1 starts; a block has to work with both.
    """

    kind: str
    done: Callable[[int, int, Any], tuple[int, bytes]]
    lasts: Callable[[], int]
    edge: bool
    left: int | None = None
    given: Any = None
    before: bool = False
    started: int = 0

    def call(self, **inputs: Value) -> dict[str, Value]:
        request, before = inputs["REQ"].value, self.before
        self.before = request
        wanted = {"REQ": "Bool", "ID": "HW_IO", "INDEX": "DInt", "RECORD": "Array of Byte"}
        wanted["LEN" if self.kind == "WRREC" else "MLEN"] = "UInt"
        if {name: value.type for name, value in inputs.items()} != wanted:
            raise SclError(f"{self.kind} with {inputs}")
        if self.left is None and request and not (self.edge and before):
            self.left, self.given = self.lasts(), self._fixed(inputs)
            self.started += 1
        if self.left is None:
            return self._shown(False, False, False, 0x00700000)
        if self._fixed(inputs) != self.given:
            raise SclError(f"the inputs of {self.kind} change while it runs")
        if self.left:
            self.left -= 1
            return self._shown(False, True, False, 0x00700200)
        return self._end(inputs)

    def _fixed(self, inputs: dict[str, Value]) -> Any:
        length = inputs["LEN" if self.kind == "WRREC" else "MLEN"].value
        record = inputs["RECORD"].value
        if length > len(record):
            raise SclError("RECORD is shorter than its length")
        data = bytes(record[:length]) if self.kind == "WRREC" else b""
        return inputs["ID"].value, inputs["INDEX"].value, length, data

    def _end(self, inputs: dict[str, Value]) -> dict[str, Value]:
        self.left = None
        number, index, length, data = self.given
        status, answer = self.done(number, index, data if self.kind == "WRREC" else length)
        if status:
            return self._shown(False, False, True, status)
        if self.kind == "RDREC":
            inputs["RECORD"].value[: len(answer)] = answer
        return self._shown(True, False, False, 0, len(answer))

    def _shown(
        self, good: bool, busy: bool, error: bool, status: int, length: int = 0
    ) -> dict[str, Value]:
        shown = {
            "BUSY": Value("Bool", busy), "ERROR": Value("Bool", error), "STATUS": Value("DWord", status),
        }  # fmt: skip
        name = "DONE" if self.kind == "WRREC" else "VALID"
        return (
            shown
            | {name: Value("Bool", good)}
            | ({} if self.kind == "WRREC" else {"LEN": Value("UInt", length)})
        )


def parse(source: str) -> Block:
    """The function block of a source."""
    return Parser(source).block()
