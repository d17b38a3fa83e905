"""Situations that pure functions are asked about: from real runs, changed at random, in batches, in torch."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.checking.bundles import TOLERANCE, different, in_torch, shapes, stacked
from bt_tasksim.checking.perturbation import changed_hidden, changed_memory, changed_observation
from bt_tasksim.checking.questions import ACT, QUESTIONS, Asked
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, Observation, WorldModel
from bt_tasksim.robot.description import RobotDescription


class RecordedDecision(NamedTuple):
    """A leaf that is about to act in a real run.

    Attributes:
        leaf: The leaf.
        seen: What is seen.
        memory: Its memory.
        hidden: What only the simulator knows.
        began: The same when the leaf became active.
        first: It is the leaf's first one in this activation.
        run: Number of the run.
    """

    leaf: ConceptModel
    seen: Seen
    memory: Any
    hidden: Hidden
    began: Hidden
    first: bool = False
    run: int = 0


class Situation(NamedTuple):
    """What a pure function may be asked about; single, or with leading batch dimensions."""

    observation: Observation
    hidden: Hidden
    began: Hidden
    elapsed: Array
    memory: Any


def perturbed(situation: Situation, rng: np.random.Generator, memory: bool = True) -> Situation:
    """A situation, changed at random: elsewhere, otherwise felt, at another time.

    Args:
        situation: The one that is changed.
        rng: Random numbers.
        memory: Change the memory too; it may then be one that never happens.
    """
    observation = changed_observation(situation.observation, rng)
    hidden = changed_hidden(situation.hidden, rng)
    elapsed = np.float64(max(0.0, float(situation.elapsed) + rng.normal(scale=0.5)))
    changed = changed_memory(situation.memory, rng) if memory else situation.memory
    return Situation(observation, hidden, situation.began, elapsed, changed)


def alike(decisions: Sequence[RecordedDecision]) -> list[RecordedDecision]:
    """The most of them whose arrays have the same shapes.

    What a concept remembers may differ in size from run to run, such as a path's number of poses.
    """
    groups: dict[object, list[RecordedDecision]] = {}
    for decision in decisions:
        groups.setdefault(shapes(_situation(decision)), []).append(decision)
    return max(groups.values(), key=len, default=[])


def _situation(decision: RecordedDecision) -> Situation:
    seen = decision.seen
    return Situation(seen.observation, decision.hidden, decision.began, seen.elapsed, decision.memory)


class Situations:
    """Situations of one leaf, one by one and in batches.

    Args:
        decisions: What the leaf decided on in real runs; not empty, and all of one world model's shapes.
        seed: Of the changes.
        copies: How many changed copies there are of each.
        leaf: The leaf that is asked; by default that of the decisions.
    """

    def __init__(
        self,
        decisions: Sequence[RecordedDecision],
        seed: int = 0,
        copies: int = 2,
        leaf: ConceptModel | Condition | None = None,
    ) -> None:
        rng = np.random.default_rng(seed)
        first = decisions[0]
        self.leaf: ConceptModel | Condition = first.leaf if leaf is None else leaf
        self.world: WorldModel = first.seen.world
        self.robot: RobotDescription = first.seen.robot
        self.single = [_situation(d) for d in decisions]
        self.real = len(self.single)
        """So many are as they were; those after them are changed."""
        self.single += [perturbed(s, rng) for s in self.single for _ in range(copies)]

    @cached_property
    def batch(self) -> Situation:
        """All of them, with one leading batch dimension."""
        made: Situation = stacked(self.single)
        return made

    @cached_property
    def torch(self) -> Situation:
        """The batch, in torch."""
        made: Situation = in_torch(self.batch)
        return made

    def __len__(self) -> int:
        return len(self.single)

    def ask(
        self,
        name: str,
        situation: Situation,
        leaf: ConceptModel | Condition | None = None,
        seen: Seen | None = None,
    ) -> Any:
        """What a pure function answers.

        Args:
            name: Its name; ``act`` is the leaf's policy, ``holds`` a condition's answer.
            situation: One or a batch.
            leaf: Another leaf than the situations' own.
            seen: Another view of what is observed.
        """
        leaf = self.leaf if leaf is None else leaf
        asked = self.asked(situation, seen)
        if isinstance(leaf, Condition):
            return leaf.holds(asked.seen)
        return (ACT if name == "act" else QUESTIONS[name]).ask(leaf, asked)

    def asked(self, situation: Situation, seen: Seen | None = None) -> Asked:
        """What a function is given in a situation, one or a batch."""
        return Asked(
            Seen(situation.observation, self.world, self.robot, situation.elapsed) if seen is None else seen,
            situation.memory,
            Known(situation.hidden, self.world, situation.began),
        )

    def differences(
        self, name: str, leaf: ConceptModel | Condition | None = None, tolerance: float = TOLERANCE
    ) -> list[str]:
        """How the answers to batches, in NumPy and in torch, differ from those one by one."""
        import torch

        one_for_all = name in QUESTIONS and QUESTIONS[name].one_for_all
        one = [self.ask(name, s, leaf) for s in self.single]
        many, tensors = (self.ask(name, batch, leaf) for batch in (self.batch, self.torch))
        found = different(name, one, many, len(self), tolerance, one_for_all=one_for_all)
        return found + different(
            f"{name} in torch", one, tensors, len(self), tolerance, torch.Tensor, one_for_all
        )
