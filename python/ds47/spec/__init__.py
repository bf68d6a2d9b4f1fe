"""The protocol tables as Python objects: lazy, cached loading of spec/*.toml and lookup.

All tables live in the TOML files. Nothing is decoded here. The limits and the state table of pairing are
in `ds47.spec.semantics`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from json import loads
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, cast
from zlib import crc32

from ds47.spec.rows import Row

Operation = Literal["read", "change", "vendor", "unknown", "get", "put", "bsend", "usend"]
"""What a transaction is asked for; the last four are those of S7."""
Severity = Literal["note", "warning", "error"]
"""How serious a finding is."""


class Format(Row):
    """One format code of a value block (docs/protocol.md A.6; formats.toml has the kinds)."""

    code: int
    name: str
    kind: str
    size: int | None = None
    """Bytes per value; None where no source gives a size."""
    pack: str = ""
    whole: bool = False
    other_size: int | None = None
    multiply: int | None = None
    divide: int | None = None
    unit: str | None = None
    """Unit of the scaled value."""
    confirmed: bool = True
    note: str | None = None
    plc: str | None = None
    """The name of the type in a PLC (IEC 61131-3)."""
    wireshark: str | None = None
    """The name in Wireshark's own dissector, None where it is `name`."""


class Attribute(Row):
    """One attribute of a parameter address (docs/protocol.md A.4)."""

    code: int
    name: str
    zh: str


class RequestId(Row):
    """One request id with its response ids (docs/protocol.md A.3)."""

    code: int
    name: str
    operation: Operation
    body: str
    positive: int
    negative: int
    vendor: bool


class ResponseId(Row):
    """One response id (docs/protocol.md A.3); `negative` is None where the id does not say."""

    code: int
    name: str
    body: str
    vendor: bool
    negative: bool | None = None


class ErrorNumber(Row):
    """One error number, or a range of them up to `last` (docs/protocol.md B).

    `info` says what error value 2 means: "none", "subindex" or "unknown".
    """

    code: int
    en: str
    zh: str
    info: str = "unknown"
    last: int | None = None
    zh_from: str | None = None


class Vendor(Row):
    """What a maker's drives have of their own (makers/*.toml); `id` is its PROFINET vendor id, None if unknown."""

    name: str
    id: int | None
    errors: Mapping[int, ErrorNumber]
    also: tuple[str, ...] = ()
    """Other names."""
    ids: tuple[int, ...] = ()
    """Further ids."""
    pkw: Mapping[int, ErrorNumber] = MappingProxyType({})
    """Error numbers of PKW."""
    by_subindex: frozenset[int] = frozenset()
    """PNUs whose subindex is the number of a parameter of the drive."""


class StatusTexts(Row):
    """The words of a PNIOStatus (docs/protocol.md E.5), per language."""

    code: Mapping[int, str]
    decode: Mapping[int, str]
    access: Mapping[int, str]
    """ErrorCode1 where ErrorDecode is 0x80, record access."""
    protocol: Mapping[int, str]
    """ErrorCode1 where ErrorDecode is 0x81, the PNIO protocol machine."""
    words: Mapping[str, str]


class Pnu(Row):
    """A well-known parameter (docs/protocol.md D; parameters.toml, drives.toml).

    `volatile`: the drive itself changes the value, so a readback that differs from what was written is
    not a finding. `family` names the drives that use the number in this meaning; "profile" means all.
    """

    number: int
    name_en: str
    name_zh: str
    type: str
    unit: str | None
    volatile: bool
    family: str
    access: str | None = None
    """"p" can be written, "r" is read-only; None if that is unknown, or if drives differ."""
    connects: str | None = None
    """The value says where a signal comes from: "bit" (binector input) or "index" (connector input)."""
    buffer: str | None = None
    """It is a buffer of "faults" or "alarms", with eight entries for each situation."""
    entry: tuple[str, str] | None = None
    """The column of the "faults" or "alarms" buffer that it holds: "number", "code", "time", "value" or "gone"."""
    messages: str | None = None
    """Its values are message numbers, looked up first among faults ("F") or alarms ("A")."""
    values_en: Mapping[int, str] = MappingProxyType({})
    values_zh: Mapping[int, str] = MappingProxyType({})
    """The known meanings of values."""
    sources: tuple[str, ...] = ()
    """Where it was read: keys of `parameter_sources`."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _row, (self.number, self.family)  # another process has the same tables


class InstructionParameter(Row):
    """A parameter of an instruction of S7-1200 and S7-1500 (instructions.toml).

    `declaration` is Input, Output or InOut; `sources` are keys of the table of sources there.
    """

    name: str
    declaration: str
    type: str
    sources: tuple[str, ...]


def _whole_place(place: Mapping[str, Any]) -> dict[str, Any]:
    return {key: place.get(key) for key in ("slot", "subslot", "index")}


class Rule(Row):
    """One rule of the catalogue (spec/rules.toml says what each field means)."""

    id: str
    name: str
    title: str
    severity: Severity
    scope: str
    anchor: str
    expert: str
    message: str
    cause: str
    advice: str
    title_zh: str
    message_zh: str
    cause_zh: str
    advice_zh: str
    analyzer_only: bool = False
    changed: tuple[str, ...] = ()
    many: str = ""
    many_zh: str = ""
    brief: str = ""
    brief_zh: str = ""
    group: tuple[str, ...] = ()
    args: Mapping[str, str] = MappingProxyType({})

    def carried(self, args: Mapping[str, Any]) -> dict[str, Any]:
        """All its arguments, in their order; None for an unknown one.

        The same goes for the keys of a place: places of PROFIBUS have no subslot.
        """
        return {
            name: _whole_place(args[name]) if kind == "place" and args.get(name) else args.get(name)
            for name, kind in self.args.items()
        }

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of its arguments that are frames."""
        return tuple(name for name, kind in self.args.items() if kind in ("frame", "frames"))

    def named_frames(self, args: Mapping[str, Any]) -> list[int]:
        """The frames in these arguments, sorted, each once."""
        found: set[int] = set()
        for name in self.frames:
            value = args.get(name)
            if value is not None:
                found.update(value if isinstance(value, list) else (value,))
        return sorted(found)


@cache
def _load(name: str) -> dict[str, Any]:
    """The content of one of the TOML files beside this one."""
    text = _content(name)
    key = f"{name} {crc32(text):08x}"
    line = _ready().get(key)
    return loads(line)[key] if line else _parsed(text)


@cache
def _ready() -> dict[str, bytes]:
    """The files as JSON, because TOML is slow to parse: one line each, by file name and checksum.

    The installation writes them (hatch_build.py). A file that has changed since is parsed.
    """
    try:
        lines = _content("tables.ndjson").splitlines()
    except OSError:
        return {}
    return {line.split(b'"', 2)[1].decode(): line for line in lines}


def _parsed(text: bytes) -> dict[str, Any]:
    import tomllib

    return tomllib.loads(text.decode("utf-8"))


def _content(name: str) -> bytes:
    """The loader also reads from a zip file; `importlib.resources` does too, but is slow to import."""
    loader: Any = __spec__.loader
    return cast(bytes, loader.get_data(str(Path(__file__).parent / name)))


@cache
def makers() -> tuple[Mapping[str, Any], ...]:
    """The files of makers (makers/*.toml), first that of the usual one: a file that is added is one of them."""
    folder = Path(__file__).with_name("makers")
    names = [f"makers/{each.name}" for each in folder.glob("*.toml")] if folder.is_dir() else []
    names = names or [
        key.split()[0] for key in _ready() if key.startswith("makers/")
    ]  # in a zip file
    return tuple(sorted(map(_load, sorted(names)), key=lambda row: "usual" not in row))


def _rows(table: str) -> list[dict[str, Any]]:
    """The rows of a table of ids.toml, and those that makers add."""
    more = (row for maker in makers() for row in maker.get(table, ()))
    return [*_load("ids.toml").get(table, ()), *more]


@cache
def formats() -> Mapping[int, Format]:
    """All named format codes."""
    return MappingProxyType({row["code"]: Format(**row) for row in _load("formats.toml")["format"]})


@cache
def _format_names() -> Mapping[str, Format]:
    """Formats by each of their names, in lower case; our own names win."""
    rows = formats().values()
    named = [(name, row) for row in rows for name in (row.wireshark, row.plc) if name]
    return {name.lower(): row for name, row in [*named, *((row.name, row) for row in rows)]}


@lru_cache(maxsize=1024)
def format_named(name: str) -> Format | None:
    """The format of that name: ours, Wireshark's or a PLC's (REAL), in any case; None if there is none."""
    return _format_names().get(name.lower())


@cache
def dialect(name: str) -> Mapping[int, int]:
    """Format codes of a dialect -> the code of `formats()` with the same meaning.

    Raises:
        KeyError: there is no dialect of that name.
    """
    tables = {row["name"]: dict(row["codes"]) for row in _load("formats.toml")["dialect"]}
    return MappingProxyType(tables[name])


@cache
def attributes() -> Mapping[int, Attribute]:
    """The named attributes of the profile."""
    return MappingProxyType(
        {row["code"]: Attribute(**row) for row in _load("ids.toml")["attribute"]}
    )


@cache
def vendor_attributes() -> frozenset[int]:
    """The attributes that the profile leaves to manufacturers, and those that one of them has besides."""
    return frozenset(_load("ids.toml")["vendor_attributes"]).union(maker_attributes())


@cache
def maker_attributes() -> Mapping[int, tuple[tuple[str, Attribute], ...]]:
    """The attributes of makers, each with the names of those that have it."""
    found: dict[int, tuple[tuple[str, Attribute], ...]] = {}
    for maker in makers():
        for row in maker.get("attribute", ()):
            found[row["code"]] = (*found.get(row["code"], ()), (maker["name"], Attribute(**row)))
    return MappingProxyType(found)


@cache
def request_ids() -> Mapping[int, RequestId]:
    """The request ids, standard and vendor."""
    return MappingProxyType({row["code"]: RequestId(**row) for row in _rows("request")})


@cache
def response_ids() -> Mapping[int, ResponseId]:
    """The response ids, standard and vendor."""
    return MappingProxyType({row["code"]: ResponseId(**row) for row in _rows("response")})


def _error_rows(rows: list[dict[str, Any]]) -> Mapping[int, ErrorNumber]:
    table: dict[int, ErrorNumber] = {}
    for row in rows:
        error = ErrorNumber(**row)
        table.update(dict.fromkeys(range(error.code, (error.last or error.code) + 1), error))
    return MappingProxyType(table)


@cache
def errors() -> Mapping[int, ErrorNumber]:
    """The error numbers of the profile."""
    return _error_rows(_load("errors.toml")["error"])


@cache
def vendors() -> tuple[Vendor, ...]:
    """The makers with a file of their own, first the one hinted at where a device does not say whose it is."""
    return tuple(
        Vendor(
            name=row["name"], id=row.get("id"), errors=_error_rows(row.get("error", [])),
            ids=tuple(row.get("ids", ())), pkw=_pkw(row),
            also=tuple(row.get("also", ())), by_subindex=frozenset(row.get("by_subindex", ())),
        )
        for row in makers()
    )  # fmt: skip


def _pkw(row: Mapping[str, Any]) -> Mapping[int, ErrorNumber]:
    """The numbers of PKW: of the table of the maker those that it has too, and its own."""
    same = [each for each in row.get("error", ()) if each["code"] in row.get("also_pkw", ())]
    return _error_rows([*same, *row.get("pkw", ())])


@cache
def vendor(vendor_id: int) -> Vendor | None:
    """The maker with this PROFINET vendor id; None where it has no file."""
    return next((each for each in vendors() if vendor_id in (each.id, *each.ids)), None)


def _words(error: ErrorNumber, code: int, lang: str) -> str:
    return error.text(lang).format(code=error_hex(code), above=code - error.code)


def error_hex(code: int) -> str:
    """An error number as people write it: `0x11`, and above one byte `0x0811`."""
    return f"0x{code:02X}" if code <= 0xFF else f"0x{code:04X}"


MAKERS: Final = range(0x65, 0x100)
"""The one-byte error numbers that belong to the maker, not to the profile."""


@lru_cache(maxsize=4096)
def error_text(code: int | None, lang: str = "en", vendor_id: int | None = None) -> str:
    """What an error number means, in words (docs/protocol.md B).

    Args:
        code: error value 1, 0..0xFFFF; the text for None is empty.
        lang: "en" or "zh"; anything else gives English.
        vendor_id: PROFINET vendor id of the device. Numbers from 0x65 on belong to the vendor.
            Without an id the text gives the meaning on SINAMICS, marked as such. For a vendor without
            a table it gives no meaning.
    """
    if code is None:
        return ""
    maker = vendor(vendor_id) if vendor_id is not None else None
    if maker and code in maker.errors:
        return _words(maker.errors[code], code, lang)
    if code in errors():
        return _words(errors()[code], code, lang)
    text = error_fallback(error_hex(code), lang)
    if in_manual(code, vendor_id):
        return text + of_maker(vendor_id or 0, lang)
    hint = vendors()[0].errors.get(code) if vendor_id is None else None
    return f"{text} ({vendors()[0].name}: {_words(hint, code, lang)})" if hint else text


def error_fallback(code: str, lang: str) -> str:
    """The words for a number of the maker that no table explains."""
    return str(_load("errors.toml")["fallback"]["zh" if lang == "zh" else "en"]).format(code=code)


def in_manual(code: int | None, vendor_id: int | None) -> bool:
    """Whether a number is one of a maker without a table: its manual says what it means."""
    if code not in MAKERS or vendor_id is None or vendor_id <= 0:
        return False
    maker = vendor(vendor_id)
    return maker is None or not maker.errors


def of_maker(vendor_id: int, lang: str) -> str:
    """What follows such a number: the maker whose manual explains it."""
    return _with_maker("of_maker", "", vendor_id, lang)


def manual_of(code: int, vendor_id: int, lang: str) -> str:
    """The advice to look such a number up, and where."""
    return _with_maker("in_manual", error_hex(code), vendor_id, lang)


@cache
def vendor_names() -> Mapping[int, str]:
    """The name of each PROFINET vendor id that is known. Most captures need none of them."""
    listed = {number: name for name, ids in _load("vendors.toml")["ids"].items() for number in ids}
    own = {number: each.name for each in vendors() for number in (each.id, *each.ids)}
    return listed | {number: name for number, name in own.items() if number is not None}


def called(vendor_id: int, lang: str) -> str:
    """`Yaskawa`, or `the device` where nobody knows whose the id is."""
    of_none: Mapping[str, str] = _load("errors.toml")["no_maker"]
    return vendor_names().get(vendor_id) or of_none["zh" if lang == "zh" else "en"]


def _with_maker(key: str, code: str, vendor_id: int, lang: str) -> str:
    text = str(_load("errors.toml")[key]["zh" if lang == "zh" else "en"])
    return text.format(code=code, maker=called(vendor_id, lang), vendor=f"0x{vendor_id:04X}")


def error_info_meaning(code: int) -> str:
    """What error value 2 means for an error number: "none", "subindex" or "unknown"."""
    error = errors().get(code)
    return error.info if error else "unknown"


@cache
def status(lang: str = "en") -> StatusTexts:
    """The words of a PNIOStatus in a language ("en" or "zh"; anything else gives English)."""
    table = _load("status.toml")
    key = "zh" if lang == "zh" else "en"

    def column(name: str) -> Mapping[int, str]:
        words: dict[int, str] = {}
        for row in table[name]:
            words.update(
                dict.fromkeys(range(row["code"], row.get("last", row["code"]) + 1), row[key])
            )
        return MappingProxyType(words)

    return StatusTexts(
        code=column("error_code"),
        decode=column("error_decode"),
        access=column("access"),
        protocol=column("protocol"),
        words=MappingProxyType(table["words"][key]),
    )


SINAMICS, MICROMASTER = "sinamics", "micromaster"
FAMILIES: Mapping[str, tuple[str, ...]] = {
    SINAMICS: (SINAMICS, "sinamics-dcm", "siemens", "encoder", "profile"),
    MICROMASTER: (MICROMASTER, "siemens", "profile"),
    "profile": ("profile",),
}
"""The rows that apply to a drive of a family, the most specific first."""


@cache
def parameters() -> Mapping[int, Mapping[str, Pnu]]:
    """The well-known parameters by number, then by family: families use the same number differently."""
    table: dict[int, dict[str, Pnu]] = {}
    for row in (*_load("parameters.toml")["parameter"], *_load("drives.toml")["parameter"]):
        for number in range(row["number"], row.get("last", row["number"]) + 1):
            made = _pnu(number, row)
            table.setdefault(number, {})[made.family] = made
    return MappingProxyType(table)


def _entry(text: str | None) -> tuple[str, str] | None:
    if text is None:
        return None
    kind, _, column = text.partition(".")
    return kind, column


def _pnu(number: int, row: Mapping[str, Any]) -> Pnu:
    values, same = row.get("values", ()), ("access", "connects", "buffer", "messages")
    return Pnu(
        number=number,
        name_en=row["en"],
        name_zh=row["zh"],
        type=row["type"],
        unit=row.get("unit"),
        volatile=row.get("volatile", False),
        family=row.get("family", "profile"),
        entry=_entry(row.get("entry")),
        **{key: row[key] for key in same if key in row},
        values_en=MappingProxyType({value: en for value, en, _ in values}),
        values_zh=MappingProxyType({value: zh for value, _, zh in values}),
        sources=tuple(row.get("sources", ())),
    )


def _row(number: int, family: str) -> Pnu:
    return parameters()[number][family]


def parameter(number: int, family: str = "profile") -> Pnu | None:
    """What a number is on drives of a family: "sinamics", "micromaster", or "profile" for all others."""
    return _of_family(family).get(number)


@cache
def _of_family(family: str) -> Mapping[int, Pnu]:
    """All numbers on drives of a family."""
    found: dict[int, Pnu] = {}
    for number, rows in parameters().items():
        if row := next((rows[each] for each in FAMILIES[family] if each in rows), None):
            found[number] = row
    return MappingProxyType(found)


def of_families(number: int) -> list[Pnu]:
    """What a number is on each family of drives, the most common first."""
    rows = parameters().get(number, {})
    order = dict.fromkeys(("profile", *FAMILIES["sinamics"], *FAMILIES["micromaster"]))
    found = {(row.name_en, row.type): row for name in reversed(order) if (row := rows.get(name))}
    return list(found.values())[::-1]


def usual(number: int) -> Pnu | None:
    """What a number is if no drive is named: the most common row with a type, else the most common row."""
    rows = of_families(number)
    return next((row for row in rows if row.type != "unknown"), rows[0] if rows else None)


@cache
def changing() -> frozenset[int]:
    """The parameters that drives of any family change themselves."""
    rows = ((number, row) for number, all_ in parameters().items() for row in all_.values())
    return frozenset(number for number, row in rows if row.volatile)


@cache
def read_only(family: str | None = None) -> frozenset[int]:
    """The numbers that the tables call read-only on drives of a family.

    Without a family: those that are read-only in every table that states their access.
    """
    found = set()
    for number, rows in parameters().items():
        if family is None:
            access = {row.access for row in rows.values()} - {None}
        else:
            access = {next((each for each in _accesses(rows, FAMILIES[family])), None)}
        if access == {"r"}:
            found.add(number)
    return frozenset(found)


def _accesses(rows: Mapping[str, Pnu], families: tuple[str, ...]) -> Iterator[str]:
    """The access that the rows state, the nearest family first."""
    for name in families:
        if name in rows and (access := rows[name].access) is not None:
            yield access


def is_changing(number: int, name: str | None) -> bool:
    """Whether the drive itself changes the parameter of this name; `name` is None if no table covers the drive."""
    rows = parameters().get(number, {}).values()
    meant = [row for row in rows if row.family == "profile" or name in (row.name_en, row.name_zh)]
    if not meant and name is not None:
        return number in changing()  # the name is from the drive, or from a list of the user
    return any(row.volatile for row in meant)


def parameter_sources() -> Mapping[str, str]:
    """The sources of the parameters of drives.toml, by their keys."""
    return cast("Mapping[str, str]", _load("drives.toml")["sources"])


@cache
def instructions() -> Mapping[str, tuple[InstructionParameter, ...]]:
    """The parameters of instructions that function blocks call, by the name of the instruction."""
    return MappingProxyType(
        {
            row["name"]: tuple(
                InstructionParameter(**each | {"sources": tuple(each["sources"])})
                for each in row["parameter"]
            )
            for row in _load("instructions.toml")["instruction"]
        }
    )


@cache
def rules() -> Mapping[str, Rule]:
    """The catalogue of findings by id, in the order of the ids."""
    rows = _load("rules.toml")["rule"]
    lists = ("changed", "group")
    return MappingProxyType(
        {row["id"]: Rule(**row | {key: tuple(row.get(key, ())) for key in lists}) for row in rows}
    )


@cache
def new_states() -> Mapping[str, str]:
    """The states of a transaction that were added after 1.0.0, with the version of each."""
    return MappingProxyType(_load("rules.toml")["states"])


@cache
def otherwise(what: str, channel: str = "any") -> str | None:
    """The last version that changed the "frames", "requests" or "names" of a channel (rules.toml)."""
    version: str | None = _load("rules.toml")["otherwise"][what].get(channel)
    return version


@cache
def _rules_by_name() -> Mapping[str, str]:
    return MappingProxyType({rule.name: rule.id for rule in rules().values()})


def rule_prefix(word: str) -> str | None:
    """The prefix of the rule ids that a word means, None if it means none.

    A word is an id (`DS410`), the start of ids (`ds4`), or the name of one rule (`drive-error`), in any case.
    """
    word = word.strip()
    start = word.upper()
    if start and any(rule.startswith(start) for rule in rules()):
        return start
    return _rules_by_name().get(word.lower())
