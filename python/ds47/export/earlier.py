"""Whether a file is what an earlier export wrote: such a file may be replaced, a recording may not.

The section header names ds47, and every frame says of which one of the original it is a copy. A file
that another program saved, or put together with a recording, is not an export any more.
"""

from __future__ import annotations

from pathlib import Path

from ds47.capture import CaptureError, PcapngWriter, open_capture
from ds47.capture.pcapng import OURS

OF_THE_ORIGINAL = " of the original"
"""How the last comment of each frame ends."""


def is_earlier_export(path: Path) -> bool:
    """Whether all of a file was written by `ds47.export.export`. What cannot be read is not.

    A frame without the comment ends the search, so a long recording is not read.
    """
    try:
        with path.open("rb") as stream:
            if not PcapngWriter.wrote(stream.read(64), OURS):
                return False
        with open_capture(path) as capture:
            some = False
            for frame in capture.everything():
                last = frame.comments[-1] if frame.comments else ""
                # a comment that is too long for a file has lost its end
                if not (last.endswith(OF_THE_ORIGINAL) or PcapngWriter.is_cut(last)):
                    return False
                some = True
            return some
    except (CaptureError, OSError):
        return False
