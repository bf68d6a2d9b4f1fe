"""The pages of the documentation that are made from the code: what there is, by name, and nothing else.

Here: which pages there are. Each module makes one of them as Markdown. Not here: pages that people write (docs/),
and where a page stands in the site (../mkdocs.yml).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from . import codes, command_line, fields, json_schema, parameters, python_names, rules

PAGES: Mapping[str, Callable[[Path], str]] = {
    "reference/commands.md": command_line.page,
    "reference/rules.md": rules.page,
    "reference/codes.md": codes.page,
    "reference/json.md": json_schema.page,
    "reference/fields.md": fields.page,
    "reference/known-parameters.md": parameters.page,
    "reference/python-names.md": python_names.page,
}
"""By their place below docs/: what makes the page, given the checkout."""
