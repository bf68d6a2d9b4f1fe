"""A browser for every test of this folder, started once; reports are written by the program itself."""

import io
import os
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))


def _missing(what):
    if os.environ.get("DS47_CI") == "1":
        pytest.fail(f"{what} is missing, and DS47_CI=1 says that it must be there", pytrace=False)
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="session")
def one_browser():
    from browser import Browser, programs

    if find_spec("selenium") is None:
        _missing("selenium")
    if programs() is None:
        _missing("chromium or chromedriver")
    with Browser() as browser:
        yield browser


@pytest.fixture
def browser(one_browser):
    """The browser, light and wide; a test that leaves a console error behind fails."""
    one_browser.look()
    one_browser.problems()
    yield one_browser
    assert one_browser.problems() == []


@pytest.fixture(scope="session")
def write(tmp_path_factory):
    """A function that writes a report over results and returns its path."""
    from ds47.model import Report
    from ds47.report import ReportOptions, html, write_all

    folder = tmp_path_factory.mktemp("pages")

    def write(name, *results, lang="en"):
        stream = io.StringIO()
        write_all(html.Writer(stream, ReportOptions(lang=lang)), Report(list(results)))
        path = folder / f"{name}.html"
        path.write_text(stream.getvalue(), "utf-8", errors="backslashreplace", newline="\n")
        return path

    return write


@pytest.fixture(scope="session")
def tour(write, captures):
    """The page of a short capture in which much goes wrong."""
    from ds47.analysis import analyze

    return write("tour", analyze(captures / "tour-machine.pcapng"))


@pytest.fixture(scope="session")
def stack(captures):
    """The result of a capture of a real stack with two controllers."""
    from ds47.analysis import analyze

    return analyze(captures / "real-stacks" / "o3_two_controllers.pcapng")


@pytest.fixture(scope="session")
def long(write, stack):
    """Its page."""
    return write("long", stack)
