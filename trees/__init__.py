"""Behaviour trees: helpers to write them, their check, and their XML form.

Names are imported when they are first used, so that ``import trees`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trees.authoring import (
        check_tree,
        fallback,
        force_failure,
        force_success,
        invert,
        parallel,
        reactive_fallback,
        reactive_sequence,
        repeat,
        retry,
        sequence,
        subtree,
        timeout,
    )
    from trees.equality import same_tree
    from trees.xml_reader import load_tree, scene_of_tree, tree_from_xml
    from trees.xml_writer import node_models, save_tree, tree_to_xml

_HOMES = {
    "trees.authoring": (
        "sequence",
        "fallback",
        "reactive_sequence",
        "reactive_fallback",
        "parallel",
        "retry",
        "repeat",
        "timeout",
        "invert",
        "force_success",
        "force_failure",
        "subtree",
        "check_tree",
    ),
    "trees.xml_reader": ("load_tree", "tree_from_xml", "scene_of_tree"),
    "trees.xml_writer": ("save_tree", "tree_to_xml", "node_models"),
    "trees.equality": ("same_tree",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "sequence",
    "fallback",
    "reactive_sequence",
    "reactive_fallback",
    "parallel",
    "retry",
    "repeat",
    "timeout",
    "invert",
    "force_success",
    "force_failure",
    "subtree",
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
    raise AttributeError(f"module 'trees' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
