"""Units of the numbers that outcomes carry: SI in values and files, handier ones in sentences."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
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


@dataclass(frozen=True)
class Measured:
    """A number as one sentence shows it.

    Attributes:
        value: The number, in SI units.
        unit: Its unit.
        spec: A format, instead of the unit's own.
    """

    value: float
    unit: Unit
    spec: str = ""

    def text(self, digits: int = 0) -> str:
        """The number with its unit, with so many digits more than its format has."""
        spec = self.spec or self.unit.spec
        if digits:
            front, _, end = spec.rstrip("efgEFG%").partition(".")
            kind = spec[len(spec.rstrip("efgEFG%")) :]
            spec = f"{front}.{int(end or 6) + digits}{kind}"
        return self.unit.text(self.value, spec)


MORE_DIGITS = 6
"""Digits beyond those of its format that a number gets at most, see `told_apart`."""


def told_apart(numbers: Sequence[Measured]) -> list[str]:
    """The texts of one sentence's numbers: those that differ and would read alike get more digits.

    Every number of such a group gets as many more as they need, up to `MORE_DIGITS`; if they are alike
    even then, they keep their format.
    """
    texts = [number.text() for number in numbers]
    for text, count in Counter(texts).items():
        alike = [i for i, other in enumerate(texts) if other == text]
        values = {numbers[i].value for i in alike if math.isfinite(numbers[i].value)}
        if count < 2 or len(values) < 2:
            continue
        longer = ([numbers[i].text(more) for i in alike] for more in range(1, MORE_DIGITS + 1))
        best = max(longer, key=lambda found: len(set(found)))
        if len(set(best)) > 1:
            for i, found in zip(alike, best, strict=True):
                texts[i] = found
    return texts


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


def degrees_meant(value: float) -> str:
    """What to add to a sentence about an angle in radians that is more than a turn; empty for others.

    Args:
        value: The angle, radians.
    """
    if not 2.0 * math.pi + 1e-9 < abs(value) < math.inf:
        return ""
    return f": values are radians, and {value:g} degrees are {math.radians(value):.3g}"
