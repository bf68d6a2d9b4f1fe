"""The frames that a scan finds in a stream, batch by batch; in a thread of its own if that pays.

Lives here: when there is a thread, how far it may be ahead, how it ends. Not here: the walk over the
frames (scan.py), the buffer (stream.py), blocks that stop the walk (pcap.py, pcapng.py).

A compiled scan of a large plain file also reads the file, without the interpreter, while the main thread makes
transactions of earlier frames. It only handles the usual case: at the end of the file, at damage or at a block
that is no frame, it stops. The thread ends, and reading goes on as if there had been none. So only one place
says what is wrong with a file. Uncompiled, the scan needs the interpreter, and a thread gains nothing.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

from .scan import BATCH, COMPILED, Found, Scan
from .stream import Window

if TYPE_CHECKING:
    from queue import SimpleQueue

FROM = 1 << 24
"""From this file size on a thread pays, in bytes."""
NAME = "ds47 reading ahead"
"""The name of each thread in a debugger."""
_BATCHES = 4
"""How many batches the thread may be ahead."""


class Batches:
    """The frames that `scan` finds in `window`, up to a block that stops it; iterate again after that block.

    Call `close` unless all of them are taken.
    """

    def __init__(self, scan: Scan, window: Window) -> None:
        self._scan = scan
        self._window = window
        self._thread: _Thread | None = None
        self._next = 0  # a thread may start from this offset on

    def __iter__(self) -> Iterator[list[Found]]:
        if COMPILED and self._window.base >= self._next:
            yield from self._ahead()
        scan, window = self._scan, self._window
        more = True
        while more:
            found = scan.scan(window.data, window.end)
            yield found
            more = len(found) == BATCH or scan.paused

    def _ahead(self) -> Iterator[list[Found]]:
        descriptor = self._window.large_file(FROM)
        if descriptor is None:
            return
        begin = self._window.base
        self._thread = _Thread(self._scan, self._window, descriptor)
        try:
            yield from self._thread.batches()
        finally:
            self.close()
        if self._window.base < begin + FROM:
            # other blocks stand between the frames, and more will follow: a thread does not pay
            self._next = self._window.base + FROM

    def close(self) -> None:
        """Ends the thread, if there is one."""
        if self._thread is not None:
            self._thread.stop()
            self._thread = None


class _Thread:
    """One run of a scan through a file. While it lasts, scan, window and file are its own."""

    def __init__(self, scan: Scan, window: Window, descriptor: int) -> None:
        from queue import SimpleQueue  # few captures are large, and fewer scans compiled

        self._scan = scan
        self._found: SimpleQueue[list[Found] | BaseException | None] = SimpleQueue()
        self._room: SimpleQueue[None] = SimpleQueue()
        for _ in range(_BATCHES):
            self._room.put(None)
        scan.stopped = False
        # a daemon: the interpreter can exit without `stop`
        self._thread = threading.Thread(
            target=_run,
            args=(scan, window, descriptor, self._found, self._room),
            name=NAME,
            daemon=True,
        )
        self._thread.start()

    def batches(self) -> Iterator[list[Found]]:
        """The batches it finds. Raises what went wrong in the thread."""
        while (found := self._found.get()) is not None:
            if isinstance(found, BaseException):
                raise found
            yield found
            self._room.put(None)

    def stop(self) -> None:
        """End the thread; scan and window stay at its position."""
        self._scan.stopped = True
        self._room.put(None)
        if self._thread is not threading.current_thread():  # garbage collection may call this there
            self._thread.join()


def _wait(scan: Scan, room: SimpleQueue[None]) -> None:
    """Waits until all batches are taken: they decide how the scan goes on."""
    taken = 0
    while taken < _BATCHES and not scan.stopped:
        room.get()
        taken += 1
    for _ in range(taken):
        room.put(None)


def _run(
    scan: Scan,
    window: Window,
    descriptor: int,
    found: SimpleQueue[list[Found] | BaseException | None],
    room: SimpleQueue[None],
) -> None:
    """The body of the thread; a function, so that it does not keep the iterating object alive."""
    try:
        more = True
        while more:
            room.get()
            found.put(scan.ahead(descriptor, window.data, window.end))
            window.take_over(scan.end, scan.passed)
            more = scan.more
            if scan.paused:
                _wait(scan, room)
    except BaseException as problem:  # noqa: BLE001 (raised again where the frames are taken)
        found.put(problem)
    found.put(None)
