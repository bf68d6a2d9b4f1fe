"""Stories of lines of PROFIBUS, which become captures: records, drives, and everything that goes wrong there.

Each rule by itself, with its near miss, is in `profibus_scenes`.
"""

from __future__ import annotations

from ds47.lab import fdl, message
from ds47.lab.cyclic import PZD
from ds47.lab.cyclic_scenes import PRINTED, real
from ds47.lab.drive import LabDrive, PkwParameter
from ds47.lab.machine import ACKNOWLEDGE, IDLE, OFF, ON, Machine
from ds47.lab.master import FAULTY, NO_DPV1, NOT_READY, PPO3, SET_PRM, WAITS, Master, Way
from ds47.lab.ppo import PpoStation
from ds47.lab.scenario import BusBook
from ds47.lab.seeds import DCM_CHANGE, DCM_READ, G120_CHANGE, G120_READ

BOOK = BusBook("profibus")
LOGS = ("profibus-seed-records",)
"""Stories that are written as a log, too."""
FIRST, SECOND, THIRD = 3, 4, 5
IO, BYTE = "b81e0100800101", "00"
"""Set_Prm of station 5, which has a byte of inputs and one of outputs; its data."""
CYCLE = 8
"""Milliseconds of a cycle of the line."""
_IN_OPERATION = 0x6B
PZD_ALONE = "00" * 4


def _cycle(master: Master, *stations: int) -> None:
    """A cycle of the line: PPO3 of each drive, the token, and time."""
    for station in stations:
        master.exchange(station, PZD_ALONE, PZD_ALONE)
    master.token()
    master.wait(CYCLE)


def _started(
    master: Master, *stations: int, set_prm: str = SET_PRM, configured: str = PPO3
) -> Master:
    """Stations after their start-up; in each cycle there is room for one service of records."""
    master.look(range(3, 8), stations)
    for station in stations:
        master.start(station, set_prm, configured)
    master.control()
    master.between = lambda: _cycle(master, *stations)
    return master


# Records


def _seeds(master: Master) -> None:
    """The records of the application notes, each as it is printed."""
    _started(master, FIRST, SECOND)
    examples = (
        (FIRST, DCM_READ, 2, 0), (FIRST, DCM_CHANGE, 1, 1), (SECOND, G120_READ, 1, 2), (SECOND, G120_CHANGE, 3, 0),
    )  # fmt: skip
    for station, (asked, answer), polls, busy in examples:
        way = Way(station)
        master.parameters(way, bytes.fromhex(asked), bytes.fromhex(answer), polls, busy)
        master.between()


@BOOK.scene(
    "DCM and G120 by MS1: short acknowledgements, polls, B5; each record as an application note prints it",
    "read ok, change ok, read ok, change ok, DS415 DS721",
)
def seed_records(master: Master) -> None:
    """The parameter channel of two drives on PROFIBUS."""
    _seeds(master)


@BOOK.scene(
    "the same line in a capture of link type USER0, which every Wireshark opens; recorded while it runs",
    "read ok, change ok, DS721",
)
def user0_running(master: Master) -> None:
    """A plant that ran before the capture began: no Set_Prm, no Chk_Cfg."""
    master.stage.link = fdl.USER0
    master.between = lambda: _cycle(master, FIRST)
    for asked, answer in (DCM_READ, DCM_CHANGE):
        master.parameters(Way(FIRST), bytes.fromhex(asked), bytes.fromhex(answer))
        master.between()


@BOOK.scene(
    "the slave names SAP 12; read and change there, with idle between; then the connection is aborted",
    "read ok, change ok, DS721",
)
def ms2(master: Master) -> None:
    """An engineering tool reads and changes parameters by MS2."""
    _started(master, FIRST)
    way = master.initiate(FIRST, 12)
    master.parameters(way, bytes.fromhex(DCM_READ[0]), bytes.fromhex(DCM_READ[1]), 2, 1)
    for _ in range(3):
        master.service(way, "48", "48")
    master.parameters(way, bytes.fromhex(DCM_CHANGE[0]), bytes.fromhex(DCM_CHANGE[1]))
    master.ask(FIRST, "5800000000", way.sap, way.own)
    master.short()
    master.between()


@BOOK.scene(
    "a drive refuses a parameter, a write, its identification and a service; of another one DPV1 is not enabled",
    "change error, change refused, 2 read refused, DS203 DS410 DS701 DS805 DS806 DS817",
)
def refused_records(master: Master) -> None:
    """Records that are refused, for five reasons."""
    _started(master, FIRST, SECOND)
    master.start(SECOND, NO_DPV1, PPO3)
    way = Way(FIRST)
    master.read(Way(FIRST, slot=1, index=255), refused="de80b000")
    locked = message.answer(1, 0x82, 2, message.error(_IN_OPERATION))
    asked = message.change(1, 2, (message.address(50076), message.word(1)))
    master.parameters(way, asked, locked)
    master.write(
        way, message.change(2, 2, (message.address(50076), message.word(2))), refused="df80b600"
    )
    master.between()
    asked = message.read(3, 1, message.address(1082))
    for station, code in ((SECOND, fdl.NOT_ENABLED), (FIRST, fdl.NO_RESOURCE)):
        master.ask(station, (b"\x5f\x00\x2f" + bytes((len(asked),)) + asked).hex(), 51, 51)
        master.tell(station, code=code)
        master.between()


@BOOK.scene(
    "101 polls and more, a response that nobody asked for, a buffer that is too long",
    "read ok, read refused, DS202 DS203 DS314 DS703 DS807 DS808 DS809",
)
def bad_habits(master: Master) -> None:
    """What a program does that should not: it reads first, polls for long, writes its whole buffer."""
    _started(master, FIRST)
    way = Way(FIRST)
    master.read(way, refused=NOT_READY)
    asked, answer = (bytes.fromhex(each) for each in DCM_READ)
    master.between = lambda: master.wait(0.5)
    master.write(way, asked, polls=2)
    master.read(way, answer, polls=104)
    asked = message.read(4, 2, message.address(50304))
    master.service(way, f"5f002ff1{asked.ljust(240, bytes(1)).hex()}")
    master.poll(FIRST, "df80b100")
    _cycle(master, FIRST)


# Drives


def _cells() -> dict[tuple[int, int], PkwParameter]:
    """What the printed telegrams of PKW read and change."""
    return {
        (25, 0): PkwParameter(real(230.0), double=True),
        (700, 0): PkwParameter(b"\0\2"),
        (1082, 0): PkwParameter(real(50.0), double=True),
        (2010, 1): PkwParameter(real(50.0), double=True),
    }


def _drive(ppo: PpoStation, drive: LabDrive) -> Machine[PpoStation]:
    """A drive with a PPO, connected; its data exchange goes on between the services of records."""
    it = Machine(ppo, drive).connect()
    ppo.master.between = it.cycle
    return it


@BOOK.scene(
    "start-up with F3 F1; four reads and a change by PKW as printed, ON, 25 %, another read, OFF1",
    "3 read ok, change ok, 2 read ok",
)
def ppo1_start(master: Master) -> None:
    """A drive with PPO1 from its start-up to standstill."""
    master.look(range(3, 8), (FIRST,))
    it = _drive(PpoStation(master, FIRST), LabDrive(up_s=1.0, down_s=0.5, cells=_cells()))
    it.control(OFF).run(0.1)
    for request, _ in PRINTED:
        it.ask(bytes.fromhex(request), 5).ask(IDLE, 4)
    it.setpoint(25).control(ON).until(lambda drive: drive.actual >= 24.9).run(0.3).read(1082)
    it.control(OFF).until(lambda drive: drive.state == "S2").run(0.2)


class _BadPlug:
    """A station with a byte each way: every twentieth answer is damaged, and asked for again."""

    def __init__(self, master: Master, station: int) -> None:
        self._master, self._station, self._cycles = master, station, 0

    def cycle(self) -> None:
        """Its exchange, and the token."""
        self._cycles += 1
        self._master.exchange(self._station, BYTE, BYTE)
        if self._cycles % 20 == 0:
            self._master.spoil()
            self._master.repeat()
            self._master.tell(self._station, BYTE)
        self._master.token()


@BOOK.scene(
    "p50076 is not changed in operation (0x6B), and is after OFF1; a fault is read; station 5 has a bad plug",
    "change error, change ok, read ok, DS410 DS701 DS721 DS801 DS803",
)
def ppo3_and_records(master: Master) -> None:
    """A drive with PPO3, and its parameters by MS1 meanwhile."""
    master.look(range(3, 8), (FIRST, THIRD))
    master.start(THIRD, IO, "1020")
    ppo = PpoStation(master, FIRST, (PZD,), beside=_BadPlug(master, THIRD).cycle)
    it = _drive(ppo, LabDrive(up_s=0.6, down_s=0.6))
    way, place = Way(FIRST), message.address(50076)
    it.control(OFF).run(0.1).setpoint(60).control(ON).until(lambda drive: drive.actual >= 59.9).run(
        0.3
    )
    refused = message.answer(1, 0x82, 2, message.error(_IN_OPERATION))
    master.parameters(way, message.change(1, 2, (place, message.word(1))), refused, busy=1)
    it.run(0.2).control(OFF).until(lambda drive: drive.state == "S2").run(0.1)
    master.parameters(
        way, message.change(2, 2, (place, message.word(1))), message.changed(2, 2), polls=2
    )
    it.drive.fault, it.line.code = 7900, fdl.HIGH
    it.run(0.1)
    master.diagnose(FIRST, FAULTY)
    it.line.code = fdl.LOW
    faults = message.answer(3, 1, 2, message.word(7900))
    master.parameters(way, message.read(3, 2, message.address(947)), faults)
    it.run(0.1).control(ACKNOWLEDGE).run(0.1).control(OFF).run(0.2)


# Lines


@BOOK.scene("three stations, and what is near to sixteen rules; none of them speaks", "read ok")
def healthy(master: Master) -> None:
    """A line without a fault."""
    _started(master, FIRST, SECOND)
    master.start(THIRD, IO, "1020")
    for _ in range(3):
        _cycle(master, FIRST, SECOND)
        master.exchange(THIRD, BYTE, BYTE)
    master.parameters(Way(FIRST), bytes.fromhex(DCM_READ[0]), bytes.fromhex(DCM_READ[1]), 2, 2)
    master.read(Way(FIRST, slot=1, index=255), bytes(64))
    for _ in range(9):
        master.exchange(SECOND, PZD_ALONE, PZD_ALONE, fdl.HIGH)
    master.diagnose(SECOND, FAULTY)
    master.look(range(6, 12))
    master.control("0200")
    for _ in range(3):
        master.exchange(FIRST, "", PZD_ALONE)
        master.exchange(SECOND, "", PZD_ALONE)
        master.token()


@BOOK.scene(
    "damaged answers and repetitions of station 4, station 5 is switched off; nothing is wrong with station 3",
    "DS801 DS802 DS803 DS804",
)
def bad_line(master: Master) -> None:
    """A bad plug at one station, and another one without supply."""
    _started(master, FIRST, SECOND, THIRD)
    for number in range(30):
        master.exchange(FIRST, PZD_ALONE, PZD_ALONE)
        master.exchange(SECOND, PZD_ALONE, PZD_ALONE)
        if number % 6 == 3:
            master.spoil(*((1,) if number == 9 else ()))
            master.repeat()
            master.tell(SECOND, PZD_ALONE)
        if number < 20:
            master.exchange(THIRD, PZD_ALONE, PZD_ALONE)
        else:
            master.ask(THIRD, "", fdl.DIAGNOSIS)
            master.restart(THIRD)
        master.token()
        master.wait(CYCLE)


@BOOK.scene(
    "nobody reads the diagnosis that station 3 asks for; it refuses data exchange, and is started again",
    "DS810 DS812 DS816",
)
def dropped_out(master: Master) -> None:
    """A station that asks for help in vain, and starts again."""
    _started(master, FIRST, SECOND)
    _cycle(master, FIRST, SECOND)
    for _ in range(12):
        master.exchange(FIRST, PZD_ALONE, PZD_ALONE, fdl.HIGH)
        master.exchange(SECOND, PZD_ALONE, PZD_ALONE)
        master.token()
        master.wait(CYCLE)
    master.ask(FIRST, PZD_ALONE)
    master.tell(FIRST, code=fdl.NOT_ENABLED)
    master.start(FIRST, configured=PPO3, diagnosis=FAULTY)
    for _ in range(5):
        _cycle(master, FIRST, SECOND)


@BOOK.scene(
    "PPO1 with 73 is refused, then sent to a drive that answers with PPO3; without a watchdog",
    "DS811 DS813 DS814 DS815",
)
def wrong_project(master: Master) -> None:
    """A project that does not fit its drives: PPO, consistency, ident number, watchdog."""
    master.look(range(3, 6), (FIRST, SECOND))
    master.start(FIRST, "90" + SET_PRM[2:], "73f1", "040400ff80b5")
    master.diagnose(FIRST, "040400ff80b5")
    master.start(SECOND, "b81e01000402 01c00000".replace(" ", ""), PPO3, "420400ff80b5")
    master.diagnose(SECOND, "420400ff80b5")
    master.start(FIRST, "90" + SET_PRM[2:], "73f1", "0004000280b5")
    master.control()
    for _ in range(4):
        master.exchange(FIRST, "00" * 12, PZD_ALONE)
        master.token()
        master.wait(CYCLE)
    master.diagnose(SECOND, WAITS)
