"""A headless browser that is spoken to through a socket, without a driver: its process, its profile, its answers.

What differs between Chromium (devtools.py) and Firefox (firefox.py) is there. What is asserted is not here.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar

from browser import until

PATIENCE = 120.0


class Spoken:
    """One window without a screen, a network or a profile; `folder` is what it has for one."""

    NAME: ClassVar[str]
    LISTENS: ClassVar[re.Pattern[str]]
    """What the browser prints when it listens, with the address."""

    def __init__(self) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix=f"ds47-{self.NAME.lower()}-")
        self.folder = Path(self._profile.name)
        self._log = (self.folder / "log").open("w+")
        self._asked = 0

    def start(self, command: list[str], path: str = "") -> None:
        """Starts the browser, and speaks to `path` of the address that it names."""
        from websocket import create_connection

        self._process = subprocess.Popen(command, stderr=self._log, stdout=subprocess.DEVNULL)
        address = self.until(self._address, f"{self.NAME} listens")
        self._socket = create_connection(address + path, timeout=PATIENCE, suppress_origin=True)

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
        told = (self.folder / "log").read_text("utf-8", "replace")
        assert self._process.poll() is None, f"{self.NAME} ended: {told[-2000:]}"
        found = self.LISTENS.search(told)
        return found and found[1]

    def answer(self, method: str, params: dict[str, Any], **more: Any) -> dict[str, Any]:
        """What comes back to a command; events before it are passed over."""
        self._asked += 1
        self._socket.send(
            json.dumps({"id": self._asked, "method": method, "params": params, **more})
        )
        while True:
            heard: dict[str, Any] = json.loads(self._socket.recv())
            if heard.get("id") == self._asked:
                return heard

    def run(self, script: str) -> Any:
        """The value of an expression in the page: text, number, truth or nothing."""
        raise NotImplementedError

    def wait(self, script: str) -> Any:
        """Waits until an expression is something true."""
        return self.until(lambda: self.run(script), script)

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Waits for a condition."""
        return until(condition, what, PATIENCE)
