"""Exceptions out of a tree: which node raised, where in the user's own file, and how all nodes end."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Generator
from typing import Any, NoReturn

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.leaf import ModelLeaf
from bt_tasksim.core.culprit import place_of, users_place
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
        except BaseException as error:
            if not is_leafs(error):
                raise
            raise InputError(
                f"'{node.name}' cannot be set up: {_said(error)}; "
                "a node's setup takes what there is to know by name: def setup(self, **kwargs)"
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
        _give_up(error, tree)


def stop(tree: Behaviour) -> None:
    """End a tree whose episode goes on, as `Behaviour.stop` does.

    Raises:
        LeafError: A node raised as it was ended; every node has ended.
    """
    try:
        tree.stop(Status.INVALID)
    except BaseException as error:
        _give_up(error, tree)


def clear(tree: Behaviour) -> None:
    """End a tree whose episode is over: a node that raises as it is ended changes nothing any more."""
    with contextlib.suppress(BtTasksimError):
        stop(tree)


def end_all(tree: Behaviour, culprit: Behaviour | None = None) -> None:
    """End every running node and the one that raised; py_trees' own `stop` misses some of them.

    Something is wrong already: what a node raises as it is ended is not told besides.
    """
    for node in tree.iterate():
        if node.status == Status.RUNNING or node is culprit:
            try:
                (node.terminate if node.children else node.stop)(Status.INVALID)
            except BaseException as error:
                if not is_leafs(error):
                    raise
            finally:
                node.status = Status.INVALID
                node.iterator = node.tick()


def _give_up(error: BaseException, tree: Behaviour) -> NoReturn:
    """End every node of a tree out of which an exception came, and raise it, as the error of its leaf's.

    Raises:
        BaseException: Always.
    """
    culprit = _raising_leaf(error, tree)
    end_all(tree, culprit)
    closed = isinstance(error, GeneratorExit) and culprit is None
    if isinstance(error, BtTasksimError) or closed or not is_leafs(error):
        raise error
    raise leaf_error(error, tree if culprit is None else culprit) from error


def no_status(node: Behaviour) -> LeafError:
    """The error that a tree has no status after its tick, as py_trees gives none to what returned none."""
    whose = ", ".join(filter(None, (type(node).__name__, place_of(type(node)))))
    return LeafError(
        f"leaf '{node.name}' ({whose}) has no status after its tick: update returns RUNNING, "
        "SUCCESS or FAILURE of py_trees.common.Status"
    )


def is_leafs(error: BaseException) -> bool:
    """Whether an exception says that the leaf that raised it is broken: it is an error, or would end Python.

    An interrupt says nothing about the leaf, nor does the exit of a signal's handler.
    """
    if not isinstance(error, SystemExit):
        return isinstance(error, Exception | GeneratorExit)
    handlers = {getattr(signal.getsignal(known), "__code__", None) for known in signal.valid_signals()}
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code in handlers:
            return False
        trace = trace.tb_next
    return True


def leaf_error(error: BaseException, node: Behaviour) -> LeafError:
    """The error that names the leaf that raised and, where it is the user's own, file and line.

    Where the exception comes from what the leaf gave to others, they are those of its class.
    """
    owner = type(getattr(node, "model", node))
    place = "" if users_place(error) else place_of(owner)
    whose = f" ({owner.__name__}, {place})" if place and isinstance(node, ModelLeaf) else ""
    return LeafError(f"leaf '{node.name}'{whose} raised {_said(error)}")


def _said(error: BaseException) -> str:
    """``ValueError in my_concept.py:12: too large``."""
    place = users_place(error)
    return f"{type(error).__name__}{f' in {place}' if place else ''}: {error}".removesuffix(": ")


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
