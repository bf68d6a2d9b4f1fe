"""What DP says in a frame, by its SAPs: diagnosis, parameters, configuration, control, data (docs/profibus.md 3).

One frame at a time. Records (MS1, MS2) are `ms1`; which answer belongs to which request is not here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ds47.profibus.telegram import Telegram
from ds47.spec import profibus
from ds47.spec.words import Flaw

DIAGNOSIS: Final = "diagnosis"
PARAMETERS: Final = "parameters"
CONFIGURATION: Final = "configuration"
GET_CONFIGURATION: Final = "get_configuration"
CONTROL: Final = "control"
EXCHANGE: Final = "exchange"
RECORD: Final = "record"
ALARM: Final = "alarm"
RESOURCE: Final = "resource"
MS2: Final = "ms2"
"""The services."""
PKW, PZD = "PKW", "PZD"
"""What a module of a PPO carries."""

_REFUSED = (1, 2, 3)
"""Codes of answers that refuse a service: UE, RR, RS."""
_NO_MASTER = 255
_MOST_MAKER = 14
"""Bytes of a maker in a special identifier; 15 stands for none, and for no comparison."""


@dataclass(frozen=True, slots=True)
class DiagnosisBlock:
    """A block of extended diagnosis; `kind` is bits 7 and 6 of its first byte."""

    kind: int
    data: bytes


@dataclass(frozen=True, slots=True)
class SlaveDiagnosis:
    """What a slave answers to Slave_Diag; None where the answer is too short."""

    flags: tuple[str, ...]
    """Ids of the bits that are set (`spec.profibus.flags("diagnosis")`)."""
    master: int | None
    """The master that has parameterised it; None for none."""
    ident: int | None
    """The ident number that stands in its GSD."""
    blocks: tuple[DiagnosisBlock, ...]
    flaws: tuple[Flaw, ...]


@dataclass(frozen=True, slots=True)
class Parameters:
    """What a master sends with Set_Prm; None where it is too short."""

    flags: tuple[str, ...]
    watchdog_ms: int | None
    """None where the watchdog is off."""
    tsdr: int | None
    """The least time until an answer, in bit times."""
    ident: int | None
    groups: int | None
    """A bit for each group of Global_Control to which the slave belongs."""
    user: bytes
    """The parameters of the maker; of a DPV1 slave the first three bytes are DPV1's."""
    flaws: tuple[Flaw, ...]


@dataclass(frozen=True, slots=True)
class ModuleArea:
    """The inputs or outputs of a module."""

    length: int
    """In bytes,"""
    words: bool
    """counted in words."""
    consistent: bool
    """Over the whole length; else each byte or word by itself."""


@dataclass(frozen=True, slots=True)
class Module:
    """An identifier of Chk_Cfg; one without areas and bytes of a maker is an empty slot."""

    data: bytes
    special: bool
    inputs: ModuleArea | None = None
    outputs: ModuleArea | None = None
    maker: bytes = b""

    @property
    def empty(self) -> bool:
        """Whether it carries nothing."""
        return self.inputs is None and self.outputs is None


@dataclass(frozen=True, slots=True)
class Configuration:
    """The modules of Chk_Cfg or Get_Cfg, in their order."""

    modules: tuple[Module, ...]
    ppo: int | None
    """Which PPO they are, by their lengths; None for none that is known."""
    roles: tuple[str | None, ...]
    """PKW or PZD for each module; None where that is not known."""
    flaws: tuple[Flaw, ...]
    input_length: int
    """Bytes from the slave,"""
    output_length: int
    """and to it."""

    @property
    def pkw_consistent(self) -> bool | None:
        """Whether PKW is consistent over its whole length, both ways; None without PKW."""
        for module, role in zip(self.modules, self.roles, strict=True):
            if role == PKW:
                return all(
                    area is not None and area.consistent for area in (module.inputs, module.outputs)
                )
        return None


@dataclass(frozen=True, slots=True)
class Control:
    """What Global_Control tells slaves; `groups` 0 are all, None where it is missing."""

    flags: tuple[str, ...]
    groups: int | None
    flaws: tuple[Flaw, ...]


@dataclass(frozen=True, slots=True)
class DataExchange:
    """Outputs to a slave, or inputs from it."""

    outputs: bool
    data: bytes
    wants_diagnosis: bool
    """The slave asks for Slave_Diag."""
    flaws: tuple[Flaw, ...] = ()


Content = SlaveDiagnosis | Parameters | Configuration | Control | DataExchange


def service(item: Telegram) -> str | None:
    """Which service of DP a frame belongs to (docs/profibus.md 3).

    Returns:
        An id of `spec.profibus.services()`, "ms2", or None where the SAPs stand for none.
    """
    return item.front.service


def refuses(answer: Telegram) -> bool:
    """Whether an answer refuses its service (UE, RR, RS): what the master sent with it does not count then."""
    return answer.front.code in _REFUSED


def decode(item: Telegram) -> Content | None:
    """What a frame says, None for nothing that DP-V0 knows (docs/profibus.md 3).

    A frame with flaws is decoded as far as possible, without proof.
    """
    name = service(item)
    if name == EXCHANGE:
        return DataExchange(bool(item.request), item.du, not item.request and item.front.wants)
    if name == DIAGNOSIS and not item.request:
        return _diagnosis(item.du)
    if name == PARAMETERS and item.request:
        return _parameters(item.du)
    if (name == CONFIGURATION and item.request) or (name == GET_CONFIGURATION and not item.request):
        return configuration(item.du)
    if name == CONTROL and item.request:
        return Control(_flags(CONTROL, item.du), _byte(item.du, 1), _too_short(item.du, 2))
    return None


def _flags(table: str, data: bytes) -> tuple[str, ...]:
    return tuple(row.id for row in profibus.flags(table) if row.stands_in(data))


def _too_short(data: bytes, want: int) -> tuple[Flaw, ...]:
    have = len(data)
    return (Flaw("data", have, {"have": have, "want": want}),) if have < want else ()


def _word(data: bytes, at: int) -> int | None:
    return int.from_bytes(data[at : at + 2]) if len(data) >= at + 2 else None


def _byte(data: bytes, at: int) -> int | None:
    return data[at] if len(data) > at else None


def _diagnosis(data: bytes) -> SlaveDiagnosis:
    flaws, master = _too_short(data, 6), _byte(data, 3)
    blocks: list[DiagnosisBlock] = []
    at = 6
    while at < len(data):
        kind, length = data[at] >> 6, data[at] & 0x3F
        long = {2: 3, 3: 1}.get(kind, max(length, 1))
        blocks.append(DiagnosisBlock(kind, data[at : at + long]))
        flaws += _too_short(data, at + long)
        at += long
    master = None if master == _NO_MASTER else master
    return SlaveDiagnosis(_flags(DIAGNOSIS, data[:6]), master, _word(data, 4), tuple(blocks), flaws)


def _parameters(data: bytes) -> Parameters:
    flags = _flags(PARAMETERS, data)
    watchdog = None
    if "watchdog" in flags and len(data) >= 3:
        base = 1 if {"dpv1", "watchdog_base_1ms"} <= set(flags) else 10
        watchdog = base * data[1] * data[2]
    tsdr, ident, groups = _byte(data, 3), _word(data, 4), _byte(data, 6)
    return Parameters(flags, watchdog, tsdr, ident, groups, data[7:], _too_short(data, 7))


def configuration(data: bytes) -> Configuration:
    """The modules of the identifier bytes of Chk_Cfg (docs/profibus.md 3)."""
    modules: list[Module] = []
    flaws: tuple[Flaw, ...] = ()
    at = 0
    while at < len(data):
        module, end = _general(data, at) if data[at] & 0x30 else _special(data, at)
        modules.append(module)
        flaws += _too_short(data, end)
        at = end
    ppo, roles = _ppo(modules)
    lengths = (
        sum(area.length for area in areas if area)
        for areas in ([each.inputs for each in modules], [each.outputs for each in modules])
    )
    return Configuration(tuple(modules), ppo, roles, flaws, *lengths)


def _general(data: bytes, at: int) -> tuple[Module, int]:
    """One byte: consistency, words or bytes, in and out, length."""
    head = data[at]
    words = bool(head & 0x40)
    area = ModuleArea(((head & 0x0F) + 1) * (1 + words), words, bool(head & 0x80))
    inputs, outputs = (area if head & bit else None for bit in (0x10, 0x20))
    return Module(data[at : at + 1], False, inputs, outputs), at + 1


def _special(data: bytes, at: int) -> tuple[Module, int]:
    """A byte that says what follows: a length byte of outputs, one of inputs, bytes of the maker."""
    head, first = data[at], at
    at += 1
    areas: list[ModuleArea | None] = []
    for bit in (0x80, 0x40):
        area = None
        if head & bit:
            area = _long_area(data[at]) if at < len(data) else None
            at += 1
        areas.append(area)
    maker = head & 0x0F
    end = at + (maker if maker <= _MOST_MAKER else 0)
    outputs, inputs = areas
    return Module(data[first:end], True, inputs, outputs, data[at:end]), end


def _long_area(head: int) -> ModuleArea:
    words = bool(head & 0x40)
    return ModuleArea(((head & 0x3F) + 1) * (1 + words), words, bool(head & 0x80))


def _ppo(modules: list[Module]) -> tuple[int | None, tuple[str | None, ...]]:
    """The PPO by the lengths of its modules, and what each of them carries."""
    filled = [each for each in modules if not each.empty]
    both = [
        each.inputs.length
        for each in filled
        if each.inputs and each.outputs and each.inputs.length == each.outputs.length
    ]
    row = next((row for row in profibus.ppos() if row.modules == tuple(both)), None)
    if row is None or len(both) < len(filled):
        return None, (None,) * len(modules)
    return row.number, tuple(
        None if each.empty else PKW if row.pkw and each is filled[0] else PZD for each in modules
    )
