"""The HTML report in a real browser: what a person does with it works, and nothing is asked of a network."""

from __future__ import annotations

import re
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

import handmade
import pytest

from browser import DESKTOP, PHONE
from ds47.analysis import analyze
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Device, Frames, Parameter, Transaction

JOBS = "[data-part=transactions]"
PARAMETERS = "[data-part=parameters]"
ROWS = f"{JOBS} tr.row"


def column(browser, place, number):
    return browser.texts(f"{place} tr.row > td:nth-child({number})")


def choose(browser, place, number, value):
    browser.run(
        "const select = document.querySelectorAll(arguments[0])[arguments[1]];"
        "select.value = arguments[2]; select.dispatchEvent(new Event('change'))",
        f"{place} .controls select", number, value,
    )  # fmt: skip


@pytest.mark.slow
def test_opening_a_page_asks_for_nothing_but_the_page(browser, tour):
    browser.requested()
    browser.open(tour)
    browser.plots()
    assert browser.requested() == [tour.as_uri()]


def test_the_first_screen_needs_no_script(browser, tour):
    browser.command("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.driver.get("about:blank")
        browser.driver.get(tour.as_uri())
        verdict, text = browser.one("h1").text, browser.one("main").text
    finally:
        browser.command("Emulation.setScriptExecutionDisabled", value=False)
    assert verdict.startswith(
        "NOT OK: 192.168.133.2 writes while its own request is open; 3 more causes"
    )
    assert "No change access while the controller is enabled" in text
    assert "Scripts are disabled here" in text


def test_a_click_on_a_head_sorts_up_and_down_and_back(browser, tour):
    browser.open(tour)
    head = f"{JOBS} thead th:nth-child(8)"  # how long it took
    before = column(browser, JOBS, 1)
    browser.click(f"{head} button")
    took = column(browser, JOBS, 8)
    known = [float(text.split()[0]) for text in took if text]
    assert known == sorted(known)
    assert len(known) == 6
    assert took[6:] == ["", ""]
    assert browser.one(head).get_attribute("aria-sort") == "ascending"
    browser.click(f"{head} button")
    assert column(browser, JOBS, 8)[0] == "27.0 ms"
    assert column(browser, JOBS, 8)[6:] == ["", ""]
    browser.click(f"{head} button")
    assert column(browser, JOBS, 1) == before
    assert browser.one(head).get_attribute("aria-sort") is None


def test_jobs_are_searched_and_filtered(browser, tour):
    browser.open(tour)
    search = browser.one(f"{JOBS} input[type=search]")
    search.send_keys("p50303 refused")
    browser.until(lambda: column(browser, JOBS, 1) == ["#5"], "the search")
    search.clear()
    search.send_keys("0x6b")
    browser.until(lambda: column(browser, JOBS, 1) == ["#6"], "the search")
    browser.click(f"{JOBS} .controls > button")
    assert len(browser.all(ROWS)) == 8
    choose(browser, JOBS, 0, "problems")
    assert column(browser, JOBS, 1) == ["#3", "#5", "#6", "#7", "#8"]
    choose(browser, JOBS, 0, "open")
    assert column(browser, JOBS, 1) == ["#8"]
    choose(browser, JOBS, 0, "bad")
    assert column(browser, JOBS, 1) == ["#5", "#6", "#7"]
    choose(browser, JOBS, 0, "problems")
    choose(browser, JOBS, 1, "read")
    assert column(browser, JOBS, 1) == ["#3", "#7"]
    assert browser.texts(f"{JOBS} .count") == ["1 to 2 of 2 (8 in all)"]


def test_a_job_opens_to_its_frames_with_bytes_beside_their_meaning(browser, tour):
    browser.open(tour)
    browser.click(f"{JOBS} tr.row:nth-child(6) .expander")
    assert browser.texts(f"{JOBS} .frame-card h4") == [
        "Write request frame 26", "Write response frame 27", "Read request frame 28", "Read response frame 29",
    ]  # fmt: skip
    rows = browser.texts(f"{JOBS} .frame-card:first-of-type .bytes tbody tr")
    assert rows[4:] == [
        "4 10 01 c3 9c 00 01 address: p50076[1], attribute value, 1 element",
        "10 08 01 format Float32, 1 value",
        "12 42 c8 00 00 p50076[1] = 100.0",
    ]
    answer = browser.texts(f"{JOBS} .frame-card:last-of-type .bytes tbody tr.wrong")
    assert "6 00 6b error 0x6B: No change access while the controller is enabled" in answer
    drawing = browser.one(f"{JOBS} svg.sequence")
    assert drawing.get_attribute("role") == "img"
    assert "Read response: error" in drawing.get_attribute("aria-label")
    assert len(browser.all(f"{JOBS} svg .arrow")) == 4
    browser.click(f"{JOBS} tr.row:nth-child(6) .expander")
    assert not browser.all(f"{JOBS} tr.detail")


@pytest.mark.slow
def test_the_bytes_shown_are_all_the_bytes_there_are(browser, long, stack):
    browser.open(long)
    browser.run(
        "const size = document.querySelector(arguments[0]);"
        "size.value = '500'; size.dispatchEvent(new Event('change'))",
        f"{JOBS} .pages select",
    )
    browser.run(
        "document.querySelectorAll(arguments[0]).forEach((each) => each.click())",
        f"{JOBS} .expander",
    )
    shown = browser.run(
        "return [...document.querySelectorAll(arguments[0])].map((each) => [...each.querySelectorAll('.bytes')]"
        ".map((table) => [...table.querySelectorAll('td.hex')].map((cell) => cell.textContent)"
        ".join('').replaceAll(' ', '')))",
        f"{JOBS} tr.detail",
    )
    expected = [
        [data.hex() for data in (item.request, item.response) if data is not None]
        for item in stack.transactions
    ]
    assert shown == expected
    rest = [text for text in browser.texts(f"{JOBS} .bytes tr") if "not decoded here" in text]
    assert len(rest) <= len(expected) // 20


def test_keys_alone_open_a_job(browser, tour):
    from selenium.webdriver.common.keys import Keys

    browser.open(tour)
    browser.one(f"{JOBS} tr.row:nth-child(2) .expander").send_keys(Keys.ENTER)
    assert len(browser.all(f"{JOBS} tr.detail")) == 1
    focused = browser.run("return document.activeElement.getAttribute('aria-label')")
    assert focused == "Details of transaction 2"
    assert browser.run("return document.activeElement.getAttribute('aria-expanded')") == "true"


def test_links_lead_from_a_finding_to_its_job_and_back(browser, tour):
    browser.open(tour)
    browser.click("#finding-1-DS410 tbody a")
    browser.wait("return !!document.querySelector('#job-1-6 + tr.detail')")
    browser.click("#job-1-6 td a")
    assert browser.run("return document.getElementById('finding-1-DS410').open")
    browser.open(tour, "#job-1-7")
    browser.wait("return !!document.querySelector('#job-1-7 + tr.detail')")


def test_every_frame_of_a_finding_leads_to_its_job(browser, tour):
    """DS705 of frame 22 is about frame 18 as well, DS417 of frame 17 about frame 6: list, problem, job."""
    browser.open(tour)

    def links(selector):
        return browser.run(
            f"return [...document.querySelectorAll('{selector}')].map((each) => each.textContent + each.hash)"
        )

    assert links("#finding-1-DS705 tbody td:first-child a") == ["18#job-1-4"]
    assert browser.texts(".problem-list .look")[0].startswith("Look at #5, frame 18 08:00:00.791")
    assert links(".problem-list .look a")[1].endswith("#job-1-4")
    browser.run("document.querySelector('#finding-1-DS417 tbody td:first-child a').click()")
    browser.wait("return !!document.querySelector('#job-1-2 + tr.detail')")
    browser.open(tour, "#job-1-3")
    browser.wait("return !!document.querySelector('#job-1-3 + tr.detail')")
    assert any("(frame 17, 6)" in text for text in browser.texts("tr.detail .found li"))


def test_one_parameter_is_one_row_and_no_two_drive_objects_look_alike(browser, long):
    """Of two controllers on three access points: index 47, 0xB02F, and 0xB02E of two submodules."""
    browser.open(long)
    rows = list(zip(column(browser, PARAMETERS, 1), column(browser, PARAMETERS, 2), strict=True))
    assert len(set(rows)) == len(rows) > 10
    for part in (PARAMETERS, JOBS):
        options = browser.run(
            f"return [...document.querySelectorAll('{part} select option')].map((each) => each.text)"
        )
        named = [text for text in options if text.startswith("rt-labs-dev")]
        assert len(set(named)) == len(named)
        assert {"rt-labs-dev DO 2", "rt-labs-dev DO 3"} <= set(named)
        assert not any(text.endswith("DO 0") for text in named)


@pytest.mark.slow
def test_the_language_changes_everywhere_and_keeps_the_place(browser, tour):
    browser.open(tour)
    browser.plots()
    choose(browser, JOBS, 0, "problems")
    browser.click("button[data-lang=zh]")
    assert browser.run("return document.documentElement.lang") == "zh"
    assert browser.one("h1").text.startswith(
        "不正常：192.168.133.2 在自己的请求尚未完成时又写入请求"
    )
    assert browser.texts(f"{JOBS} thead th")[6] == "结果"
    assert column(browser, JOBS, 7) == ["正常", "被拒绝", "错误", "部分失败", "无应答"]
    assert "控制器使能时无修改权限" in browser.one(JOBS).text
    assert browser.texts(".plot figcaption")[0] == "任务耗时分布"
    assert browser.one("button[data-lang=zh]").get_attribute("aria-pressed") == "true"
    assert "What to do" not in browser.one("main").text
    browser.click("button[data-lang=en]")
    assert browser.one("h1").text.startswith("NOT OK")
    browser.wait("return document.querySelectorAll('.plot').length === 4")


def test_a_page_made_in_chinese_starts_in_chinese(browser, write, captures):
    from ds47.analysis import analyze

    result = analyze(captures / "tour-machine.pcapng")
    browser.open(write("zh", result, lang="zh"))
    assert browser.one("h1").text.startswith("不正常")
    browser.click("button[data-lang=en]")
    assert (
        "Write refused with status DF80B500: write: access: state conflict"
        in browser.one("main").text
    )


def test_light_and_dark(browser, tour):
    background = "return getComputedStyle(document.body).backgroundColor"
    browser.look(dark=True)
    browser.open(tour)
    dark = browser.run(background)
    browser.click("[data-theme-button]")
    light = browser.run(background)
    assert browser.one("[data-theme-button]").get_attribute("aria-label") == "Theme: light"
    browser.click("[data-theme-button]")
    assert browser.run(background) == dark != light


CONTRAST = r"""
const numbers = (text) => text.match(/[\d.]+/g).map(Number);
const over = (front, back) => back.map((each, n) => front[n] * (front[3] ?? 1) + each * (1 - (front[3] ?? 1)));
const light = (color) => color.map((each) => each / 255)
  .map((each) => (each <= 0.03928 ? each / 12.92 : ((each + 0.055) / 1.055) ** 2.4))
  .reduce((sum, each, n) => sum + each * [0.2126, 0.7152, 0.0722][n], 0);
const behind = (element) => element
  ? over(numbers(getComputedStyle(element).backgroundColor), behind(element.parentElement))
  : [255, 255, 255];
return [...document.querySelectorAll("body *:not(svg *, script, style)")]
  .filter((each) => each.offsetWidth)
  .filter((each) => [...each.childNodes].some((node) => node.nodeType === 3 && node.data.trim()))
  .map((each) => {
    const back = behind(each);
    const front = over(numbers(getComputedStyle(each).color), back);
    const [less, more] = [back, front].map(light).sort((a, b) => a - b);
    return [(more + 0.05) / (less + 0.05), each.matches(".sign") ? 3 : 4.5, each.outerHTML.slice(0, 80)];
  }).filter(([contrast, least]) => contrast < least);
"""


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_every_text_stands_out_from_what_is_behind_it(browser, tour, size, dark):
    browser.look(size, dark=dark, touch=size == PHONE)
    browser.open(tour)
    browser.run("window.scrollTo(0, document.body.scrollHeight)")
    browser.wait("return !!document.querySelector('.sign')")
    assert browser.run(CONTRAST) == []


def test_a_filter_is_copied(browser, tour):
    browser.open(tour)
    browser.run(
        "navigator.clipboard.writeText = (text) => { window.copied = text; return Promise.resolve(); }"
    )
    browser.click("#finding-1-DS410 [data-copy]")
    browser.until(lambda: browser.one("#finding-1-DS410 [data-copy]").text == "Copied", "the word")
    assert browser.run("return window.copied") == "frame.number == 29 or frame.number == 33"
    browser.until(
        lambda: browser.one("#finding-1-DS410 [data-copy]").text == "Copy", "the word before"
    )


def test_a_corrected_request_is_copied_in_every_form(browser, write, captures):
    browser.open(write("corrected", analyze(captures / "diagnosis-index-and-count.pcapng")))
    browser.run(
        "navigator.clipboard.writeText = (text) => { window.copied = text; return Promise.resolve(); }"
    )
    assert not browser.one(".problem-list .corrected dl").is_displayed()
    browser.click(".problem-list .corrected summary")
    copied = []
    for number in range(len(browser.all(".corrected [data-copy]"))):
        browser.run(
            "document.querySelectorAll('.corrected [data-copy]')[arguments[0]].click()", number
        )
        copied.append(browser.run("return window.copied"))
    assert copied[0] == "0101010110010b540000"
    assert copied[1] == "16#0101 16#0101 16#1001 16#0B54 16#0000"
    assert copied[2].splitlines()[-1] == "#length := 10;"
    assert copied[3] == "ds47 encode 'read ref 1 axis 1 p2900[0]'"
    browser.click(".problem-list .look a")
    browser.wait("return !!document.querySelector('#job-1-1 + tr.detail')")


def test_an_opened_job_tells_what_the_plc_saw(browser, tour):
    browser.open(tour, "#job-1-6")
    browser.wait("return !!document.querySelector('tr.detail')")
    expected = (
        "PLC: WRREC DONE, STATUS 00000000; RDREC VALID, STATUS 00000000, LEN 10"
        " - byte 1 is 16#82: negative response"
    )
    assert browser.texts("tr.detail .plc") == [expected]
    assert browser.texts("tr.detail .facts .copyable") == ["frame.number in {26..29}"]
    browser.click("button[data-lang=zh]")
    assert browser.one("tr.detail .plc").text.startswith("PLC：WRREC DONE")


def test_a_parameter_that_the_drive_described(browser, write, captures):
    browser.open(write("described", analyze(captures / "format-described.pcapng")), "#job-1-3")
    browser.wait("return !!document.querySelector('tr.detail')")
    facts = browser.one("tr.detail .facts").text
    assert "described by the drive in\np1120[0]: frame 8" in facts
    assert '= 1000 (10.0) s "Ramp-up time"' in browser.one("tr#job-1-3").text.replace("\n", " ")
    browser.click("button[data-lang=zh]")
    assert "第 8 帧" in browser.one("tr.detail .facts").text
    rows = browser.texts(f"{PARAMETERS} tr.row")
    assert any("1500 (15.0) s #7" in row for row in rows)
    # what was read before its description has no unit, and one axis has one
    browser.click("button[data-lang=en]")
    assert browser.plots() == 4
    browser.run(
        "const select = document.querySelector('[data-picker]');"
        "select.value = [...select.options].find((each) => each.text.includes('p1120[0] \"Ramp')).value;"
        "select.dispatchEvent(new Event('change'))"
    )
    label = browser.run(
        "return [...document.querySelectorAll('.plot .canvas')].at(-1).getAttribute('aria-label')"
    )
    assert "p1120[0]: 2 points: 2 read" in label
    assert label.endswith("0 not accepted; value 1000.")


def test_parameters_with_their_last_value(browser, tour):
    browser.open(tour)
    rows = browser.texts(f"{PARAMETERS} tr.row")
    assert any("p50303[0]" in row and "10.0 s #7" in row and "DF80B500" in row for row in rows)
    (failed,) = [row for row in rows if "p50076[1]" in row]
    assert "1 change" in failed
    browser.one(f"{PARAMETERS} input[type=search]").send_keys("fault")
    browser.until(lambda: len(browser.all(f"{PARAMETERS} tr.row")) == 4, "the search")


def test_plots_are_drawn_and_another_parameter_can_be_picked(browser, tour):
    browser.open(tour)
    assert browser.plots() == 4
    labels = browser.run(
        "return [...document.querySelectorAll('.plot .canvas')].map((each) => each.getAttribute('aria-label'))"
    )
    assert "half within 3.0 ms" in labels[0]
    assert "8 transactions in" in labels[2]
    assert "s: 4 ok, 1 partial, 1 error, 1 refused, 1 unanswered." in labels[2]
    assert (
        "p50303[0]: 4 points: 2 read, 0 written and accepted, 1 written with unknown outcome, 1 not accepted"
        in labels[3]
    )
    browser.run(
        "const select = document.querySelector('[data-picker]');"
        "select.value = [...select.options].find((each) => each.text.includes('p50304[0]')).value;"
        "select.dispatchEvent(new Event('change'))"
    )
    label = browser.run(
        "return [...document.querySelectorAll('.plot .canvas')].at(-1).getAttribute('aria-label')"
    )
    assert "p50304[0]: 2 points: 1 read, 1 written and accepted, 0 written with" in label
    assert label.endswith("0 not accepted; from 60 s to 100 s.")


@pytest.mark.parametrize("name", ["lossy-stacks/l3_once", "tour-machine"])
def test_the_summary_is_one_sheet_with_a_place_to_sign(browser, captures, tmp_path, name):
    page = tmp_path / "sheet.html"
    capture = str(captures / f"{name}.pcapng")
    heading = (
        "--title",
        "What was found at press 1",
        "--customer",
        "A customer",
        "--order",
        "4711",
    )
    assert main(["report", "-f", "html", "--summary", *heading, "-o", str(page), capture]) == 0
    browser.open(page)
    assert not browser.one(".sign").is_displayed()
    assert len(re.findall(rb"/Type /Page\b", browser.pdf())) == 1
    browser.command("Emulation.setEmulatedMedia", media="print")
    try:
        assert browser.one(".sign").text.split() == ["Name", "Date", "Signature"]
    finally:
        browser.command("Emulation.setEmulatedMedia", media="")


def test_paper_holds_the_findings_unfolded(browser, tour):
    browser.open(tour)
    browser.plots()
    folded = "return document.querySelectorAll('details.finding:not([open])').length"
    before = browser.run(folded)
    assert before > 1
    browser.run(
        "addEventListener('beforeprint', () => {"
        " window.onPaper = document.querySelectorAll('details.finding[open]').length; })"
    )
    pdf = browser.pdf()
    assert pdf.startswith(b"%PDF")
    assert 2 <= pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page ") <= 8
    assert browser.run("return window.onPaper") == len(browser.all("details.finding"))
    assert browser.run(folded) == before


def test_a_long_capture_takes_a_dozen_pages_and_its_bytes_stand_in_an_annex(browser, long):
    browser.open(long)
    browser.plots()
    pages = len(re.findall(rb"/Type /Page\b", browser.pdf()))
    assert 5 <= pages <= 12
    browser.command("Emulation.setEmulatedMedia", media="print")
    try:
        browser.run("window.dispatchEvent(new Event('beforeprint'))")
        annex = browser.texts(".annex .card")
        assert annex
        assert len(browser.texts(".problem-list .onlyprint")) == len(annex)
        assert browser.run("return document.querySelectorAll('.problem-list pre').length") == len(
            annex
        )
        shown = "return [...document.querySelectorAll('.problem-list pre')].some((each) => each.offsetHeight)"
        assert not browser.run(shown)
        assert len(browser.all(ROWS)) == 120
    finally:
        browser.run("window.dispatchEvent(new Event('afterprint'))")
        browser.command("Emulation.setEmulatedMedia", media="")


WAITING = "return document.querySelectorAll('.waiting').length"


@pytest.mark.slow
@pytest.mark.parametrize("key", [False, True])
def test_the_button_and_its_key_print_when_everything_is_there(browser, write, captures, key):
    from selenium.webdriver import ActionChains, Keys

    names = ("record-polls.pcapng", "tour-machine.pcapng")
    browser.open(write("printed", *(analyze(captures / name) for name in names)))
    browser.run(
        "window.print = () => { window.printed = document.querySelectorAll('.canvas').length }"
    )
    assert browser.run(WAITING) == 7  # tables and plots of two captures, the changes of one
    if key:
        ActionChains(browser.driver).key_down(Keys.CONTROL).send_keys("p").perform()
        ActionChains(browser.driver).key_up(Keys.CONTROL).perform()
    else:
        browser.click("[data-print]")
    assert browser.wait("return window.printed") == 8
    assert browser.run(WAITING) == 0
    assert browser.run(
        "return [...document.querySelectorAll('.canvas')].every((each) => each.querySelector('svg'))"
    )


def test_paper_holds_every_capture_and_says_which_plots_it_lacks(browser, write, captures):
    names = ("record-polls.pcapng", "tour-machine.pcapng")
    page = write("paper", *(analyze(captures / name) for name in names))
    browser.driver.get("about:blank")
    browser.driver.get(page.as_uri())
    browser.run("""addEventListener("beforeprint", () => {
        const plots = document.querySelector("#plots-2").textContent;
        Promise.resolve().then(() => setTimeout(() => {
          window.onPaper = [document.querySelectorAll("details.capture-fold[open]").length,
            document.querySelectorAll("[data-part=transactions] tr.row").length, plots];
        }));
      });
      window.dispatchEvent(new Event("beforeprint"))""")
    folds, jobs, plots = browser.wait("return window.onPaper")
    assert (folds, jobs) == (2, 9)
    assert "not drawn yet when this was printed" in plots
    browser.wait("return document.querySelectorAll('.canvas').length === 8")
    browser.run("window.dispatchEvent(new Event('afterprint'))")
    assert not browser.all("details.capture-fold[open]")


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_a_phone_shows_it_without_scrolling_sideways(browser, tour, dark):
    browser.look((390, 844), dark=dark, touch=True)
    browser.open(tour, "#job-1-6")
    browser.wait("return !!document.querySelector('tr.detail')")
    browser.plots()
    assert browser.run("return document.documentElement.scrollWidth") <= 390
    wide = browser.run(
        "return [...document.querySelectorAll('main *')].filter((each) =>"
        " !each.closest('.wide, svg') && each.getBoundingClientRect().right > 391)"
        ".map((each) => each.outerHTML.slice(0, 80))"
    )
    assert wide == []
    figures = "const each = document.querySelector('.figures'); "
    assert browser.run(figures + "return each.scrollWidth <= each.parentElement.clientWidth")
    apart = (
        "const [one, two] = [...document.querySelectorAll('#job-1-5 a[href*=finding]')].map((each) =>"
        " each.getBoundingClientRect()); return two.left - one.right"
    )
    assert 0 < browser.run(apart) < 20


def test_the_parts_are_a_menu_on_a_phone_and_stand_side_by_side_where_there_is_room(browser, tour):
    browser.look((420, 844), touch=True)
    browser.open(tour)
    links = "return [...document.querySelectorAll('.parts a')].filter((each) => each.checkVisibility()).length"
    assert browser.run(links) == 0
    first = "return document.querySelector('.problem-list li').getBoundingClientRect().top"
    assert browser.run(first) < 844 * 0.65, "the first problem is seen without scrolling"
    browser.click(".parts summary")
    assert browser.run(links) == 5
    outside = (
        "return [...document.querySelectorAll('.parts a')]"
        ".filter((each) => each.getBoundingClientRect().right > 420).length"
    )
    assert browser.run(outside) == 0
    browser.click(".parts a[href='#transactions-1']")
    assert browser.run(links) == 0, "the menu closes behind who chose"
    top = "return document.querySelector('#transactions-1').getBoundingClientRect().top"
    assert 40 < browser.run(top) < 80, "below the menu"
    browser.look()
    assert browser.wait(links) == 5


def test_what_is_short_in_a_table_stands_in_one_line(browser, tour):
    browser.look((1400, 900))
    browser.open(tour)
    heights = (
        "return [...document.querySelectorAll('[data-part=trail] tr.row td:nth-child(5)')].map((each) => {"
        " const range = document.createRange(); range.selectNodeContents(each);"
        " return range.getClientRects().length; })"
    )
    assert browser.run(heights) == [1, 1, 1, 1]
    wider = (
        "return [...document.querySelectorAll('.wide')]"
        ".filter((each) => each.scrollWidth > each.clientWidth).length"
    )
    assert browser.run(wider) == 0


def test_a_sentence_about_a_state_breaks(browser, write, captures):
    browser.look((420, 844), touch=True)
    browser.open(write("state", analyze(captures / "cyclic-changed-after-off1.pcapng")))
    assert browser.all(".problem-list .state")
    assert browser.run("return document.documentElement.scrollWidth") <= 420


def test_a_difference_on_a_phone_breaks_no_number(browser, captures, tmp_path):
    page = tmp_path / "difference.html"
    folder = captures / "real-stacks"
    names = ("o1_profinetpy062_be.pcapng", "o3_two_controllers.pcapng")
    with page.open("w", encoding="utf-8") as stream, redirect_stdout(stream):
        main(["diff", "-f", "html", "--all", *(str(folder / name) for name in names)])
    browser.look((400, 844), touch=True)
    browser.driver.get(page.as_uri())
    numbers, broken = browser.run("""
      const found = [], broken = [];
      const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
      while (texts.nextNode()) {
        const text = texts.currentNode;
        if (!text.parentElement.closest("td")) continue;
        for (const match of text.data.matchAll(/\\d[\\d.]*/g)) {
          const range = document.createRange();
          range.setStart(text, match.index);
          range.setEnd(text, match.index + match[0].length);
          found.push(match[0]);
          if (range.getClientRects().length > 1) broken.push(match[0]);
        }
      }
      return [found.length, broken]""")
    assert numbers > 50
    assert broken == []
    assert browser.run("return document.documentElement.scrollWidth") <= 400


def test_everything_that_can_be_used_has_a_name(browser, tour):
    browser.open(tour, "#job-1-6")
    browser.wait("return !!document.querySelector('tr.detail')")
    nameless = browser.run(
        "return [...document.querySelectorAll('button, input, select, [role=img], nav, svg')].filter((each) =>"
        " !(each.getAttribute('aria-label') || each.textContent.trim() || each.closest('label')))"
        ".map((each) => each.outerHTML)"
    )
    assert nameless == []
    assert browser.run("return document.querySelectorAll('h1').length") == 1
    double = browser.run(
        "const ids = [...document.querySelectorAll('[id]')].map((each) => each.id);"
        "return ids.filter((each, number) => ids.indexOf(each) !== number)"
    )
    assert double == []


def make(number, **changes):
    item = Transaction(
        operation="read",
        state="ok",
        controller="10.0.0.1",
        device="10.0.0.2",
        ar=None,
        api=0,
        slot=1,
        subslot=1,
        index=47,
        request_reference=1,
        axis=1,
        frames=Frames(1, 2, 3, 4),
        start_ns=number * 10**6,
        duration_ns=10**6,
        request=bytes.fromhex("01010101100100150000"),
        response=bytes.fromhex("01010101080144bb8000"),
        write_status=0,
        read_status=0,
        parameters=[Parameter(21, 0, "value", 1, None, None, "Float32", 1, [1500.0])],
        id=number,
    )
    return replace(item, **changes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("p0945", ["#1"]), ("r0945", ["#1"]), ("R945", ["#1"]), ("p945[2]", ["#1"]), ("r0945[02]", ["#1"]),
        ("p945[4]", []), ("p0010", ["#2"]), ("p10[0]", ["#2"]), ("p010[", ["#2"]), ("r2d2", ["#3"]),
        ("0945", ["#1"]),
    ],
)  # fmt: skip
def test_a_parameter_is_found_as_siemens_writes_it(browser, write, query, found):
    values = [Parameter(945, 0, "value", 4, None, None, "Unsigned16", 4, [1, 2, 3, 4])]
    jobs = [
        make(1, parameters=values),
        make(2, parameters=[Parameter(10, 0, "value", 1, None, None, "Integer16", 1, [7])]),
        make(3, device="10.0.0.3"),
    ]
    devices = [Device("10.0.0.3", station="r2d2")]
    browser.open(
        write("siemens", CaptureResult("x", frames=12, transactions=jobs, devices=devices))
    )
    browser.one(f"{JOBS} input[type=search]").send_keys(query)
    number = len(found)
    browser.until(
        lambda: browser.texts(f"{JOBS} .count")[0].endswith(f" of {number} (3 in all)"),
        "the search",
    )
    assert [each for each in column(browser, JOBS, 1) if each.startswith("#")] == found


@pytest.mark.slow
def test_hostile_text_stays_text(browser, write):
    evil = "<img src=x onerror=alert(1)><script>alert(1)</script>\"'><b>"
    parameter = Parameter(1, 0, "value", 1, None, evil, "VisibleString", 1, [evil])
    result = CaptureResult(
        path=evil, frames=4, problem=evil, devices=[Device("10.0.0.2", evil, evil, 1, 1)],
        transactions=[make(1, parameters=[parameter], operation="change", controller=evil)],
        findings=[handmade.finding("DS410", "error", evil, 1, 1), handmade.finding("DS315", "error", evil, 1)],
    )  # fmt: skip
    browser.open(write("evil", result, result))
    browser.run("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    browser.wait("return !document.querySelector('article:not([data-ready])')")
    browser.click(f"{JOBS} .expander")
    browser.plots()
    browser.click("button[data-lang=zh]")
    assert not browser.all("main img, main b")
    assert evil in browser.one(f"{JOBS} tr.row").text
    name = evil.rpartition("/")[
        2
    ]  # what stands before a slash is a folder, which a page does not name
    assert name in browser.one("h2.verdict + p").text


def test_an_error_number_of_two_bytes_has_four_digits(browser, write, tmp_path):
    stage = Stage()
    answer = bytes.fromhex("01810101 4401 0811")
    Client(stage).exchange(message.read(1, 1, message.address(4711)), answer)
    path = tmp_path / "wide.pcapng"
    with PcapngWriter(path) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data)
    browser.open(write("wide", analyze(path)))
    browser.click(f"{JOBS} .expander")
    rows = browser.texts(f"{JOBS} .frame-card:last-of-type .bytes tbody tr.wrong")
    assert "6 08 11 error 0x0811: Manufacturer-specific error 0x0811" in rows
    text = browser.one("main").text
    assert "0x811" not in text


def test_several_captures_stand_behind_an_overview(browser, write, captures):
    results = [analyze(captures / name) for name in ("record-polls.pcapng", "tour-machine.pcapng")]
    browser.open(write("two", *results))
    assert browser.one("h1").text.startswith(
        "NOT OK: 192.168.133.2 writes while its own request is open"
    )
    assert not browser.one("#capture-2 article").is_displayed()
    browser.click("a[href='#capture-2']")
    browser.wait("return !!document.querySelector('#capture-2 tr.row')")
    assert len(browser.all(f"#capture-2 {ROWS}")) == 8


def test_the_overview_has_the_worst_first_and_sorts(browser, write, captures):
    names = ("record-polls.pcapng", "tour-machine.pcapng", "conversation-error.pcapng")
    browser.open(write("three", *(analyze(captures / name) for name in names)))
    shown = "table.overview tbody th"
    worst = browser.texts(shown)
    assert [Path(each).name for each in worst] == [names[1], names[2], names[0]]
    assert browser.texts(".problem-list li")[0].startswith("DS705 error two-users: 1 time in 1 cap")
    begun = [" ".join(each.split()) for each in browser.texts("table.overview td.time")]
    assert begun == ["2026-01-01 08:00:00"] * 3
    lengths = browser.texts("table.overview td.time + td")
    assert lengths[0] == "13.5 s"
    head = "table.overview thead th:nth-child(5)"  # jobs
    browser.click(f"{head} button")
    assert browser.texts(shown) == [worst[1], worst[2], worst[0]]
    assert browser.one(head).get_attribute("aria-sort") == "ascending"
    browser.click(f"{head} button")
    assert browser.texts(shown)[0] == worst[0]
    browser.click(f"{head} button")
    assert browser.texts(shown) == worst
    browser.click("button[data-lang=zh]")
    assert browser.texts(f"{head} button") == ["任务"]


@pytest.mark.slow
def test_a_hundred_thousand_jobs_open_quickly(browser, write):
    jobs = [
        make(
            n,
            state="ok" if n % 50 else "refused",
            duration_ns=(n % 97 + 1) * 10**5,
            frames=Frames(4 * n, 4 * n + 1, 4 * n + 2, 4 * n + 3),
        )
        for n in range(1, 100_001)
    ]
    page = write("many", CaptureResult(path="many", frames=400_004, transactions=jobs))
    assert page.stat().st_size < 12_000_000
    browser.open(page)
    assert browser.busy() < 4  # of the processor, whatever else the machine does
    assert browser.run("return document.querySelectorAll('*').length") < 5000
    assert browser.texts(f"{JOBS} .count") == ["1 to 50 of 100,000"]
    browser.click(f"{JOBS} .pages button:last-child")
    assert column(browser, JOBS, 1)[-1] == "#100000"
    browser.one(f"{JOBS} input[type=search]").send_keys("#777 ")
    browser.until(lambda: "#777" in column(browser, JOBS, 1)[:1], "the search")
    assert browser.plots() == 4
    assert "points are drawn" in browser.one("[data-part=plots]").text
