"""What a program may choose, as the options of an analysis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal, TypedDict

from ds47.analysis import AnalysisOptions
from ds47.cyclic.named import pairs as name_pairs
from ds47.cyclic.named import parse as parse_name
from ds47.cyclic.named import parse_ppo
from ds47.model import CHANNELS
from ds47.profidrive import Options
from ds47.s7.choices import parse as parse_s7
from ds47.spec import rule_prefix

Engine = Literal["native", "tshark", "both"]
"""Who decodes: ds47 itself, the Wireshark plugin, or both, to compare them."""


class Choices(TypedDict, total=False):
    """How a capture is analysed: keywords of `analyze`, which says what they mean, and of the like."""

    indices: Iterable[int]
    slow_ms: float | None
    pkw_layouts: Mapping[str, str] | None
    channels: str | Iterable[str]
    cyclic: Iterable[str]
    ppos: Mapping[int, int] | None
    s7_ports: Iterable[int]
    s7_cpus: Mapping[str, str] | None
    s7_blocks: Mapping[str, int] | None
    s7_readback: bool
    vendor_id: int | None
    select: str | Iterable[str]
    ignore: str | Iterable[str]
    options: Options | None


def chosen(given: Choices) -> AnalysisOptions:
    """The options of an analysis.

    Raises:
        ValueError: there is no such rule, channel, port or CPU, or a name in `cyclic` is none.
        TypeError: there is no such choice, or `slow_ms` is no number.
    """
    if unknown := given.keys() - Choices.__annotations__:
        raise TypeError(f"no choice {min(unknown)!r}: {', '.join(Choices.__annotations__)}")
    channels, slow_ms = _several(given.get("channels", CHANNELS)), given.get("slow_ms")
    if slow_ms is not None and not isinstance(slow_ms, (int, float)):
        raise TypeError(f"slow_ms is {slow_ms!r}: a number of milliseconds, or None")
    if wrong := set(channels) - set(CHANNELS):
        raise ValueError(f"no channel {min(wrong)!r}: {', '.join(CHANNELS)}")
    options = AnalysisOptions(
        indices=frozenset(given.get("indices", ())),
        slow_ms=slow_ms,
        select=_rules(given.get("select", ())),
        ignore=_rules(given.get("ignore", ())),
        codec=given.get("options") or Options(),
        pkw_layouts=tuple((given.get("pkw_layouts") or {}).items()),
        channels=channels,
        cyclic=tuple(map(parse_name, given.get("cyclic", ()))),
        ppos=tuple(parse_ppo(f"{at}=ppo{ppo}") for at, ppo in (given.get("ppos") or {}).items()),
        s7=parse_s7(
            tuple(given.get("s7_ports", ())),
            [f"{ip}={kind}" for ip, kind in (given.get("s7_cpus") or {}).items()],
            [f"{ip}={size}" for ip, size in (given.get("s7_blocks") or {}).items()],
            given.get("s7_readback", False),
        ),
        vendor_id=given.get("vendor_id"),
    )
    name_pairs(options.cyclic)
    return options


def _several(given: str | Iterable[str]) -> tuple[str, ...]:
    """A text where several are meant is one of them, not its letters."""
    return (given,) if isinstance(given, str) else tuple(given)


def _rules(names: str | Iterable[str]) -> tuple[str, ...]:
    found = []
    for name in _several(names):
        prefix = rule_prefix(name)
        if prefix is None:
            raise ValueError(f"no rule has the number or name {name!r}. Try: ds47 rules")
        found.append(prefix)
    return tuple(found)
