"""Which file names are captures, and how a line names one. Nothing is opened here."""

from __future__ import annotations

STDIN = "-"
"""What stands for standard input among paths."""
SUFFIXES = (".pcap", ".pcapng", ".cap")
"""The endings of a capture; each also with one of PACKED behind."""
PACKED = ("", ".gz", ".zst")
ENDINGS = tuple(suffix + packed for suffix in SUFFIXES for packed in PACKED)
EXPORTED = ".ds47.pcapng"
"""The ending that `ds47 export` gives: frames of a capture that mostly stands beside it."""


def is_capture(name: str) -> bool:
    """Whether a file of this name, in whatever case, is taken for a capture where a folder is searched.

    An export is not: it would count the same frames twice.
    """
    return name.lower().endswith(ENDINGS) and not is_export(name)


def is_export(name: str) -> bool:
    """Whether a file has the name of an export, packed or not. It is read where it is named."""
    return name.lower().endswith(tuple(EXPORTED + packed for packed in PACKED))


def about(path: str, problem: str) -> str:
    """One line that names the capture, and names it once."""
    name = "stdin" if path == STDIN else path
    line = " ".join(problem.split())
    return line if name in line else f"{name}: {line}"
