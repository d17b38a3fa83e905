"""What is read of a group of worlds in one transfer, and which columns of it are what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array


@dataclass(frozen=True)
class Columns:
    """Where things are in a report.

    Attributes:
        first: First column, by name.
        count: Number of columns, by name.
    """

    first: dict[str, int]
    count: dict[str, int]

    @classmethod
    def of(cls, widths: Mapping[str, int]) -> Columns:
        """One thing behind the other."""
        ends = np.cumsum([0, *widths.values()]).tolist()
        return cls(dict(zip(widths, ends, strict=False)), dict(widths))

    @property
    def width(self) -> int:
        """Number of all columns."""
        return sum(self.count.values())

    def floats(self, report: Array, name: str) -> Array:
        """Numbers ``(k, n)`` of rows of a report, in double precision."""
        return self._of(report, name).view(np.float32).astype(float)

    def integers(self, report: Array, name: str) -> Array:
        """Whole numbers ``(k, n)`` of rows of a report."""
        return self._of(report, name)

    def _of(self, report: Array, name: str) -> Array:
        return np.ascontiguousarray(report[:, self.first[name] : self.first[name] + self.count[name]])
