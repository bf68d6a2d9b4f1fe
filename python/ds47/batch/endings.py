"""How a run over captures ends before its end.

A file of its own, because a run of one capture needs nothing else of `ds47.batch.runner`.
"""

from __future__ import annotations


class Failed(Exception):
    """The run as a whole cannot go on; the text says why, and what to do."""


class Lost(Exception):
    """What analyses, or takes the results, went away in the middle; what is finished stays. The text says what."""
