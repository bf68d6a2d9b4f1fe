"""A headless Firefox that looks at a page: opens it, gives it files, runs scripts in it.

It is spoken to by WebDriver BiDi itself, which needs no driver beside it. What is asserted is not here.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from browser import until

PATIENCE = 120.0
_LISTENS = re.compile(r"WebDriver BiDi listening on (ws://[\d.]+:\d+)")
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


class Firefox:
    """One window without a screen, a network or a profile, of this machine's Firefox or another."""

    def __init__(self, command: list[str] | None = None) -> None:
        from websocket import create_connection

        found = command or [str(program())]
        self._profile = tempfile.TemporaryDirectory(prefix="ds47-firefox-")
        folder = Path(self._profile.name)
        (folder / "user.js").write_text(_OFFLINE, "utf-8")
        self._log = (folder / "log").open("w+")
        self._process = subprocess.Popen(
            [*found, "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile", str(folder)],
            stderr=self._log, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        self._asked = 0
        address = self.until(self._address, "Firefox listens")
        self._socket = create_connection(
            f"{address}/session", timeout=PATIENCE, suppress_origin=True
        )
        self.ask("session.new", capabilities={})
        (self._window,) = (
            each["context"] for each in self.ask("browsingContext.getTree")["contexts"]
        )

    def __enter__(self) -> Firefox:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._socket.close()
        self._process.terminate()
        self._process.wait(30)
        self._log.close()
        self._profile.cleanup()

    def _address(self) -> str | None:
        assert self._process.poll() is None, "Firefox ended"
        found = _LISTENS.search(Path(self._profile.name, "log").read_text("utf-8", "replace"))
        return found and found[1]

    def ask(self, method: str, **params: Any) -> Any:
        """A command of WebDriver BiDi, and its result."""
        self._asked += 1
        self._socket.send(json.dumps({"id": self._asked, "method": method, "params": params}))
        while True:
            heard = json.loads(self._socket.recv())
            if heard.get("id") == self._asked:
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

    def wait(self, script: str) -> Any:
        """Waits until an expression is something true."""
        return self.until(lambda: self.run(script), script)

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Waits for a condition."""
        return until(condition, what, PATIENCE)

    def picture(self, path: Path) -> None:
        """What the window shows."""
        import base64

        told = self.ask("browsingContext.captureScreenshot", context=self._window)
        path.write_bytes(base64.b64decode(told["data"]))
