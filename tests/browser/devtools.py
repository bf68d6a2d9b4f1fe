"""A headless Chromium without a driver: it is spoken to by the DevTools protocol itself, as bare systems need it.

The same words as firefox.py. What is asserted is not here.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from browser import until

PATIENCE = 120.0
_LISTENS = re.compile(r"DevTools listening on (ws://\S+)")


class DevTools:
    """One window without a screen, a network or a profile."""

    def __init__(self, command: list[str]) -> None:
        from websocket import create_connection

        self._profile = tempfile.TemporaryDirectory(prefix="ds47-chromium-")
        self._log = Path(self._profile.name, "log").open("w+")
        self._process = subprocess.Popen(
            [*command, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
             "--no-first-run", "--remote-debugging-port=0", f"--user-data-dir={self._profile.name}/profile",
             "about:blank"], stderr=self._log, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        self._asked = 0
        address = self.until(self._address, "Chromium listens")
        self._socket = create_connection(address, timeout=PATIENCE, suppress_origin=True)
        self._session: str | None = None
        (page,) = (
            each for each in self.ask("Target.getTargets")["targetInfos"] if each["type"] == "page"
        )
        attached = self.ask("Target.attachToTarget", targetId=page["targetId"], flatten=True)
        self._session = attached["sessionId"]

    def __enter__(self) -> DevTools:
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
        told = Path(self._profile.name, "log").read_text("utf-8", "replace")
        assert self._process.poll() is None, f"Chromium ended: {told[-2000:]}"
        found = _LISTENS.search(told)
        return found and found[1]

    def ask(self, method: str, **params: Any) -> Any:
        """A command of the protocol, and its result."""
        self._asked += 1
        message = {"id": self._asked, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        while True:
            heard = json.loads(self._socket.recv())
            if heard.get("id") == self._asked:
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

    def wait(self, script: str) -> Any:
        """Waits until an expression is something true."""
        return self.until(lambda: self.run(script), script)

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Waits for a condition."""
        return until(condition, what, PATIENCE)

    def picture(self, path: Path) -> None:
        """What the window shows."""
        import base64

        path.write_bytes(base64.b64decode(self.ask("Page.captureScreenshot")["data"]))
