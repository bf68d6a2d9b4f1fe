"""What a CPU says about itself in the answer to a read of a system status list (SZL; docs/s7.md 6).

Only lists that tell which CPU it is, or how many bytes it reads consistently for a panel.
"""

from __future__ import annotations

from collections.abc import Iterator

from ds47.s7.model import DONE, At, SzlEvidence
from ds47.s7.pdu import UserData

# Entries of an SZL: the bytes of one, where in it the text or number begins, and how many bytes that has
_SZL = {
    (0x0131, 3): ("consistent", 40, 6, 2),
    (0x0011, 0): ("order_number", 28, 2, 20),
    (0x0111, 1): ("order_number", 28, 2, 20),
    (0x001C, 0): ("module", 34, 2, 32),
    (0x011C, 7): ("module", 34, 2, 32),
}
_ENTRY_OF = {"consistent": 3, "order_number": 1, "module": 7}
"""The index of the entry that has it."""


def evidence(data: UserData, at: At) -> Iterator[SzlEvidence]:
    """What the answer to the reading of an SZL says of the CPU."""
    content = data.content
    if data.code != DONE or len(content) < 8:
        return
    szl_id, szl_index, length, number = (content[i] << 8 | content[i + 1] for i in (0, 2, 4, 6))
    name, size, begin, bytes_ = _SZL.get((szl_id, szl_index), ("", 0, 0, 0))
    if not name or length != size:
        return
    for entry in range(min(number, (len(content) - 8) // size)):
        part = content[8 + entry * size : 8 + (entry + 1) * size]
        if part[0] << 8 | part[1] != _ENTRY_OF[name]:
            continue
        value = part[begin : begin + bytes_]
        if name == "consistent":
            yield SzlEvidence(at, szl_id, szl_index, name, int.from_bytes(value, "big"))
            continue
        text = value.split(b"\0")[0].decode("latin-1").strip()
        if text and text.isprintable():
            yield SzlEvidence(at, szl_id, szl_index, name, text)
