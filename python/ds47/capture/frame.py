"""What a capture consists of: one frame.

Plain data; how it gets out of a file is in pcap.py and pcapng.py, what it means in `ds47.profinet`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True, init=False)
class Frame:
    """One captured frame.

    `number` counts from 1 as Wireshark does for the same file. `time_ns` is in nanoseconds since
    1970-01-01T00:00Z (a pcapng Simple Packet Block has no time: it gets that of the frame yielded
    before it). `link_type` is a LINKTYPE_ number (1 is Ethernet). `data` are the captured bytes,
    `original_length` how many there were on the wire.
    """

    number: int
    time_ns: int
    link_type: int
    data: bytes
    original_length: int

    def __init__(
        self,
        number: int,
        time_ns: int,
        link_type: int,
        data: bytes,
        original_length: int,
    ) -> None:
        self.number = number
        self.time_ns = time_ns
        self.link_type = link_type
        self.data = data
        self.original_length = original_length
