"""Read and write of records: the data of MS1, and of MS2, which has the same (docs/profibus.md 4).

One message at a time. The frame around it is `telegram`, the record inside (DS47) `ds47.profidrive`; which polls
and answers belong together is not here.
"""

from __future__ import annotations

from dataclasses import dataclass

from ds47.spec import profibus
from ds47.spec.words import Flaw

REQUEST, POLL, ANSWER, TAKEN, REFUSAL = "request", "poll", "answer", "taken", "refusal"
"""Kinds of a message: asked, asked again without data, answered, answered without data, refused."""
READ, WRITE = 0x5E, 0x5F
MOST_DATA = 240
"""Bytes of a record; as the length of a read it asks for as much as there is."""

_HEAD = 4


@dataclass(frozen=True, slots=True)
class Ms1Message:
    """A message; what it does not have is None or empty.

    `length` is what the message says, `data` what is there of the record, at most so much. `error_*` are the three
    bytes of a refusal.
    """

    kind: str
    code: int | None = None
    """The first byte."""
    slot: int | None = None
    index: int | None = None
    length: int | None = None
    data: bytes = b""
    error_decode: int | None = None
    error_code_1: int | None = None
    error_code_2: int | None = None
    flaws: tuple[Flaw, ...] = ()

    @property
    def function(self) -> str | None:
        """The id of its function, "read" or "write" for records; None for one that is unknown."""
        if self.code is None:
            return None
        rows = profibus.refusals() if self.kind == REFUSAL else profibus.functions()
        row = rows.get(self.code)
        return None if row is None else row.id

    @property
    def status(self) -> int | None:
        """A refusal as PROFINET has it, 32 bits with the function in the highest byte: DE80B500."""
        if None in (self.code, self.error_decode, self.error_code_1, self.error_code_2):
            return None
        parts = (
            self.code or 0,
            self.error_decode or 0,
            self.error_code_1 or 0,
            self.error_code_2 or 0,
        )
        return int.from_bytes(bytes(parts))

    @property
    def not_ready(self) -> bool:
        """Whether the answer is not there yet, and has to be asked for again."""
        return (
            self.error_decode,
            self.error_code_1,
        ) == profibus.not_ready() and self.function == "read"


def decode(data: bytes, request: bool) -> Ms1Message:
    """A message from the data of its frame, whatever that is (docs/profibus.md 4).

    Args:
        data: the data unit, SAPs not included.
        request: whether the master sent it.
    """
    if not data:
        return Ms1Message(POLL if request else TAKEN)
    code = data[0]
    if not request and code in profibus.refusals():
        return _refusal(data)
    kind = REQUEST if request else ANSWER
    if code not in (READ, WRITE):
        return Ms1Message(kind, code, data=data[1:])
    slot, index, length = (data[at] if at < len(data) else None for at in (1, 2, 3))
    rest = data[_HEAD:]
    flaws = _flaws(data, length, len(rest), carries=(code == WRITE) == request)
    return Ms1Message(kind, code, slot, index, length, rest[:length], flaws=flaws)


def _flaws(data: bytes, length: int | None, there: int, carries: bool) -> tuple[Flaw, ...]:
    """What does not fit; some manuals print a length that is not that of the data."""
    if length is None:
        return (Flaw("data", len(data), {"have": len(data), "want": _HEAD}),)
    if carries and length != there:
        return (Flaw("record_length", 3, {"says": length, "there": there}),)
    if not carries and there:
        return (Flaw("more", _HEAD, {"n": there}),)
    return ()


def _refusal(data: bytes) -> Ms1Message:
    decode_byte, first, second = (data[at] if at < len(data) else None for at in (1, 2, 3))
    flaws: tuple[Flaw, ...] = ()
    if len(data) < _HEAD:
        flaws = (Flaw("data", len(data), {"have": len(data), "want": _HEAD}),)
    elif len(data) > _HEAD:
        flaws = (Flaw("more", _HEAD, {"n": len(data) - _HEAD}),)
    return Ms1Message(
        REFUSAL, data[0], data=data[_HEAD:], error_decode=decode_byte, error_code_1=first,
        error_code_2=second, flaws=flaws,
    )  # fmt: skip
