"""A headless Firefox that looks at a page: opens it, gives it files, runs scripts in it.

It is spoken to by WebDriver BiDi itself, which needs no driver beside it. What is asserted is not here.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
from pathlib import Path
from typing import Any

from spoken import Spoken

_OFFLINE = """\
user_pref("network.proxy.type", 1);
user_pref("network.proxy.http", "127.0.0.1");
user_pref("network.proxy.http_port", 9);
user_pref("network.proxy.ssl", "127.0.0.1");
user_pref("network.proxy.ssl_port", 9);
user_pref("network.proxy.no_proxies_on", "");
user_pref("datareporting.policy.dataSubmissionEnabled", false);
user_pref("app.update.auto", false);
user_pref("browser.shell.checkDefaultBrowser", false);
"""


def program() -> str | None:
    """The browser; None where it is missing."""
    return shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox(Spoken):
    """A window of this machine's Firefox or another."""

    NAME = "Firefox"
    LISTENS = re.compile(r"WebDriver BiDi listening on (ws://[\d.]+:\d+)")

    def __init__(self, command: list[str] | None = None) -> None:
        super().__init__()
        (self.folder / "user.js").write_text(_OFFLINE, "utf-8")
        self.start(
            [*(command or [str(program())]), "--headless", "--no-remote", "--remote-debugging-port", "0",
             "--profile", str(self.folder)], "/session",
        )  # fmt: skip
        self.ask("session.new", capabilities={})
        (self._window,) = (
            each["context"] for each in self.ask("browsingContext.getTree")["contexts"]
        )

    def __enter__(self) -> Firefox:
        return self

    def ask(self, method: str, **params: Any) -> Any:
        """A command of WebDriver BiDi, and its result."""
        heard = self.answer(method, params)
        assert heard["type"] == "success", f"{method}: {heard.get('message')}"
        return heard["result"]

    def open(self, page: Path) -> None:
        """Opens a file."""
        self.ask(
            "browsingContext.navigate", context=self._window, url=page.as_uri(), wait="complete"
        )

    def run(self, script: str) -> Any:
        """The value of an expression in the page: text, number, truth or nothing."""
        told = self.ask(
            "script.evaluate", expression=script, target={"context": self._window}, awaitPromise=True
        )  # fmt: skip
        assert told["type"] == "success", told["exceptionDetails"]["text"]
        return told["result"].get("value")

    def inside(self, script: str) -> Any:
        """The same in the first frame of the page."""
        ((outer,), own) = self.ask("browsingContext.getTree")["contexts"], self._window
        self._window = outer["children"][0]["context"]
        try:
            return self.run(script)
        finally:
            self._window = own

    def files(self, selector: str, *paths: Path) -> None:
        """Chooses files in a field."""
        told = self.ask(
            "script.evaluate", expression=f"document.querySelector({json.dumps(selector)})",
            target={"context": self._window}, awaitPromise=False, resultOwnership="root",
        )  # fmt: skip
        self.ask(
            "input.setFiles", context=self._window, element={"sharedId": told["result"]["sharedId"]},
            files=[str(path) for path in paths],
        )  # fmt: skip

    def picture(self, path: Path) -> None:
        """What the window shows."""
        told = self.ask("browsingContext.captureScreenshot", context=self._window)
        path.write_bytes(base64.b64decode(told["data"]))
