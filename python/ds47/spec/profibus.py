"""The tables of PROFIBUS DP as Python objects (spec/profibus.toml).

Loading, lookup and words only; frames are decoded in `ds47.profibus`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from ds47.spec import _load
from ds47.spec.rows import Row
from ds47.spec.words import Words


class ProfibusCode(Row):
    """A request, an answer, a start byte, a kind of station or of block by its code (docs/profibus.md 2)."""

    code: int
    en: str
    zh: str
    id: str = ""
    exchange: bool = False
    """Without SAPs it belongs to data exchange."""
    wants: bool = False
    """The slave asks for Slave_Diag."""
    silent: bool = False
    """It has no answer."""
    probe: bool = False
    """It asks whether a station is there at all."""


class Service(Row):
    """What a pair of SAPs stands for; data exchange has none."""

    id: str
    en: str
    zh: str
    sap: int | None = None
    """Of the slave,"""
    master: int | None = None
    """and of the master."""


class Flag(Row):
    """A bit of Slave_Diag, Set_Prm or Global_Control."""

    id: str
    byte: int
    bit: int
    en: str
    zh: str

    def stands_in(self, data: bytes) -> bool:
        """Whether the bit is set; not where its byte is missing."""
        return self.byte < len(data) and bool(data[self.byte] >> self.bit & 1)


class PpoLayout(Row):
    """A PPO by the bytes of its modules; `pkw`: the first one is PKW."""

    number: int
    modules: tuple[int, ...]
    pkw: bool = False


class Function(Row):
    """A function of MS1 and MS2 by its first byte; `negative` is that of its refusal."""

    code: int
    id: str
    en: str
    zh: str
    negative: int | None = None


_WORDS = Words("profibus.toml")
words, flaw_ids = _WORDS.words, _WORDS.flaw_ids
flaw_text, flaw_template = _WORDS.flaw_text, _WORDS.flaw_template
CODES = ("start", "request", "answer", "station", "block")
FLAGS = ("diagnosis", "parameters", "control")


@cache
def codes(table: str) -> Mapping[int, ProfibusCode]:
    """One of CODES, by code."""
    return MappingProxyType(
        {row["code"]: ProfibusCode(**row) for row in _load("profibus.toml")[table]}
    )


@cache
def flags(table: str) -> tuple[Flag, ...]:
    """One of FLAGS, in the order of the bits."""
    return tuple(Flag(**row) for row in _load("profibus.toml")[table])


def probes(code: int | None) -> bool:
    """Whether a request asks if a station exists: most addresses do not answer."""
    row = codes("request").get(code or 0)
    return row is not None and row.probe


@cache
def services() -> Mapping[str, Service]:
    """The services by id; MS2, which has many SAPs, is not among them."""
    return MappingProxyType(
        {row["id"]: Service(**row) for row in _load("profibus.toml")["service"]}
    )


@cache
def service_ids() -> Mapping[tuple[int, int], str]:
    """The SAP of the slave and that of the master -> the id of the service."""
    rows = services().values()
    return MappingProxyType(
        {
            (row.sap, row.master): row.id
            for row in rows
            if row.sap is not None and row.master is not None
        }
    )


def service_id(
    request: bool | None, code: int | None, slave: int | None, master: int | None
) -> str | None:
    """The service of DP that a frame with this function belongs to, by the SAPs of slave and master.

    Returns:
        An id of `services()`, "ms2", or None where the SAPs stand for none.
    """
    if code is None:
        return None
    if slave is None and master is None:
        row = codes("request" if request else "answer").get(code)
        return "exchange" if row is not None and row.exchange else None
    if slave is None or master is None:
        return None
    own, most = ms2()
    known = service_ids().get((slave, master))
    return known or ("ms2" if master == own and slave <= most else None)


@cache
def ms2() -> tuple[int, int]:
    """The SAP of a master for MS2, and the highest that a slave has for it."""
    row = _load("profibus.toml")["ms2"]
    return row["master"], row["most"]


@cache
def lengths() -> tuple[int, int]:
    """The least and the greatest LE of SD2."""
    row = _load("profibus.toml")["length"]
    return row["least"], row["most"]


@cache
def ppos() -> tuple[PpoLayout, ...]:
    """The PPO that a configuration can be."""
    rows = _load("profibus.toml")["ppo"]
    return tuple(PpoLayout(**{**row, "modules": tuple(row["modules"])}) for row in rows)


@cache
def functions() -> Mapping[int, Function]:
    """The functions of MS1 and MS2 by their code, refusals apart."""
    rows = _load("profibus.toml")["function"]
    return MappingProxyType({row["code"]: Function(**row) for row in rows})


@cache
def refusals() -> Mapping[int, Function]:
    """The functions by the code of their refusal."""
    rows = functions().values()
    return MappingProxyType({row.negative: row for row in rows if row.negative is not None})


@cache
def not_ready() -> tuple[int, int]:
    """Error decode and error code 1 of a read that has no answer yet."""
    row = _load("profibus.toml")["not_ready"]
    return row["error_decode"], row["error_code_1"]


class Listing(Row):
    """How logs of text name what they have; all in small letters."""

    time: tuple[str, ...]
    data: tuple[str, ...]
    direction: tuple[str, ...]
    """Names of the three columns,"""
    to_slave: tuple[str, ...]
    to_master: tuple[str, ...]
    """words for both directions,"""
    units: Mapping[str, int]
    """and units of a time, in nanoseconds."""


@cache
def listing() -> Listing:
    """The words of logs."""
    table = _load("profibus.toml")["listing"]
    return Listing(**{k: tuple(v) if isinstance(v, list) else v for k, v in table.items()})


class Printed(Row):
    """Parts of a function code by the names that a master prints for them."""

    request: Mapping[str, int]
    count: Mapping[str, int]
    """FCB and FCV."""
    state: Mapping[str, int]
    status: Mapping[str, int]


@cache
def printed() -> Printed:
    """The names of profirust."""
    return Printed(**_load("profibus.toml")["printed"])


@cache
def vendors() -> Mapping[int, int]:
    """PROFINET vendor id of the maker, by the ident numbers of drives that are known."""
    rows = _load("profibus.toml")["ident"]
    return MappingProxyType({row["number"]: row["vendor"] for row in rows})


def vendor(ident: int | None) -> int | None:
    """PROFINET vendor id of the maker of a drive, by the ident number of its GSD; None where that is not known."""
    return None if ident is None else vendors().get(ident)


@cache
def families() -> Mapping[int, str]:
    """The family of the parameters (parameters.toml) by the ident number, where it is not that of the maker."""
    rows = _load("profibus.toml")["ident"]
    return MappingProxyType({row["number"]: row["family"] for row in rows if "family" in row})


def family(ident: int | None) -> str | None:
    """The family of the parameters of a drive, by the ident number of its GSD; None where that is not known."""
    return None if ident is None else families().get(ident)


def service_text(service_id: str, lang: str = "en") -> str:
    """What a service is called, MS2 too, in "en" or "zh"."""
    if service_id == "ms2":
        named: str = _load("profibus.toml")["ms2"][lang]
        return named
    return services()[service_id].text(lang)


def control_text(fc: int, lang: str = "en") -> str:
    """What a function code says, in "en" or "zh": `SRD high, FCB 1`, `OK, slave`."""
    requested, code, middle = bool(fc & 0x40), fc & 0x0F, fc >> 4 & 3
    row = codes("request" if requested else "answer").get(code)
    own = _WORDS.word("unknown", lang).format(code=code) if row is None else row.text(lang)
    if not requested:
        beside = codes("station")[middle].text(lang)
    else:
        beside = ("", _WORDS.word("fcb", lang).format(bit=0), _WORDS.word("fcb_first", lang),
                  _WORDS.word("fcb", lang).format(bit=1))[middle]  # fmt: skip
    return own + _WORDS.word("separator", lang) + beside if beside else own


def function_text(code: int, request: bool, lang: str = "en") -> str:
    """What the first byte of MS1 says, in "en" or "zh": `DS_Read`, `DS_Read positive`, `DS_Read negative`."""
    refused = None if request else refusals().get(code)
    row = refused or functions().get(code)
    if row is None:
        return _WORDS.word("unknown", lang).format(code=code)
    own = row.text(lang)
    if request or row.negative is None:
        return own
    return own + " " + _WORDS.word("negative" if refused else "positive", lang)
