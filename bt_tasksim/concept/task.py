"""A task as it was seen in a demonstration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """One task of a demonstration.

    Attributes:
        concept: Name of the concept, in lower case.
        start: Second at which it begins, on the demonstration's clock.
        end: Second at which it ends.
        confidence: Probability in [0, 1] that all decisions behind it would come out again as they did if
            sensor noise and the slack of the model were drawn anew (`demos_decomp.evidence`).
        parameters: By name, metres and unit vectors in the robot base frame; the concept's `recognition`
            says which.
        reasons: The decisions behind it, in words, each with its probability.
        path: ``(32, 3)`` positions of a carried target, evenly spaced along its way, relative to the origin
            that its via-points are relative to; None for other concepts.
    """

    concept: str
    start: float
    end: float
    confidence: float
    parameters: Mapping[str, Any]
    reasons: tuple[str, ...] = ()
    path: Floats | None = field(default=None, repr=False, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Concept, start, end, confidence and parameters as plain numbers, lists and strings."""
        return {
            "concept": self.concept,
            "start": round(self.start, 3),
            "end": round(self.end, 3),
            "confidence": round(self.confidence, 4),
            "parameters": {name: plain(value) for name, value in self.parameters.items()},
        }


def plain(value: Any) -> Any:
    """A parameter as JSON: numbers to a tenth of a millimetre (or of a thousandth), arrays as lists."""
    if isinstance(value, str) or value is None:
        return value
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return (np.round(np.asarray(value, dtype=float), 4) + 0.0).tolist()
