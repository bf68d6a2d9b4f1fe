"""Who sends cyclic frames: for a capture without a Connect, in which a user has to name the channels.

Only the first frames are looked at: cyclic frames come every few milliseconds. What is in them is not known.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Final

from ds47.capture.frame import Frame
from ds47.capture.scan import ETHERNET, PROFINET, network_layer
from ds47.model import Sender

FRAMES: Final = 2000
"""So many frames are looked at."""
_MOST = 64
_FIRST, _LAST = 0x0100, 0xFBFF
"""Frame ids of cyclic frames."""
_STATES = 6
"""Bytes of the frame id in front of the data, and of cycle counter and states behind it."""


def senders(frames: Iterable[Frame]) -> list[Sender]:
    """The senders of cyclic frames among the first frames, in the order in which they are met."""
    found: dict[tuple[bytes, int], Sender] = {}
    for frame in islice(frames, FRAMES):
        data = frame.data
        if frame.link_type != ETHERNET or len(found) >= _MOST:
            continue
        kind, at = network_layer(data, 0, len(data), ETHERNET)
        frame_id = int.from_bytes(data[at : at + 2])
        key = data[6:12], frame_id
        if kind == PROFINET and _FIRST <= frame_id <= _LAST and key not in found:
            length = max(0, frame.original_length - at - _STATES)
            found[key] = Sender(data[6:12].hex(":"), data[:6].hex(":"), frame_id, length)
    return list(found.values())
