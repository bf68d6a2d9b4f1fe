"""Names of files that every system takes: what Windows keeps for itself or refuses.

Not here: which names ds47 gives (`store`, `ds47.batch.results`).
"""

from __future__ import annotations

from typing import Final

REFUSED: Final = frozenset('<>:"|?*' + "".join(map(chr, range(32))))
"""Letters that no name has on Windows, what separates folders aside."""
_DEVICES: Final = frozenset(
    ("CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$",
     *(f"{port}{n}" for port in ("COM", "LPT") for n in "0123456789¹²³"))
)  # fmt: skip


def is_device(name: str) -> bool:
    """Whether Windows takes a name for that of a device: `con`, `NUL.pcap`."""
    return name.split(".", 1)[0].rstrip(" ").upper() in _DEVICES
