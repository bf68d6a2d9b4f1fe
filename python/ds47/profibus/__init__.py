"""PROFIBUS DP: what a line of the bus carries (docs/profibus.md).

`telegram` decodes frames, `dp` the content of DP, `ms1` reads and writes of records. `stream` finds frames in raw
bytes, `listing` in a text log. `line` pairs answers with requests, `bus` takes the frames of a capture. What a
record call means is not decided here.
"""

from typing import Final

PROFIBUS_DL: Final = 257
USER0: Final = 147
LINK_TYPES: Final = frozenset({PROFIBUS_DL, USER0})
"""LINKTYPE_PROFIBUS_DL, and the first link type for private use: PROFIBUS if one of its frames proves it."""
