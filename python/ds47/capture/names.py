"""Which file names are captures, and how messages name one. Nothing is opened here."""

from __future__ import annotations

STDIN = "-"
"""The path that means standard input."""
SUFFIXES = (".pcap", ".pcapng", ".cap")
"""The endings of a capture; one of PACKED may follow."""
PACKED = ("", ".gz", ".zst")
ENDINGS = tuple(suffix + packed for suffix in SUFFIXES for packed in PACKED)
EXPORTED = ".ds47.pcapng"
"""The ending of `ds47 export`: frames of a capture that is usually beside it."""


def is_capture(name: str) -> bool:
    """Whether a search of a folder takes a file of this name, in any case, for a capture.

    An export is not taken: it would count the same frames twice.
    """
    return name.lower().endswith(ENDINGS) and not is_export(name)


def is_export(name: str) -> bool:
    """Whether a file has the name of an export, packed or not. It is read only by name."""
    return name.lower().endswith(tuple(EXPORTED + packed for packed in PACKED))


def about(path: str, problem: str) -> str:
    """One line that names the capture exactly once."""
    name = "stdin" if path == STDIN else path
    line = " ".join(problem.split())
    return line if name in line else f"{name}: {line}"
