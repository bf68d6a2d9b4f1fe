"""Words of the reports and of the commands, and which findings a diagnosis covers, as Python objects.

From report.toml, which Wireshark shares, and commands.toml, which only the analyzer needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from ds47.spec import _load

COVERS = ("job", "word", "whole")
"""How a diagnosis covers findings; report.toml says what each means."""


@cache
def report_words() -> Mapping[str, Mapping[str, str]]:
    """Every text of report.toml by its key, then by language ("en", "zh")."""
    table: Mapping[str, Mapping[str, str]] = _load("report.toml")["words"]
    return table


@cache
def command_words() -> Mapping[str, Mapping[str, str]]:
    """The same of commands.toml; no key stands in both."""
    table: Mapping[str, Mapping[str, str]] = _load("commands.toml")["words"]
    return table


@cache
def covers(how: str) -> Mapping[str, tuple[str, ...]]:
    """Rule of a diagnosis -> rules, or how they begin, of the findings that it covers in this way (of COVERS)."""
    return {rule: tuple(covered) for rule, covered in _load("report.toml")["covers"][how].items()}
