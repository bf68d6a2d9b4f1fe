"""Frames of a capture to the exchanges of a line of PROFIBUS (docs/profibus.md 6).

Takes the frames of the two link types that carry PROFIBUS; what an exchange is about is the business of those who
hear of it. Files and texts are not here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ds47.profibus import PROFIBUS_DL
from ds47.profibus.line import Exchange, Line, LineFrame
from ds47.profibus.telegram import decode


class ExchangeListener(NamedTuple):
    """Who hears of an exchange when it is over: of these services of `dp` alone, or of all (None)."""

    take: Callable[[Exchange], None]
    services: frozenset[str] | None = None


class BusTracker:
    """One line of PROFIBUS.

    Args:
        listeners: hear of the exchanges, one after the other.
        heard: gets each frame, and whether the recording has only a part of it.
    """

    def __init__(
        self,
        listeners: Sequence[ExchangeListener],
        heard: Callable[[LineFrame, bool], None],
    ) -> None:
        self._listeners = listeners
        self._of: dict[str | None, list[Callable[[Exchange], None]]] = {}
        """Those of a service."""
        self._heard = heard
        self._proven = False
        """Whether a frame with the right check byte was seen: the user's own link type may be anything."""
        self.line = Line()

    def take(
        self, link_type: int, data: bytes, number: int, time_ns: int, cut: bool = False
    ) -> None:
        """A frame of one of `LINK_TYPES`, with its number and its time; `cut`: the recording has not all of it."""
        item = decode(data)
        if not self._proven:
            self._proven = link_type == PROFIBUS_DL or item.proved
            if not self._proven:
                return
        seen = LineFrame(number, time_ns, item)
        self._heard(seen, cut)
        for exchange in self.line.take(seen, cut):
            self._tell(exchange)

    def finish(self) -> None:
        """No frame comes any more."""
        for exchange in self.line.finish():
            self._tell(exchange)

    def _tell(self, exchange: Exchange) -> None:
        service = exchange.request.item.front.service
        found = self._of.get(service)
        if found is None:
            found = self._of[service] = [
                each.take for each in self._listeners
                if each.services is None or service in each.services
            ]  # fmt: skip
        for take in found:
            take(exchange)
