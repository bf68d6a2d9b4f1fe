"""The classic pcap format: microseconds and nanoseconds, both byte orders.

Lives here: the file header, what a record header means, what is wrong where the scan stops. Not
here: the walk over the records (scan.py), compression and stdin (stream.py).
Format: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from .ahead import Batches
from .errors import CaptureError
from .frame import Frame
from .scan import MAX_FRAME, ByteOrder, Found, PcapScan
from .stream import Window

_FILE_HEADER = 24

# magic as a big-endian number: nanoseconds of one unit of the fraction, length of a record header
_MAGICS = {
    0xA1B2C3D4: (1000, 16),
    0xA1B23C4D: (1, 16),
    0xA1B2CD34: (1000, 24),  # Kuznetzov's patched libpcap
}


def recognised(head: bytes) -> bool:
    """True when `head`, the first 4 bytes of a file, is a pcap magic number."""
    return _order(head) is not None


def _order(head: bytes) -> ByteOrder | None:
    orders: tuple[ByteOrder, ByteOrder] = ("little", "big")
    for order in orders:
        if int.from_bytes(head[:4], order) in _MAGICS:
            return order
    return None


class PcapReader:
    """Frames of one pcap file that may matter, in order.

    `frames` counts all that were passed, `problem` is one line when the file is damaged. Raises CaptureError
    when the file header is not whole.
    """

    dropped: int | None = None  # the format cannot say

    def __init__(self, window: Window) -> None:
        if not window.more(0, _FILE_HEADER):
            reason = window.broken or f"it has {window.end} bytes, the file header alone has 24"
            raise CaptureError(f"the pcap file header is not whole: {reason}")
        order = _order(bytes(window.data[:4]))
        assert order is not None, "only called for recognised files"
        magic = int.from_bytes(window.data[:4], order)
        self._unit, self._header = _MAGICS[magic]
        self._sign = "<" if order == "little" else ">"
        # the upper bits say how long a frame check sequence is; IP lengths tell that better
        self.link_type = int.from_bytes(window.data[20:24], order) & 0x03FFFFFF
        self._window = window
        self._scan = PcapScan(order, self._header, self.link_type)
        self._scan.position = _FILE_HEADER
        self._batches = Batches(self._scan, window)
        self.frames = 0
        self.first_ns: int | None = None
        self.problem: str | None = None

    def read(self) -> Iterator[list[Frame]]:
        """Yield the frames that may matter, some at once; sets `problem` when it must stop early."""
        self._first()
        while True:
            for found in self._batches:
                yield self._records(found)
            self.frames = self._scan.frames
            if not self._continue():
                return

    def _first(self) -> None:
        """The time of the first record, which the scan may leave out."""
        window, scan = self._window, self._scan
        whole = window.more(scan.position, self._header)
        scan.position = 0
        if whole:
            seconds, fraction = struct.unpack_from(self._sign + "2I", window.data)
            self.first_ns = seconds * 1_000_000_000 + fraction * self._unit

    def _records(self, found: list[Found]) -> list[Frame]:
        """Records, as the scan found them, as frames."""
        link_type, unit, frames = self.link_type, self._unit, []
        second, second_ns = 0, 0
        for number, _, seconds, fraction, original, data in found:
            if seconds != second:  # products of large numbers are slow where this is compiled
                second, second_ns = seconds, seconds * 1_000_000_000
            frames.append(Frame(number, second_ns + fraction * unit, link_type, data, original))
        if frames:
            self.frames = frames[-1].number
        return frames

    def close(self) -> None:
        """Let go of the file."""
        self._batches.close()

    def _continue(self) -> bool:
        """Get what the record in front of the scan needs; False at the end or at damage."""
        window, scan, header = self._window, self._scan, self._header
        whole = window.more(scan.position, header)
        scan.position = 0
        if not whole:
            if window.end or window.broken:
                self._cut_off(header)
            return False
        (captured,) = struct.unpack_from(self._sign + "I", window.data, 8)
        if captured > MAX_FRAME:
            self.problem = (
                f"damaged at byte {window.base}: frame {self.frames + 1} claims {captured} "
                f"captured bytes, more than {MAX_FRAME}; only the frames before it are reported"
            )
            return False
        if not window.more(0, header + captured):
            self._cut_off(header + captured)
            return False
        return True

    def _cut_off(self, need: int) -> None:
        window = self._window
        self.problem = window.broken or (
            f"cut off at byte {window.base}: frame {self.frames + 1} needs {need} bytes and "
            f"{window.end} are left"
        )
        self.problem += "; only the frames before it are reported"
