"""The plots of the HTML report in a real browser: groups, percentiles, marks, the choice of a parameter, keys."""

from __future__ import annotations

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
    log = "return Bokeh.documents.flatMap((each) => each.roots()).some((each) => each.left[0].axis_label"
    assert browser.run(log + ".endsWith('response, ms') && each.y_scale.type === 'LogScale')")


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
    assert "1 not accepted; from 1 to 3. 1 of them lie beyond the scale" in browser.run(label)
    ranges = browser.run(
        "return Bokeh.documents.flatMap((each) => each.roots())"
        ".filter((each) => each.left[0].axis_label.startsWith('p1120')).map((each) => each.y_range.end)"
    )
    assert ranges
    assert 3 < ranges[0] < 4


def test_states_of_a_drive_stand_on_the_axis_of_its_transactions(browser, write, captures):
    result = analyze(captures / "cyclic-changed-after-off1.pcapng")
    browser.open(write("states", result))
    browser.plots()
    keys = ".plot .keys button"
    assert (
        browser.texts(keys).count("┃ state or command of a drive") == 3
    )  # all but the distribution
    found = browser.run(
        "return Bokeh.documents.flatMap((each) => each.roots()).map((each) => each.renderers"
        ".filter((one) => one.glyph.type === 'VSpan').map((one) => [...one.data_source.data.x])).flat()"
    )
    changes = {
        round((each.time_ns - result.start_ns) / 1e9, 3)
        for timeline in result.timelines
        for each in timeline.events
        if each.name != "first"
    }
    assert len(found) == 3
    assert all({round(x, 3) for x in xs} == changes for xs in found)
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
