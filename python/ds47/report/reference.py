"""What 100 % of a setpoint is: p2000 of a drive, given by the user or read in the capture.

`ds47.report.timelines` looks for it and words it.
"""

from __future__ import annotations

from typing import NamedTuple


class Reference(NamedTuple):
    """What 100 % is: values with their units, and the frame that said so; None where a person did."""

    values: tuple[tuple[float, str], ...]
    frame: int | None = None

    def shown(self, percent: float) -> str:
        """So much of it, as `25 Hz, 698 rpm`."""
        return ", ".join(
            f"{value * percent / 100:.4g} {unit}".rstrip() for value, unit in self.values
        )
