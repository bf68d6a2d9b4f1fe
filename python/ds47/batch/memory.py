"""When to look for garbage: between two captures, and only where there is much new.

What an analysis keeps while it runs has no cycles, so looking for them again and again only costs
time; what belonged to a capture that is over, as a whole, has some.
"""

from __future__ import annotations

import atexit
import gc

_OBJECTS = 20_000
"""How many new ones make it worth it."""


def collect_rarely() -> None:
    """From now on only `collect` looks for garbage."""
    gc.freeze()
    gc.disable()
    atexit.register(gc.freeze)  # or the interpreter looks through all of it once more when it ends


def collect() -> None:
    """Between two captures."""
    if gc.get_count()[0] > _OBJECTS:
        gc.collect()
        gc.freeze()  # what is left stays: to look through it again and again took a fifth of a large folder
