"""Frames of PROFIBUS, byte by byte (docs/profibus.md 2).

Apart from `ds47.profibus` for the same reason as `message`: frames that the encoder made would agree with its
mistakes. Who sends them is `master`.
"""

from __future__ import annotations

PROFIBUS_DL, USER0 = 257, 147
"""Link types of captures."""
SHORT = b"\xe5"
RECORDS, RESOURCE = 51, 49
"""SAPs of a slave: MS1, and where MS2 begins."""
CONTROL, DIAGNOSIS, PARAMETERS, CONFIGURATION = 58, 60, 61, 62
OWN, OWN_MS2 = 62, 50
"""SAPs of a master; with MS1 it has that of the slave."""
EVERYBODY = 127
STATUS, SDN = 0x49, 0x46
FIRST, NEXT = 0x6D, 0x5D
"""SRD: the first one to a station, and those after it, of which bit 5 is FCB."""
FCB = 0x20
NO_RESOURCE, NOT_ENABLED, LOW, NOTHING, HIGH = 0x02, 0x03, 0x08, 0x09, 0x0A
"""Codes of answers; with HIGH the slave asks for a diagnosis."""


def frame(
    to: int, of: int, fc: int, data: bytes = b"", dsap: int | None = None, ssap: int | None = None
) -> bytes:
    """SD1 without data, SD3 with eight bytes (SAPs among them), else SD2."""
    saps = bytes(sap for sap in (dsap, ssap) if sap is not None)
    body = bytes((to | (dsap is not None) << 7, of | (ssap is not None) << 7, fc)) + saps + data
    end = bytes((sum(body) & 0xFF, 0x16))
    if len(body) == 3:
        return b"\x10" + body + end
    if len(body) == 11:
        return b"\xa2" + body + end
    return bytes((0x68, len(body), len(body), 0x68)) + body + end


def token(to: int, of: int) -> bytes:
    """SD4: who has it now, and who had it."""
    return bytes((0xDC, to, of))
