"""Force success: a FAILURE counts as SUCCESS."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.decorators import FailureIsSuccess

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, SUCCESS, NodePlace, PassesOn


def force_success(child: Behaviour, *, name: str = "ForceSuccess") -> FailureIsSuccess:
    """The child, whose FAILURE counts as SUCCESS.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return FailureIsSuccess(name, free_children(name, (child,))[0])


@register("tree node", "ForceSuccess")
class ForceSuccessKind(NodeKind[FailureIsSuccess]):
    """py_trees' FailureIsSuccess."""

    category = "Decorator"
    behaviour = FailureIsSuccess
    symbol = "✓"
    label = "force success"
    helper = staticmethod(force_success)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> FailureIsSuccess:
        """See `NodeKind.make`."""
        return force_success(children[0], name=name)

    def compiled(self, node: FailureIsSuccess, place: NodePlace) -> PassesOn:
        """See `NodeKind.compiled`."""
        return PassesOn(place, {FAILURE: SUCCESS}, {FAILURE: "failure is success{}"})
