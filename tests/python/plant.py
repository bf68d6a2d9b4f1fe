"""A plant at work: drives whose transactions overlap, as frames; and the frames of a capture."""

from __future__ import annotations

import random
from pathlib import Path
from uuid import UUID

from ds47.capture import Frame, open_capture
from ds47.capture.errors import CaptureError
from ds47.lab import message
from ds47.lab.client import Client, drive
from ds47.lab.stage import Stage
from ds47.lab.wire import RecordId


def plant(rounds: int, devices: int = 3, seed: int = 47) -> list[tuple[int, bytes]]:
    """Transactions of some devices at once: reads of several kinds, changes, errors, reads back."""
    chance, stage = random.Random(seed), Stage()
    clients = [
        Client(
            stage, device=drive(number + 1), activity=UUID(int=4711 << 64 | number),
            channel=RecordId(UUID(int=47 << 64 | number), index=(47, 0xB02E)[number % 2]),
        )
        for number in range(devices)
    ]  # fmt: skip
    for number in range(rounds):
        reference = number % 255 + 1
        asked = []
        for client in clients:
            kind = chance.choice(("one", "one", "two", "change", "error", "text"))
            first = message.address(chance.choice((21, 1120, 2)))
            real, word = message.real(float(chance.randrange(4))), message.word(chance.randrange(9))
            if kind == "change":
                request = message.change(reference, 1, (message.address(1120), real))
                answer = message.changed(reference, 1, 1)
            else:
                values = {"one": [real], "two": [word, real], "error": [message.error(0x11)],
                          "text": [message.block(0x09, "3s", b"abc")]}[kind]  # fmt: skip
                places = [first] if len(values) == 1 else [first, message.address(964, 0, 1)]
                request = message.read(reference, 1, *places)
                answer = message.answer(reference, 0x81 if kind == "error" else 1, 1, *values)
            asked.append((client, request, answer))
        calls = [client.ask_write(request) for client, request, _ in asked]
        for (client, request, _), call in zip(asked, calls, strict=True):
            client.accept_write(call, request)
        calls = [client.ask_read() for client, _, _ in asked]
        for (client, _, answer), call in zip(asked, calls, strict=True):
            client.accept_read(call, answer)
    return [(shot.time_ns, shot.data) for shot in stage.shots]


def frames_of(path: Path) -> list[Frame]:
    try:
        with open_capture(path) as capture:
            return [frame for frame in capture if frame.link_type == 1]
    except CaptureError:
        return []
