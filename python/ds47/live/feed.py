"""Bytes as they come, and requests of the user in between: a file object that never blocks the user.

A thread reads the capture and another one the keyboard; both put what they got into one queue, and so
do signal handlers. All else happens in the one thread that calls `read1`. The same way on all systems:
Windows cannot wait for a pipe and the keyboard at once.
"""

from __future__ import annotations

import os
import queue
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Literal

from ds47.capture.names import STDIN

_CHUNK = 1 << 16
_CHUNKS_AHEAD = 16
"""How far the reading thread may be ahead of the analysis: then the pipe fills, and dumpcap waits."""
_PATIENCE = 0.25
"""Seconds after which the main thread looks up, so that Ctrl-C works on Windows."""
_LAST_SECONDS = 3.0
"""How long after a wish to stop the rest of the capture may take."""

_Event = tuple[Literal["data", "end", "stop", "summary"], bytes]


class Feed:
    """The source of a live capture, for `ds47.capture.open_capture`.

    Args:
        descriptor: of the pipe or file to read.
        on_summary: called when the user asks for a summary.
        on_stop: called when the user stops: ends the writer of the pipe.
        drain: whether there will be an end of the pipe then, worth waiting for.
        follow: whether the end of the file is only the end so far: more may be written behind it.
        seconds: after which it stops by itself, whether or not the writer of the pipe does.
    """

    def __init__(
        self,
        descriptor: int,
        on_summary: Callable[[], None],
        on_stop: Callable[[], None],
        drain: bool = False,
        follow: bool = False,
        seconds: float | None = None,
    ) -> None:
        self._descriptor = descriptor
        self._on_summary = on_summary
        self._on_stop = on_stop
        self._drain = drain
        self._follow = follow
        self._events: queue.SimpleQueue[_Event] = queue.SimpleQueue()
        self._room = threading.Semaphore(_CHUNKS_AHEAD)
        self._left = b""
        self._ended = False
        self._last = None if seconds is None else time.monotonic() + seconds
        self._deadline: float | None = None
        self._closed = False
        self.problem: str | None = None
        """What the reading of the pipe failed of."""
        self._thread = threading.Thread(target=self._read_source, daemon=True)
        self._thread.start()

    @property
    def stopped(self) -> bool:
        """Whether the user stopped: then a truncated capture is no fault."""
        return self._deadline is not None

    def stop(self) -> None:
        """Wish to stop; may be called from a signal handler."""
        self._events.put(("stop", b""))

    def summary(self) -> None:
        """Wish for a summary; may be called from a signal handler."""
        self._events.put(("summary", b""))

    def close(self) -> bool:
        """Nothing is wanted any more; whether the reading thread has ended, and leaves the descriptor alone."""
        self._closed = True
        self._room.release()
        self._thread.join(2 * _PATIENCE)
        return not self._thread.is_alive()

    def read1(self, size: int = _CHUNK) -> bytes:
        """What there is, at least one byte; b"" at the end."""
        while not self._left and not self._ended:
            self._take()
        piece, self._left = self._left[:size], self._left[size:]
        return piece

    read = read1

    def _take(self) -> None:
        """Waits for one event and does what it asks for."""
        now = time.monotonic()
        if self._deadline is not None and now > self._deadline:  # however much still comes
            self._ended = True
            return
        if self._deadline is None and self._last is not None and now > self._last:
            self._begin_to_stop()
        try:
            kind, data = self._events.get(timeout=_PATIENCE)
        except queue.Empty:
            return
        if kind == "data":
            self._room.release()
            self._left = data
        elif kind == "summary":
            self._on_summary()
        elif kind == "end":
            self._ended = True
        elif self._deadline is None:
            self._begin_to_stop()
        else:  # asked for twice
            self._ended = True

    def _begin_to_stop(self) -> None:
        self._on_stop()
        self._follow = False
        self._deadline = time.monotonic() + (_LAST_SECONDS if self._drain else _PATIENCE)

    def _read_source(self) -> None:
        """The reading thread. `os.read`: a thread that waits in a buffered file hangs the exit."""
        try:
            for data in self._pieces():
                self._room.acquire()
                self._events.put(("data", data))
        except OSError as problem:
            self.problem = problem.strerror or str(problem)
        self._events.put(("end", b""))

    def _pieces(self) -> Iterator[bytes]:
        while not self._closed:
            if data := os.read(self._descriptor, _CHUNK):
                yield data
            elif not self._follow:
                return
            elif os.fstat(self._descriptor).st_size < os.lseek(self._descriptor, 0, os.SEEK_CUR):
                self.problem = "the file became shorter while it was followed"
                return
            else:
                time.sleep(_PATIENCE)

    @contextmanager
    def listening(self, keyboard: int | None) -> Iterator[None]:
        """While signals and the Enter key on a terminal become wishes."""
        if keyboard is not None:
            threading.Thread(target=self._read_keyboard, args=(keyboard,), daemon=True).start()

        def stop(_number: int, _frame: FrameType | None) -> None:
            self.stop()

        def summary(_number: int, _frame: FrameType | None) -> None:
            self.summary()

        wanted = {"SIGINT": stop, "SIGTERM": stop, "SIGBREAK": stop,
                  "SIGUSR1": summary, "SIGINFO": summary}  # fmt: skip
        before = {}
        for name, handler in wanted.items():
            number = getattr(signal, name, None)
            if number is not None:
                with suppress(ValueError):  # not in the main thread
                    before[number] = signal.signal(number, handler)
        try:
            yield
        finally:
            for number, handler_before in before.items():
                signal.signal(number, handler_before)

    def _read_keyboard(self, descriptor: int) -> None:
        with suppress(OSError):
            while os.read(descriptor, 1024):
                self.summary()


def opened(source: str) -> int:
    """The descriptor of standard input, of a named pipe, of a file. Raises OSError."""
    if source == STDIN:
        return sys.stdin.fileno()
    return os.open(source, os.O_RDONLY | getattr(os, "O_BINARY", 0))


def grows(source: str, descriptor: int) -> bool:
    """Whether a source is a file that was named, so that its end need not be the end of the capture."""
    return source != STDIN and stat.S_ISREG(os.fstat(descriptor).st_mode)


def keyboard(source: int) -> int | None:
    """The descriptor of a terminal where the user may press Enter; None without one."""
    with suppress(OSError, ValueError):
        if sys.stdin.isatty() and sys.stdin.fileno() != source:
            return sys.stdin.fileno()
    with suppress(OSError, ValueError):
        if sys.stderr.isatty():
            name = "CONIN$" if sys.platform == "win32" else "/dev/tty"
            if sys.platform == "win32" or os.tcgetpgrp(sys.stderr.fileno()) == os.getpgrp():
                return os.open(name, os.O_RDONLY)
    return None
