"""The trees of a task: the one that people write, the one from its goals, and both with recovery."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from py_trees.behaviour import Behaviour

from benchmarks.any_tree.goals import Step
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.scene.specs import Goal
from bt_tasksim.trees import recovering, sequence, tidy

TREES = ("obvious", "recovering", "tidy", "tidy recovering")
"""What `tree_of` makes."""


def tree_of(steps: Sequence[Step], goals: Sequence[Any], kind: str, grasp: str | None = None) -> Behaviour:
    """A tree.

    Args:
        steps: What is done, in order.
        goals: What should be true.
        kind: One of `TREES`: ``obvious`` is grasp, pick, bring, place and release, object by object.
        grasp: Policy of its grasps; None for the pinned one.

    Raises:
        InputError: There is no such kind.
    """
    if kind not in TREES:
        raise InputError(f"unknown kind of tree '{kind}'{nearest(kind, TREES)}")
    if kind.startswith("tidy"):
        tree = tidy([goal for goal in goals if isinstance(goal, Goal)])
    else:
        tree = sequence("any tree", *(leaf for step in steps for leaf in _leaves(step, grasp)))
    return recovering(tree) if kind.endswith("recovering") else tree


def _leaves(step: Step, grasp: str | None) -> list[Behaviour]:
    policy = {} if grasp is None else {"policy": grasp}
    name, to = step.target, step.place
    where = {"anywhere": True} if step.goal.relation == "anywhere" else {}
    taken: list[Behaviour] = [Grasp(name, **policy), Pick(name), Bring(name, to=to, **where)]
    if step.drop:
        return [*taken, Release(name, into=to)]
    return [*taken, Place(name, on=to, **where), Release(name)]
