"""What only the analyzer says: diagnoses of the whole capture, which Wireshark has not while it shows a frame, and
what is about control and status words of drives.

Whatever compares the analyzer with the Lua half leaves them out with the one function that is here.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ds47.spec import rules


def of_transactions(told: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings or diagnoses of a report without those that only the whole capture can show."""
    whole = {rule.id for rule in rules().values() if not rule.in_wireshark}
    return [each for each in told if each["rule"] not in whole]
