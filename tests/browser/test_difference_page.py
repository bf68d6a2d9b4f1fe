"""The page of `ds47 diff` in a real browser: both captures in one plot, both languages, nothing fetched."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ds47.cli import main

CAPTURE = Path(__file__).parents[2] / "captures" / "real-stacks" / "o1_profinetpy062_be.pcapng"
PLOTS = (
    "const plots = [...document.querySelectorAll('[data-difference] .canvas')];"
    "return plots.length === 3 && plots.every((each) => each.querySelector('svg'))"
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("difference")
    one, other = folder / "one.json", folder / "other.json"
    main(["report", "-f", "json", "-o", str(one), str(CAPTURE)])
    report = json.loads(one.read_text("utf-8"))
    for item in report["captures"][0]["transactions"]:
        for each in item["parameters"]:
            if (
                item["state"] == "ok"
                and item["operation"] == "read"
                and each["format"] == "Float32"
            ):
                each["values"] = [
                    value + 1 if isinstance(value, float) else value for value in each["values"]
                ]
    other.write_text(json.dumps(report), "utf-8")
    target = folder / "difference.html"
    main(["diff", "-f", "html", "-o", str(target), str(one), str(other)])
    return target


def opened(browser, page, size=(1280, 900), dark=False):
    browser.look(size, dark=dark, touch=size[0] < 500)
    browser.driver.get("about:blank")
    browser.driver.get(page.as_uri())
    browser.run("document.querySelector('[data-difference]').scrollIntoView()")
    browser.wait(PLOTS)


def test_it_asks_for_nothing_and_opens_with_what_is_otherwise(browser, page):
    browser.requested()
    opened(browser, page)
    assert browser.requested() == [page.as_uri()]
    assert "differ" in browser.one("h1.verdict").text
    first = browser.texts(".remarks li")[0]
    assert "other values read: p0025[0]" in first
    assert " -> " in first


def test_one_of_several_things_is_chosen_for_a_plot(browser, page):
    opened(browser, page)
    captions = browser.texts("[data-difference] figcaption")
    assert captions == [
        "How long transactions take, over time",
        "Share of transactions done within a time",
        "Values that differ, over time",
    ]
    about = "[data-difference] figure:nth-child(1) p"
    before = browser.texts(about)[0]
    browser.run(
        "const select = document.querySelector('[data-difference] select');"
        "select.value = '1'; select.dispatchEvent(new Event('change'))"
    )
    browser.wait(PLOTS)
    after = browser.texts(about)[0]
    assert before != after
    for text in (before, after):
        counts = text.removeprefix("A: ").removesuffix(" points.").split(" points, B: ")
        assert counts[0] == counts[1], "both sides have the same transactions"


def test_the_language_changes_everywhere(browser, page):
    opened(browser, page)
    browser.click("button[data-lang=zh]")
    browser.wait(PLOTS)
    assert "参数元素" in browser.one("h1.verdict").text
    assert browser.texts("[data-difference] figcaption")[0] == "任务耗时随时间变化"
    browser.click("button[data-lang=en]")


@pytest.mark.parametrize("dark", [False, True])
def test_a_phone_shows_it_without_scrolling_sideways(browser, page, dark):
    opened(browser, page, (390, 844), dark)
    assert browser.run("return document.documentElement.scrollWidth") <= 390
