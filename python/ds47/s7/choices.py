"""What a user may choose for S7: ports, and how many bytes which server copies at once (docs/s7.md 9).

From the words of the command line, of `ds47.toml` and of Python to values; what they do is known elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ds47.capture.scan import MOST_PORTS
from ds47.spec import s7

PORT = 102
"""ISO on TCP."""
_MOST_BYTES = 0xFFFF


class Choices(NamedTuple):
    """What a user may choose.

    Attributes:
        ports: of TCP, beside 102.
        blocks: bytes that a server copies at once, by its address; "" stands for all others.
        cpus: kinds of servers (`spec.s7.cpus`) likewise.
        readback: whether what is read has to be what was written (DS916).
    """

    ports: tuple[int, ...] = ()
    blocks: tuple[tuple[str, int], ...] = ()
    cpus: tuple[tuple[str, str], ...] = ()
    readback: bool = False

    @property
    def every_port(self) -> tuple[int, ...]:
        """All ports of TCP that are wanted."""
        return (PORT, *self.ports)

    def and_then(self, other: Choices) -> Choices:
        """Both; where they differ the other one counts."""
        return Choices(
            (*self.ports, *other.ports), (*self.blocks, *other.blocks), (*self.cpus, *other.cpus),
            self.readback or other.readback,
        )  # fmt: skip


def parse(
    ports: Sequence[int] = (),
    cpus: Sequence[str] = (),
    blocks: Sequence[str] = (),
    readback: bool = False,
) -> Choices:
    """The choices in words: kinds of CPU and bytes as `s7-400`, or `10.0.0.2=s7-400` for one server.

    Raises:
        ValueError: the name of what is wrong, then what is allowed.
    """
    wrong = [each for each in ports if not 0 < each <= 0xFFFF]
    if wrong or len({*ports, PORT}) > MOST_PORTS:
        raise ValueError(
            f"port {wrong[0] if wrong else ports[-1]}: up to {MOST_PORTS - 1} ports of TCP"
        )
    return Choices(
        tuple(ports), tuple(map(_block, blocks)), tuple(map(_cpu, cpus)), readback
    )  # fmt: skip


def _cpu(text: str) -> tuple[str, str]:
    ip, _, name = text.rpartition("=")
    if name not in s7.cpus():
        raise ValueError(f"cpu {text!r}: {', '.join(s7.cpus())}; for one server 10.0.0.2=s7-400")
    return ip, name


def _block(text: str) -> tuple[str, int]:
    ip, _, size = text.rpartition("=")
    if not (size.isdecimal() and size.isascii() and 0 < int(size) <= _MOST_BYTES):
        raise ValueError(f"block {text!r}: a number of bytes, for one server 10.0.0.2=462")
    return ip, int(size)
