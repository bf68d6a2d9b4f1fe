"""Which drive object a request goes to, as far as the request itself says it.

Under 0xB02E the slot decides, under every other index the axis byte. Which slot holds which axis is not known
here.
"""

from __future__ import annotations

from typing import NamedTuple

from ds47.acyclic.judge import Reach
from ds47.profidrive.drive_objects import LOCAL
from ds47.profinet.records import ChannelKey


class Target(NamedTuple):
    """A drive object of a device: by its slot (`local`), else by its axis number."""

    local: bool
    first: int
    second: int = 0

    def is_known(self) -> bool:
        """Whether two requests to it go to the same drive object."""
        return self.local or self.first != 0

    def may_be(self, other: Target) -> bool:
        """Whether both may be the same drive object: axis 0 names none, and a slot may hold any.

        Two submodules may belong to one drive object, too.
        """
        return self.local or other.local or self == other or 0 in (self.first, other.first)


def target_of(slot: int, subslot: int, index: int, axis: int | None) -> Target:
    """Whom a request addresses."""
    return Target(True, slot, subslot) if index == LOCAL else Target(False, axis or 0)


def reach_of(channel: ChannelKey, axis: int | None) -> Reach:
    """The way of a request."""
    slot, subslot, index = channel[4:]
    return slot, subslot, -1 if index == LOCAL or axis is None else axis
