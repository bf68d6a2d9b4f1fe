"""PROFIBUS DP: what a line of the bus carries (docs/profibus.md).

`telegram` has the frames, `dp` what DP says in them, `ms1` read and write of records, `stream` the frames of
bytes without borders, `listing` those of a log that is text. `line` knows which answer belongs to which request,
`bus` takes the frames of a capture. What a record call is, and what it means, is not here.
"""

from typing import Final

PROFIBUS_DL: Final = 257
USER0: Final = 147
LINK_TYPES: Final = frozenset({PROFIBUS_DL, USER0})
"""LINKTYPE_PROFIBUS_DL, and the link type that is everybody's own: PROFIBUS where a frame of it proves that."""
