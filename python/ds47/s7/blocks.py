"""How many bytes a partner copies without interruption when others read and write its memory (docs/s7.md 6).

A capture does not have this number: the user names it, or the partner says what it is. Nothing is judged here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ds47.s7.model import SzlEvidence
from ds47.spec import s7

ANYBODY = ""
"""The address of all partners that are not named."""
CHOSEN, KIND, SAID, ORDER = "block_chosen", "block_kind", "block_said", "block_order"
"""Who says how large a block is: --s7-block, --s7-cpu, SZL 0131, or the order number in an SZL."""


@dataclass(frozen=True, slots=True)
class BlockSize:
    """A number of bytes, and who says so."""

    size: int
    source: str
    """CHOSEN, KIND, SAID or ORDER."""
    frame: int | None = None
    """Where the partner said it."""
    name: str | None = None
    """The kind of CPU, or its order number."""


class Blocks:
    """The blocks of all partners.

    Args:
        sizes: bytes by IP address; ANYBODY stands for all others.
        kinds: ids of `spec.s7.cpus()` likewise.
        most: how many partners to remember.
    """

    def __init__(self, sizes: Mapping[str, int], kinds: Mapping[str, str], most: int) -> None:
        self._chosen = {ip: BlockSize(size, CHOSEN) for ip, size in sizes.items()}
        self._kinds = {
            ip: BlockSize(s7.cpus()[kind].block, KIND, None, kind) for ip, kind in kinds.items()
        }
        self._most = most
        self._stated: dict[str, BlockSize] = {}

    def evidence(self, ip: str, found: SzlEvidence) -> None:
        """A partner said what it is; of two numbers the larger one counts."""
        value = found.value
        if isinstance(value, str):
            cpu = s7.cpu_of_order(value)
            block = BlockSize(cpu.block, ORDER, found.at.frame, value) if cpu else None
        else:
            block = BlockSize(value, SAID, found.at.frame) if value > 0 else None
        before = self._stated.get(ip)
        if block is None or (before is not None and before.size >= block.size):
            return
        if before is not None or len(self._stated) < self._most:
            self._stated[ip] = block

    def of(self, ip: str) -> BlockSize | None:
        """The block size of a partner; None if unknown."""
        for table in (self._chosen, self._kinds):
            block = table and (table.get(ip) or table.get(ANYBODY))
            if block:
                return block
        return self._stated.get(ip)
