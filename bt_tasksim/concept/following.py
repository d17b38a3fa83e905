"""What may still follow a leaf in its tree, as far as sequences say."""

from __future__ import annotations

from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

ALL_IN_ANY_ORDER = "all_in_any_order"
"""Attribute of a composite all of whose children have to succeed, in an order that is found on the way."""


def following(leaf: Behaviour) -> tuple[Any, ...]:
    """The models of the leaves that may be ticked after a leaf has succeeded, in order.

    They are the later siblings in each sequence above it, and all siblings in a composite whose children may
    succeed in any order, done already or not (see `bt_tasksim.concept.seen.Seen.to_come`). What stands under
    a fallback is among them, since it may be ticked; a fallback's later children are none, since they are not
    ticked after a success.
    """
    found: list[Any] = []
    node = leaf
    while node.parent is not None:
        parent = node.parent
        place = next(k for k, child in enumerate(parent.children) if child is node)
        siblings = parent.children[place + 1 :] if isinstance(parent, Sequence) else []
        if getattr(parent, ALL_IN_ANY_ORDER, False):
            siblings = [*parent.children[place + 1 :], *parent.children[:place]]
        for sibling in siblings:
            models = (getattr(each, "model", None) for each in sibling.iterate())
            found += [model for model in models if model is not None]
        node = parent
    return tuple(found)
