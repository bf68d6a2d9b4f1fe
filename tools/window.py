"""A real Wireshark with the plugin and the profile of this checkout, on a display that nobody sees.

Here is what a picture or a test needs of a window: to start it, to press keys, to wait for a dialog, to
photograph it. Which pictures are taken stands in screenshots.py. Linux only; needs Xvfb, xdotool and
ImageMagick. Wireshark runs as an ordinary user: as root 4.4 and later load no plugin.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

ROOT = Path(__file__).resolve().parent.parent
NEEDED = {"Xvfb": "xvfb", "import": "imagemagick", "xdotool": "xdotool"}
NOBODY = 65534
PATIENCE = 60  # seconds for a window to come: a machine may be busy
SCREEN = (1600, 1200)


def missing(program: str) -> list[str]:
    """Names of Debian's packages of programs that are not here."""
    packages = {**NEEDED, program: "wireshark"}
    return sorted({package for name, package in packages.items() if shutil.which(name) is None})


class Wireshark:
    """A Wireshark that shows a capture in the profile DS47; to be used in a `with`."""

    def __init__(
        self,
        capture: Path,
        *arguments: str,
        program: str = "wireshark",
        size: tuple[int, int] = (1400, 1000),
        recent: str = "",
        profile: bool = True,
    ) -> None:
        """Nothing runs yet.

        Args:
            capture: what it opens
            arguments: further ones of Wireshark
            program: the program, or the wrapper of another version (window-roots.sh)
            size: of the main window, pixels
            recent: lines for the file `recent` of the profile, such as heights of panes
            profile: whether the profile is there and chosen
        """
        self.capture, self.arguments, self.program = capture, arguments, program
        self.size, self.recent, self.profile = size, recent, profile
        self.work = Path(tempfile.mkdtemp(prefix="ds47-window-"))
        self.processes: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Wireshark:
        try:
            self._settings()
            self._start()
            self.main = self.window(self.capture.name)
            self.wait_until_loaded()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends what was started."""
        for process in reversed(self.processes):
            process.kill()
            process.wait()
        shutil.rmtree(self.work, ignore_errors=True)

    def _settings(self) -> None:
        """Copies: the ordinary user may not be allowed to look into the checkout."""
        self.home = self.work / "home"
        run, settings = self.work / "run", self.home / ".config" / "wireshark"
        for part in ("dissector", "lua"):
            shutil.copytree(ROOT / part, run / part)
        shutil.copy(self.capture, run)
        settings.mkdir(parents=True)
        if self.profile:
            folder = settings / "profiles" / "DS47"
            shutil.copytree(ROOT / "dissector" / "profile", folder)
            with (folder / "recent").open("a", encoding="ascii") as file:
                file.write(self.recent)
        width, height = self.size
        (settings / "recent_common").write_text(
            f"gui.geometry_main_x: 0\ngui.geometry_main_y: 0\n"
            f"gui.geometry_main_width: {width}\ngui.geometry_main_height: {height}\n"
        )
        self.work.chmod(0o711)
        if os.geteuid() == 0:
            subprocess.run(["chown", "-R", f"{NOBODY}:{NOBODY}", self.work], check=True)
        self.home.chmod(0o700)

    def _start(self) -> None:
        got, tell = os.pipe()
        command = ["Xvfb", "-displayfd", str(tell), "-screen", "0", f"{SCREEN[0]}x{SCREEN[1]}x24"]
        self._run([*command, "-nolisten", "tcp"], pass_fds=(tell,))
        os.close(tell)
        with open(got, encoding="ascii") as answer:
            number = answer.readline().strip()
        self.environment = {
            **os.environ,
            "DISPLAY": f":{number}",
            "HOME": str(self.home),
            "XDG_CONFIG_HOME": str(self.home / ".config"),
            "XDG_RUNTIME_DIR": str(self.home),
            "LC_ALL": "C.UTF-8",
            "TZ": "UTC",
            "QT_QPA_PLATFORM": "xcb",
        }
        as_user = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
        run = self.work / "run"
        self.log = self.work / "log"
        with self.log.open("wb") as log:
            self._run(
                [
                    *(as_user if os.geteuid() == 0 else []),
                    *(self.program, "-o", "gui.update.enabled:FALSE"),
                    *(("-C", "DS47") if self.profile else ()),
                    *("-X", f"lua_script:{run / 'dissector' / 'ds47.lua'}"),
                    *("-r", str(run / self.capture.name)),
                    *self.arguments,
                ],
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self.environment,
                cwd=run,
            )

    def _run(self, command: Sequence[str], **options: object) -> None:
        self.processes.append(
            subprocess.Popen(command, stdin=subprocess.DEVNULL, **options)  # type: ignore[call-overload]
        )

    def xdotool(self, *arguments: object) -> str:
        """What xdotool prints."""
        command = ["xdotool", *map(str, arguments)]
        done = subprocess.run(
            command, env=self.environment, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    def windows(self, title: str = "") -> list[str]:
        """Ids of the windows that are seen, by a part of their titles."""
        return self.xdotool("search", "--onlyvisible", "--name", title or ".").split()

    def window(self, title: str, patience: float = PATIENCE) -> str:
        """The id of a window, waiting for it.

        Raises:
            RuntimeError: it did not come
        """
        end = time.monotonic() + patience
        while time.monotonic() < end:
            found = self.windows(title)
            if found:
                return found[-1]
            if self.processes[-1].poll() is not None:
                break
            time.sleep(0.3)
        log = self.log.read_text(errors="replace")
        raise RuntimeError(f"no window named {title!r}; Wireshark said:\n{log}")

    def wait_until_loaded(self) -> None:
        """Until it has nothing more to do: no processor time in a second."""
        before = -1
        while before != (before := self._ticks()):
            time.sleep(1)

    def _ticks(self) -> int:
        """Processor time of Wireshark, hundredths of a second, tens left out."""
        stat = Path(f"/proc/{self.processes[-1].pid}/stat").read_text()
        fields = stat.rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) // 5

    def focus(self, window: str) -> None:
        """Keys go there."""
        self.xdotool("windowfocus", "--sync", window)
        time.sleep(0.3)

    def keys(self, *keys: str, wait: float = 0.5) -> None:
        """Presses keys, such as `alt+t`."""
        self.xdotool("key", "--delay", 80, *keys)
        time.sleep(wait)

    def type(self, text: str) -> None:
        """Types a text."""
        self.xdotool("type", "--delay", 20, text)
        time.sleep(0.5)

    def click(self, x: int, y: int, button: int = 1, repeat: int = 1, wait: float = 0.5) -> None:
        """Clicks; buttons 4 and 5 are the wheel."""
        self.xdotool("mousemove", x, y, "click", "--repeat", repeat, "--delay", 80, button)
        time.sleep(wait)

    def place(self, window: str, width: int, height: int, x: int = 0, y: int = 0) -> None:
        """Moves and sizes a window."""
        self.xdotool("windowsize", window, width, height)
        self.xdotool("windowmove", window, x, y)
        time.sleep(1)

    def close_window(self, window: str) -> None:
        """As Escape does."""
        self.focus(window)
        self.keys("Escape", wait=1)

    def complaints(self) -> str:
        """What Lua said that went wrong."""
        lines = self.log.read_text(errors="replace").splitlines()
        return "\n".join(each for each in lines if "Lua Error" in each or "Error during" in each)

    def picture(self, target: Path, window: str = "root", crop: str = "") -> None:
        """A PNG of a window, few colours, without what would make two runs differ."""
        shot = self.work / "shot.png"
        subprocess.run(["import", "-window", window, shot], env=self.environment, check=True)
        few = ["+dither", "-colors", "64", "-strip", "-define", "png:compression-level=9"]
        cut = ["-crop", crop, "+repage"] if crop else []
        subprocess.run(["convert", shot, *cut, *few, target], check=True)
