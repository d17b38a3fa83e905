"""Helpers to write a tree in a few readable lines, and the check that a tree makes sense.

Every helper returns a py_trees behaviour, so trees mix freely with plain py_trees. Semantics are those of the
nodes of BehaviorTree.CPP v4 with the same names; `trees.xml_writer` writes them as such.
"""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.composites import Composite, Selector, Sequence
from py_trees.composites import Parallel as PyTreesParallel
from py_trees.decorators import Decorator, FailureIsSuccess, Inverter, SuccessIsFailure

from bt_tasksim.concept import ConceptNode
from bt_tasksim.errors import InputError
from trees.decorators import Parallel, Repeat, Retry, SubTree, Timeout

DEEPEST = 200
"""Levels of nodes that a tree may have."""


def sequence(name: str, *children: Behaviour) -> Sequence:
    """One child after the other; goes on where it stood; fails with the first child that fails.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Sequence(name, memory=True, children=_free(name, children))


def fallback(name: str, *children: Behaviour) -> Selector:
    """One child after the other until one succeeds; goes on where it stood.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Selector(name, memory=True, children=_free(name, children))


def reactive_sequence(name: str, *children: Behaviour) -> Sequence:
    """A sequence that asks its conditions again at every tick; only its last child may act.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Sequence(name, memory=False, children=_free(name, children))


def reactive_fallback(name: str, *children: Behaviour) -> Selector:
    """A fallback that asks its conditions again at every tick; only its last child may act.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return Selector(name, memory=False, children=_free(name, children))


def parallel(name: str, *children: Behaviour, success: int = -1, failure: int = 1) -> Parallel:
    """All children in every tick, until enough have succeeded or failed.

    Args:
        name: The node's name.
        children: Its children.
        success: How many have to succeed; negative counts from all: -1 is all, -2 all but one.
        failure: How many failures make it fail; negative counts likewise.

    Raises:
        InputError: A child is not a behaviour or already has a parent, or a count does not fit.
    """
    return Parallel(name, _free(name, children), success_count=success, failure_count=failure)


def retry(attempts: int, child: Behaviour, *, name: str = Retry.default_name) -> Retry:
    """The child, up to so many times until it succeeds; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return Retry(name, _free(name, (child,))[0], attempts)


def repeat(times: int, child: Behaviour, *, name: str = Repeat.default_name) -> Repeat:
    """The child so many times in a row, unless it fails; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return Repeat(name, _free(name, (child,))[0], times)


def timeout(seconds: float, child: Behaviour, *, name: str = Timeout.default_name) -> Timeout:
    """The child, which is stopped and fails after so many seconds of episode time.

    Raises:
        InputError: The time does not fit, or the child already has a parent.
    """
    return Timeout(name, _free(name, (child,))[0], seconds)


def invert(child: Behaviour, *, name: str = "Inverter") -> Inverter:
    """The child, with SUCCESS and FAILURE exchanged.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return Inverter(name, _free(name, (child,))[0])


def force_success(child: Behaviour, *, name: str = "ForceSuccess") -> FailureIsSuccess:
    """The child, whose FAILURE counts as SUCCESS.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return FailureIsSuccess(name, _free(name, (child,))[0])


def force_failure(child: Behaviour, *, name: str = "ForceFailure") -> SuccessIsFailure:
    """The child, whose SUCCESS counts as FAILURE.

    Raises:
        InputError: The child is not a behaviour, or already has a parent.
    """
    return SuccessIsFailure(name, _free(name, (child,))[0])


def subtree(name: str, root: Behaviour) -> SubTree:
    """A tree within a tree, which its file keeps as a tree of its own.

    Raises:
        InputError: The root is not a behaviour, or already has a parent.
    """
    return SubTree(name, _free(name, (root,))[0])


def check_tree(root: Behaviour) -> None:
    """Check that a tree makes sense; call it before the first tick.

    Refused are: a node that stands in two places or among its own descendants, more than 200 levels, a
    composite without children, and a concept that would be started anew at every tick after it has finished.
    The last happens below nodes that tick finished children again: in a sequence or fallback without memory
    (its reactive form) concepts may stand in the last child only, the earlier children may hold conditions;
    and in py_trees' own Parallel without ``synchronise`` there may be none. The last child of a reactive
    node may be one concept or a composite with memory that holds several.

    Raises:
        InputError: The tree is refused; the sentence names the nodes.
    """
    problem = find_problem(root)
    if problem is not None:
        raise InputError(problem[1])


def find_problem(root: Behaviour) -> tuple[Behaviour, str] | None:
    """The first node that `check_tree` would refuse, with the sentence that says why; None if all is well."""
    return _problem_of_shape(root) or _problem_of_memory(root)


def _free(owner: str, children: tuple[Behaviour, ...]) -> list[Behaviour]:
    if not isinstance(owner, str):
        raise InputError(f"a node's name should be text, found {owner!r}: the name comes before the children")
    seen = set()
    for child in children:
        if not isinstance(child, Behaviour):
            raise InputError(f"'{owner}': a child should be a behaviour, found {child!r}")
        if child.parent is not None or id(child) in seen:
            where = child.parent.name if child.parent is not None else owner
            raise InputError(
                f"'{owner}': node '{child.name}' already stands under '{where}'; make a second one instead"
            )
        seen.add(id(child))
    return list(children)


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
                return node, (
                    f"{_kind(node)} '{node.name}' has no memory and would start '{concept.name}' anew at "
                    f"every tick after it has finished: use a node with memory, or put '{child.name}' last"
                )
    return None


def _ticked_again(node: Behaviour) -> Iterator[Behaviour]:
    """The children that are ticked again after they have finished, while others still run."""
    if isinstance(node, Sequence | Selector) and not node.memory:
        yield from node.children[:-1]
    elif isinstance(node, PyTreesParallel) and not (
        node.policy.synchronise or isinstance(node.policy, ParallelPolicy.SuccessOnOne)
    ):
        yield from node.children


def _kind(node: Behaviour) -> str:
    match node:
        case Sequence():
            return "sequence" if node.memory else "reactive sequence"
        case Selector():
            return "fallback" if node.memory else "reactive fallback"
        case Composite():
            return type(node).__name__.lower()
        case Decorator():
            return f"decorator {type(node).__name__}"
        case _:
            return type(node).__name__
