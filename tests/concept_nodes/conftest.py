"""Batches of real and perturbed situations, and the claim that a pure function treats them one by one."""

from __future__ import annotations

from typing import Any

import pytest

from bt_tasksim.checking.bundles import frozen
from bt_tasksim.checking.situations import Situations
from bt_tasksim.concept.model import ConceptModel

TOLERANCE = 1e-9
FUNCTIONS = (
    "command", "done", "necessary_cost", "violated", "maintained", "advance", "sufficient_cost", "act",
)  # fmt: skip


class Near(Situations):
    """Situations of a leaf that tests make claims about."""

    def check(self, name: str, leaf: Any = None, tolerance: float = TOLERANCE) -> list[Any]:
        """One by one, as a batch and as a batch in torch the answers are the same, and nothing changes."""
        before = frozen((self.single, self.batch, self.torch))
        assert not self.differences(name, leaf, tolerance)
        answers = [self.ask(name, s, leaf) for s in self.single]
        assert frozen((self.single, self.batch, self.torch)) == before, f"{name} changed what it was given"
        return answers


@pytest.fixture(scope="session")
def functions():
    """Names of the pure functions of a concept that answer at every tick."""
    return FUNCTIONS


@pytest.fixture(scope="session")
def situations(recorded_run):
    """Situations of the first leaf of a concept in a scenario: ``situations(Grasp, "pick_and_place")``."""
    kept: dict[Any, Near] = {}

    def get(concept: type[ConceptModel], scenario: str = "pick_and_place", seed: int = 1) -> Near:
        key = concept, scenario, seed
        if key not in kept:
            found = [d for d in recorded_run(scenario, seed) if type(d.leaf) is concept]
            kept[key] = Near([*found[:: max(1, len(found) // 12)], found[-1]])
        return kept[key]

    return get
