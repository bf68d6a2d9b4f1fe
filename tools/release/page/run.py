"""Runs one command of ds47 inside the page, as a shell would: arguments in; status, output and messages out."""

import io
import json
import os
import sys

sys.path.insert(0, "/lib/ds47")
os.environ |= {"NO_COLOR": "1", "DS47_PARAMS": "/lists", "HOME": "/home"}


def run(argv: str) -> str:
    """One command; `argv` and what comes back are JSON."""
    from ds47.cli import main

    os.chdir("/captures")
    streams = sys.stdin, sys.stdout, sys.stderr
    out, err = io.BytesIO(), io.BytesIO()
    sys.stdin = io.TextIOWrapper(io.BytesIO(), "utf-8")
    sys.stdout = io.TextIOWrapper(out, "utf-8", "backslashreplace", newline="\n")
    sys.stderr = io.TextIOWrapper(err, "utf-8", "backslashreplace", newline="\n")
    try:
        try:
            status = main(json.loads(argv))
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        sys.stdout.flush()
        sys.stderr.flush()
        texts = [each.getvalue().decode("utf-8", "replace") for each in (out, err)]
    finally:
        sys.stdin, sys.stdout, sys.stderr = streams
    return json.dumps({"status": status, "stdout": texts[0], "stderr": texts[1]})
