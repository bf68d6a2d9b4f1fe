#!/usr/bin/env python3
"""Writes the whole analyzer as one page for a browser without network: dist/ds47.html.

    python tools/release/make_page.py [FOLDER]        (make page)

In it are Python for browsers (Pyodide, by version and digest of its npm package), what ds47.pyz has, and the page
itself (page/). Equal sources give equal bytes.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import make_pyz
import pins
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ds47.regression import difference_page
from ds47.report import digest_page, html
from ds47.report.html import embed, shell

SOURCES = Path(__file__).resolve().parent / "page"
SAMPLE = "tour-machine.pcapng"
"""What the page shows to who has no capture at hand."""
MOST = 15_000_000
"""Bytes of the page: it goes by mail."""
PYODIDE, VERSION = "pyodide", "314.0.7"
INTEGRITY = "sha512-0YvXxEhfEdpLfb/XkM2BFAeMROq0iMUX2bzzH9pOttyMcWkwq+HbE5uyuGD82LN7y2q+SNvi/6V5JEsOlD2R1A=="
RUNTIME = (
    "pyodide.mjs",
    "pyodide.asm.mjs",
    "pyodide.asm.wasm",
    "python_stdlib.zip",
    "pyodide-lock.json",
)
UNUSED = ("ds47/wireshark/plugin/", "ds47/batch/cluster.py", "ds47/lab/")
"""What nobody can use in a browser: there is no tshark there, and no other machine."""
POLICY = (
    "default-src 'none'; script-src {} 'wasm-unsafe-eval' blob:; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; frame-src blob:; connect-src 'none'; "
    "base-uri 'none'; form-action 'none'"
)
"""Nothing can be asked of any other machine, and no script runs but ours, whatever a capture has in it."""
WRITTEN = (html.SCRIPTS, difference_page.SCRIPTS, digest_page.SCRIPTS)
"""The scripts of all pages that ds47 writes: a page that is shown inside another one has its policy as well."""


def runtime() -> dict[str, bytes]:
    """The files of Pyodide that a page needs. SystemExit where the package is not the one that is pinned."""
    npm = shutil.which("npm")
    folder = pins.BUILD / "npm"
    package = folder / f"{PYODIDE}-{VERSION}.tgz"
    if not package.exists():
        if npm is None:
            sys.exit("npm is missing (Debian: npm): it fetches Python for browsers")
        folder.mkdir(parents=True, exist_ok=True)
        command = [
            npm,
            "pack",
            f"{PYODIDE}@{VERSION}",
            "--pack-destination",
            str(folder),
            "--silent",
        ]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    found = "sha512-" + base64.b64encode(hashlib.sha512(package.read_bytes()).digest()).decode()
    if found != INTEGRITY:
        sys.exit(f"{package}: {found} is not {INTEGRITY}")
    with tarfile.open(package) as archive:
        return {name: _member(archive, f"package/{name}") for name in RUNTIME}


def _member(archive: tarfile.TarFile, name: str) -> bytes:
    member = archive.extractfile(name)
    assert member is not None
    return member.read()


def parts() -> dict[str, bytes]:
    """What the worker gets: name -> content."""
    wheels = [pins.own(), *pins.download(make_pyz.LIBRARIES, pins.BUILD / "wheels")]
    ours = {
        name: data
        for name, data in make_pyz.contents(wheels).items()
        if name != "__main__.py" and not name.startswith(UNUSED)
    }
    held = runtime()
    lock = json.loads(held["pyodide-lock.json"]) | {
        "packages": {}
    }  # none of its own packages is taken
    return {
        **held,
        "pyodide-lock.json": json.dumps(lock, sort_keys=True).encode(),
        "ds47.zip": make_pyz.archive(ours),
        "run.py": (SOURCES / "run.py").read_bytes(),
    }


def packed(data: bytes) -> str:
    """As a script element holds it: gzip in base64."""
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode("ascii")


def policy() -> str:
    """The policy of the page, with its own scripts and those of the reports that it shows."""
    own = [_source("old.js"), _source("page.js")]
    written = [shell.script_of(shell.environment(), each) for each in WRITTEN]
    return POLICY.format(" ".join(map(embed.source_of, own + written)))


def page(held: dict[str, bytes]) -> str:
    """The page with these parts."""
    words: dict[str, dict[str, str]] = tomllib.loads((SOURCES / "texts.toml").read_text("utf-8"))
    templates = Environment(
        loader=FileSystemLoader(SOURCES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    both = Markup('<span lang="en">{}</span><span lang="zh">{}</span>')
    drop = templates.get_template("drop.html.j2").module.drop  # type: ignore[attr-defined]

    def spans(key: str) -> Markup:
        return both.format(words[key]["en"], words[key]["zh"])

    look = pins.ROOT / "python" / "ds47" / "report" / "templates" / "report" / "page.css"
    known: dict[str, Any] = {
        "version": pins.version(),
        "policy": policy(),
        "style": Markup(look.read_text("utf-8") + _source("page.css")),
        "old": Markup(_source("old.js")),
        "script": Markup(_source("page.js")),
        "worker": Markup(_source("worker.js")),
        "words": Markup(json.dumps(words, ensure_ascii=False).replace("<", "\\u003c")),
        "parts": [(name, Markup(packed(data))) for name, data in held.items()],
        "licences": _source("licences.txt"),
        "t": spans,
        "plain": lambda key: words[key]["en"],
        "drop": lambda kind, text, **more: drop(
            spans, kind, text, *map(more.get, ("folder", "sample"))
        ),
        "sample": Markup(packed((pins.ROOT / "captures" / SAMPLE).read_bytes())),
        "sample_name": SAMPLE,
    }
    return templates.get_template("page.html.j2").render(known)


def _source(name: str) -> str:
    text = (SOURCES / name).read_text("utf-8")
    if "</script" in text.lower() or "</style" in text.lower():
        raise ValueError(f"{name} would end its element")
    return text


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else pins.ROOT / "dist"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "ds47.html"
    path.write_text(page(parts()), "utf-8", newline="\n")
    size = path.stat().st_size
    print(f"{path}: {size // 1024} KiB")
    if size > MOST:
        sys.exit(f"{path} is larger than {MOST} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
