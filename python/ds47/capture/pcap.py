"""The classic pcap format: microseconds and nanoseconds, both byte orders.

Lives here: the file header, what a record header means, what is wrong where the scan stops. Not
here: the walk over the records (scan.py), compression and stdin (stream.py).
Format: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

from .errors import CaptureError
from .frame import Frame, Interface, WholeFrame
from .scan import MAX_FRAME, ByteOrder, Found, PcapScan
from .stream import Window
from .walk import Walk

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


class PcapReader(Walk):
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
        link_type = int.from_bytes(window.data[20:24], order) & 0x03FFFFFF
        self._interface = Interface(link_type, int.from_bytes(window.data[16:20], order))
        self._record = struct.Struct(self._sign + "4I")
        super().__init__(window, PcapScan(order, self._header, link_type))
        self._scan.position = _FILE_HEADER

    def read(self) -> Iterator[list[Frame]]:
        """Yield the frames that may matter, some at once; sets `problem` when it must stop early."""
        self._first()
        while True:
            for found in self._batches:
                yield self._records(found)
            self.frames = self._scan.frames
            if self.frames:
                self.last_ns = self._time_ns(self._scan.high, self._scan.low)
            if not self._continue():
                return

    def everything(self, wanted: Callable[[int], bool]) -> Iterator[WholeFrame]:
        """Yield the frames of these numbers with all that the file says of them; `problem` as `read`."""
        window, scan, header = self._window, self._scan, self._header
        self._first()
        while self._continue():
            at = scan.position
            seconds, fraction, captured, original = self._record.unpack_from(window.data, at)
            scan.position = at + header + captured
            self.frames += 1
            self.last_ns = time_ns = self._time_ns(seconds, fraction)
            if wanted(self.frames):
                data = bytes(window.view[at + header : scan.position])
                yield WholeFrame(self.frames, time_ns, self._interface, data, original)

    def _first(self) -> None:
        """The time of the first record, which the scan may leave out."""
        if self._have(self._header):
            record = self._record.unpack_from(self._window.data, self._scan.position)
            self.first_ns = self._time_ns(*record[:2])

    def _time_ns(self, seconds: int, fraction: int) -> int:
        return seconds * 1_000_000_000 + fraction * self._unit

    def _records(self, found: list[Found]) -> list[Frame]:
        """Records, as the scan found them, as frames."""
        link_type, unit, frames = self._interface.link_type, self._unit, []
        second, second_ns = 0, 0
        for number, _, seconds, fraction, original, data in found:
            if seconds != second:  # products of large numbers are slow where this is compiled
                second, second_ns = seconds, seconds * 1_000_000_000
            frames.append(Frame(number, second_ns + fraction * unit, link_type, data, original))
        if frames:
            self.frames = frames[-1].number
        return frames

    def _continue(self) -> bool:
        """Get what the record in front of the scan needs; False at the end or at damage."""
        header = self._header
        if not self._have(header):
            if self._left or self._window.broken:
                self._cut_off(header)
            return False
        captured = self._record.unpack_from(self._window.data, self._scan.position)[2]
        if captured > MAX_FRAME:
            self.problem = (
                f"damaged at byte {self._offset}: frame {self.frames + 1} claims {captured} "
                f"captured bytes, more than {MAX_FRAME}; only the frames before it are reported"
            )
            return False
        if not self._have(header + captured):
            self._cut_off(header + captured)
            return False
        return True

    def _cut_off(self, need: int) -> None:
        self.problem = self._window.broken or (
            f"cut off at byte {self._offset}: frame {self.frames + 1} needs {need} bytes and "
            f"{self._left} are left"
        )
        self.problem += "; only the frames before it are reported"
