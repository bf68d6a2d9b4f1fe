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


class Gate:
    """Holds events of index 47 back until their AR has proved itself.

    Args:
        extra: record indices that are ours whatever they hold.
        waiting: how many events of one AR, and how many ARs, may wait; the oldest goes first.
    """

    def __init__(self, extra: frozenset[int], waiting: int) -> None:
        self._always = ALWAYS | extra
        self._waiting = waiting
        self._open: set[ArKey] = set()
        self._held: OrderedDict[ArKey, deque[Callable[[], None]]] = OrderedDict()

    def concerns(self, index: int) -> bool:
        """Whether a record of this index can be ours at all."""
        return index == SHARED_INDEX or index in self._always

    def needs_proof(self, ar: ArKey, index: int) -> bool:
        """Whether a message with the right shape would open the gate."""
        return index not in self._always and ar not in self._open

    def pass_on(
        self, ar: ArKey, index: int, event: Callable[[], None], *, shaped: bool = False
    ) -> None:
        """Runs the event, now or when a shaped message of the same AR comes; never if none does."""
        if not self.needs_proof(ar, index):
            event()
            return
        if shaped:
            self._open.add(ar)
            for held in self._held.pop(ar, ()):
                held()
            event()
            return
        self._held.setdefault(ar, deque(maxlen=self._waiting)).append(event)
        while len(self._held) > self._waiting:
            self._held.popitem(last=False)
