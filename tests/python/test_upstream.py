"""What docs/developers/upstream.md says of Wireshark's own decoder: the comparison in tools/, and the patches."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from fake_tshark import real_tshark

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/developers/upstream.md").read_text("utf-8")


def compared(*names: str) -> subprocess.CompletedProcess[str]:
    paths = [str(ROOT / "captures" / f"{name}.pcapng") for name in names]
    command = [sys.executable, str(ROOT / "tools/compare_builtin.py"), real_tshark(), *paths]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.slow
def test_blocks_that_the_built_in_reads_are_those_of_ds47() -> None:
    done = compared("seed-g120-read", "seed-dcm-change")
    assert done.returncode == 0, done.stderr
    assert (
        done.stdout == "seed-g120-read: 1 of 1 frames agree\nseed-dcm-change: 1 of 1 frames agree\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["message-error-no-words", "format-mixed"])
def test_the_frames_that_the_page_names_do_not_agree(name: str) -> None:
    text = subprocess.run([real_tshark(), "-v"], capture_output=True, text=True, check=False).stdout
    version = tuple(map(int, re.findall(r"\d+", text)[:2]))
    if version > (4, 6):
        pytest.skip(f"nobody has looked at {version}")
    done = compared(name)
    assert (done.returncode, done.stdout) == (1, f"{name}: 0 of 1 frames agree; not frames 4\n"), (
        done.stderr
    )
    assert f"| `{name}` | 0 of 1 | 0 of 1 | 1 of 1 |" in PAGE


DECODER, TESTS = "plugins/epan/profinet/packet-dcerpc-pn-io.c", "test/suite_dissection.py"
PATCHES = {
    "upstream": [DECODER],
    "upstream-links": [DECODER, TESTS],
    "upstream-profibus": [
        *("epan/dissectors/CMakeLists.txt", "epan/dissectors/packet-profibus.c", TESTS),
        *("wiretap/pcap-common.c", "wiretap/wtap.c", "wiretap/wtap.h"),
    ],
}


@pytest.mark.parametrize(("name", "files"), PATCHES.items())
def test_a_patch_is_one(name: str, files: list[str]) -> None:
    """Each hunk has as many lines as its head says: `patch` takes no other."""
    patch = (ROOT / f"tools/{name}.patch").read_text("utf-8")
    assert re.findall(r"^\+\+\+ b/(\S+)\n", patch, flags=re.MULTILINE) == files
    hunks = re.split(r"^(?=@@ )|^(?=--- (?:a|/dev)/)", patch, flags=re.MULTILINE)
    hunks = [each for each in hunks if each.startswith("@@ ")]
    assert len(hunks) > 5
    for hunk in hunks:
        first, *lines = hunk.splitlines()
        found = re.match(r"@@ -\d+(?:,(\d+))? \+\d+(?:,(\d+))? @@", first)
        assert found
        before, after = (int(number or 1) for number in found.groups())
        assert sum(line[0] in " -" for line in lines) == before
        assert sum(line[0] in " +" for line in lines) == after


def test_fields_of_the_second_patch_stand_in_the_page() -> None:
    patch = (ROOT / "tools/upstream-links.patch").read_text("utf-8")
    new = re.findall(r'^\+ *{ "[^"]+", "(pn_io\.\S+)"', patch, flags=re.MULTILINE)
    assert len(new) == 3
    assert all(f"`{field}`" in PAGE for field in new)
