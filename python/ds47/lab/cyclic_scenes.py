"""Scenes of the cyclic channels: each rule of PKW and PZD once, its near miss, and telegrams as printed.

A near miss is the closest conversation of which the rule says nothing. Telegram 353 where nothing else is said.
"""

from __future__ import annotations

import struct

from ds47.lab.client import Client, drive
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic, LabModule
from ds47.lab.drive import LabDrive, PkwParameter
from ds47.lab.machine import ACKNOWLEDGE, IDLE, OFF, ON, Machine
from ds47.lab.scenario import Book

BOOK = Book("cyclic")
SPEED, ALONE = LabModule(2, 2, 4), LabModule(2, 2, 12)
"""Telegrams 1 and 352, without PKW."""
WITHOUT_CONTROL = 0x007E
"""OFF without bit 10."""


def real(value: float) -> bytes:
    """A value as Float32."""
    return struct.pack(">f", value)


def parameters() -> dict[tuple[int, int], PkwParameter]:
    """What the drive of most scenes has: p1082 is the maximum, p1120 the ramp-up time."""
    return {
        (1082, 0): PkwParameter(real(50.0), double=True),
        (1120, 0): PkwParameter(real(10.0), double=True),
        (2000, 0): PkwParameter(real(50.0), double=True),
        (2010, 1): PkwParameter(real(50.0), double=True, array=True),
        (700, 0): PkwParameter(b"\0\6", most=10),
        (304, 0): PkwParameter(b"\0\x64", locked=True),
        (52, 0): PkwParameter(b"\0\7", writable=False),
    }


def machine(
    client: Client, *modules: LabModule, reduction: int = 16, **settings: object
) -> Machine[Cyclic]:
    """The machine of most scenes, connected; `settings` are those of its drive."""
    line = Cyclic(client, modules or (PKW, PZD), reduction=reduction)
    return Machine(line, LabDrive(cells=parameters())).let(**settings).connect()


# Operation


@BOOK.scene("A clean start, a run and a stop: no finding", "read ok")
def start_and_stop(client: Client) -> None:
    """A drive is started, runs, is read, and stops by OFF1."""
    it = machine(client).start(60).read(1082)
    it.setpoint(30).run(1).control(OFF).until(lambda drive: drive.state == "S2").run(0.3)


@BOOK.scene("DS520: a fault while the drive runs", "DS512 DS520")
def fault(client: Client) -> None:
    """The drive finds a fault while it runs."""
    it = machine(client).start().let(fault=30002)
    it.run(0.5).control(OFF).run(0.2).control(ACKNOWLEDGE).run(0.2).control(OFF).run(0.5)


@BOOK.scene("DS520 of a drive of another maker, as a note", "DS520")
def fault_of_another_maker(client: Client) -> None:
    """A drive trips three times, and its maker is not the one whose tables are known."""
    client.device = drive(vendor_id=0x0493)
    it = machine(client).start()
    for _ in range(3):
        it.let(fault=30002)
        it.run(0.3).control(OFF).run(0.2).control(ACKNOWLEDGE).run(0.2).control(OFF).run(
            0.3
        ).start()


@BOOK.scene("DS520 with the number, which telegram 352 carries", "DS520")
def fault_with_number(client: Client) -> None:
    """The drive finds a fault while it runs, and its telegram has the number."""
    it = machine(client, ALONE).start().let(fault=30002)
    it.run(0.5).control(OFF).run(0.2).control(ACKNOWLEDGE).run(0.2).control(OFF).run(0.5)


@BOOK.scene("Near DS520: a fault at standstill", "DS512")
def fault_at_standstill(client: Client) -> None:
    """The drive finds a fault while it stands, which is acknowledged."""
    it = machine(client).control(OFF).run(0.3)
    it.let(fault=7860).run(0.5).control(ACKNOWLEDGE).run(0.2).control(OFF).run(0.3)


@BOOK.scene(
    "DS521: ON with a complete control word, and the drive waits for something else", "DS512 DS521"
)
def on_without_enable(client: Client) -> None:
    """ON, and an enable signal of the drive is missing."""
    machine(client, enabled=False).control(OFF).run(0.3).setpoint(50).control(ON).run(12)


@BOOK.scene("Near DS521: the enable signal comes after eight seconds", "DS512")
def on_with_late_enable(client: Client) -> None:
    """ON, and an enable signal of the drive comes late, with a new ON."""
    it = machine(client, enabled=False).control(OFF).run(0.3).setpoint(50).control(ON).run(8)
    it.let(enabled=True).start()


@BOOK.scene("DS522: ON in a word that the drive ignores", "DS512 DS522")
def on_without_control(client: Client) -> None:
    """ON, but bit 10 of the control word is missing."""
    it = machine(client).control(OFF).run(0.3)
    it.control(0x007E).run(0.2).control(0x007F).run(1).control(OFF).run(0.3)


@BOOK.scene("DS522, DS532: a program that does not know bit 10", "DS512 DS522 DS532 DS533")
def never_control(client: Client) -> None:
    """16#007E, 16#007F, and 16#00FE after a fault: never is bit 10 set."""
    it = machine(client).control(WITHOUT_CONTROL).run(0.3).control(WITHOUT_CONTROL | 1).run(2)
    it.control(WITHOUT_CONTROL).run(0.3).let(fault=7860)
    it.run(0.5).control(WITHOUT_CONTROL | 0x80).run(2.2).control(WITHOUT_CONTROL).run(0.3)


@BOOK.scene("Near DS522: bit 10 is missing, and nothing is asked for", "DS512")
def control_given_back(client: Client) -> None:
    """The program gives control back while the drive stands."""
    machine(client).control(OFF).run(0.3).control(0x0000).run(1).control(OFF).run(0.3)


@BOOK.scene("DS523: ON stands at 1 from the first frame on; then OFF1 and ON", "DS512 DS523")
def on_from_the_first_frame(client: Client) -> None:
    """The drive does not start: 16#047F from the first frame on. 16#047E, 16#047F: it runs."""
    it = machine(client).setpoint(40).control(ON).run(4).control(OFF).run(0.5).control(ON)
    it.until(lambda drive: drive.actual >= 39.9).run(0.5)


@BOOK.scene("Near DS523: ON stands for one second, then the program gives the edge", "DS512")
def on_with_edge(client: Client) -> None:
    """ON stands at 1 for one second only."""
    it = machine(client).setpoint(40).control(ON).run(1).control(OFF).run(0.5).control(ON)
    it.until(lambda drive: drive.actual >= 39.9).run(0.5)


@BOOK.scene("DS524: acknowledged, and the fault stays", "DS512 DS524 DS533")
def fault_that_stays(client: Client) -> None:
    """A fault is acknowledged while its cause is still there."""
    it = machine(client, cleared=False).control(OFF).run(0.3)
    it.let(fault=7860).run(0.5).control(ACKNOWLEDGE).run(0.2).control(OFF).run(3)


@BOOK.scene("Near DS524: it goes after one second", "DS512")
def fault_that_goes_late(client: Client) -> None:
    """A fault is acknowledged again, and goes with the second time."""
    it = machine(client, cleared=False).control(OFF).run(0.3)
    it.let(fault=7860).run(0.5).control(ACKNOWLEDGE).run(0.2).control(OFF).run(0.8)
    it.let(cleared=True).control(ACKNOWLEDGE).run(0.2).control(OFF).run(3)


@BOOK.scene("DS532: acknowledged with 16#00FE, without control by PLC", "DS512 DS532 DS533")
def acknowledged_without_control(client: Client) -> None:
    """A fault is acknowledged three times by words without bit 10, and stands to the end."""
    it = machine(client).control(OFF).run(0.3).let(fault=7860).run(0.5)
    for _ in range(3):
        it.control(WITHOUT_CONTROL).run(0.5).control(WITHOUT_CONTROL | 0x80).run(2.2)


@BOOK.scene("Near DS532: the fault goes at that edge", "DS512")
def acknowledged_by_something_else(client: Client) -> None:
    """An acknowledgement without bit 10, and somebody acknowledges the fault at the drive meanwhile."""
    it = machine(client).control(OFF).run(0.3).let(fault=7860)
    it.run(0.5).control(WITHOUT_CONTROL).run(0.2).control(WITHOUT_CONTROL | 0x80).run(0.3)
    it.let(fault=0).run(3)


@BOOK.scene("DS533: a fault at standstill that nobody acknowledges", "DS512 DS533")
def fault_that_stands(client: Client) -> None:
    """The drive finds a fault while it stands, and has it when the capture ends."""
    machine(client).control(OFF).run(0.3).let(fault=7860).run(0.5)


@BOOK.scene("DS533: a fault, and then the data of the drive is invalid", "DS512 DS533")
def fault_behind_invalid_data(client: Client) -> None:
    """The drive finds a fault while it stands; its data is not valid any more when the capture ends."""
    it = machine(client).control(OFF).run(0.3).let(fault=7860).run(0.5)
    it.line.iops[INPUT] = BAD
    it.run(0.5)


@BOOK.scene("DS525: the setpoint changes, and bit 6 blocks it", "DS512 DS525")
def setpoint_blocked(client: Client) -> None:
    """The setpoint changes while STW1 bit 6 blocks it."""
    it = machine(client).start(30).control(ON & ~0x40)
    for percent in range(30, 60):
        it.setpoint(percent).run(0.1)
    it.control(ON).run(1)


@BOOK.scene("Near DS525: the setpoint stands while it is blocked", "DS512")
def setpoint_blocked_at_rest(client: Client) -> None:
    """The setpoint is blocked for a while, and does not change."""
    machine(client).start(30).control(ON & ~0x40).run(3).control(ON).run(1)


@BOOK.scene("DS526: the motor is blocked", "DS512 DS526")
def motor_blocked(client: Client) -> None:
    """The motor is blocked while it runs."""
    machine(client).start(60).let(blocked=True).run(7).let(blocked=False).run(1)


@BOOK.scene("Near DS526: a long ramp, with ZSW1 bit 8 = 1", "DS512")
def long_ramp(client: Client) -> None:
    """A ramp of twenty seconds: the actual value is far from the setpoint, and the drive says that all is well."""
    it = machine(client, up_s=20.0, down_s=20.0).control(OFF).run(0.2).setpoint(10).control(ON)
    it.until(lambda drive: drive.actual >= 9.9).setpoint(60).run(8)


@BOOK.scene("DS527: somebody takes control at the drive", "DS512 DS527")
def control_taken(client: Client) -> None:
    """Control is taken at the drive while the PLC has it."""
    machine(client).start().let(local=True).run(1)


@BOOK.scene("Near DS527: control is taken after the PLC gave it back", "DS512")
def control_taken_after(client: Client) -> None:
    """Control is given back by the PLC, then taken at the drive."""
    machine(client).control(OFF).run(0.3).control(0).run(0.3).let(local=True).run(1)


@BOOK.scene("DS528: the control word becomes 0 while the drive runs", "DS512 DS528")
def controller_stops(client: Client) -> None:
    """The controller sends a control word of 0 while the drive runs."""
    machine(client).start().control(0).run(1)


@BOOK.scene("DS528: the data of the controller becomes invalid", "DS512 DS528")
def controller_invalid(client: Client) -> None:
    """The IOPS of the controller becomes bad while the drive runs."""
    it = machine(client).start()
    it.line.iops[OUTPUT] = BAD
    it.run(0.5)
    it.line.iops[OUTPUT] = GOOD
    it.run(0.5)


@BOOK.scene("Near DS528: the same at standstill", "DS512")
def controller_stops_at_standstill(client: Client) -> None:
    """The controller sends a control word of 0 while the drive stands."""
    machine(client).control(OFF).run(0.5).control(0).run(1)


@BOOK.scene("DS529: OFF2 at the drive", "DS512 DS529")
def off_at_the_drive(client: Client) -> None:
    """The pulses are switched off at a terminal of the drive."""
    machine(client).start().let(off2=True).run(1)


@BOOK.scene("Near DS529: OFF2 by the control word", "DS512")
def off_by_the_controller(client: Client) -> None:
    """The program coasts the drive by OFF2."""
    machine(client).start().control(0x047C).run(1).control(OFF).run(0.3)


@BOOK.scene("Everything that is no finding: jog, reverse, OFF3, an alarm", "DS512")
def every_event(client: Client) -> None:
    """A drive jogs, turns the other way, has an alarm, stops quickly."""
    it = machine(client).start(40).control(ON | 0x0800).run(2).let(alarm=True).run(0.3)
    it.let(alarm=False)
    it.run(0.3).control(ON & ~0x0004).until(lambda drive: drive.state == "S1").control(OFF).run(0.3)
    it.control(0x057E).run(0.3).control(OFF).run(0.3)


# PKW


def _saved(client: Client, times: int) -> None:
    it = machine(client).start()
    for number in range(times):
        it.change(1082, real(40 + number), ak=13)


def slow_response(client: Client, pnu: int, pause: int, cycles: int) -> None:
    """The drive responds after so many cycles; so many stands the request."""
    machine(client, pause=pause).start().read(pnu, cycles=cycles)


@BOOK.scene("DS507: a double word is changed as a word", "read ok, change error, DS501 DS507")
def word_on_double_word(client: Client) -> None:
    """A parameter that was read as a double word is changed as a word."""
    machine(client).start().read(1082).change(1082, b"\0\x28", ak=2)


@BOOK.scene("Near DS507: a word is changed as a word", "read ok, change ok")
def word_on_word(client: Client) -> None:
    """A parameter that was read as a word is changed as a word."""
    machine(client).start().read(700).change(700, b"\0\2", ak=2)


BOOK.scenes(
    _saved,
    ("saved-often", "The program saves a parameter with each change", "DS508: twelve changes that save",
     "12 change ok, DS508", 12),
    ("saved-seldom", "The program saves a parameter ten times", "Near DS508: ten of them",
     "10 change ok", 10),
)  # fmt: skip


@BOOK.scene("DS509: 120 reads of one parameter", "120 read ok, DS509")
def same_read(client: Client) -> None:
    """The program reads one parameter again and again."""
    it = machine(client).start()
    for _ in range(120):
        it.read(1082)


@BOOK.scene("Near DS509: the request stands, and the drive repeats its response", "read ok")
def held_read(client: Client) -> None:
    """The program holds its request instead, and the value moves."""
    it = machine(client).start()
    it.read(1082, cycles=200)


@BOOK.scene("DS510: IND in the other order", "2 read error, DS501 DS510")
def other_layout(client: Client) -> None:
    """The program writes subindex and page in the other order."""
    it = machine(client).start()
    for request in (b"\x10\x0a\x80\x01", b"\x10\x0b\x80\x02"):
        it.ask(request + bytes(4)).ask(IDLE, 5)


@BOOK.scene("Near DS510: page 80 and subindex 1, as they should be", "read ok")
def right_layout(client: Client) -> None:
    """The program writes them in the order of cyclic transfer."""
    machine(client).start().read(2010, 1, ak=6)


BOOK.scenes(
    slow_response,
    ("slow-response", "The drive takes its time", "DS511: a response after 1.6 s", "read ok, DS511",
     1082, 100, 110),
    ("less-slow-response", "The drive takes some time", "Near DS511: a response after 0.8 s", "read ok",
     1082, 50, 60),
    ("request-ignored", "A drive beside whose words something reads as a request, and that does not respond to it",
     "DS514: what reads as a request stands for 40 cycles", "DS514", 700, 10_000, 40),
    ("request-ignored-shortly", "The program takes it back sooner",
     "Near DS514: it stands for 20 cycles", "", 700, 10_000, 20),
)  # fmt: skip


@BOOK.scene(
    "DS530: a change that is not accepted in operation, and is after OFF1",
    "change error, change ok, DS501 DS530",
)
def change_in_operation(client: Client) -> None:
    """A parameter cannot be changed in operation; after OFF1 it can."""
    it = machine(client).start().change(304, b"\0\x32", ak=2)
    it.control(OFF).until(lambda drive: drive.state == "S2").change(304, b"\0\x32", ak=2)


@BOOK.scene(
    "DS531: a change that is not accepted, and not because of operation",
    "change error, DS501 DS531",
)
def change_at_standstill(client: Client) -> None:
    """A parameter cannot be changed, though the drive stands."""
    it = machine(client).control(OFF).run(0.3)
    it.drive.cells[304, 0].refused = 17
    it.change(304, b"\0\x32", ak=2)


PRINTED = (
    ("12bc000000000000", "12bc000000000002"), ("100a018000000000", "200a018042480000"),
    ("143a000000000000", "243a000042480000"), ("343a000042200000", "243a000042200000"),
    ("1019000000000000", "2019000043660000"),
)  # fmt: skip
"""Requests of PKW and their responses, as an application note prints them; of the last one the request only."""
SAID = (
    ("047e3333", "fb310000"), ("047f3333", "fb330000"), ("047f3333", "fb373333"), ("047e0000", "fb310000"),
    ("057e0000", "fb310000"), ("047e0000", "fb310000"),
)  # fmt: skip
"""Words of controller and drive; what the drive says after ON is not printed."""


@BOOK.scene(
    "The telegrams of PKW and PZD that an application note prints", "3 read ok, change ok, read ok"
)
def as_printed(client: Client) -> None:
    """Nine telegrams of PKW and six of PZD, one after the other."""
    line = Cyclic(client)
    line.connect()
    for control, status in SAID:
        line.say(PZD, OUTPUT, bytes.fromhex(control))
        line.cycle(2)
        line.say(PZD, INPUT, bytes.fromhex(status))
        line.cycle(6)
    for request, response in PRINTED:
        line.say(PKW, OUTPUT, bytes.fromhex(request))
        line.cycle(3)
        line.say(PKW, INPUT, bytes.fromhex(response))
        line.cycle(3)
