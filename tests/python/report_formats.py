"""The formats of the report as tests take them: a new one is in each list that it belongs to."""

from __future__ import annotations

from importlib import import_module

from ds47.report import FORMATS

PRINTED = tuple(name for name in FORMATS if name != "parquet")
"""Those that are text: stdout takes them."""
STREAMED = tuple(name for name in PRINTED if import_module(f"ds47.report.{name}").Writer.streams)
"""Those of them that are written while a capture is read."""
