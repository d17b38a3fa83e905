"""Inverter: SUCCESS and FAILURE exchanged."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.decorators import Inverter

from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, SUCCESS, NodePlace, PassesOn


def invert(child: Behaviour, *, name: str = "Inverter") -> Inverter:
    """The child, with SUCCESS and FAILURE exchanged.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return Inverter(name, free_children(name, (child,))[0])


@register("tree node", "Inverter")
class InverterKind(NodeKind[Inverter]):
    """py_trees' Inverter."""

    category = "Decorator"
    behaviour = Inverter
    symbol = "¬"
    label = "not"
    helper = staticmethod(invert)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Inverter:
        """See `NodeKind.make`."""
        return invert(children[0], name=name)

    def compiled(self, node: Inverter, place: NodePlace) -> PassesOn:
        """See `NodeKind.compiled`."""
        return PassesOn(
            place,
            {SUCCESS: FAILURE, FAILURE: SUCCESS},
            {SUCCESS: "success -> failure", FAILURE: "failure -> success"},
        )
