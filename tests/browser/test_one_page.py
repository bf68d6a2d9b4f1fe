"""The analyzer as one page: in Chromium and Firefox, from a file and without network, it equals the command."""

import base64
import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from browser import until

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).resolve().parents[2]
SHOWN = "document.querySelector('#outcome').textContent || document.querySelector('#messages').textContent"
CLEAR = """(() => {
  document.querySelector('[data-lang=en]').click();
  for (let button; (button = document.querySelector('.held button'));) button.click();
  for (const each of document.querySelectorAll('select')) each.selectedIndex = 0;
  for (const each of document.querySelectorAll('input')) { each.value = ''; each.checked = false; }
  for (const each of document.querySelectorAll('#outcome, #messages, .answer')) each.textContent = '';
  return 1;
})()"""
READY = "/ready|failed/.test(document.querySelector('#state').className)"
MADE = """(() => {
  const found = {};
  for (const { name, data } of document.querySelector('#made').files || []) {
    const bytes = new Uint8Array(data.buffer || data);
    let text = '';
    for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
    found[name] = btoa(text);
  }
  return JSON.stringify(found);
})()"""


def _missing(what):
    if os.environ.get("DS47_CI") == "1":
        pytest.fail(f"{what} is missing, and DS47_CI=1 says that it must be there", pytrace=False)
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page, made of this checkout."""
    if shutil.which("npm") is None:
        _missing("npm")
    folder = tmp_path_factory.mktemp("page")
    command = [sys.executable, str(REPOSITORY / "tools" / "release" / "make_page.py"), str(folder)]
    subprocess.run(command, check=True)
    return folder / "ds47.html"


class Chromium:
    """The browser of the other tests, by the three words that these tests need."""

    def __init__(self, browser):
        self.browser = browser

    def open(self, page):
        self.browser.driver.get(page.as_uri())

    def run(self, script):
        return self.browser.run(f"return {script}")

    def wait(self, script):
        return self.browser.wait(f"return {script}")

    def inside(self, script):
        """What an expression gives in the report that the page shows."""
        self.browser.driver.switch_to.frame(self.browser.one("#page"))
        try:
            return self.run(script)
        finally:
            self.browser.driver.switch_to.default_content()

    def files(self, selector, *paths):
        self.browser.one(selector).send_keys("\n".join(str(path) for path in paths))


@pytest.fixture(scope="module", params=["chromium", "firefox"])
def open_page(request, page):
    """Each browser with the page open and the analyzer started, once."""
    if request.param == "chromium":
        browser = request.getfixturevalue("one_browser")
        browser.look()
        browser.problems()
        found = Chromium(browser)
        _begin(found, page)
        yield found
        assert browser.problems() == []
        return
    import firefox

    if find_spec("websocket") is None:
        _missing("websocket-client")
    if firefox.program() is None:
        _missing("firefox-esr")
    with firefox.Firefox() as found:
        _begin(found, page)
        yield found


@pytest.fixture
def desk(open_page):
    """The page as it is when it was just opened: English, no file, no outcome."""
    turn(open_page, "report")
    open_page.run(CLEAR)
    return open_page


def _begin(desk, page):
    desk.open(page)
    desk.wait(READY)
    assert desk.run("document.querySelector('#state').className") == "standing ready"


def turn(desk, section):
    desk.run(f"location.hash = '{section}'")
    desk.wait(f"document.querySelector('section.current').id === '{section}'")


def outcome(desk):
    """Exit status, messages, and what was made: name -> bytes."""
    desk.wait(SHOWN)
    told = desk.run("document.querySelector('#outcome').dataset.status")
    status = int(told) if told else None
    made = {name: base64.b64decode(text) for name, text in json.loads(desk.run(MADE)).items()}
    return status, desk.run("document.querySelector('#messages').textContent"), made


def again(desk):
    desk.run(
        "[...document.querySelectorAll('#outcome, #messages')].forEach(e => e.textContent = '') || 1"
    )


def command(*arguments, cwd, status=0):
    """What the command of this checkout writes to stdout."""
    environment = {**os.environ, "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "ds47", *arguments], cwd=cwd, capture_output=True, env=environment
    )  # fmt: skip
    assert done.returncode == status, done.stderr
    return done.stdout


def test_a_report_equals_that_of_the_command(desk, captures, tmp_path):
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    status, messages, made = outcome(desk)
    assert (status, messages, list(made)) == (0, "", ["tour-machine.html"])
    command(
        "report", "-f", "html", "-o", str(tmp_path / "page"), "tour-machine.pcapng", cwd=captures
    )
    assert made["tour-machine.html"] == (tmp_path / "page").read_bytes()
    for kind, ending in (("json", "json"), ("parameters", "csv"), ("text", "txt")):
        again(desk)
        desk.run(f"document.querySelector('#report select').value = '{kind}'")
        desk.run("document.querySelector('#report .go').click()")
        _, _, made = outcome(desk)
        said = command("report", "-f", kind, "tour-machine.pcapng", cwd=captures)
        assert made[f"tour-machine.{ending}"] == said


def test_a_capture_with_two_controllers_is_the_same_too(desk, captures):
    capture = captures / "real-stacks" / "o3_two_controllers.pcapng"
    desk.run("document.querySelector('#report select').value = 'json'")
    desk.files("#report input[name=files]", capture)
    _, _, made = outcome(desk)
    assert made["o3_two_controllers.json"] == command(
        "report", "-f", "json", capture.name, cwd=capture.parent
    )


def test_a_sample_and_the_fields_need_no_command_line(desk, captures, tmp_path):
    desk.run("document.querySelector('#report select').value = 'text'")
    desk.run("document.querySelector('#report [name=tz]').value = 'Asia/Shanghai'")
    desk.run("document.querySelector('#show-sample').click()")
    status, messages, made = outcome(desk)
    assert (status, messages) == (0, "")
    said = command(
        "report", "-f", "text", "--tz", "Asia/Shanghai", "tour-machine.pcapng", cwd=captures
    )
    assert made["tour-machine.txt"] == said
    assert b"+08:00" in said
    again(desk)
    desk.run("document.querySelector('#report [name=vendor]').value = 'sinamics'")
    desk.run("document.querySelector('#report .go').click()")
    assert outcome(desk)[0] == 0
    shown = desk.run("document.querySelector('#shown-command').textContent")
    assert "--tz Asia/Shanghai --vendor sinamics" in shown


def test_two_captures_are_compared(desk, captures, tmp_path):
    turn(desk, "compare")
    one, two = "change-float.pcapng", "tour-machine.pcapng"
    one = next(each.name for each in sorted(captures.glob("*change*.pcapng")))
    desk.files(".drop[data-kind=a] input", captures / one)
    desk.files(".drop[data-kind=b] input", captures / two)
    desk.run("document.querySelector('#compare .go').click()")
    status, _, made = outcome(desk)
    command("diff", "-f", "html", "-o", str(tmp_path / "page"), one, two, cwd=captures)
    assert status == 0
    assert list(made.values()) == [(tmp_path / "page").read_bytes()]


def test_frames_are_exported(desk, captures, tmp_path):
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    outcome(desk)
    turn(desk, "export")
    desk.run("document.querySelector('#export input[name=options]').value = '-t 4'")
    again(desk)
    desk.run("document.querySelector('#export .go').click()")
    status, _, made = outcome(desk)
    command(
        "export",
        "-t",
        "4",
        "-o",
        str(tmp_path / "four.pcapng"),
        "tour-machine.pcapng",
        cwd=captures,
    )
    assert status == 0
    assert made == {"tour-machine.ds47.pcapng": (tmp_path / "four.pcapng").read_bytes()}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("explain", "DE80B500"),
        ("decode", "01 02 01 01 10 00 07 6F 00 00"),
        ("encode", "read axis 2 p945[0..7]"),
    ],
)
def test_codes_and_bytes_are_explained(desk, name, text, tmp_path):
    turn(desk, "codes")
    desk.run(f"document.querySelector('#{name}-text').value = '{text}'")
    desk.run(f"document.querySelector('form[data-command={name}] button').click()")
    said = desk.wait(f"document.querySelector('form[data-command={name}] .answer').textContent")
    words = [text] if name == "encode" else text.split()
    assert said.startswith(command(name, *words, cwd=tmp_path).decode())


def test_a_list_of_parameters_names_them_in_the_next_report(desk, captures, tmp_path):
    known = tmp_path / "mine.csv"
    known.write_text("number,name,unit\n50304,Upper carriage,mm\n", "utf-8")
    turn(desk, "lists")
    desk.files("#lists input[name=files]", known)
    desk.run("document.querySelector('#lists .go').click()")
    desk.wait("document.querySelector('#lists .answer').textContent")
    turn(desk, "report")
    desk.run("document.querySelector('#report select').value = 'text'")
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    _, _, made = outcome(desk)
    assert b"Upper carriage" in made["tour-machine.txt"]
    turn(desk, "command")
    again(desk)
    desk.run("document.querySelector('#command input[name=line]').value = 'params remove mine'")
    desk.run("document.querySelector('#command form button').click()")
    assert outcome(desk)[:2] == (0, "")


def test_what_is_no_capture_is_said_as_the_command_says_it(desk, tmp_path):
    (tmp_path / "notes.pcap").write_text("no capture", "utf-8")
    desk.files("#report input[name=files]", tmp_path / "notes.pcap")
    status, messages, made = outcome(desk)
    words = [sys.executable, "-m", "ds47", "report", "-f", "html", "-o", "page.html", "notes.pcap"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (status, messages) == (done.returncode, done.stderr)
    assert done.returncode == 3
    assert list(made.values()) == [(tmp_path / "page.html").read_bytes()]


def test_the_page_asks_no_other_machine_for_anything(desk, captures):
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    outcome(desk)
    denied = "fetch('https://example.invalid/').then(() => 'asked', () => 'denied')"
    if isinstance(desk, Chromium):
        script = f"const done = arguments[arguments.length - 1]; {denied}.then(done)"
        assert desk.browser.driver.execute_async_script(script) == "denied"
        desk.browser.driver.get_log("browser")  # the refusal itself
        asked = [
            message["params"]["request"]["url"]
            for each in desk.browser.driver.get_log("performance")
            if (message := json.loads(each["message"])["message"])["method"]
            == "Network.requestWillBeSent"
        ]
        assert asked
        assert {url.split(":")[0] for url in asked} <= {"file", "blob", "data"}
    else:
        assert desk.run(denied) == "denied"
    policy = desk.run("document.querySelector('meta[http-equiv]').content")
    assert "connect-src 'none'" in policy
    assert "default-src 'none'" in policy


def test_a_report_works_in_the_page_and_reaches_nothing_of_it(desk, captures):
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    outcome(desk)
    until(
        lambda: desk.inside("document.querySelector('article[data-ready]') !== null"),
        "it is drawn",
        60,
    )
    jump = "(document.querySelector('a[href^=\"#\"]').click(), location.hash)"
    assert desk.inside(jump).startswith("#")
    attempt = "(() => { try { return parent.document.title } catch (e) { return e.name } })()"
    assert desk.inside(attempt) == "SecurityError"


def test_no_script_runs_but_ours(desk):
    added = "document.body.append(Object.assign(document.createElement('script'), {text: 'window.foreign = 1'}))"
    assert desk.run(f"{added} || 'foreign' in window") is False
    if isinstance(desk, Chromium):
        (refused,) = desk.browser.problems()
        assert "Executing inline script violates" in refused


def test_the_page_speaks_both_languages(desk, captures):
    desk.run("document.querySelector('[data-lang=zh]').click()")
    desk.run("document.querySelector('#report select').value = 'text'")
    desk.files("#report input[name=files]", captures / "tour-machine.pcapng")
    _, _, made = outcome(desk)
    said = command("report", "-f", "text", "--lang", "zh", "tour-machine.pcapng", cwd=captures)
    assert made["tour-machine.txt"] == said
    assert "报告" in desk.run("document.querySelector('nav').innerText")


def test_an_old_browser_is_told_so(browser, page):
    source = "delete window.DecompressionStream"
    added = browser.command("Page.addScriptToEvaluateOnNewDocument", source=source)
    try:
        browser.driver.get(page.as_uri())
        assert (
            browser.run("return document.querySelector('#missing').textContent")
            == "DecompressionStream"
        )
        assert browser.one(".too-old").is_displayed()
        assert not browser.one(".desk").is_displayed()
    finally:
        browser.command("Page.removeScriptToEvaluateOnNewDocument", **added)


def test_the_page_goes_by_mail(page):
    assert page.stat().st_size <= 15_000_000
