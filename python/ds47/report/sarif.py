"""SARIF 2.1.0: findings as CI servers and editors show the results of an analysis.

A capture has no lines; its rows in Wireshark's list of packets are the frames, so a result's
`startLine` is its frame (servers insist on a line). The fingerprint of a finding says what was
asked of whom, not when and in which frame: it stays the same when a test is recorded again.

Results are written as they come, the rules that they name after them. In a report, a capture that
could not be read as a whole is a notification of the tool.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, TextIO
from urllib.parse import quote

from ds47 import spec
from ds47.model import CaptureResult, Finding, Transaction
from ds47.report import ReportOptions
from ds47.report import Writer as _Writer
from ds47.report.json import text
from ds47.report.sentences import message
from ds47.version import __version__

FINGERPRINT = "ds47/v1"
"""How fingerprints are made: the name changes when that changes."""
_SEMANTIC_VERSION = __version__.replace(".dev", "-dev.")
_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_LEVELS = ("error", "warning", "note")
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
_LINK = re.compile(r"\[(?=[^\]]*\]\()")


@dataclass(frozen=True, slots=True)
class SarifResult:
    """One finding or change: `rule` is of the catalogue, or a kind of change.

    `subject` says what it is about in words that do not change from run to run; else the message
    does.
    """

    rule: str
    severity: str
    message: str
    path: str
    frame: int | None = None
    transaction: int | None = None
    subject: str | None = None


def write(results: Iterable[SarifResult], stream: TextIO) -> None:
    """Writes one run as a SARIF log; `results` may be a generator."""
    log = _Log(stream)
    for each in results:
        log.result(each)
    log.close()


class Writer(_Writer):
    """Writes a result per finding, as soon as it is there."""

    streams: ClassVar[bool] = True

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._log = _Log(stream)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        if findings:
            subject = _subject(transaction)
            for finding in findings:
                self._log.result(_finding(path, finding, subject, self.options.lang))

    def capture(self, result: CaptureResult) -> None:
        for finding in result.findings:
            self._log.result(_finding(result.path, finding, "", self.options.lang))
        if not result.complete or result.problem:
            problem = result.problem or "the file ends early"
            self._log.problem(result.path, f"only partly read: {problem}")

    def unreadable(self, path: str, problem: str) -> None:
        self._log.problem(path, problem)

    def close(self) -> None:
        self._log.close()


class _Log:
    """A SARIF log on its way into a stream; remembers which rules it named."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._rules: dict[str, int] = {}
        self._problems: list[dict[str, Any]] = []
        self._path: str | None = None
        self._seen: Counter[bytes] = Counter()
        self._separator = "\n"
        stream.write(
            f'{{"$schema": "{_SCHEMA}", "version": "2.1.0", "runs": [{{\n'
            '"columnKind": "unicodeCodePoints",\n"results": ['
        )

    def result(self, item: SarifResult) -> None:
        about = {
            "frame": item.frame,
            "transaction": item.transaction,
            "filter": None if item.frame is None else f"frame.number == {item.frame}",
        }
        entry = {
            "ruleId": item.rule,
            "ruleIndex": self._rules.setdefault(item.rule, len(self._rules)),
            "level": item.severity if item.severity in _LEVELS else "error",
            "message": _message(item.message),
            "locations": [_location(item.path, item.frame)],
            "partialFingerprints": {FINGERPRINT: self._fingerprint(item)},
            "properties": {key: value for key, value in about.items() if value is not None},
        }
        self._stream.write(self._separator + text(entry))
        self._separator = ",\n"

    def problem(self, path: str, problem: str) -> None:
        self._problems.append(
            {
                "level": "error",
                "message": _message(problem),
                "locations": [_location(path, None)],
            }
        )

    def close(self) -> None:
        invocation: dict[str, Any] = {"executionSuccessful": not self._problems}
        if self._problems:
            invocation["toolExecutionNotifications"] = self._problems
        rules = ",\n".join(text(_rule(name)) for name in self._rules)
        self._stream.write(
            f'],\n"invocations": [{text(invocation)}],\n'
            f'"tool": {{"driver": {{"name": "ds47", "version": "{__version__}", '
            f'"semanticVersion": "{_SEMANTIC_VERSION}", "rules": [\n{rules}]}}}}}}]}}\n'
        )

    def _fingerprint(self, item: SarifResult) -> str:
        """What the result is about, and which of those that are alike in this capture it is."""
        if item.path != self._path:
            self._path = item.path
            self._seen.clear()
        subject = item.message if item.subject is None else item.subject
        parts = "\0".join((item.rule, _uri(item.path), subject))
        digest = sha256(parts.encode("utf-8", "backslashreplace")).digest()[:16]
        self._seen[digest] += 1
        return f"{digest.hex()}:{self._seen[digest]}"


def _finding(path: str, item: Finding, subject: str, lang: str) -> SarifResult:
    text = f"Frame {item.frame}: {message(item, lang)}"
    return SarifResult(item.rule, item.severity, text, path, item.frame, item.transaction, subject)


def _subject(item: Transaction) -> str:
    """The request and its device: the same in another recording of the same test."""
    asked = [(each.pnu, each.subindex, each.attribute) for each in item.parameters]
    where = (item.device, item.api, item.slot, item.subslot, item.index, item.axis)
    return repr((item.operation, where, asked))


def _rule(name: str) -> dict[str, Any]:
    """A rule, with cause and advice where the catalogue has it; else a kind of change."""
    known = spec.rules().get(name)
    if known is None:
        return {"id": name, "shortDescription": _message(name.replace("_", " "))}
    return {
        "id": name,
        "name": known.name,
        "shortDescription": _message(known.name),
        "fullDescription": _message(known.cause),
        "help": _message(known.advice),
        "defaultConfiguration": {"level": known.severity},
    }


def _location(path: str, frame: int | None) -> dict[str, Any]:
    location: dict[str, Any] = {"artifactLocation": {"uri": _uri(path)}}
    if frame:
        location["region"] = {"startLine": frame}
    return {"physicalLocation": location}


def _message(text: str) -> dict[str, str]:
    """A text in which SARIF sees no placeholder and no link (2.1.0, 3.11.5 and 3.11.6)."""
    return {"text": _LINK.sub(r"\\[", text.replace("{", "{{").replace("}", "}}"))}


def _uri(path: str) -> str:
    """A path as a relative URI, or as a file URI where it is absolute; a URL stays one."""
    if path == "-":
        return "stdin"
    if _URL.match(path):
        return quote(path, safe="/:@?&=+%~")
    if Path(path).is_absolute():
        return Path(path).as_uri()
    return quote(os.fsencode(Path(path).as_posix()))
