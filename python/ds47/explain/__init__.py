"""Codes as people meet them: a text such as `DE80B500` or `107` to what it may mean.

Two steps: `forms` turns a text into numbers, `meanings` looks the numbers up. Pure: no files but the tables of
`ds47.spec`, no output; how what is found is laid out is `ds47.report.explanation`.
"""

from ds47.explain.answer import BlockOutputs, CodeMeaning, Reason
from ds47.explain.forms import Reading, UnknownFormError, read
from ds47.explain.makers import find_vendor
from ds47.explain.meanings import explain

__all__ = [
    "BlockOutputs", "CodeMeaning", "Reading", "Reason", "UnknownFormError", "explain", "find_vendor", "read",
]  # fmt: skip
