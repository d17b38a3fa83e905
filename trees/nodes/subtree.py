"""Subtree: a tree within a tree, which its file keeps as a tree of its own."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.reporting import said_by
from bt_tasksim.core.outcomes import Statement
from bt_tasksim.trees.nodes.base import free_children
from bt_tasksim.trees.nodes.batch import NodePlace, PassesOn
from bt_tasksim.trees.nodes.pass_through import PassThrough


class SubTree(PassThrough):
    """A tree within a tree: passes ticks and statuses through. Its file keeps it as a tree of its own."""

    def update(self) -> Status:
        """The child's status."""
        self.report(said_by(self.decorated))
        return self.decorated.status


def subtree(name: str, root: Behaviour) -> SubTree:
    """A tree within a tree, which its file keeps as a tree of its own.

    Raises:
        InputError: The root is not a behaviour, or already has a parent.
    """
    return SubTree(name, free_children(name, (root,))[0])


def compiled(node: SubTree, place: NodePlace) -> BatchSubTree:
    """See `NodeKind.compiled`: a subtree is no kind of node, since its form in XML is another."""
    return BatchSubTree(place)


class BatchSubTree(PassesOn):
    """`SubTree` in many worlds at once."""

    def says(self, row: int) -> Statement | None:
        """What its child says."""
        return self.batch.reasons.said_by(self.place.children[0], row)
