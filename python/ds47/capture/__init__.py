"""Capture files: the only place that opens them.

`open_capture` reads pcap and pcapng (.gz, .zst, stdin) and yields the frames that may matter. `Series` reads
several files in a row. `PcapngWriter` writes. `ds47.profinet` decodes what is in a frame.
"""

from .errors import CaptureError
from .frame import Frame, Interface, WholeFrame
from .reader import Capture, holds_capture, open_capture
from .remote import open_bytes, sha256
from .series import Series
from .writer import PcapngWriter

__all__ = [
    "Capture",
    "CaptureError",
    "Frame",
    "Interface",
    "PcapngWriter",
    "Series",
    "WholeFrame",
    "holds_capture",
    "open_bytes",
    "open_capture",
    "sha256",
]
