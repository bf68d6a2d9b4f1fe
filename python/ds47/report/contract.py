"""The result, key by key: what JSON, loading, CSV, Parquet, data frames and the schema files are made from.

A key is the name of an attribute of the model, in the same unit; `Shape` has the keys of one object in their
order. A new key is a line here and an attribute there. Words are in sentences.py; files are written and read
elsewhere. `tools/make_schemas.py` writes the JSON Schemas from this table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache, lru_cache
from itertools import chain, groupby, repeat
from typing import Any, NamedTuple

from ds47 import model
from ds47.profidrive.dictionary import family_of
from ds47.report import buffers, descriptions
from ds47.report import values as meanings
from ds47.report.bilingual import LANGUAGES
from ds47.report.filters import display_filter
from ds47.report.sentences import error_words, message, name, sentence
from ds47.spec import (
    FAMILIES,
    MICROMASTER,
    SINAMICS,
    cyclic,
    parameter,
    parameters,
    profibus,
    s7,
    vendors,
)
from ds47.spec.units import duration, nanoseconds, second, timestamp

Tell = Callable[[Any, str], Any]
"""From an object of the model and a language to what JSON has."""
Take = Callable[[Any, int | None], Any]
"""From what JSON has, and the vendor id of the device, to an argument of the model."""


class Key(NamedTuple):
    """One key of an object.

    Attributes:
        name: of the key, and of the attribute.
        schema: what JSON Schema says of the value.
        about: its description in the schema.
        column: its description where it is a column of a table; empty where it is none.
        shape: that of the value, where it is an object, or of each one in a list.
        tell: makes the value from the whole object and the language, where no attribute has it.
        into: the argument that it is loaded into, where that has another name; empty: it is not loaded.
        take: makes that argument of the value.
        required: whether every object has it.
        later: whether objects of `ds47.report/1` do without it.
        channel: the only one whose transactions have it; empty for all.
        rare: whether most objects do without it: it is left out where it is None.
        field: of the field in Wireshark that has the name of the column: label, kind, and what the kind takes
            (`spec/wireshark.toml`); empty where there is none, or one that is made otherwise.
        steady: whether many transactions have the same: what is written of it is kept.
    """

    name: str
    schema: dict[str, Any]
    about: str = ""
    column: str = ""
    shape: Shape | None = None
    tell: Tell | None = None
    into: str | None = None
    take: Take | None = None
    required: bool = True
    later: bool = False
    channel: str = ""
    rare: bool = False
    field: tuple[str, ...] = ()
    steady: bool = False


class Shape:
    """An object of the contract: its name, its keys, the class of the model that it is loaded into.

    `make` may be a function that makes one. Without it this is a part of the object around it: its keys are
    loaded into that.
    """

    def __init__(
        self,
        title: str,
        keys: tuple[Key, ...],
        make: Callable[..., Any] | None = None,
        about: str = "",
    ) -> None:
        self.title = title
        self.keys = keys
        self.make = make
        self.about = about

    def plain(self, item: Any, lang: str = "en") -> dict[str, Any]:
        """An object of the model as one of the contract, its texts in "en" or "zh"."""
        found = {}
        for key in self.keys:
            if key.channel and key.channel != item.channel:
                continue
            value = getattr(item, key.name) if key.tell is None else key.tell(item, lang)
            if value is not None:
                found[key.name] = value if key.shape is None else _plain(key.shape, value, lang)
            elif not key.rare:
                found[key.name] = None
        return found

    def load(self, item: dict[str, Any], vendor_id: int | None = None) -> Any:
        """An object of the contract, of a device of this vendor, as one of the model.

        Raises:
            KeyError: a key is missing.
        """
        assert self.make is not None
        return self.make(**dict(self._arguments(item, vendor_id)))

    def _arguments(self, item: dict[str, Any], vendor_id: int | None) -> Iterator[tuple[str, Any]]:
        for key in self.keys:
            absent = key.later or not key.required or key.channel or key.rare
            if key.into == "" or (key.name not in item and absent):
                continue
            value = item[key.name]
            if key.shape is not None and value is None:
                yield key.into or key.name, None
                continue
            if key.shape is not None and key.shape.make is None:
                yield from key.shape._arguments(value, vendor_id)
                continue
            if key.shape is not None:
                value = _loaded(key.shape, value, vendor_id)
            elif key.take is not None:
                value = key.take(value, vendor_id)
            yield key.into or key.name, value


def _plain(shape: Shape, value: Any, lang: str) -> Any:
    if isinstance(value, list):
        return [shape.plain(each, lang) for each in value]
    return shape.plain(value, lang)


def _loaded(shape: Shape, value: Any, vendor_id: int | None) -> Any:
    if isinstance(value, list):
        return [shape.load(each, vendor_id) for each in value]
    return shape.load(value, vendor_id)


# Kinds of values


def whole(least: int = 0, most: int | None = None, *, maybe: bool = False) -> dict[str, Any]:
    """A whole number between two others."""
    found: dict[str, Any] = {"type": ["integer", "null"] if maybe else "integer", "minimum": least}
    return found if most is None else found | {"maximum": most}


def ref(title: str) -> dict[str, Any]:
    """What is defined under that title."""
    return {"$ref": f"#/$defs/{title}"}


def many(schema: dict[str, Any], least: int = 0) -> dict[str, Any]:
    """A list of such."""
    found: dict[str, Any] = {"type": "array"}
    return found | ({"minItems": least} if least else {}) | {"items": schema}


BYTE, WORD = whole(0, 0xFF, maybe=True), whole(0, 0xFFFF, maybe=True)
FRAME, COUNT, NUMBER = whole(1, maybe=True), whole(), whole(1)
TEXT: dict[str, Any] = {"type": "string"}
MAYBE_TEXT: dict[str, Any] = {"type": ["string", "null"]}
FLAG: dict[str, Any] = {"type": "boolean"}
SHA256 = MAYBE_TEXT | {"pattern": "^[0-9a-f]{64}$"}
_TIME = "^-?[0-9]{4,}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{9}Z$"
VALUES = {"type": "array", "items": {"type": ["number", "string"]}}
MAYBE_VALUES = VALUES | {"type": ["array", "null"]}


# Back from JSON


def error(item: dict[str, Any], vendor_id: int | None) -> model.ParameterError:
    """An error of a parameter, of a device of this vendor; its text tells whether the vendor was known then.

    Of a station of PROFIBUS only the text tells whose its numbers are.
    """
    code, info, text = item["code"], item.get("info"), item["text"]
    own = ((vendor_id, None), (None, None), (vendor_id, 7), (vendor_id, 8))
    others = ((each.id, ak) for ak in (None, 7, 8) for each in vendors())
    for vendor, ak in chain(own, others):
        known = model.ParameterError(code, info, vendor, ak=ak)
        if text in [model.error_words(known, lang) for lang in LANGUAGES]:
            return known
    return model.ParameterError(code, info, said=text)


def take_time(text: str | None, _vendor_id: int | None) -> int | None:
    """A time in nanoseconds."""
    return None if text is None else nanoseconds(text)


def take_ns(milliseconds: float | None, _vendor_id: int | None) -> int | None:
    """A duration in nanoseconds."""
    return duration(milliseconds)


def take_hex(digits: str | None, _vendor_id: int | None) -> bytes | None:
    """Bytes."""
    return None if digits is None else bytes.fromhex(digits)


def take_status(digits: str | None, _vendor_id: int | None) -> int | None:
    """A PNIO status as a number."""
    return None if digits is None else int(digits, 16)


def meaning(item: model.Parameter, lang: str) -> str | None:
    """What the values of a parameter mean, in "en" or "zh"; None where nothing says it."""
    told = meanings.meaning(item)
    return None if told is None else told.text(lang)


def _parameter(**arguments: Any) -> model.Parameter:
    """A parameter; a name that no table has is that of the drive, or of a list."""
    (name_, vendor_id), frames = arguments.pop("name"), arguments.pop("described_in", None)
    pnu, family = arguments["pnu"], arguments.pop("family", None)
    if pnu is not None:
        family = family_of(vendor_id, family)
    row = own = None
    if pnu is not None and name_ is not None:
        row = parameter(pnu, family)
        rows = parameters().get(pnu, {}).values() if row is None else (row,)
        own = next((each for each in rows if name_ in (each.name_en, each.name_zh)), None)
        if own is not None and own.family not in FAMILIES[family]:
            family = SINAMICS  # a name of that table tells it, where the vendor does not
    given = name_ if own is None else None
    described = None
    if frames or given is not None:
        described = model.Described(given, tuple(frames or ()))
    meant = arguments.pop("meaning", None)
    item = model.Parameter(**arguments, listed=own or row, described=described, family=family)
    if meant is not None and meant not in (meaning(item, "en"), meaning(item, "zh")):
        item.value_texts = {None: meant}  # by a list of the user
    return item


# The objects

DEVICE = Shape("device", (
    Key("ip", TEXT),
    Key("mac", MAYBE_TEXT),
    Key("station", MAYBE_TEXT),
    Key("vendor_id", WORD),
    Key("device_id", WORD),
    Key("assumed_vendor_id", WORD, "Whose it was said to be, where the capture does not show it.", rare=True),
), model.Device)  # fmt: skip

READ = Shape("", (Key("request", FRAME), Key("response", FRAME)), model.Read)
_WIRESHARK = "as Wireshark numbers it."
FRAMES = Shape("", (
    Key("write_request", FRAME, column=f"Frame of the Write request, {_WIRESHARK}",
        field=("Write request", "framenum", "REQUEST")),
    Key("write_response", FRAME, column=f"Frame of the Write response, {_WIRESHARK}",
        field=("Write response", "framenum", "RESPONSE")),
    Key("read_request", FRAME, column=f"Frame of the Read request that fetched the response, {_WIRESHARK}",
        field=("Read request", "framenum", "REQUEST")),
    Key("read_response", FRAME, column=f"Frame of the Read response that holds the record, {_WIRESHARK}",
        field=("Read response", "framenum", "RESPONSE")),
    Key("polls", many({}), shape=READ),
    Key("rereads", many({}), shape=READ),
), model.Frames)  # fmt: skip

ERROR = Shape("error", (
    Key("code", WORD, column="Error number (docs/protocol.md, B); null without an error."),
    Key("text", TEXT, tell=error_words, column="What the error number means."),
    Key("info", WORD, column="Second word of the error: often the subindex or the limit."),
))  # fmt: skip

_FLAG: dict[str, Any] = {"type": ["boolean", "null"]}
_LIMIT: dict[str, Any] = {"type": ["number", "string", "null"]}
DESCRIPTION = Shape("description", (
    Key("identifier", WORD, "The word of data type and bits."),
    Key("type", MAYBE_TEXT, "Name of the data type, 0x7F of one that has none."),
    Key("writable", _FLAG, "False where the parameter is write-protected."),
    Key("text_array", _FLAG, "Whether it has texts."),
    Key("changed", _FLAG, "Whether it differs from its factory setting."),
    Key("reset_only", _FLAG, "Whether it can only be reset."),
    Key("array", _FLAG, "Whether it has elements."),
    Key("elements", WORD, "How many, or the length of a string; 0 where it is neither."),
    Key("factor", _LIMIT, "To the standard unit."),
    Key("quantity", BYTE, "Variable index."),
    Key("conversion", whole(-128, 127, maybe=True), "Conversion index."),
    Key("unit", MAYBE_TEXT, "What the two mean; null where no table says it."),
    Key("name", MAYBE_TEXT, "Without the blanks at its end."),
    Key("low", _LIMIT, "Lower limit in the type of the parameter; null where the bytes do not fit it."),
    Key("high", _LIMIT, "Upper limit."),
    Key("extension", WORD, "Extension of the identifier."),
    Key("reference", WORD, "PNU whose value is 100 %."),
    Key("normalisation", WORD, "The word of normalisation."),
    Key("full_scale", whole(maybe=True), "What is 100 % in the value, where that word is valid."),
), about="What a description says (docs/protocol.md C); null where the message does not have it.")  # fmt: skip


PARAMETER = Shape("parameter", (
    Key("pnu", WORD, column="Parameter number; null where the request is not known."),
    Key("subindex", WORD, column="First subindex asked for."),
    Key("attribute", {"anyOf": [{"type": "null"}, ref("attribute")]},
        column="Which part of the parameter: value, description, text, or a number."),
    Key("element_count", BYTE, column="Number of elements asked for."),
    Key("name", MAYBE_TEXT, tell=name, take=lambda *both: both,
        column="Name of the parameter, as the drive calls it or the list."),
    Key("unit", MAYBE_TEXT, column="Unit of the values, of the scaled ones where there are any."),
    Key("format", MAYBE_TEXT,
        column="Format of the values, 0x7F for one that has no name; null for an error."),
    Key("value_count", BYTE, column="Number of values, as the message says."),
    Key("family", {"enum": [MICROMASTER]},
        "Whose parameters it is one of, where the vendor does not say it: of MICROMASTER.",
        tell=lambda item, _: MICROMASTER if item.family == MICROMASTER else None, rare=True),
    Key("values", VALUES),
    Key("scaled", MAYBE_VALUES),
    Key("error", ref("error"), tell=lambda item, lang: item.error and ERROR.plain(item.error, lang),
        take=lambda value, vendor_id: value and error(value, vendor_id)),
    Key("description", ref("description"), "Only of a description (attribute 0x20): what it says.",
        tell=lambda item, _: (found := descriptions.of(item)) and DESCRIPTION.plain(found), into="", rare=True),
    Key("texts", many(TEXT), "Only of texts (attribute 0x30): the entries.",
        tell=lambda item, _: descriptions.entries(item), into="", rare=True),
    Key("described_in", many(NUMBER, 1),
        "Frames of the descriptions of the drive (attribute 0x20) that say its name or unit.", rare=True),
    Key("meaning", TEXT, "What the values mean, where the tables or a list of the user say it.",
        tell=meaning, rare=True),
), _parameter)  # fmt: skip

_BYTES = Shape("", (
    Key("request", ref("hex"), take=take_hex), Key("response", ref("hex"), take=take_hex),
))  # fmt: skip
_STATUSES = Shape("", (
    Key("write", ref("status"), into="write_status", take=take_status,
        column="PNIO status of the Write, eight hex digits.", field=("Status of the Write", "uint32", "HEX")),
    Key("read", ref("status"), into="read_status", take=take_status,
        column="PNIO status of the Read, eight hex digits.", field=("Status of the Read", "uint32", "HEX")),
))  # fmt: skip

_R_ID = "Of BSEND and USEND."


@lru_cache(maxsize=256)
def code_text(code: int | None, lang: str) -> str | None:
    """What the partner answered, in words."""
    return None if code is None else s7.code_text("return_code", code, lang)


ITEM = Shape("item", (
    Key("address", MAYBE_TEXT, "As programs of a PLC write it; null where nothing of the request is known.",
        column="Address of the variable, as programs of a PLC write it; null of what a program sends."),
    Key("area", MAYBE_TEXT, "What its addresses begin with."),
    Key("db", WORD, "Number of the data block."),
    Key("start", whole(maybe=True), "Its first byte; of timers and counters the number of the first one."),
    Key("bit", whole(0, 7, maybe=True), "The bit in that byte, where it is not about whole bytes."),
    Key("length", whole(maybe=True), "Bytes.", column="Bytes of the variable, or of what was sent."),
    Key("value", ref("hex"), "What was read, written or sent.", take=take_hex,
        tell=lambda item, _: None if item.value is None else item.value.hex(),
        column="What was read, written or sent, in hex."),
    Key("code", BYTE, "What the partner answered; 255 is success.",
        column="What the partner answered; 255 is success."),
    Key("text", MAYBE_TEXT, "What that means.", tell=lambda item, lang: code_text(item.code, lang), into=""),
    Key("drive_object", WORD, "Only of a partner that is known as a drive: the one of the address.", rare=True),
    Key("parameter", ref("parameter"), "Likewise the element, with its value.", shape=PARAMETER, rare=True),
), model.Item, "A variable of a job of S7, or data that a program sends; docs/s7.md.")  # fmt: skip

TRANSACTION = Shape("transaction", (
    Key("id", NUMBER, column="Number of the transaction in its capture, by first frame.",
        field=("Transaction", "uint32", "DEC")),
    Key("channel", ref("channel"),
        "Record calls, the parameter channel inside cyclic frames, or S7 communication.", later=True,
        column="ds47 for record calls, pkw for the parameter channel inside cyclic frames, s7 for S7.",
        field=("Channel", "code", "channels"), steady=True),
    Key("operation", ref("operation"), column="What was asked for.",
        field=("Operation", "code", "operations"), steady=True),
    Key("state", ref("state"), column="What came of it.", field=("State", "code", "states"), steady=True),
    Key("controller", TEXT, column="Who asked: its IP address, on PROFIBUS dp and its address.",
        field=("Controller", "ipv4"), steady=True),
    Key("device", TEXT, column="Who was asked, in the same way.", field=("Device", "ipv4"), steady=True),
    Key("station", whole(0, 127, maybe=True), "Address of the device on PROFIBUS; null on PROFINET.",
        later=True, column="Address of the device on PROFIBUS; null on PROFINET.",
        field=("Station", "uint8", "DEC"), steady=True),
    Key("ar", MAYBE_TEXT, "UUID; null for an implicit read.",
        column="UUID of the connection; null for an implicit read.", field=("AR UUID", "string"), steady=True),
    Key("api", whole(0, 0xFFFF_FFFF, maybe=True), column="API of the record; null on PROFIBUS.",
        field=("API", "uint32", "DEC_HEX"), steady=True),
    Key("slot", WORD, column="Slot of the record.", field=("Slot", "uint16", "DEC_HEX"), steady=True),
    Key("subslot", WORD, column="Subslot of the record; null on PROFIBUS.",
        field=("Subslot", "uint16", "DEC_HEX"), steady=True),
    Key("index", WORD, "Null where the channel has none.",
        column="Index of the record: 47, 45102 (0xB02E), 45103 (0xB02F); null for pkw.",
        field=("Record index", "uint16", "DEC_HEX"), steady=True),
    Key("request_reference", WORD, column="The number that the response has to mirror.",
        field=("Request reference", "uint8", "HEX")),
    Key("axis", BYTE, column="Drive object (DO).", field=("Axis / DO-ID", "uint8", "DEC")),
    Key("drive_object", WORD, "The one that the request is proved to reach, by all that the capture shows; "
        "in a format that is written as it comes, by what came before.", later=True,
        column="Number of the drive object that the request is proved to reach; null where none is.",
        field=("Drive object", "uint16", "DEC")),
    Key("telegram", whole(1, 999, maybe=True), "PROFIdrive telegram of the drive object: p0922 as it was read or "
        "written last, else the only one with the lengths of the cyclic data; in a format that is written as it "
        "comes, p0922 by what came before.", later=True,
        column="PROFIdrive telegram of the drive object; null where nothing tells it."),
    Key("frames", {}, shape=FRAMES),
    Key("start", TEXT | {"pattern": _TIME}, into="start_ns", take=take_time,
        column="Time of the first frame, UTC, to the nanosecond."),
    Key("duration_ms", {"type": ["number", "null"]},
        "From the Write request to the first Read response that holds the record; "
        "may be negative where time steps back.",
        column="From the Write request to the response; negative where the clock was set back.",
        into="duration_ns", take=take_ns, field=("Duration (ms)", "double")),
    Key("cycles", whole(maybe=True), "Of pkw: from the request to its response.", later=True,
        column="Of pkw: from the request to its response, in cycles.",
        field=("Cycles from request to response", "uint32", "DEC")),
    Key("bytes", {}, shape=_BYTES),
    Key("status", {}, shape=_STATUSES),
    Key("parameters", many(ref("parameter")), shape=PARAMETER),
    Key("findings", many(ref("rule")), take=lambda value, _: list(value)),
    Key("connection", whole(1, maybe=True), "Only of s7: the id of the connection.", channel=model.S7,
        column="Of s7: the id of the connection."),
    Key("items", many(ref("item")), "Only of s7.", shape=ITEM, channel=model.S7),
    Key("r_id", whole(0, 0xFFFF_FFFF, maybe=True), f"Only of s7. {_R_ID}", channel=model.S7, column=_R_ID),
    Key("error", WORD, "Only of s7: error class and code of the answer, 0 for none.", channel=model.S7,
        column="Of s7: error class and code of the answer as one number, 0 for none."),
    Key("segments", many({}), "Only of s7: the frames of a BSEND and of its acknowledgements.", shape=READ,
        channel=model.S7),
), model.Transaction)  # fmt: skip

FINDING = Shape("finding", (
    Key("rule", ref("rule")),
    Key("severity", ref("severity")),
    Key("message", TEXT, "The sentence of the report; where `offset` is a number, with it in front.",
        tell=message, into=""),
    Key("args",
        {"type": "object", "additionalProperties":
            {"type": ["string", "number", "boolean", "array", "object", "null"]}},
        "The facts that it rests on, by the names of the rule's args (`ds47 rules`); "
        "null where one is not known."),
    Key("frame", COUNT),
    Key("time", TEXT | {"pattern": _TIME}, "When `frame` was; absent where that is not known.",
        into="time_ns", take=take_time, rare=True),
    Key("frames", many(COUNT, 1), "All frames that it is about, sorted; `frame` is one of them."),
    Key("transaction", whole(1, maybe=True), "Its id, null where no transaction is concerned."),
    Key("offset", whole(maybe=True), "Byte of the DS47 message that it is about, from 0."),
    Key("filter", TEXT | {"minLength": 1}, "A Wireshark display filter.", into=""),
), model.Finding)  # fmt: skip


def _corrected(item: model.Diagnosis, _lang: str) -> dict[str, Any] | None:
    if item.corrected is None:
        return None
    from ds47.diagnosis.suggest import corrected  # only here: most captures need no correction

    shown = corrected(item.corrected, item.args.get("family"))
    return {
        "transaction": item.corrected_in, "request": shown.hex, "words": shown.words,
        "scl": shown.scl, "encode": shown.encode,
    }  # fmt: skip


CORRECTED = Shape("", (
    Key("transaction", whole(1, maybe=True), "The one whose request it mends."),
    Key("request", TEXT | {"pattern": "^([0-9a-f]{2})*$"}),
    Key("words", many(TEXT | {"pattern": "^16#([0-9A-F]{2}){1,2}$"}), "For a watch table."),
    Key("scl", TEXT, "For an SCL block."),
    Key("encode", MAYBE_TEXT, "The command line that makes these bytes, null where its notation cannot."),
))  # fmt: skip

DIAGNOSIS = Shape("diagnosis", (
    Key("rule", ref("rule")),
    Key("severity", ref("severity")),
    Key("device", MAYBE_TEXT, "IP address of the device, null where the cause is the capture."),
    Key("message", TEXT, "What is true of all its findings.", tell=sentence, into=""),
    Key("args", {"type": "object"},
        "Those of its findings; null for one that is not the same in all of them.", later=True),
    Key("differs", many(TEXT), "Names of those args that are not the same in all findings, sorted.", later=True),
    Key("count", NUMBER, "Findings of this cause."),
    Key("frames", many(COUNT, 1), "The frames that the findings stand on; of more than 1000 the first."),
    Key("frames_left_out", COUNT, "Further frames, for which frames has no room.", later=True),
    Key("transactions", many(NUMBER),
        "Ids of those concerned, in the order of the findings; of more than 1000 the first."),
    Key("filter", TEXT | {"minLength": 1},
        "A Wireshark display filter for frames; of more than 60 runs of frames the first.",
        tell=lambda item, _: display_filter(item.frames)[0], into=""),
    Key("corrected", {}, "The request as it should have been, where it can be computed.",
        tell=_corrected, into=""),
), model.Diagnosis, "One cause with all the findings that it explains; docs/diagnoses.md.")  # fmt: skip

FILE = Shape("file", (
    Key("path", TEXT),
    Key("sha256", SHA256),
    Key("first_frame", NUMBER),
    Key("frames", COUNT),
    Key("missing_before", COUNT,
        "Files of the series that are not there before this one; "
        "before the first, those that the ring buffer wrote over."),
    Key("problem", MAYBE_TEXT, "Why it was not read, or not to its end."),
), model.CaptureFile,
    "A file of a series (--series). Frames are numbered through all files, as mergecap -a puts them into one: "
    "frame n of the capture is frame n - first_frame + 1 of the file.")  # fmt: skip


_SIDE = Shape("", (
    Key("mac", TEXT, "Of the sender; on PROFIBUS dp and its address."),
    Key("frame_id", whole(0, 0xFFFF, maybe=True), "Null on PROFIBUS."),
    Key("offset", COUNT, "Of its first byte, from the byte behind the frame id; on PROFIBUS in the data."),
    Key("length", COUNT),
), model.Side)  # fmt: skip
RELATION = Shape("relation", (
    Key("channel", {"enum": [model.PKW, model.PZD]}),
    Key("controller", TEXT),
    Key("device", TEXT),
    Key("api", whole(0, 0xFFFF_FFFF, maybe=True), "Null where the channel was named by hand, and on PROFIBUS."),
    Key("slot", WORD),
    Key("subslot", WORD),
    Key("telegrams", many(COUNT), "Those that the lengths allow."),
    Key("output", {}, "From the controller to the device.", shape=_SIDE),
    Key("input", {}, "From the device to the controller.", shape=_SIDE),
    Key("cycle_ms", {"type": ["number", "null"]}, "From one frame of the device to the next."),
    Key("frame", FRAME,
        "The response to the Connect, on PROFIBUS Chk_Cfg; of a channel named by hand its first frame."),
    Key("certainty", {"enum": [model.LENGTHS, model.CONFIGURED, model.SEEN, model.NAMED, model.ODD,
                               model.REFUTED]},
        "Its lengths fit; its configuration tells it; what a drive says was seen; named by hand; named, and its"
        " words have no sense; named, and no drive has one of them."),
), model.Relation, "A channel in cyclic frames; docs/cyclic.md.")  # fmt: skip

SENDER = Shape("sender", (
    Key("mac", TEXT),
    Key("to", TEXT, "MAC address of the receiver."),
    Key("frame_id", whole(0, 0xFFFF)),
    Key("length", COUNT, "Bytes between frame id and cycle counter."),
    Key("word", {"enum": ["STW1", "ZSW1", None]}, "The word that these frames, with those that come back, show.",
        required=False),
    Key("offset", COUNT | {"type": ["integer", "null"]}, "Where it stands behind the frame id.", required=False),
), model.Sender, "A station that sends cyclic frames in which no channel is known.")  # fmt: skip

EVENT = Shape("event", (
    Key("frame", NUMBER, column="Frame in which it is seen first, as Wireshark numbers it."),
    Key("time", TEXT | {"pattern": _TIME}, into="time_ns", take=take_time,
        tell=lambda item, _: timestamp(item.time_ns), column="Time of that frame, UTC, to the nanosecond."),
    Key("name", {"enum": list(cyclic.event_ids())}, "An edge of a bit, or data that is no longer valid.",
        column="What happened: an edge of a bit, or data that is no longer valid."),
    Key("word", {"enum": ["STW1", "ZSW1", None]}, column="The word that has the edge; null where it is none."),
    Key("before", WORD, "The whole word.", column="The whole word before it."),
    Key("after", WORD, "The whole word.", column="The whole word from then on."),
    Key("state", {"enum": [*cyclic.state_ids(), None]}, "Of the drive from then on.",
        column="State of the drive from then on."),
    Key("overlays", many(TEXT), "What is shown beside the state: fault, alarm, OFF2, OFF3.",
        tell=lambda item, _: list(item.overlays), take=lambda value, _: tuple(value)),
), model.Event, "Something that happened to a drive.")  # fmt: skip
TIMELINE = Shape("timeline", (
    Key("relation", NUMBER, "Its place in relations, from 1."),
    Key("events", many(ref("event")), "In the order of time.", shape=EVENT),
    Key("events_left_out", COUNT, "Events for which there was no room."),
), model.Timeline, "What happened to a drive, by its control and status word; docs/cyclic.md.")  # fmt: skip


_SPAN = Shape("", tuple(
    Key(f"{name}_ms", {"type": "number"}, into=f"{name}_ns", take=take_ns) for name in ("least", "mean", "most")
), model.Span)  # fmt: skip
_SPANS: dict[str, Any] = {"type": ["object", "null"]}
_STATION_DIAGNOSIS = Shape("", (
    Key("frame", NUMBER),
    Key("flags", many({"enum": [row.id for row in profibus.flags("diagnosis")]}), "The bits that are set."),
    Key("master", whole(0, 126, maybe=True), "The master that has parameterised it; null for none."),
    Key("ident", WORD, "Ident number."),
    Key("blocks", many(TEXT | {"pattern": "^([0-9a-f]{2})*$"}), "Blocks of extended diagnosis.",
        tell=lambda item, _: [each.hex() for each in item.blocks],
        take=lambda value, _: list(map(bytes.fromhex, value))),
), model.StationDiagnosis)  # fmt: skip
BUS_STATION = Shape("bus_station", (
    Key("address", whole(0, 127)),
    Key("role", {"enum": ["master", "slave"]}, "A master asks."),
    Key("ident", WORD, "Ident number in Set_Prm, or in Slave_Diag."),
    Key("ppo", COUNT | {"type": ["integer", "null"]}, "That of Chk_Cfg."),
    Key("watchdog_ms", COUNT | {"type": ["integer", "null"]}, "As Set_Prm sets it; null where it is off, too."),
    Key("requests", COUNT, "To it; repetitions, and FDL_Status without an answer, aside."),
    Key("unanswered", COUNT),
    Key("damaged", COUNT, "Damaged frames in the place of answers."),
    Key("retries", COUNT),
    Key("exchanges", COUNT, "Data exchanges."),
    Key("outputs", BYTE, "Bytes to it in the last of them."),
    Key("inputs", BYTE, "Bytes from it."),
    Key("cycle", _SPANS, "From one data exchange to the next; null without times.", shape=_SPAN),
    Key("answer", _SPANS, "From a request to its answer; null without times.", shape=_SPAN),
    Key("diagnoses_wanted", COUNT, "How often it began to ask for Slave_Diag."),
    Key("diagnoses_fetched", COUNT, "How often the master read it then."),
    Key("parameters", FRAME, "The last Set_Prm that was answered."),
    Key("configuration", FRAME, "The last Chk_Cfg."),
    Key("diagnosis", {"type": ["object", "null"]}, "What it said last to Slave_Diag.",
        shape=_STATION_DIAGNOSIS),
), model.BusStation, "A station of PROFIBUS; docs/profibus.md.")  # fmt: skip
BUS = Shape("bus", (
    Key("frames", COUNT),
    Key("tokens", COUNT),
    Key("damaged", COUNT, "Frames."),
    Key("stray", COUNT, "Answers that nobody asked for."),
    Key("stations", many(ref("bus_station")), shape=BUS_STATION),
), model.Bus, "The line of PROFIBUS; docs/profibus.md.")  # fmt: skip


_TSAP = MAYBE_TEXT | {"pattern": "^([0-9a-f]{2})*$"}


def _tsap_text(name: str) -> Tell:
    return lambda item, _: (found := getattr(item, name)) and found.hex()


EVIDENCE = Shape("", (
    Key("name", {"enum": ["order_number", "module", "consistent"]},
        "consistent: the bytes that it reads consistently for a panel."),
    Key("value", {"type": ["string", "integer"]}),
    Key("frame", NUMBER),
), model.Evidence)  # fmt: skip
DRIVE = Shape("", (
    Key("proof", {"enum": ["chosen", "order", "records", "cyclic", "device", "station", "values", "addresses"]},
        "What shows it: --s7-cpu, the order number in an SZL, record calls, cyclic frames, device id, its type "
        "of station in DCP, values that share no bytes. Addresses only suggest it."),
    Key("address", MAYBE_TEXT, "The first one of an element,"),
    Key("drive_object", WORD, "and what that stands for."),
    Key("pnu", WORD),
    Key("subindex", WORD),
), model.Drive)  # fmt: skip
CONNECTION = Shape("connection", (
    Key("id", NUMBER, "By the first frame; ids need not follow each other."),
    Key("client", TEXT),
    Key("client_port", COUNT),
    Key("server", TEXT),
    Key("server_port", COUNT),
    Key("client_tsap", _TSAP, "In hex; null where the beginning of the connection is not in the capture.",
        tell=_tsap_text("client_tsap"), take=take_hex),
    Key("server_tsap", _TSAP, tell=_tsap_text("server_tsap"), take=take_hex),
    Key("rack", whole(0, 7, maybe=True), "With slot, as the TSAP of the server has them."),
    Key("slot", whole(0, 31, maybe=True)),
    Key("pdu_length", WORD, "Bytes of a PDU, as agreed; null where the setup is not in the capture."),
    Key("parallel", WORD, "Parallel jobs, as agreed."),
    Key("most_open", COUNT, "Jobs of one end without an answer, at the most."),
    Key("jobs", COUNT),
    Key("refused", COUNT, "Jobs that were refused, or of which an item was."),
    Key("unanswered", COUNT),
    Key("orphans", COUNT, "Answers without a job."),
    Key("read_bytes", COUNT),
    Key("written_bytes", COUNT),
    Key("sent_bytes", COUNT, "By BSEND and USEND."),
    Key("answer", _SPANS, "From a job to its answer; null without one.", shape=_SPAN),
    Key("cyclic", COUNT, "PDUs of cyclic services."),
    Key("other", COUNT, "PDUs of other services of S7."),
    Key("plus", COUNT, "PDUs of S7CommPlus."),
    Key("lost_bytes", COUNT, "Bytes that the capture does not have."),
    Key("first_frame", NUMBER),
    Key("last_frame", NUMBER),
    Key("setup", FRAME, "The answer to the setup."),
    Key("block", whole(1, 0xFFFF, maybe=True),
        "Bytes that the server copies at once, as the user says or it does itself; null where nobody does."),
    Key("evidence", many({}), "What the server says of itself.", shape=EVIDENCE),
    Key("drive", {}, "Only of a server that is a drive, or seems to be one.", shape=DRIVE, rare=True),
), model.Connection, "A connection of S7; docs/s7.md.")  # fmt: skip


def _by_index(item: tuple[str, object]) -> tuple[int, str]:
    """Record indices are numbers written as text; what is none comes last."""
    key = item[0]
    return (int(key) if key.isdecimal() else 1 << 32, key)


NARROWED = Shape("narrowed", (
    Key("criteria", TEXT, "As options of the command line."),
    Key("transactions", COUNT, "So many the capture has."),
    Key("findings", COUNT, "So many findings it has."),
    Key("unproved", COUNT, "Transactions that may be of the drive object that is asked for; nothing proves it."),
), model.Narrowed, "What a report that was narrowed leaves out; docs/report.md.")  # fmt: skip

EXPECTED = Shape("expected", (
    Key("parameters", COUNT, "So many are expected of the drives in the capture."),
    Key("seen", COUNT, "Of so many of them it has a value."),
    Key("wrong", COUNT, "So many of these are not as expected (DS602)."),
    Key("absent", many(TEXT), "Drives in the list that are not in the capture."),
), model.Expected, "What the capture shows of the parameters in a golden list; docs/report.md.")  # fmt: skip

_CELL: dict[str, Any] = {
    "type": ["object", "null"], "additionalProperties": False, "required": ["value", "frame"],
    "properties": {
        "value": {"type": ["integer", "number", "string"]}, "frame": COUNT,
        "text": {"type": "string", "description": "What a list of the user says of the number."},
    },
}  # fmt: skip
BUFFER_SCHEMA: dict[str, Any] = {
    "type": "object", "additionalProperties": False,
    "required": ["kind", "device", "target", "frames", "entries"],
    "properties": {
        "kind": {"enum": ["faults", "alarms"]}, "device": TEXT,
        "target": TEXT | {"description": "The drive object, or the way to it."},
        "frames": {"type": "array", "items": COUNT, "description": "Frames of the responses that show it."},
        "entries": {"type": "array", "items": {
            "type": "object", "additionalProperties": False,
            "required": ["subindex", "situation", *buffers.COLUMNS],
            "properties": {
                "subindex": COUNT,
                "situation": {"type": ["integer", "null"], "minimum": 0,
                    "description": "0 is the present one; null where the drive is of another make."},
                **dict.fromkeys(buffers.COLUMNS, _CELL),
            },
        }},
    },
}  # fmt: skip


def _told_buffer(item: buffers.Buffer) -> dict[str, Any]:
    return {
        "kind": item.kind, "device": item.sample.device, "target": item.target, "frames": item.frames,
        "entries": [
            {
                "subindex": each.subindex, "situation": each.situation,
                **{name: _told_cell(each.cells.get(name)) for name in buffers.COLUMNS},
            }
            for each in item.entries
        ],
    }  # fmt: skip


def _told_cell(cell: buffers.EntryValue | None) -> dict[str, Any] | None:
    if cell is None:
        return None
    text = {} if cell.text is None else {"text": cell.text}
    return {"value": cell.value, "frame": cell.frame, **text}


HEAD = (
    Key("path", TEXT),
    Key("sha256", SHA256),
    Key("frames", COUNT),
    Key("start", MAYBE_TEXT | {"pattern": _TIME},
        "Time of the first frame, whatever it holds; null where there is none. Absent before it was kept.",
        into="start_ns", take=take_time, required=False),
    Key("end", MAYBE_TEXT | {"pattern": _TIME},
        "Time of the last frame, whatever it holds; null where there is none. Absent before it was kept.",
        into="end_ns", take=take_time, required=False),
    Key("complete", FLAG),
    Key("rpc", ref("counts"), "RPC PDUs by type."),
    Key("records",
        {"type": "object", "propertyNames": {"pattern": "^[0-9]+$"}, "additionalProperties": ref("counts")},
        "Record calls by index (decimal), then by kind.",
        tell=lambda item, _: dict(sorted(item.records.items(), key=_by_index))),
    Key("files", many(ref("file"), 1), "Only where the capture is a series of files.", shape=FILE, required=False),
    Key("relations", many(ref("relation"), 1), "Only where cyclic frames have channels.", shape=RELATION,
        required=False),
    Key("timelines", many(ref("timeline"), 1), "Only where cyclic frames have the words of drives.",
        shape=TIMELINE, required=False),
    Key("senders", many(ref("sender"), 1), "Only where cyclic frames are there without their Connect.",
        shape=SENDER, required=False),
    Key("bus", ref("bus"), "Only on PROFIBUS.", shape=BUS, required=False),
    Key("connections", many(ref("connection"), 1), "Only where there is S7 communication.", shape=CONNECTION,
        required=False),
    Key("connections_left_out", NUMBER, "Further connections, for which there was no room.", required=False),
    Key("others", ref("counts"), "Only where nothing is PROFINET, PROFIBUS or S7: what the first frames are.",
        required=False),
    Key("buffers", many(BUFFER_SCHEMA, 1), "Only where more of faults or alarms was read than their numbers.",
        tell=lambda item, _: [_told_buffer(each) for each in buffers.buffers(item)], into="", required=False),
    Key("narrowed", ref("narrowed"), "Only where a part of the capture is shown.", shape=NARROWED, required=False),
    Key("expected", ref("expected"), "Only where a golden list is given.", shape=EXPECTED, required=False),
)  # fmt: skip
LISTS = (
    Key("devices", many(ref("device")), shape=DEVICE),
    Key("transactions", many(ref("transaction")), shape=TRANSACTION),
    Key("findings", many(ref("finding")), shape=FINDING),
    Key("diagnoses", many(ref("diagnosis")), shape=DIAGNOSIS),
)
SUMMARY = Key("summary", {
    "type": "object", "additionalProperties": COUNT, "required": ["transactions"],
    "properties": {"transactions": COUNT},
})  # fmt: skip
CAPTURE_HEAD = Shape("", HEAD)
"""What is said of a capture itself, before its lists."""
CAPTURE = Shape("capture", (*HEAD, *LISTS, SUMMARY), model.CaptureResult)


# Code that makes the keys again, for what is written of every transaction: compiled once


_MADE: dict[Take | None, str] = {
    take_hex: "{}.hex()",
    take_ns: "{} / 1e6",
    take_status: "'%08X' % {}",
    take_time: "second({0} // 1_000_000_000) + '.%09dZ' % ({0} % 1_000_000_000)",
}
"""How a key is loaded -> code that makes it of the attribute that it is loaded into."""


def code(key: Key, attribute: str, null: str = "None", text: str = "{}", mark: str = "") -> str:
    """Code for a key, neither a list nor an object, of code for its attribute; `null` is what stands for None.

    `text` is code for a text that anybody may have written, `mark` stands on both sides of one that is made here.
    """
    kind, made = key.schema.get("type", ()), _MADE.get(key.take)
    if made is None:
        made = "{}" if "integer" in kind else text
    elif mark and "number" not in kind:
        made = f"'{mark}' + {made} + '{mark}'"
    if isinstance(kind, list) or key.schema in (ref("hex"), ref("status")):
        return f"{null} if (value := {attribute}) is None else {made.format('value')}"
    return made.format(attribute)


def compiled(made: str, names: dict[str, Any], of: str = "item, lang") -> Callable[..., Any]:
    """A function that makes something `of` an object of the model and a language; `names` are what it calls."""
    names["second"] = second
    exec(f"def make({of}): return {made}", names)
    function: Callable[..., Any] = names["make"]
    return function


def fields(
    cells: Iterable[tuple[Key, str]], cell: Callable[[Key, str], str], between: str, names: dict[str, Any]
) -> str:  # fmt: skip
    """The inside of an f-string, of what `cell` makes of keys and their attributes; of steady keys it is kept."""
    found: list[str] = []
    for steady, group in groupby(cells, lambda each: each[0].steady):
        these = list(group)
        if not steady:
            found += [cell(*each) for each in these]
            continue
        inside = between.join([cell(key, key.name) for key, _ in these])
        make = compiled(f"f'''{inside}'''", dict(names), ", ".join([key.name for key, _ in these]))
        function = f"kept_{len(names)}"
        names[function] = lru_cache(maxsize=4096)(make)
        found.append(f"{{{function}({', '.join([attribute for _, attribute in these])})}}")
    return between.join(found)


# Tables


class Column(NamedTuple):
    """A column of a table: a key of a transaction or a parameter, a dot between a key and the one inside it."""

    name: str
    key: Key
    attribute: str
    """Code for what it is made of."""


def columns(shape: Shape, prefix: str = "", owner: str = "item") -> Iterator[Column]:
    """The keys of a shape, and of the objects in it, that have a description as a column."""
    for key in shape.keys:
        if key.column:
            yield Column(prefix + key.name, key, f"{owner}.{key.into or key.name}")
        elif key.shape is not None and "items" not in key.schema and not key.rare:
            part = f"{owner}.{key.name}" if key.shape.make else owner
            yield from columns(key.shape, f"{prefix}{key.name}.", part)


POLLS = Column("polls", Key(
    "polls", COUNT, column="How often the controller read before the response was there.",
    field=("Polls", "uint32", "DEC"),
), "len(item.frames.polls)")  # fmt: skip
RULES = Column("findings", Key(
    "findings", MAYBE_TEXT | {"pattern": "^(DS[1-9][0-9]{2}( DS[1-9][0-9]{2})*)?$"},
    column="Rules that apply to the transaction, a blank between; empty without.",
), "' '.join(item.findings)")  # fmt: skip


def _of_transaction() -> Iterator[Column]:
    for column in columns(TRANSACTION):
        if column.key.channel:
            continue
        yield column._replace(name="transaction") if column.name == "id" else column
        if column.name == "frames.read_response":
            yield POLLS
    yield RULES


TRANSACTION_COLUMNS = tuple(_of_transaction())
"""`transaction` is its id, `polls` how many, `findings` the rules with a blank between."""
HEAD_COLUMNS = tuple(columns(PARAMETER))
"""What comes before the values of a parameter,"""
ERROR_COLUMNS = tuple(columns(ERROR, "error."))
"""and what comes behind them."""
S7_COLUMNS = (
    *(each for each in columns(TRANSACTION) if each.key.channel),
    *columns(ITEM, "item."),
)
"""What is the last of all, for transactions of S7: a row for each of their items."""
NOTHING: list[Any] = [None] * len(S7_COLUMNS)
"""The cells of S7_COLUMNS of any other transaction."""


@cache
def transaction_cells() -> Callable[[Any, str], list[Any]]:
    """What makes the cells of TRANSACTION_COLUMNS."""
    cells = [code(each.key, each.attribute) for each in TRANSACTION_COLUMNS]
    return compiled(f"[{', '.join(cells)}]", {})


def rows(item: model.Transaction) -> Iterable[tuple[model.Parameter | None, list[Any]]]:
    """A row for each parameter, of S7 for each item: the parameter, if any, and the cells of S7_COLUMNS."""
    if item.channel == model.S7:
        return _items(item)
    return zip(item.parameters or (None,), repeat(NOTHING))


def _items(item: model.Transaction) -> Iterator[tuple[model.Parameter | None, list[Any]]]:
    left = [item.connection, item.r_id, item.error]
    if not item.items:
        yield None, left + [None] * 4
    for each in item.items:
        value = None if each.value is None else each.value.hex()
        yield each.parameter, [*left, each.address, each.length, value, each.code]


def head_cells(item: model.Parameter, lang: str) -> list[Any]:
    """The cells of HEAD_COLUMNS."""
    return [
        key.tell(item, lang) if key.tell else getattr(item, key.name) for _, key, _ in HEAD_COLUMNS
    ]


def error_cells(item: model.Parameter, lang: str) -> list[Any]:
    """The cells of ERROR_COLUMNS."""
    error = item.error
    return [None] * 3 if error is None else [error.code, error_words(error, lang), error.info]
