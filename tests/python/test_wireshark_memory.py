"""Memory of tshark with the plugin: cyclic frames without news must leave nothing behind.

What piles up between two collections of Lua must not grow with the file: once it was counted as alive, and so
doubled itself.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from fake_tshark import real_tshark

ROOT = Path(__file__).resolve().parents[2]
FEW, MANY = 250_000, 1_000_000
KEPT = 50
"""MB more for so many more frames: 1,500 transactions, and what is between two collections."""


def peak(capture: Path, home: Path, *, plugin: bool) -> float:
    """The most memory in use while a capture is read, MB."""
    environment = os.environ | {"HOME": str(home), "XDG_CONFIG_HOME": str(home)}
    command = [real_tshark(), "-n", "-r", str(capture)]
    if plugin:
        command += ["-X", f"lua_script:{ROOT / 'dissector/ds47.lua'}"]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout
    with process.stdout as shown:
        assert (sum(b" DS47 " in line for line in shown) > 1000) is plugin
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_maxrss / 1024


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems count other memory")
def test_cyclic_frames_leave_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    import make_noise

    used = []
    for frames in (FEW, MANY):
        capture = tmp_path / f"{frames}.pcap"
        make_noise.write(capture, frames)
        alone = peak(capture, tmp_path, plugin=False)  # Wireshark keeps something of each frame
        used.append(peak(capture, tmp_path, plugin=True) - alone)
        capture.unlink()
    assert used[1] - used[0] < KEPT, used
