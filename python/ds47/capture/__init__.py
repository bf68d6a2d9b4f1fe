"""Capture files: the only place that opens them.

`open_capture` reads pcap and pcapng (.gz, .zst, stdin) and yields the frames that may matter;
`PcapngWriter` writes. What is in a frame is the business of `ds47.profinet`.
"""

from .errors import CaptureError
from .frame import Frame
from .reader import Capture, open_capture
from .writer import PcapngWriter

__all__ = ["Capture", "CaptureError", "Frame", "PcapngWriter", "open_capture"]
