"""Scenes of a line of PROFIBUS: each rule DS801 to DS815 once, and its near miss.

A near miss is the closest line of which the rule says nothing. Station 3 is a MICROMASTER 4; it has PPO1
where nothing else is said.
"""

from __future__ import annotations

from ds47.lab import fdl
from ds47.lab.master import FAULTY, NO_DPV1, NOT_READY, PPO1, SET_PRM, WAITS, Master, Way
from ds47.lab.scenario import BusBook

BOOK = BusBook("profibus")
MOTOR = 3
HERE = Way(MOTOR)
IDENTIFICATION = Way(MOTOR, slot=1, index=255)
READ, ANSWER = bytes.fromhex("01010101 100103840000"), bytes.fromhex("01010101 42010005")
"""P0900, which is a word."""
UNREAD_LIMIT, POLL_LIMIT = 10, 100


def running(
    master: Master, set_prm: str = SET_PRM, configured: str = PPO1, diagnosis: str = ""
) -> Master:
    """A station after its start-up, in data exchange."""
    master.start(MOTOR, set_prm, configured, diagnosis)
    master.control()
    return going(master)


def going(master: Master, cycles: int = 3, code: int = fdl.LOW) -> Master:
    """So many exchanges, with the token between them."""
    for _ in range(cycles):
        master.exchange(MOTOR, code=code)
        master.token()
    return master


def _started(master: Master, *how: str) -> None:
    running(master, *how)


def _polled(master: Master, polls: int) -> None:
    running(master).write(HERE, READ)
    master.read(HERE, ANSWER, polls=polls)


# Frames


@BOOK.scene("DS801: two answers with a wrong check byte", "DS801")
def wrong_check_bytes(master: Master) -> None:
    """Answers are damaged on the line."""
    for _ in range(2):
        running(master) if not master.number else going(master)
        master.exchange(MOTOR)
        master.spoil()
    going(master)


@BOOK.scene("Near DS801: the recording cut the last frame")
def cut_frame(master: Master) -> None:
    """A capture that ends inside a frame."""
    running(master)
    master.stage.snap = 10
    master.exchange(MOTOR)


@BOOK.scene("DS802: an answer whose length bytes differ", "DS802")
def lengths_of_a_frame(master: Master) -> None:
    """A length byte is damaged on the line."""
    running(master).exchange(MOTOR)
    master.spoil(1)
    going(master)


@BOOK.scene("Near DS802: SD2 with length 3 is a frame, though SD1 is shorter")
def short_frame(master: Master) -> None:
    """A station without inputs answers in a frame that has a length and no data."""
    master.start(MOTOR, configured="20")
    master.ask(MOTOR, "00")
    body = bytes((master.address, MOTOR, fdl.LOW))
    master.put(bytes((0x68, 3, 3, 0x68)) + body + bytes((sum(body) & 0xFF, 0x16)))


@BOOK.scene("DS803: two repetitions of a request", "DS803")
def repeated(master: Master) -> None:
    """The master asks three times until the station answers."""
    running(master).ask(MOTOR, "00" * 12)
    master.repeat()
    master.repeat()
    master.tell(MOTOR, "00" * 12)
    going(master)


@BOOK.scene("Near DS803: the line was recorded at two places")
def recorded_twice(master: Master) -> None:
    """Every frame stands in the capture twice."""
    master.stage.copies = 2
    running(master)


@BOOK.scene("DS804: a request without an answer", "DS804")
def no_answer(master: Master) -> None:
    """The station misses a request, and the master begins anew with it."""
    running(master).ask(MOTOR, "00" * 12)
    master.restart(MOTOR)
    master.token()
    going(master)


@BOOK.scene(
    "Near DS804: nobody is at the addresses 4 to 9, the recorder missed an answer and stops before another one",
    "DS725",
)
def nobody_there(master: Master) -> None:
    """The master had the first answer, for its next request has the other FCB; then the capture ends."""
    running(master).ask(MOTOR, "00" * 12)
    master.look(range(4, 10))
    going(master).ask(MOTOR, "00" * 12)


# Records


@BOOK.scene("DS805: records without DPV1_Enable", "read refused, DS805")
def records_without_dpv1(master: Master) -> None:
    """Set_Prm did not enable DPV1, and the program writes a request."""
    running(master, NO_DPV1).ask(MOTOR, f"5f002f{len(READ):02x}{READ.hex()}", 51, 51)
    master.tell(MOTOR, code=fdl.NOT_ENABLED)
    going(master)


@BOOK.scene(
    "DS817: no resource (RR), and the write is accepted later", "read refused, read ok, DS415 DS817"
)
def no_resource(master: Master) -> None:
    """The station has no room for a record, and takes it later."""
    running(master).ask(MOTOR, f"5f002f{len(READ):02x}{READ.hex()}", 51, 51)
    master.tell(MOTOR, code=fdl.NO_RESOURCE)
    going(master).parameters(HERE, READ, ANSWER)


@BOOK.scene("Near DS805: the same with DPV1_Enable", "read ok")
def records_with_dpv1(master: Master) -> None:
    """Set_Prm enabled DPV1, and the program writes a request."""
    going(running(master)).parameters(HERE, READ, ANSWER)


@BOOK.scene("Near DS817: no resource (RR) for a data exchange", "DS816")
def no_resource_for_outputs(master: Master) -> None:
    """The station has no room for outputs, and no record is refused."""
    running(master).ask(MOTOR, "00" * 12)
    master.tell(MOTOR, code=fdl.NO_RESOURCE)
    going(master)


@BOOK.scene("DS806: a master asks for identification, and the drive has none", "DS806")
def no_identification(master: Master) -> None:
    """The master reads index 255, which the station refuses."""
    running(master).read(IDENTIFICATION, refused="de80b000")
    going(master)


@BOOK.scene("Near DS806: the drive has one")
def identification(master: Master) -> None:
    """The master reads index 255 of slot 1."""
    running(master).read(IDENTIFICATION, bytes(10))
    going(master)


BOOK.scenes(
    _polled,
    ("polled-often", "The station takes 101 polls for its response", "DS807: 101 polls",
     "read ok, DS807", POLL_LIMIT + 1),
    ("polled", "The station takes 100 polls for its response", "Near DS807: 100 polls", "read ok",
     POLL_LIMIT),
)  # fmt: skip


@BOOK.scene("DS808: a read of index 47 before any write", "read ok, DS703 DS808")
def read_first(master: Master) -> None:
    """The program reads a response before it asks."""
    running(master).read(HERE, refused=NOT_READY)
    going(master).parameters(HERE, READ, ANSWER)


@BOOK.scene("Near DS808: the same in a capture that has no start-up", "read ok, DS110 DS725")
def read_first_later(master: Master) -> None:
    """The capture begins behind a write, or without one: nobody knows."""
    going(master).read(HERE, refused=NOT_READY)
    going(master).parameters(HERE, READ, ANSWER)


@BOOK.scene(
    "DS809: a write of 241 bytes, of which the frame has room for 240",
    "read refused, DS202 DS203 DS314 DS809",
)
def write_too_long(master: Master) -> None:
    """The program writes 241 bytes, which the station refuses."""
    running(master).service(HERE, f"5f002ff1{READ.ljust(240, bytes(1)).hex()}")
    master.poll(MOTOR, "df80b100")


@BOOK.scene("Near DS809: a buffer of 240 bytes", "read ok, DS314")
def longest_write(master: Master) -> None:
    """The program writes its whole buffer of 240 bytes."""
    running(master).parameters(HERE, READ.ljust(240, b"\0"), ANSWER)


# Stations


@BOOK.scene("DS810: Set_Prm after data exchange", "DS810")
def parameters_again(master: Master) -> None:
    """The station has left data exchange, and is started again."""
    running(master)
    running(master)


@BOOK.scene("Near DS810: Set_Prm twice before data exchange")
def parameters_twice(master: Master) -> None:
    """The master sends the parameters twice, as the station was not ready."""
    master.start(MOTOR, diagnosis=WAITS)
    running(master)


@BOOK.scene(
    "DS816: a data exchange comes 400 ms after the one before; the watchdog is 300 ms", "DS816"
)
def exchange_refused(master: Master) -> None:
    """The watchdog of the station runs out, as its master is too slow."""
    running(master).wait(400)
    for _ in range(2):
        master.ask(MOTOR, "00" * 12)
        master.tell(MOTOR, code=fdl.NOT_ENABLED)


@BOOK.scene("Near DS816: a data exchange comes 290 ms after the one before")
def exchange_in_time(master: Master) -> None:
    """The master is slow, and not too slow for the watchdog."""
    running(master).wait(290)
    going(master)


@BOOK.scene("DS811: 4 bytes of inputs, where Chk_Cfg says 12", "DS811")
def other_lengths(master: Master) -> None:
    """The station answers with the data of PPO3, and was configured with PPO1."""
    running(master).exchange(MOTOR, "00" * 12, "00" * 4)


@BOOK.scene("Near DS811: a master in clear state sends no outputs")
def no_outputs(master: Master) -> None:
    """The master holds its slaves safe."""
    running(master).control("0200")
    for _ in range(3):
        master.exchange(MOTOR, "")


@BOOK.scene("DS812: ten answers ask for a diagnosis that nobody reads", "DS812")
def diagnosis_not_read(master: Master) -> None:
    """The station asks for a diagnosis in vain."""
    going(running(master), UNREAD_LIMIT, fdl.HIGH)


@BOOK.scene("Near DS812: nine answers, then it is read")
def diagnosis_read(master: Master) -> None:
    """The station asks for a diagnosis until it is read."""
    going(running(master), UNREAD_LIMIT - 1, fdl.HIGH).diagnose(MOTOR, FAULTY)
    going(master)


@BOOK.scene("DS814: Cfg_Fault", "DS814")
def configuration_refused(master: Master) -> None:
    """The station refuses the configuration."""
    master.start(MOTOR, diagnosis="040c000280b5")
    master.diagnose(MOTOR, "040c000280b5")


@BOOK.scene("Near DS814: the station is not ready yet, and asks nothing")
def not_ready_yet(master: Master) -> None:
    """The station takes a while until it is ready."""
    master.start(MOTOR, diagnosis="020c000280b5")
    master.diagnose(MOTOR)
    going(master)


BOOK.scenes(
    _started,
    ("pkw-word-by-word", "PKW is configured without consistency over its whole length",
     "DS813: PKW as 73", "DS813", SET_PRM, "73f1"),
    ("pzd-word-by-word", "PZD alone is configured without consistency over its whole length",
     "Near DS813: PKW as F3, and PZD as 71", "", SET_PRM, "f371"),
    ("no-watchdog", "The watchdog of the station is switched off",
     "DS815: Set_Prm locks the station, and leaves the watchdog off", "DS815", "b0" + SET_PRM[2:], PPO1,
     "0004000280b5"),
)  # fmt: skip


@BOOK.scene("Near DS815: Set_Prm without watchdog that locks nothing")
def unlocked(master: Master) -> None:
    """The watchdog is off in Set_Prm of a master that then gives the station back."""
    running(master).ask(4, "70" + SET_PRM[2:], fdl.PARAMETERS)
    master.short()
