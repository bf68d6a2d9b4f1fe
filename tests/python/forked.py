"""The command in a process of its own that has imported it already: forked from one that did so once.

For tests that look at what a command says. What is about the process itself (signals, consoles, how long a start
takes) starts one.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NoReturn

PATIENCE = 120


@cache
def _parent() -> subprocess.Popen[bytes]:
    command = [sys.executable, "-X", "utf8", __file__]
    made = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    atexit.register(made.communicate)  # it ends when nothing more can be asked
    return made


def ds47(
    *arguments: str, cwd: Path, env: Mapping[str, str], data: bytes = b""
) -> subprocess.CompletedProcess[bytes]:
    """Its exit status, output and errors, as `subprocess.run` gives them."""
    if not hasattr(os, "fork"):
        command = [sys.executable, "-X", "utf8", "-m", "ds47", *arguments]
        return subprocess.run(
            command, cwd=cwd, env=env, input=data, capture_output=True, check=False
        )
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("in", "out", "err")]
        files[0].write_bytes(data)
        asked = {
            "arguments": arguments,
            "cwd": str(cwd),
            "env": dict(env),
            "files": [*map(str, files)],
        }
        given, told = _parent().stdin, _parent().stdout
        assert given
        assert told
        given.write(json.dumps(asked).encode() + b"\n")
        given.flush()
        status = int(told.readline())
        output, errors = (each.read_bytes() for each in files[1:])
        return subprocess.CompletedProcess(arguments, status, output, errors)


def _run(arguments: list[str], cwd: str, env: dict[str, str], files: list[str]) -> NoReturn:
    """What the child does."""
    signal.alarm(PATIENCE)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    time.tzset()
    modes = (os.O_RDONLY, os.O_WRONLY | os.O_CREAT, os.O_WRONLY | os.O_CREAT)
    for number, (path, mode) in enumerate(zip(files, modes, strict=True)):
        os.dup2(os.open(path, mode), number)
    status = 1
    try:
        status = import_module("ds47.cli").main(arguments)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001  as Python itself
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status or 0)


def _serve() -> None:
    for command in import_module("ds47.cli").COMMANDS:
        import_module(f"ds47.cli.{command}")
    for name in ("analysis", "diagnosis", "report.text", "report.json", "report.html"):
        import_module(f"ds47.{name}")
    replies = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            _run(**json.loads(line))
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), file=replies, flush=True)


if __name__ == "__main__":
    _serve()
