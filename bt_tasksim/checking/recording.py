"""Real runs of a tree, decision by decision."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.checking.situations import RecordedDecision, whole
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.policy.policy import Action, Decidable, Policy, ProgrammedPolicy, ViewT
from bt_tasksim.scene.scene import WorldSource

LONGEST = 60.0
"""Seconds of a run, at most."""
HOLD = 6
"""Control periods for which an exploring action stays what it is."""


@dataclasses.dataclass
class Recording:
    """What was seen of some runs.

    Attributes:
        decisions: What each watched leaf decided on, by the leaf.
        ends: How each run ended, in one sentence.
        errors: What a run raised.
    """

    decisions: dict[ConceptNode, list[RecordedDecision]]
    ends: list[str]
    errors: list[BaseException]


class Spy:
    """A policy that notes what it is asked, and decides as another one does, or with other motions.

    Args:
        leaf: The leaf that it decides for.
        policy: The other one; None: nothing but exploring, with a completion signal now and then.
        runner: The runner of the tree.
        notes: Where it writes.
        explore: Seed of random motions; None: those of the other policy.
    """

    name, source = "spy", ""

    def __init__(
        self,
        leaf: ConceptNode,
        policy: Policy | None,
        runner: Runner,
        notes: list[RecordedDecision],
        explore: int | None = None,
    ) -> None:
        self.leaf = leaf
        self.policy, self.runner, self.notes = policy, runner, notes
        self.run = 0
        self._rng = None if explore is None else np.random.default_rng(explore)
        self._motion: Array = np.zeros((1, 0))
        self._held = 0
        self._activation = -1
        self._began: Hidden | None = None

    def act(self, model: Decidable[ViewT], seen: ViewT, memory: Any) -> Action:
        """See `bt_tasksim.policy.policy.Policy.act`."""
        if not isinstance(seen, Seen):
            raise TypeError(f"the spy on leaf '{self.leaf.name}' was asked outside of a tree")
        leaf = self.leaf
        hidden = self.runner.context.hidden()
        hidden = None if hidden is None else whole(Hidden, hidden)
        first = self._activation != leaf.activations
        if first:
            self._activation, self._began = leaf.activations, hidden
        if hidden is not None and self._began is not None:
            self.notes.append(RecordedDecision(leaf, seen, memory, hidden, self._began, first, self.run))
        if self.policy is not None and self._rng is None:
            return self.policy.act(model, seen, memory)
        rng = self._rng or np.random.default_rng(0)
        if self._held % HOLD == 0:
            self._motion = rng.uniform(-1.0, 1.0, (1, model.actions))
        self._held += 1
        if self.policy is not None:
            terminate = self.policy.act(model, seen, memory).terminate
        else:
            terminate = rng.random(1) < 0.01
        return Action(self._motion, terminate)


def record(
    tree: Behaviour,
    scene: WorldSource,
    watched: Sequence[type[ConceptModel]] | None = None,
    seeds: Sequence[int] = (1,),
    explore: bool = False,
    stream: str = "evaluation",
    options: EngineOptions | None = None,
) -> Recording:
    """Run a tree in draws of its scene, and note what its leaves decide on.

    Args:
        tree: The tree.
        scene: The scene.
        watched: Concepts whose leaves are watched, with their programmed policies; None: all, with the
            policies that they have.
        seeds: A run for each.
        explore: From the second run on, leaves that can learn make random motions.
        stream: Stream of the draws; those of ``training`` are from the scene's last stage, where it has any.
        options: Which engines.
    """
    runner = Runner(tree, scene, options or EngineOptions(), longest=LONGEST)
    leaves = [leaf for leaf in tree.iterate() if isinstance(leaf, ConceptNode)]
    out = Recording({}, [], [])
    kept: list[tuple[ConceptNode, Policy]] = []
    spies: list[Spy] = []
    for leaf in leaves:
        if watched is not None and type(leaf.model) not in watched:
            continue
        policy: Policy | None
        if watched is None:
            policy = leaf.policy_in_use
            kept.append((leaf, policy))
        else:
            policy = ProgrammedPolicy() if leaf.model.is_programmed else None
        notes = out.decisions.setdefault(leaf, [])
        spies.append(Spy(leaf, policy, runner, notes))
        leaf.use(spies[-1])
    stage = len(scene.stages) - 1 if stream == "training" and scene.stages else None
    for number, seed in enumerate(seeds):
        for spy in spies:
            spy.run = number
            if explore and number > 0:
                spy._rng = np.random.default_rng(seed)
        try:
            configuration = clear_draw(scene, seed, stream, runner.robot, stage, runner.pipeline.real)
            result = runner.finish(configuration, runner.reset(configuration))
            out.ends.append(result.why)
        except BtTasksimError as error:
            out.errors.append(error)
            out.ends.append(str(error))
    for leaf, policy in kept:
        leaf.use(policy)
    return out
