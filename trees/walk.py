"""The order of a tree's nodes, as files, logs and pictures have it."""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.behaviour import Behaviour


def preorder(root: Behaviour) -> Iterator[tuple[int, Behaviour]]:
    """Depth and node: parents before their children, these from left to right.

    py_trees' own `iterate` has children first. A loop, so that a tree may be as deep as it likes.
    """
    stack = [(0, root)]
    while stack:
        depth, node = stack.pop()
        yield depth, node
        stack.extend((depth + 1, child) for child in reversed(node.children))


def nodes_of(root: Behaviour) -> list[Behaviour]:
    """A tree's nodes in that order."""
    return [node for _, node in preorder(root)]
