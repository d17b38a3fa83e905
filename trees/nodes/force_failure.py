"""Force failure: a SUCCESS counts as FAILURE."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.decorators import SuccessIsFailure

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, SUCCESS, NodePlace, PassesOn


def force_failure(child: Behaviour, *, name: str = "ForceFailure") -> SuccessIsFailure:
    """The child, whose SUCCESS counts as FAILURE.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return SuccessIsFailure(name, free_children(name, (child,))[0])


@register("tree node", "ForceFailure")
class ForceFailureKind(NodeKind[SuccessIsFailure]):
    """py_trees' SuccessIsFailure."""

    category = "Decorator"
    behaviour = SuccessIsFailure
    symbol = "✗"
    label = "force failure"
    helper = staticmethod(force_failure)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> SuccessIsFailure:
        """See `NodeKind.make`."""
        return force_failure(children[0], name=name)

    def compiled(self, node: SuccessIsFailure, place: NodePlace) -> PassesOn:
        """See `NodeKind.compiled`."""
        return PassesOn(place, {SUCCESS: FAILURE}, {SUCCESS: "success is failure{}"})
