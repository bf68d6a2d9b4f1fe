"""Times of day: zones, midnight, summer time, clocks that were never set."""

from __future__ import annotations

import io
from datetime import datetime
from pathlib import Path

import handmade
import pytest

from ds47.cli import main
from ds47.model import CaptureResult, Report
from ds47.report import ReportOptions, text, write_all
from ds47.report.clock import Clock
from ds47.report.wrap import columns as width
from ds47.report.zones import UNIVERSAL, Zone, zone

SECOND = 10**9
BERLIN = zone("Europe/Berlin")


def ns(moment: str) -> int:
    """Nanoseconds since 1970 of a time with its offset."""
    return round(datetime.fromisoformat(moment).timestamp()) * SECOND


def of(start: int, *starts: int) -> CaptureResult:
    """A capture of transactions that begin then and take no time."""
    jobs = [
        handmade.transaction(id=number, start_ns=each, duration_ns=0)
        for number, each in enumerate(starts, 1)
    ]
    return CaptureResult("x", frames=9, start_ns=start, transactions=jobs)


def printed(result: CaptureResult, where: Zone, lang: str = "en") -> str:
    stream = io.StringIO()
    write_all(text.Writer(stream, ReportOptions(zone=where, lang=lang)), Report([result]))
    return stream.getvalue()


def test_the_zone_is_said_once_and_each_line_has_its_time() -> None:
    start = ns("2026-11-21T11:14:03+00:00")
    shown = printed(of(start, start + SECOND // 2), BERLIN)
    assert "2026-11-21 12:14:03.000 +01:00 (Europe/Berlin) to 12:14:03.500" in shown
    assert "\n#1  12:14:03.500  0.500  " in shown
    assert shown.count("Berlin") == 1


def test_a_capture_ends_with_its_last_frame_whatever_that_holds() -> None:
    start = ns("2026-11-21T23:59:50+01:00")
    result = of(start, start + SECOND)
    assert " to 23:59:51.000 (last transaction or event), 1.00 s" in printed(result, BERLIN)
    result.end_ns = start + 15 * SECOND
    shown = printed(result, BERLIN)
    assert " to 2026-11-22 00:00:05.000, 15.0 s" in shown
    assert "#1  2026-11-21 23:59:51.000  1.000" in shown
    result.end_ns = start - SECOND
    assert "(Europe/Berlin) first frame\n" in printed(result, BERLIN)


def test_over_midnight_each_time_has_its_date() -> None:
    start = ns("2026-11-21T23:59:59+01:00")
    shown = printed(of(start, start, start + 2 * SECOND), BERLIN)
    assert "\n#1  2026-11-21 23:59:59.000  0.000  " in shown
    assert "\n#2  2026-11-22 00:00:01.000  2.000  " in shown
    assert "#1  22:59:59.000  0.000" in printed(of(start, start, start + 2 * SECOND), UNIVERSAL)


def test_the_hour_that_comes_twice_is_told_apart() -> None:
    """On 2026-10-25 02:30 is there twice in Berlin."""
    first = ns("2026-10-25T02:30:00+02:00")
    clock = Clock(BERLIN, first, first + 3600 * SECOND)
    assert clock.at(first) == "02:30:00.000 +02:00"
    assert clock.at(first + 3600 * SECOND) == "02:30:00.000 +01:00"


def test_the_changes_of_a_clock_are_known_to_the_second() -> None:
    first, last = ns("2026-03-01T00:00:00+01:00"), ns("2026-12-01T00:00:00+01:00")
    spring, autumn = ns("2026-03-29T01:00:00+00:00"), ns("2026-10-25T01:00:00+00:00")
    found = Clock(BERLIN, first, last).changes()
    assert found == [(first, 3600), (spring, 7200), (autumn, 3600)]
    assert Clock(BERLIN, first, first + 60 * SECOND).changes() == [(first, 3600)]
    assert Clock(UNIVERSAL, -(10**30), 10**30).changes() == [(-(10**30), 0)]
    assert Clock(BERLIN, None).changes() == [(0, 3600)]


def test_a_clock_that_was_never_set_has_no_time_of_day() -> None:
    shown = printed(of(5 * SECOND, 6 * SECOND), BERLIN)
    assert "no time of day: the clock of the capture begins at 1970-01-01 00:00:05;" in shown
    assert "\n#1  1.000  " in shown
    assert "Berlin" not in shown


@pytest.mark.parametrize("time_ns", [-(10**30), -1, 0, 2**63, 10**30])
@pytest.mark.parametrize("where", [BERLIN, UNIVERSAL, zone("local"), zone("-11:30")])
def test_no_time_is_too_odd(time_ns: int, where: Zone) -> None:
    """Captures may lie: a year that no calendar has is written all the same."""
    clock = Clock(where, time_ns, time_ns + 1)
    assert clock.since(time_ns) == "0.000"
    assert clock.whole(time_ns)


def test_a_year_that_no_calendar_has_is_that_of_utc() -> None:
    far = 400_000 * 365 * 86_400 * SECOND
    assert Clock(BERLIN, far).whole(far)[:-3].endswith("+00:00 (Europe/Berl")


@pytest.mark.parametrize(
    "name", ["", "Europa/Berlin", "+25:00", "+02:75", "2", "../etc/passwd", "Europe"]
)
def test_a_zone_that_nobody_knows_is_one_clear_line(
    name: str, captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--tz", name, str(captures / "tour-machine.pcapng")]) == 2
    told = capsys.readouterr().err
    assert f"--tz {name!r} is not a time zone known here" in told
    assert "Traceback" not in told


def test_json_stays_utc(captures: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = set()
    for each in ("UTC", "+05:30", "Europe/Berlin"):
        path = str(captures / "tour-machine.pcapng")
        assert main(["report", "-f", "json", "--tz", each, path]) == 0
        told.add(capsys.readouterr().out)
    assert len(told) == 1


@pytest.mark.parametrize("columns", [60, 80, 100])
@pytest.mark.parametrize("lang", ["en", "zh"])
def test_no_line_is_wider_than_asked_for_but_what_may_be_copied(
    columns: int, lang: str, captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(captures / "tour-machine.pcapng")
    assert main(["report", "--width", str(columns), "--lang", lang, path]) == 0
    wide = [each for each in capsys.readouterr().out.splitlines() if width(each) > columns]
    copied = ("frame.number", "#request[", "ds47 encode", "16#")
    assert [each for each in wide if not any(word in each for word in copied)] == []
