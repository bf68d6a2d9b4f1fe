"""The rules of other systems, emulated here: consoles of Windows, what its Python lacks, files that are open.

`make windows` runs the tests on Windows' own Python. Names of files are tested where they are given
(test_folders.py, test_params.py), places of Wireshark in test_plugin_install.py, CRLF where files are read.
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ds47.cli import main

CODE_PAGES = ("cp1252", "cp936")
TOUR, OTHER = "tour-machine.pcapng", "record-global.pcapng"
COMMANDS = [
    "report {tour}", "report --all --plc {tour} {other}", "report -f overview {tour} {other}",
    "report -f junit {tour}", "report -f csv {tour}", "check {tour}", "check {changed}", "accept --yes {changed}",
    "accept --yes {tour}", "baseline --force {changed}", "diff {tour} {other}", "trail {tour} --pnu 945",
    "export -t 1 -o {folder}/one.pcapng {tour}", "decode 01 02 01 01 10 00 07 6F 00 00",
    "encode read axis 2 p945[0..7]", "explain DE80B500", "rules", "rules DS410", "params list",
    "params import {list}", "params remove {name}",
    "demo --no-browser -o {folder}/demo", "plugin install --folder {folder}/plugins --no-profile",
    "report {folder}/none.pcapng", "report {list}",
]  # fmt: skip


class Console:
    """Standard output and errors of a program on Windows whose output goes to a file or a pipe."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, code_page: str) -> None:
        self.out, self.err = (
            io.TextIOWrapper(io.BytesIO(), code_page, errors, newline="\r\n")
            for errors in ("strict", "backslashreplace")
        )
        monkeypatch.setattr(sys, "stdout", self.out)
        monkeypatch.setattr(sys, "stderr", self.err)

    def text(self) -> tuple[str, str]:
        """What was written, decoded as ds47 says that it is: output UTF-8, messages in the code page."""
        for stream in (self.out, self.err):
            stream.flush()
        out, err = (stream.buffer.getvalue() for stream in (self.out, self.err))  # type: ignore[attr-defined]
        return out.decode("utf-8"), err.decode(self.err.encoding)


@pytest.fixture
def changed(tmp_path: Path, captures: Path) -> Path:
    """A capture whose stored result is that of another state."""
    target = tmp_path / "打印机.pcapng"
    shutil.copy(captures / TOUR, target)
    stored = (captures / TOUR).with_suffix(".ds47.json").read_text("utf-8")
    assert '"values": [\n' in stored or '"state": "ok"' in stored
    target.with_suffix(".ds47.json").write_text(
        stored.replace('"state": "refused"', '"state": "ok"').replace(TOUR, target.name), "utf-8"
    )
    return target


@pytest.mark.parametrize("code_page", CODE_PAGES)
@pytest.mark.parametrize("words", COMMANDS)
def test_no_command_stops_at_a_letter_that_the_code_page_lacks(
    words: str, code_page: str, changed: Path, captures: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "lists"))
    names = tmp_path / "轴.csv"
    names.write_text("number,name\n50304,上滑座\n", "utf-8")
    if "{name}" in words:
        assert main(["params", "import", str(names)]) == 0
    console = Console(monkeypatch, code_page)
    given = [
        word.format(
            tour=captures / TOUR, other=captures / OTHER, changed=changed, folder=tmp_path, list=names, name="轴"
        ) for word in words.split()
    ]  # fmt: skip
    arguments = [given[0]] if given[0] != "params" and given[0] != "plugin" else given[:2]
    rest = given[len(arguments) :]
    language = [] if given[0] in ("plugin", "encode") else ["--lang", "zh"]
    status = main([*arguments, *language, *rest])
    out, err = console.text()
    assert status in (0, 1, 3), err
    assert "internal fault" not in err
    assert out or err
    assert "\r\r" not in out


def test_a_result_in_chinese_is_taken_over_on_a_western_console(
    changed: Path, monkeypatch: Any
) -> None:
    console = Console(monkeypatch, "cp1252")
    assert main(["accept", "--lang", "zh", "--yes", str(changed)]) == 0
    out, err = console.text()
    assert (out.splitlines()[0], err) == (str(changed), "")
    assert "打印机" in out


@pytest.mark.parametrize("kind", ["html", "csv", "json"])
def test_a_report_that_is_open_in_another_program_stays_and_is_named(
    kind: str, captures: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    """Windows replaces no file that is open: Excel keeps a CSV, for example."""
    target = tmp_path / f"report.{kind}"
    target.write_text("the old one", "utf-8")

    def refused(self: Path, other: Path) -> Path:
        raise PermissionError(13, "Permission denied", str(self), 5, str(other))

    monkeypatch.setattr(Path, "replace", refused)
    status = main(["report", "-f", kind, "-o", str(target), str(captures / TOUR)])
    assert status == 2
    assert (
        f"cannot write {target}: Permission denied (is it open in another program?)"
        in capsys.readouterr().err
    )
    assert [path.name for path in tmp_path.iterdir()] == [target.name]
    assert target.read_text("utf-8") == "the old one"


BARE = """
import concurrent.futures.process, multiprocessing.popen_spawn_posix, os, signal, subprocess, sys
for name in ("resource", "fcntl", "termios", "tty", "pty", "pwd", "grp", "syslog", "readline", "curses"):
    sys.modules[name] = None
for module, names in ((os, GONE), (signal, SIGNALS)):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
from ds47.cli import main
sys.exit(main(sys.argv[1:]))
"""
GONE = (
    "fork", "forkpty", "geteuid", "getuid", "getgid", "getegid", "getgroups", "setsid", "getpgrp", "tcgetpgrp",
    "sched_getaffinity", "statvfs", "mkfifo", "uname", "killpg", "chown", "lchown", "getloadavg", "sysconf",
    "O_NOFOLLOW", "O_CLOEXEC", "ST_RDONLY", "posix_fadvise", "POSIX_FADV_SEQUENTIAL",
    "pread", "preadv", "sendfile", "fchmod", "wait4", "openpty", "ttyname",
)  # fmt: skip
SIGNALS = (
    "SIGPIPE", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGHUP", "SIGCHLD", "SIGKILL", "SIGWINCH", "SIGINFO", "alarm",
    "setitimer", "pthread_sigmask", "pthread_kill", "sigwait", "siginterrupt", "set_wakeup_fd",
)  # fmt: skip
"""What Python on Windows does not have, the first two lists of os, the last of signal."""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="there it is so")
@pytest.mark.parametrize(
    "words",
    [
        ["report", "-f", "json", "{tour}"],
        ["report", "-f", "html", "-o", "{folder}/page.html", "{tour}"],
        ["report", "-j", "2", "-f", "json", "{tour}", "{other}"],
        ["report", "-j", "2", "--results", "{folder}/results", "{tour}", "{other}"],
        ["check", "{tour}"],
        ["export", "-t", "1", "-o", "{folder}/one.pcapng", "{tour}"],
        ["export", "--anonymise", "--key", "{folder}/key", "-o", "{folder}/a.pcapng", "{tour}"],
        ["watch", "--no-follow", "-f", "ndjson", "{tour}"],
        ["plugin", "install", "--folder", "{folder}/plugins", "--no-profile"],
        ["demo", "--no-browser", "-o", "{folder}/demo"],
    ],
    ids=lambda words: " ".join(words[:4:3]),
)
def test_nothing_is_asked_of_python_that_windows_does_not_have(
    words: list[str], captures: Path, tmp_path: Path
) -> None:
    given = [
        word.format(tour=captures / TOUR, other=captures / OTHER, folder=tmp_path) for word in words
    ]
    program = BARE.replace("GONE", repr(GONE)).replace("SIGNALS", repr(SIGNALS))
    here = subprocess.run([sys.executable, "-m", "ds47", *given], capture_output=True, text=True)
    for path in tmp_path.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    there = subprocess.run([sys.executable, "-c", program, *given], capture_output=True, text=True)
    assert (there.returncode, there.stderr) == (here.returncode, here.stderr)
    assert there.returncode == 0
    assert there.stdout == here.stdout


@pytest.mark.skipif(sys.platform != "win32", reason="elsewhere a file that is open is replaced")
def test_a_report_that_somebody_reads_stays(captures: Path, tmp_path: Path, capsys: Any) -> None:
    target = tmp_path / "report.csv"
    target.write_text("the old one", "utf-8")
    with target.open("rb"):
        assert main(["report", "-f", "csv", "-o", str(target), str(captures / TOUR)]) == 2
    assert "(is it open in another program?)" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


@pytest.mark.skipif(sys.platform != "win32", reason="elsewhere it is a name as any other")
def test_a_list_with_the_name_of_a_device_is_kept(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "lists"))
    (tmp_path / "list.csv").write_text("number,name\n50304,Upper carriage\n", "utf-8")
    assert main(["params", "import", "--name", "aux.v2", str(tmp_path / "list.csv")]) == 0
    assert [path.name for path in (tmp_path / "lists").iterdir()] == ["aux-.v2.toml"]


@pytest.mark.parametrize(
    ("platform", "shown"),
    [("win32", '"line 3.pcapng"'), ("linux", "'line 3.pcapng'"), ("darwin", "'line 3.pcapng'")],
)
def test_a_command_that_is_offered_has_the_quotes_of_the_shell(
    platform: str, shown: str, captures: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    """cmd.exe takes single quotes for letters."""
    shutil.copy(captures / TOUR, tmp_path / "line 3.pcapng")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "platform", platform)
    assert main(["line 3.pcapng"]) == 2
    assert f"ds47 report {shown}" in capsys.readouterr().err
