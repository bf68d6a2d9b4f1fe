"""Running dumpcap, Wireshark's capture program: finding it, what to tell it, what it says when it fails."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import BinaryIO

from ds47.analysis import AnalysisOptions
from ds47.capture.closing import Closing
from ds47.model import S7
from ds47.s7.choices import PORT
from ds47.spec.raised import Error
from ds47.wireshark.locate import usual_folders

_DCP = "ether proto 0x8892 and ether[{0}:2] >= 0xfefc and ether[{0}:2] <= 0xfeff"
_TAGGED_DCP = (
    "ether proto 0x8892 and ((ether[14:2] >= 0xfefc and ether[14:2] <= 0xfeff) or "
    "(ether[18:2] >= 0xfefc and ether[18:2] <= 0xfeff))"
)
_FILTER = (
    f"udp{{0}} or ether proto 0x88cc or ({_DCP.format(14)}) or "
    f"(vlan and (udp{{0}} or ether proto 0x88cc or ({_TAGGED_DCP})))"
)
CAPTURE_FILTER = _FILTER.format("")
"""UDP (all fragments of it), LLDP and DCP, with and without a VLAN tag; not the cyclic data, which is most.

`vlan` comes last because everything behind it is looked for behind a tag. A frame id may stand at 14
in a tagged frame too, where the card has taken the tag away.
"""
_COOKED_FILTER = "udp{0}"
"""For devices without Ethernet headers: `vlan` and `ether[]` are errors there."""
_COOKED = ("any",)
SECONDS_TO_END = 5
"""How long dumpcap may take longer than it should."""

_SECONDS_TO_SPEAK = 1
"""Who it started may hold its stderr open."""
_CHATTER = ("Capturing on ", "File: ", "Packets ")
"""How lines begin that complain of nothing."""
_NO_PERMISSION = "permission"
_ADVICE = {
    "linux": "add yourself to the group wireshark (Debian: sudo dpkg-reconfigure wireshark-common; "
    "sudo usermod -aG wireshark $USER; log in again), or pipe: sudo dumpcap -i {0} -w - | ds47 watch -",
    "darwin": "install ChmodBPF, which comes with Wireshark, or pipe: sudo dumpcap -i {0} -w - | ds47 watch -",
    "win32": "install Npcap, which comes with Wireshark, and allow users to capture",
}


class DumpcapError(Error):
    """dumpcap is not there, or does not capture; the message is for a person."""


def find(program: str | None = None) -> str:
    """The program: the one named, DS47_DUMPCAP, on the PATH, or where Wireshark is usually installed.

    Raises DumpcapError.
    """
    named = program or os.environ.get("DS47_DUMPCAP")
    if named:
        found = shutil.which(named)
        if found is None:
            raise DumpcapError(f"{named} is not a program that can be run")
        return found
    found = shutil.which("dumpcap")
    name = "dumpcap.exe" if sys.platform == "win32" else "dumpcap"
    usual = (folder / name for folder in usual_folders(os.environ, sys.platform))
    found = found or next((str(path) for path in usual if path.is_file()), None)
    if found is None:
        raise DumpcapError(
            "dumpcap is not installed: it comes with Wireshark (Debian: apt install wireshark-common); "
            "or name it: --dumpcap PROGRAM or DS47_DUMPCAP"
        )
    return found


def arguments(
    interfaces: Sequence[str],
    capture_filter: str | None,
    duration: float | None = None,
    tcp_ports: Sequence[int] = (),
) -> list[str]:
    """What to tell dumpcap, after its name. An empty filter captures everything.

    `tcp_ports` are captured where no filter is given.
    """
    if capture_filter is None:
        cooked = any(name in _COOKED for name in interfaces)
        tcp = "".join(f" or tcp port {port}" for port in tcp_ports)
        capture_filter = (_COOKED_FILTER if cooked else _FILTER).format(tcp)
    words = ["-q", "-w", "-"]
    if capture_filter:
        words += ["-f", capture_filter]  # before -i: for all interfaces
    for name in interfaces:
        words += ["-i", name]
    if duration is not None:
        words += ["-a", f"duration:{duration:g}"]
    return words


def start(
    program: str | None,
    interfaces: Sequence[str],
    capture_filter: str | None,
    duration: float | None,
    options: AnalysisOptions,
) -> Dumpcap:
    """Captures what an analysis with these options needs. Raises DumpcapError."""
    ports = (PORT, *options.s7.ports) if S7 in options.channels else ()
    return Dumpcap(find(program), arguments(interfaces, capture_filter, duration, ports))


class Dumpcap(Closing):
    """dumpcap, running; a context manager that ends it.

    `output` is the capture. Raises DumpcapError where it cannot be started.
    """

    def __init__(self, program: str, words: Sequence[str]) -> None:
        try:
            self._process = subprocess.Popen(
                [program, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
            )
        except OSError as problem:
            raise DumpcapError(f"{program} cannot be run: {problem.strerror}") from problem
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self.output: BinaryIO = self._process.stdout  # type: ignore[assignment]
        self._errors: deque[str] = deque(maxlen=20)
        self._reader = threading.Thread(target=self._read_errors, daemon=True)
        self._reader.start()
        self._interface = words[words.index("-i") + 1] if "-i" in words else ""
        self._asked_to_end: float | None = None

    def close(self) -> None:
        """Ends it, and waits until it has ended."""
        self.end()
        if self._ended() is None:
            self._process.kill()
            self._process.wait()
        self._reader.join(_SECONDS_TO_SPEAK)
        self.output.close()
        if self._process.stderr is not None:
            self._process.stderr.close()

    def end(self) -> None:
        """Asks it to end; what it has captured still comes."""
        if self._asked_to_end is None:
            self._asked_to_end = time.monotonic()
        if self._process.poll() is None:
            self._process.terminate()

    def problem(self) -> str | None:
        """Why it ended by itself; None where it ended because it was asked to, or its time was over.

        Waits for its end: call this when the output is at its end.
        """
        status = self._ended()
        if not status or self._asked_to_end is not None:
            return None
        self._reader.join(_SECONDS_TO_SPEAK)
        return self._said(status)

    def _ended(self) -> int | None:
        """Its status, for which it has some seconds since it was asked to end; None where it goes on."""
        begin = time.monotonic() if self._asked_to_end is None else self._asked_to_end
        try:
            return self._process.wait(max(0.1, begin + SECONDS_TO_END - time.monotonic()))
        except subprocess.TimeoutExpired:
            return None

    def _read_errors(self) -> None:
        assert self._process.stderr is not None
        for line in iter(self._process.stderr.readline, b""):
            self._errors.append(line.decode("utf-8", errors="replace").rstrip())

    def _said(self, status: int) -> str:
        """Its complaint, else the last that it said, with advice if there is any."""
        lines = [line for line in self._errors if line and not line.startswith(_CHATTER)]
        first = next((n for n, line in enumerate(lines) if line.startswith("dumpcap:")), None)
        text = " ".join(lines[-3:] if first is None else lines[first : first + 3])
        if first is None:
            text = f"dumpcap ended with status {status}{': ' if text else ''}{text}"
        if _NO_PERMISSION in text.lower():
            text += ". " + _ADVICE.get(sys.platform, _ADVICE["linux"]).format(self._interface)
        elif "no device named" in text.lower() or "interface" in text.lower():
            text += ". Interfaces: dumpcap -D"
        return text
