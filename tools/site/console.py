"""A hook of mkdocs: in a console block a line that starts with ``$`` and a blank is a command, and no other one.

As the highlighter has it, ``#2`` at the start of a line of a report would be the prompt of root.
"""

from __future__ import annotations

import re

from pygments.lexers.shell import BashSessionLexer

BashSessionLexer._ps1rgx = re.compile(r"^(\$ )(.*\n?)")
