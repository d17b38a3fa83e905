"""Units of the numbers that outcomes carry: SI in values and files, handier ones in sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """How a number is kept and how a sentence shows it.

    Attributes:
        symbol: SI unit of the value, as files name it; empty for a count.
        shown: Unit in sentences.
        scale: Factor from the value to the number that is shown.
        spec: Format of the number that is shown, unless a sentence asks for another one.
    """

    symbol: str
    shown: str
    scale: float = 1.0
    spec: str = ".0f"

    def text(self, value: float, spec: str = "") -> str:
        """The number with its unit: ``31 mm``.

        Args:
            value: The number, in SI units.
            spec: A format, instead of the unit's own.
        """
        return f"{value * self.scale:{spec or self.spec}} {self.shown}".rstrip()


METRES = Unit("m", "mm", 1000.0)
RADIANS = Unit("rad", "degrees", 180.0 / math.pi, ".1f")
SECONDS = Unit("s", "s", 1.0, ".3g")
MILLISECONDS = Unit("s", "ms", 1000.0)
"""For short times; the value is in seconds."""
NEWTONS = Unit("N", "N")
NEWTON_METRES = Unit("Nm", "Nm", 1.0, ".1f")
METRES_PER_SECOND = Unit("m/s", "mm/s", 1000.0)
RADIANS_PER_SECOND = Unit("rad/s", "degrees/s", 180.0 / math.pi)
SHARE = Unit("1", "%", 100.0)
"""From 0 to 1."""
COUNT = Unit("", "")
"""A number of things."""
