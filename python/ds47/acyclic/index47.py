"""Which record calls are ours (docs/pairing.md, "Which records are ours").

0xB02E, 0xB02F and the indices a user names always are. Index 47 belongs to whoever made the module: what
comes on it waits here until one message of that AR has the shape of the parameter channel; then all of
it, in its order, goes on.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable

ALWAYS = frozenset({0xB02E, 0xB02F})
SHARED_INDEX = 47

ArKey = tuple[str, str, bytes]
"""Controller, device, AR UUID (nil for ReadImplicit)."""


class Index47:
    """Holds events of index 47 back until their AR has proved itself.

    Args:
        extra: record indices that are ours whatever they hold.
        waiting: how many events of one AR, and how many ARs, may wait; the oldest goes first.
        waiting_ars: how many times as many events may wait of all ARs together.
        proven: how many ARs that have proved themselves are remembered; the one that spoke last goes
            last.
    """

    def __init__(
        self, extra: frozenset[int], waiting: int, waiting_ars: int = 16, proven: int = 65_536
    ) -> None:
        self._always = ALWAYS | extra
        self._concerned = self._always | {SHARED_INDEX}
        self._waiting = waiting
        self._most_events = waiting * waiting_ars
        self._most_open = proven
        self.open: OrderedDict[ArKey, None] = OrderedDict()
        """The ARs that have proved themselves; the one that spoke last comes last."""
        self._held: OrderedDict[ArKey, deque[Callable[[], None]]] = OrderedDict()
        self._events = 0

    def concerns(self, index: int) -> bool:
        """Whether a record of this index can be ours at all."""
        return index in self._concerned

    def waits(self, device: str) -> bool:
        """Whether anything waits that was asked of a device, perhaps a change of a parameter."""
        return any(ar[1] == device for ar in self._held)

    def passes(self, ar: ArKey, index: int) -> bool:
        """Whether an event may go on now; the AR has spoken then."""
        if ar in self.open:
            self.open.move_to_end(ar)
            return True
        return index in self._always

    def pass_on(
        self, ar: ArKey, index: int, event: Callable[[], None], *, shaped: bool = False
    ) -> None:
        """Runs the event, now or when a shaped message of the same AR comes; never if none does."""
        if self.passes(ar, index):
            event()
            return
        if shaped:
            self._prove(ar)
            event()
            return
        self._held.setdefault(ar, deque(maxlen=self._waiting))
        self.follow(ar, event)

    def follow(self, ar: ArKey, event: Callable[[], None]) -> None:
        """Lets an event wait behind those that wait for an AR; where none does, it is not needed."""
        held = self._held.get(ar)
        if held is None:
            return
        self._events += len(held) < self._waiting
        held.append(event)
        while len(self._held) > self._waiting or self._events > self._most_events:
            self._events -= len(self._held.popitem(last=False)[1])

    def _prove(self, ar: ArKey) -> None:
        self.open[ar] = None
        while len(self.open) > self._most_open:
            self.open.popitem(last=False)
        held = self._held.pop(ar, ())
        self._events -= len(held)
        for event in held:
            event()
