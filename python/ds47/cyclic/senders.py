"""Who sends cyclic frames: for a capture without a Connect, in which a user has to name the channels.

Only the first frames are looked at: cyclic frames come every few milliseconds. Where words stand in them is
tried in `search`.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice, starmap
from typing import Final

from ds47.capture.frame import Frame
from ds47.capture.scan import ETHERNET, PROFINET, network_layer
from ds47.model import Sender

FRAMES: Final = 2000
"""So many frames are looked at."""
RT_MARK: Final = PROFINET.to_bytes(2, "big")
"""The bytes that each cyclic frame has somewhere."""
_MOST = 64
_FIRST, _LAST = 0x0100, 0xFBFF
"""Frame ids of cyclic frames."""
_STATES = 6
"""Bytes of the frame id in front of the data, and of cycle counter and states behind it."""
_ID = 2

_Key = tuple[bytes, int]
_Images = list[tuple[int, bytes]]


def senders(frames: Iterable[Frame]) -> list[Sender]:
    """The senders of cyclic frames among the first frames, in the order in which they are met."""
    found: dict[_Key, Sender] = {}
    images: dict[_Key, _Images] = {}
    for frame in islice(frames, FRAMES):
        data = frame.data
        if frame.link_type != ETHERNET:
            continue
        kind, at = network_layer(data, 0, len(data), ETHERNET)
        frame_id = int.from_bytes(data[at : at + _ID])
        key = data[6:12], frame_id
        if kind != PROFINET or not _FIRST <= frame_id <= _LAST:
            continue
        length = max(0, frame.original_length - at - _STATES)
        if key not in found and len(found) < _MOST:
            found[key] = Sender(data[6:12].hex(":"), data[:6].hex(":"), frame_id, length)
        if key in found:
            said = frame.time_ns, data[at + _ID : at + _ID + length]
            images.setdefault(key, []).append(said)
    _look(found, images)
    return list(found.values())


def _look(found: dict[_Key, Sender], images: dict[_Key, _Images]) -> None:
    """Says of two that send to each other where control and status word stand, where their frames show it."""
    for one, other in [(a, b) for a in found for b in found if found[a].is_answered_by(found[b])]:
        from ds47.cyclic.search import Sample, offsets  # few captures need it

        words_at = offsets(*(list(starmap(Sample, images[each])) for each in (one, other)))
        if words_at is not None and found[one].word is None and found[other].word is None:
            found[one] = found[one]._replace(word="STW1", offset=words_at[0])
            found[other] = found[other]._replace(word="ZSW1", offset=words_at[1])
