"""Outputs of PLC blocks and what they show: blocks.toml as Python objects.

Loading and lookup; which of them a text names, and the answer about it, are `ds47.explain.blocks`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from ds47.spec import _load
from ds47.spec.explanations import CodeCause
from ds47.spec.rows import Row


class Block(Row):
    """A block, and how people write its name."""

    name: str
    words: list[str]
    service: int | None = None
    """The first byte of a STATUS with which the device refuses its call."""
    parameters: int = 16
    """How many it accesses in one call, of those that do."""


class Output(Row):
    """An output of some blocks; blocks.toml says what the columns mean."""

    blocks: list[str]
    name: str
    words: list[str]
    reads: str
    error: str = ""
    decimal: bool = False
    """Manuals count it in decimal."""
    only_named: bool = False
    vendor: str | None = None
    filter: str = ""
    note_en: str = ""
    note_zh: str = ""
    look_en: str = ""
    look_zh: str = ""


class BlockCode(Row):
    """What some blocks show at one output."""

    blocks: list[str]
    output: str
    codes: list[int]
    error: bool
    en: str
    zh: str
    source: list[str]
    cause: list[dict[str, str]]
    first: bool = False

    def causes(self) -> tuple[CodeCause, ...]:
        """The causes, the likeliest first."""
        return tuple(CodeCause(**each) for each in self.cause)


@cache
def blocks() -> tuple[Block, ...]:
    """All blocks."""
    return tuple(Block(**row) for row in _load("blocks.toml")["block"])


@cache
def outputs(block: str) -> tuple[Output, ...]:
    """The outputs of a block, the one that people mean without naming it first."""
    rows = (Output(**row) for row in _load("blocks.toml")["output"])
    return tuple(row for row in rows if block in row.blocks)


@cache
def codes() -> tuple[BlockCode, ...]:
    """What outputs show."""
    return tuple(BlockCode(**row) for row in _load("blocks.toml")["code"])


def of_output(block: str, output: str) -> Mapping[int, BlockCode]:
    """Number -> what it means at this output of a block."""
    rows = (row for row in codes() if block in row.blocks and row.output == output)
    return {code: row for row in rows for code in row.codes}


def near(known: Mapping[int, object] | frozenset[int], value: int) -> list[int]:
    """The numbers closest to one that is unknown, in their order."""
    most: int = _load("blocks.toml")["near"]
    return sorted(sorted(known, key=lambda code: abs(code - value))[:most])


def words(lang: str) -> Mapping[str, str]:
    """The sentences around the rows."""
    table: Mapping[str, str] = _load("blocks.toml")["words"]["zh" if lang == "zh" else "en"]
    return table
