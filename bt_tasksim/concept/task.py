"""A recognised task, and what a log decomposes into."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import networkx as nx
import numpy as np

from demos_decomp.log import Floats


@dataclass(frozen=True)
class Task:
    """One task of a demonstration.

    Attributes:
        concept: Name of the concept: grasp, pick, bring, place, release.
        start: Second at which it begins, on the demonstration's clock.
        end: Second at which it ends.
        confidence: Probability in [0, 1] that all decisions behind it would come out again as they did if
            sensor noise and the slack of the model were drawn anew (`demos_decomp.evidence`).
        parameters: By name, metres and unit vectors in the robot base frame unless stated otherwise:

            * grasp: ``target``; ``approach`` (3), the direction from which the hand comes; ``closing`` (3),
              the hand's opening axis in the target's frame, its sign chosen so that its largest component
              is positive;
            * pick: ``target``, ``direction`` (3), ``distance``, ``off`` (where known);
            * bring: ``target``; ``to``, or ``position`` (3) of the target where it ends nowhere known;
              ``via``, positions (3) of the target relative to the origin of ``to`` (or to ``position``)
              that a polyline needs to stay within 2 cm of the path, without its two ends;
            * place: ``target``, ``direction`` (3), ``distance``, ``on`` (or ``position`` (3), as above);
            * release: ``target``; ``into``, only where it was let go over or in a bin.
        reasons: The decisions behind it, in words, each with its probability.
        path: ``(32, 3)`` positions of a brought target, evenly spaced along its way, relative to the origin
            that ``via`` is relative to; None for other concepts.
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


@dataclass(frozen=True)
class Decomposition:
    """What a log decomposes into.

    Attributes:
        tasks: Tasks of the one demonstration, or the merged ones where there are several.
        graph: Concept instances and their order, see `demos_decomp.graph`.
        demonstrations: Tasks of every demonstration by its name.
        remarks: What was seen and not understood, for people, by demonstration.
    """

    tasks: tuple[Task, ...]
    graph: nx.DiGraph[str]
    demonstrations: Mapping[str, tuple[Task, ...]]
    remarks: Mapping[str, tuple[str, ...]]

    def to_json(self) -> dict[str, Any]:
        """``tasks`` and ``graph`` as plain JSON values, and the tasks of each demonstration if several."""
        from demos_decomp.graph import graph_to_json

        merged = len(self.demonstrations) > 1
        several = {name: [t.to_json() for t in tasks] for name, tasks in self.demonstrations.items()}
        return {
            "tasks": [task.to_json() for task in self.tasks],
            "graph": graph_to_json(self.graph),
            **({"demonstrations": several} if merged else {}),
            "remarks": {name: list(said) for name, said in self.remarks.items() if said},
        }


def plain(value: Any) -> Any:
    """A parameter as JSON: numbers to a tenth of a millimetre (or of a thousandth), arrays as lists."""
    if isinstance(value, str) or value is None:
        return value
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return (np.round(np.asarray(value, dtype=float), 4) + 0.0).tolist()
