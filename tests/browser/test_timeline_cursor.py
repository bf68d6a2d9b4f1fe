"""The cursor of a drawing in a real browser: what it reads is what the frames say, by code that knows no page."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest
from selenium.webdriver.common.keys import Keys
from tests.audit import pzd, reading

from ds47.analysis import analyze
from ds47.cli import main

CAPTURES = Path(__file__).parents[2] / "captures"
DRIVE = CAPTURES / "cyclic-changed-after-off1.pcapng"
SHOWN = ".drawing:not([hidden])"
ROWS = f"{SHOWN} [data-reading] dd"
STATE, SETPOINT, ACTUAL, COMMAND, JOBS = 1, 2, 3, 4, 5
FULL = 0x4000


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    target = tmp_path_factory.mktemp("cursor") / "drive.html"
    main(["report", "-f", "html", "-o", str(target), str(DRIVE)])
    return target


@pytest.fixture
def drawing(browser, page):
    browser.open(page)
    browser.run("document.querySelector('[data-timeline]').scrollIntoView()")
    browser.wait(f"return !!document.querySelector('{SHOWN} [data-reading] dt')")
    return browser


def press(browser, *keys):
    browser.run(f"document.querySelector('{SHOWN}').focus()")
    for key in keys:
        browser.driver.switch_to.active_element.send_keys(key)
    return browser.texts(ROWS)


def point(browser, seconds, kind="pointermove"):
    """Moves the pointer to a time of the drawing, or clicks there."""
    browser.run(
        f"""const drawing = document.querySelector('{SHOWN}'), picture = drawing.querySelector('svg');
        const box = picture.getBoundingClientRect(), data = drawing.dataset;
        const share = (arguments[0] - Number(data.seconds)) / Number(data.span);
        const x = (Number(data.left) + share * Number(data.width)) / picture.viewBox.baseVal.width * box.width;
        const place = {{clientX: box.left + x, clientY: box.top + 9, bubbles: true}};
        picture.dispatchEvent(new PointerEvent(arguments[1], place))""",
        seconds, kind,
    )  # fmt: skip
    return browser.texts(ROWS)


@pytest.fixture(scope="module")
def truth():
    """Each cyclic frame of the drive: when it came, and what both sides say then."""
    item = reading.read(DRIVE, page=False)
    begin = item.capture.frames[0].time_ns
    (drive,) = pzd.drives(item)
    return [((each.time_ns - begin) // 1000, each) for each in drive.looks], item


def times(text):
    """The times in a text, microseconds."""
    return [round(float(each) * 1e6) for each in re.findall(r"(\d+\.\d{6}) s", text)]


def checked(told, truth):
    """Holds what the cursor reads against the frames; the moment, and the parts that were told."""
    looks, item = truth
    (now,) = times(told[0])
    known = [(at, look) for at, look in looks if at <= now]
    standing = known[-1][1]
    assert told[STATE].startswith(pzd._state(standing) or "not known")
    for since in times(told[STATE]):
        behind = [look for at, look in looks if since <= at <= now][1:]
        assert {pzd._state(look) for look in behind} <= {pzd._state(standing)}
    changes = [
        (at, two.frame) for (_, one), (at, two) in pairwise(known)
        if two.by_controller and one.stw1 is not None and two.stw1 != one.stw1
    ]  # fmt: skip
    if changes:
        assert (times(told[COMMAND]), f"frame {changes[-1][1]}" in told[COMMAND]) == (
            [changes[-1][0]],
            True,
        )
    else:
        assert told[COMMAND] == "none so far"
    for place, name in ((SETPOINT, "setpoint"), (ACTUAL, "actual")):
        value = re.match(r"(-?\d+\.\d\d) %", told[place])
        if value is None:
            assert told[place] == "none so far"
            continue
        (at,) = times(told[place])
        assert at <= now
        look = [each for when, each in looks if when == at][-1]
        assert value[1] == f"{getattr(look, name) / FULL * 100:.2f}"
    ours = [each for each in item.plain["transactions"] if each["duration_ms"] is not None]
    begin = item.capture.frames[0].time_ns
    for each in ours:
        first = (reading.instant(each["start"]) - begin) // 1000
        if first <= now <= first + each["duration_ms"] * 1000:
            assert f"#{each['id']} " in told[JOBS]
    return now, told


def test_from_event_to_event_it_reads_what_the_frames_say(drawing, truth):
    moments, told = [], press(drawing, Keys.HOME)
    while not moments or times(told[0]) != moments[-1:]:
        moments.append(checked(told, truth)[0])
        told = press(drawing, Keys.ARROW_RIGHT)
    assert len(moments) > 8
    assert moments == sorted(moments)
    assert times(press(drawing, Keys.END)[0]) == moments[-1:]
    assert times(press(drawing, Keys.ARROW_LEFT)[0]) == moments[-2:-1]
    assert times(press(drawing, Keys.HOME)[0]) == moments[:1]
    assert times(press(drawing, Keys.SHIFT + Keys.ARROW_RIGHT + Keys.NULL)[0])[0] in moments[5:]


@pytest.mark.parametrize("zoom", [0, 1, 2])
def test_wherever_the_pointer_is(drawing, truth, zoom):
    drawing.click(f"[data-zoom='{zoom}']")
    drawing.wait(f"return !!document.querySelector('{SHOWN} [data-reading] dt')")
    first, span = drawing.run(
        f"const data = document.querySelector('{SHOWN}').dataset; return [Number(data.seconds), Number(data.span)]"
    )
    compared = 0
    for part in range(1, 40):
        told = point(drawing, first + span * part / 40)
        if "of this drive" not in told[STATE]:
            checked(told, truth)
            compared += 1
    assert compared > 20


def test_a_click_holds_and_escape_lets_go(drawing):
    held = point(drawing, 5.0, "click")
    assert "held, Escape releases it" in held[0]
    assert point(drawing, 7.0) == held
    assert point(drawing, 7.0, "click")[0] != held[0]
    told = press(drawing, Keys.ESCAPE)
    assert told[0] == "point at the picture, or press an arrow key in it"
    assert set(told[1:]) == {"–"}
    assert "held" not in point(drawing, 7.0)[0]


def test_its_links_lead_to_event_and_job(drawing):
    moment = drawing.run(
        f"const bar = document.querySelector('{SHOWN} .job rect');"
        f"const data = document.querySelector('{SHOWN}').dataset;"
        "return Number(data.seconds) + (bar.x.baseVal.value + 1 - data.left) / data.width * data.span"
    )
    told = point(drawing, moment, "click")
    assert re.match(r"#\d+ change p50076", told[JOBS])
    drawing.click(f"{ROWS} a[href^='#event-']")
    frame = drawing.run("return document.querySelector(location.hash).cells[0].innerText")
    assert f"frame {frame}" in told[STATE]
    assert drawing.run("return document.querySelector(location.hash).closest('details').open")
    drawing.click(f"{ROWS} a[href^='#job-']")
    drawing.wait("return !!document.querySelector('tr.detail')")


def test_beside_what_is_known_it_says_so(browser, write):
    result = analyze(CAPTURES / "cyclic-does-not-start.pcapng")
    for each in result.timelines:
        each.events = each.events[2:]
        each.end_ns = each.events[-1].time_ns + 1_000_000
        each.events_left_out = 3
    browser.open(write("part", result))
    browser.run("document.querySelector('[data-timeline]').scrollIntoView()")
    browser.click("[data-zoom='0']")
    browser.wait(f"return !!document.querySelector('{SHOWN} [data-reading] dt')")
    first, span = browser.run(
        f"const data = document.querySelector('{SHOWN}').dataset; return [Number(data.seconds), Number(data.span)]"
    )
    assert point(browser, first + span)[STATE] in (
        "not known",
        "after the last frame of this drive",
    )
    assert point(browser, first + span)[COMMAND] != "none so far"


def test_it_speaks_chinese(drawing):
    english = point(drawing, 5.0, "click")
    drawing.click("button[data-lang='zh']")
    chinese = drawing.texts(ROWS)
    assert "已固定" in chinese[0]
    assert chinese[STATE] != english[STATE]
    assert times(chinese[STATE]) == times(english[STATE])
    drawing.click("button[data-lang='en']")
    assert drawing.texts(ROWS) == english
