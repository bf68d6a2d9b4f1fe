"""A headless Chromium that looks at a report: opens it, clicks, prints, takes pictures.

Used by the tests beside it and by tools/html_screenshots.py. What is asserted is not here.
"""

from __future__ import annotations

import base64
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

PATIENCE = 60.0
"""Seconds until what should happen has not happened; a busy machine is slow."""
DESKTOP = (1280, 900)
PHONE = (390, 844)


def programs() -> tuple[str, str] | None:
    """Browser and driver, as Debian and most others name them; None where one is missing."""
    browser = (
        shutil.which("chromium")
        or shutil.which("chromium-browser")
        or shutil.which("google-chrome")
    )
    driver = shutil.which("chromedriver")
    return (browser, driver) if browser and driver else None


def until(condition: Callable[[], Any], what: str, patience: float) -> Any:
    """Waits so many seconds for a condition to give something true."""
    end = time.monotonic() + patience
    while True:
        result = condition()
        if result:
            return result
        if time.monotonic() > end:
            raise AssertionError(f"never happened: {what}")
        time.sleep(0.05)


class Browser:
    """One window without a screen, a network or a profile."""

    def __init__(self) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        found = programs()
        assert found is not None
        options = webdriver.ChromeOptions()
        options.binary_location = found[0]
        for argument in (
            "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
            "--force-device-scale-factor=1", "--proxy-server=127.0.0.1:9", "--lang=en-US",
        ):  # fmt: skip
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(found[1]))
        self.command("Network.enable")
        self.command("Performance.enable", timeDomain="threadTicks")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.driver.quit()

    def command(self, name: str, **arguments: Any) -> Any:
        """A command of the DevTools protocol."""
        return self.driver.execute_cdp_cmd(name, arguments)

    def look(
        self, size: tuple[int, int] = DESKTOP, dark: bool = False, touch: bool = False
    ) -> None:
        """The size of the window and the colours that the system prefers."""
        width, height = size
        self.command(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=touch,
        )  # fmt: skip
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[feature])

    def open(self, page: Path, fragment: str = "") -> float:
        """Opens a report and waits until its tables are there; the seconds that this took."""
        begun = time.monotonic()
        self.driver.get("about:blank")
        self.driver.get(page.resolve().as_uri() + fragment)
        self.wait("return !document.querySelector('article:not([data-ready]) [data-part]')"
                  " || !!document.querySelector('details.capture-fold')")  # fmt: skip
        return time.monotonic() - begun

    def run(self, script: str, *arguments: Any) -> Any:
        """Runs a script in the page."""
        return self.driver.execute_script(script, *arguments)

    def wait(self, script: str, *arguments: Any) -> Any:
        """Waits until a script gives something true."""
        return self.until(lambda: self.run(script, *arguments), script)

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Waits for a condition."""
        return until(condition, what, PATIENCE)

    def one(self, selector: str) -> Any:
        """The first element that a CSS selector means."""
        from selenium.webdriver.common.by import By

        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> list[Any]:
        """All elements that a CSS selector means."""
        from selenium.webdriver.common.by import By

        return list(self.driver.find_elements(By.CSS_SELECTOR, selector))

    def texts(self, selector: str) -> list[str]:
        """The visible text of all elements that a CSS selector means."""
        return [" ".join(text.split()) for text in self.run(
            "return [...document.querySelectorAll(arguments[0])].map((each) => each.innerText)", selector
        )]  # fmt: skip

    def click(self, selector: str) -> None:
        """Clicks an element, in view."""
        element = self.one(selector)
        self.run("arguments[0].scrollIntoView({block: 'center'})", element)
        element.click()

    def busy(self) -> float:
        """Seconds of processor time that the page has taken since it was opened."""
        metrics = self.command("Performance.getMetrics")["metrics"]
        return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))

    def plots(self) -> int:
        """Brings the plots into view and waits for them; how many there are."""
        if not self.all("[data-part=plots]"):
            return 0
        self.run("document.querySelector('[data-part=plots]').scrollIntoView()")
        ready = (
            "const plots = [...document.querySelectorAll('.plot .canvas')];"
            "return plots.every((each) => each.querySelector('svg')) ? plots.length : 0"
        )
        return int(self.wait(ready))

    def told(self, plot: int) -> set[str]:
        """What the pointer reads in a plot where anything drawn begins, each line with its end."""
        return set(
            self.run(
                """
                const canvas = [...document.querySelectorAll(".plot .canvas")].at(arguments[0]), told = [];
                for (const path of canvas.querySelectorAll("svg svg path")) {
                  for (const [, x, y] of path.getAttribute("d").matchAll(/M([\\d.-]+) ([\\d.-]+)/g)) {
                    const at = new DOMPoint(Number(x), Number(y)).matrixTransform(path.getScreenCTM());
                    const where = { clientX: at.x, clientY: at.y };
                    canvas.firstElementChild.dispatchEvent(new PointerEvent("pointermove", where));
                    const tip = canvas.querySelector(".tip");
                    if (!tip.hidden) told.push([...tip.children].map((each) => `${each.textContent}\\n`).join(""));
                  }
                }
                return told;""",
                plot,
            )
        )

    def ticks(self, plot: int, up: bool = False) -> list[str]:
        """The numbers or times at an axis of a plot."""
        texts = "svg text.up" if up else "svg .axes > text:not(.up, [transform])"
        found = self.run(
            "const canvas = [...document.querySelectorAll('.plot .canvas')].at(arguments[0]);"
            "return [...canvas.querySelectorAll(arguments[1])].map((each) => each.textContent)", plot, texts,
        )  # fmt: skip
        return [str(each) for each in (found if up else found[:-1])]

    def problems(self) -> list[str]:
        """What the console holds that is worse than information."""
        return [
            entry["message"] for entry in self.driver.get_log("browser") if entry["level"] != "INFO"
        ]

    def requested(self) -> list[str]:
        """The addresses that were asked for since the last call, those inside the page aside."""
        import json

        found = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                found.append(message["params"]["request"]["url"])
        return [url for url in found if not url.startswith(("about:", "data:", "blob:"))]

    def pdf(self) -> bytes:
        """The page on paper (A4)."""
        result = self.command(
            "Page.printToPDF", printBackground=True, paperWidth=8.27, paperHeight=11.69
        )
        return base64.b64decode(result["data"])

    def picture(self) -> bytes:
        """What is in view, as PNG."""
        return base64.b64decode(self.command("Page.captureScreenshot", format="png")["data"])
