"""What makes text and data safe inside a page: JSON, packed data, script, style and policy.

Nothing of the report is known here.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json

from markupsafe import Markup

PACK_FROM = 200_000
"""Characters from which on data is packed: a mail takes the page, and browsers unpack quickly."""
_UNSAFE = ("<", ">", "&", "\u2028", "\u2029")
_NOWHERE = b"\x00\xff"
_LEVEL = 4
"""Of the compression: most of what level 9 saves, in a fifth of its time."""


def as_json(item: object) -> Markup:
    """JSON that no text in it can end early, for a script element of a data type."""
    text = _dumps(item)
    for char in _UNSAFE:
        text = text.replace(char, f"\\u{ord(char):04x}")
    return Markup(text)  # nothing is left that HTML would see


def _dumps(item: object) -> str:
    return json.dumps(item, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def packed(text: str) -> str:
    """A text as gzip in base64; the same text gives the same."""
    data = gzip.compress(text.encode("utf-8", "backslashreplace"), _LEVEL, mtime=0)
    # The head names the level and the system, and later Pythons name them otherwise.
    return base64.b64encode(data[:8] + _NOWHERE + data[10:]).decode("ascii")


def data_element(name: str, item: object) -> Markup:
    """A script element that holds data: plain where it is short, else packed."""
    text = _dumps(item)
    if len(text) >= PACK_FROM:
        start = Markup('<script type="application/gzip" id="{}">').format(name)
        return start + packed(text) + _END
    return Markup('<script type="application/json" id="{}">').format(name) + as_json(item) + _END


_END = Markup("</script>\n")


def safe_script(source: str) -> Markup:
    """A script of ours as it stands in its element."""
    if "</script" in source.lower() or "<!--" in source:
        raise ValueError("the script would end its element")
    return Markup(source)  # our own file


def safe_style(source: str) -> Markup:
    """A style sheet of ours as it stands in its element."""
    if "</style" in source.lower():
        raise ValueError("the style sheet would end its element")
    return Markup(source)  # our own file


def policy(script: str) -> str:
    """The content security policy: nothing is loaded, and only this script runs."""
    return (
        f"default-src 'none'; script-src {source_of(script)}; style-src 'unsafe-inline'; "
        "img-src data:; font-src data:; base-uri 'none'; form-action 'none'"
    )


def source_of(script: str) -> str:
    """The word of a policy that lets this script run."""
    raw = hashlib.sha256(script.encode("utf-8", "backslashreplace")).digest()
    return f"'sha256-{base64.b64encode(raw).decode('ascii')}'"
