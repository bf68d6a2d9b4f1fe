"""Frames of PROFIBUS against pyprofibus, a stack that is not ours: every field of frames by chance.

It runs in a process of its own. What it does not do is not compared: special identifiers of a configuration, which
it takes apart by another rule, and SAP 0.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ds47.lab import everything
from ds47.profibus import dp, telegram

PROGRAM = Path(__file__).with_name("pyprofibus_codec.py")
LOOSE = {"reserved", "address", "extension", "rest"}
"""Flaws that pyprofibus does not look for."""
Ask = Any


@pytest.fixture(scope="module")
def ask() -> Iterator[Ask]:
    """A function that gives what pyprofibus says to a frame."""
    if find_spec("pyprofibus") is None:
        missing = pytest.fail if os.environ.get("DS47_CI") == "1" else pytest.skip
        missing("pyprofibus is missing")
    with subprocess.Popen(
        [sys.executable, str(PROGRAM)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None

        def question(data: bytes) -> dict[str, Any]:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(data.hex() + "\n")
            process.stdin.flush()
            found: dict[str, Any] = json.loads(process.stdout.readline())
            return found

        yield question
        process.stdin.close()


SAPS = st.none() | st.integers(1, 63)
FRAMES = st.builds(
    telegram.encode, st.integers(0, 127), st.integers(0, 126), st.integers(0, 127),
    st.binary(max_size=244), SAPS, SAPS,
)  # fmt: skip
OFTEN = settings(
    max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def same_fields(item: telegram.Telegram, said: dict[str, Any]) -> None:
    ours = {"da": item.da, "sa": item.sa, "fc": item.fc}
    ours |= {"dae": item.front.dae.hex(), "sae": item.front.sae.hex(), "du": item.du.hex()}
    assert ours == {name: said[name] for name in ours}


@pytest.mark.slow
@OFTEN
@given(data=FRAMES)
def test_every_field_of_a_frame(ask: Ask, data: bytes) -> None:
    said = ask(data)
    same_fields(telegram.decode(data), said)
    assert said["raw"] == data.hex()


def test_the_lab_sends_what_pyprofibus_sends(ask: Ask) -> None:
    """Frames of all scenes that are not damaged, those aside that it does not make: SD2 without data."""
    scenes = [each for name, each in everything().items() if name.startswith("profibus-")]
    frames = {shot.data for scene in scenes for shot in scene.play().shots}
    whole = [each for each in frames if (item := telegram.decode(each)).fc and not item.flaws]
    compared = [each for each in whole if each[:2] != b"\x68\x03"]
    for data in compared:
        said = ask(data)
        same_fields(telegram.decode(data), said)
        assert said["raw"] == data.hex()
    assert len(compared) > 200


@pytest.mark.slow
@OFTEN
@given(
    content=st.binary(min_size=8, max_size=8),
    da=st.integers(0, 255),
    sa=st.integers(0, 255),
    fc=st.integers(0, 127),
)
def test_every_field_of_a_short_frame(ask: Ask, content: bytes, da: int, sa: int, fc: int) -> None:
    """SD3: SAPs among the eight bytes; and SD1, which has none."""
    for start, body in (
        (0xA2, bytes((da, sa, fc)) + content),
        (0x10, bytes((da & 127, sa & 127, fc))),
    ):
        data = bytes((start,)) + body + bytes((telegram.check_byte(body), 0x16))
        item, said = telegram.decode(data), ask(data)
        kinds = {each.kind for each in item.flaws}
        if "error" in said:
            assert kinds == {"extension"} or kinds == {"extension", "address"}
        else:
            assert kinds <= {"address"}
            same_fields(item, said)


@pytest.mark.slow
@OFTEN
@given(data=FRAMES, at=st.integers(0, 255), byte=st.integers(0, 255), keep=st.integers(0, 255))
def test_both_refuse_the_same_damaged_frames(
    ask: Ask, data: bytes, at: int, byte: int, keep: int
) -> None:
    at %= len(data)
    damaged = (data[:at] + bytes((byte,)) + data[at + 1 :])[: keep if keep % 4 == 0 else None]
    if not damaged:
        return
    item, said = telegram.decode(damaged), ask(damaged)
    kinds = {each.kind for each in item.flaws}
    if "error" in said:
        assert kinds
    else:
        assert kinds <= LOOSE
        if not kinds & {"extension", "rest"}:
            same_fields(item, said)


@OFTEN
@given(du=st.binary(min_size=6, max_size=30))
def test_a_diagnosis(ask: Ask, du: bytes) -> None:
    data = telegram.encode(2, 3, 0x08, du, 62, 60)
    found, said = dp.decode(telegram.decode(data)), ask(data)["dp"]
    assert isinstance(found, dp.SlaveDiagnosis)
    assert found.ident == said["identNumber"]
    assert (255 if found.master is None else found.master) == said["masterAddr"]
    masks = {
        "station_non_existent": ("b0", 0x01), "station_not_ready": ("b0", 0x02), "cfg_fault": ("b0", 0x04),
        "ext_diag": ("b0", 0x08), "not_supported": ("b0", 0x10), "invalid_response": ("b0", 0x20),
        "prm_fault": ("b0", 0x40), "master_lock": ("b0", 0x80), "prm_req": ("b1", 0x01), "stat_diag": ("b1", 0x02),
        "watchdog": ("b1", 0x08), "freeze": ("b1", 0x10), "sync": ("b1", 0x20), "deactivated": ("b1", 0x80),
        "overflow": ("b2", 0x80),
    }  # fmt: skip
    assert set(found.flags) == {name for name, (byte, mask) in masks.items() if said[byte] & mask}


@OFTEN
@given(du=st.binary(min_size=7, max_size=30))
def test_parameters(ask: Ask, du: bytes) -> None:
    data = telegram.encode(3, 2, 0x7D, du, 61, 62)
    found, said = dp.decode(telegram.decode(data)), ask(data)["dp"]
    assert isinstance(found, dp.Parameters)
    assert (found.ident, found.tsdr, found.groups) == (
        said["identNumber"],
        said["minTSDR"],
        said["groupIdent"],
    )
    if found.watchdog_ms is not None:
        assert found.watchdog_ms in (said["wdFact1"] * said["wdFact2"] * base for base in (1, 10))


@pytest.mark.slow
@OFTEN
@given(du=st.lists(st.integers(0, 255).filter(lambda each: each & 0x30), max_size=20).map(bytes))
def test_a_configuration_of_general_identifiers(ask: Ask, du: bytes) -> None:
    data = telegram.encode(3, 2, 0x7D, du, 62, 62)
    found, said = dp.decode(telegram.decode(data)), ask(data)["dp"]
    assert isinstance(found, dp.Configuration)
    assert [each.data.hex() for each in found.modules] == said["modules"]
