"""What a plain installation does not have, and how to get it: the extras of pyproject.toml by their packages.

Only the words. No package index has ds47, so a hint names the packages, never `ds47[EXTRA]`.
"""

from __future__ import annotations

import sys

_PACKAGES = {
    "lab": "scapy",
    "tshark": "pyshark~=0.6.0",
    "parquet": "pyarrow",
    "cluster": "dask distributed fsspec",
    "urls": "fsspec",
    "pandas": "pandas",
    "xlsx": "openpyxl",
}
"""As an index knows them, without a character that some shell takes for its own."""


def install(what: str) -> str:
    """The command that installs for this Python what an extra needs: `urls` of `cluster`, or a table of pandas."""
    from ds47.spec.shell import shell_word  # not for every start

    return f"{shell_word(sys.executable or 'python')} -m pip install {_PACKAGES[what]}"
