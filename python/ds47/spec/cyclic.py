"""The tables of the cyclic channels as Python objects: pkw.toml, pzd.toml and telegrams.toml.

Loading and lookup only; words are decoded in `ds47.cyclic`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from functools import cache
from types import MappingProxyType

from ds47.spec import _load, error_fallback, of_maker, vendor, vendors
from ds47.spec.rows import Row


class PkwRequest(Row):
    """One request of PKW by its AK (docs/cyclic.md 2)."""

    ak: int
    en: str
    zh: str
    access: str
    """ "read", "change", "description", "count", "text", "none" or "unknown"."""
    answers: tuple[int, ...]
    """The AK of matching answers, apart from 7 and 8."""
    array: bool = False
    width: int | None = None
    """Bits of the value to write."""
    eeprom: bool = False


class PkwAnswer(Row):
    """One answer of PKW by its AK; `width` in bits, None if PWE is not a value."""

    ak: int
    en: str
    zh: str
    width: int | None = None


class Bit(Row):
    """What a bit of STW1 or ZSW1 says as 1 and as 0; "" for nothing."""

    bit: int
    set: str
    clear: str
    set_zh: str
    clear_zh: str
    family: str | None = None

    def said(self, value: int, lang: str = "en") -> str:
        """What the bit says in a control or status word, in "en" or "zh"."""
        name = "set" if value >> self.bit & 1 else "clear"
        words: str = getattr(self, name + ("_zh" if lang == "zh" else ""))
        return words


class State(Row):
    """A state or an overlay: the bits of ZSW1 under a mask; `missing` says what leads to the next state."""

    id: str
    mask: int
    bits: int
    en: str
    zh: str
    missing: str = ""
    missing_zh: str = ""


class Stopping(Row):
    """The state S5, which only the control word shows: one of `states` while one of `bits` is 0.

    It does not apply while one of `unless` is 1, or `heeded` is 0.
    """

    id: str
    en: str
    zh: str
    states: tuple[str, ...]
    bits: tuple[int, ...]
    unless: tuple[int, ...]
    heeded: int
    missing: str
    missing_zh: str


class Needed(Row):
    """A bit of STW1 that a drive needs to run; `setpoint`: it runs without the bit, but does not turn."""

    bit: int
    en: str
    zh: str
    setpoint: bool = False


class Edge(Row):
    """An edge of a bit of STW1 or ZSW1 as an event; `speed`: only in telegrams with a speed."""

    id: str
    word: str
    bit: int
    value: int
    """The new value of the bit."""
    en: str
    zh: str
    speed: bool = False


class PzdTelegram(Row):
    """The words of a telegram after its PKW words, if any; "(2)" marks a double word, "(4)" two of them.

    Without words no source has them. `unordered`: these are the words, and the place of each is not known.
    `vendor` is the PROFINET vendor id of whose the number is, None of a standard telegram.
    """

    number: int
    en: str
    zh: str
    sources: tuple[str, ...]
    """What it was read in, in words."""
    out: tuple[str, ...] = ()
    inward: tuple[str, ...] = ()
    pkw: bool = False
    unordered: bool = False
    vendor: int | None = None

    @property
    def is_known(self) -> bool:
        """Whether its words are known, each in its place."""
        return bool(self.out or self.inward) and not self.unordered

    @property
    def is_of_drive(self) -> bool:
        """Whether its words are those of a drive: STW1 comes first."""
        return self.is_known and self.out[:1] == (_STW1,)

    @property
    def sizes(self) -> tuple[int, int]:
        """Bytes of its words, out and in."""
        return size(self.out), size(self.inward)

    def is_of(self, vendor_id: int | None) -> bool:
        """Whether a device of this maker may have it."""
        return self.vendor is None or self.vendor == vendor_id


_STW1 = "STW1"


@cache
def requests() -> Mapping[int, PkwRequest]:
    """The requests of PKW by AK, all sixteen."""
    rows = _load("pkw.toml")["request"]
    return MappingProxyType(
        {row["ak"]: PkwRequest(**{**row, "answers": tuple(row["answers"])}) for row in rows}
    )


@cache
def answers() -> Mapping[int, PkwAnswer]:
    """The answers of PKW by AK, all sixteen."""
    return MappingProxyType({row["ak"]: PkwAnswer(**row) for row in _load("pkw.toml")["answer"]})


@cache
def weights() -> Mapping[int, int]:
    """Bit of the page byte -> its weight in the parameter number."""
    table = _load("pkw.toml")["page"]["weights"]
    return MappingProxyType({int(bit): weight for bit, weight in table.items()})


@cache
def _errors() -> Mapping[int, tuple[str, str]]:
    return MappingProxyType(
        {row["code"]: (row["en"], row["zh"]) for row in _load("pkw.toml")["error"]}
    )


@cache
def error_codes(family: str | None = None) -> frozenset[int]:
    """The error numbers of a family of drives; without one, of all families.

    Raises:
        KeyError: there is no family of that name.
    """
    if family is None:
        return frozenset(_errors()).union(*(maker.pkw for maker in vendors()))
    named = {row["name"]: frozenset(row["errors"]) for row in _load("pkw.toml")["family"]}
    return named[family]


def error_text(code: int, lang: str = "en", vendor_id: int | None = None) -> str | None:
    """What an error number of PKW means, in "en" or "zh" (docs/cyclic.md 2); None if unknown.

    Args:
        code: the number.
        lang: "en" or "zh".
        vendor_id: PROFINET vendor id of the device. Its maker's table goes before the profile's, and numbers above
            those of the profile belong to the maker.
    """
    maker = None if vendor_id is None else vendor(vendor_id)
    if maker is not None and code in maker.pkw:
        return maker.pkw[code].text(lang)
    row = _errors().get(code)
    own = is_of_profile(code) or vendor_id == vendors()[0].id
    if own and (row is not None or code not in error_codes()):
        return None if row is None else row[lang == "zh"]
    text = error_fallback(str(code), lang)
    return text if vendor_id is None else text + of_maker(vendor_id, lang)


def families() -> tuple[str, ...]:
    """The families of drives with known error numbers."""
    return tuple(row["name"] for row in _load("pkw.toml")["family"])


def is_of_profile(code: int | None) -> bool:
    """Whether an error number of PKW belongs to the PROFIdrive profile, not to the maker."""
    return code is not None and code <= profile_errors()


def profile_errors() -> int:
    """The last error number of PKW in the profile."""
    last: int = _load("pkw.toml")["errors"]["profile"]
    return last


def connector_mark() -> int:
    """The bits of PWE2 that mark a value as a connector."""
    mark: int = _load("pkw.toml")["connector"]["mark"]
    return mark


@cache
def float_range() -> tuple[float, float]:
    """The smallest and the largest absolute value of a double word that is shown as a float."""
    row = _load("pkw.toml")["value"]
    return row["float_least"], row["float_most"]


DRIVE_WORDS = ("stw1", "zsw1")
"""The control word and the status word of a drive."""
OTHERS = "others"
"""The drives of makers who are known, and have words of their own for some bits."""


def family_of_words(vendor_id: int | None) -> str | None:
    """Whose words the bits have: OTHERS, or None of Siemens and where nothing tells the maker."""
    return None if vendor_id in (None, vendors()[0].id) else OTHERS


@cache
def bit_words() -> tuple[str, ...]:
    """The words with known bits: of drives, of control units, of infeeds."""
    own = [name.lower() for name in _load("telegrams.toml")["words"]]
    return (*DRIVE_WORDS, *(each for each in own if each in _load("telegrams.toml")))


@cache
def bits(word: str, family: str | None = None) -> tuple[Bit, ...]:
    """The bits of a word, in order: sixteen of "stw1" and "zsw1", and those that words of other telegrams have.

    Args:
        word: one of `bit_words`.
        family: "micromaster", "positioning", OTHERS or None.
    """
    found: dict[int, Bit] = {}
    for row in _load("pzd.toml" if word in DRIVE_WORDS else "telegrams.toml")[word]:
        if row.get("family") in (None, family):
            found[row["bit"]] = Bit(**row)
    if family == OTHERS and word in DRIVE_WORDS:
        own = _load("pzd.toml")["own"]
        found |= {
            bit: Bit(**{**own, "bit": bit, "family": OTHERS}) for bit in range(own["bit"], 16)
        }
    return tuple(found[bit] for bit in sorted(found))


@cache
def states() -> tuple[State, ...]:
    """The states in the order of matching."""
    return tuple(State(**row) for row in _load("pzd.toml")["state"])


def state_ids() -> tuple[str, ...]:
    """The ids of all states."""
    return (*(row.id for row in states()), stopping().id)


@cache
def state_errors() -> frozenset[int]:
    """Error numbers of a change that blame the state of the drive."""
    return frozenset(_load("pzd.toml")["operation"]["errors"])


@cache
def overlays() -> tuple[State, ...]:
    """The overlays of a state: fault, alarm, OFF2, OFF3."""
    return tuple(State(**row) for row in _load("pzd.toml")["overlay"])


@cache
def stopping() -> Stopping:
    """The state of a drive that is switching off."""
    row = _load("pzd.toml")["stopping"]
    return Stopping(**{name: tuple(v) if isinstance(v, list) else v for name, v in row.items()})


@cache
def needed() -> tuple[Needed, ...]:
    """The bits of STW1 that a drive needs, in the order of its start sequence."""
    return tuple(Needed(**row) for row in _load("pzd.toml")["needed"])


@cache
def edges(word: str) -> tuple[Edge, ...]:
    """The events of "stw1" or "zsw1", in the order of their bits."""
    return tuple(Edge(**row) for row in _load("pzd.toml")["event"] if row["word"] == word)


@cache
def _events() -> Mapping[str, tuple[str, str]]:
    rows = [*_load("pzd.toml")["event"], *_load("pzd.toml")["happening"]]
    return MappingProxyType({row["id"]: (row["en"], row["zh"]) for row in rows})


def event_text(event_id: str, lang: str = "en") -> str:
    """An event in words, in "en" or "zh"."""
    return _events()[event_id][lang == "zh"]


def event_ids() -> tuple[str, ...]:
    """The ids of all events."""
    return tuple(_events())


@cache
def telegrams() -> Mapping[int, PzdTelegram]:
    """The telegrams that a source names, by their numbers."""
    table = _load("telegrams.toml")
    found = {}
    for row in table["telegram"]:
        words = {"out": tuple(row.get("out", ())), "inward": tuple(row.get("in", ()))}
        rest = {name: value for name, value in row.items() if name not in ("out", "in", "sources")}
        sources = tuple(table["sources"][each] for each in row["sources"])
        found[row["number"]] = PzdTelegram(**rest, **words, sources=sources)
    return MappingProxyType(found)


@cache
def drive_telegrams() -> Mapping[int, PzdTelegram]:
    """Those of drives, whose words begin with STW1 and ZSW1."""
    return MappingProxyType({n: row for n, row in telegrams().items() if row.is_of_drive})


def bare(word: str) -> str:
    """The name of a word of a telegram without the mark of more than one word."""
    return word.partition("(")[0]


def size(words: Iterable[str]) -> int:
    """Bytes of words of a telegram."""
    return sum(2 * int(each[-2]) if each.endswith(")") else 2 for each in words)


def telegram_word(word: str, lang: str = "en") -> str:
    """What a word of a telegram is, in "en" or "zh"; "" where nobody knows."""
    row = _load("telegrams.toml")["words"].get(bare(word))
    return "" if row is None else str(row["zh" if lang == "zh" else "en"])


def full_scale(double: bool = False) -> int:
    """The raw value of 100 % in a word or a double word."""
    value: int = _load("pzd.toml")["scale"]["double_word" if double else "word"]
    return value


def meaning(ak: int, answer: bool, lang: str = "en") -> str:
    """What the AK of a request or an answer means, in "en" or "zh"."""
    row: PkwRequest | PkwAnswer = answers()[ak] if answer else requests()[ak]
    return row.text(lang)


def _state(state_id: str) -> State | Stopping:
    ending = stopping()
    return ending if state_id == ending.id else next(row for row in states() if row.id == state_id)


def state_text(state_id: str, beside: Collection[str], lang: str = "en") -> str:
    """`S2 ready to switch on, fault`: a state and its overlays, in "en" or "zh"."""
    own = _state(state_id).text(lang)
    first = f"{state_id} {own}" if state_id.startswith("S") else own
    shown = [each.text(lang) for each in overlays() if each.id in beside]
    return ("，" if lang == "zh" else ", ").join([first, *shown])


def overlay_text(overlay_id: str, lang: str = "en") -> str:
    """An overlay in words, in "en" or "zh"."""
    row = next(each for each in overlays() if each.id == overlay_id)
    return row.text(lang)


def next_step(state_id: str, beside: Collection[str], lang: str = "en") -> str:
    """What the drive needs to leave its state, in "en" or "zh": a fault comes first, "" for nothing."""
    rows: list[State | Stopping] = [row for row in overlays() if row.id in beside and row.missing]
    rows.append(_state(state_id))
    return rows[0].missing_zh if lang == "zh" else rows[0].missing
