"""The plugin while a capture goes on: frames of a stored capture on the loopback interface, dumpcap and tshark.

Needs the right to capture and to send frames on `lo`, as root has; else it is skipped. dumpcap captures and
tshark reads a pipe, because tshark runs as an ordinary user (Wireshark 4.4 and later load no script as root).
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from test_watch import needs_dumpcap
from test_wireshark_plugin import BROKEN, CAPTURES, PLUGIN, program, run

from ds47.capture.reader import open_capture

TOUR = CAPTURES["tour-machine.pcapng"]
DRIVE = CAPTURES["cyclic-does-not-start.pcapng"]
PAUSE = 0.002  # seconds between frames: the kernel drops none


def data_of(path: Path) -> list[bytes]:
    """The frames of a capture."""
    with open_capture(path) as capture:
        return [frame.data for frame in capture.everything()]


@pytest.fixture
def wire() -> Iterator[socket.socket]:
    """What sends Ethernet frames on the loopback interface: one test of this machine at a time, as all hear it."""
    fcntl = pytest.importorskip("fcntl")
    needs_dumpcap()
    try:
        opened = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)
        opened.bind(("lo", 0))
    except (AttributeError, PermissionError, OSError) as error:
        pytest.skip(f"may not send frames on lo: {error}")
    turn = Path(tempfile.gettempdir(), "ds47-loopback.lock")
    with opened, turn.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield opened


@contextmanager
def live(home: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A tshark that decodes what dumpcap captures on `lo`; both are ready when the body begins."""
    capture = [
        needs_dumpcap(),
        "-q",
        "-i",
        "lo",
        "-f",
        "udp port 34964 or ether proto 0x8892",
        "-w",
        "-",
    ]
    shark = [*program(), "-n", "-l", "-i", "-", "-X", f"lua_script:{PLUGIN}", *arguments]
    environment = {
        **os.environ,
        "HOME": str(home),
        "XDG_CONFIG_HOME": str(home),
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    }
    with (
        subprocess.Popen(capture, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as source,
        subprocess.Popen(shark, stdin=source.stdout, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                         encoding="utf-8", errors="replace", env=environment) as shown,
    ):  # fmt: skip
        try:
            time.sleep(3)
            yield shown
        finally:
            source.terminate()
            shown.kill()


def sent_and_shown(path: Path, wire: socket.socket, home: Path, *arguments: str) -> list[str]:
    """What tshark prints of a capture that is sent again, a line a frame.

    On a busy machine some tsharks end without an error before they have read all that their dumpcap
    announced. The plugin has no part in that: where frames are missing they are sent once more.
    """
    frames, shown = data_of(path), []
    for _ in range(3):
        shown = [
            line for line in sent_once(frames, wire, home, *arguments) if re.match(r"\d+\t", line)
        ]
        if len(shown) == len(frames):
            break
    return shown


def sent_once(frames: list[bytes], wire: socket.socket, home: Path, *arguments: str) -> list[str]:
    """The lines of a tshark that these frames are sent to."""
    with live(home, "-c", str(len(frames)), *arguments) as shark:
        for data in frames:
            wire.send(data)
            time.sleep(PAUSE)
        out, _ = shark.communicate(timeout=60)
    if "Couldn't run dumpcap" in out:
        assert os.environ.get("DS47_CI") != "1", out
        pytest.skip("an ordinary user may not run dumpcap here")
    assert not any(word in out for word in BROKEN), out
    assert shark.returncode == 0, f"tshark ended with {shark.returncode}: {out[-2000:]}"
    return out.splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("path", [TOUR, DRIVE], ids=lambda path: path.stem)
def test_a_live_capture_is_decoded_as_the_stored_one(
    path: Path, wire: socket.socket, tmp_path: Path
) -> None:
    """In one pass, frame for frame, but for the times."""
    names = ("frame.number", "ds47.pnu", "ds47.value", "ds47.transaction", "ds47.pzd.event.name")
    fields = ["-T", "fields", *(part for name in names for part in ("-e", name))]
    stored = run(tmp_path, "-r", path, *fields).decode().splitlines()
    shown = sent_and_shown(path, wire, tmp_path, *fields)
    assert len([line for line in stored if any(line.split("\t")[3:])]) > 6
    assert shown == stored
