"""PROFIBUS DP: what a line of the bus carries (docs/profibus.md).

`telegram` has the frames, `dp` what DP says in them, `ms1` read and write of records, `stream` the frames of
bytes without borders, `listing` those of a log that is text. `line` knows which answer belongs to which request,
and `calls` which of them are one record call. What a record call means is not here.
"""

from ds47.profibus.telegram import Flaw, Telegram, decode

__all__ = ["Flaw", "Telegram", "decode"]
