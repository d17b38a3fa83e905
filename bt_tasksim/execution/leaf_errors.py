"""Exceptions out of a tree: which node raised, where in the user's own file, and how all nodes end."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.culprit import users_place
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError


def set_up(tree: Behaviour, **arguments: Any) -> None:
    """Set all nodes of a tree up.

    Raises:
        InputError: A node's ``setup`` raised; says which.
        BtTasksimError: It found an error of its own kind.
    """
    for node in tree.iterate():
        try:
            node.setup(**arguments)
        except BtTasksimError:
            raise
        except Exception as error:
            place = users_place(error)
            raise InputError(
                f"'{node.name}' cannot be set up: {type(error).__name__}{f' in {place}' if place else ''}: "
                f"{error}; a node's setup takes what there is to know by name: def setup(self, **kwargs)"
            ) from error


def ticking(tree: Behaviour) -> Generator[Behaviour, None, None]:
    """One tick of a tree, node by node as it visits them.

    Raises:
        LeafError: A leaf raised; every node has ended.
        BtTasksimError: A leaf found an error of its own kind; every node has ended.
    """
    try:
        yield from tree.tick()
    except BaseException as error:
        culprit = _raising_leaf(error, tree)
        end_all(tree, culprit)
        if isinstance(error, BtTasksimError) or not isinstance(error, Exception):
            raise
        raise leaf_error(error, culprit.name if culprit is not None else tree.name) from error


def end_all(tree: Behaviour, culprit: Behaviour | None = None) -> None:
    """End every running node and the one that raised; py_trees' own `stop` misses some of them."""
    for node in tree.iterate():
        if node.status == Status.RUNNING or node is culprit:
            if not node.children:
                node.stop(Status.INVALID)
            else:
                node.terminate(Status.INVALID)
                node.status = Status.INVALID
                node.iterator = node.tick()


def no_status(node: Behaviour) -> LeafError:
    """The error that a tree has no status after its tick, as py_trees gives none to what returned none."""
    return LeafError(
        f"leaf '{node.name}' ({type(node).__name__}) has no status after its tick: update returns RUNNING, "
        "SUCCESS or FAILURE of py_trees.common.Status"
    )


def leaf_error(error: Exception, name: str) -> LeafError:
    """The error that names the leaf that raised and, where it is the user's own, file and line."""
    place = users_place(error)
    return LeafError(f"leaf '{name}' raised {type(error).__name__}{f' in {place}' if place else ''}: {error}")


def _raising_leaf(error: BaseException, tree: Behaviour) -> Behaviour | None:
    """The innermost behaviour of a tree in whose methods an exception was raised."""
    nodes = {id(node) for node in tree.iterate()}
    found = None
    trace = error.__traceback__
    while trace is not None:
        owner = trace.tb_frame.f_locals.get("self")
        if isinstance(owner, Behaviour) and id(owner) in nodes:
            found = owner
        trace = trace.tb_next
    return found
