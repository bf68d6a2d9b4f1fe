"""Every cyclic frame of a drive around one frame, for a picture of some cycles: the file is read once more.

The analysis looks at frames in which something changes and at samples of the others, so it does not know them all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from ds47.capture import CaptureError, open_capture
from ds47.capture.frame import Frame
from ds47.capture.scan import PROFINET, network_layer
from ds47.cyclic import pzd
from ds47.model import Relation
from ds47.profinet.link import GROUP, addresses

REACH: Final = 4000
"""So many frames before and after the one are looked at."""


class SpeedSample(NamedTuple):
    """A frame of one side: its number, its time (nanoseconds since 1970), and the word behind STW1 or ZSW1.

    `raw` is the setpoint as it is effective, or the actual value; 16384 is 100 %.
    """

    frame: int
    time_ns: int
    by_controller: bool
    raw: int


def closeup(
    path: str, relation: Relation, frame: int, half_ns: int, *, others: bool = False
) -> list[SpeedSample]:
    """The frames of a drive around a frame, `half_ns` nanoseconds before and after; empty where there is no file.

    Args:
        path: the capture.
        relation: its PZD.
        frame: the number of a frame in it.
        half_ns: how far to look, in nanoseconds.
        others: whether the drive is known to be of another maker than Siemens.
    """
    if not Path(path).is_file():
        return []
    found: list[SpeedSample] = []
    middle = None
    try:
        with open_capture(path) as capture:
            for each in capture.everything(lambda number: abs(number - frame) <= REACH):
                middle = each.time_ns if each.number == frame else middle
                seen = _seen(each, relation, others)
                if seen is not None:
                    found.append(seen)
                if each.number == frame + REACH:
                    break
    except CaptureError:
        return []
    return [each for each in found if middle is not None and abs(each.time_ns - middle) <= half_ns]


def _seen(frame: Frame, relation: Relation, others: bool) -> SpeedSample | None:
    kind, at = network_layer(frame.data, 0, len(frame.data), frame.link_type)
    source, receiver = addresses(frame)
    sender = source, int.from_bytes(frame.data[at : at + 2])
    output, input_ = relation.output, relation.input
    for side, other, by_controller in ((output, input_, True), (input_, output, False)):
        words = frame.data[at + 2 + side.offset : at + 6 + side.offset]
        to_it = receiver in (None, other.mac) or frame.data[0] & GROUP
        if kind == PROFINET and sender == (side.mac, side.frame_id) and to_it and len(words) == 4:
            raw = int.from_bytes(words[2:], signed=True)
            turned = by_controller and pzd.turns(int.from_bytes(words[:2]), others)
            return SpeedSample(frame.number, frame.time_ns, by_controller, -raw if turned else raw)
    return None
