"""Whatever happened to a capture before: no eight bytes of a secret stand in its anonymised export.

Captures of the lab hold one text wherever a station or a machine builder can put one. They are sent in
IP and RPC fragments, cut, thinned out, doubled and shuffled. More of them than the test does:
`python tests/python/test_anonymise_fuzz.py FIRST LAST` (seeds).
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from ds47.analysis import AnalysisOptions
from ds47.capture import PcapngWriter
from ds47.capture.scan import SLL, SLL2
from ds47.export import ExportOutcome, Replacements, Selection, SelectionError, export
from ds47.lab import ether, message, wire
from ds47.lab.client import OK, Client
from ds47.lab.naming import DCP, LLDP, dcp_identify, lldp
from ds47.lab.stage import MILLISECOND, Shot, Stage
from ds47.profidrive import Options

SECRET = b"acme-hall-7.secret-press-of-customer"
"""A name of a station, in lower case as DCP has it."""
WINDOW = 8
FOREIGN = 4711
"""A UDP port that is none of PROFINET."""
NAMES = (8920, 61000, 199, 8900)
"""Parameters that hold a name, whatever is asked for; on a Siemens drive."""
TEXT = 7000
LIMITS = 974
"""Its numbers stay, whatever is asked for; nothing else of it does."""
PARTS = (0x10, 0x20, 0x30)
"""Attributes: value, description, text."""
OCTETS, BYTES, WORDS, UNSIGNED8, UNSIGNED16 = 0x0A, 0x41, 0x42, 0x05, 0x06


def forms(chance: random.Random) -> bytes:
    """The secret as somebody may write it."""
    return chance.choice((SECRET, SECRET.upper(), SECRET.title()))


def values(chance: random.Random, text: bytes) -> bytes:
    """A value block with the text, of characters of one byte or of two."""
    if chance.random() < 0.25:
        wide = b"".join(bytes((0, char)) for char in text)
        return message.raw_block(chance.choice((WORDS, UNSIGNED16)), len(text), wide)
    return message.raw_block(chance.choice((OCTETS, BYTES, UNSIGNED8)), len(text), text)


def exchange(client: Client, chance: random.Random, number: int, pnus: list[int]) -> None:
    """Reads or changes parameters with the text; some blocks of plain numbers stand in front."""
    addresses, blocks = [], []
    for _ in range(chance.randrange(6)):
        addresses.append(message.address(21))
        blocks.append(message.real(chance.choice((0.5, 1500.0))))
    for pnu in pnus:
        text = forms(chance)
        part = chance.choice(PARTS) if pnu == LIMITS else PARTS[0]
        addresses.append(message.address(pnu, 0, len(text), part))
        blocks.append(values(chance, text))
    if chance.random() < 0.5:
        request = message.read(number, 1, *addresses)
        response = message.answer(number, 1, 1, *blocks)
    else:
        request = message.change(number, 1, *zip(addresses, blocks, strict=True))
        response = message.changed(number, 1, len(addresses))
    slack = SECRET if chance.random() < 0.1 else b""
    client.exchange(request + slack, response + slack, polls=chance.choice((0, 0, 1)))


def says_its_name(stage: Stage, client: Client, chance: random.Random) -> None:
    """DCP, LLDP and Connect, with the text as the name of both stations."""
    plc, motor = client.host, client.device
    if stage.link == ether.ETHERNET:
        name = SECRET.decode()
        stage.frame(ether.bare(motor.mac, plc.mac, DCP, dcp_identify(motor, name)))
        stage.frame(ether.bare(motor.mac, "01:80:c2:00:00:0e", LLDP, lldp(motor, name)))
    call = client.call(wire.CONNECT)
    client.ask(call, wire.ar_request(client.channel.ar, plc, forms(chance).decode()))
    client.accept(call, OK, wire.ar_response(client.channel.ar, motor))


def machine(chance: random.Random, everything: bool) -> Stage:
    """What the capture point saw; where values are kept, the text is in parameters for names only."""
    stage = Stage(link=chance.choice((ether.ETHERNET, ether.ETHERNET, SLL, SLL2)))
    stage.mtu = chance.choice((None, 1480, 800, 400, 200, 64))
    stage.copies = chance.choice((1, 1, 1, 2))
    client = Client(stage, order=chance.choice(("<", ">")))
    client.fragment = chance.choice((None, None, 300, 120, 40))
    client.write(message.read(1, 1, message.address(21)))  # this is a parameter channel
    client.read(message.answer(1, 1, 1, message.real(1.0)))
    for number in range(2, 9):
        kind = chance.randrange(6)
        if kind == 0:
            says_its_name(stage, client, chance)
        elif kind == 1:
            client.read(forms(chance) * 3, at=client.at(index=0xAFF0))
        elif kind == 2:
            ports = FOREIGN, FOREIGN
            stage.send(client.host, client.device, forms(chance) * chance.choice((1, 9)), ports)
        else:
            known = (*NAMES, TEXT, LIMITS) if everything else NAMES
            pnus = [chance.choice(known) for _ in range(chance.randrange(1, 5))]
            exchange(client, chance, number, pnus)
    return stage


def mishandled(shots: list[Shot], chance: random.Random) -> list[Shot]:
    """The frames as a bad capture has them: cut, lost, doubled, out of order."""
    snap = chance.choice((None, None, *(chance.randrange(60, 700) for _ in range(4))))
    wild, lost, doubled, moved = (chance.choice((0, 0, 0.05, 0.3)) for _ in range(4))
    kept = []
    for shot in shots:
        if chance.random() < lost:
            continue
        limit = chance.randrange(len(shot.data)) if chance.random() < wild else snap
        data = shot.data if limit is None else shot.data[:limit]
        kept.append(Shot(shot.time_ns, data, shot.original_length))
        while chance.random() < doubled:
            later = shot.time_ns + chance.choice((0, 50_000, 3 * MILLISECOND))
            again = data if chance.random() < 0.5 else shot.data
            kept.append(Shot(later, again, shot.original_length))
    for at in range(len(kept)):
        if chance.random() < moved:
            other = min(len(kept) - 1, at + chance.randrange(12))
            kept[at], kept[other] = kept[other], kept[at]
    return kept


def chosen(chance: random.Random, shots: list[Shot]) -> Selection:
    """All frames, or some of them."""
    times = sorted(shot.time_ns for shot in shots) or [0]
    return chance.choice(
        (
            Selection(),
            Selection(start=chance.choice(times)),
            Selection(end=chance.choice(times)),
            Selection(devices=("192.168.133.33",)),
            Selection(transactions=((1, 1),)),
            Selection(rules=("DS",)),
        )
    )


def remains(data: bytes) -> Iterator[bytes]:
    """Pieces of the secret in a file: as text of either case, of two bytes a character, as hex."""
    low = data.lower()
    for at in range(len(SECRET) - WINDOW + 1):
        piece = SECRET[at : at + WINDOW]
        for form in (piece, b"".join(bytes((0, char)) for char in piece)):
            if form in low:
                yield form
            if any(each.hex().encode() in low for each in (form, form.upper())):
                yield form.hex().encode()


def one(seed: int, folder: Path) -> tuple[ExportOutcome | None, list[bytes]]:
    """A capture by its seed, exported; and what of the secret is left. Every frame is accounted for."""
    chance = random.Random(seed)
    everything = chance.random() < 0.5
    stage = machine(chance, everything)
    shots = mishandled(stage.shots, chance)
    source, target = folder / "in.pcapng", folder / "out.pcapng"
    target.unlink(missing_ok=True)
    with PcapngWriter(source, link_type=stage.link) as writer:
        for shot in shots:
            writer.write(shot.time_ns, shot.data, shot.original_length)
    settings = AnalysisOptions(codec=Options(chance.random() < 0.2, chance.random() < 0.2))
    wanted = chosen(chance, shots)
    try:
        outcome = export(source, target, wanted, settings, Replacements(), everything)
    except SelectionError:  # the capture lost all of it
        return None, []
    told = sorted([*outcome.frames, *outcome.left_out, *(frame for frame, _ in outcome.leaks)])
    assert told == export(source, folder / "plain.pcapng", wanted, settings).frames
    return outcome, list(remains(target.read_bytes())) if outcome.frames else []


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 120, 30))
def test_no_piece_of_a_secret_leaves(first: int, tmp_path: Path) -> None:
    exported = 0
    for seed in range(first, first + 30):
        outcome, left = one(seed, tmp_path)
        assert not left, f"seed {seed}: {left}"
        exported += len(outcome.frames) if outcome else 0
    assert exported > 300  # it is no use to export nothing


def test_the_search_finds_every_form() -> None:
    wide = b"".join(bytes((0, char)) for char in SECRET.upper())
    for data in (SECRET[3:11], SECRET.title(), wide, SECRET.hex().encode(), wide.hex().encode()):
        assert list(remains(b"in front " + data + b" behind"))
    assert not list(remains(SECRET[:7] + b"|" + SECRET[7:14]))


def main() -> None:
    """Runs the seeds from the first argument up to the second, and says which leave something."""
    bad = frames = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(int(sys.argv[1]), int(sys.argv[2])):
            outcome, left = one(seed, Path(folder))
            frames += len(outcome.frames) if outcome else 0
            if left:
                bad += 1
                sys.stdout.write(f"seed {seed}: {left[:3]}\n")
    sys.stdout.write(f"{bad} captures leave something; {frames} exported frames\n")


if __name__ == "__main__":
    main()
