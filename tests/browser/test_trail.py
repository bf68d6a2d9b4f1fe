"""The trail of a parameter in a browser: a click on a drive object, on a parameter, and a link from outside."""

from urllib.parse import quote

import pytest

from ds47.analysis import analyze

TRAIL = "[data-part=trail]"
DRIVE = "192.168.47.2"


@pytest.fixture(scope="module")
def page(write, captures):
    return write("trail", analyze(captures / "real-stacks/o3_two_controllers.pcapng"))


def column(browser, number):
    return browser.texts(f"{TRAIL} tr.row > td:nth-child({number})")


def test_a_click_on_a_drive_object_shows_who_wrote_to_it_and_when(browser, page):
    browser.open(page)
    link = f"a[href='#trail-1?device={DRIVE}&do=3']"
    assert browser.texts(link) == ["3"]
    browser.click(link)
    browser.wait(f"return document.querySelector('{TRAIL} .count')?.textContent.includes('of 103')")
    assert browser.texts(f"{TRAIL} .count") == ["1 to 50 of 103 (222 in all)"]
    assert column(browser, 1)[0] == "12:14:23.605 1.230 s"
    assert column(browser, 2)[0] == "215"
    assert set(column(browser, 4)) <= {"192.168.47.1", "192.168.47.3"}
    assert all(each.endswith("DO 3") for each in column(browser, 5))
    assert column(browser, 8)[:2] == ["? → 46463", "? → 5"]
    outcome = column(browser, 9)[0]
    assert outcome.startswith("negative response No operating priority")
    assert outcome.endswith("(0x0B)")
    assert browser.run(
        f"return document.querySelector('{TRAIL} select').selectedOptions[0].text"
    ).endswith("DO 3")


def test_a_click_on_the_changes_of_a_parameter_shows_its_trail(browser, page):
    browser.open(page)
    row = "[data-part=parameters] tr.row:has(a.trail)"
    name, link = browser.texts(f"{row} td:nth-child(2) > div")[0].split(" ", 1)
    number = int(link.removeprefix("writes: "))
    browser.click(f"{row} a.trail")
    browser.wait(f"return document.querySelectorAll('{TRAIL} tr.row').length === {number}")
    assert {each.split()[0] for each in column(browser, 7)} == {name}
    assert browser.run("return location.hash").startswith("#trail-1?place=")
    browser.click(f"{TRAIL} tr.row a[href^='#job-1-']")
    browser.wait("return !!document.querySelector('tr.detail')")


def test_a_link_from_outside_and_the_other_language(browser, page):
    browser.open(page, f"#trail-1?place={quote(DRIVE + '/DO 2')}&p=141")
    browser.wait(f"return document.querySelectorAll('{TRAIL} tr.row').length === 3")
    browser.click("button[data-lang=zh]")
    assert len(column(browser, 1)) == 3
    assert set(column(browser, 9)) <= {"已接受", "否定应答", "已发送，结果未知"}
    browser.open(page, "#trail-1?device=10.0.0.1&do=99")  # nobody is there: all of it
    browser.wait(
        f"return document.querySelector('{TRAIL} .count')?.textContent === '1 to 50 of 222'"
    )


def test_a_capture_without_changes_has_no_trail(browser, write, captures):
    browser.open(write("reads", analyze(captures / "conversation-error.pcapng")))
    assert not browser.all(TRAIL)
    assert not browser.all("a.trail")


def test_a_click_shows_which_parameter_is_refused_most(browser, page):
    browser.open(page)
    head = "[data-part=parameters] thead th:nth-child(6)"
    assert browser.texts(head) == ["Negative response"]
    browser.click(f"{head} button")
    first = "[data-part=parameters] tr.row:first-child > td"
    assert browser.texts(f"{first}:nth-child(6)") == ["4 read"]
    assert browser.one(head).get_attribute("aria-sort") == "descending"
    counts = [
        sum(map(int, text.split()[::2]))
        for text in browser.texts("[data-part=parameters] tr.row > td:nth-child(6)")
    ]
    assert counts == sorted(counts, reverse=True)
    browser.click(f"{head} button")
    assert browser.one(head).get_attribute("aria-sort") == "ascending"
    browser.click(f"{head} button")
    assert browser.one(head).get_attribute("aria-sort") is None
