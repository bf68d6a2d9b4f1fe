"""Takes the pictures of the HTML report in docs/images, with the browser of tests/browser.

Usage: html_screenshots.py [FOLDER]. Needs Chromium with its driver, selenium and bokeh.
"""

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "browser"))

from browser import DESKTOP, PHONE, Browser, programs  # noqa: E402
from ds47.cli import main as ds47  # noqa: E402

TOUR = "captures/tour-machine.pcapng"
DRIVE = "captures/cyclic-changed-after-off1.pcapng"
BUS = "captures/profibus-ppo3-and-records.pcapng"
LONG = "captures/real-stacks/o3_two_controllers.pcapng"


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
    browser.look()
    browser.open(pages["tour"])
    made["report"] = browser.picture()
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
    browser.look()
    browser.open(pages["zh"])
    made["report-zh"] = browser.picture()
    return made


def main() -> int:
    """Write the pictures; returns the exit status."""
    if programs() is None:
        sys.stderr.write(
            "chromium or chromedriver is missing (Debian: chromium, chromium-driver)\n"
        )
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
            "zh": report(Path(work, "zh.html"), "--lang", "zh", TOUR),
        }
        for name, data in pictures(browser, pages).items():
            (folder / f"{name}.png").write_bytes(data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
