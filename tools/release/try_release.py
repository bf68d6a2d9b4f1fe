#!/usr/bin/env python3
"""Tries what `make release` built where nothing else is: in bare Debian roots, without network.

    python tools/release/try_release.py [NAME...]        (make try-release)

    python       ds47.pyz, with Python alone
    wheelhouse   the line that installs, with Python and its venv
    container    the Containerfile, built by buildah
    chromium     ds47.html from file://, with the browser alone
    firefox      likewise

Each gets to the report of a capture, which has to equal that of this checkout's command, byte for byte. The roots
are made by tools/bare-roots.sh. DS47_DIST=... names another folder than dist/, DS47_PICTURES=... one for what the
browsers show. Needs root: it starts itself again without network and with mounts of its own.
Exit status: 0 all went well; 1 something did not; 77 this machine cannot try it.
"""

from __future__ import annotations

import base64
import fcntl
import hashlib
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pins

sys.path.insert(0, str(pins.ROOT / "tests" / "browser"))

if TYPE_CHECKING:
    from devtools import DevTools
    from firefox import Firefox

DIST = Path(os.environ.get("DS47_DIST") or pins.ROOT / "dist")
CAPTURE = "tour-machine.pcapng"
REPORTS = (["-f", "html"], ["-f", "json"], ["-f", "text", "--lang", "zh"])
CANNOT = 77
INSIDE = "DS47_TRIED_INSIDE"
ROOTS = {"container": ("base", "buildah")}
LIMITS = [word for each in ("nproc=1000:1000", "nofile=1024:1024") for word in ("--ulimit", each)]
"""What buildah asks for by itself may be more than a container that this runs in has."""
Roots = dict[str, Path]


def run(command: list[str], **options: object) -> bytes:
    """What a command says, with an environment of nothing. SystemExit where it fails."""
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": "/tmp", "TZ": "UTC"}
    done = subprocess.run(command, env=environment, capture_output=True, **options)  # type: ignore[call-overload]
    if done.returncode:
        told = (done.stdout + done.stderr).decode("utf-8", "replace")[-3000:]
        sys.exit(f"{' '.join(map(str, command))}\nexit status {done.returncode}\n{told}")
    return bytes(done.stdout)


def within(root: Path, *words: str | Path, folder: Path | str = "/") -> list[str]:
    """What runs a program in a root, in a folder of it."""
    return [str(shutil.which("unshare")), f"--root={root}", f"--wd={folder}", *map(str, words)]


def mount(*words: str | Path) -> None:
    subprocess.run(["mount", *map(str, words)], check=True)


def expected(report: list[str]) -> bytes:
    """What the command of this checkout writes."""
    return run(
        [sys.executable, "-m", "ds47", "report", *report, "-o", "-", CAPTURE], cwd=pins.ROOT / "captures"
    )  # fmt: skip


def compare(name: str, found: bytes, wanted: bytes) -> None:
    if found != wanted:
        sys.exit(f"{name}: {len(found)} bytes are not the {len(wanted)} of the command")


def reports(name: str, command: list[str]) -> None:
    """Every report, by a command that takes words and starts beside the capture."""
    for report in REPORTS:
        found = run([*command, "report", *report, "-o", "-", CAPTURE])
        compare(f"{name}, {' '.join(report)}", found, expected(report))


def try_python(roots: Roots, work: Path) -> None:
    root = roots["python"]
    there = [each.name for each in (root / "usr/bin").iterdir()]
    if "sh" in there or [*root.glob("usr/lib/python3/dist-packages/*")]:
        sys.exit(f"{root} has more than Python")
    command = ["/usr/bin/python3", work / "ds47.pyz"]
    reports("ds47.pyz", within(root, *command, folder=work / "captures"))


def _house(work: Path) -> Path:
    """The unpacked wheelhouse."""
    (archive,) = DIST.glob("ds47-*-wheelhouse.zip")
    if not (work / archive.stem).exists():
        zipfile.ZipFile(archive).extractall(work)
    return work / archive.stem


def try_wheelhouse(roots: Roots, work: Path) -> None:
    house, root = _house(work), roots["wheelhouse"]
    told = (house / "README.txt").read_text("utf-8")
    (line,) = re.findall(r"^ +python3 (-m pip .*)$", told, re.MULTILINE)
    place = work / "installed"
    run(within(root, "/usr/bin/python3", "-m", "venv", place))
    run(within(root, place / "bin/python3", *line.split(), folder=house))
    reports("wheelhouse", within(root, place / "bin/ds47", folder=work / "captures"))


def try_container(roots: Roots, work: Path) -> None:
    """The base is named as the Containerfile names it, so that not a letter of that is changed."""
    house, root = _house(work), roots["buildah"]
    (base,) = re.findall(
        r"^FROM (\S+)$", (house / "Containerfile").read_text("utf-8"), re.MULTILINE
    )
    store = work / "images"
    store.mkdir()
    (root / "base").mkdir(exist_ok=True)
    mount("--rbind", roots["base"], root / "base")
    told = "FROM scratch\nCOPY . /\nENV PATH=/usr/local/bin:/usr/bin:/bin\n"
    (store / "Base").write_text(told, "utf-8")
    (store / "policy.json").write_text('{"default": [{"type": "insecureAcceptAnything"}]}', "utf-8")

    def buildah(verb: str, *words: str | Path) -> str:
        where = ["--root", store / "root", "--runroot", store / "run", "--storage-driver", "vfs"]
        return run(within(root, "/usr/bin/buildah", *where, verb, *words)).decode().strip()

    trust = ["--signature-policy", store / "policy.json"]
    build = ["--isolation", "chroot", *LIMITS, *trust]
    name = base if "/" in base else f"docker.io/library/{base}"
    buildah("bud", *build, "-f", store / "Base", "-t", name, "/base")
    buildah("bud", *build, "--pull=never", "-t", "ds47", house)
    entry = json.loads(buildah("inspect", "ds47"))["OCIv1"]["config"]["Entrypoint"]
    made = buildah("from", *LIMITS, *trust, "--pull=never", "ds47")
    start = ["--isolation", "chroot", "--volume", f"{work}/captures:/captures", made, "--", *entry]
    for report in REPORTS:
        buildah("run", *start, "report", *report, "-o", "/captures/out", CAPTURE)
        found = (work / "captures" / "out").read_bytes()
        compare(f"container, {' '.join(report)}", found, expected(report))


def try_chromium(roots: Roots, work: Path) -> None:
    from devtools import DevTools

    with DevTools(within(roots["chromium"], "/usr/lib/chromium/chromium")) as desk:
        _page(desk, work)


def try_firefox(roots: Roots, work: Path) -> None:
    from firefox import Firefox

    with Firefox(within(roots["firefox"], "/usr/lib/firefox-esr/firefox-esr")) as desk:
        _page(desk, work)


def _page(desk: DevTools | Firefox, work: Path) -> None:
    """A capture given to the page, and what comes of it."""
    desk.open(work / "ds47.html")
    desk.wait("/ready|failed/.test(document.querySelector('#state').className)")
    desk.files("#report input[name=files]", work / "captures" / CAPTURE)
    desk.wait(
        "document.querySelector('#outcome').textContent || document.querySelector('#messages').textContent"
    )
    made = """(() => { let text = ''; for (const { data } of document.querySelector('#made').files)
        for (const each of new Uint8Array(data.buffer || data)) text += String.fromCharCode(each);
        return btoa(text); })()"""
    compare("ds47.html", base64.b64decode(desk.run(made)), expected(REPORTS[0]))
    if os.environ.get("DS47_PICTURES"):
        desk.picture(Path(os.environ["DS47_PICTURES"]) / f"bare-{type(desk).__name__}.png")


TRIED: dict[str, Callable[[Roots, Path], None]] = {
    "python": try_python,
    "wheelhouse": try_wheelhouse,
    "container": try_container,
    "chromium": try_chromium,
    "firefox": try_firefox,
}


def bring(names: list[str]) -> Roots:
    """The roots for what is tried."""
    wanted = [root for name in names for root in ROOTS.get(name, (name,))]
    done = subprocess.run(
        [pins.ROOT / "tools" / "bare-roots.sh", *wanted], stdout=subprocess.PIPE, text=True
    )
    if done.returncode:
        sys.exit(done.returncode)
    return {
        name: Path(root) for name, root in (line.split(" ", 1) for line in done.stdout.splitlines())
    }


def released(names: list[str]) -> None:
    """SystemExit where a file of the release is missing or is not what its checksum says."""
    wanted = {
        "python": "ds47.pyz", "chromium": "ds47.html", "firefox": "ds47.html",
        "wheelhouse": "ds47-*-wheelhouse.zip", "container": "ds47-*-wheelhouse.zip",
    }  # fmt: skip
    sums = DIST / "SHA256SUMS"
    told = sums.read_text("utf-8").splitlines() if sums.exists() else []
    listed = dict(reversed(line.split("  ")) for line in told)
    for pattern in {wanted[name] for name in names}:
        found = [*DIST.glob(pattern)]
        if len(found) != 1:
            sys.exit(f"{DIST}: no {pattern}, or several; make release writes it")
        digest = hashlib.sha256(found[0].read_bytes()).hexdigest()
        if told and listed.get(found[0].name) != digest:
            sys.exit(f"{found[0]} is not what {sums.name} says")


def shut_in(names: list[str], roots: Roots) -> int:
    """Everything again, where there is no network and where mounts end with the process."""
    with tempfile.TemporaryDirectory(prefix="tried-", dir=pins.ROOT / "build" / "bare") as work:
        told = {"work": work, **{name: str(root) for name, root in roots.items()}}
        command = ["unshare", "--net", "--mount", "--propagation", "private"]
        environment = {**os.environ, INSIDE: json.dumps(told)}
        done = subprocess.run([*command, sys.executable, __file__, *names], env=environment)
    return done.returncode


def loopback() -> None:
    """Browsers are spoken to by 127.0.0.1. SystemExit where there is any other device."""
    devices = [name for _, name in socket.if_nameindex()]
    if devices != ["lo"]:
        sys.exit(f"not without network: {', '.join(devices)}")
    up, set_flags = 0x1, 0x8914
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        fcntl.ioctl(asked, set_flags, struct.pack("16sh14x", b"lo", up))


def furnish(root: Path, work: Path) -> None:
    """What every system has, and the files that are tried, at the path that they have outside."""
    mount("--rbind", root, root)
    mount("-t", "proc", "proc", root / "proc")
    mount("--rbind", "/dev", root / "dev")
    mount("-t", "tmpfs", "tmpfs", root / "tmp")
    place = Path(f"{root}{work}")
    place.mkdir(parents=True, exist_ok=True)
    mount("--rbind", work, place)


def inside(names: list[str], roots: Roots, work: Path) -> int:
    """Tries them, one after the other."""
    loopback()
    tempfile.tempdir = str(work)  # of the browsers' profiles, too
    (work / "captures").mkdir()
    shutil.copy(pins.ROOT / "captures" / CAPTURE, work / "captures")
    for name in ("ds47.pyz", "ds47.html"):
        if (DIST / name).exists():
            shutil.copy(DIST / name, work)
    for name, root in roots.items():
        if name != "base":  # that is only copied
            furnish(root, work)
    for name in names:
        begun = time.monotonic()
        TRIED[name](roots, work)
        took = time.monotonic() - begun
        print(f"{name}: the report equals that of the command ({took:.1f} s)", flush=True)
    return 0


def main() -> int:
    names = sys.argv[1:] or list(TRIED)
    unknown = set(names) - set(TRIED)
    if unknown:
        sys.exit(f"no such thing to try: {', '.join(sorted(unknown))}")
    if INSIDE in os.environ:
        told = {name: Path(path) for name, path in json.loads(os.environ.pop(INSIDE)).items()}
        return inside(names, told, told.pop("work"))
    released(names)
    return shut_in(names, bring(names))


if __name__ == "__main__":
    sys.exit(main())
