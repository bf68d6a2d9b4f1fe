"""A program: pyprofibus is the master of one drive with PPO1, and a scripted slave answers it.

Prints the frames of the line as a log, which ds47 reads: time and bytes. It is run in a process of its own
(test_profibus_master) and shares nothing with ds47: all frames, those of the slave too, are built by pyprofibus.
What is said is a textbook's about the MICROMASTER 440: its nine telegrams of PKW, its control and status words.

The clock is that of a line with 1.5 Mbit/s: what a frame takes, a pause behind it, and one cycle every 2 ms.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from pyprofibus.dp import (
    DpCfgDataElement,
    DpTelegram,
    DpTelegram_ChkCfg_Req,
    DpTelegram_DataExchange_Con,
    DpTelegram_DataExchange_Req,
    DpTelegram_SetPrm_Req,
    DpTelegram_SlaveDiag_Con,
    DpTelegram_SlaveDiag_Req,
)
from pyprofibus.dp_master import DPM1, DpSlaveDesc
from pyprofibus.fdl import FdlTelegram, FdlTelegram_ack, FdlTelegram_FdlStat_Con
from pyprofibus.phy import CpPhy

MASTER, DRIVE = 2, 3
IDENT = 0x80B5
BIT_NS = 667
"""At 1.5 Mbit/s; a byte has eleven bits."""
PAUSE_NS = 25_000
CYCLE_NS = 2_000_000

ASKED = {
    "12bc000000000000": "12bc000000000002",
    "100a018000000000": "200a018042480000",
    "143a000000000000": "243a000042480000",
    "343a000042200000": "243a000042200000",
    "1019000000000000": "2019000043660000",
}
"""Requests and responses; of the last one the book prints the first word, and 230 V are ours."""
NOTHING = "0000000000000000"
LATE = 3
"""Cycles that the drive takes for an answer."""
HELD = 6
"""Cycles in which a request stands."""
READY, RUNS = "fb31", "fb37"
ON = "047f"
SETPOINT = "3333"
STEP = 0x0444
"""By which the actual value moves in a cycle, until it is the setpoint."""


def script() -> Iterator[str]:
    """The outputs of the master, a cycle each."""
    for pkw in ASKED:
        if pkw != "343a000042200000":  # the write follows the read at once
            yield from [NOTHING + "047e0000"] * 2
        yield from [pkw + "047e0000"] * HELD
    yield from [NOTHING + "047e" + SETPOINT] * 10
    yield from [NOTHING + ON + SETPOINT] * 30
    yield from [NOTHING + "047e0000"] * 20


class Drive:
    """What the slave puts into its inputs, made of the outputs that it got."""

    def __init__(self) -> None:
        self._asked, self._since = NOTHING, 0
        self._answer = NOTHING
        self._actual = 0

    def answer(self, outputs: str) -> str:
        """The inputs behind these outputs."""
        pkw, stw1, setpoint = outputs[:16], outputs[16:20], outputs[20:]
        self._since = self._since + 1 if pkw == self._asked else 1
        self._asked = pkw
        if self._since > LATE or pkw == NOTHING:
            self._answer = ASKED.get(pkw, NOTHING)
        wanted = int(setpoint, 16) if stw1 == ON else 0
        way = wanted - self._actual
        self._actual += max(-STEP, min(STEP, way))
        state = RUNS if stw1 == ON or self._actual else READY
        return f"{self._answer}{state}{self._actual:04x}"


class Line(CpPhy):  # type: ignore[misc]
    """The wire with the slave at its other end; prints what goes over it."""

    def __init__(self) -> None:
        super().__init__()
        self._now_ns = 0
        sys.stdout.write("time;data\n")
        self._answers: list[bytes] = []
        self._drive = Drive()
        self._parameters = False
        self.exchanges = 0

    def sendData(self, telegramData: bytes, srd: bool) -> None:  # noqa: N802, N803
        """A frame of the master; the slave answers at once."""
        asked = FdlTelegram.fromRawData(bytearray(telegramData))
        if not asked.dae and asked.du:
            self._now_ns = (self._now_ns // CYCLE_NS + 1) * CYCLE_NS
        self._show(telegramData)
        if srd:
            self._answers.append(bytes(self._said(asked).getRawData()))

    def pollData(self, timeout: float) -> bytearray | None:  # noqa: N802
        """A frame of the slave."""
        if not self._answers:
            return None
        data = self._answers.pop(0)
        self._show(data)
        return bytearray(data)

    def _show(self, data: bytes) -> None:
        assert self._now_ns < 1_000_000_000, "all of it is in one second"
        sys.stdout.write(f"2026-01-01T12:00:00.{self._now_ns:09}Z;{bytes(data).hex()}\n")
        self._now_ns += 11 * BIT_NS * len(data) + PAUSE_NS

    def _said(self, asked: FdlTelegram) -> FdlTelegram:
        """What the slave answers."""
        if asked.fc & FdlTelegram.FC_REQFUNC_MASK == FdlTelegram.FC_FDL_STAT:
            return FdlTelegram_FdlStat_Con(da=asked.sa, sa=asked.da)
        dp = DpTelegram.fromFdlTelegram(asked, thisIsMaster=False)
        if DpTelegram_SlaveDiag_Req.checkType(dp):
            return self._diagnosis().toFdlTelegram()
        if DpTelegram_SetPrm_Req.checkType(dp):
            assert dp.identNumber == IDENT
            self._parameters = True
            return FdlTelegram_ack()
        if DpTelegram_ChkCfg_Req.checkType(dp):
            return FdlTelegram_ack()
        assert DpTelegram_DataExchange_Req.checkType(dp)
        self.exchanges += 1
        inputs = bytearray.fromhex(self._drive.answer(bytes(dp.du).hex()))
        return DpTelegram_DataExchange_Con(da=asked.sa, sa=asked.da, du=inputs).toFdlTelegram()

    def _diagnosis(self) -> DpTelegram_SlaveDiag_Con:
        """Before Set_Prm the station waits for it; then its watchdog is on, and it belongs to the master."""
        told = DpTelegram_SlaveDiag_Con(da=MASTER, sa=DRIVE)
        told.identNumber = IDENT
        told.b1 = told.B1_ONE
        if self._parameters:
            told.b1 |= told.B1_WD
            told.masterAddr = MASTER
        else:
            told.b0, told.b1 = told.B0_STANORDY, told.b1 | told.B1_PRMREQ
        return told


def station() -> DpSlaveDesc:
    """A MICROMASTER 440 with PPO1."""
    drive = DpSlaveDesc()
    drive.slaveAddr, drive.identNumber = DRIVE, IDENT
    drive.inputSize = drive.outputSize = 12
    drive.setPrmTelegram.da = drive.chkCfgTelegram.da = DRIVE
    drive.setPrmTelegram.identNumber = IDENT
    drive.setCfgDataElements([DpCfgDataElement(0xF3), DpCfgDataElement(0xF1)])
    drive.setUserPrmData(bytearray(3))
    drive.setGroupMask(1)
    drive.setWatchdog(300)
    return drive


def main() -> None:
    line, drive = Line(), station()
    line.setConfig(baudrate=CpPhy.BAUD_12000000)
    master = DPM1(line, MASTER)
    master.addSlave(drive)
    master.initialize()
    outputs = script()
    said = next(outputs)
    while True:
        drive.setMasterOutData(bytearray.fromhex(said))
        before = line.exchanges
        master.run()
        if line.exchanges > before:
            following = next(outputs, None)
            if following is None:
                break
            said = following
    while line._answers:
        master.run()


if __name__ == "__main__":
    main()
