"""Takes the pictures of the HTML report, on paper too, the page and the site in docs/images, with Chromium.

Usage: html_screenshots.py [FOLDER]. Needs Chromium with its driver, selenium, pngquant, pdftoppm and a font
with Chinese (Debian: chromium, chromium-driver, pngquant, poppler-utils, fonts-noto-cjk); for the pictures of page
and site dist/ds47.html (`make page`) and build/site/html (`make site`).
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "browser"))

from browser import DESKTOP, PHONE, Browser, programs  # noqa: E402
from ds47.cli import main as ds47  # noqa: E402

TOUR = "captures/tour-machine.pcapng"
DRIVE = "captures/cyclic-changed-after-off1.pcapng"
BUS = "captures/profibus-ppo3-and-records.pcapng"
STACK = "captures/real-stacks/o1_profinetpy062_be.pcapng"
LONG = "captures/real-stacks/o3_two_controllers.pcapng"
TITLE = (
    "--title",
    "Press 1",
    "--order",
    "4711",
    "--customer",
    "Example Press Works",
    "--author",
    "A. Engineer",
)
PAGE = ROOT / "dist" / "ds47.html"
SITE = ROOT / "build" / "site" / "html"
PROGRAMS = {"pngquant": "pngquant", "pdftoppm": "poppler-utils", "fc-list": "fontconfig"}
"""What is needed besides the browser, with Debian's packages."""


def report(target: Path, *arguments: str) -> Path:
    """Writes a report."""
    try:
        ds47(["report", "-f", "html", "-o", str(target), *arguments])
    except SystemExit as end:
        if end.code:
            raise
    return target


def pictures(browser: Browser, pages: dict[str, Path]) -> dict[str, bytes]:
    """Every picture by its name."""
    made: dict[str, bytes] = {}
    browser.look((DESKTOP[0], 700))
    browser.open(pages["tour"])
    made["report"] = browser.picture()
    browser.look()
    browser.open(pages["tour"], "#job-1-6")
    browser.wait("return !!document.querySelector('tr.detail svg')")
    made["report-job"] = browser.picture()
    browser.look((DESKTOP[0], 1000), dark=True)
    browser.open(pages["long"])
    browser.plots()
    browser.run("document.querySelector('#plots-1').scrollIntoView()")
    made["report-plots-dark"] = browser.picture()
    browser.look(PHONE, touch=True)
    browser.open(pages["tour"])
    made["report-phone"] = browser.picture()
    browser.look((DESKTOP[0], 620))
    browser.open(pages["drive"])
    browser.run("document.querySelector('[data-timeline]').scrollIntoView()")
    made["drive"] = browser.picture()
    browser.look((DESKTOP[0], 860))
    browser.open(pages["bus"])
    browser.run("document.querySelector('#bus-1').scrollIntoView()")
    made["profibus"] = browser.picture()
    browser.look((DESKTOP[0], 700))
    browser.open(pages["zh"])
    made["report-zh"] = browser.picture()
    return made


def on_paper(browser: Browser, page: Path) -> bytes:
    """The first page of a report as it is printed, A4."""
    browser.look()
    browser.open(page)
    browser.plots()
    return subprocess.run(
        ["pdftoppm", "-r", "90", "-png", "-f", "1", "-l", "1", "-"],
        input=browser.pdf(), capture_output=True, check=True,
    ).stdout  # fmt: skip


def of_the_page(browser: Browser) -> dict[str, bytes]:
    """The analyzer as a page, with a capture dropped on it, in both languages."""
    made: dict[str, bytes] = {}
    browser.look((DESKTOP[0], 820))
    for lang, name in (("en", "page"), ("zh", "page-zh")):
        browser.driver.get(PAGE.as_uri())
        browser.wait("return /ready/.test(document.querySelector('#state').className)")
        browser.run(f"document.querySelector('[data-lang={lang}]').click()")
        browser.one("#report input[name=files]").send_keys(str(ROOT / TOUR))
        browser.wait("return !!document.querySelector('#outcome').textContent")
        browser.wait("return document.querySelector('#page').offsetHeight > 0")
        time.sleep(3)  # the report draws itself in a frame of its own, into which nobody sees
        made[name] = browser.picture()
    return made


def of_the_site(browser: Browser) -> dict[str, bytes]:
    """Its front page in both languages."""
    made: dict[str, bytes] = {}
    browser.look((DESKTOP[0], 820))
    for place, name in (("index.html", "site"), ("zh/index.html", "site-zh")):
        browser.driver.get((SITE / place).as_uri())
        made[name] = browser.picture()
    return made


def small(picture: bytes) -> bytes:
    """The same with at most 256 colours, a third of its size."""
    command = ["pngquant", "--speed", "1", "--strip", "-"]
    return subprocess.run(command, input=picture, capture_output=True, check=True).stdout


def missing() -> list[str]:
    """Debian's packages that are missing."""
    wanted = [package for program, package in PROGRAMS.items() if shutil.which(program) is None]
    if programs() is None:
        wanted += ["chromium", "chromium-driver"]
    if not wanted and not subprocess.check_output(["fc-list", ":lang=zh"]).strip():
        wanted.append("fonts-noto-cjk")
    return wanted


def main() -> int:
    """Write the pictures; returns the exit status."""
    if packages := missing():
        sys.stderr.write(f"missing (Debian): {' '.join(packages)}\n")
        return 1
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images"
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(ROOT)  # the page shows the path as it was given
    with tempfile.TemporaryDirectory() as work, Browser() as browser:
        pages = {
            "tour": report(Path(work, "tour.html"), TOUR),
            "long": report(Path(work, "long.html"), LONG),
            "drive": report(Path(work, "drive.html"), DRIVE),
            "bus": report(Path(work, "bus.html"), BUS),
            "stack": report(Path(work, "stack.html"), *TITLE, STACK),
            "zh": report(Path(work, "zh.html"), "--lang", "zh", TOUR),
        }
        made = pictures(browser, pages) | {"paper": on_paper(browser, pages["stack"])}
        for there, take in ((PAGE, of_the_page), (SITE / "index.html", of_the_site)):
            if there.exists():
                made |= take(browser)
            else:
                sys.stderr.write(f"not there, so not taken: {there.relative_to(ROOT)}\n")
        for name, data in made.items():
            (folder / f"{name}.png").write_bytes(small(data))
    return 0


if __name__ == "__main__":
    sys.exit(main())
