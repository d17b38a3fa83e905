"""Whether anything acts below a node: what fails before that has changed nothing."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status


def acts(node: Behaviour) -> bool:
    """A leaf, at or below a node, is RUNNING: it moves something, or lets time pass.

    A concept that refuses to begin, such as a grasp that finds no way, is never RUNNING; nor is a condition,
    nor what stands below a retry that waits for the next tick. A concept that still plans, as on a robot,
    does not act yet.
    """
    return any(
        below.status == Status.RUNNING and not below.children and not getattr(below, "plans", False)
        for below in node.iterate()
    )
