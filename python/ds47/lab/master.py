"""A simulated master on a line of PROFIBUS, and what its slaves answer.

A slave has no mind of its own, as the device of `client`: a scene says what it answers. The drive behind a PPO is
`drive`, and `ppo` carries its words. Frames are `fdl`. Data is hex, as manuals print it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from ds47.lab import fdl
from ds47.lab.stage import Stage

SET_PRM = "b81e010080b501c00000"
"""Locked, watchdog 300 ms, ident 80B5 (MICROMASTER 4), group 1, DPV1 enabled (C0)."""
NO_DPV1 = "b81e010080b501000000"
WAITS, READY = "000400ff80b5", "000c000280b5"
"""Slave_Diag before Set_Prm, without a master; and after it, with the watchdog and master 2."""
PPO1, PPO3 = "f3f1", "f1"
FAULTY = "080c000280b506810000ab12"
"""Slave_Diag with extended diagnosis."""
NOT_READY = "de80b500"
GAP_NS = 100_000


def line(link: int = fdl.PROFIBUS_DL) -> Stage:
    """A stage on which frames of PROFIBUS go past, a tenth of a millisecond apart."""
    return Stage(link=link, gap_ns=GAP_NS)


@dataclass(frozen=True, slots=True)
class Way:
    """Where records of a slave are read and written: MS1, or the SAP that MS2 got."""

    station: int
    sap: int = fdl.RECORDS
    own: int = fdl.RECORDS
    slot: int = 0
    index: int = 47


@dataclass(slots=True)
class Master:
    """The only master on the line: it asks one station after the other.

    `between`: called before each service of records, for the data exchange that goes on.
    """

    stage: Stage = field(default_factory=line)
    address: int = 2
    between: Callable[[], object] = lambda: None
    _fcb: dict[int, int] = field(default_factory=dict)
    _asked: bytes = b""

    @property
    def number(self) -> int:
        """That of the last frame."""
        return len(self.stage.shots)

    # Frames

    def put(self, data: bytes) -> int:
        """A frame, whatever it is; its number."""
        self.stage.frame(data)
        return self.number

    def ask(self, station: int, data: str = "", sap: int | None = None, own: int = fdl.OWN) -> int:
        """A request; FCB begins with 1, without FCV, and changes with each one."""
        bit = self._fcb.get(station)
        fc = fdl.FIRST if bit is None else fdl.NEXT | fdl.FCB * bit
        self._fcb[station] = 0 if bit is None else 1 - bit
        source = None if sap is None else own
        self._asked = fdl.frame(station, self.address, fc, bytes.fromhex(data), sap, source)
        return self.put(self._asked)

    def repeat(self) -> int:
        """The last request once more, as it went out."""
        return self.put(self._asked)

    def restart(self, station: int) -> None:
        """No answer came, after all repetitions: the next request begins anew, without FCV."""
        self._fcb.pop(station, None)

    def tell(
        self,
        station: int,
        data: str = "",
        sap: int | None = None,
        own: int = fdl.OWN,
        code: int = fdl.LOW,
    ) -> int:
        """An answer."""
        to = None if sap is None else own
        return self.put(fdl.frame(self.address, station, code, bytes.fromhex(data), to, sap))

    def short(self) -> int:
        """SC."""
        return self.put(fdl.SHORT)

    def token(self) -> int:
        """The token, from the master to itself."""
        return self.put(fdl.token(self.address, self.address))

    def spoil(self, at: int = -2, by: int = 1) -> None:
        """A byte of the last frame was changed on the line: its check byte, where no other is named."""
        shot = self.stage.shots[-1]
        changed = bytearray(shot.data)
        changed[at] = (changed[at] + by) & 0xFF
        self.stage.shots[-1] = replace(shot, data=bytes(changed))

    def wait(self, milliseconds: float) -> None:
        """Let time pass."""
        self.stage.wait(milliseconds)

    # DP

    def look(self, stations: Iterable[int], there: Iterable[int] = ()) -> None:
        """FDL_Status to each address: who is there?"""
        present = set(there)
        for station in stations:
            self.put(fdl.frame(station, self.address, fdl.STATUS))
            if station in present:
                self.put(fdl.frame(self.address, station, 0))

    def start(
        self, station: int, set_prm: str = SET_PRM, configured: str = PPO1, diagnosis: str = ""
    ) -> None:
        """Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag; the ident number is that of Set_Prm, or of `diagnosis`."""
        ident = (diagnosis or set_prm)[8:12]
        self.diagnose(station, WAITS[:8] + ident)
        self.ask(station, set_prm, fdl.PARAMETERS)
        self.short()
        self.ask(station, configured, fdl.CONFIGURATION)
        self.short()
        self.diagnose(station, diagnosis or READY[:8] + ident)

    def diagnose(self, station: int, answer: str = READY) -> int:
        """Slave_Diag with its answer."""
        self.ask(station, "", fdl.DIAGNOSIS)
        return self.tell(station, answer, fdl.DIAGNOSIS)

    def control(self, data: str = "0000") -> int:
        """Global_Control to everybody; 0000 says operate."""
        own, content = fdl.OWN, bytes.fromhex(data)
        return self.put(fdl.frame(fdl.EVERYBODY, self.address, fdl.SDN, content, fdl.CONTROL, own))

    def exchange(
        self, station: int, out: str = "00" * 12, back: str = "00" * 12, code: int = fdl.LOW
    ) -> int:
        """One data exchange; the number of the answer."""
        self.ask(station, out)
        return self.tell(station, back, code=code)

    # Records

    def record(self, station: int, data: str) -> int:
        """A service of MS1 without its answer: SC."""
        self.ask(station, data, fdl.RECORDS, fdl.RECORDS)
        return self.short()

    def poll(self, station: int, data: str = "") -> int:
        """A poll of MS1, answered with data, or with SC."""
        return self.service(Way(station), "", data)

    def service(self, way: Way, asked: str, answer: str = "") -> int:
        """A request of records and its answer, SC without data."""
        self.between()
        self.ask(way.station, asked, way.sap, way.own)
        return self.tell(way.station, answer, way.sap, way.own) if answer else self.short()

    def write(self, way: Way, data: bytes, polls: int = 1, refused: str = "") -> None:
        """DS_Write, and polls until it is done, or refused."""
        head = bytes((0x5F, way.slot, way.index, len(data)))
        self.service(way, (head + data).hex())
        self._polls(way, polls, refused or head.hex())

    def read(
        self, way: Way, data: bytes = b"", polls: int = 1, refused: str = "", most: int = 240
    ) -> None:
        """DS_Read of as much as there is, up to `most` bytes, and polls until it is answered, or refused."""
        head = bytes((0x5E, way.slot, way.index))
        self.service(way, (head + bytes((most,))).hex())
        self._polls(way, polls, refused or (head + bytes((len(data),)) + data).hex())

    def _polls(self, way: Way, polls: int, last: str) -> None:
        """So many polls; the last one returns this."""
        for _ in range(polls - 1):
            self.service(way, "")
        self.service(way, "", last)

    def parameters(
        self, way: Way, request: bytes, response: bytes, polls: int = 1, busy: int = 0
    ) -> None:
        """A whole transaction of DS47: a write, reads that are answered B5, and the last read."""
        self.write(way, request, polls)
        for _ in range(busy):
            self.read(way, refused=NOT_READY)
        self.read(way, response, polls)

    def initiate(self, station: int, sap: int) -> Way:
        """MS2: the slave names the SAP of the connection, and answers the initiate there."""
        begin = Way(station, fdl.RESOURCE, fdl.OWN_MS2)
        self.service(begin, "57000000019001000000000000000000")
        self.service(begin, "", f"56{sap:02x}0190")
        way = Way(station, sap, fdl.OWN_MS2)
        self.service(way, "", "57000000010001000000000000000000")
        return way
