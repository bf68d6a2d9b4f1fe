"""Scenarios: causes (DS7xx) that the order of calls betrays, and the sentences that all of the causes use.

Each cause is shown by `diagnosis-NAME`, the name of its rule, or by several with a word behind it. Each
has a near miss, with `-not` at the end, that differs in the decisive detail only and gives no diagnosis.
Changes end with p0977 = 1 (copy RAM to ROM), so that DS721 is given where it is meant and nowhere else.
The other causes: `diagnoses_places`, `diagnoses_whole`, `diagnoses_refused` and `diagnoses_bytes`.
"""

from __future__ import annotations

from uuid import UUID

from ds47.lab import message
from ds47.lab.client import BUSY, Client, controller
from ds47.lab.scenario import Book
from ds47.lab.wire import RecordId

BOOK = Book("diagnosis")

CYCLE = 10
"""Milliseconds of a cycle of the program: a block sees the end of another one in the next."""
LONG = 12_000
"""Milliseconds in which nobody reads: then it is clear that nobody will."""

SPEED, CURRENT = message.address(21), message.address(27)
FAULTS = message.address(945, 0, 4)
FIXED = message.address(2900)
LOCAL, GLOBAL, CONFUSED = 0xB02E, 0xB02F, 71

DF_BUSY, DF_STATE, DF_HEADER = 0xDF80C200, 0xDF80B500, 0xDF80B700
DF_INDEX, DF_SLOT, DF_ACCESS = 0xDF80B000, 0xDF80B200, 0xDF80B600


def read(reference: int, *addresses: bytes, axis: int = 1) -> bytes:
    """A read request; r0021 where nothing else is said."""
    return message.read(reference, axis, *(addresses or (SPEED,)))


def speed(reference: int, value: float = 1500.0, axis: int = 1) -> bytes:
    """The answer to a read of one Float32."""
    return message.answer(reference, 1, axis, message.real(value))


def fixed(reference: int, value: float) -> bytes:
    """A change of P2900, fixed value 1."""
    return message.change(reference, 1, (FIXED, message.real(value)))


def save(client: Client, reference: int) -> None:
    """Copy RAM to ROM: p0977 = 1, which takes the drive a while."""
    request = message.change(reference, 1, (message.address(977), message.word(1)))
    client.wait(CYCLE)
    client.exchange(request, message.changed(reference, 1), polls=3)


def ask(client: Client, reference: int, value: float = 1500.0, at: RecordId | None = None) -> None:
    """A read of r0021 that nothing is wrong with."""
    client.exchange(read(reference), speed(reference, value), at=at)
    client.wait(CYCLE)


def polls(client: Client, count: int, pause: float = CYCLE, at: RecordId | None = None) -> None:
    """Reads that are refused with DE80B500, and a pause behind each."""
    for _ in range(count):
        client.poll(at=at)
        client.wait(pause)


# The Read before the Write response (DS702)


@BOOK.scene(
    "RDREC starts together with WRREC: its first Read overtakes the Write response",
    "read ok, DS702",
)
def read_too_early(client: Client) -> None:
    """Read and Write started in the same cycle."""
    request = read(1)
    write = client.ask_write(request)
    early = client.ask_read()
    client.accept_write(write, request)
    client.refuse_read(early, BUSY)
    client.wait(CYCLE)
    client.read(speed(1))


@BOOK.scene(
    "the same frames, but the first Read is sent after the Write response: an ordinary poll",
    "read ok",
)
def read_too_early_not(client: Client) -> None:
    """Read started with DONE of the Write, the drive not ready yet."""
    client.exchange(read(1), speed(1), polls=1)


# Nothing was asked (DS703)


@BOOK.scene(
    "RDREC goes on after the response was read: three times DE80B500", "read ok, DS206 DS703"
)
def nothing_was_asked(client: Client) -> None:
    """Reads without a request."""
    ask(client, 1)
    polls(client, 3)


@BOOK.scene(
    "the same three DE80B500, but a request stands before them: the drive is busy", "2 read ok"
)
def nothing_was_asked_not(client: Client) -> None:
    """Reads while the drive works on a request."""
    ask(client, 1)
    client.write(read(2))
    polls(client, 3)
    client.read(speed(2, 1480.0))


# The previous response read again (DS704)


def _faults(client: Client, status: int) -> None:
    """The fault buffer, asked for twice with the same reference; `status` is that of the second Write."""
    answer = message.answer(1, 1, 1, message.word(7900, 0, 0, 0))
    client.exchange(read(1, FAULTS), answer)
    client.wait(500)
    client.write(read(1, FAULTS), status=status)
    client.wait(CYCLE)
    client.read(answer)


BOOK.scenes(
    _faults,
    ("old-answer", "An old response after a failed Write",
     "the second Write fails, the Read brings the first response again: a fault long acknowledged still shows",
     "read ok, read refused, DS203 DS415 DS704", DF_BUSY),
    ("old-answer-not", "The same value asked for twice",
     "the same bytes, but the second Write is accepted: the fault is really still there",
     "2 read ok, DS415", 0),
)  # fmt: skip


@BOOK.scene(
    "RDREC runs again without WRREC: the same response three times, 500 ms apart", "read ok, DS704"
)
def old_answer_unsent(client: Client) -> None:
    """One request, three Reads."""
    ask(client, 1)
    for _ in range(2):
        client.wait(500)
        client.read(speed(1))


@BOOK.scene(
    "a change at slot 1 that nobody reads; at slot 2 a whole transaction, and one Read too many behind it",
    "change superseded, read ok, change ok, DS206 DS414 DS703",
)
def nothing_was_asked_elsewhere(client: Client) -> None:
    """A Read without a request, while another submodule has one open."""
    client.write(fixed(1, 25.0))
    there = client.at(slot=2)
    ask(client, 1, at=there)
    polls(client, 1, at=there)
    save(client, 2)


# Two users of one channel (DS705)


@BOOK.scene(
    "block B writes its request before block A has read its response, which is lost",
    "read superseded, read ok, DS413 DS705",
)
def two_users(client: Client) -> None:
    """Two blocks on one channel of one AR."""
    client.write(read(1))
    client.exchange(read(2, CURRENT), speed(2, 12.5))


@BOOK.scene(
    "the same question once more before its response was read: one user who does not wait",
    "read superseded, read ok, DS413",
)
def two_users_again_not(client: Client) -> None:
    """One block that asks again."""
    client.write(read(1))
    client.exchange(read(2), speed(2, 12.5))


@BOOK.scene(
    "the same two requests one after the other: each response is read before the next request",
    "2 read ok",
)
def two_users_not(client: Client) -> None:
    """Two blocks that take turns."""
    client.exchange(read(1), speed(1))
    client.exchange(read(2, CURRENT), speed(2, 12.5))


def second_controller(client: Client) -> Client:
    """Another controller with an AR to the same submodule of the same drive."""
    return Client(
        client.stage,
        controller(2),
        client.device,
        activity=UUID("1f2e3d4c-5b6a-11f0-8a47-00000a0b0c02"),
        channel=client.at(ar=UUID("47474747-0002-4000-8000-000000000002")),
    )


def _turned_away(client: Client, second: Client) -> None:
    """The second one asks while the request of the first is open."""
    ask(second, 1)
    client.write(read(7))
    second.write(read(2), status=DF_STATE)
    client.read(speed(7))


@BOOK.scene(
    "the second controller asks while the first one's request is open: DF80B500",
    "2 read ok, read refused, DS203 DS705",
)
def two_users_across(client: Client) -> None:
    """Two controllers on one channel."""
    _turned_away(client, second_controller(client))


@BOOK.scene(
    "the same two controllers, the second one asks when the first has its response", "3 read ok"
)
def two_users_across_not(client: Client) -> None:
    """Two controllers that take turns."""
    second = second_controller(client)
    ask(second, 1)
    ask(client, 7)
    ask(second, 2)


@BOOK.scene(
    "one controller with two ARs, such as the program and a diagnostic block: DF80B500",
    "2 read ok, read refused, DS203 DS705",
)
def two_users_connections(client: Client) -> None:
    """Two connections of one controller on one channel."""
    second = Client(
        client.stage,
        client.host,
        client.device,
        activity=UUID("1f2e3d4c-5b6a-11f0-8a47-00000a0b0c03"),
        channel=client.at(ar=UUID("74747474-0003-4000-8000-000000000003")),
    )
    _turned_away(client, second)


@BOOK.scene(
    "DF80B500 and nobody else to be seen: the other user is not in the capture",
    "read ok, read refused, read ok, DS203 DS705",
)
def two_users_unknown(client: Client) -> None:
    """A channel that somebody else uses."""
    ask(client, 1)
    client.write(read(2), status=DF_STATE)
    client.wait(50)
    ask(client, 3)


@BOOK.scene(
    "the same, refused with DF80C200: the drive is short of resources and says nothing of another user",
    "read ok, read refused, read ok, DS203",
)
def two_users_unknown_not(client: Client) -> None:
    """A Write refused for another reason."""
    ask(client, 1)
    client.write(read(2), status=DF_BUSY)
    client.wait(50)
    ask(client, 3)
