"""Situations that pure functions are asked about: from real runs, changed at random, in batches, in torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from bt_tasksim.checking.bundles import TOLERANCE, different, joined, shapes
from bt_tasksim.checking.perturbation import changed_hidden, changed_memory, changed_observation
from bt_tasksim.checking.questions import QUESTIONS, Asked
from bt_tasksim.concept.functions import ConceptFunctions, any_of, sequence_of
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.core import facts
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, Observation
from bt_tasksim.robot.description import RobotDescription

_T = TypeVar("_T", Observation, Hidden)


class RecordedDecision(NamedTuple):
    """A leaf that is about to act in a real run, which is one world: all arrays are ``(1, ...)``.

    Attributes:
        leaf: The leaf.
        seen: What is seen.
        memory: Its memory.
        hidden: What only the simulator knows.
        began: The same when the leaf became active.
        first: It is the leaf's first one in this activation.
        run: Number of the run.
    """

    leaf: ConceptNode
    seen: Seen
    memory: Any
    hidden: Hidden
    began: Hidden
    first: bool = False
    run: int = 0


class Situation(NamedTuple):
    """What pure functions may be asked about, in ``N`` worlds."""

    observation: Observation
    hidden: Hidden
    began: Hidden
    elapsed: Array
    memory: Any
    world: WorldFacts

    def map(self, change: Callable[[Array], Array]) -> Situation:
        """The same, each array changed: taken by rows, or brought to another library."""
        observation, hidden, began, elapsed, memory = (mapped(change, part) for part in self[:-1])
        return Situation(observation, hidden, began, elapsed, memory, self.world.map(change))

    def at(self, rows: Array) -> Situation:
        """Some of the worlds, in any order."""
        return self.map(lambda values: values[rows])


def together(situations: Sequence[Situation]) -> Situation:
    """The worlds of several situations as one batch."""
    observation, hidden, began, elapsed, memory = (
        joined([situation[k] for situation in situations]) for k in range(5)
    )
    world = facts.joined([situation.world for situation in situations])
    return Situation(observation, hidden, began, elapsed, memory, world)


def perturbed(situation: Situation, rng: np.random.Generator, memory: bool = True) -> Situation:
    """A situation, changed at random: elsewhere, otherwise felt, at another time.

    Args:
        situation: The one that is changed.
        rng: Random numbers.
        memory: Change the memory too; it may then be one that never happens.
    """
    elapsed = situation.elapsed + rng.normal(scale=0.5, size=situation.elapsed.shape)
    return situation._replace(
        observation=changed_observation(situation.observation, rng),
        hidden=changed_hidden(situation.hidden, rng),
        elapsed=np.maximum(elapsed, 0.0),
        memory=changed_memory(situation.memory, rng) if memory else situation.memory,
    )


def alike(decisions: Sequence[RecordedDecision]) -> list[RecordedDecision]:
    """The most of them that can stand in one batch.

    What a concept remembers may differ in size from run to run, and a scene may have other objects.
    """
    groups: dict[object, list[RecordedDecision]] = {}
    for decision in decisions:
        situation, world = situation_of(decision), decision.seen.world
        names = tuple(world.columns.items()), tuple(world.place_columns.items())
        groups.setdefault((names, shapes(situation[:-1])), []).append(decision)
    return max(groups.values(), key=len, default=[])


def situation_of(decision: RecordedDecision) -> Situation:
    """The situation in which a decision was taken."""
    seen = decision.seen
    return Situation(
        whole(Observation, seen.observation),
        whole(Hidden, decision.hidden),
        whole(Hidden, decision.began),
        seen.elapsed,
        decision.memory,
        seen.world,
    )


def whole(kind: type[_T], bundle: _T) -> _T:
    """An observation or a hidden state whose arrays were made when they were looked at, all of them made."""
    made: _T = kind(**{field.name: getattr(bundle, field.name) for field in dataclasses.fields(kind)})
    return made


class Situations:
    """Situations of one concept, one world each, and all of them as a batch.

    Args:
        decisions: What a leaf of it decided on in real runs; not empty.
        seed: Of the changes.
        copies: How many changed copies there are of each.
        model: The concept that is asked; by default that of the decisions.
    """

    def __init__(
        self,
        decisions: Sequence[RecordedDecision],
        seed: int = 0,
        copies: int = 2,
        model: ConceptFunctions | None = None,
    ) -> None:
        rng = np.random.default_rng(seed)
        first = decisions[0]
        self.model: ConceptFunctions = first.leaf.model if model is None else model
        self.robot: RobotDescription = first.seen.robot
        self.period = first.seen.world.control_period
        """Seconds from one tick to the next."""
        self.single = [situation_of(d) for d in decisions]
        self.real = len(self.single)
        """So many are as they were; those after them are changed."""
        self.firsts = [s for s, d in zip(self.single, decisions, strict=True) if d.first]
        """Those in which the concept began, as they were."""
        self.single += [perturbed(s, rng) for s in self.single for _ in range(copies)]

    @cached_property
    def batch(self) -> Situation:
        """All of them as one batch; they can stand in one, see `alike`."""
        return together(self.single)

    @cached_property
    def torch(self) -> Situation:
        """The batch, in torch."""
        import torch

        return self.batch.map(lambda values: torch.from_numpy(np.array(values)))

    @cached_property
    def beginning(self) -> list[int]:
        """Positions of those in which the concept can begin."""
        return [k for k, situation in enumerate(self.single) if self._begins(situation)]

    def _begins(self, situation: Situation) -> bool:
        seen = self.asked(situation).seen
        try:
            unmet = sequence_of(self.model.initial_state(seen), type(self.model).__name__)
            if bool(any_of(seen.tool, unmet)[0]):
                return False
            self.model.begin(seen)
        except NoWayError:
            return False
        return True

    def __len__(self) -> int:
        return len(self.single)

    def ask(
        self,
        name: str,
        situation: Situation,
        model: ConceptFunctions | None = None,
        seen: Seen | None = None,
    ) -> Any:
        """What a pure function answers.

        Args:
            name: Its name.
            situation: What it is asked about.
            model: Another concept than the situations' own.
            seen: Another view of what is observed.
        """
        return QUESTIONS[name].ask(self.model if model is None else model, self.asked(situation, seen))

    def asked(self, situation: Situation, seen: Seen | None = None) -> Asked:
        """What a function is given in a situation."""
        return Asked(
            Seen(situation.observation, situation.world, self.robot, situation.elapsed)
            if seen is None
            else seen,
            situation.memory,
            Known(situation.hidden, situation.world, situation.began),
        )

    def asking(self, name: str) -> list[int]:
        """Positions of the situations in which a function is asked."""
        return self.beginning if name == "begin" else list(range(len(self)))

    def differences(
        self, name: str, model: ConceptFunctions | None = None, tolerance: float = TOLERANCE
    ) -> list[str]:
        """How the answers to batches, in NumPy and in torch, differ from those world by world."""
        import torch

        rows = np.array(self.asking(name))
        one = [self.ask(name, self.single[k], model) for k in rows]
        found = different(name, one, self.ask(name, self.batch.at(rows), model), tolerance)
        library = None if QUESTIONS[name].words else torch.Tensor
        tensors = self.ask(name, self.torch.at(torch.from_numpy(rows)), model)
        return found + different(f"{name} in torch", one, tensors, tolerance, library)
