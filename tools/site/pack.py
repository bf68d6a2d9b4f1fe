"""Packs the built site into one zip, the same bytes of the same site.

python -m tools.site.pack HTML ZIP
"""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

FIRST_TIME = (1980, 1, 1, 0, 0, 0)
"""The earliest that a zip knows."""
LEFT_OUT = re.compile(r"\.map$|\.inv$|^sitemap\.xml|^404\.html$")
"""What nobody reads in a folder: source maps, indices for other sites and servers, and a server's own page."""


def pack(site: Path, target: Path) -> None:
    """Writes it; a folder of the name of the zip is the only thing at its top."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for path in sorted(site.rglob("*")):
            if path.is_file() and not LEFT_OUT.search(path.name):
                entry = zipfile.ZipInfo(
                    f"{target.stem}/{path.relative_to(site).as_posix()}", FIRST_TIME
                )
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                file.writestr(entry, path.read_bytes())


if __name__ == "__main__":
    pack(Path(sys.argv[1]), Path(sys.argv[2]))
