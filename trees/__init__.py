"""Behaviour trees: helpers to write them, their check, and their XML form.

Names are imported when they are first used, so that ``import trees`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from bt_tasksim._names import one_module

if TYPE_CHECKING:
    from bt_tasksim.trees.check import check_tree
    from bt_tasksim.trees.equality import same_tree
    from bt_tasksim.trees.from_goals import tidy
    from bt_tasksim.trees.nodes.any_order import any_order
    from bt_tasksim.trees.nodes.fallback import fallback
    from bt_tasksim.trees.nodes.force_failure import force_failure
    from bt_tasksim.trees.nodes.force_success import force_success
    from bt_tasksim.trees.nodes.inverter import invert
    from bt_tasksim.trees.nodes.parallel import parallel
    from bt_tasksim.trees.nodes.reactive_fallback import reactive_fallback
    from bt_tasksim.trees.nodes.reactive_sequence import reactive_sequence
    from bt_tasksim.trees.nodes.repeat import repeat
    from bt_tasksim.trees.nodes.retry import retry
    from bt_tasksim.trees.nodes.retry_while_acting import retry_while_acting
    from bt_tasksim.trees.nodes.sequence import sequence
    from bt_tasksim.trees.nodes.subtree import subtree
    from bt_tasksim.trees.nodes.timeout import timeout
    from bt_tasksim.trees.recovery import recovering
    from bt_tasksim.trees.xml_reader import load_tree, scene_of_tree, tree_from_xml
    from bt_tasksim.trees.xml_writer import node_models, save_tree, tree_to_xml

one_module(__name__)

_HOMES = {
    "bt_tasksim.trees.check": ("check_tree",),
    "bt_tasksim.trees.nodes.subtree": ("subtree",),
    "bt_tasksim.trees.xml_reader": ("load_tree", "tree_from_xml", "scene_of_tree"),
    "bt_tasksim.trees.xml_writer": ("save_tree", "tree_to_xml", "node_models"),
    "bt_tasksim.trees.equality": ("same_tree",),
    "bt_tasksim.trees.from_goals": ("tidy",),
    "bt_tasksim.trees.recovery": ("recovering",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "sequence",
    "fallback",
    "reactive_sequence",
    "reactive_fallback",
    "parallel",
    "any_order",
    "retry",
    "retry_while_acting",
    "repeat",
    "timeout",
    "invert",
    "force_success",
    "force_failure",
    "subtree",
    "tidy",
    "recovering",
    "check_tree",
    "load_tree",
    "tree_from_xml",
    "scene_of_tree",
    "save_tree",
    "tree_to_xml",
    "node_models",
    "same_tree",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    if not name.startswith("_"):
        from bt_tasksim.trees.vocabulary import helpers, like_helper

        helper = helpers().get(name)
        if helper is not None:
            return helper
        raise AttributeError(f"module 'trees' has no attribute '{name}'{like_helper(name)}")
    raise AttributeError(f"module 'trees' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
