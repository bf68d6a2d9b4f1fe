"""The docstrings of a result's classes in the compiled package: mypyc keeps their signatures, but no words.

They are taken from the sources, which lie beside the extension modules. Plain Python needs nothing of this.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from types import GetSetDescriptorType
from typing import Any

_COMPILED = ("ds47.model", "ds47.profidrive.model")
"""The modules of the public classes that hatch_build.py compiles."""


@cache
def restore() -> None:
    """Gives classes, and properties of them, the docstrings of their sources; once, and where a source is."""
    for name in _COMPILED:
        module = import_module(name)
        file = Path(module.__file__ or "")
        source = file.with_name(f"{name.rpartition('.')[2]}.py")
        if file == source or not source.is_file():
            continue
        for node in ast.parse(source.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                _describe(getattr(module, node.name), node)


def _describe(described: Any, node: ast.ClassDef) -> None:
    described.__doc__ = ast.get_docstring(node)
    for each in node.body:
        if isinstance(each, ast.FunctionDef):
            own = vars(described).get(each.name)
            if isinstance(own, GetSetDescriptorType):  # what mypyc makes of a property
                setattr(described, each.name, property(own.__get__, doc=ast.get_docstring(each)))
