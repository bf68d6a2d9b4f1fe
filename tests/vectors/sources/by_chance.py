"""Writes ../by_chance.json: what becomes of lines of S7 and PROFIBUS that are made by chance (seeded).

    .venv/bin/python tests/vectors/sources/by_chance.py

A second implementation said the same of all of it when the file was written first. So a difference is a fault,
or a change that was meant: look at the findings that differ before writing it anew.
"""

from __future__ import annotations

import io
import json
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "python")]

import s7_by_chance  # noqa: E402
import s7_bytes_by_chance as by_chance  # noqa: E402
import test_profibus_bus as line  # noqa: E402

from ds47 import lab  # noqa: E402
from ds47.analysis import AnalysisOptions, analyze  # noqa: E402
from ds47.model import CaptureResult  # noqa: E402
from ds47.report import json as report  # noqa: E402

TARGET = HERE.parent / "by_chance.json"
TOGETHER = 100
"""Messages that have one sum: so a difference is found in few of them."""
LINES = range(100, 140)


def check_sum(item: Any) -> str:
    return f"{zlib.crc32(json.dumps(item, sort_keys=True).encode()):08x}"


def sums(lines: list[dict[str, Any]]) -> list[str]:
    """The check sums of what the decoders say."""
    said = by_chance.decoded(lines)
    return [check_sum(said[at : at + TOGETHER]) for at in range(0, len(said), TOGETHER)]


def result(content: bytes, options: AnalysisOptions) -> CaptureResult:
    return analyze(io.BytesIO(content), options)


def told(content: bytes, options: AnalysisOptions) -> dict[str, Any]:
    """The findings of a capture, and check sums of all that is said beside them."""
    found = report.capture(result(content, options), "en")
    keys = ("operation", "state", "frames", "duration_ms", "r_id", "error", "items", "segments")
    jobs = [{key: each.get(key) for key in keys} for each in found["transactions"]]
    return {
        "jobs": f"{len(jobs)} {check_sum(jobs)}",
        "about": check_sum([found.get("connections"), found.get("bus")]),
        "findings": [
            f"{each['rule']} {each['frame']} {check_sum(each['args'])}"
            for each in found["findings"]
        ],
    }


def bus_lines() -> Iterator[bytes]:
    """Lines of PROFIBUS, some as two recorders hear them."""
    lines = [line.everything_wrong()]
    lines += [line.by_chance(seed)[0] for seed in LINES]
    lines += [line.twice(each) for each in lines[::4]]
    lines += [line.third_heard_twice(both) for both in (5, 6)]
    for each in lines:
        yield lab.captured(each.stage)


PARTS: dict[str, Callable[[], list[Any]]] = {
    "pdus": lambda: sums(by_chance.pdus_by_chance()),
    "talks": lambda: sums([*by_chance.talks_by_chance(), *by_chance.single_bytes()]),
    "questions": lambda: sums(by_chance.questions_by_chance()),
    "scenes": lambda: [told(*scene) for scene in s7_by_chance.scenes()],
    "lines": lambda: [told(content, AnalysisOptions()) for content in bus_lines()],
}


def text(found: dict[str, list[Any]]) -> str:
    """The file: a line for each entry."""
    parts = (
        f"{json.dumps(name)}: [\n" + ",\n".join(map(json.dumps, part)) + "\n]"
        for name, part in found.items()
    )
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    TARGET.write_text(text({name: part() for name, part in PARTS.items()}), encoding="utf-8")
