"""Protocols that can be switched off, and fields that are there to be filtered by, in a real tshark."""

from __future__ import annotations

import pytest
from test_wireshark_plugin import CAPTURES, COMPLETE, ROOT, Tshark, columns, rows, tshark

from ds47.analysis import analyze

__all__ = ["tshark"]  # fixture

DRIVE = "cyclic-changed-after-off1.pcapng"
POLLED = "record-polls.pcapng"


def frames(tshark: Tshark, name: str, filters: str, *more: str) -> list[str]:
    found = tshark("-r", CAPTURES[name], "-2", "-Y", filters, *columns("frame.number"), *more)
    return found.splitlines()


@pytest.mark.slow
def test_the_protocol_of_drives_is_found_and_can_be_switched_off(tshark: Tshark) -> None:
    """By its name it is found wherever its fields are; switched off it has neither words nor events."""
    told = frames(tshark, DRIVE, "ds47_pzd")
    assert len(told) > 100
    assert (
        told == frames(tshark, DRIVE, "ds47.pzd") == frames(tshark, DRIVE, "ds47_pzd && ds47.pzd")
    )
    off, channel = ("--disable-protocol", "ds47_pzd"), frames(tshark, DRIVE, "ds47")
    assert frames(tshark, DRIVE, "ds47.pzd.event")
    assert frames(tshark, DRIVE, "ds47_pzd || ds47.pzd || ds47.pzd.event", *off) == []
    assert frames(tshark, DRIVE, "ds47", *off) == channel != []
    assert " PZD " in tshark("-r", CAPTURES[DRIVE])
    assert " PZD " not in tshark("-r", CAPTURES[DRIVE], *off)


def test_the_parameter_channel_can_be_switched_off(tshark: Tshark) -> None:
    off = ("--disable-protocol", "ds47")
    assert frames(tshark, POLLED, "ds47")
    assert frames(tshark, POLLED, "ds47 || ds47.pnu", *off) == []


@pytest.mark.slow
def test_on_profibus_each_protocol_can_be_switched_off(tshark: Tshark) -> None:
    path = ROOT / "captures/profibus-ppo3-and-records.pcapng"

    def count(filters: str, off: str) -> int:
        told = ("-2", "-Y", filters, "-o", "ds47.profibus_user0:TRUE", "--disable-protocol", off)
        return len(tshark("-r", path, *told).splitlines())

    found = {
        off: [count(each, off) > 0 for each in ("ds47_profibus", "ds47 || ds47.pnu", "ds47_pzd")]
        for off in ("modbus", "ds47", "ds47_pzd", "ds47_profibus")
    }
    assert found == {
        "modbus": [True, True, True], "ds47": [True, False, False],
        "ds47_pzd": [True, True, False], "ds47_profibus": [False, False, False],
    }  # fmt: skip


@pytest.mark.parametrize("passes", [(), COMPLETE], ids=["one pass", "two passes"])
def test_each_frame_says_how_long_ago_the_request_was(
    passes: tuple[str, ...], tshark: Tshark
) -> None:
    """Polls among them; the Read response has the time of the whole transaction."""
    shown = columns("frame.time_relative", "ds47.time", "ds47.duration_ms", "ds47.request_in")
    found = rows(tshark("-r", CAPTURES[POLLED], *passes, "-Y", "ds47", *shown))
    assert len(found) > 8
    assert [row[1] for row in found] == ["", *(row[0] for row in found[1:])]
    assert float(found[-1][1]) * 1000 == pytest.approx(float(found[-1][2]))
    assert float(found[5][1]) > float(found[3][1]) > 0


@pytest.mark.parametrize("name", ["tour-machine.pcapng", "transport-two-controllers.pcapng"])
def test_one_value_finds_all_accesses_to_a_parameter_of_a_drive_object(
    name: str, tshark: Tshark
) -> None:
    """The value is what Apply as Filter takes: it has to be the same in requests and responses."""
    wanted: dict[tuple[str | None, int | None, int | None], set[int]] = {}
    for item in analyze(CAPTURES[name]).transactions:
        for each in item.parameters:
            told = {item.frames.write_request, item.frames.read_response} - {None}
            place = (item.device, item.axis, each.pnu)
            wanted.setdefault(place, set()).update(frame for frame in told if frame)
    shown = columns("frame.number", "ds47.follow")
    found: dict[str, set[int]] = {}
    for number, told in rows(tshark("-r", CAPTURES[name], *COMPLETE, "-Y", "ds47.follow", *shown)):
        for text in told.split(","):
            found.setdefault(text, set()).add(int(number))
    assert found == {
        f"{device} DO {axis} PNU {pnu}": told
        for (device, axis, pnu), told in wanted.items()
        if axis and pnu is not None
    } | {text: told for text, told in found.items() if " DO " not in text}
    text, told = max(found.items(), key=lambda each: len(each[1]))
    assert len(told) > 2
    assert frames(tshark, name, f'ds47.follow == "{text}"') == [str(each) for each in sorted(told)]
