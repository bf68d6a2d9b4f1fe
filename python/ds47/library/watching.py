"""`ds47.watch`: transactions and findings of a line that goes on, as a program takes them: one after the other.

The analysis hands out what it finds, a program asks for it: a thread has the one, and a short queue is between.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from queue import Empty, Queue
from typing import Final, NamedTuple, Unpack

from ds47.analysis import AnalysisOptions
from ds47.capture import CaptureError, open_capture
from ds47.capture.names import STDIN
from ds47.library.choices import Choices, chosen
from ds47.live import dumpcap as dumpcaps
from ds47.live.dumpcap import Dumpcap
from ds47.live.feed import Feed, grows, opened
from ds47.live.traffic import Live
from ds47.model import Finding, Transaction

_AHEAD: Final = 256
"""How many the analysis may be ahead; then it waits, and so do the frames."""
_PATIENCE: Final = 0.25
"""Seconds after which a waiting thread looks up, so that Ctrl-C works on Windows."""


class Seen(NamedTuple):
    """Something that `watch` saw."""

    transaction: Transaction | None
    """One that has its response, or will never have one. None for a finding that comes alone: about no
    transaction, or about one that was seen before, whose id it has."""
    findings: list[Finding]
    """What was found about it so far; or that one finding."""
    before: Transaction | None
    """As it was seen before, where more came for it, such as a late response; None the first time."""


class _Source(NamedTuple):
    """What is watched, and how: the arguments of `watch`."""

    path: str | None
    interfaces: tuple[str, ...]
    capture_filter: str | None
    duration: float | None
    program: str | None
    follow: bool

    @property
    def name(self) -> str:
        return self.path or "+".join(self.interfaces)


def watch(
    source: str | Path | None = None,
    *,
    interfaces: str | Iterable[str] = (),
    capture_filter: str | None = None,
    duration: float | None = None,
    dumpcap: str | None = None,
    follow: bool = True,
    **choices: Unpack[Choices],
) -> Generator[Seen, None, None]:
    """Watches a line: hands out each transaction as soon as it has its response, and each finding.

    Memory does not grow with the time. The end of the loop, or `close()`, ends the capture.

    Args:
        source: a capture file that is still being written, a named pipe, or "-" for standard input; or None.
        interfaces: then those on which dumpcap captures: one, or several.
        capture_filter: for dumpcap, instead of the one that keeps what matters; "" captures everything.
        duration: seconds after which dumpcap ends.
        dumpcap: the program; None for that of the environment variable DS47_DUMPCAP, else the one that is found.
        follow: whether to wait for what is written behind the end of a file, without end.
        choices: keywords of `analyze`.

    Raises:
        ValueError: as for `analyze`; neither a source nor interfaces, or both.
        TypeError: as for `analyze`.
        Error: dumpcap is missing or may not capture; the source cannot be read, or, when all that could be read
            was handed out, not to its end. This and what follows is raised when the first one is asked for.
    """
    names = (interfaces,) if isinstance(interfaces, str) else tuple(interfaces)
    if (source is None) == (not names):
        raise ValueError("either a source or interfaces")
    of_dumpcap = (capture_filter, duration, dumpcap)
    if source is not None and of_dumpcap != (None, None, None):
        raise ValueError("capture_filter, duration and dumpcap go with interfaces")
    path = None if source is None else os.fspath(source)
    return _watched(
        _Source(path, names, capture_filter, duration, dumpcap, follow), chosen(choices)
    )


def _watched(source: _Source, options: AnalysisOptions) -> Generator[Seen, None, None]:
    with ExitStack() as stack:
        running = None
        if source.path is None:
            running = stack.enter_context(
                dumpcaps.start(
                    source.program,
                    source.interfaces,
                    source.capture_filter,
                    source.duration,
                    options,
                )
            )
        feed = stack.enter_context(_feeding(source, running))
        watching = _Watching(feed, source.name, options)
        stack.callback(watching.close)
        yield from watching
        complaint = running.problem() if running else None
        if problem := complaint or watching.problem or feed.problem:
            raise CaptureError(problem if source.name in problem else f"{source.name}: {problem}")


@contextmanager
def _feeding(source: _Source, running: Dumpcap | None) -> Iterator[Feed]:
    """The bytes of what is watched; what was opened for them is closed when nobody reads it any more."""
    if running is not None:
        feed = Feed(running.output.fileno(), _nothing, running.end)
        try:
            yield feed
        finally:
            running.end()
            feed.close()
        return
    assert source.path is not None
    try:
        descriptor = opened(source.path)
    except OSError as problem:
        raise CaptureError(f"{source.path}: cannot be opened: {problem.strerror}") from problem
    follow = source.follow and grows(source.path, descriptor)
    feed = Feed(descriptor, _nothing, _nothing, follow=follow)
    try:
        yield feed
    finally:
        if feed.close() and source.path != STDIN:  # else the thread still waits for the pipe
            os.close(descriptor)


def _nothing() -> None:
    """Nobody asks for a summary, and a file needs not be told that we stop."""


class _Watching:
    """An analysis in a thread; iterating gives what it sees. A listener of `Live`."""

    def __init__(self, feed: Feed, name: str, options: AnalysisOptions) -> None:
        self._feed = feed
        self._name = name
        self._options = options
        self._seen: Queue[Seen | None] = Queue(_AHEAD)
        self._over = False
        self._fault: BaseException | None = None
        self.problem: str | None = None
        """Why it ended before its end."""
        self._thread = threading.Thread(target=self._analyze, daemon=True)
        self._thread.start()

    def finished(self, transaction: Transaction, findings: list[Finding]) -> None:
        """One is seen the first time."""
        self._seen.put(Seen(transaction, [*findings], None))

    def changed(
        self, before: Transaction, transaction: Transaction, findings: list[Finding]
    ) -> None:
        """Something came for one that was seen."""
        self._seen.put(Seen(transaction, [*findings], before))

    def found(self, finding: Finding) -> None:
        """A finding comes alone."""
        self._seen.put(Seen(None, [finding], None))

    def __iter__(self) -> Iterator[Seen]:
        while (seen := self._next()) is not None:
            yield seen
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        """Ends the analysis, and what is between it and here."""
        self._feed.stop()
        self._feed.stop()  # twice: at once
        while self._next() is not None:
            pass
        self._thread.join()

    def _next(self) -> Seen | None:
        while not self._over:
            try:
                seen = self._seen.get(timeout=_PATIENCE)
            except Empty:
                continue
            self._over = seen is None
            return seen
        return None

    def _analyze(self) -> None:
        try:
            with open_capture(self._feed, name=self._name) as capture:  # type: ignore[arg-type]
                self.problem = Live(self._options, self).watch(capture).problem
        except CaptureError as problem:
            self.problem = str(problem)
        except BaseException as fault:  # noqa: BLE001 (raised where somebody waits for the next one)
            self._fault = fault
        finally:
            self._seen.put(None)
