"""A line of PROFIBUS with one master, made by hand: frames as a recorder has them, healthy or not.

Knows nothing of what ds47 makes of it. Frames are built byte by byte, so that the encoder has no part in it.
"""

from __future__ import annotations

import io

from ds47.capture.writer import PcapngWriter

MASTER = 2
SHORT = b"\xe5"
SET_PRM = "b81e010080b501c00000"
"""Locked, watchdog 300 ms, ident 80B5, DPV1 enabled; 8 is the watchdog, C0 of byte 7 DPV1."""
DIAGNOSIS = "000c000280b5"
"""Watchdog on, of master 2."""
PPO1, PPO3 = "f3f1", "f1"
LINK = 257


def frame(to: int, of: int, fc: int, data: bytes = b"", dsap: int = -1, ssap: int = -1) -> bytes:
    """SD1 without data, else SD2."""
    both = dsap >= 0
    body = bytes((to | 0x80 * both, of | 0x80 * both, fc)) + (bytes((dsap, ssap)) if both else b"")
    body += data
    end = bytes((sum(body) & 0xFF, 0x16))
    if len(body) == 3:
        return b"\x10" + body + end
    return bytes((0x68, len(body), len(body), 0x68)) + body + end


class Wire:
    """What the master asks and what the stations answer, one after the other."""

    def __init__(self, gap_ns: int = 100_000) -> None:
        self.shots: list[tuple[int, bytes]] = []
        self.gap_ns = gap_ns
        self.now_ns = 1_767_254_400_000_000_000
        self._fcb: dict[int, int] = {}

    @property
    def number(self) -> int:
        """That of the last frame."""
        return len(self.shots)

    def put(self, data: bytes) -> int:
        """A frame, whatever it is; its number."""
        self.shots.append((self.now_ns, data))
        self.now_ns += self.gap_ns
        return self.number

    def ask(self, station: int, data: str = "", sap: int = -1, own: int = 62) -> int:
        """A request, the first one without FCV."""
        fc = 0x6D if station not in self._fcb else 0x5D | self._fcb[station] << 5
        self._fcb[station] = 1 - self._fcb.get(station, 1)
        return self.put(
            frame(station, MASTER, fc, bytes.fromhex(data), sap, own if sap >= 0 else -1)
        )

    def repeat(self) -> int:
        """The last frame once more."""
        return self.put(self.shots[-1][1])

    def tell(
        self, station: int, data: str = "", sap: int = -1, own: int = 62, code: int = 8
    ) -> int:
        """An answer."""
        content = bytes.fromhex(data)
        return self.put(frame(MASTER, station, code, content, own if sap >= 0 else -1, sap))

    def short(self) -> int:
        """SC."""
        return self.put(SHORT)

    def token(self) -> int:
        """The token, from the master to itself."""
        return self.put(bytes((0xDC, MASTER, MASTER)))

    def spoil(self, at: int = -2, by: int = 1) -> None:
        """A changed byte in the last frame: its check byte."""
        time_ns, data = self.shots[-1]
        changed = bytearray(data)
        changed[at] = (changed[at] + by) & 0xFF
        self.shots[-1] = time_ns, bytes(changed)

    def start(
        self, station: int, set_prm: str = SET_PRM, configured: str = PPO1, told: str = DIAGNOSIS
    ) -> None:
        """Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag."""
        self.diagnose(station, "000400ff80b5")
        self.ask(station, set_prm, 61)
        self.short()
        self.ask(station, configured, 62)
        self.short()
        self.diagnose(station, told)

    def diagnose(self, station: int, told: str = DIAGNOSIS) -> int:
        """Slave_Diag with its answer."""
        self.ask(station, "", 60)
        return self.tell(station, told, 60)

    def exchange(
        self, station: int, out: str = "00" * 12, back: str = "00" * 12, code: int = 8
    ) -> int:
        """One data exchange; the number of the answer."""
        self.ask(station, out)
        return self.tell(station, back, code=code)

    def record(self, station: int, data: str) -> int:
        """A service of MS1 without its answer: SC."""
        self.ask(station, data, 51, 51)
        return self.short()

    def poll(self, station: int, data: str = "") -> int:
        """A poll of MS1, answered with data, or with SC."""
        self.ask(station, "", 51, 51)
        return self.tell(station, data, 51, 51) if data else self.short()

    def written(self) -> bytes:
        """As a capture."""
        target = io.BytesIO()
        with PcapngWriter(target, link_type=LINK) as writer:
            for shot in self.shots:
                writer.write(*shot)
        return target.getvalue()
