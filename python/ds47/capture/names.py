"""Which file names are captures. Nothing is opened here."""

from __future__ import annotations

SUFFIXES = (".pcap", ".pcapng", ".cap")
"""The endings of a capture; each also with one of PACKED behind."""
PACKED = ("", ".gz", ".zst")
ENDINGS = tuple(suffix + packed for suffix in SUFFIXES for packed in PACKED)


def is_capture(name: str) -> bool:
    """Whether a file of this name is taken for a capture, in whatever case."""
    return name.lower().endswith(ENDINGS)
