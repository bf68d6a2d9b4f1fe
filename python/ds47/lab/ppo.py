"""The words of a drive in data exchange: what `cyclic` is on PROFINET.

Start-up and exchanges, cycle by cycle. What controller and drive say is decided by `machine` and the scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ds47.lab import fdl
from ds47.lab.cyclic import INPUT, OUTPUT, PKW, PZD, LabModule
from ds47.lab.master import SET_PRM, Master


@dataclass(slots=True)
class PpoStation:
    """A station and its exchanges with the master.

    `reduction`: milliseconds of a cycle. `beside`: called in each cycle behind the exchange.
    """

    master: Master
    station: int = 3
    modules: Sequence[LabModule] = (PKW, PZD)
    reduction: float = 16
    set_prm: str = SET_PRM
    configured: str = ""
    """Identifiers of Chk_Cfg; "" for those of the modules."""
    code: int = fdl.LOW
    """Of the answers."""
    beside: Callable[[], object] = lambda: None
    data: dict[tuple[LabModule, int], bytes] = field(default_factory=dict)

    def connect(self) -> None:
        """Start-up, and the master says operate."""
        words = bytes(0xF0 | (each.length // 2 - 1) for each in self.modules)
        self.master.start(self.station, self.set_prm, self.configured or words.hex())
        self.master.control()

    def say(self, module: LabModule, kind: int, data: bytes) -> None:
        """From the next cycle on a module has this data in a direction."""
        self.data[module, kind] = data

    def cycle(self) -> None:
        """A cycle goes by."""
        stage = self.master.stage
        begun = stage.now_ns
        self.master.exchange(self.station, self._side(OUTPUT), self._side(INPUT), self.code)
        self.beside()
        stage.now_ns = max(stage.now_ns, begun + round(self.reduction * 1_000_000))

    def _side(self, kind: int) -> str:
        parts = (
            self.data.get((each, kind), b"").ljust(each.length, b"\0") for each in self.modules
        )
        return b"".join(parts).hex()
