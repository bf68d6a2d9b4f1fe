"""The summary of captures as JSON (`--summary -f json`): the schema is schema/summary-1.schema.json."""

from __future__ import annotations

from typing import Any, Final

from ds47.report.bilingual import Both
from ds47.report.digest import Digest, ShortCause, Who
from ds47.report.digests import Digests
from ds47.report.json import laid_out
from ds47.version import __version__

SCHEMA: Final = "ds47.summary/1"


class Writer(Digests):
    """Keeps a digest of each capture, and writes one document at the end."""

    def close(self) -> None:
        document = {
            "schema": SCHEMA,
            "tool": {"name": "ds47", "version": __version__},
            "level": self.level,
            "verdict": self._text(self.verdict),
            "captures": [self._capture(each) for each in self.captures],
            "unreadable": [{"path": path, "problem": problem} for path, problem in self.problems],
        }  # fmt: skip
        self.stream.write(laid_out(document))

    def _capture(self, digest: Digest) -> dict[str, Any]:
        return {
            "path": digest.path,
            "level": digest.level,
            "verdict": self._text(digest.verdict),
            "frames": digest.counts.frames,
            "start": digest.start,
            "end": digest.end,
            "narrowed": None if digest.narrowed is None else self._text(digest.narrowed),
            "transactions": digest.counts.jobs,
            "failed": digest.counts.failed,
            "unknown": digest.counts.open,
            "states": dict(digest.counts.states),
            "causes": [self._cause(each) for each in digest.causes],
            "causes_left_out": digest.left_out,
            "drives": [self._who(each) for each in digest.drives],
        }

    def _cause(self, cause: ShortCause) -> dict[str, Any]:
        return {
            "rule": cause.rule,
            "severity": cause.severity,
            "message": self._text(cause.message),
            "advice": self._text(cause.advice),
            "findings": cause.findings,
            "alike": cause.alike,
            "frame": cause.frame,
            "transaction": cause.transaction,
        }

    def _who(self, item: Who) -> dict[str, Any]:
        return {
            "ip": item.device.ip,
            "station": item.device.station,
            "transactions": self._text(item.transactions),
        }

    def _text(self, text: Both) -> str:
        return text.text(self.options.lang)
