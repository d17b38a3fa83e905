"""Whether what a tree asks of parts of furniture is within the way that they go in its scene."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept_nodes.on_joint import OnJoint
from bt_tasksim.core.errors import InputError

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import WorldSource

DRAWS = 10
"""Worlds of the scene in which it is asked: how far a part goes may be drawn."""


def check_parts(tree: Behaviour, scene: WorldSource, report: Report) -> None:
    """Every leaf that moves a part of furniture asks for what the part can do, wherever it stands before.

    Args:
        tree: The tree.
        scene: Its scene.
        report: Where findings go.
    """
    movers = [(n.name, n.model) for n in tree.iterate() if isinstance(n, ConceptNode)]
    asked = [(name, model) for name, model in movers if isinstance(model, OnJoint)]
    found: defaultdict[str, list[str]] = defaultdict(list)
    drawn = 0
    for seed in range(DRAWS) if asked else ():
        try:
            world = scene.sample(seed)
        except InputError:
            continue  # the check of the scene says so
        drawn += 1
        joints = {actor.name: actor.model().joint for actor in world.objects}
        for name, model in asked:
            joint = joints.get(model.target)
            if joint is not None and (why := model.beyond_its_way(joint)):
                found[name].append(why)
    for name, reasons in found.items():
        level = ERROR if len(reasons) == drawn else WARNING
        what = f"cannot be done in {len(reasons)} of {drawn} draws: {reasons[0]}"
        report.add(level, "tree", name, what, "ask for less, or for furniture that goes farther")
