"""Takes the pictures of Wireshark in docs/images: its windows with the plugin and the profile of this checkout.

Usage: screenshots.py [FOLDER [PROGRAM]], PROGRAM being another Wireshark than this machine's own, for example
one of window-roots.sh. Installs nothing; says which of Debian's packages are missing.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))

from window import Wireshark, missing  # noqa: E402

LONG = ROOT / "captures" / "real-stacks" / "o3_two_controllers.pcapng"
TOUR = ROOT / "captures" / "tour-machine.pcapng"
DRIVE = ROOT / "captures" / "cyclic-longer-ramp.pcapng"
BUS = ROOT / "tools" / "screenshot-profibus.txt"
REFUSED = 130  # a change that was refused: a negative response with findings
WRONG_TYPE = 387  # a change of which the capture proves what should have been sent
RUNNING = 29  # the same in the capture of the tutorial
LIST = "gui.geometry_main_upper_pane: 330\ngui.geometry_main_lower_pane: 880\n"
PACKET_MENU = 6  # entries of the menu of a packet up to ours
SEND_INSTEAD = 11  # lines of that finding up to the bytes
IO_GRAPHS, FLOW_GRAPH = 6, 18  # entries of the menu Statistics before these
CHANGES = 'ds47.operation == "change"'


class Pictures:
    """Pictures of one Wireshark into one folder."""

    def __init__(self, folder: Path, program: str) -> None:
        self.folder, self.program = folder, program

    def open(self, capture: Path, *arguments: str) -> Wireshark:
        """A window with a list of some ten frames."""
        size = (1366, 900)
        return Wireshark(capture, *arguments, program=self.program, size=size, recent=LIST)

    def take(self, shown: Wireshark, name: str, window: str, crop: str = "") -> None:
        """One of them, without the pointer in it."""
        shown.xdotool("mousemove", 1590, 1190)
        time.sleep(0.5)
        shown.picture(self.folder / f"{name}.png", window, crop)
        size = (self.folder / f"{name}.png").stat().st_size
        sys.stderr.write(f"{name}.png: {size} bytes\n")
        if shown.complaints():
            raise RuntimeError(shown.complaints())

    def of_records(self) -> None:
        """A capture of real stacks: a finding in the tree, the menu, statistics, expert infos, a graph."""
        with self.open(LONG, "-g", str(REFUSED)) as shown:
            self._tree(shown)
            self.take(shown, "wireshark", shown.main)
            shown.keys("End")
            self.take(shown, "wireshark-finding", shown.main)
            shown.keys("alt+s")
            self.take(shown, "wireshark-menu", "root", "720x840+0+0")
            shown.keys("Escape", "Escape")
            self._packet_menu(shown)
            self._expert(shown)
            self._graph(shown, "wireshark-graph")
        with self.open(LONG, "-Y", CHANGES) as shown:
            self._statistics(shown)

    def _tree(self, shown: Wireshark) -> None:
        """Our tree, which is the last one, at the top of its pane opened; the list a bit further."""
        shown.focus(shown.main)
        shown.click(300, 250, button=5, repeat=2)
        low = shown.size[1] - 60
        shown.click(300, low)
        shown.keys("Home", "End", "shift+Right")
        shown.click(300, low, button=5, repeat=2)

    def _packet_menu(self, shown: Wireshark) -> None:
        """The menu of a packet, which Wireshark has for plugins from 4.4 on."""
        version = subprocess.run([self.program, "-v"], capture_output=True, text=True, check=True)
        found = re.search(r"^Wireshark (\d+)\.(\d+)", version.stdout, re.MULTILINE)
        if found is None or (int(found[1]), int(found[2])) < (4, 4):
            return
        shown.focus(shown.main)
        shown.click(500, 140)
        shown.click(500, 140, button=3)
        shown.keys(*["Down"] * PACKET_MENU, "Right")
        self.take(shown, "wireshark-packet-menu", "root", "1230x540+0+60")
        shown.keys("Escape", "Escape", "Escape")

    def _statistics(self, shown: Wireshark) -> None:
        """As it opens, from Tools > DS47, whose last entry it is."""
        shown.focus(shown.main)
        shown.keys("alt+t")
        shown.keys("Up", "Up", "Right", "Up", "Return")
        window = shown.window("DS47 statistics")
        time.sleep(1)
        self.take(shown, "wireshark-statistics", window)
        shown.close_window(window)

    def _expert(self, shown: Wireshark) -> None:
        """The last entry of the menu Analyze."""
        shown.focus(shown.main)
        shown.keys("alt+a")
        shown.keys("Up", "Return")
        window = shown.window("Expert Information")
        shown.wait_until_loaded()
        shown.place(window, 900, 480)
        self.take(shown, "wireshark-expert", window)
        shown.close_window(window)

    def _graph(self, shown: Wireshark, name: str) -> None:
        """An entry of the menu Statistics."""
        shown.focus(shown.main)
        shown.keys("alt+s")
        shown.keys(*["Down"] * IO_GRAPHS, "Return")
        window = shown.window("I/O Graphs")
        shown.wait_until_loaded()
        shown.place(window, 960, 560)
        self.take(shown, name, window)
        shown.close_window(window)

    def _flow(self, shown: Wireshark) -> None:
        """The flow graph of the frames that the filter shows, to which 4.4 limits it by itself."""
        shown.focus(shown.main)
        shown.keys("alt+s")
        shown.keys(*["Down"] * FLOW_GRAPH, "Return")
        window = shown.window("Flow")
        shown.wait_until_loaded()
        shown.place(window, 960, 660)
        self.take(shown, "wireshark-flow", window)
        shown.close_window(window)

    def of_what_to_send(self) -> None:
        """The request of a refused change: its finding with the bytes to send instead, in a tab of their own."""
        with self.open(LONG, "-g", str(WRONG_TYPE)) as shown:
            shown.focus(shown.main)
            shown.click(300, 250, button=5, repeat=2)
            shown.click(300, shown.size[1] - 60)
            shown.keys("Home", "End", "Right")
            shown.keys("End", "Up", "Up", "shift+Right")
            shown.keys(*["Down"] * (SEND_INSTEAD + 2), "Up", "Up")  # the next two lines as well
            self.take(shown, "wireshark-instead", shown.main)

    def of_the_tour(self) -> None:
        """The capture of the tutorial: a change that a running drive does not accept."""
        with self.open(TOUR, "-g", str(RUNNING)) as shown:
            self._tree(shown)
            self.take(shown, "wireshark-tour", shown.main)
        with self.open(TOUR, "-Y", "ds47") as shown:
            self._flow(shown)

    def of_a_drive(self) -> None:
        """A drive that starts and stops: the window of drives, setpoint and actual value as a graph."""
        with self.open(DRIVE) as shown:
            shown.focus(shown.main)
            shown.keys("alt+t")
            shown.keys("Up", "Up", "Right", "Up", "Up", "Up", "Return")
            window = shown.window("DS47 drives")
            time.sleep(1)
            self.take(shown, "wireshark-drives", window)
            shown.close_window(window)
            self._graph(shown, "wireshark-drive-graph")

    def of_a_bus(self) -> None:
        """A line of PROFIBUS: the tree of a frame and ours below it."""
        with tempfile.TemporaryDirectory() as work:
            line = Path(work) / "line.pcapng"
            command = [sys.executable, "-m", "ds47", "export", "--link", "profibus", str(BUS)]
            subprocess.run([*command, "-o", str(line)], check=True, cwd=ROOT)
            with self.open(line, "-g", "36") as shown:
                shown.focus(shown.main)
                shown.click(300, 250, button=5, repeat=2)
                shown.click(300, shown.size[1] - 60)
                shown.keys("Home", "End", "Up")
                shown.keys("shift+Right")
                shown.keys("End", "Right")
                shown.keys("Home", "Down")
                self.take(shown, "wireshark-profibus", shown.main)


def main() -> int:
    """Take them; returns the exit status."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images"
    program = sys.argv[2] if len(sys.argv) > 2 else "wireshark"
    packages = missing(program)
    if packages:
        sys.stderr.write(f"missing (Debian): {' '.join(packages)}\n")
        return 1
    folder.mkdir(parents=True, exist_ok=True)
    pictures = Pictures(folder.resolve(), program)
    pictures.of_records()
    pictures.of_what_to_send()
    pictures.of_the_tour()
    pictures.of_a_drive()
    pictures.of_a_bus()
    return 0


if __name__ == "__main__":
    sys.exit(main())
