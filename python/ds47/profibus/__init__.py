"""PROFIBUS DP: what a line of the bus carries (docs/profibus.md).

`telegram` has the frames, `dp` what DP says in them, `ms1` read and write of records, `stream` the frames of
bytes without borders, `listing` those of a log that is text. What belongs together, and what it means for a drive,
is not here.
"""

from ds47.profibus.telegram import Flaw, Telegram, decode

__all__ = ["Flaw", "Telegram", "decode"]
