"""Report as NDJSON: one object a line, written when its transaction is finished.

Two kinds of line, both of the contract `ds47.report/2` (`$defs/line` of the schema):

    {"path": ..., "transaction": {...}, "findings": [...]}     in order of completion
    {"path": ..., "capture": {...}}                            the end of a capture

The second has the capture's keys but its transactions; its findings are those that were not in a
line before. Holds nothing between two lines. The objects themselves come from `ds47.report.json`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar, TextIO

from ds47.model import CaptureResult, Finding, Report, Transaction
from ds47.report import ReportOptions, json, write_all
from ds47.report import Writer as _Writer
from ds47.report.targets import Following, Telegrams


def write(report: Report, stream: TextIO, options: ReportOptions | None = None) -> None:
    """Writes a complete report line by line."""
    write_all(Writer(stream, options), report)


@lru_cache(maxsize=16)
def _path(path: str) -> str:
    return json.text(path)


class Writer(_Writer):
    """Writes lines as things are finished."""

    streams: ClassVar[bool] = True

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._telegrams = Following()

    def whole(self, result: CaptureResult) -> None:
        Telegrams.tell(result)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        lang = self.options.lang
        self._telegrams.tell(path, transaction)
        line = json.transaction_line(transaction, lang)
        about = json.text([json.finding(each, lang) for each in findings]) if findings else "[]"
        self.stream.write(
            f'{{"path": {_path(path)}, "transaction": {line}, "findings": {about}}}\n'
        )

    def capture(self, result: CaptureResult) -> None:
        whole = json.capture(result, self.options.lang)
        del whole["transactions"]
        self.stream.write(json.text({"path": result.path, "capture": whole}) + "\n")
