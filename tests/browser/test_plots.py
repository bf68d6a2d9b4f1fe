"""The plots of the HTML report in a real browser: groups, percentiles, marks, the choice of a parameter, keys."""

from __future__ import annotations

import math
from collections import Counter

import handmade
import pytest

from ds47.analysis import analyze
from ds47.model import CaptureResult, Parameter, ParameterError


def test_the_plots_tell_stations_apart_and_mark_what_was_found(browser, long, stack):
    browser.open(long)
    browser.plots()
    keys = browser.texts(".plot:has([data-grouping]) .keys button")
    controllers = {each.controller for each in stack.transactions}
    assert len(controllers) == 2
    assert {text.split(" ", 1)[1] for text in keys} == {
        *controllers, "p50", "p95", "p99", "error or warning"
    }  # fmt: skip
    rows = browser.texts(".figures tbody tr")
    counted = Counter(
        each.controller
        for each in stack.transactions
        if each.duration_ns is not None and each.duration_ns >= 0
    )
    assert {tuple(row.split()[:2]) for row in rows} == {
        (name, str(n)) for name, n in counted.items()
    }
    slowest = max(each.duration_ns for each in stack.transactions if each.duration_ns)
    assert any(row.endswith(f" {slowest / 1e6:.1f} ms") for row in rows)
    browser.run(
        "const select = document.querySelector('[data-grouping]'); select.value = 'operation';"
        "select.dispatchEvent(new Event('change'))"
    )
    assert any("change" in text for text in browser.texts(".figures tbody tr"))
    durations = [float(text) for text in browser.ticks(1, up=True)]
    assert durations[-1] / durations[0] > 20, "the axis is logarithmic"
    assert len(durations) < 10


def test_a_parameter_to_plot_is_searched(browser, long):
    browser.open(long)
    browser.plots()
    browser.one("[data-picker-search]").send_keys("r01258[0] do 3")
    options = browser.texts("[data-picker] option")
    assert options
    assert all("DO 3 p1258[0]" in text for text in options)
    label = (
        "return [...document.querySelectorAll('.plot .canvas')].at(-1).getAttribute('aria-label')"
    )
    assert browser.run(label).startswith("The value of a parameter over time, p1258[0]: ")


def test_what_was_not_accepted_does_not_set_the_scale(browser, write):
    def job(number, value, state="ok", error=None):
        parameter = Parameter(1120, 0, "value", 1, None, None, "Float32", 1, [value], error=error)
        return handmade.transaction(
            id=number, operation="change", state=state, start_ns=number * 10**9, parameters=[parameter]
        )  # fmt: skip

    refused = ParameterError(2, None)
    page = write(
        "scale",
        CaptureResult(
            "scale.pcapng",
            frames=9,
            transactions=[job(1, 1), job(2, 3), job(3, 3_500_000_000, "error", refused)],
        ),
    )
    browser.open(page)
    browser.plots()
    label = (
        "return [...document.querySelectorAll('.plot .canvas')].at(-1).getAttribute('aria-label')"
    )
    assert "1 not accepted; from 1 to 3. 1 of them are beyond the scale" in browser.run(label)
    values = [float(text) for text in browser.ticks(-1, up=True)]
    assert values[0] >= 0
    assert 2 < values[-1] < 4
    (beyond,) = (told for told in browser.told(-1) if "3500000000" in told)
    assert "Transaction\n#3\n" in beyond


def test_states_of_a_drive_stand_on_the_axis_of_its_transactions(browser, write, captures):
    result = analyze(captures / "cyclic-changed-after-off1.pcapng")
    browser.open(write("states", result))
    browser.plots()
    keys = ".plot .keys button"
    assert (
        browser.texts(keys).count("┃ state or command of a drive") == 3
    )  # all but the distribution
    changes = {
        f"{math.floor((each.time_ns - result.start_ns) / 1e6) / 1000:.3f} s"
        for timeline in result.timelines
        for each in timeline.events
        if each.name != "first"
    }
    for plot in (1, 2, 3):
        told = [text for text in browser.told(plot) if "drive\n" in text and "#" not in text]
        assert {text.splitlines()[1].split(" · ")[1] for text in told} == changes
    browser.click(f".plot {keys.split()[1]} button")
    assert browser.one(keys).get_attribute("aria-pressed") == "false"


@pytest.mark.parametrize("width", [390, 1280])
def test_keys_of_plots_are_whole_at_any_width(browser, write, captures, width):
    browser.look((width, 844), touch=width < 500)
    browser.open(write("keys", analyze(captures / "cyclic-changed-after-off1.pcapng")))
    browser.plots()
    cut = browser.run(
        "return [...document.querySelectorAll('.keys button')].filter((each) => {"
        " const own = each.getBoundingClientRect(), all = each.closest('.plot').getBoundingClientRect();"
        " return own.left < all.left || own.right > all.right || !own.height; }).map((each) => each.textContent)"
    )
    assert browser.all(".keys button")
    assert cut == []


def test_a_part_of_the_time_is_shown_in_all_plots_over_it_and_all_of_it_again(browser, tour):
    from selenium.webdriver import ActionChains

    browser.open(tour)
    browser.plots()
    before = [browser.ticks(plot) for plot in (0, 1, 2, 3)]
    picture = browser.one("[data-part=plots] .plot:nth-child(3) .canvas > svg")
    browser.run("arguments[0].scrollIntoView({block: 'center'})", picture)
    ActionChains(browser.driver).drag_and_drop_by_offset(picture, 90, 0).perform()
    after = [browser.ticks(plot) for plot in (0, 1, 2, 3)]
    assert after[0] == before[0], "not over time"
    for was, now in zip(before[1:], after[1:], strict=True):
        assert was[0] < now[0] < now[-1] < was[-1]
    again = browser.one("[data-part=plots] .plot:nth-child(3) .canvas > svg")
    ActionChains(browser.driver).double_click(again).perform()
    assert [browser.ticks(plot) for plot in (0, 1, 2, 3)] == before


def test_a_finger_reads_a_mark_before_it_opens_its_transaction(browser, tour):
    browser.open(tour)
    browser.plots()
    tap = (
        "const canvas = [...document.querySelectorAll('.plot .canvas')][1];"
        "const mark = canvas.querySelector('svg svg path');"
        "const [, x, y] = /M([\\d.]+) ([\\d.]+)/.exec(mark.getAttribute('d'));"
        "const at = new DOMPoint(Number(x), Number(y)).matrixTransform(mark.getScreenCTM());"
        "for (const name of ['pointerdown', 'pointerup']) canvas.firstElementChild.dispatchEvent("
        "  new PointerEvent(name, { clientX: at.x, clientY: at.y, pointerType: 'touch', pointerId: 1 }));"
        "return canvas.querySelector('.tip').innerText"
    )
    assert "#1" in browser.run(tap)
    assert not browser.all("tr.detail")
    browser.run(tap)
    browser.wait("return !!document.querySelector('#job-1-1 + tr.detail')")


def test_numbers_of_transactions_on_an_axis_are_whole(browser, tour):
    browser.open(tour)
    browser.plots()
    assert browser.ticks(2, up=True) == ["0", "1", "2"]
