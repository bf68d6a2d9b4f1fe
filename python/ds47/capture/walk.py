"""What the readers of both formats have in common: where they stand in the capture.

Not here: the formats (pcap.py, pcapng.py), the loops that pass what does not matter (scan.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from .ahead import Batches
from .scan import Scan, Watch
from .stream import Window


class Walk:
    """Stands in front of a record or block. `frames` counts what was passed; `problem` says what is broken."""

    def __init__(self, window: Window, scan: Scan) -> None:
        self._window = window
        self._scan = scan
        self._batches = Batches(scan, window)
        self.frames = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.problem: str | None = None
        self.timed = True
        """Whether frames have times."""

    def watch(self, watches: Sequence[Watch]) -> None:
        """From the next frame on these cyclic frames matter too, and no others."""
        self._scan.watch(watches)

    def tcp(self, ports: Iterable[int]) -> None:
        """From the next frame on those of these ports of TCP matter too."""
        self._scan.tcp(ports)

    def close(self) -> None:
        """Let go of the file, and of what was read of it."""
        self._batches.close()
        self._window.close()

    @property
    def _offset(self) -> int:
        """Where this stands in the (decompressed) capture."""
        return self._window.base + self._scan.position

    @property
    def _left(self) -> int:
        """How many bytes of it are in memory."""
        return self._window.end - self._scan.position

    def _have(self, need: int) -> bool:
        """Have `need` bytes from here on; the window moves only when it has to."""
        scan, window = self._scan, self._window
        if window.end - scan.position >= need:
            return True
        whole = window.more(scan.position, need)
        scan.position = 0
        return whole
