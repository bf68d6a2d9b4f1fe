"""The times of the page in a browser: those of the report's zone, wherever the browser is."""

from __future__ import annotations

import io

import pytest

from ds47.analysis import analyze
from ds47.model import Report
from ds47.report import ReportOptions, html, write_all
from ds47.report.clock import Clock
from ds47.report.zones import zone

HOUR = 3600 * 10**9
BERLIN = zone("Europe/Berlin")
IN_THE_HOUR_THAT_COMES_TWICE = 1_792_887_600 * 10**9  # 2026-10-25 00:20 UTC
CASES = {
    "one day": (0, 1),
    "midnight": (1_767_308_390 * 10**9, 1),
    "summer time ends": (IN_THE_HOUR_THAT_COMES_TWICE, 1000),
    "half a year": (IN_THE_HOUR_THAT_COMES_TWICE, 12_000_000),
    "never set": (5 * 10**9 + 1, 1),
    "before 1970": (-(10**18), 1),
}


def moved(captures, start_ns, factor):
    """The transactions of a capture at other times, some of them with parts of a microsecond."""
    result = analyze(captures / "tour-machine.pcapng")
    first = result.start_ns
    start_ns = start_ns or first
    for number, each in enumerate(result.transactions):
        each.start_ns = start_ns + (each.start_ns - first) * factor + 333 * number
    result.start_ns = start_ns + 999
    result.end_ns = result.transactions[-1].start_ns + HOUR // 60
    for each in result.findings:
        each.time_ns = None
    return result


@pytest.mark.parametrize("name", CASES)
def test_the_page_says_the_times_that_the_text_says(browser, captures, tmp_path, name):
    result = moved(captures, *CASES[name])
    stream = io.StringIO()
    write_all(html.Writer(stream, ReportOptions(zone=BERLIN)), Report([result]))
    page = tmp_path / "page.html"
    page.write_text(stream.getvalue(), "utf-8")
    browser.open(page)
    clock = Clock.of(result, BERLIN)
    told = [
        " ".join(filter(None, [clock.at(each.start_ns), f"{clock.since(each.start_ns)} s"]))
        for each in result.transactions
    ]
    assert browser.texts("[data-part=transactions] td.time") == told
    spans = clock.span(result)
    assert spans.en in browser.texts(".about")[0]


def test_a_plot_says_time_of_day_seconds_and_frame_where_the_pointer_is(
    browser, captures, tmp_path
):
    result = analyze(captures / "tour-machine.pcapng")
    stream = io.StringIO()
    write_all(html.Writer(stream, ReportOptions(zone=BERLIN)), Report([result]))
    page = tmp_path / "page.html"
    page.write_text(stream.getvalue(), "utf-8")
    browser.open(page)
    browser.plots()
    told = browser.told(1)
    clock = Clock.of(result, BERLIN)
    for each in result.transactions:
        if each.duration_ns is not None:
            lines = (
                f"Transaction\n#{each.id}\nDrive\npress-1-drive DO 2\n"
                f"time\n{clock.at(each.start_ns)} · {clock.since(each.start_ns)} s\n"
                f"frame\n{each.frames.first()}\nTook\n{each.duration_ns / 1e6:.1f} ms\n"
            )
            assert [text for text in told if text.startswith(lines)], lines
    (fault,) = (text for text in told if "fault buffer" in text)
    assert fault.endswith(": read from the fault buffer, r0945: 7900, 30002\n")
    assert browser.ticks(1) == ["09:00:00.000", "09:00:00.500", "09:00:01.000", "09:00:01.500"]
