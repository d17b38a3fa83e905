"""The check that a tree makes sense."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping

import py_trees.decorators
import py_trees.timers
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.composites import Composite, Selector, Sequence
from py_trees.composites import Parallel as PyTreesParallel
from py_trees.decorators import Decorator

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import BtTasksimWarning, InputError
from bt_tasksim.trees.vocabulary import kind_of

DEEPEST = 200
"""Levels of nodes that a tree may have."""


WALL_CLOCKS: Mapping[type[Behaviour], str] = {
    py_trees.decorators.Timeout: "timeout(...) of trees",
    py_trees.timers.Timer: "Wait(...) of concept_nodes",
}
"""Nodes of py_trees that ask the wall clock, and what to use instead."""


def check_tree(root: Behaviour) -> None:
    """Check that a tree makes sense; call it before the first tick.

    Refused are: a node that stands in two places or among its own descendants, more than 200 levels, a
    composite without children, and a concept that would be started anew at every tick after it has finished.
    The last happens below nodes that tick finished children again: in a sequence or fallback without memory
    (its reactive form) concepts may stand in the last child only, the earlier children may hold conditions;
    and in py_trees' own Parallel without ``synchronise`` there may be none. The last child of a reactive
    node may be one concept or a composite with memory that holds several.

    py_trees' own Timeout and Timer are warned of: they count wall-clock time, of which a single simulation
    needs hardly any and a batch of many more, and which is another one in each run of the same seed.

    Raises:
        InputError: The tree is refused; the sentence names the nodes.
    """
    problem = find_problem(root)
    if problem is not None:
        raise InputError(problem[1])
    for node in root.iterate():
        for clock, instead in WALL_CLOCKS.items():
            if isinstance(node, clock):
                warnings.warn(
                    f"'{node.name}' is py_trees' own {clock.__name__}, which counts wall-clock time: in one "
                    f"world it ends late, among the many of a batch early, and at another time in each run; "
                    f"use {instead}, which counts episode time",
                    BtTasksimWarning,
                    stacklevel=2,
                )


def find_problem(root: Behaviour) -> tuple[Behaviour, str] | None:
    """The first node that `check_tree` would refuse, with the sentence that says why; None if all is well."""
    return _problem_of_shape(root) or _problem_of_memory(root)


def _problem_of_shape(root: Behaviour) -> tuple[Behaviour, str] | None:
    seen: set[int] = set()
    path: set[int] = set()
    stack: list[tuple[Behaviour, bool]] = [(root, True)]
    while stack:
        node, entering = stack.pop()
        if not entering:
            path.remove(id(node))
            continue
        if id(node) in path:
            return node, f"node '{node.name}' stands among its own descendants"
        if id(node) in seen:
            return node, f"node '{node.name}' stands in two places of the tree; make a second one instead"
        if len(path) >= DEEPEST:
            return node, f"the tree has more than {DEEPEST} levels, at node '{node.name}'"
        if isinstance(node, Composite) and not node.children:
            return node, f"{_kind(node)} '{node.name}' has no children"
        seen.add(id(node))
        path.add(id(node))
        stack.append((node, False))
        stack.extend((child, True) for child in reversed(node.children))
    return None


def _acting(root: Behaviour) -> dict[int, ConceptNode]:
    """For each node that holds concepts, the first of them."""
    acting: dict[int, ConceptNode] = {}
    for node in root.iterate():  # children come before their parents
        if isinstance(node, ConceptNode):
            acting[id(node)] = node
            continue
        for child in node.children:
            if id(child) in acting:
                acting[id(node)] = acting[id(child)]
                break
    return acting


def _problem_of_memory(root: Behaviour) -> tuple[Behaviour, str] | None:
    acting = _acting(root)
    for node in root.iterate():
        for child in _ticked_again(node):
            concept = acting.get(id(child))
            if concept is not None:
                advice = (
                    "give its policy synchronise=True"
                    if isinstance(node, PyTreesParallel)
                    else f"use a node with memory, or put '{child.name}' last"
                )
                return node, (
                    f"{_kind(node)} '{node.name}' has no memory and would start '{concept.name}' anew at "
                    f"every tick after it has finished: {advice}"
                )
    return None


def _ticked_again(node: Behaviour) -> Iterator[Behaviour]:
    """The children that are ticked again after they have finished, while others still run."""
    kind = kind_of(node)
    if kind is not None:
        yield from kind.ticked_again(node)
    elif isinstance(node, Sequence | Selector) and not node.memory:
        yield from node.children[:-1]
    elif isinstance(node, PyTreesParallel) and not (
        node.policy.synchronise or isinstance(node.policy, ParallelPolicy.SuccessOnOne)
    ):
        yield from node.children


def _kind(node: Behaviour) -> str:
    kind = kind_of(node)
    if kind is not None and kind.category == "Control":
        return kind.label
    if isinstance(node, Composite):
        return type(node).__name__.lower()
    return f"decorator {type(node).__name__}" if isinstance(node, Decorator) else type(node).__name__
