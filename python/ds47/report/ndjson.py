"""Report as NDJSON: one object a line, written when its transaction is finished.

Two kinds of line, both of the contract `ds47.report/2` (`$defs/line` of the schema):

    {"path": ..., "transaction": {...}, "findings": [...]}     in order of completion
    {"path": ..., "capture": {...}}                            the end of a capture

The second has the capture's keys but its transactions; its findings are those that were not in a
line before. Holds nothing between two lines. The lines are written by `ds47.report.json`, as the same objects.
"""

from __future__ import annotations

from ds47.report.json import LineWriter

Writer = LineWriter
