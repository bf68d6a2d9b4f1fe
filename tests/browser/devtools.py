"""A headless Chromium without a driver: it is spoken to by the DevTools protocol itself, as bare systems need it.

The same words as firefox.py. What is asserted is not here.
"""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

from spoken import Spoken


class DevTools(Spoken):
    """A window of Chromium."""

    NAME = "Chromium"
    LISTENS = re.compile(r"DevTools listening on (ws://\S+)")

    def __init__(self, command: list[str]) -> None:
        super().__init__()
        self._session: dict[str, str] = {}
        self.start(
            [*command, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--no-first-run", "--remote-debugging-port=0", f"--user-data-dir={self.folder / 'profile'}",
             "about:blank"]
        )  # fmt: skip
        (page,) = (
            each for each in self.ask("Target.getTargets")["targetInfos"] if each["type"] == "page"
        )
        attached = self.ask("Target.attachToTarget", targetId=page["targetId"], flatten=True)
        self._session = {"sessionId": attached["sessionId"]}

    def __enter__(self) -> DevTools:
        return self

    def ask(self, method: str, **params: Any) -> Any:
        """A command of the protocol, and its result."""
        heard = self.answer(method, params, **self._session)
        assert "error" not in heard, f"{method}: {heard.get('error')}"
        return heard["result"]

    def open(self, page: Path) -> None:
        """Opens a file."""
        self.ask("Page.enable")
        told = self.ask("Page.navigate", url=page.as_uri())
        assert "errorText" not in told, told
        self.wait("document.readyState === 'complete'")

    def run(self, script: str) -> Any:
        """The value of an expression in the page: text, number, truth or nothing."""
        told = self.ask(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def files(self, selector: str, *paths: Path) -> None:
        """Chooses files in a field."""
        root = self.ask("DOM.getDocument")["root"]["nodeId"]
        node = self.ask("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.ask("DOM.setFileInputFiles", nodeId=node, files=[str(path) for path in paths])

    def picture(self, path: Path) -> None:
        """What the window shows."""
        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot")["data"]))
