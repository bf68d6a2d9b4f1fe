"""PKW in cyclic frames in Lua against Python: relations, transactions and findings of whole captures.

Scenes of `test_parameter_channels`, and talk by chance (seeded): other modules, losses of data, Connects in
between, VLAN tags, frames that are lost, cut or changed.
"""

from __future__ import annotations

import io
import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from test_parameter_channels import (
    CHANGE,
    FIFTY,
    IDLE,
    MOVED,
    OTHER,
    READ,
    REFUSED,
    USS,
    Machine,
    proven,
    talk,
)

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic, LabModule

pytestmark = pytest.mark.slow
CHANCES = 50
"""Captures by chance for each Lua, other ones for each."""
MODULES = (
    (PKW, PZD), (PZD, PKW), (LabModule(1, 1, 2), PZD, LabModule(2, 9, 8), LabModule(7, 1, 30)),
    (LabModule(3, 1, 12),), (LabModule(3, 1, 20),), (LabModule(3, 1, 8), LabModule(3, 2, 12)),
    (LabModule(2, 1, 8),), (PKW, PZD, LabModule(5, 1, 12), LabModule(6, 1, 8), LabModule(6, 2, 12)),
)  # fmt: skip
WORDS = (
    READ, FIFTY, MOVED, CHANGE, REFUSED, IDLE, *OTHER, *USS, "22bc000000050000", "12bc000000000000",
    "843a000000000000", "343a000000000000", "243a000042200000", "743a00000000ffff", "543a0000ffffffff",
    "13ff030000000000", "a3ff030000000000", "643a000000000002",
)  # fmt: skip


def scenes() -> Iterator[Source]:
    """What the tests of the analyzer play."""
    for number, modules in enumerate(MODULES):
        machine = Machine(modules=modules)
        machine.module = next(each for each in modules if each != PZD and each.length >= 8)
        yield Source(f"modules {number}", talk(machine.connect()).capture(), True)
    yield Source("no Connect", talk(Machine().turn()).capture(), True)
    yield Source("not answered", Machine().connect().ask(READ, 200).ask(IDLE).capture(), False)
    machine = talk(Machine().connect())
    machine.line.modules = (LabModule(1, 1, 6), PKW, PZD)
    yield Source("another Connect", talk(machine.connect()).capture(), True)
    yield Source("long", talk(talk(Machine().connect()).turn(3_000)).capture(), False)
    machine = Machine()
    machine.line = Cyclic(Client(machine.stage, device=drive(vendor_id=0x0493)))
    yield Source("another maker", talk(machine.connect()).capture(), True)


def by_chance(seed: int) -> Source:
    chance = random.Random(seed)
    machine = Machine(modules=chance.choice(MODULES))
    machine.module = chance.choice(list(machine.line.modules))
    machine.connect()
    if chance.random() < 0.8:
        talk(machine)
    for _ in range(chance.randint(1, 40)):
        step(machine, chance)
    return Source(f"seed {seed}", damaged(machine, chance), seed % 3 == 0)


def step(machine: Machine, chance: random.Random) -> None:
    """Something that controller or drive does for some cycles."""
    fate, cycles = chance.random(), chance.choice((1, 1, 2, 3, 5))
    if fate < 0.03:
        machine.ask("343a000000000000", 1).ask(CHANGE, cycles)  # a change in parts
    elif fate < 0.45:
        machine.ask(chance.choice(WORDS), cycles)
    elif fate < 0.9:
        machine.respond(chance.choice(WORDS), cycles)
    elif fate < 0.95:
        machine.line.iops[chance.choice((INPUT, OUTPUT))] = chance.choice((GOOD, GOOD, BAD))
        machine.turn(cycles)
    elif fate < 0.98:
        machine.line.status = chance.choice((0x35, 0x35, 0x31))
        machine.turn(cycles)
    else:
        machine.line.modules = chance.choice(MODULES)
        machine.module = chance.choice(list(machine.line.modules))
        machine.connect()


def damaged(machine: Machine, chance: random.Random) -> bytes:
    """The capture, of which frames have a VLAN tag, are lost, cut, or have another byte."""
    rate, tag = chance.choice((0.0, 0.0, 0.02)), chance.choice((b"", b"\x81\x00\xc0\x00"))
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for shot in machine.stage.shots:
            data = shot.data
            if data[12:14] == b"\x88\x92":
                data = data[:12] + tag + data[12:]
            fate = chance.random() / rate if rate else 1.0
            if 0.3 < fate < 0.6:
                at = chance.randrange(12, len(data))
                data = data[:at] + bytes((chance.randrange(256),)) + data[at + 1 :]
            elif 0.6 < fate < 1.0:
                data = data[: chance.randint(14, len(data))]
            if fate >= 0.3:
                writer.write(shot.time_ns, data, max(len(data), shot.original_length))
    return target.getvalue()


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("version", VERSIONS)
def test_scenes_give_the_same_result(version: str, lang: str, tmp_path: Path) -> None:
    sources = list(scenes())
    assert sum(len(analyze(each.open()).transactions) for each in sources) > 20
    compare(version, lang, sources, tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_talk_by_chance_gives_the_same_result(version: str, tmp_path: Path) -> None:
    first = 1000 * VERSIONS.index(version)
    sources = [by_chance(seed) for seed in range(first, first + CHANCES)]
    compare(version, "en", sources, tmp_path)


def test_talk_by_chance_has_what_can_be_compared() -> None:
    """Every state and every finding about PKW."""
    results = [analyze(by_chance(seed).open()) for seed in range(CHANCES)]
    states = {each.state for result in results for each in result.transactions}
    rules = {each.rule for result in results for each in result.findings}
    assert states >= {"ok", "error", "mismatch", "superseded", "unanswered"}
    assert rules >= {"DS501", "DS502", "DS503", "DS504", "DS505", "DS506", "DS513"}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    "layouts", [(("", "uss"),), (("192.168.133.33", "uss"),), (("", "uss"), ("192.168.133.33", "cyclic"))]
)  # fmt: skip
def test_the_layout_of_the_index_is_that_of_the_drive(
    version: str, layouts: tuple[tuple[str, str], ...], tmp_path: Path
) -> None:
    content = Machine().connect().ask(USS[0]).respond(USS[1]).ask(IDLE).capture()
    options = AnalysisOptions(pkw_layouts=layouts)
    (item,) = analyze(io.BytesIO(content), options).transactions
    assert item.parameters[0].pnu in (10, 2010)
    compare(version, "en", [Source("uss", content, True)], tmp_path, options)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_slowest_response_is_named(version: str, tmp_path: Path) -> None:
    """Two are slow, the first one more so."""
    line = proven()
    for cycles in (700, 600):
        line.ask(OTHER[0], cycles).respond(OTHER[1]).ask(IDLE).respond(IDLE)
    source = Source("slow", line.capture(), True)
    (told,) = [each for each in analyze(source.open()).findings if each.rule == "DS511"]
    assert (told.args["count"], told.args["slowest"]) == (2, 2800.1)
    compare(version, "en", [source], tmp_path)
