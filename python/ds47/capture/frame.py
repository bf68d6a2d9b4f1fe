"""One frame of a capture, and what else the file says about it.

Plain data. pcap.py and pcapng.py read it from a file; `ds47.profinet` knows what it means.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ds47.spec.plain import Plain


@dataclass(slots=True, init=False, repr=False, eq=False)
class Frame(Plain):
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


@dataclass(slots=True, eq=False, repr=False)
class Interface:
    """What a file says about an interface; `options` are those for a person, as (code, value).

    A timestamp t of pcapng is t * numerator // denominator nanoseconds, plus the offset.
    """

    link_type: int
    snap_length: int
    options: list[tuple[int, bytes]] = field(default_factory=list)
    numerator: int = 1000
    denominator: int = 1
    offset_ns: int = 0

    def time_ns(self, high: int, low: int) -> int:
        """A timestamp in nanoseconds since 1970."""
        return (high << 32 | low) * self.numerator // self.denominator + self.offset_ns

    def resolution(self, code: int) -> None:
        """Set if_tsresol: a negative power of 10, or with bit 7 set of 2."""
        units = 2 ** (code & 0x7F) if code & 0x80 else 10**code
        if 1_000_000_000 % units == 0:
            self.numerator, self.denominator = 1_000_000_000 // units, 1
        else:
            self.numerator, self.denominator = 1_000_000_000, units


@dataclass(slots=True, init=False)
class WholeFrame(Frame):
    """A frame with everything in its file: `comments` are packet comments, `flags` is epb_flags."""

    interface: Interface
    comments: list[str]
    flags: int | None

    def __init__(
        self, number: int, time_ns: int, interface: Interface, data: bytes, original_length: int
    ) -> None:
        Frame.__init__(self, number, time_ns, interface.link_type, data, original_length)
        self.interface = interface
        self.comments = []
        self.flags = None
