"""Whether what a tree asks of parts of furniture is what they can do in its scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour

from bt_tasksim.checking.part_kinds import Mover, is_asked, of_other_kind, what_to_do
from bt_tasksim.checking.part_values import asks_for_a_value, beyond
from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.concept.leaf import ModelLeaf
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.joints import JointModel

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import WorldSource

DRAWS = 10
"""Worlds of the scene in which it is asked: how far a part goes may be drawn."""
LESS = "ask for less, or for furniture that goes farther"
WITHIN = "ask for a value between these"


@dataclass
class _Leaf:
    """A leaf of the tree, and why it cannot be done: what is wrong and what to do, for each draw with that.

    Attributes:
        name: What it is called in findings.
        model: Its model.
        guarded: The tree asks how the part moves.
        reasons: What was found.
    """

    name: str
    model: Any
    guarded: bool
    reasons: list[tuple[str, str]] = field(default_factory=list)


def check_parts(tree: Behaviour, scene: WorldSource, report: Report) -> None:
    """Every leaf that moves a part of furniture is for such parts, and asks for no more than they can do.

    Conditions, likewise, ask for no values that a part cannot have.

    Args:
        tree: The tree.
        scene: Its scene.
        report: Where findings go.
    """
    leaves = _leaves(tree)
    drawn = 0
    for seed in range(DRAWS) if leaves else ():
        try:
            world = scene.sample(seed)
        except InputError:
            continue  # the check of the scene says so
        drawn += 1
        joints = {actor.name: actor.model().joint for actor in world.objects}
        for leaf in leaves:
            if leaf.model.target in joints and (why := _wrong(leaf, joints[leaf.model.target])):
                leaf.reasons.append(why)
    for leaf in leaves:
        if leaf.reasons:
            level = ERROR if len(leaf.reasons) == drawn else WARNING
            sentence, remedy = leaf.reasons[0]
            how = "cannot be done" if isinstance(leaf.model, Mover) else "makes no sense"
            what = f"{how} in {len(leaf.reasons)} of {drawn} draws: {sentence}"
            report.add(level, "tree", leaf.name, what, remedy)


def _leaves(tree: Behaviour) -> Sequence[_Leaf]:
    """What moves parts or compares them with a value.

    Those of the same name are told apart by which leaf of the tree they are.
    """
    last = [node for node in tree.iterate() if not node.children]
    every = [(k, leaf) for k, leaf in enumerate(last, 1) if isinstance(leaf, ModelLeaf)]
    asked = [(k, n) for k, n in every if isinstance(n.model, Mover) or asks_for_a_value(n.model)]
    called = Counter(n.name for _, n in asked)
    models = [n.model for _, n in every]
    return [
        _Leaf(n.name if called[n.name] == 1 else f"{n.name} (leaf {k})", n.model, is_asked(n.model, models))
        for k, n in asked
    ]


def _wrong(leaf: _Leaf, joint: JointModel | None) -> tuple[str, str] | None:
    """What is wrong with a leaf for a part with such a joint, and what to do."""
    if isinstance(leaf.model, Mover):
        if why := of_other_kind(leaf.model, joint):
            return None if leaf.guarded else (why, what_to_do(leaf.model, joint))
    elif leaf.guarded:
        return None
    if joint is not None and (why := beyond(leaf.model, joint)):
        return why, LESS if isinstance(leaf.model, Mover) else WITHIN
    return None
