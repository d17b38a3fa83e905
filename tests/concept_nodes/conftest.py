"""Situations of real and perturbed worlds, and the claim that a pure function treats them one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bt_tasksim.checking.bundles import different, frozen
from bt_tasksim.checking.questions import QUESTIONS
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Seen

TOLERANCE = 1e-9
FUNCTIONS = (
    "initial_state", "begin", "command", "done", "necessary_cost", "violated", "limits", "maintained",
    "advance", "carry_out", "sufficient_cost", "explain",
)  # fmt: skip


class Near(Situations):
    """Situations of a concept that tests make claims about."""

    def ask(self, name: str, situation: Situation, model: Any = None, seen: Seen | None = None) -> Any:
        """See `Situations.ask`; a condition is asked whether it holds."""
        if isinstance(model, Condition):
            return model.holds(self.asked(situation, seen).seen)
        return super().ask(name, situation, model, seen)

    def check(self, name: str, model: Any = None, tolerance: float = TOLERANCE) -> list[Any]:
        """Each world gets the same bits alone and in any company, nearly the same numbers in torch, and
        nothing changes; gives what each gets alone."""
        import torch

        before = frozen((self.single, self.batch, self.torch))
        asked = np.array(self.asking(name))
        alone = {k: self.ask(name, self.single[k], model) for k in asked.tolist()}
        mixed = np.random.default_rng(len(asked)).permutation(asked)
        orders = (asked, mixed, mixed[: len(mixed) // 2], asked[::-1])
        for rows in orders[1:3] if name == "begin" else orders:  # it plans anew in each of them
            many = self.ask(name, self.batch.at(rows), model)
            assert not different(name, [alone[k] for k in rows.tolist()], many, 0.0)
        tensors = self.ask(name, self.torch.at(torch.from_numpy(asked)), model)
        words = name in QUESTIONS and QUESTIONS[name].words
        assert not different(name, list(alone.values()), tensors, tolerance, None if words else torch.Tensor)
        assert frozen((self.single, self.batch, self.torch)) == before, f"{name} changed what it was given"
        return list(alone.values())


@pytest.fixture(scope="session")
def functions():
    """Names of the pure functions of a concept that are asked at its begin and at every tick."""
    return FUNCTIONS


@pytest.fixture(scope="session")
def situations(recorded_run):
    """Situations of the first leaf of a concept in a scenario: ``situations(Grasp, "pick_and_place")``."""
    kept: dict[Any, Near] = {}

    def get(concept: type[ConceptModel], scenario: str = "pick_and_place", seed: int = 1) -> Near:
        key = concept, scenario, seed
        if key not in kept:
            found = [d for d in recorded_run(scenario, seed) if type(d.leaf.model) is concept]
            kept[key] = Near([*found[:: max(1, len(found) // 12)], found[-1]])
        return kept[key]

    return get
